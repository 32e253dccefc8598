//! Checking of trajectories, on a thread of its own: bounded work, but long beside a command that says stop.
//!
//! What is decided here needs no race: layout, numbers, robot, joints, limits. The cycle decides the rest.
use crate::prepared::PreparedTrajectory;
use std::io;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use taustream_arm::Robot;
use taustream_drivers::Nanos;
use taustream_messages::{CheckedTrajectory, Rejection, Replaces, RobotDigest, TrajectoryMessage};
use taustream_motion::limits::{Quantity, check_motion_from};
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
    /// Until when its sender waits.
    pub valid_until: Nanos,
    /// The trajectory, or why it is refused.
    pub result: Result<Box<PreparedTrajectory>, Rejection>,
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
        Self { digest: robot.message_digest, joints: robot.joints.len(), limits: robot.limits() }
    }

    /// Checks everything about a message that the moment cannot change.
    ///
    /// # Errors
    /// The first thing that is wrong with it.
    pub fn check(&self, message: &TrajectoryMessage) -> Result<Box<PreparedTrajectory>, Rejection> {
        let checked =
            CheckedTrajectory::try_from(message).map_err(|e| Rejection::Malformed(e.to_string()))?;
        if checked.robot_digest != self.digest {
            return Err(Rejection::WrongRobot);
        }
        if checked.trajectory.joints() != self.joints {
            let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
            let (got, expected) = (count(checked.trajectory.joints()), count(self.joints));
            return Err(Rejection::JointCount { got, expected });
        }
        let begin_s = match checked.replaces {
            Replaces::Rest => 0.0,
            Replaces::Cut { at_s, .. } => at_s,
        };
        let end_s = checked.trajectory.duration_s();
        if end_s < begin_s {
            return Err(Rejection::Malformed(format!("it ends at {end_s} s, before its cut at {begin_s} s")));
        }
        // From the cut on: what the kept strokes alone would do before it is never run.
        check_motion_from(&checked.trajectory, &self.limits, begin_s).map_err(|v| Rejection::Limit {
            joint: u32::try_from(v.joint).unwrap_or(u32::MAX),
            at_s: v.at_s,
            value: v.value,
            limit: v.limit,
            what: quantity_word(v.quantity).to_owned(),
        })?;
        Ok(Box::new(PreparedTrajectory::new(checked, &self.limits)))
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
                let valid_until = Nanos(message.claimed_valid_until_ns());
                let result = rules.check(&message);
                if done.send(Checked { id, generation, valid_until, result }).is_err() {
                    return;
                }
            }
        };
        thread::Builder::new().name("checker".into()).stack_size(4 << 20).spawn(work)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use taustream_messages::trajectory::Corrupted;
    use taustream_motion::{Stroke, Trajectory, joint_array};

    const BASE_RAD: [f64; MAX_JOINTS] = joint_array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);

    fn robot() -> Robot {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
        Robot::load(&file).unwrap_or_else(|faults| panic!("{faults}"))
    }

    fn message(duration_s: f64, replaces: Replaces) -> Box<TrajectoryMessage> {
        let delta_rad = joint_array([0.5, 0.1, -0.2, 0.0, 0.0, 0.3]);
        let stroke = Stroke { start_s: 0.0, duration_s, n: 6, delta_rad };
        let trajectory = Trajectory::new(6, BASE_RAD, &[stroke]).unwrap();
        let robot_digest = robot().digest;
        let checked =
            CheckedTrajectory { trajectory_id: 7, generation: 1, robot_digest, replaces, trajectory };
        TrajectoryMessage::new(&checked)
    }

    #[test]
    fn check_of_a_sound_trajectory_lets_it_through_bit_by_bit() {
        let checked = Rules::of(&robot()).check(&message(2.0, Replaces::Rest)).unwrap();
        assert_eq!(message(2.0, Replaces::Rest), TrajectoryMessage::new(&checked));
    }

    #[test]
    fn check_of_each_corrupted_message_is_refused_with_its_reason() {
        let rules = Rules::of(&robot());
        let table: [(Corrupted, &str); 12] = [
            (Corrupted::Layout(99), "layout version 99"),
            (Corrupted::Joints(17), "joint_count is 17"),
            (Corrupted::Joints(7), "wrong joint count: 7 for an arm of 6"),
            (Corrupted::StrokeCount(600), "stroke_count is 600"),
            (Corrupted::Exponent(3), "n is 3"),
            (Corrupted::Delta(f64::NAN), "delta_rad is not finite"),
            (Corrupted::Duration(0.0), "duration_s is 0"),
            (Corrupted::Start(-1.0), "start_s is -1"),
            (Corrupted::Base(f64::INFINITY), "base_rad of joint 1"),
            (Corrupted::Base(9.0), "limit of joint 1"),
            (Corrupted::Replaces(7), "replaces code 7"),
            (Corrupted::Digest(1), "wrong robot"),
        ];
        for (how, words) in table {
            let spoiled = message(2.0, Replaces::Rest).corrupted(how);
            let sentence = rules.check(&spoiled).unwrap_err().to_string();
            assert!(sentence.contains(words), "{how:?}: {sentence}");
        }
    }

    #[test]
    fn check_of_a_motion_too_fast_names_joint_time_and_limit() {
        let refused = Rules::of(&robot()).check(&message(0.3, Replaces::Rest));
        assert!(matches!(refused, Err(Rejection::Limit { joint: 0, .. })), "{refused:?}");
    }

    /// An arm outside its limits on two joints: only what leads both of them inwards is a motion.
    #[test]
    fn check_of_a_motion_from_outside_lets_it_come_in_and_refuses_to_go_further() {
        let rules = Rules::of(&robot());
        let mut base_rad = BASE_RAD;
        (base_rad[0], base_rad[5]) = (-3.25, 3.1600);
        let led = |by_rad: [f64; 2]| {
            let delta_rad = joint_array([by_rad[0], 0.0, 0.0, 0.0, 0.0, by_rad[1]]);
            let stroke = Stroke { start_s: 0.0, duration_s: 2.0, n: 6, delta_rad };
            let trajectory = Trajectory::new(6, base_rad, &[stroke]).unwrap();
            let (robot_digest, replaces) = (robot().digest, Replaces::Rest);
            let checked =
                CheckedTrajectory { trajectory_id: 7, generation: 1, robot_digest, replaces, trajectory };
            rules.check(&TrajectoryMessage::new(&checked)).map(drop)
        };
        assert_eq!(led([0.3, -0.3]), Ok(()));
        for (by_rad, offender) in [([-0.01, -0.3], 0), ([0.3, 0.001], 5), ([0.3, 0.0], 5), ([0.05, -0.3], 0)]
        {
            let refused = led(by_rad);
            assert!(
                matches!(refused, Err(Rejection::Limit { joint, .. }) if joint == offender),
                "{by_rad:?}: {refused:?}"
            );
        }
    }

    #[test]
    fn check_of_a_cut_looks_at_what_runs_from_the_cut_on() {
        let rules = Rules::of(&robot());
        let cut = |at_s| Replaces::Cut { trajectory_id: 3, at_s };
        assert!(rules.check(&message(2.0, cut(0.5))).is_ok());
        // Too fast as a whole, and at rest before the cut.
        let result = rules.check(&message(0.3, cut(0.3)));
        assert!(result.is_ok(), "{result:?}");
        let refused = rules.check(&message(0.3, cut(0.1)));
        assert!(matches!(refused, Err(Rejection::Limit { at_s, .. }) if at_s >= 0.1), "{refused:?}");
        let refused = rules.check(&message(2.0, cut(2.1)));
        assert!(matches!(refused, Err(Rejection::Malformed(_))), "{refused:?}");
    }
}
