//! `taustream plan`: from two poses, or a pose and a position, to a verified trajectory file.
use super::verify::{PeakTable, PeakUse, Unmodelled, clearance_words, peak_use};
use crate::angles::Position;
use crate::args::PlanArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, deliver};
use serde::Serialize;
use std::fmt;
use std::time::Duration;
use taustream_arm::text::counted;
use taustream_arm::{Robot, Scene, TrajectoryFile};
use taustream_motion::JointArray;
use taustream_optimizers::Method;
use taustream_planner::{
    Plan, PlanOptions, PositionError, PositionTask, StartMargin, plan, plan_through, plan_to_position,
};

/// The summary of a plan.
#[derive(Debug, Serialize)]
struct Summary {
    robot: String,
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
    clearance_m: f64,
    clearance_at_s: f64,
    clearance_between: [String; 2],
    unmodelled_links: Vec<String>,
    clearance_required_m: f64,
    peak_use: Vec<PeakUse>,
    goal_rad: Vec<f64>,
    /// Where the tip was to go, when a position was requested.
    target_m: Option<[f64; 3]>,
    /// Upper bound of how far off it ends.
    position_error_m: Option<f64>,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "planned by    {} in {:.3} s (seed {})", self.planner, self.planning_s, self.seed)?;
        writeln!(f, "duration      {:.3} s, {}", self.duration_s, counted(self.strokes, "stroke"))?;
        if let Some(energy_j) = self.energy_j {
            writeln!(f, "energy        {energy_j:.2} J of mechanical work, nothing recovered")?;
        }
        let [a, b] = &self.clearance_between;
        writeln!(
            f,
            "clearance     {}",
            clearance_words((self.clearance_m, self.clearance_required_m), self.clearance_at_s, (a, b))
        )?;
        write!(f, "{}", Unmodelled(&self.unmodelled_links))?;
        if let (Some([x, y, z]), Some(error_m)) = (self.target_m, self.position_error_m) {
            writeln!(f, "position      {x}, {y}, {z} m, at most {error_m:.1e} m off, in the pose")?;
            let angles: Vec<String> = self.goal_rad.iter().map(|q| format!("{q:.6}")).collect();
            writeln!(f, "              {} rad", angles.join(","))?;
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
    let options = PlanOptions {
        seed: args.seed,
        deadline: Duration::from_millis(args.deadline_ms.into()),
        planner: args.planner,
        reading: args.reading,
        objective: args.objective,
        blend: args.blend(),
        ..PlanOptions::default()
    };
    let end = End::of(args, &robot)?;
    let found =
        end.plan((&robot, &scene), start_rad, &options).map_err(|error| explain(&error, args, &robot))?;
    let json = TrajectoryFile {
        robot: robot.name.clone(),
        digest: Some(robot.digest_hex()),
        trajectory: found.plan.trajectory.clone(),
    }
    .to_json();

    let summary = summarise(&robot, found, args);
    deliver(form, args.output.as_deref(), &json, &summary)
}

/// What a motion is planned to.
enum End {
    Pose(JointArray),
    /// The last of several poses.
    Through(Vec<JointArray>),
    Position([f64; 3], Option<&'static Method>),
}

/// A plan, and by how much it misses the position that was requested.
struct Planned {
    plan: Plan,
    position: Option<([f64; 3], f64)>,
}

impl End {
    fn of(args: &PlanArgs, robot: &Robot) -> Result<Self, Failure> {
        match (args.goal(), args.to_position) {
            (_, Some(Position(target_m))) => Ok(Self::Position(target_m, args.reach_with)),
            (Some((goal, option)), None) if args.via.is_empty() => {
                goal.pose_of(robot, option).map(Self::Pose)
            }
            (Some((goal, option)), None) => {
                let mut poses_rad =
                    args.via.iter().map(|via| via.pose_of(robot, "--via")).collect::<Result<Vec<_>, _>>()?;
                poses_rad.push(goal.pose_of(robot, option)?);
                Ok(Self::Through(poses_rad))
            }
            (None, None) => Err(Failure::Usage("give --goal, --goal-deg or --to-position".to_owned())),
        }
    }

    fn plan(
        &self,
        (robot, scene): (&Robot, &Scene),
        start_rad: JointArray,
        options: &PlanOptions,
    ) -> Result<Planned, PositionError> {
        match self {
            Self::Through(poses_rad) => {
                let all_rad: Vec<JointArray> =
                    std::iter::once(&start_rad).chain(poses_rad).copied().collect();
                let plan = plan_through(robot, scene, &all_rad, options)?;
                Ok(Planned { plan, position: None })
            }
            Self::Pose(goal_rad) => {
                let plan = plan(robot, scene, &start_rad, goal_rad, options)?;
                Ok(Planned { plan, position: None })
            }
            &Self::Position(target_m, method) => {
                let margin = StartMargin::Scene;
                let task = PositionTask { robot, scene, start_rad, target_m, margin, method };
                let reached = plan_to_position(&task, options, None)?;
                Ok(Planned { plan: reached.plan, position: Some((target_m, reached.error_m)) })
            }
        }
    }
}

/// A second sentence for positions that look like millimetres.
fn millimetres_hint(error: &PositionError, args: &PlanArgs) -> Option<String> {
    let (PositionError::TooFar { distance_m, reach_m }, Some(Position(target_m))) = (error, args.to_position)
    else {
        return None;
    };
    let largest = target_m.iter().map(|x| x.abs()).fold(0.0, f64::max);
    (*distance_m > 10.0 * reach_m && largest <= 1e3 * reach_m).then(|| {
        format!(
            "positions are in m, and {largest} looks like millimetres: {largest} mm = {} m",
            largest * 1e-3
        )
    })
}

fn explain(error: &PositionError, args: &PlanArgs, robot: &Robot) -> Failure {
    let goal_hint = || args.goal().and_then(|(goal, _)| goal.degrees_hint(robot));
    let hint =
        args.start().0.degrees_hint(robot).or_else(goal_hint).or_else(|| millimetres_hint(error, args));
    Failure::Refused(match hint {
        Some(hint) => format!("no plan: {error} ({hint})"),
        None => format!("no plan: {error}"),
    })
}

fn summarise(robot: &Robot, Planned { plan: found, position }: Planned, args: &PlanArgs) -> Summary {
    let goal_rad = found.trajectory.end_rad().iter().take(robot.joints.len()).copied().collect();
    let (a, b) = found.proof.clearance_between;
    Summary {
        robot: robot.name.clone(),
        digest: robot.digest_hex(),
        file: args.output.as_ref().map(|p| p.display().to_string()),
        planner: found.how,
        seed: args.seed,
        planning_s: found.planning_s,
        objective: args.objective.name(),
        duration_s: found.proof.duration_s,
        energy_j: found.energy_j,
        strokes: found.trajectory.strokes().len(),
        clearance_m: found.proof.clearance_m,
        clearance_at_s: found.proof.clearance_at_s,
        clearance_between: [a, b],
        unmodelled_links: robot.unmodelled_links.clone(),
        clearance_required_m: found.proof.clearance_required_m,
        peak_use: peak_use(robot, &found.proof.peaks),
        goal_rad,
        target_m: position.map(|(target_m, _)| target_m),
        position_error_m: position.map(|(_, error_m)| error_m),
    }
}
