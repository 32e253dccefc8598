//! What a motion asks of the drives, as summaries show it.
use serde::Serialize;
use std::fmt;
use taustream_arm::Robot;
use taustream_motion::Trajectory;
use taustream_planner::torque::{TorqueLimits, Unchecked};

/// What one joint has to bear at most.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct TorqueUse {
    joint: String,
    torque_nm: f64,
    at_s: f64,
    /// Null for a joint that states none.
    torque_nm_max: Option<f64>,
    /// "N" for a prismatic joint, whose numbers above are forces; left out where they are Nm.
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<&'static str>,
}

/// The torques of a motion, or why nobody knows them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Torques {
    /// One entry a joint; empty where torques are not checked.
    pub(crate) torque_use: Vec<TorqueUse>,
    /// Why torques are not checked; null where they are.
    pub(crate) torque_unchecked: Option<String>,
    /// Why energies and torques by the stated masses are too low; null where the masses may be right.
    pub(crate) mass_doubt: Option<String>,
}

impl Torques {
    /// Of a motion that was proven, so that no joint is beyond its torque.
    pub(crate) fn of(robot: &Robot, motion: &Trajectory) -> Self {
        let mass_doubt = robot.mass_doubt();
        let unchecked = |why: String| Self {
            torque_use: Vec::new(),
            torque_unchecked: Some(why),
            mass_doubt: mass_doubt.clone(),
        };
        let limits = match TorqueLimits::of(robot) {
            Ok(limits) => limits,
            Err(why) => return unchecked(why.to_string()),
        };
        match limits.prove(motion) {
            Err(overload) => unchecked(overload.to_string()),
            Ok(peaks) => {
                let joints = robot.joints.iter().zip(peaks).map(|(joint, peak)| TorqueUse {
                    joint: joint.name.clone(),
                    torque_nm: peak.torque_nm,
                    at_s: peak.at_s,
                    torque_nm_max: joint.torque_nm_max,
                    unit: joint.kind.is_prismatic().then(|| joint.kind.force_unit()),
                });
                Self { torque_use: joints.collect(), torque_unchecked: None, mass_doubt }
            }
        }
    }
}

impl fmt::Display for Torques {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |use_: &TorqueUse| use_.torque_nm_max.map(|max| use_.torque_nm / max);
        let most = self.torque_use.iter().filter_map(|use_| Some((share(use_)?, use_)));
        if let Some((share, use_)) = most.max_by(|a, b| a.0.total_cmp(&b.0)) {
            writeln!(
                f,
                "torque        at most {:.0} % of what a joint can: {:.1} {} of {} at t = {:.3} s",
                100.0 * share,
                use_.torque_nm,
                use_.unit.unwrap_or("Nm"),
                use_.joint,
                use_.at_s
            )?;
        }
        // Without limits or masses nothing was promised; doubtful masses are said where energies are.
        let is_silent = [Unchecked::NoLimits, Unchecked::NoMasses].map(|why| why.to_string());
        match (&self.torque_unchecked, &self.mass_doubt) {
            (_, Some(doubt)) => writeln!(f, "WARNING       {doubt}"),
            (Some(why), None) if !is_silent.contains(why) => writeln!(f, "torque        {why}"),
            (Some(_) | None, None) => Ok(()),
        }
    }
}
