//! Why a goal is not reached.
use crate::constraints::TipFault;
use crate::explain::Stage;
use crate::plan::PlanError;
use crate::verify::Contact;
use taustream_optimizers::Refusal;

/// Why the tip is not brought to its target.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GoalError {
    /// A coordinate is not a finite number.
    #[error("the position's {axis} is {value_m}; three finite numbers in m are needed")]
    BadPosition {
        /// x, y or z.
        axis: char,
        /// The value that was given.
        value_m: f64,
    },
    /// A tip that the robot does not have.
    #[error("there is no tip {}; the robot has {tips}", tip + 1)]
    NoSuchTip {
        /// Counted from 0.
        tip: usize,
        /// How many there are.
        tips: usize,
    },
    /// A tolerance is negative or no number.
    #[error("the tolerance of the {what} is {value}; it must be 0 or more ({unit})")]
    BadTolerance {
        /// Position or turn.
        what: &'static str,
        /// The value that was given.
        value: f64,
        /// m or rad.
        unit: &'static str,
    },
    /// Farther away than the arm is long.
    #[error(
        "out of reach: the position is {distance_m:.4} m from the first joint, and the arm reaches at most {reach_m:.4} m, \
         at least {:.4} m too short; choose a nearer position", distance_m - reach_m
    )]
    TooFar {
        /// From the first joint's frame.
        distance_m: f64,
        /// An upper bound.
        reach_m: f64,
    },
    /// The tip does not get there inside the joint ranges.
    #[error(
        "out of reach: of {tries} tries the nearest pose inside the joint ranges is still {by_m:.6} m{} off; choose another \
         {}", turned(*by_rad), what_else(*by_rad)
    )]
    Missed {
        /// Guesses, or runs of a swarm.
        tries: usize,
        /// How far off the nearest pose is.
        by_m: f64,
        /// By what angle it is turned, where the orientation counts.
        by_rad: Option<f64>,
    },
    /// The tip gets there, but never clear of everything.
    #[error(
        "no clear pose at the position: of {tries} tries {poses} got there, the clearest with {contact}; choose another \
         position, another seed or a longer deadline"
    )]
    NoClearPose {
        /// Guesses, or runs of a swarm.
        tries: usize,
        /// How many found a pose.
        poses: usize,
        /// What is least in the way.
        contact: Contact,
    },
    /// The tip gets there, but never as it must be on the way.
    #[error(
        "no pose at the position keeps the constraints of the tip: of {tries} tries {poses} got there, the last with {fault}; \
         choose another position, or a wider constraint"
    )]
    NoKeptPose {
        /// Guesses, or runs of a swarm.
        tries: usize,
        /// How many found a pose.
        poses: usize,
        /// Which constraint.
        fault: TipFault,
    },
    /// Clear poses, and no way to any of them.
    #[error("{poses} clear poses at the position, and no motion to the {planned} nearest: {error}")]
    NoMotion {
        /// How many poses.
        poses: usize,
        /// To how many of them motions were planned.
        planned: usize,
        /// Why not to the last of them.
        error: Box<PlanError>,
    },
    /// None of several goals serves.
    #[error("none of {goals} goals is reached; the last: {error}")]
    NoneOf {
        /// How many were given.
        goals: usize,
        /// Why not the last.
        error: Box<PlanError>,
    },
    /// No goal was given.
    #[error("no goal was given")]
    NoGoal,
    /// The clock was over before there was a motion.
    #[error("the deadline was over before a motion was found; give it more time")]
    NoTime,
    /// The swarm does not start.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The start or the scene is at fault.
    #[error(transparent)]
    Plan(#[from] PlanError),
}

fn turned(by_rad: Option<f64>) -> String {
    by_rad.map_or_else(String::new, |by_rad| format!(" and {by_rad:.6} rad"))
}

fn what_else(by_rad: Option<f64>) -> &'static str {
    match by_rad {
        None => "position, another seed or a longer deadline",
        Some(_) => "position or orientation, a larger tolerance, another seed or a longer deadline",
    }
}

impl GoalError {
    /// What was done before it failed, in its order; empty where nothing was begun.
    #[must_use]
    pub fn stages(&self) -> &[Stage] {
        match self {
            Self::Plan(error) => error.stages(),
            Self::NoMotion { error, .. } | Self::NoneOf { error, .. } => error.stages(),
            Self::BadPosition { .. }
            | Self::NoSuchTip { .. }
            | Self::BadTolerance { .. }
            | Self::TooFar { .. }
            | Self::Missed { .. }
            | Self::NoClearPose { .. }
            | Self::NoKeptPose { .. }
            | Self::NoGoal
            | Self::NoTime
            | Self::Refused(_) => &[],
        }
    }
}
