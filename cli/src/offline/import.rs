//! `taustream import`: a motion made elsewhere as a verified trajectory file.
use super::verify::{PeakTable, PeakUse, Unmodelled, clearance_words, peak_use};
use crate::args::ImportArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, deliver};
use serde::Serialize;
use std::fmt;
use std::io;
use std::path::Path;
use taustream_arm::text::counted;
use taustream_arm::{MotionTable, Robot, Scene, TrajectoryFile};
use taustream_motion::{JointArray, JointKind};
use taustream_optimizers::papers::spline_time::SplineCost;
use taustream_planner::import::{
    ImportError, Imported, Reference, TimedBy, Via, ViaProfile, fitted_durations_s, import, import_path,
    import_strokes, optimised_durations_s, poses_of,
};

/// Speeds at the ends of a table that are worth a word (rad/s).
const AT_REST_RAD_S: f64 = 0.01;

/// The summary of an import.
#[derive(Debug, Serialize)]
struct Summary {
    robot: String,
    digest: String,
    file: Option<String>,
    source: String,
    exact: bool,
    original_s: f64,
    duration_s: f64,
    time_added_s: f64,
    time_scale: f64,
    strokes: usize,
    n: Option<u32>,
    kernel_s: Option<f64>,
    delay_s: f64,
    deviation_rad: f64,
    deviation_joint: String,
    /// Unit of the deviation; left out where it is rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    deviation_unit: Option<&'static str>,
    deviation_at_s: f64,
    notes: Vec<String>,
    clearance_m: f64,
    clearance_at_s: f64,
    clearance_between: [String; 2],
    unmodelled_links: Vec<String>,
    clearance_required_m: f64,
    peak_use: Vec<PeakUse>,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "imported      {}", self.source)?;
        let (original_s, added_s) = (self.original_s, self.time_added_s);
        writeln!(
            f,
            "duration      {:.3} s, {}; the original takes {original_s:.3} s, {added_s:+.3} s",
            self.duration_s,
            counted(self.strokes, "stroke")
        )?;
        if self.time_scale > 1.0 {
            writeln!(f, "SLOWED DOWN   {:.4} times, to keep the motion limits", self.time_scale)?;
        }
        if self.exact {
            writeln!(f, "deviation     none: the profile is a stroke")?;
        } else {
            let (joint, at_s) = (&self.deviation_joint, self.deviation_at_s);
            writeln!(
                f,
                "deviation     at most {:.6} {}, {joint} at t = {at_s:.3} s",
                self.deviation_rad,
                self.deviation_unit.unwrap_or("rad")
            )?;
        }
        for note in &self.notes {
            writeln!(f, "note          {note}")?;
        }
        let [a, b] = &self.clearance_between;
        writeln!(
            f,
            "clearance     {}",
            clearance_words((self.clearance_m, self.clearance_required_m), self.clearance_at_s, (a, b))
        )?;
        write!(f, "{}", Unmodelled(&self.unmodelled_links))?;
        write!(f, "{}", PeakTable(&self.peak_use))?;
        match &self.file {
            Some(file) => write!(f, "written to    {file}"),
            None => write!(f, "not saved; -o FILE writes the trajectory file"),
        }
    }
}

/// What is imported, as text, and what is worth saying about it.
struct Source {
    words: String,
    notes: Vec<String>,
}

/// Imports, and writes file and summary.
pub(crate) fn run(form: Form, args: &ImportArgs) -> Result<(), Failure> {
    let robot = arm::modelled_robot(&args.robot)?;
    let scene = arm::scene(&args.scene)?;
    let (imported, source) = match &args.table {
        Some(table) => from_table(args, table, &robot, &scene)?,
        None => from_points(args, &robot, &scene)?,
    };
    let file = TrajectoryFile {
        robot: robot.name.clone(),
        digest: Some(robot.digest_hex()),
        kinds: robot.kinds(),
        trajectory: imported.trajectory.clone(),
    };
    let summary = summarise(&robot, &imported, source, args);
    deliver(form, args.output.as_deref(), &file.to_json(), &summary)
}

/// Files of angles say nothing of metres.
fn refuse_prismatic(robot: &Robot, file: &str) -> Result<(), Failure> {
    let Some(joint) = robot.joints.iter().find(|joint| joint.kind.is_prismatic()) else { return Ok(()) };
    Err(Failure::Usage(format!(
        "{file} holds angles, and joint {} of robot `{}` is prismatic (m); give points by --via",
        joint.name, robot.name
    )))
}

fn from_table(
    args: &ImportArgs,
    path: &Path,
    robot: &Robot,
    scene: &Scene,
) -> Result<(Imported, Source), Failure> {
    refuse_prismatic(robot, "a table")?;
    let joints: Vec<String> = robot.joints.iter().map(|joint| joint.name.clone()).collect();
    let table = if path == Path::new("-") {
        MotionTable::read(Path::new("standard input"), io::stdin().lock(), &joints)?
    } else {
        MotionTable::load(path, &joints)?
    };
    let mut notes = Vec::new();
    if !table.ignored.is_empty() {
        notes.push(format!("ignored columns: {}", table.ignored.join(", ")));
    }
    if table.began_s != 0.0 {
        notes.push(format!("its clock begins at {} s; that is 0 here", table.began_s));
    }
    let words = format!("{} of {}", counted(table.t_s.len(), "row"), path.display());
    let reference = Reference::of_table(table, &robot.limits()).map_err(|e| refused(&e))?;
    notes.extend(reference.note().map(str::to_owned));
    let imported = import(robot, scene, &reference, args.tolerance_rad).map_err(|e| refused(&e))?;
    Ok((imported, Source { words, notes }))
}

fn from_points(args: &ImportArgs, robot: &Robot, scene: &Scene) -> Result<(Imported, Source), Failure> {
    if args.path.is_some() {
        refuse_prismatic(robot, "a path file")?;
    }
    let path = args.path.as_deref().map(arm::path).transpose()?;
    let points_rad: Vec<JointArray> = match &path {
        Some(path) => poses_of(robot, path).map_err(|e| refused(&e))?,
        None => args.via.iter().map(|angles| angles.pose_of(robot, "--via")).collect::<Result<_, _>>()?,
    };
    let joints = robot.joints.len();
    if points_rad.len() < 2 {
        let why = "one --via is no motion; give it once for each of two or more points";
        return Err(Failure::Usage(why.to_owned()));
    }
    let by_file = path.as_ref().and_then(|path| path.profile.clone()).filter(|_| !args.blend.is_given());
    let Some(name) = args.profile.clone().or(by_file) else {
        let of_profiles = args.k.is_some() || args.durations.is_some() || args.timed_by.is_some();
        if of_profiles {
            let names = ViaProfile::NAMES.join(", ");
            return Err(Failure::Usage(format!(
                "--k, --durations and --timed-by are for a --profile: {names}; without one the points are timed by the limits"
            )));
        }
        let imported = import_path((robot, scene), &points_rad, args.blend.blend());
        let words = format!("{} along straight lines", counted(points_rad.len(), "point"));
        return Ok((imported.map_err(|e| refused(&e))?, Source { words, notes: Vec::new() }));
    };
    if args.blend.is_given() {
        let why = "a blend rounds straight lines; a --profile has its own way through the points";
        return Err(Failure::Usage(why.to_owned()));
    }
    let profile = ViaProfile::from_name(&name, args.k).map_err(|e| Failure::Usage(e.to_string()))?;
    let (durations_s, notes) = durations(args, profile, &points_rad, robot)?;
    let via = Via { points_rad: &points_rad, joints, profile, durations_s: &durations_s };
    let imported = if let Some(n) = profile.stroke_n() {
        import_strokes(robot, scene, &via, n)
    } else {
        let reference = Reference::through(&via).map_err(|e| refused(&e))?;
        import(robot, scene, &reference, args.tolerance_rad)
    };
    let words = format!("{} by {}", counted(points_rad.len(), "point"), profile.name());
    Ok((imported.map_err(|e| refused(&e))?, Source { words, notes }))
}

/// How long each piece takes, with a word on it: as given, as an optimiser finds, or as short as the limits allow.
fn durations(
    args: &ImportArgs,
    profile: ViaProfile,
    points_rad: &[JointArray],
    robot: &Robot,
) -> Result<(Vec<f64>, Vec<String>), Failure> {
    if let Some(durations) = &args.durations {
        return Ok((durations.0.clone(), Vec::new()));
    }
    let words =
        |durations_s: &[f64]| durations_s.iter().map(|s| format!("{s:.4}")).collect::<Vec<_>>().join(", ");
    let Some(method) = &args.timed_by else {
        let durations_s = fitted_durations_s(points_rad, robot.joints.len(), profile, &robot.limits())
            .map_err(|e| refused(&e))?;
        let note = format!("durations as short as the limits allow: {} s", words(&durations_s));
        return Ok((durations_s, vec![note]));
    };
    if profile != ViaProfile::BSpline7 {
        return Err(Failure::Usage(format!(
            "--timed-by is for profile b-spline7, not for {}",
            profile.name()
        )));
    }
    let evaluations = usize::try_from(args.evaluations).unwrap_or(usize::MAX);
    let by = TimedBy { method, seed: args.seed, evaluations };
    let (durations_s, cost) = optimised_durations_s(points_rad, robot, &by).map_err(|e| refused(&e))?;
    let SplineCost { time_s, jerk_rad_s3, broken, cost, .. } = cost;
    let note = format!(
        "durations by {method} (seed {}): {} s; time {time_s:.4} s, impact {jerk_rad_s3:.4} rad/s^3, {broken} limits \
         broken, cost {cost:.6}",
        args.seed,
        words(&durations_s)
    );
    Ok((durations_s, vec![note]))
}

/// What does not fit the words or files is bad usage; what is no motion for this arm is refused.
fn refused(error: &ImportError) -> Failure {
    let text = format!("not imported: {error}");
    let is_usage = matches!(
        error,
        ImportError::Duration { .. }
            | ImportError::Durations { .. }
            | ImportError::Joints { .. }
            | ImportError::NoNear
            | ImportError::Optimiser { .. }
    );
    if is_usage { Failure::Usage(text) } else { Failure::Refused(text) }
}

fn summarise(robot: &Robot, imported: &Imported, source: Source, args: &ImportArgs) -> Summary {
    let (a, b) = imported.proof.clearance_between.clone();
    let deviation = imported.deviation;
    let mut notes = source.notes;
    for (end, speed) in ["begins", "ends"].into_iter().zip(imported.end_speeds_rad_s) {
        if speed > AT_REST_RAD_S {
            notes.push(format!(
                "the original {end} at {speed:.3} rad/s; the import {end} at rest there, rounded"
            ));
        }
    }
    Summary {
        robot: robot.name.clone(),
        digest: robot.digest_hex(),
        file: args.output.as_ref().map(|p| p.display().to_string()),
        source: source.words,
        exact: imported.kernel.is_none() && deviation.rad == 0.0,
        original_s: imported.original_s,
        duration_s: imported.proof.duration_s,
        time_added_s: imported.proof.duration_s - imported.original_s,
        time_scale: imported.time_scale,
        strokes: imported.trajectory.strokes().len(),
        n: imported.kernel.map(|kernel| kernel.n),
        kernel_s: imported.kernel.map(|kernel| kernel.width_s),
        delay_s: imported.kernel.map_or(0.0, |kernel| kernel.delay_s),
        deviation_rad: deviation.rad,
        deviation_joint: robot.joints.get(deviation.joint).map(|j| j.name.clone()).unwrap_or_default(),
        deviation_unit: Some(robot.kind(deviation.joint))
            .filter(|kind| kind.is_prismatic())
            .map(JointKind::unit),
        deviation_at_s: deviation.at_s,
        notes,
        clearance_m: imported.proof.clearance_m,
        clearance_at_s: imported.proof.clearance_at_s,
        clearance_between: [a, b],
        unmodelled_links: robot.unmodelled_links.clone(),
        clearance_required_m: imported.proof.clearance_required_m,
        peak_use: peak_use(robot, &imported.proof.peaks),
    }
}
