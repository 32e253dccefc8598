//! Rounded paths of five random points against stops at every point.
use super::{LimitedArm, Spread, timed};
use crate::args::TimingArgs;
use serde::Serialize;
use std::fmt;
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};
use taustream_planner::rng::SeededRng;
use taustream_planner::timing::Path;
use taustream_planner::timing::line::LineLimits;

/// How far from the corners a motion may pass (rad).
const BLENDS_RAD: [f64; 3] = [0.02, 0.1, 0.4];
/// Shortest path (rad), and how many times longer the longest is.
const LENGTHS_RAD: [f64; 2] = [0.3, 40.0];
/// Poses of a motion that are written for another solver.
const SAMPLES: u32 = 600;

/// The paths of one blend under one arm's limits.
#[derive(Serialize)]
pub(super) struct PathRow {
    limits: String,
    blend_rad: f64,
    paths: u32,
    /// Paths that were rounded; the others stop at every point.
    rounded: usize,
    ratio: Spread,
    /// Median processor time to find a motion, microseconds.
    timing_us: f64,
}

/// A motion, for another solver.
#[derive(Serialize)]
pub(super) struct Sampled {
    limits: String,
    blend_rad: f64,
    length_rad: f64,
    duration_s: f64,
    /// Sum of the optima that stop at every point.
    stops_s: f64,
    velocity_rad_s: Vec<f64>,
    acceleration_rad_s2: Vec<f64>,
    jerk_rad_s3: Vec<f64>,
    /// At even times from start to end.
    position_rad: Vec<Vec<f64>>,
}

impl Sampled {
    /// One line of JSON.
    pub(super) fn to_line(&self) -> String {
        serde_json::to_string(self).map_or_else(|_| String::new(), |line| line + "\n")
    }

    fn of(arm: &LimitedArm, motion: &Trajectory, [blend_rad, length_rad, stops_s]: [f64; 3]) -> Self {
        let limits = || arm.limits.iter().take(arm.joints).map(|l| l.motion);
        let duration_s = motion.duration_s();
        let at = |i: u32| motion.sample(duration_s * f64::from(i) / f64::from(SAMPLES)).position_rad;
        Self {
            limits: arm.name.clone(),
            blend_rad,
            length_rad,
            duration_s,
            stops_s,
            velocity_rad_s: limits().map(|m| m.velocity_rad_s).collect(),
            acceleration_rad_s2: limits().map(|m| m.acceleration_rad_s2).collect(),
            jerk_rad_s3: limits().map(|m| m.jerk_rad_s3).collect(),
            position_rad: (0..=SAMPLES).map(|i| at(i).iter().take(arm.joints).copied().collect()).collect(),
        }
    }
}

pub(super) fn rows(arm: &LimitedArm, args: &TimingArgs) -> (Vec<PathRow>, Vec<Sampled>) {
    let (mut rows, mut motions) = (Vec::new(), Vec::new());
    for blend_rad in BLENDS_RAD {
        rows.extend(row(arm, args, blend_rad, &mut motions));
    }
    (rows, motions)
}

fn row(arm: &LimitedArm, args: &TimingArgs, blend_rad: f64, motions: &mut Vec<Sampled>) -> Option<PathRow> {
    let (mut ratios, mut times_us, mut rounded) = (Vec::new(), Vec::new(), 0);
    for number in 0..args.paths {
        let share = f64::from(number) / f64::from((args.paths - 1).max(1));
        let length_rad = LENGTHS_RAD[0] * LENGTHS_RAD[1].powf(share);
        let mut rng = SeededRng::new(args.seed, u64::from(number));
        let corners_rad = random_path(&mut rng, arm.joints, length_rad);
        let path = Path { corners_rad: &corners_rad, joints: arm.joints, limits: &arm.limits };
        let blends_rad = vec![blend_rad; corners_rad.len() - 2];
        let (found, took_us) = timed(|| path.rounded(&blends_rad, f64::INFINITY));
        times_us.push(took_us);
        rounded += usize::from(found.is_some());
        let motion = found.or_else(|| path.stopping())?.trajectory;
        let stop_s = |pair: &[JointArray]| {
            let [from, to] = pair else { return None };
            Some(LineLimits::between(from, to, (arm.joints, &arm.limits))?.optimum().duration_s())
        };
        let stops_s: f64 = corners_rad.windows(2).filter_map(stop_s).sum();
        ratios.push(motion.duration_s() / stops_s);
        motions.push(Sampled::of(arm, &motion, [blend_rad, length_rad, stops_s]));
    }
    let (ratio, timing_us) = (Spread::of(ratios)?, Spread::of(times_us)?.median);
    Some(PathRow { limits: arm.name.clone(), blend_rad, paths: args.paths, rounded, ratio, timing_us })
}

/// Five points; the segments' lengths differ by up to three times.
fn random_path(rng: &mut SeededRng, joints: usize, length_rad: f64) -> Vec<JointArray> {
    let mut corners_rad = vec![[0.0; MAX_JOINTS]];
    let (mut total_rad, mut last) = (0.0, [0.0; MAX_JOINTS]);
    for _ in 0..4 {
        let mut step = [0.0; MAX_JOINTS];
        step.iter_mut().take(joints).for_each(|q| *q = rng.within(-1.0, 1.0));
        let norm = step.iter().map(|q| q * q).sum::<f64>().sqrt();
        let segment = rng.within(0.5, 1.5);
        total_rad += segment;
        last.iter_mut().zip(&step).for_each(|(q, step)| *q += step * segment / norm);
        corners_rad.push(last);
    }
    corners_rad.iter_mut().flatten().for_each(|q| *q *= length_rad / total_rad);
    corners_rad
}

impl fmt::Display for PathRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Spread { median, largest } = self.ratio;
        write!(
            f,
            "{:<30} {:>9} {median:>7.3} {largest:>7.3} {:>8} {:>6.0}",
            self.limits,
            self.blend_rad,
            format!("{}/{}", self.rounded, self.paths),
            self.timing_us
        )
    }
}
