//! From two poses to a verified motion.
use crate::budget::Budget;
use crate::collide::{Course, Motion, SweepRules};
use crate::constraints::{TipConstraints, TipFault, TipRules, TipUse};
use crate::enter::Entry;
use crate::explain::{Explanation, Stage};
use crate::kind::{Improvement, PlannerKind};
use crate::margin_exit::{MarginExit, Relaxed, find_margin_exit, is_clear};
use crate::objective::{Evaluator, Objective};
use crate::pipeline::Pipeline;
use crate::verify::{Contact, Proof, Violation};
use crate::world::World;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_arm::{NoMasses, Robot, Scene};
use taustream_messages::way_points::Blend;
use taustream_motion::digits::{Amount, OutsideRange};
use taustream_motion::range::INSIDE_RAD;
use taustream_motion::{JointArray, JointKind, LimitSet, MAX_STROKES, Trajectory};
use taustream_optimizers::Reading;

/// What [`Plan::how`] says when the clock cut the work short, so that one seed may give another answer.
pub(crate) const CUT_SHORT: &str = ", cut short by the deadline";

/// How to plan.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// How far from the corners of its path the motion may pass.
    pub blend: Blend,
    /// What the tip must keep along the whole motion.
    pub constraints: TipConstraints,
    /// True when the clock aborts at the deadline. Without it only the budget that is derived from the deadline ends the
    /// work, so that one seed gives one answer on any machine, however busy: for comparisons, not for arms.
    pub keeps_deadline: bool,
    /// True to spend the deadline on shorter motions; false to answer with what a few searches and shortcuts find, in milliseconds,
    /// and to use the deadline only as long as there is no answer.
    pub spends_deadline: bool,
}

impl Default for PlanOptions {
    fn default() -> Self {
        let (deadline, planner) = (Duration::from_millis(2000), PlannerKind::Auto);
        let (reading, improvement) = (Reading::Corrected, Improvement::default());
        let (objective, blend) = (Objective::default(), Blend::default());
        let (keeps_deadline, spends_deadline) = (true, false);
        Self {
            seed: 0,
            deadline,
            planner,
            reading,
            improvement,
            objective,
            blend,
            constraints: TipConstraints::default(),
            keeps_deadline,
            spends_deadline,
        }
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
    /// Mechanical energy of the motion ([`crate::energy`]); `None` when the robot states no masses.
    pub energy_j: Option<f64>,
    /// How long planning took.
    pub planning_s: f64,
    /// Processor time of the planning thread until the first verified motion.
    pub first_s: f64,
    /// Poses that searches, shortcuts and refinements checked: the measure of work that every machine agrees on.
    pub checks: usize,
    /// What the motion uses of its constraints; `None` without any.
    pub tip_use: Option<TipUse>,
    /// What was done, in its order.
    pub stages: Vec<Stage>,
}

/// Stack of a thread that plans: trajectories lie on it by the dozen, 78 kB each, so that the 2 MiB that threads have by default are too few.
pub const STACK_BYTES: usize = 32 << 20;

impl Plan {
    /// Length of the path in joint space, rad; see [`path_length_rad`].
    #[must_use]
    pub fn path_length_rad(&self) -> f64 {
        path_length_rad(&self.trajectory, 0.0)
    }
}

/// Length of a motion's path in joint space from an instant on, rad, where a metre of a prismatic joint counts as a radian: the sum of the norms of the differences of all joints, by dense samples.
#[must_use]
pub fn path_length_rad(trajectory: &Trajectory, from_s: f64) -> f64 {
    const SAMPLES: u32 = 2_000;
    let (course, left_s) = (Course::new(trajectory), trajectory.duration_s() - from_s);
    let at = |i: u32| course.at(from_s + left_s * f64::from(i) / f64::from(SAMPLES));
    let mut before_rad = at(0);
    let mut length_rad = 0.0;
    for i in 1..=SAMPLES {
        let now_rad = at(i);
        let square: f64 = now_rad.iter().zip(&before_rad).map(|(a, b)| (a - b).powi(2)).sum();
        length_rad += square.sqrt();
        before_rad = now_rad;
    }
    length_rad
}

/// Which of the two given poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseOf {
    /// Where the motion begins.
    Start,
    /// Where it shall end.
    Goal,
    /// A pose that it shall pass, counted from 0.
    Via(usize),
}

impl PoseOf {
    fn kind(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Goal => "goal",
            Self::Via(_) => "way point",
        }
    }
}

impl std::fmt::Display for PoseOf {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Start => f.write_str("start"),
            Self::Goal => f.write_str("goal"),
            Self::Via(number) => write!(f, "way point {}", number + 1),
        }
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
        "{which} outside limits: joint {} ({name}) at {}; {}",
        joint + 1,
        OutsideRange { kind: *kind, position_rad: *value_rad, range_rad: *range_rad },
        match which {
            PoseOf::Start => "choose a start inside, or lead an arm that stands there back with `taustream recover`",
            PoseOf::Goal => "choose a goal inside",
            PoseOf::Via(_) => "choose a way point inside",
        }
    )]
    OutsideLimits {
        /// Which pose.
        which: PoseOf,
        /// Zero-based index of the joint.
        joint: usize,
        /// The joint's name.
        name: String,
        /// Rad, or m.
        kind: JointKind,
        /// The value that was given.
        value_rad: f64,
        /// How far outside.
        by_rad: f64,
        /// Lowest and highest angle.
        range_rad: [f64; 2],
    },
    /// The arm touches something in a given pose.
    #[error("{which} in collision: {contact}; choose another {which}{}", contact.correction())]
    InCollision {
        /// Which pose.
        which: PoseOf,
        /// What touches what.
        contact: Contact,
    },
    /// The arm touches nothing in a given pose, but is nearer to something than the margin of the scene, or of the robot's
    /// links; a goal must keep [`SweepRules::EDGE_END_M`] more.
    #[error("{which} nearer than the margin: {contact}{}; choose another {which} or a smaller margin", match which {
        PoseOf::Start => String::new(),
        PoseOf::Via(_) => format!(" (a way point keeps {} m more, or no way to it can be proven)", SweepRules::EDGE_END_M),
    PoseOf::Goal => format!(" (a goal keeps {} m more, or no way to it can be proven)", SweepRules::EDGE_END_M),
    })]
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
    #[error("no path found: {tried}; {remedy}")]
    NotFound {
        /// What was tried, with counts and the obstacle in the way.
        tried: String,
        /// What ended the search, and what helps.
        remedy: Remedy,
        /// What was done, in its order.
        explanation: Box<Explanation>,
    },
    /// A joint would be on its way for longer than any motion may take.
    #[error(
        "the motion would take at least {least_s:.0} s, and the longest is {LONGEST_S:.0} s: joint {} ({name}) has to go {} {} with \
         {} = {}, {} = {}, {} = {}; correct its motion limits or choose a nearer goal",
        joint + 1, Amount(*by_rad), kind.unit(), kind.rate_keys()[0], motion.velocity_rad_s, kind.rate_keys()[1],
        motion.acceleration_rad_s2, kind.rate_keys()[2], motion.jerk_rad_s3
    )]
    TooSlow {
        /// Zero-based index of the joint.
        joint: usize,
        /// The joint's name.
        name: String,
        /// Rad, or m.
        kind: JointKind,
        /// How far it has to go.
        by_rad: f64,
        /// What it may do.
        motion: LimitSet,
        /// Lower bound of the duration.
        least_s: f64,
    },
    /// A pose violates a constraint of the tip.
    #[error("the {which} violates a constraint of the tip: {fault}; choose another {}, or a wider constraint", which.kind())]
    Constraint {
        /// Which pose.
        which: PoseOf,
        /// Which constraint.
        fault: TipFault,
    },
    /// Constraints that make no sense for this robot.
    #[error(transparent)]
    Constraints(TipFault),
    /// A planner that keeps no constraints of poses.
    #[error(
        "planner {planner} does not keep the tip upright or inside a box; use auto, straight or rrt-connect"
    )]
    Unconstrained {
        /// Its name.
        planner: String,
    },
    /// A path was found, but no timing of it fits into a message.
    #[error(
        "a path was found ({tried}), but not in {MAX_STROKES} strokes: it is too long, or has too many corners, for the motion \
         limits; raise them or choose a nearer goal"
    )]
    Untimed {
        /// What found the path.
        tried: String,
        /// What was done, in its order.
        explanation: Box<Explanation>,
    },
    /// A path was found, but its timed motion could not be proven.
    #[error("a path was found ({tried}), but its motion is not proven: {violation}")]
    Unproven {
        /// What found the path.
        tried: String,
        /// Why the proof failed.
        violation: Violation,
        /// What was done, in its order.
        explanation: Box<Explanation>,
    },
}

/// What ended a search, and what helps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Remedy {
    /// The clock: more time helps.
    #[error("the deadline of {} ms ended it: try a longer one", .0.as_millis())]
    Clock(Duration),
    /// The evaluations that the deadline grants.
    #[error("the evaluations that a deadline of {} ms grants are spent: try another seed, planner or goal, or a longer deadline", .0.as_millis())]
    Budget(Duration),
    /// Only the straight line was asked for.
    #[error("only the straight line was asked for: try another planner or goal")]
    Planner,
}

impl Remedy {
    /// True when the clock ended the work.
    #[must_use]
    pub fn is_clock(self) -> bool {
        matches!(self, Self::Clock(_))
    }
}

/// Longest motion that is planned (s): a day. What would take longer is a slip of a unit in the limits.
const LONGEST_S: f64 = 86_400.0;

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

/// Plans a verified motion that passes poses in their order, each within the blend of the options: straight from one to the
/// next where that is free, around what blocks it elsewhere.
///
/// # Errors
/// What is wrong with a pose, or what was tried in vain.
pub fn plan_through(
    robot: &Robot,
    scene: &Scene,
    poses_rad: &[JointArray],
    options: &PlanOptions,
) -> Result<Plan, PlanError> {
    plan_through_until((robot, scene, StartMargin::Scene), poses_rad, options, None)
}

/// Like [`plan_through`], and given up as soon as `cancel` is set.
///
/// # Errors
/// What is wrong with a pose, or what was tried in vain.
pub fn plan_through_until(
    (robot, scene, margin): (&Robot, &Scene, StartMargin),
    poses_rad: &[JointArray],
    options: &PlanOptions,
    cancel: Option<&AtomicBool>,
) -> Result<Plan, PlanError> {
    let budget = Budget::until(options.clock(), cancel);
    let evaluator = Evaluator::new(options.objective, robot)?;
    let world = World::new(robot, scene).map_err(|name| PlanError::Shape { name })?;
    check_constraints(&world, poses_rad, options)?;
    if let (StartMargin::AsItStands, Some((start_rad, onward_rad))) = (margin, poses_rad.split_first()) {
        check_numbers(robot, PoseOf::Start, start_rad)?;
        let entry = Entry::of(robot, start_rad);
        let relaxed = Relaxed::around(&world, start_rad)?;
        let onward_rad = clear_poses_from(1, &world, onward_rad)?;
        if entry.is_some() || !is_clear(&world, start_rad) {
            let onward = (*start_rad, onward_rad.as_slice());
            return plan_out(
                &world,
                (Some(&relaxed), entry.as_ref()),
                (&budget, &evaluator),
                (onward, options),
            );
        }
        return Pipeline::new(&world, &budget, options, &evaluator).run_onward(start_rad, &onward_rad);
    }
    let inside_rad = clear_poses(&world, poses_rad)?;
    Pipeline::new(&world, &budget, options, &evaluator).run_through(&inside_rad)
}

/// Poses of a motion, each inside the limits and clear of everything.
///
/// # Errors
/// Which pose is not, and why.
pub(crate) fn clear_poses(world: &World, poses_rad: &[JointArray]) -> Result<Vec<JointArray>, PlanError> {
    clear_poses_from(0, world, poses_rad)
}

/// The same of poses before which a motion has some others.
fn clear_poses_from(
    before: usize,
    world: &World,
    poses_rad: &[JointArray],
) -> Result<Vec<JointArray>, PlanError> {
    let robot = world.robot();
    let last = (before + poses_rad.len()).saturating_sub(1);
    let mut inside_rad = Vec::with_capacity(poses_rad.len());
    for (i, pose_rad) in (before..).zip(poses_rad) {
        let which = match i {
            0 => PoseOf::Start,
            _ if i == last => PoseOf::Goal,
            _ => PoseOf::Via(i - 1),
        };
        check_pose(robot, which, pose_rad)?;
        let pose_rad = nearest_inside(robot, pose_rad);
        // A goal keeps more, or no edge to it can be proven; so must what lies between.
        let more_m = if i == 0 { 0.0 } else { SweepRules::EDGE_END_M };
        if let Some(contact) = world.contact_within(&pose_rad, more_m) {
            return Err(PlanError::too_close(which, contact));
        }
        inside_rad.push(pose_rad);
    }
    Ok(inside_rad)
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
    check_numbers(task.robot, PoseOf::Start, &task.start_rad)?;
    let entry = Entry::of(task.robot, &task.start_rad);
    if task.margin == StartMargin::Scene {
        check_pose(task.robot, PoseOf::Start, &task.start_rad)?;
    }
    check_pose(task.robot, PoseOf::Goal, &task.goal_rad)?;
    // A goal at a limit ends inside of it, whatever rounding does.
    let asked_rad = task.goal_rad;
    let task = &Task { goal_rad: nearest_inside(task.robot, &asked_rad), ..*task };
    check_duration(task)?;
    let mut plan = plan_inside(task, options, (&budget, entry.as_ref()))?;
    if let Some(words) = goal_words(task, &asked_rad) {
        plan.how = format!("{words}; {}", plan.how);
    }
    Ok(plan)
}

/// Plans to a goal inside the limits.
fn plan_inside(
    task: &Task,
    options: &PlanOptions,
    (budget, entry): (&Budget, Option<&Entry>),
) -> Result<Plan, PlanError> {
    let evaluator = Evaluator::new(options.objective, task.robot)?;
    let world = World::new(task.robot, task.scene).map_err(|name| PlanError::Shape { name })?;
    let (start_rad, goal_rad) = (&task.start_rad, &task.goal_rad);
    check_constraints(&world, &[*start_rad, *goal_rad], options)?;
    let relaxed = match (task.margin, world.contact(start_rad)) {
        (StartMargin::Scene, Some(contact)) => return Err(PlanError::too_close(PoseOf::Start, contact)),
        (StartMargin::Scene, None) => None,
        (StartMargin::AsItStands, _) => Some(Relaxed::around(&world, start_rad)?),
    };
    if let Some(contact) = world.contact_within(goal_rad, SweepRules::EDGE_END_M) {
        return Err(PlanError::too_close(PoseOf::Goal, contact));
    }
    if entry.is_none() && is_clear(&world, start_rad) {
        return Pipeline::new(&world, budget, options, &evaluator).run(start_rad, goal_rad);
    }
    let onward = (*start_rad, std::slice::from_ref(goal_rad));
    plan_out(&world, (relaxed.as_ref(), entry), (budget, &evaluator), (onward, options))
}

/// Plans from a start outside the limits, inside the margin or at its edge: out of there first, and on to one pose or through several.
fn plan_out(
    world: &World,
    (relaxed, entry): (Option<&Relaxed>, Option<&Entry>),
    (budget, evaluator): (&Budget, &Evaluator),
    ((start_rad, onward_rad), options): ((JointArray, &[JointArray]), &PlanOptions),
) -> Result<Plan, PlanError> {
    let towards_rad = onward_rad.first().unwrap_or(&start_rad);
    let inside_rad = entry.map_or(start_rad, |entry| entry.pose_rad);
    let led_in = |mut plan: Plan| {
        if let Some(entry) = entry {
            plan.how = format!("{}; {}", entry.words, plan.how);
        }
        plan
    };
    let full = world.contact(&start_rad).is_none().then_some((world, None));
    let reduced = relaxed.map(|r| (&r.world, Some(r.note.clone())));
    for (near, note) in full.into_iter().chain(reduced) {
        let (clear_rad, first_rad) = if is_clear(world, &inside_rad) {
            (Some(inside_rad), vec![start_rad])
        } else {
            let first_rad = if entry.is_some() { vec![start_rad, inside_rad] } else { vec![start_rad] };
            (find_margin_exit([near, world], [&inside_rad, towards_rad], options.seed, budget), first_rad)
        };
        if let Some(clear_rad) = clear_rad {
            let pipeline = Pipeline::new(world, budget, options, evaluator);
            return pipeline
                .margin_exit(MarginExit { near, first_rad, note })
                .run_onward(&clear_rad, onward_rad)
                .map(led_in);
        }
    }
    // No exit path nearby: the reduced margin along the whole motion, rather than an arm that cannot be moved.
    let near = relaxed.map_or(world, |relaxed| &relaxed.world);
    let mut pipeline = Pipeline::new(near, budget, options, evaluator);
    if entry.is_some() {
        pipeline = pipeline.margin_exit(MarginExit { near, first_rad: vec![start_rad], note: None });
    }
    let mut plan = pipeline.run_onward(&inside_rad, onward_rad)?;
    if let Some(relaxed) = relaxed {
        plan.how = format!("{}; {}", relaxed.note.words(None), plan.how);
    }
    Ok(led_in(plan))
}

impl PlanError {
    /// What was done before it failed, in its order; empty where nothing was begun.
    #[must_use]
    pub fn stages(&self) -> &[Stage] {
        match self {
            Self::NotFound { explanation, .. }
            | Self::Untimed { explanation, .. }
            | Self::Unproven { explanation, .. } => &explanation.stages,
            Self::BadPose { .. }
            | Self::OutsideLimits { .. }
            | Self::InCollision { .. }
            | Self::InsideMargin { .. }
            | Self::Shape { .. }
            | Self::NoMasses(_)
            | Self::Constraint { .. }
            | Self::Constraints(_)
            | Self::Unconstrained { .. }
            | Self::TooSlow { .. } => &[],
        }
    }

    /// A pose that touches something, or is nearer to it than it may be.
    pub(crate) fn too_close(which: PoseOf, contact: Contact) -> Self {
        if contact.touches() {
            Self::InCollision { which, contact }
        } else {
            Self::InsideMargin { which, contact }
        }
    }
}

/// Refuses poses of a motion that violate constraints of the tip, and constraints that no planner of this name keeps.
fn check_constraints(
    world: &World,
    poses_rad: &[JointArray],
    options: &PlanOptions,
) -> Result<(), PlanError> {
    let rules = TipRules::in_world(world, &options.constraints).map_err(PlanError::Constraints)?;
    let Some(rules) = rules.filter(TipRules::are_of_poses) else { return Ok(()) };
    if !options.planner.keeps_constraints() {
        return Err(PlanError::Unconstrained { planner: options.planner.name().to_owned() });
    }
    let last = poses_rad.len().saturating_sub(1);
    for (i, pose_rad) in poses_rad.iter().enumerate() {
        let which = match i {
            0 => PoseOf::Start,
            _ if i == last => PoseOf::Goal,
            _ => PoseOf::Via(i - 1),
        };
        rules.check_pose(pose_rad).map_err(|fault| PlanError::Constraint { which, fault })?;
    }
    Ok(())
}

/// Refuses goals that a joint cannot reach within [`LONGEST_S`], whatever the path.
fn check_duration(task: &Task) -> Result<(), PlanError> {
    let ends = task.start_rad.iter().zip(&task.goal_rad);
    for (joint, (described, (start_rad, goal_rad))) in task.robot.joints.iter().zip(ends).enumerate() {
        let (by_rad, motion) = ((goal_rad - start_rad).abs(), described.limits.motion);
        // From rest to rest: half of the way is gained at the full acceleration, or jerk, at most.
        let least_s = (by_rad / motion.velocity_rad_s)
            .max(2.0 * (by_rad / motion.acceleration_rad_s2).sqrt())
            .max((32.0 * by_rad / motion.jerk_rad_s3).cbrt());
        if by_rad > 0.0 && least_s > LONGEST_S {
            let (name, kind) = (described.name.clone(), described.kind);
            return Err(PlanError::TooSlow { joint, name, kind, by_rad, motion, least_s });
        }
    }
    Ok(())
}

/// What is reported when a goal at a limit was taken inside of it.
fn goal_words(task: &Task, asked_rad: &JointArray) -> Option<String> {
    let joints = task.robot.joints.iter().zip(asked_rad.iter().zip(&task.goal_rad));
    let moved = joints.filter(|(_, (requested, goal))| (*requested - *goal).abs() > 2.0 * INSIDE_RAD);
    let words: Vec<String> = moved
        .map(|(joint, (requested, goal))| {
            format!("{} by {} {}", joint.name, Amount((requested - goal).abs()), joint.kind.unit())
        })
        .collect();
    (!words.is_empty()).then(|| format!("goal taken at the limit: {}", words.join(", ")))
}

/// The pose with every joint at the nearest angle at which a plan may end.
pub(crate) fn nearest_inside(robot: &Robot, pose_rad: &JointArray) -> JointArray {
    let mut inside_rad = *pose_rad;
    for (position_rad, joint) in inside_rad.iter_mut().zip(&robot.joints) {
        *position_rad = joint.limits.nearest_inside(*position_rad);
    }
    inside_rad
}

fn check_numbers(robot: &Robot, which: PoseOf, pose_rad: &JointArray) -> Result<(), PlanError> {
    let joints = robot.joints.len();
    for (joint, &value_rad) in pose_rad.iter().enumerate() {
        if !value_rad.is_finite() || (joint >= joints && value_rad != 0.0) {
            return Err(PlanError::BadPose { which, joint, value_rad, joints });
        }
    }
    Ok(())
}

/// Refuses a pose that no arm has, or that lies outside the limits by more than the tolerance.
///
/// # Errors
/// The first joint whose value is none, or outside.
pub fn check_pose(robot: &Robot, which: PoseOf, pose_rad: &JointArray) -> Result<(), PlanError> {
    check_numbers(robot, which, pose_rad)?;
    for (joint, (described, &value_rad)) in robot.joints.iter().zip(pose_rad).enumerate() {
        let limits = &described.limits;
        if !limits.is_inside(value_rad) {
            let (name, range_rad) = (described.name.clone(), limits.position_rad);
            let by_rad = limits.outside_rad(value_rad).abs();
            let kind = described.kind;
            return Err(PlanError::OutsideLimits { which, joint, name, kind, value_rad, by_rad, range_rad });
        }
    }
    Ok(())
}
