//! Leading the arm to poses that are spread over its range, and reading its torques there.
use super::held::Held;
use crate::args::GravityArgs;
use crate::arm::ArmName;
use crate::failure::Failure;
use crate::interrupt;
use crate::live::client::Client;
use crate::live::follow::{follow, say_pauses};
use crate::live::replan::ask_while;
use crate::live::standstill::{Rest, Resting, rest};
use crate::output::Form;
use crate::words::fault_sentence;
use std::f64::consts::PI;
use taustream_arm::rng::SeededRng;
use taustream_arm::{Robot, RobotJoint, Settings};
use taustream_messages::plan::CheckedPlanRequest;
use taustream_messages::{Phase, Report};
use taustream_motion::{JointArray, MAX_JOINTS};

/// How far from a pose each joint is before it goes there, rad.
const ASIDE_RAD: f64 = 0.08;
/// What a range is drawn in by at both ends before poses are chosen.
const INSIDE_SHARE: f64 = 0.05;
/// Random poses of which each next one is chosen, and tries for each pose that is asked for.
const CANDIDATES: usize = 60;
const TRIES: usize = 6;
/// How long the arm comes to rest before its torques are read, and how long they are, s.
const SETTLE_S: f64 = 0.5;
const READ_S: f64 = 0.5;

/// The arm while it is calibrated.
struct Measuring<'a> {
    form: Form,
    client: &'a Client,
    settings: &'a Settings,
    arm: ArmName,
    seed: u64,
}

/// Measures in as many poses as asked for, and goes back.
///
/// # Errors
/// When the arm does not hold or reports no torques, when too few poses can be reached, or when it does not reach one.
pub(super) fn measure(form: Form, settings: &Settings, args: &GravityArgs) -> Result<Vec<Held>, Failure> {
    let client = Client::join(&settings.name)?;
    let (report, phase) = client.report()?;
    check(settings, &report, phase)?;
    let measuring =
        Measuring { form, client: &client, settings, arm: ArmName::of(settings), seed: args.seed };
    let (start_rad, wanted) = (report.command_rad, usize::from(args.poses));
    let held = measuring.poses(start_rad, wanted)?;
    measuring.go(start_rad)?;
    if held.len() < wanted {
        return Err(Failure::Refused(format!(
            "the planner led the arm to {} of {wanted} poses in {} tries; clear the scene, or ask for fewer with --poses",
            held.len(),
            TRIES * wanted
        )));
    }
    Ok(held)
}

/// Whether the arm can be calibrated.
fn check(settings: &Settings, report: &Report, phase: Phase) -> Result<(), Failure> {
    if report.robot_digest != settings.robot.message_digest {
        return Err(Failure::Refused(format!(
            "the streamer of arm `{}` drives another robot than {}; name its settings with --settings",
            settings.name,
            settings.robot.file.display()
        )));
    }
    if phase != Phase::Holding {
        return Err(Failure::Refused(format!(
            "the arm is {}; a calibration begins while it holds: `taustream enable`, or wait for the end of its motion",
            phase.word()
        )));
    }
    let joints = settings.robot.joints.iter().zip(&report.measured_torque_nm);
    match joints.enumerate().find(|(_, (_, torque_nm))| !torque_nm.is_finite()) {
        Some((index, (joint, _))) => Err(Failure::Refused(format!(
            "the drive of joint {} ({}) reports no torque, so what it bears is not known",
            index + 1,
            joint.name
        ))),
        None => Ok(()),
    }
}

impl Measuring<'_> {
    fn poses(&self, start_rad: JointArray, wanted: usize) -> Result<Vec<Held>, Failure> {
        let mut rng = SeededRng::new(self.seed, 0);
        let (mut known, mut held) = (vec![start_rad], Vec::with_capacity(wanted));
        for _ in 0..TRIES * wanted {
            if held.len() == wanted {
                break;
            }
            let pose_rad = far_from(&known, &self.settings.robot, &mut rng);
            known.push(pose_rad);
            let words = format_args!("pose {} of {wanted} ..", held.len() + 1);
            self.form.progress(words);
            match self.hold(pose_rad) {
                Ok(measured) => held.push(measured),
                // A pose that cannot be reached is no reason to end.
                Err(Failure::Refused(why)) => self.form.progress(format_args!("  left out: {why}")),
                Err(failure) => return Err(failure),
            }
        }
        Ok(held)
    }

    /// Rests in a pose twice, after coming from both of its sides.
    fn hold(&self, pose_rad: JointArray) -> Result<Held, Failure> {
        let joints = self.settings.robot.joints.len();
        let [above, below] = [1.0, -1.0].map(|side| aside(&self.settings.robot, &pose_rad, side));
        let mut rests = Vec::with_capacity(2);
        for from_rad in [above, below] {
            self.go(from_rad)?;
            self.go(pose_rad)?;
            rests.push(self.rest()?);
        }
        let [first, second] = rests.as_slice() else {
            return Err(Failure::Failed("two rests were not measured".to_owned()));
        };
        let half = |a: f64, b: f64| 0.5 * (a + b);
        let of = |f: &dyn Fn(usize) -> f64| (0..joints).map(f).collect();
        Ok(Held {
            q_rad: of(&|j| half(first.q_rad[j], second.q_rad[j])),
            torque_nm: of(&|j| half(first.torque_nm[j], second.torque_nm[j])),
            friction_nm: of(&|j| 0.5 * (first.torque_nm[j] - second.torque_nm[j]).abs()),
        })
    }

    /// Goes to a pose by a verified motion, and waits for its end.
    fn go(&self, goal_rad: JointArray) -> Result<(), Failure> {
        let joints = self.settings.robot.joints.len();
        let request = CheckedPlanRequest { seed: self.seed, ..CheckedPlanRequest::to_pose(joints, goal_rad) };
        let mut meanwhile = interrupt::check;
        let planned = ask_while(self.client, &self.arm, &request, &mut meanwhile, &mut |_| {})?;
        follow(self.client, &self.arm, planned.trajectory_id, say_pauses(self.form)).map(drop)
    }

    /// Reads torques while the arm holds.
    fn rest(&self) -> Result<Rest, Failure> {
        match rest(self.client, SETTLE_S, READ_S)? {
            Resting::Held(rest) => Ok(*rest),
            Resting::Left(report, phase) => {
                let why = fault_sentence(&report, &self.arm);
                Err(Failure::Failed(format!("the arm no longer holds, it is {}: {why}", phase.word())))
            }
            Resting::Unknown => Err(Failure::Failed(format!(
                "too few reports of the streamer in {READ_S} s; raise report_rate_hz in the settings"
            ))),
        }
    }
}

/// The range in which poses of a joint are chosen: a turn at most, and not at its ends.
fn range_rad(joint: &RobotJoint) -> [f64; 2] {
    let [low, high] = joint.limits.position_rad;
    let inside = INSIDE_SHARE * (high - low);
    let within @ [low, high] = [low + inside, high - inside];
    if low < PI && high > -PI { [low.max(-PI), high.min(PI)] } else { within }
}

/// Of random poses the one that is furthest from those that were chosen before, each joint measured by its range.
fn far_from(known: &[JointArray], robot: &Robot, rng: &mut SeededRng) -> JointArray {
    let ranges: Vec<[f64; 2]> = robot.joints.iter().map(range_rad).collect();
    let squared = |a: &JointArray, b: &JointArray| -> f64 {
        let joints = a.iter().zip(b).zip(&ranges);
        joints.map(|((a, b), [low, high])| ((a - b) / (high - low).max(f64::EPSILON)).powi(2)).sum()
    };
    let mut best = ([0.0; MAX_JOINTS], f64::NEG_INFINITY);
    for _ in 0..CANDIDATES {
        let mut pose = [0.0; MAX_JOINTS];
        pose.iter_mut().zip(&ranges).for_each(|(q, [low, high])| *q = rng.within(*low, *high));
        let away = known.iter().map(|other| squared(&pose, other)).fold(f64::INFINITY, f64::min);
        if away > best.1 {
            best = (pose, away);
        }
    }
    best.0
}

/// The pose with every joint moved to one side, inside its limits.
fn aside(robot: &Robot, pose_rad: &JointArray, side: f64) -> JointArray {
    let mut aside = *pose_rad;
    for (q, joint) in aside.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        *q = (*q + side * ASIDE_RAD).clamp(low, high);
    }
    aside
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn poses_are_inside_apart_and_of_a_seed() {
        let robot = crate::arm::robot(Path::new("ur5")).unwrap();
        let choose = |seed: u64| {
            let (mut rng, mut known) = (SeededRng::new(seed, 0), vec![[0.0; MAX_JOINTS]]);
            for _ in 0..12 {
                let next = far_from(&known, &robot, &mut rng);
                known.push(next);
            }
            known
        };
        let known = choose(1);
        assert_eq!(known, choose(1));
        assert_ne!(known, choose(2));
        for pose in &known {
            for side in [1.0, -1.0] {
                let there = aside(&robot, pose, side);
                for (q, joint) in there.iter().zip(&robot.joints) {
                    assert!((joint.limits.position_rad[0]..=joint.limits.position_rad[1]).contains(q));
                }
            }
        }
        for (i, a) in known.iter().enumerate() {
            for b in &known[i + 1..] {
                let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(apart > 0.5, "{apart}");
            }
        }
    }
}
