//! How long an arm may take to stop, by its limits alone.
use crate::{Fault, Faults, Robot};
use taustream_motion::stopping::stop_duration_s;

/// Longest stop of an arm whose settings do not say otherwise, s.
pub const STOP_S_MAX: f64 = 1.0;

impl Robot {
    /// How long a stop takes at most, s, whatever motion inside the motion limits runs; infinite when the stop limits leave no
    /// room above the motion limits.
    #[must_use]
    pub fn stop_s(&self) -> f64 {
        stop_duration_s(&self.limits(), self.joints.len())
    }

    /// Refuses an arm that cannot stop in time. Nothing shortens a stop beyond what the limits say.
    ///
    /// # Errors
    /// The joint that takes longest, when that is more than `stop_s_max`.
    pub fn require_stops(&self, stop_s_max: f64) -> Result<(), Faults> {
        let limits = self.limits();
        let alone_s = |joint: usize| {
            let mut alone = limits;
            alone.rotate_left(joint);
            stop_duration_s(&alone, 1)
        };
        // Of equal ones the first is named.
        let slowest = (0..self.joints.len()).rev().map(|joint| (joint, alone_s(joint)));
        let Some((joint, stop_s)) = slowest.max_by(|a, b| a.1.total_cmp(&b.1)) else { return Ok(()) };
        if stop_s <= stop_s_max {
            return Ok(());
        }
        let name = self.joints.get(joint).map_or("?", |joint| joint.name.as_str());
        let value = format!("a stop of joint {name} takes up to {stop_s:.3} s");
        let expected = format!(
            "at most {stop_s_max} s: raise what its stop limits leave above its motion limits (acceleration and jerk), or lower its \
             velocity; supervision.stop_s_max of a settings file accepts more"
        );
        Err(Faults(vec![Fault::new(&self.file, &format!("joint[{joint}].stop"), &value, &expected)]))
    }
}
