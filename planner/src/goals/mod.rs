//! Goals that are not one pose of the joints: the tip at a position or in a pose, or any of several poses.
//!
//! Inverse kinematics ([`Inverse`]) from many guesses, or a swarm by name, finds poses whose tip is at the target. What is
//! not exact, or nearer to anything than it may be, is dropped; to the nearest of the others motions are planned, and the
//! best verified one wins. A robot with several tips has a target for one of them.
mod error;
mod inverse;
mod line;
mod poses;
mod swarm;
mod target;
mod turns;

use crate::budget::Budget;
use crate::constraints::TipRules;
use crate::objective::Objective;
use crate::plan::{
    CUT_SHORT, Plan, PlanError, PlanOptions, PoseOf, StartMargin, Task, check_pose, plan_until,
};
use crate::world::World;
use nalgebra::Vector3;
use poses::{Poses, Search};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::JointArray;
use taustream_optimizers::Reading;

pub use error::GoalError;
pub use inverse::Inverse;
pub use line::{Line, LineError, TipSpeed, plan_line, plan_line_keeping};
pub use poses::Finder;
pub use target::{ERROR_M_MAX, ERROR_RAD_MAX, Orientation, TipError, TipTarget};
pub use turns::nearest_turn;

/// Poses to which motions are planned; more only while there is none.
pub(crate) const GOALS_MAX: usize = 4;
/// Rounding of forward kinematics, as a share of the arm's reach: a few dozen operations in f64.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The arm, what is around it, and where its motion begins.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Its surroundings.
    pub scene: &'a Scene,
    /// Where the motion begins.
    pub start_rad: JointArray,
    /// What the start must keep.
    pub margin: StartMargin,
}

/// A motion whose tip ends at the target.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// The motion.
    pub plan: Plan,
    /// The pose at its end.
    pub pose_rad: JointArray,
    /// How far the tip is off there; the position is an upper bound.
    pub error: TipError,
    /// Guesses, or runs of a swarm.
    pub tries: usize,
    /// Different clear poses that they found.
    pub poses: usize,
}

/// Plans a verified motion to where the tip is at a target.
///
/// # Errors
/// How far out of reach it is, what is in the way there, or why no motion goes there.
pub fn plan_to_tip(
    situation: &Situation,
    (target, finder): (&TipTarget, Finder),
    options: &PlanOptions,
    cancel: Option<&AtomicBool>,
) -> Result<Reached, GoalError> {
    let Situation { robot, start_rad, .. } = *situation;
    let budget = Budget::until(options.clock(), cancel);
    check_target(target)?;
    check_pose(robot, PoseOf::Start, &start_rad)?;
    let (poses, reach_m) = find_poses(situation, (target, finder), options, &budget)?;
    let (mut plan, pose_rad) =
        best_motion(situation, &poses.clear, options, (&budget, cancel))?.map_err(|(planned, error)| {
            let poses = poses.clear.len();
            error.map_or(GoalError::NoTime, |error| GoalError::NoMotion { poses, planned, error })
        })?;
    plan.how = format!(
        "{} (nearest of {} clear poses by {} tries); {}",
        finder.name(),
        poses.clear.len(),
        poses.tries,
        plan.how
    );
    plan.planning_s = budget.elapsed_s();
    let mut error = target.error(robot, &plan.trajectory.end_rad());
    error.position_m += ROUNDING * reach_m;
    Ok(Reached { plan, pose_rad, error, tries: poses.tries, poses: poses.clear.len() })
}

/// Clear poses whose tip is at a target, those that take least time from the start first.
///
/// # Errors
/// How far out of reach it is, or what is in the way there.
pub fn tip_poses(
    situation: &Situation,
    target: &TipTarget,
    options: &PlanOptions,
    cancel: Option<&AtomicBool>,
) -> Result<Vec<JointArray>, GoalError> {
    let budget = Budget::until(options.clock(), cancel);
    check_target(target)?;
    Ok(find_poses(situation, (target, Finder::Inverse), options, &budget)?.0.clear)
}

/// Clear poses whose tip is at a target, and how far the arm reaches at most (m).
fn find_poses(
    situation: &Situation,
    (target, finder): (&TipTarget, Finder),
    options: &PlanOptions,
    budget: &Budget,
) -> Result<(Poses, f64), GoalError> {
    let Situation { robot, scene, start_rad, .. } = *situation;
    let world = World::new(robot, scene).map_err(|name| PlanError::Shape { name })?;
    let reach_m = check_reach(robot, target)?;
    let (reading, seed) = (options.reading, options.seed);
    let rules = TipRules::in_world(&world, &options.constraints).map_err(PlanError::Constraints)?;
    let rules = rules.filter(TipRules::are_of_poses);
    let search = Search { world: &world, budget, start_rad, target, reach_m, finder, reading, seed, rules };
    Ok((search.run(options.deadline)?, reach_m))
}

/// Plans a verified motion to the best of several poses.
///
/// # Errors
/// Why the last of them serves not, when none does.
pub fn plan_to_any(
    situation: &Situation,
    goals_rad: &[JointArray],
    options: &PlanOptions,
    cancel: Option<&AtomicBool>,
) -> Result<(Plan, JointArray), GoalError> {
    let Situation { robot, scene, start_rad, margin } = *situation;
    if let [goal_rad] = *goals_rad {
        let task = Task { robot, scene, start_rad, goal_rad, margin };
        return Ok((plan_until(&task, options, cancel)?, goal_rad));
    }
    let budget = Budget::until(options.clock(), cancel);
    let mut nearest_first = goals_rad.to_vec();
    nearest_first.sort_by(|a, b| time_s(robot, &start_rad, a).total_cmp(&time_s(robot, &start_rad, b)));
    let goals = goals_rad.len();
    let (mut plan, goal_rad) = best_motion(situation, &nearest_first, options, (&budget, cancel))?
        .map_err(|(_, error)| error.map_or(GoalError::NoTime, |error| GoalError::NoneOf { goals, error }))?;
    plan.planning_s = budget.elapsed_s();
    Ok((plan, goal_rad))
}

/// One exact pose by one try of a finder, clear or not, and the time to it from the start at full speed: what finders are
/// measured by.
///
/// # Errors
/// When the position is out of reach or the method's numbers make no sense.
pub fn one_try(
    world: &World,
    start_rad: JointArray,
    (target, finder): (&TipTarget, Finder),
    seed: u64,
) -> Result<Option<(JointArray, f64)>, GoalError> {
    let (robot, budget) = (world.robot(), Budget::unbounded());
    let reach_m = check_reach(robot, target)?;
    let reading = Reading::Corrected;
    let rules = None;
    let search = Search { world, budget: &budget, start_rad, target, reach_m, finder, reading, seed, rules };
    let pose = poses::one_try(&search)?;
    Ok(pose.map(|pose| (pose, time_s(robot, &start_rad, &pose))))
}

fn check_target(target: &TipTarget) -> Result<(), GoalError> {
    for (axis, value_m) in ['x', 'y', 'z'].into_iter().zip(target.position_m) {
        if !value_m.is_finite() {
            return Err(GoalError::BadPosition { axis, value_m });
        }
    }
    let turns = target.orientation.map_or([0.0; 3], |o| o.tolerance_rad);
    let all = turns.map(|value| ("turn", value, "rad"));
    for (what, value, unit) in std::iter::once(("position", target.tolerance_m, "m")).chain(all) {
        if value.is_nan() || value < 0.0 || (unit == "m" && value.is_infinite()) {
            return Err(GoalError::BadTolerance { what, value, unit });
        }
    }
    Ok(())
}

/// An upper bound of the tip's distance to the first joint, unless the position is farther away.
fn check_reach(robot: &Robot, target: &TipTarget) -> Result<f64, GoalError> {
    let (chain, tips) = (&robot.chain, robot.chain.tips().len());
    if target.tip >= tips {
        return Err(GoalError::NoSuchTip { tip: target.tip, tips });
    }
    let frame = target.frame(robot);
    let first = chain.movers(frame).next().and_then(|first| chain.joint(first));
    let first = first.map_or_else(Vector3::zeros, |j| j.pre.translation.vector);
    let joints = chain.movers(frame).filter_map(|i| Some((chain.joint(i)?, robot.extension_m(i))));
    let lengths = joints.map(|(j, extension_m)| {
        j.pre.translation.vector.norm() + extension_m + j.post.translation.vector.norm()
    });
    let reach_m = lengths.sum::<f64>() - first.norm();
    let distance_m = (Vector3::from(target.position_m) - first).norm();
    if distance_m > reach_m + target.tolerance_m.max(ERROR_M_MAX) {
        return Err(GoalError::TooFar { distance_m, reach_m });
    }
    Ok(reach_m.max(1e-3))
}

/// Least time of a motion between two poses: at full speed of the joint that has farthest to go.
fn time_s(robot: &Robot, from_rad: &JointArray, to_rad: &JointArray) -> f64 {
    let joints = from_rad.iter().zip(to_rad).zip(&robot.joints);
    joints.map(|((a, b), j)| (a - b).abs() / j.limits.motion.velocity_rad_s).fold(0.0, f64::max)
}

/// To how many poses motions were planned, and why not to the last of them.
type NoMotion = (usize, Option<Box<PlanError>>);

/// The best of the motions to the first poses, which are sorted by their time, and its pose.
fn best_motion(
    situation: &Situation,
    poses: &[JointArray],
    options: &PlanOptions,
    (budget, cancel): (&Budget, Option<&AtomicBool>),
) -> Result<Result<(Plan, JointArray), NoMotion>, GoalError> {
    if poses.is_empty() {
        return Err(GoalError::NoGoal);
    }
    let Situation { robot, scene, start_rad, margin } = *situation;
    let each_plan = options.deadline / 8;
    let (mut best, mut planned, mut failure, mut cut) = (None::<(Plan, JointArray)>, 0, None, false);
    for goal_rad in poses {
        if budget.is_over() || (planned >= GOALS_MAX && best.is_some()) {
            break;
        }
        let score = best.as_ref().map_or(f64::INFINITY, |(plan, _)| plan.score);
        if options.objective == Objective::Time && time_s(robot, &start_rad, goal_rad) >= score {
            break;
        }
        planned += 1;
        let left = options.clock().saturating_sub(Duration::from_secs_f64(budget.elapsed_s()));
        cut |= left < each_plan;
        let each = PlanOptions { deadline: each_plan.min(left), ..*options };
        let task = Task { robot, scene, start_rad, goal_rad: *goal_rad, margin };
        match plan_until(&task, &each, cancel) {
            Ok(plan) if plan.score < score => best = Some((plan, *goal_rad)),
            Ok(_) => {}
            Err(error) => failure = Some(Box::new(error)),
        }
    }
    Ok(best.ok_or((planned, failure)).map(|(mut plan, goal_rad)| {
        if (cut || budget.was_cut()) && !plan.how.contains(CUT_SHORT) {
            plan.how.push_str(CUT_SHORT);
        }
        (plan, goal_rad)
    }))
}
