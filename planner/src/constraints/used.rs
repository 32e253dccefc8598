//! How much of its constraints a proven motion uses, for people.
use super::{TipRules, tilt_rad};
use taustream_motion::Trajectory;

/// The largest values of dense samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipUse {
    /// Angle between the tip's axis and its direction; `None` where that is free.
    pub tilt_rad: Option<f64>,
    /// Least distance to a side of the tip's box; `None` where there is none.
    pub inside_m: Option<f64>,
    /// Speed of the tip's origin.
    pub speed_m_s: f64,
    /// How many zones with a speed limit the scene has.
    pub zones: usize,
}

const SAMPLES: u32 = 4_000;

impl TipRules<'_> {
    /// What a motion uses.
    #[must_use]
    pub fn used(&self, motion: &Trajectory) -> TipUse {
        let mut used = TipUse {
            tilt_rad: self.asked.upright.map(|_| 0.0),
            inside_m: self.asked.inside.map(|_| f64::INFINITY),
            speed_m_s: 0.0,
            zones: self.zones.len(),
        };
        for i in 0..=SAMPLES {
            let setpoint = motion.sample(motion.duration_s() * f64::from(i) / f64::from(SAMPLES));
            let (tip, columns) = self.chain().jacobian(self.frame, &setpoint.position_rad);
            if let (Some(most), Some(upright)) = (&mut used.tilt_rad, &self.asked.upright) {
                *most = most.max(tilt_rad(upright, &tip));
            }
            if let Some(least) = &mut used.inside_m {
                *least = least.min(self.spare(&tip).inside_m);
            }
            let velocity = columns.iter().zip(&setpoint.velocity_rad_s).map(|(c, v)| c.linear_m * *v);
            used.speed_m_s = used.speed_m_s.max(velocity.sum::<nalgebra::Vector3<f64>>().norm());
        }
        used
    }
}
