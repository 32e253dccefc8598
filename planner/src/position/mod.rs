//! From a pose to a verified motion whose tip ends at a position, without inverse kinematics (Lv et al. 2019).
//!
//! Swarms look for poses whose tip is there, several times with seeds of their own, and each find is polished. What is
//! not exact, or nearer to anything than it may be, is dropped; to the nearest of the others motions are planned, and the
//! best verified one wins. The tip is the robot's last frame; how it is turned is left free.
mod polish;
mod swarm;

use crate::budget::Budget;
use crate::margin_exit::is_clear;
use crate::objective::Objective;
use crate::plan::{
    CUT_SHORT, Plan, PlanError, PlanOptions, PoseOf, StartMargin, Task, check_pose, nearest_inside,
    plan_until,
};
use crate::verify::Contact;
use crate::world::World;
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use swarm::Search;
use taustream_arm::{Robot, Scene};
use taustream_motion::JointArray;
use taustream_optimizers::{METHODS, Method, Reading, Refusal};

pub use polish::{error_m, polish};

/// A pose counts as there when its tip is no farther off.
pub const ERROR_M_MAX: f64 = 1e-6;
/// Methods that take turns: once polished, these find clear poses most surely, and near ones (docs/goals.md).
const METHODS_IN_TURN: [&str; 2] = ["ibfoa", "greedy-bfoa"];
/// Poses that differ by less in every joint are one.
const SAME_RAD: f64 = 1e-3;
/// Poses to which motions are planned; more only while there is none.
const GOALS_MAX: usize = 4;
/// Rounding of forward kinematics, as a share of the arm's reach: a few dozen operations in f64.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// What to reach.
#[derive(Clone, Copy, Debug)]
pub struct PositionTask<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Its surroundings.
    pub scene: &'a Scene,
    /// Where the motion begins.
    pub start_rad: JointArray,
    /// Where the tip shall end, in the base's frame.
    pub target_m: [f64; 3],
    /// What the start must keep.
    pub margin: StartMargin,
    /// Which method looks for poses; `None` lets the best ones take turns.
    pub method: Option<&'static Method>,
}

/// A motion whose tip ends at the position.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// The motion.
    pub plan: Plan,
    /// The pose at its end.
    pub pose_rad: JointArray,
    /// Upper bound of the tip's distance to the position there.
    pub error_m: f64,
    /// Runs of a swarm.
    pub tries: usize,
    /// Different clear poses that they found.
    pub poses: usize,
}

/// Why a position is not reached.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PositionError {
    /// A coordinate is not a finite number.
    #[error("the position's {axis} is {value_m}; three finite numbers in m are needed")]
    BadTarget {
        /// x, y or z.
        axis: char,
        /// The value that was given.
        value_m: f64,
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
        "out of reach: of {tries} tries the nearest pose inside the joint ranges is still {by_m:.6} m off; choose another \
         position, another seed or a longer deadline"
    )]
    Missed {
        /// Runs of a swarm.
        tries: usize,
        /// How far off the nearest pose is.
        by_m: f64,
    },
    /// The tip gets there, but never clear of everything.
    #[error(
        "no clear pose at the position: of {tries} tries {poses} got there, the clearest with {contact}; choose another \
         position, another seed or a longer deadline"
    )]
    NoClearPose {
        /// Runs of a swarm.
        tries: usize,
        /// How many found a pose.
        poses: usize,
        /// What is least in the way.
        contact: Contact,
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

/// How much is tried, from the deadline alone, so that one seed gives one answer wherever the clock does not cut in.
struct PositionBudget {
    tries: usize,
    each_plan: Duration,
}

impl PositionBudget {
    /// About a third of the time for poses on a small controller, the rest for motions.
    fn of(deadline: Duration) -> Self {
        let ms = usize::try_from(deadline.as_millis()).unwrap_or(usize::MAX);
        let each_plan = deadline / 8;
        Self { tries: (ms / 200).clamp(4, 20), each_plan }
    }
}

/// Plans a verified motion to where the tip is at a position.
///
/// # Errors
/// How far out of reach it is, what is in the way there, or why no motion goes there.
pub fn plan_to_position(
    task: &PositionTask,
    options: &PlanOptions,
    cancel: Option<&AtomicBool>,
) -> Result<Reached, PositionError> {
    let budget = Budget::until(options.clock(), cancel);
    for (axis, value_m) in ['x', 'y', 'z'].into_iter().zip(task.target_m) {
        if !value_m.is_finite() {
            return Err(PositionError::BadTarget { axis, value_m });
        }
    }
    check_pose(task.robot, PoseOf::Start, &task.start_rad)?;
    let world = World::new(task.robot, task.scene).map_err(|name| PlanError::Shape { name })?;
    let reach_m = check_reach(task.robot, &task.target_m)?;
    let position_budget = PositionBudget::of(options.deadline);
    let search = Search {
        world: &world,
        budget: &budget,
        start_rad: task.start_rad,
        target_m: task.target_m,
        reach_m,
        reading: options.reading,
    };
    let poses = Poses::find(&search, task.method, options.seed, position_budget.tries)?;
    let mut reached = best_motion(task, options, &poses, (&position_budget, &budget, cancel))?;
    reached.error_m += ROUNDING * reach_m;
    reached.plan.planning_s = budget.elapsed_s();
    Ok(reached)
}

/// One polished run of one method: the pose, clear or not, when it is there, and the time to it from the start at full
/// speed. What the best methods are measured by.
///
/// # Errors
/// When the position is out of reach or the method's numbers make no sense.
pub fn one_try(
    world: &World,
    start_rad: JointArray,
    target_m: [f64; 3],
    method: &'static Method,
    seed: u64,
) -> Result<Option<(JointArray, f64)>, PositionError> {
    let (robot, budget) = (world.robot(), Budget::unbounded());
    let reach_m = check_reach(robot, &target_m)?;
    let reading = Reading::Corrected;
    let search = Search { world, budget: &budget, start_rad, target_m, reach_m, reading };
    let Some(rough) = search.run(method, seed)? else { return Ok(None) };
    let target_m = Vector3::from(target_m);
    let pose = nearest_inside(robot, &polish(robot, &rough, &target_m));
    let is_there = error_m(robot, &pose, &target_m) <= ERROR_M_MAX;
    Ok(is_there.then(|| (pose, time_s(robot, &start_rad, &pose))))
}

/// An upper bound of the tip's distance to the first joint, unless the position is farther away.
fn check_reach(robot: &Robot, target_m: &[f64; 3]) -> Result<f64, PositionError> {
    let chain = &robot.chain;
    let first = chain.joint(0).map_or_else(Vector3::zeros, |j| j.pre.translation.vector);
    let joints = (0..chain.joints()).filter_map(|i| chain.joint(i));
    let lengths = joints.map(|j| j.pre.translation.vector.norm() + j.post.translation.vector.norm());
    let reach_m = lengths.sum::<f64>() - first.norm();
    let distance_m = (Vector3::from(*target_m) - first).norm();
    if distance_m > reach_m + ERROR_M_MAX {
        return Err(PositionError::TooFar { distance_m, reach_m });
    }
    Ok(reach_m.max(1e-3))
}

/// Clear poses at the position, those that take least time first.
struct Poses {
    clear: Vec<JointArray>,
    tries: usize,
    /// The methods that found them.
    methods: Vec<&'static str>,
}

impl Poses {
    fn find(
        search: &Search,
        method: Option<&'static Method>,
        seed: u64,
        tries_max: usize,
    ) -> Result<Self, PositionError> {
        let robot = search.world.robot();
        let target_m = Vector3::from(search.target_m);
        let in_turn = || METHODS.iter().filter(|m| METHODS_IN_TURN.contains(&m.name));
        let methods: Vec<&Method> = method.map_or_else(|| in_turn().collect(), |m| vec![m]);
        let mut poses = Self { clear: Vec::new(), tries: 0, methods: Vec::new() };
        let (mut nearest_m, mut there, mut least_contact) = (f64::INFINITY, 0, None::<Contact>);
        for (i, method) in (0_u64..).zip(methods.iter().cycle()).take(tries_max) {
            // The first swarm decides, however late: an answer within the deadline needs a pose.
            let Some(rough) = search.run(method, seed.wrapping_add(i.wrapping_mul(0x9E37_79B9_7F4A_7C15)))?
            else {
                break;
            };
            poses.tries += 1;
            let pose = nearest_inside(robot, &polish(robot, &rough, &target_m));
            let error = error_m(robot, &pose, &target_m);
            nearest_m = nearest_m.min(error);
            if error > ERROR_M_MAX {
                continue;
            }
            there += 1;
            if is_clear(search.world, &pose) {
                poses.keep(pose, method.name);
            } else if let Some((pair, distance_m)) = search.world.closest(&pose) {
                let contact = search.world.contact_of(&pair, distance_m);
                let gap_m = |c: &Contact| c.distance_m - c.required_m;
                if least_contact.as_ref().is_none_or(|least| gap_m(&contact) > gap_m(least)) {
                    least_contact = Some(contact);
                }
            }
        }
        let tries = poses.tries;
        match (poses.clear.is_empty(), least_contact) {
            (false, _) => {
                let time_s = |pose: &JointArray| time_s(robot, &search.start_rad, pose);
                poses.clear.sort_by(|a, b| time_s(a).total_cmp(&time_s(b)));
                Ok(poses)
            }
            (true, _) if tries == 0 => Err(PositionError::NoTime),
            (true, Some(contact)) => Err(PositionError::NoClearPose { tries, poses: there, contact }),
            (true, None) => Err(PositionError::Missed { tries, by_m: nearest_m }),
        }
    }

    /// Keeps a pose unless it is known already.
    fn keep(&mut self, pose: JointArray, method: &'static str) {
        let same = |a: &JointArray| a.iter().zip(&pose).all(|(x, y)| (x - y).abs() < SAME_RAD);
        if self.clear.iter().any(same) {
            return;
        }
        self.clear.push(pose);
        if !self.methods.contains(&method) {
            self.methods.push(method);
        }
    }
}

/// Least time of a motion between two poses: at full speed of the joint that has farthest to go.
fn time_s(robot: &Robot, from_rad: &JointArray, to_rad: &JointArray) -> f64 {
    let joints = from_rad.iter().zip(to_rad).zip(&robot.joints);
    joints.map(|((a, b), j)| (a - b).abs() / j.limits.motion.velocity_rad_s).fold(0.0, f64::max)
}

/// The best of the motions to the first poses.
fn best_motion(
    task: &PositionTask,
    options: &PlanOptions,
    poses: &Poses,
    (position_budget, budget, cancel): (&PositionBudget, &Budget, Option<&AtomicBool>),
) -> Result<Reached, PositionError> {
    let (mut best, mut planned, mut failure, mut cut) = (None::<(Plan, JointArray)>, 0, None, false);
    for goal_rad in &poses.clear {
        if budget.is_over() || (planned >= GOALS_MAX && best.is_some()) {
            break;
        }
        let PositionTask { robot, scene, start_rad, margin, .. } = *task;
        let score = best.as_ref().map_or(f64::INFINITY, |(plan, _)| plan.score);
        if options.objective == Objective::Time && time_s(robot, &start_rad, goal_rad) >= score {
            break;
        }
        planned += 1;
        let left = options.clock().saturating_sub(Duration::from_secs_f64(budget.elapsed_s()));
        cut |= left < position_budget.each_plan;
        let each = PlanOptions { deadline: position_budget.each_plan.min(left), ..*options };
        let task = Task { robot, scene, start_rad, goal_rad: *goal_rad, margin };
        match plan_until(&task, &each, cancel) {
            Ok(plan) if plan.score < score => best = Some((plan, *goal_rad)),
            Ok(_) => {}
            Err(error) => failure = Some(error),
        }
    }
    let found = poses.clear.len();
    match (best, failure) {
        (Some((mut plan, pose_rad)), _) => {
            let by = poses.methods.join(" and ").to_uppercase();
            plan.how = format!(
                "{by} (nearest of {found} clear poses by {} tries, then damped least squares); {}",
                poses.tries, plan.how
            );
            if (cut || budget.was_cut()) && !plan.how.contains(CUT_SHORT) {
                plan.how.push_str(CUT_SHORT);
            }
            let end_rad = plan.trajectory.end_rad();
            let error_m = error_m(task.robot, &end_rad, &Vector3::from(task.target_m));
            Ok(Reached { plan, pose_rad, error_m, tries: poses.tries, poses: found })
        }
        (None, Some(error)) => Err(PositionError::NoMotion { poses: found, planned, error: Box::new(error) }),
        (None, None) => Err(PositionError::NoTime),
    }
}
