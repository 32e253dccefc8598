//! From two poses to a verified motion.
use crate::budget::Budget;
use crate::dynamics::NoMasses;
use crate::kind::{Improvement, PlannerKind};
use crate::margin_exit::{MarginExit, Relaxed, find_margin_exit, is_clear};
use crate::objective::{Evaluator, Objective};
use crate::optimize::Reading;
use crate::pipeline::Pipeline;
use crate::verify::{Contact, Proof, Violation};
use crate::world::World;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, Trajectory};

/// What [`Plan::how`] says when the clock cut the work short, so that one seed may give another answer.
pub(crate) const CUT_SHORT: &str = ", cut short by the deadline";

/// How to plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanOptions {
    /// Seed of every random choice: one seed gives one answer, unless the clock cuts the work short (then
    /// [`Plan::how`] says so).
    pub seed: u64,
    /// How long planning may take. Work is budgeted in evaluations derived from it; the clock only aborts.
    pub deadline: Duration,
    /// Which method.
    pub planner: PlannerKind,
    /// Which reading of the papers the optimisers follow.
    pub reading: Reading,
    /// How the default planner improves what it found.
    pub improvement: Improvement,
    /// What makes one motion better than another.
    pub objective: Objective,
    /// True when the clock aborts at the deadline. Without it only the budget that is derived from the deadline ends the
    /// work, so that one seed gives one answer on any machine, however busy: for comparisons, not for arms.
    pub keeps_deadline: bool,
}

impl Default for PlanOptions {
    fn default() -> Self {
        let (deadline, planner) = (Duration::from_millis(2000), PlannerKind::Auto);
        let (reading, improvement) = (Reading::Corrected, Improvement::default());
        let objective = Objective::default();
        Self { seed: 0, deadline, planner, reading, improvement, objective, keeps_deadline: true }
    }
}

impl PlanOptions {
    /// When the clock aborts.
    pub(crate) fn clock(&self) -> Duration {
        if self.keeps_deadline { self.deadline } else { Duration::MAX }
    }
}

/// A verified motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The motion, from rest to rest.
    pub trajectory: Trajectory,
    /// What found it, in a few words.
    pub how: String,
    /// What was proven about it.
    pub proof: Proof,
    /// What it is worth by the objective: seconds, cost or joules; less is better.
    pub score: f64,
    /// Mechanical energy of the motion ([`crate::dynamics`]); `None` when the robot states no masses.
    pub energy_j: Option<f64>,
    /// How long planning took.
    pub planning_s: f64,
    /// Poses that searches, shortcuts and refinements checked: the measure of work that every machine agrees on.
    pub checks: usize,
}

/// Which of the two given poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseOf {
    /// Where the motion begins.
    Start,
    /// Where it shall end.
    Goal,
}

impl std::fmt::Display for PoseOf {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A joint value is not a finite number, or a joint that the arm does not have is not zero.
    #[error("{which} pose: joint {} is {value_rad}; expected {joints} finite values in rad", joint + 1)]
    BadPose {
        /// Which pose.
        which: PoseOf,
        /// Zero-based index of the joint.
        joint: usize,
        /// The value that was given.
        value_rad: f64,
        /// How many joints the arm has.
        joints: usize,
    },
    /// A joint lies outside its range.
    #[error(
        "{which} outside limits: joint {} ({name}) at {value_rad:.4} rad is {by_rad:.4} rad outside [{:.4}, {:.4}]; choose a {which} inside",
        joint + 1, range_rad[0], range_rad[1]
    )]
    OutsideLimits {
        /// Which pose.
        which: PoseOf,
        /// Zero-based index of the joint.
        joint: usize,
        /// The joint's name.
        name: String,
        /// The value that was given.
        value_rad: f64,
        /// How far outside.
        by_rad: f64,
        /// Lowest and highest angle.
        range_rad: [f64; 2],
    },
    /// The arm touches something in a given pose.
    #[error("{which} in collision: {contact}; choose another {which} or correct the scene")]
    InCollision {
        /// Which pose.
        which: PoseOf,
        /// What touches what.
        contact: Contact,
    },
    /// The arm touches nothing in a given pose, but is nearer to something than the scene's margin.
    #[error("{which} nearer than the margin: {contact}; choose another {which} or a smaller margin")]
    InsideMargin {
        /// Which pose.
        which: PoseOf,
        /// What is near to what.
        contact: Contact,
    },
    /// A shape of the robot or the scene cannot be built.
    #[error("{name}: its mesh has no usable triangles; correct the file")]
    Shape {
        /// The link or obstacle.
        name: String,
    },
    /// Energy counts, and no masses are known.
    #[error(transparent)]
    NoMasses(#[from] NoMasses),
    /// Nothing was found.
    #[error(
        "no path found: {tried}{}; try a longer deadline, another seed, planner or goal",
        if *cut_short { " (the deadline cut the search short)" } else { "" }
    )]
    NotFound {
        /// What was tried, with counts and the obstacle in the way.
        tried: String,
        /// True when the clock ended the search before its budget did.
        cut_short: bool,
    },
    /// A path was found, but its timed motion could not be proven.
    #[error("a path was found ({tried}), but its motion is not proven: {violation}")]
    Unproven {
        /// What found the path.
        tried: String,
        /// Why the proof failed.
        violation: Violation,
    },
}

/// Plans a verified motion between two poses at rest.
///
/// # Errors
/// What is wrong with a pose, or what was tried in vain.
pub fn plan(
    robot: &Robot,
    scene: &Scene,
    start_rad: &JointArray,
    goal_rad: &JointArray,
    options: &PlanOptions,
) -> Result<Plan, PlanError> {
    let (start_rad, goal_rad) = (*start_rad, *goal_rad);
    let task = Task { robot, scene, start_rad, goal_rad, margin: StartMargin::Scene };
    plan_until(&task, options, None)
}

/// What to plan.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Its surroundings.
    pub scene: &'a Scene,
    /// Where the motion begins.
    pub start_rad: JointArray,
    /// Where it shall end.
    pub goal_rad: JointArray,
    /// What the start must keep.
    pub margin: StartMargin,
}

/// What the start of a motion must keep from obstacles. The goal always keeps the scene's margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartMargin {
    /// The scene's margin.
    Scene,
    /// What it has, down to a millimetre: for an arm that stands where it stands, after a stop or a sag. The motion
    /// keeps no less than that until it has left the margin, and [`Plan::how`] says so.
    AsItStands,
}

/// Like [`plan`], and given up as soon as `cancel` is set.
///
/// # Errors
/// What is wrong with a pose, or what was tried in vain.
pub fn plan_until(
    task: &Task,
    options: &PlanOptions,
    cancel: Option<&AtomicBool>,
) -> Result<Plan, PlanError> {
    let budget = Budget::until(options.clock(), cancel);
    check_pose(task.robot, PoseOf::Start, &task.start_rad)?;
    check_pose(task.robot, PoseOf::Goal, &task.goal_rad)?;
    let evaluator = Evaluator::new(options.objective, task.robot)?;
    let world = World::new(task.robot, task.scene).map_err(|name| PlanError::Shape { name })?;
    let (start_rad, goal_rad) = (&task.start_rad, &task.goal_rad);
    let relaxed = match (task.margin, world.contact(start_rad)) {
        (StartMargin::Scene, Some(contact)) => return Err(PlanError::too_close(PoseOf::Start, contact)),
        (StartMargin::Scene, None) => None,
        (StartMargin::AsItStands, _) => Some(Relaxed::around(&world, start_rad)?),
    };
    if let Some(contact) = world.contact(goal_rad) {
        return Err(PlanError::too_close(PoseOf::Goal, contact));
    }
    if is_clear(&world, start_rad) {
        return Pipeline::new(&world, &budget, options, &evaluator).run(start_rad, goal_rad);
    }
    plan_out(&world, relaxed.as_ref(), (&budget, &evaluator), (task, options))
}

/// Plans from a start inside the margin or at its edge: out of it first.
fn plan_out(
    world: &World,
    relaxed: Option<&Relaxed>,
    (budget, evaluator): (&Budget, &Evaluator),
    (task, options): (&Task, &PlanOptions),
) -> Result<Plan, PlanError> {
    let ends = [&task.start_rad, &task.goal_rad];
    let full = world.contact(&task.start_rad).is_none().then_some((world, None));
    let reduced = relaxed.map(|r| (&r.world, Some(r.note.clone())));
    for (near, note) in full.into_iter().chain(reduced) {
        if let Some(pose_rad) = find_margin_exit([near, world], ends, options.seed, budget) {
            let margin_exit = MarginExit { near, start_rad: task.start_rad, note };
            return Pipeline::new(world, budget, options, evaluator)
                .margin_exit(margin_exit)
                .run(&pose_rad, &task.goal_rad);
        }
    }
    // No exit path nearby: the reduced margin along the whole motion, rather than an arm that cannot be moved.
    let Some(relaxed) = relaxed else {
        return Pipeline::new(world, budget, options, evaluator).run(&task.start_rad, &task.goal_rad);
    };
    let mut plan =
        Pipeline::new(&relaxed.world, budget, options, evaluator).run(&task.start_rad, &task.goal_rad)?;
    plan.how = format!("{}; {}", relaxed.note.words(None), plan.how);
    Ok(plan)
}

impl PlanError {
    /// A pose that touches something, or is nearer to it than it may be.
    pub(crate) fn too_close(which: PoseOf, contact: Contact) -> Self {
        if contact.touches() {
            Self::InCollision { which, contact }
        } else {
            Self::InsideMargin { which, contact }
        }
    }
}

pub(crate) fn check_pose(robot: &Robot, which: PoseOf, pose_rad: &JointArray) -> Result<(), PlanError> {
    let joints = robot.joints.len();
    for (joint, &value_rad) in pose_rad.iter().enumerate() {
        if !value_rad.is_finite() || (joint >= joints && value_rad != 0.0) {
            return Err(PlanError::BadPose { which, joint, value_rad, joints });
        }
    }
    for (joint, (described, &value_rad)) in robot.joints.iter().zip(pose_rad).enumerate() {
        let range_rad = described.limits.position_rad;
        let by_rad = (range_rad[0] - value_rad).max(value_rad - range_rad[1]);
        if by_rad > 0.0 {
            let name = described.name.clone();
            return Err(PlanError::OutsideLimits { which, joint, name, value_rad, by_rad, range_rad });
        }
    }
    Ok(())
}
