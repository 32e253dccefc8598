//! What one history leaves to be checked.
use crate::harness::JOINTS;
use taustream_messages::Phase;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Trajectory};

/// A trajectory that was accepted.
#[derive(Clone, Debug)]
pub struct Motion {
    pub id: u64,
    /// The one that it cuts; 0 for none.
    pub cuts: u64,
    pub trajectory: Trajectory,
    /// Trajectory time of its cut; none from rest.
    pub cut_s: Option<f64>,
    /// From which trajectory time it is sampled.
    pub from_s: f64,
}

/// One cycle that sent setpoints, as the streamer logs it.
#[derive(Clone, Copy, Debug)]
pub struct Cycle {
    pub tick: u64,
    pub phase: Phase,
    /// The trajectory that made the setpoint; 0 for none.
    pub id: u64,
    pub s: f64,
    pub sigma: f64,
    pub position_rad: JointArray,
    pub off_path_rad: JointArray,
    pub sent: bool,
}

/// Everything that is checked of a history.
#[derive(Clone, Debug)]
pub struct Log {
    pub limits: [JointLimits; MAX_JOINTS],
    pub period_s: f64,
    /// Longest stop of the arm, cycles.
    pub stop_cycles: u64,
    /// The setpoints that have reached each drive, with the cycle that sent them.
    pub drives: [Vec<(u64, f64)>; JOINTS],
    pub cycles: Vec<Cycle>,
    pub motions: Vec<Motion>,
    /// Messages that were spoiled or too late, and accepted all the same.
    pub swallowed: Vec<String>,
    /// Messages that were refused.
    pub refused: usize,
    pub stalls: usize,
    pub guard_trips: u64,
    pub faulted: bool,
    /// The phase at the end.
    pub end: Phase,
    pub story: Vec<String>,
}

impl Log {
    /// Replacements that have taken over.
    pub fn takeovers(&self) -> usize {
        self.cycles
            .windows(2)
            .filter(|pair| pair[0].id != 0 && pair[1].id != 0 && pair[0].id != pair[1].id)
            .count()
    }

    pub fn motion(&self, id: u64) -> Option<&Motion> {
        self.motions.iter().find(|motion| motion.id == id)
    }
}
