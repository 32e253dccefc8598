//! `taustream verify`: the proof that a motion keeps limits and clearance, or the first violation.
use super::tip_lines::TipLines;
use super::torque_use::Torques;
use crate::args::{VerifyArgs, constraints_of, group_of};
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, note};
use serde::Serialize;
use std::fmt;
use taustream_arm::text::counted;
use taustream_arm::{Robot, RobotJoint};
use taustream_motion::digits::Decimals;
use taustream_motion::limits::Peaks;
use taustream_planner::enter::Entry;
use taustream_planner::verify_keeping;

/// Why every trajectory that passed the file's door is smooth: any sum of strokes with n >= 4 is C3.
const CONTINUITY: &str = "position, velocity, acceleration and jerk are continuous (a sum of Tau-J* strokes)";

/// What was proven.
#[derive(Debug, Serialize)]
struct Answer {
    verified: bool,
    robot: String,
    trajectory: String,
    duration_s: f64,
    strokes: usize,
    clearance_m: f64,
    clearance_at_s: f64,
    clearance_between: [String; 2],
    unmodelled_links: Vec<String>,
    clearance_required_m: f64,
    continuity: &'static str,
    peak_use: Vec<PeakUse>,
    #[serde(flatten)]
    torques: Torques,
    #[serde(flatten)]
    tip: TipLines,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = &self.clearance_between;
        writeln!(f, "verified      {} for robot {}", self.trajectory, self.robot)?;
        writeln!(f, "duration      {:.3} s, {}", self.duration_s, counted(self.strokes, "stroke"))?;
        writeln!(
            f,
            "clearance     {}",
            clearance_words((self.clearance_m, self.clearance_required_m), self.clearance_at_s, (a, b))
        )?;
        write!(f, "{}", Unmodelled(&self.unmodelled_links))?;
        writeln!(f, "continuity    {}", self.continuity)?;
        write!(f, "{}{}", self.torques, self.tip)?;
        write!(f, "{}", PeakTable(&self.peak_use))
    }
}

/// Verifies and prints the proof.
pub(crate) fn run(form: Form, VerifyArgs { motion: args, tip, group }: &VerifyArgs) -> Result<(), Failure> {
    let path = args.trajectory.path();
    let scene = arm::scene(&args.scene)?;
    let (robot, file) = arm::motion_of(args.robot.as_deref(), path)?;
    robot.require_modelled()?;
    let asked = constraints_of(tip, &robot, group_of(&robot, group.as_deref())?)?;
    let (proof, tip_use) = verify_keeping(&robot, &scene, (&file.trajectory, &asked))
        .map_err(|v| Failure::Refused(format!("{}: not safe: {v}", path.display())))?;
    let (a, b) = proof.clearance_between;
    if let Some(entry) = Entry::of(&robot, file.trajectory.base_rad()) {
        note(format_args!("note: {}", entry.words));
    }
    form.print(&Answer {
        verified: true,
        robot: robot.name.clone(),
        trajectory: path.display().to_string(),
        duration_s: proof.duration_s,
        strokes: file.trajectory.strokes().len(),
        clearance_m: proof.clearance_m,
        clearance_at_s: proof.clearance_at_s,
        clearance_between: [a, b],
        unmodelled_links: robot.unmodelled_links.clone(),
        clearance_required_m: proof.clearance_required_m,
        continuity: CONTINUITY,
        peak_use: peak_use(&robot, &proof.peaks),
        torques: Torques::of(&robot, &file.trajectory),
        tip: TipLines::of(&asked, tip_use),
    })
}

/// A line that names the links without a shape, where there are some.
pub(crate) struct Unmodelled<'a>(pub(crate) &'a [String]);

impl fmt::Display for Unmodelled<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return Ok(());
        }
        writeln!(f, "UNMODELLED    {}: no shape, so NOTHING keeps them from being hit", self.0.join(", "))
    }
}

/// How much of its motion limits one joint uses at most; peaks are proven upper bounds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct PeakUse {
    joint: String,
    velocity_rad_s: f64,
    velocity_percent: f64,
    acceleration_rad_s2: f64,
    acceleration_percent: f64,
    jerk_rad_s3: f64,
    jerk_percent: f64,
}

/// Peaks beside the motion limits, one entry a joint.
pub(crate) fn peak_use(robot: &Robot, peaks: &Peaks) -> Vec<PeakUse> {
    let peaks = peaks.velocity_rad_s.iter().zip(&peaks.acceleration_rad_s2).zip(&peaks.jerk_rad_s3);
    let entry = |(joint, ((v, a), j)): (&RobotJoint, ((&f64, &f64), &f64))| {
        let motion = &joint.limits.motion;
        PeakUse {
            joint: joint.name.clone(),
            velocity_rad_s: *v,
            velocity_percent: 100.0 * v / motion.velocity_rad_s,
            acceleration_rad_s2: *a,
            acceleration_percent: 100.0 * a / motion.acceleration_rad_s2,
            jerk_rad_s3: *j,
            jerk_percent: 100.0 * j / motion.jerk_rad_s3,
        }
    };
    robot.joints.iter().zip(peaks).map(entry).collect()
}

/// Peak use as a table for people.
pub(crate) struct PeakTable<'a>(pub(crate) &'a [PeakUse]);

impl fmt::Display for PeakTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "peak use of the motion limits (velocity, acceleration, jerk):")?;
        for p in self.0 {
            let (v, a, j) = (p.velocity_percent, p.acceleration_percent, p.jerk_percent);
            writeln!(f, "  {:<18} {v:>4.0} % {a:>4.0} % {j:>4.0} %", p.joint)?;
        }
        Ok(())
    }
}

/// Clearance as text; infinite when nothing can collide.
pub(crate) fn clearance_words(
    (clearance_m, required_m): (f64, f64),
    at_s: f64,
    between: (&str, &str),
) -> String {
    let (a, b) = between;
    if clearance_m < required_m {
        // Each pair keeps what it must, another one less than this: without the time to look for the least distance, no more is known.
        let required = Decimals::apart(&[required_m], 4).show(required_m);
        format!(
            "more than {required} m at t = {at_s:.3} s, between {a} and {b}, as required; the deadline left no time to find the least distance"
        )
    } else if clearance_m.is_finite() {
        let decimals = Decimals::apart(&[clearance_m, required_m], 4);
        let (clearance, required) = (decimals.show(clearance_m), decimals.show(required_m));
        format!("{clearance} m at t = {at_s:.3} s, between {a} and {b} (more than {required} m required)")
    } else {
        "unlimited: nothing in this scene can collide".to_owned()
    }
}
