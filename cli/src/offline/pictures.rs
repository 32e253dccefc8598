//! `taustream bench pictures`: one joint of one move as others make it and as ours, and of one replacement in motion.
use crate::args::PicturesArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use crate::plot::curves::{self, JointMotion};
use serde::Serialize;
use std::fmt;
use std::path::Path as FilePath;
use taustream_motion::duration::joints_duration_s;
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Stroke, Trajectory};
use taustream_planner::replacement::replacement;
use taustream_planner::timing::Path;
use taustream_planner::timing::line::LineLimits;

/// Joints that the poses below have.
const JOINTS: usize = 6;
/// Start, three points and goal of the move, rad.
const POINTS_RAD: [[f64; JOINTS]; 5] = [
    [0.0, -1.57, 1.57, -1.57, -1.57, 0.0],
    [0.7, -1.3, 1.4, -1.6, -1.3, 0.3],
    [1.2, -1.1, 1.5, -1.8, -1.2, 0.5],
    [2.0, -1.3, 1.7, -1.7, -1.4, 0.2],
    [2.6, -1.6, 1.6, -1.5, -1.57, 0.0],
];
/// How far from the three points it may pass, rad.
const BLEND_RAD: f64 = 0.15;
/// Exponent of the paper's strokes: 1/k with its k = 0.1.
const PAPER_N: u32 = 10;
/// Where the move of the second picture is led instead, rad; and the share of its time that has passed then.
const NEW_GOAL_RAD: [f64; JOINTS] = [0.4, -1.0, 1.9, -1.9, -1.2, 0.4];
const CUT_SHARE: f64 = 0.4;
/// The joint that is drawn.
const DRAWN: usize = 0;
/// Samples of each motion.
const SAMPLES: u32 = 600;

/// What was drawn.
#[derive(Serialize)]
struct Answer {
    pictures: Vec<Drawing>,
}

#[derive(Serialize)]
struct Drawing {
    file: String,
    motions: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    what: String,
    duration_s: f64,
    /// Highest velocity, acceleration and jerk of the joint that is drawn, over its limits.
    peaks: [f64; 3],
}

/// Draws both pictures, and says what is in them.
pub(super) fn run(form: Form, args: &PicturesArgs) -> Result<(), Failure> {
    let robot = arm::robot(&args.robot)?;
    if robot.joints.len() != JOINTS {
        let why =
            format!("{} has {} joints; the pictures have poses of {JOINTS}", robot.name, robot.joints.len());
        return Err(Failure::Usage(why));
    }
    let limits = robot.limits();
    let untimed = || Failure::Failed(format!("the limits of {} leave no motion to draw", robot.name));
    let via = via(&limits).ok_or_else(untimed)?;
    let replan = replan(&limits).ok_or_else(untimed)?;
    let drawn = &robot.joints.get(DRAWN..=DRAWN).unwrap_or_default();
    let title =
        |what: &str| format!("{what}: joint {} of {}, its motion limits dashed", DRAWN + 1, robot.name);
    let pictures = [
        ("via.svg", title(&format!("Through three points, {BLEND_RAD} rad past them at most")), via),
        ("replan.svg", title("Another goal in the middle of a move"), replan),
    ];
    let mut drawings = Vec::new();
    for (name, title, motions) in pictures {
        let file = args.output.join(name);
        write_whole(&file, &curves::svg(&file, &title, &motions, drawn)?)?;
        let motions = motions.iter().map(|motion| Row::of(motion, &limits)).collect();
        drawings.push(Drawing { file: FilePath::display(&file).to_string(), motions });
    }
    form.print(&Answer { pictures: drawings })
}

fn pose(rad: &[f64; JOINTS]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().zip(rad).for_each(|(pose, rad)| *pose = *rad);
    pose
}

/// The same five points in three ways.
fn via(limits: &[JointLimits; MAX_JOINTS]) -> Option<Vec<JointMotion>> {
    let corners_rad = POINTS_RAD.map(|rad| pose(&rad));
    let path = Path { corners_rad: &corners_rad, joints: JOINTS, limits };
    let ours = path.rounded(&[BLEND_RAD; 3], f64::INFINITY)?.trajectory;
    let paper = paper(&corners_rad, limits)?;
    Some(vec![
        whole("one stroke each (Wang et al.)", &paper),
        ruckig_stops(&corners_rad, limits)?,
        whole("taustream", &ours),
    ])
}

/// From point to point with one stroke each, as fast as the limits allow.
fn paper(corners_rad: &[JointArray], limits: &[JointLimits; MAX_JOINTS]) -> Option<Trajectory> {
    let (mut strokes, mut start_s) = (Vec::new(), 0.0);
    for pair in corners_rad.windows(2) {
        let [from, to] = pair else { return None };
        let mut delta_rad = [0.0; MAX_JOINTS];
        for (delta_rad, (from, to)) in delta_rad.iter_mut().zip(from.iter().zip(to)) {
            *delta_rad = to - from;
        }
        let duration_s = joints_duration_s(&delta_rad, limits, PAPER_N);
        strokes.push(Stroke { start_s, duration_s, n: PAPER_N, delta_rad });
        start_s += duration_s;
    }
    Trajectory::new(JOINTS, *corners_rad.first()?, &strokes).ok()
}

/// The optimum of each segment, one after the other: what Ruckig gives for a straight line from rest to rest.
fn ruckig_stops(corners_rad: &[JointArray], limits: &[JointLimits; MAX_JOINTS]) -> Option<JointMotion> {
    let (mut duration_s, mut samples) = (0.0, Vec::new());
    for pair in corners_rad.windows(2) {
        let [from, to] = pair else { return None };
        let optimum = LineLimits::between(from, to, (JOINTS, limits))?.optimum();
        let (from_rad, delta_rad) = (from.get(DRAWN)?, to.get(DRAWN)? - from.get(DRAWN)?);
        for k in 0..=SAMPLES {
            let t_s = optimum.duration_s() * f64::from(k) / f64::from(SAMPLES);
            let [s, v, a, j] = optimum.state(t_s);
            let values = [from_rad + delta_rad * s, delta_rad * v, delta_rad * a, delta_rad * j];
            samples.push((duration_s + t_s, values));
        }
        duration_s += optimum.duration_s();
    }
    Some(JointMotion { what: timed("Ruckig, stops", duration_s), duration_s, samples })
}

/// A straight move, what became of it, and what it would have been.
fn replan(limits: &[JointLimits; MAX_JOINTS]) -> Option<Vec<JointMotion>> {
    let [first, .., last] = POINTS_RAD.map(|rad| pose(&rad));
    let corners_rad = [first, last];
    let old = Path { corners_rad: &corners_rad, joints: JOINTS, limits }.stopping()?.trajectory;
    let at_s = CUT_SHARE * old.duration_s();
    let new = replacement(&old, at_s, &pose(&NEW_GOAL_RAD), limits)?;
    Some(vec![
        whole("the first move", &old),
        sampled(format!("kept until {at_s:.2} s"), &new, [0.0, at_s]),
        sampled(timed("replacement", new.duration_s()), &new, [at_s, new.duration_s()]),
    ])
}

fn timed(what: &str, duration_s: f64) -> String {
    format!("{what}: {duration_s:.2} s")
}

fn whole(what: &str, trajectory: &Trajectory) -> JointMotion {
    let duration_s = trajectory.duration_s();
    sampled(timed(what, duration_s), trajectory, [0.0, duration_s])
}

fn sampled(what: String, trajectory: &Trajectory, [from_s, to_s]: [f64; 2]) -> JointMotion {
    let mut cursor = Cursor::at_start(trajectory);
    let times = (0..=SAMPLES).map(|k| from_s + (to_s - from_s) * f64::from(k) / f64::from(SAMPLES));
    let samples = times.map(|t_s| {
        let s = cursor.sample(trajectory, t_s);
        let of = |values: &JointArray| values.get(DRAWN).copied().unwrap_or(f64::NAN);
        let blocks = [&s.position_rad, &s.velocity_rad_s, &s.acceleration_rad_s2, &s.jerk_rad_s3];
        (t_s, blocks.map(of))
    });
    JointMotion { what, duration_s: to_s, samples: samples.collect() }
}

impl Row {
    fn of(motion: &JointMotion, limits: &[JointLimits; MAX_JOINTS]) -> Self {
        let limit = limits.get(DRAWN).map(|limits| limits.motion).unwrap_or_default();
        let mut peaks = [0.0_f64; 3];
        for (_, [_, derivatives @ ..]) in &motion.samples {
            for (peak, value) in peaks.iter_mut().zip(derivatives) {
                *peak = peak.max(value.abs());
            }
        }
        let most = [limit.velocity_rad_s, limit.acceleration_rad_s2, limit.jerk_rad_s3];
        peaks.iter_mut().zip(most).for_each(|(peak, most)| *peak /= most);
        Self { what: motion.what.clone(), duration_s: motion.duration_s, peaks }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "peaks are shares of the motion limits of joint {}", DRAWN + 1)?;
        for Drawing { file, motions } in &self.pictures {
            write!(f, "\n{file}")?;
            for Row { what, peaks: [v, a, j], .. } in motions {
                write!(f, "\n  {what:<40} velocity {v:.3}, acceleration {a:.3}, jerk {j:.3}")?;
            }
        }
        Ok(())
    }
}
