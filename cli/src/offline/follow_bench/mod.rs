//! `taustream bench follow`: how far a motion lags behind a stream of targets, and how smooth it is, beside Ruckig and
//! interpolation.
mod comparison;
mod follower;
mod measure;
mod signals;

use crate::args::FollowBenchArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use comparison::{Chase, Interpolation};
use follower::Following;
use measure::{Measured, measure, peaks};
use serde::Serialize;
use signals::Signal;
use std::fmt;
use taustream_motion::{JointLimits, LimitSet};

/// Distance of logged setpoints, s.
const TICK_S: f64 = 1e-3;
/// The beginning is left out, ms: everything starts at rest.
const SKIPPED: usize = 2000;
/// Streams that are measured, with their rates, Hz.
const STREAMS: [(Signal, f64); 5] = [
    (Signal::Swing, 30.0),
    (Signal::Swing, 125.0),
    (Signal::Hand, 10.0),
    (Signal::Hand, 30.0),
    (Signal::Hand, 125.0),
];
/// Offsets of chunks, rad.
const OFFSETS_RAD: [f64; 3] = [0.02, 0.045, 0.07];
/// Rate of the targets in chunks, Hz; how many a chunk has, and how many of them are reached before the next one comes.
const CHUNK_HZ: f64 = 30.0;
const CHUNK: u32 = 16;
const REACHED: u32 = 8;

/// One stream, by every method.
#[derive(Debug, Serialize)]
struct Row {
    stream: String,
    taustream: Measured,
    ruckig: Measured,
    linear: Measured,
    cubic: Measured,
    /// Our lag over Ruckig's.
    lag_ratio: f64,
    /// After a stream that breaks off in full motion: how far the motion goes beyond its last target, mrad.
    overshoot_mrad: f64,
    planning_us_median: f64,
    strokes_max: usize,
}

/// Peak jerk of chunks that do not fit to each other, rad/s^3.
#[derive(Debug, Serialize)]
struct Seam {
    offset_mrad: f64,
    taustream: f64,
    ruckig: f64,
    linear: f64,
    cubic: f64,
}

#[derive(Debug, Serialize)]
struct Answer {
    robot: String,
    limits: LimitsOf,
    latency_ms: u32,
    streams: Vec<Row>,
    seams: Vec<Seam>,
    lag_ratio_worst: f64,
}

#[derive(Debug, Serialize)]
struct LimitsOf {
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
    jerk_rad_s3: f64,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let l = &self.limits;
        writeln!(
            f,
            "one joint with limits of {} ({} rad/s, {} rad/s^2, {} rad/s^3); our targets count {} ms after their arrival, the others' at once",
            self.robot, l.velocity_rad_s, l.acceleration_rad_s2, l.jerk_rad_s3, self.latency_ms
        )?;
        writeln!(
            f,
            "stream              by          lag (ms)  rms (mrad)   peak rad/s    rad/s^2     rad/s^3"
        )?;
        for row in &self.streams {
            let methods = [
                ("taustream", &row.taustream),
                ("Ruckig", &row.ruckig),
                ("linear", &row.linear),
                ("cubic", &row.cubic),
            ];
            for (name, m) in methods {
                writeln!(
                    f,
                    "{:<19} {name:<10} {:>9.1} {:>11.2} {:>12.2} {:>10.1} {:>11.0}",
                    row.stream,
                    m.lag_ms,
                    m.rms_rad * 1e3,
                    m.velocity_rad_s,
                    m.acceleration_rad_s2,
                    m.jerk_rad_s3
                )?;
            }
            writeln!(
                f,
                "  lag over Ruckig's {:.2}; beyond the last target of a stream that breaks off: {:.1} mrad; planning {:.0} us (median), at most {} strokes",
                row.lag_ratio, row.overshoot_mrad, row.planning_us_median, row.strokes_max
            )?;
        }
        writeln!(
            f,
            "peak jerk at the seams of chunks (rad/s^3)   taustream     Ruckig      linear       cubic"
        )?;
        for s in &self.seams {
            writeln!(
                f,
                "  {:>3.0} mrad apart {:>38.0} {:>10.0} {:>11.0} {:>11.0}",
                s.offset_mrad, s.taustream, s.ruckig, s.linear, s.cubic
            )?;
        }
        write!(f, "largest lag over Ruckig's: {:.2}", self.lag_ratio_worst)
    }
}

/// Measures and prints.
pub(super) fn run(form: Form, args: &FollowBenchArgs) -> Result<(), Failure> {
    let robot = arm::robot(&args.robot)?;
    let Some(joint) = robot.joints.first() else {
        return Err(Failure::Usage(format!("{} has no joints", robot.name)));
    };
    // What is measured is not to end at a limit of the position.
    let limits = JointLimits { position_rad: [-10.0, 10.0], ..joint.limits };
    let latency_s = f64::from(args.latency_ms) * 1e-3;
    let streams: Vec<Row> =
        STREAMS.iter().map(|stream| row(*stream, f64::from(args.seconds), (&limits, latency_s))).collect();
    let seams = OFFSETS_RAD.iter().map(|offset_rad| seam(*offset_rad, (&limits, latency_s))).collect();
    let lag_ratio_worst = streams.iter().map(|row| row.lag_ratio).fold(0.0, f64::max);
    let LimitSet { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 } = limits.motion;
    form.print(&Answer {
        robot: robot.name.clone(),
        limits: LimitsOf { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 },
        latency_ms: args.latency_ms,
        streams,
        seams,
        lag_ratio_worst,
    })
}

/// One stream by every method.
fn row((signal, rate_hz): (Signal, f64), seconds_s: f64, (limits, latency_s): (&JointLimits, f64)) -> Row {
    let period_s = 1.0 / rate_hz;
    let from_rad = signal.at(0.0);
    let mut ours = Following::new(from_rad, limits, latency_s);
    let mut chase = Chase::new(from_rad, &limits.motion);
    let mut straight = Interpolation::new(false, period_s, from_rad);
    let mut cubic = Interpolation::new(true, period_s, from_rad);
    let mut logs: [Vec<f64>; 4] = Default::default();
    let (mut k, mut tick) = (0_u32, 0_u32);
    while f64::from(tick) * TICK_S < seconds_s {
        let now_s = f64::from(tick) * TICK_S;
        if f64::from(k) * period_s <= now_s {
            let target_rad = signal.target(k, f64::from(k) * period_s);
            ours.take(now_s, target_rad);
            chase.take(now_s, target_rad);
            straight.take(now_s, target_rad);
            cubic.take(now_s, target_rad);
            k += 1;
        }
        let setpoints = [ours.at(now_s), chase.at(now_s), straight.at(now_s), cubic.at(now_s)];
        logs.iter_mut().zip(setpoints).for_each(|(log, q)| log.push(q));
        tick += 1;
    }
    let overshoot_mrad = 1e3 * overshoot_rad((signal, rate_hz), (limits, latency_s));
    let [taustream, ruckig, linear, cubic] = logs.map(|log| measure(&log, SKIPPED, &|t_s| signal.at(t_s)));
    Row {
        stream: format!("{} at {rate_hz} Hz", signal.name()),
        lag_ratio: taustream.lag_ms / ruckig.lag_ms,
        taustream,
        ruckig,
        linear,
        cubic,
        overshoot_mrad,
        planning_us_median: ours.planning_us_median(),
        strokes_max: ours.strokes_max(),
    }
}

/// Breaks a stream off at many instants; the farthest that the motion goes beyond the last target from where it came.
fn overshoot_rad((signal, rate_hz): (Signal, f64), (limits, latency_s): (&JointLimits, f64)) -> f64 {
    let period_s = 1.0 / rate_hz;
    let mut ours = Following::new(signal.at(0.0), limits, latency_s);
    let mut farthest_rad: f64 = 0.0;
    for k in 0..200_u32 {
        let now_s = f64::from(k) * period_s;
        let target_rad = signal.target(k, now_s);
        ours.take(now_s, target_rad);
        let mut t_s = now_s;
        let behind_rad = target_rad - ours.at(now_s);
        while t_s < now_s + 2.0 {
            let beyond_rad = (ours.at(t_s) - target_rad) * behind_rad.signum();
            farthest_rad = farthest_rad.max(beyond_rad);
            t_s += 0.01;
        }
    }
    farthest_rad
}

/// Chunks of a swing, each off the one before.
fn seam(offset_rad: f64, (limits, latency_s): (&JointLimits, f64)) -> Seam {
    let signal = Signal::Swing;
    let period_s = 1.0 / CHUNK_HZ;
    // Within a chunk the k-th target is due k periods after it was sent.
    let offset = |chunk: u32| if chunk.is_multiple_of(2) { 0.5 * offset_rad } else { -0.5 * offset_rad };
    let from_rad = signal.at(0.0);
    let mut ours = Following::new(from_rad, limits, latency_s);
    let mut chase = Chase::new(from_rad, &limits.motion);
    let mut straight = Interpolation::new(false, period_s, from_rad);
    let mut cubic = Interpolation::new(true, period_s, from_rad);
    let mut logs: [Vec<f64>; 4] = Default::default();
    let (mut k, mut tick) = (0_u32, 0_u32);
    while f64::from(tick) * TICK_S < 10.0 {
        let now_s = f64::from(tick) * TICK_S;
        if f64::from(k) * period_s <= now_s {
            let chunk = k / REACHED;
            let sent_s = f64::from(k) * period_s;
            if k.is_multiple_of(REACHED) {
                let targets = (0..CHUNK).map(|number| {
                    let due_s = f64::from(number) * period_s;
                    (due_s, signal.at(sent_s + due_s) + offset(chunk))
                });
                ours.take_chunk(now_s, &targets.collect::<Vec<_>>());
            }
            // The others take them one by one as they are due.
            let target_rad = signal.at(sent_s) + offset(chunk);
            chase.take(now_s, target_rad);
            straight.take(now_s, target_rad);
            cubic.take(now_s, target_rad);
            k += 1;
        }
        let setpoints = [ours.at(now_s), chase.at(now_s), straight.at(now_s), cubic.at(now_s)];
        logs.iter_mut().zip(setpoints).for_each(|(log, q)| log.push(q));
        tick += 1;
    }
    let [taustream, ruckig, linear, cubic] = logs.map(|log| peaks(log.get(SKIPPED..).unwrap_or(&[]))[2]);
    Seam { offset_mrad: offset_rad * 1e3, taustream, ruckig, linear, cubic }
}
