//! Checking of trajectories, on a thread of its own: bounded work, but long beside a command that says stop.
//!
//! What is decided here needs no race: layout, numbers, robot, joints, limits. The cycle decides the rest.
use std::io;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use taustream_arm::Robot;
use taustream_messages::{CheckedTrajectory, Rejection, Replaces, RobotDigest, TrajectoryMessage};
use taustream_motion::limits::{Quantity, check_motion};
use taustream_motion::{JointLimits, MAX_JOINTS};

/// Messages that may wait to be checked; more are refused as busy.
const WAITING_MAX: usize = 4;

/// A message after its check.
#[derive(Debug)]
pub struct Checked {
    /// The id that the message claims.
    pub id: u64,
    /// The generation that the message claims.
    pub generation: u64,
    /// The trajectory, or why it is refused.
    pub result: Result<Box<CheckedTrajectory>, Rejection>,
}

/// What a trajectory is checked against.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    digest: RobotDigest,
    joints: usize,
    limits: [JointLimits; MAX_JOINTS],
}

impl Rules {
    /// The rules of a robot.
    #[must_use]
    pub fn of(robot: &Robot) -> Self {
        Self { digest: robot.digest, joints: robot.joints.len(), limits: robot.limits() }
    }

    /// Checks everything about a message that the moment cannot change.
    ///
    /// # Errors
    /// The first thing that is wrong with it.
    pub fn check(&self, message: &TrajectoryMessage) -> Result<Box<CheckedTrajectory>, Rejection> {
        let checked =
            CheckedTrajectory::try_from(message).map_err(|e| Rejection::Malformed(e.to_string()))?;
        if let Replaces::Cut { at_s, .. } = checked.replaces {
            return Err(Rejection::CutUnsupported { at_s });
        }
        if checked.robot_digest != self.digest {
            return Err(Rejection::WrongRobot);
        }
        if checked.trajectory.joints() != self.joints {
            let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
            let (got, expected) = (count(checked.trajectory.joints()), count(self.joints));
            return Err(Rejection::JointCount { got, expected });
        }
        check_motion(&checked.trajectory, &self.limits).map_err(|v| Rejection::Limit {
            joint: u32::try_from(v.joint).unwrap_or(u32::MAX),
            at_s: v.at_s,
            value: v.value,
            limit: v.limit,
            what: quantity_word(v.quantity).to_owned(),
        })?;
        Ok(Box::new(checked))
    }
}

fn quantity_word(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Position => "position, rad",
        Quantity::Velocity => "velocity, rad/s",
        Quantity::Acceleration => "acceleration, rad/s^2",
        Quantity::Jerk => "jerk, rad/s^3",
    }
}

/// The checking thread, seen from the service thread. It ends when this is dropped.
#[derive(Debug)]
pub struct Checker {
    messages: SyncSender<Box<TrajectoryMessage>>,
    results: Receiver<Checked>,
}

impl Checker {
    /// Starts the thread for a robot.
    ///
    /// # Errors
    /// When no thread can be started.
    pub fn start(robot: &Robot) -> io::Result<Self> {
        let rules = Rules::of(robot);
        let (messages, todo) = sync_channel::<Box<TrajectoryMessage>>(WAITING_MAX);
        let (done, results) = sync_channel(WAITING_MAX);
        let work = move || {
            for message in todo {
                let (id, generation) = (message.claimed_id(), message.claimed_generation());
                let result = rules.check(&message);
                if done.send(Checked { id, generation, result }).is_err() {
                    return;
                }
            }
        };
        thread::Builder::new().name("checker".into()).stack_size(1 << 20).spawn(work)?;
        Ok(Self { messages, results })
    }

    /// Has a message checked; false when too many wait already.
    #[must_use]
    pub fn check(&self, message: Box<TrajectoryMessage>) -> bool {
        self.messages.try_send(message).is_ok()
    }

    /// The next result.
    #[must_use]
    pub fn checked(&self) -> Option<Checked> {
        self.results.try_recv().ok()
    }
}
