//! `taustream plan`: from a pose to a goal, as a verified trajectory file.
use super::tip_lines::TipLines;
use super::torque_use::Torques;
use super::verify::{PeakTable, PeakUse, Unmodelled, clearance_words, peak_use};
use crate::args::{Goal, PlanArgs};
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, deliver};
use crate::progress::while_it_takes;
use serde::Serialize;
use std::fmt;
use std::time::{Duration, Instant};
use taustream_arm::text::counted;
use taustream_arm::{Robot, TrajectoryFile};
use taustream_motion::JointArray;
use taustream_planner::budget::Budget;
use taustream_planner::goals::{TipError, plan_line_keeping};
use taustream_planner::held::check_held;
use taustream_planner::{
    Finder, GoalError, Plan, PlanOptions, PoseOf, Situation, StartMargin, TipTarget, check_pose,
    plan_through, plan_to_any, plan_to_tip,
};

/// The summary of a plan.
#[derive(Debug, Serialize)]
struct Summary {
    robot: String,
    /// The group that alone moves; null for all joints.
    group: Option<String>,
    digest: String,
    file: Option<String>,
    planner: String,
    seed: u64,
    planning_s: f64,
    objective: &'static str,
    duration_s: f64,
    /// Mechanical work of the joints; null for a robot that states no masses.
    #[serde(rename = "energy_J")]
    energy_j: Option<f64>,
    strokes: usize,
    /// Of the path in joint space.
    path_length_rad: f64,
    clearance_m: f64,
    clearance_at_s: f64,
    clearance_between: [String; 2],
    unmodelled_links: Vec<String>,
    clearance_required_m: f64,
    peak_use: Vec<PeakUse>,
    #[serde(flatten)]
    torques: Torques,
    #[serde(flatten)]
    tip: TipLines,
    goal_rad: Vec<f64>,
    /// Units of `goal_rad`, one a joint; left out where all are rad.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    units: Vec<&'static str>,
    /// Where the tip was to go, when a position was requested.
    target_m: Option<[f64; 3]>,
    /// Upper bound of how far off it ends.
    position_error_m: Option<f64>,
    /// How the tip was to be turned (x, y, z, w), when that was requested.
    target_quaternion_xyzw: Option<[f64; 4]>,
    /// By what angle it ends turned from that, about the axes that are not free.
    orientation_error_rad: Option<f64>,
    /// Length of the straight line of the tip, when one was requested.
    line_m: Option<f64>,
    /// How far the tip is from it at most.
    line_off_m: Option<f64>,
    /// What was done, in its order.
    stages: Vec<StageLine>,
    /// True when people shall see the stages, too.
    #[serde(skip)]
    explain: bool,
}

/// One stage of planning.
#[derive(Debug, Serialize)]
struct StageLine {
    what: String,
    took_s: f64,
    /// Duration of the best verified motion after it.
    motion_s: Option<f64>,
    #[serde(skip)]
    line: String,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "planned by    {} in {:.3} s (seed {})", self.planner, self.planning_s, self.seed)?;
        if let Some(group) = &self.group {
            writeln!(f, "moves         group {group}; the other joints hold")?;
        }
        if self.explain {
            for stage in &self.stages {
                writeln!(f, "  {}", stage.line)?;
            }
        }
        let (duration_s, length_rad) = (self.duration_s, self.path_length_rad);
        writeln!(
            f,
            "duration      {duration_s:.3} s, {}, {length_rad:.3} {} long",
            counted(self.strokes, "stroke"),
            if self.units.is_empty() { "rad" } else { "rad and m" }
        )?;
        if let Some(energy_j) = self.energy_j {
            writeln!(f, "energy        {energy_j:.2} J of mechanical work, nothing recovered")?;
        }
        write!(f, "{}", self.torques)?;
        let [a, b] = &self.clearance_between;
        writeln!(
            f,
            "clearance     {}",
            clearance_words((self.clearance_m, self.clearance_required_m), self.clearance_at_s, (a, b))
        )?;
        write!(f, "{}{}", Unmodelled(&self.unmodelled_links), self.tip)?;
        if let (Some([x, y, z]), Some(error_m)) = (self.target_m, self.position_error_m) {
            let turned = self.orientation_error_rad.map(|rad| format!(", turned by {rad:.1e} rad"));
            let turned = turned.unwrap_or_default();
            writeln!(f, "position      {x}, {y}, {z} m, at most {error_m:.1e} m off{turned}, in the pose")?;
            let unit = |joint: usize| if self.units.get(joint) == Some(&"m") { "m" } else { "" };
            let goal = self.goal_rad.iter().enumerate();
            let angles: Vec<String> = goal.map(|(joint, q)| format!("{q:.6}{}", unit(joint))).collect();
            writeln!(f, "              {} rad", angles.join(","))?;
        }
        if let (Some(line_m), Some(off_m)) = (self.line_m, self.line_off_m) {
            writeln!(
                f,
                "straight line {line_m:.4} m of the tip, which is at most {:.3} mm off it",
                1e3 * off_m
            )?;
        }
        write!(f, "{}", PeakTable(&self.peak_use))?;
        match &self.file {
            Some(file) => write!(f, "written to    {file}"),
            None => write!(f, "not saved; -o FILE writes the trajectory file"),
        }
    }
}

/// Plans, and writes file and summary.
pub(crate) fn run(form: Form, args: &PlanArgs) -> Result<(), Failure> {
    let robot = arm::modelled_robot(&args.robot)?;
    let scene = arm::scene(&args.scene)?;
    let (start, option) = args.start();
    let start_rad = start.pose_of(&robot, option)?;
    let group = args.goal.group_of(&robot)?.cloned();
    let robot = match &group {
        Some(group) => {
            // Else a joint that stands outside its range would be led in.
            check_pose(&robot, PoseOf::Start, &start_rad)
                .map_err(|error| explain(&error.into(), args, &robot))?;
            robot.holding(group.others(robot.joints.len()), &start_rad)
        }
        None => robot,
    };
    let default = PlanOptions::default();
    let deadline = args.deadline_ms.map(|ms| Duration::from_millis(ms.into()));
    let options = PlanOptions {
        seed: args.seed,
        deadline: deadline.unwrap_or(default.deadline),
        spends_deadline: deadline.is_some(),
        planner: args.planner,
        reading: args.reading,
        objective: args.objective,
        blend: args.via.blend(),
        constraints: args.goal.constraints(&robot)?,
        ..default
    };
    let situation = Situation { robot: &robot, scene: &scene, start_rad, margin: StartMargin::Scene };
    let goal = args.goal.of(&robot, &start_rad)?;
    if let (Goal::Tip(_), Some(option)) = (&goal, args.via.given())
        && (args.goal.linear || option == "--via")
    {
        let why = "a straight line of the tip has no corners, and way points need a goal of the joints";
        return Err(Failure::Usage(format!("{option}: {why}")));
    }
    let work = || match goal {
        Goal::Tip(target) if args.goal.linear => straight(&situation, &target, (args, &options)).map(Ok),
        Goal::Tip(target) => Ok(to_tip(&situation, &target, (args, &options))),
        Goal::Poses(goals_rad) => to_poses(&situation, &goals_rad, (args, &options)),
    };
    let found = while_it_takes(form, "planning", work)?.map_err(|error| {
        if args.explain {
            error.stages().iter().for_each(|stage| form.progress(format_args!("  {stage}")));
        }
        explain(&error, args, &robot)
    })?;
    let held_joints = group.as_ref().map_or(0, |group| group.others(robot.joints.len()));
    check_held(&robot, &found.plan.trajectory, held_joints)
        .map_err(|moved| Failure::Failed(moved.to_string()))?;
    let json = TrajectoryFile {
        robot: robot.name.clone(),
        digest: Some(robot.digest_hex()),
        kinds: robot.kinds(),
        trajectory: found.plan.trajectory.clone(),
    }
    .to_json();

    let summary = summarise(&robot, found, args);
    deliver(form, args.output.as_deref(), &json, &summary)
}

/// A plan, and by how much it misses the target of the tip.
struct Planned {
    plan: Plan,
    tip: Option<(TipTarget, TipError)>,
    /// Length of the tip's straight line, and how far it is off.
    line: Option<[f64; 2]>,
}

fn straight(
    situation: &Situation,
    target: &TipTarget,
    (args, options): (&PlanArgs, &PlanOptions),
) -> Result<Planned, Failure> {
    let started = Instant::now();
    let budget = args
        .deadline_ms
        .map_or_else(Budget::unbounded, |ms| Budget::until(Duration::from_millis(ms.into()), None));
    let asked = (&args.goal.tip_speed(), &options.constraints);
    let found = plan_line_keeping(situation, target, asked, &budget)
        .map_err(|error| Failure::Refused(format!("no plan: {error}")))?;
    let line = Some([found.length_m, found.off_m]);
    let plan = found.into_plan("straight line of the tip".to_owned(), started.elapsed().as_secs_f64());
    let tip = Some((*target, target.error(situation.robot, &plan.trajectory.end_rad())));
    Ok(Planned { plan, tip, line })
}

fn to_tip(
    situation: &Situation,
    target: &TipTarget,
    (args, options): (&PlanArgs, &PlanOptions),
) -> Result<Planned, GoalError> {
    let finder = args.reach_with.map_or(Finder::Inverse, Finder::Swarm);
    let reached = plan_to_tip(situation, (target, finder), options, None)?;
    Ok(Planned { plan: reached.plan, tip: Some((*target, reached.error)), line: None })
}

/// To the best of several poses, or through way points to the only one.
fn to_poses(
    situation: &Situation,
    goals_rad: &[JointArray],
    (args, options): (&PlanArgs, &PlanOptions),
) -> Result<Result<Planned, GoalError>, Failure> {
    let Situation { robot, scene, start_rad, .. } = *situation;
    let via_rad = args.via.poses_of((robot, args.goal.group_of(robot)?), &start_rad)?;
    let plan = if via_rad.is_empty() {
        plan_to_any(situation, goals_rad, options, None).map(|(plan, _)| plan)
    } else if let [goal_rad] = goals_rad {
        let all_rad: Vec<JointArray> =
            std::iter::once(start_rad).chain(via_rad).chain(std::iter::once(*goal_rad)).collect();
        plan_through(robot, scene, &all_rad, options).map_err(GoalError::Plan)
    } else {
        return Err(Failure::Usage("--via needs one goal; several were given".to_owned()));
    };
    Ok(plan.map(|plan| Planned { plan, tip: None, line: None }))
}

/// A second sentence for positions that look like millimetres.
fn millimetres_hint(error: &GoalError, args: &PlanArgs) -> Option<String> {
    let (GoalError::TooFar { distance_m, reach_m }, Some(target)) = (error, args.goal.tip()) else {
        return None;
    };
    let largest = target.position_m.iter().map(|x| x.abs()).fold(0.0, f64::max);
    (*distance_m > 10.0 * reach_m && largest <= 1e3 * reach_m).then(|| {
        format!(
            "positions are in m, and {largest} looks like millimetres: {largest} mm = {} m",
            largest * 1e-3
        )
    })
}

fn explain(error: &GoalError, args: &PlanArgs, robot: &Robot) -> Failure {
    let group = args.goal.group_of(robot).ok().flatten();
    let goal_hint = || args.goal.angles().find_map(|(goal, _)| goal.degrees_hint(robot, group));
    let hint =
        args.start().0.degrees_hint(robot, None).or_else(goal_hint).or_else(|| millimetres_hint(error, args));
    Failure::Refused(match hint {
        Some(hint) => format!("no plan: {error} ({hint})"),
        None => format!("no plan: {error}"),
    })
}

/// The units of the joints of a robot with prismatic ones; none where all are rad.
pub(crate) fn units(robot: &Robot) -> Vec<&'static str> {
    if !robot.has_prismatic() {
        return Vec::new();
    }
    robot.joints.iter().map(|joint| joint.kind.unit()).collect()
}

fn summarise(robot: &Robot, Planned { plan: found, tip, line }: Planned, args: &PlanArgs) -> Summary {
    let goal_rad = found.trajectory.end_rad().iter().take(robot.joints.len()).copied().collect();
    let path_length_rad = found.path_length_rad();
    let stages = found.stages.iter().map(|stage| StageLine {
        what: stage.what.clone(),
        took_s: stage.took_s,
        motion_s: stage.motion_s,
        line: stage.to_string(),
    });
    let (a, b) = found.proof.clearance_between;
    Summary {
        robot: robot.name.clone(),
        group: args.goal.group_of(robot).ok().flatten().map(|group| group.name.clone()),
        digest: robot.digest_hex(),
        file: args.output.as_ref().map(|p| p.display().to_string()),
        planner: found.how,
        seed: args.seed,
        planning_s: found.planning_s,
        objective: args.objective.name(),
        duration_s: found.proof.duration_s,
        energy_j: found.energy_j,
        strokes: found.trajectory.strokes().len(),
        path_length_rad,
        stages: stages.collect(),
        explain: args.explain,
        clearance_m: found.proof.clearance_m,
        clearance_at_s: found.proof.clearance_at_s,
        clearance_between: [a, b],
        unmodelled_links: robot.unmodelled_links.clone(),
        clearance_required_m: found.proof.clearance_required_m,
        peak_use: peak_use(robot, &found.proof.peaks),
        torques: Torques::of(robot, &found.trajectory),
        tip: TipLines::of(&args.goal.constraints(robot).unwrap_or_default(), found.tip_use),
        goal_rad,
        units: units(robot),
        target_m: tip.map(|(target, _)| target.position_m),
        position_error_m: tip.map(|(_, error)| error.position_m),
        target_quaternion_xyzw: tip
            .and_then(|(target, _)| target.orientation)
            .map(|o| o.rotation.coords.into()),
        line_m: line.map(|[length_m, _]| length_m),
        line_off_m: line.map(|[_, off_m]| off_m),
        orientation_error_rad: tip.and_then(|(target, error)| error.angle_rad(&target)),
    }
}
