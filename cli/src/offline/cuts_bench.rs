//! `taustream bench cuts`: how long replacements of running motions take, against the optimum from the state at the cut.
use super::limit_sets::{LimitedArm, limit_sets};
use crate::args::CutsBenchArgs;
use crate::failure::Failure;
use crate::output::Form;
use rsruckig::prelude::{
    ControlInterface, InputParameter, Ruckig, Synchronization, ThrowErrorHandler,
    Trajectory as RuckigTrajectory,
};
use serde::Serialize;
use std::fmt;
use std::time::Instant;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Trajectory};
use taustream_planner::replacement::replacement;
use taustream_planner::rng::SeededRng;
use taustream_planner::timing::Path;

/// Lengths of the moves that are cut, and distances of the new goals from the pose at the cut (rad).
const REACH_RAD: [f64; 2] = [0.1, 4.0];
/// Every so many cuts begin with a new move; those between cut the replacement before.
const CHAIN: u32 = 2;

/// The cuts under one set of limits.
#[derive(Serialize)]
struct Row {
    limits: String,
    cuts: usize,
    /// Cuts for which no strokes were found.
    refused: usize,
    /// Duration from the cut over the optimum.
    median: f64,
    p95: f64,
    largest: f64,
    /// Median time to find the strokes, microseconds.
    planning_us: f64,
}

/// The measurement, for people and programs.
#[derive(Serialize)]
struct Answer {
    cuts: Vec<Row>,
}

/// Measures and prints.
pub(super) fn run(form: Form, args: &CutsBenchArgs) -> Result<(), Failure> {
    let arms = limit_sets(&args.robot)?;
    form.progress(format_args!(
        "cutting {} motions under each of {} sets of limits ..",
        args.cuts,
        arms.len()
    ));
    let rows: Option<Vec<Row>> = arms.iter().map(|arm| row(arm, args)).collect();
    let cuts =
        rows.ok_or_else(|| Failure::Failed("no motion could be timed under these limits".to_owned()))?;
    form.print(&Answer { cuts })
}

fn row(arm: &LimitedArm, args: &CutsBenchArgs) -> Option<Row> {
    let mut rng = SeededRng::new(args.seed, 0);
    // Positions are free: what is measured is time.
    let limits = arm.limits.map(|limits| JointLimits { position_rad: [-1e3, 1e3], ..limits });
    let (mut ratios, mut times_us, mut refused) = (Vec::new(), Vec::new(), 0);
    let mut running: Option<(Trajectory, f64)> = None;
    for number in 0..args.cuts {
        if number % CHAIN == 0 {
            running = None;
        }
        let (motion, from_s) = match running.take() {
            Some(running) => running,
            None => (straight(&mut rng, arm, &limits)?, 0.0),
        };
        let at_s = from_s + (motion.duration_s() - from_s) * rng.unit();
        let goal_rad = away(&mut rng, arm, &motion.sample(at_s).position_rad);
        let begun = Instant::now();
        let found = replacement(&motion, at_s, &goal_rad, &limits);
        times_us.push(begun.elapsed().as_secs_f64() * 1e6);
        match found {
            None => refused += 1,
            Some(found) => {
                let optimum_s = optimum_s((&motion, at_s), &goal_rad, (arm.joints, &limits))?;
                ratios.push((found.duration_s() - at_s) / optimum_s);
                running = Some((found, at_s));
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    times_us.sort_by(f64::total_cmp);
    let part = |values: &[f64], of_100: usize| {
        values.get((values.len() * of_100 / 100).min(values.len() - 1)).copied()
    };
    Some(Row {
        limits: arm.name.clone(),
        cuts: ratios.len(),
        refused,
        median: part(&ratios, 50)?,
        p95: part(&ratios, 95)?,
        largest: *ratios.last()?,
        planning_us: part(&times_us, 50)?,
    })
}

/// A pose whose joints are up to a random distance away.
fn away(rng: &mut SeededRng, arm: &LimitedArm, from_rad: &JointArray) -> JointArray {
    let [least, most] = REACH_RAD;
    let reach_rad = least * (most / least).powf(rng.unit());
    let mut to_rad = *from_rad;
    to_rad.iter_mut().take(arm.joints).for_each(|q| *q += rng.within(-reach_rad, reach_rad));
    to_rad
}

fn straight(rng: &mut SeededRng, arm: &LimitedArm, limits: &[JointLimits; MAX_JOINTS]) -> Option<Trajectory> {
    let from_rad = [0.0; MAX_JOINTS];
    let corners_rad = [from_rad, away(rng, arm, &from_rad)];
    Some(Path { corners_rad: &corners_rad, joints: arm.joints, limits }.stopping()?.trajectory)
}

/// Ruckig's state-to-state optimum for all joints together (s).
fn optimum_s(
    (motion, at_s): (&Trajectory, f64),
    goal_rad: &JointArray,
    (joints, limits): (usize, &[JointLimits; MAX_JOINTS]),
) -> Option<f64> {
    let state = motion.sample(at_s);
    let mut slowest_s: f64 = 0.0;
    for joint in 0..joints {
        let mut input = InputParameter::<1>::new(None);
        input.control_interface = ControlInterface::Position;
        input.synchronization = Synchronization::None;
        input.current_position[0] = state.position_rad[joint];
        input.current_velocity[0] = state.velocity_rad_s[joint];
        input.current_acceleration[0] = state.acceleration_rad_s2[joint];
        input.target_position[0] = goal_rad[joint];
        let motion = limits[joint].motion;
        input.max_velocity[0] = motion.velocity_rad_s;
        input.max_acceleration[0] = motion.acceleration_rad_s2;
        input.max_jerk[0] = motion.jerk_rad_s3;
        let mut solution = RuckigTrajectory::new(None);
        Ruckig::<1, ThrowErrorHandler>::new(None, 0.001).calculate(&input, &mut solution).ok()?;
        slowest_s = slowest_s.max(solution.get_duration());
    }
    (slowest_s > 0.0).then_some(slowest_s)
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "replacements: duration from the cut / Ruckig's optimum from the same state (all joints, each for itself); \
             at most 1.15 at the median and 1.4 at the 95th percentile are promised"
        )?;
        write!(
            f,
            "{:<30} {:>6} {:>7} {:>7} {:>7} {:>7} {:>8}",
            "limits", "cuts", "refused", "median", "p95", "largest", "us"
        )?;
        for row in &self.cuts {
            let Row { limits, cuts, refused, median, p95, largest, planning_us } = row;
            write!(
                f,
                "\n{limits:<30} {cuts:>6} {refused:>7} {median:>7.3} {p95:>7.3} {largest:>7.3} {planning_us:>8.0}"
            )?;
        }
        Ok(())
    }
}
