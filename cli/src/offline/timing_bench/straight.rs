//! Straight moves of all lengths against the jerk-limited optimum.
use super::{LimitedArm, Spread, timed};
use crate::args::TimingArgs;
use serde::Serialize;
use std::fmt;
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_planner::rng::SeededRng;
use taustream_planner::timing::Path;
use taustream_planner::timing::line::LineLimits;
use taustream_planner::timing::train::Train;

/// Lengths of the longest joint's way (rad).
const LENGTHS_RAD: [f64; 8] = [1e-6, 1e-3, 0.01, 0.1, 0.5, 1.0, 3.0, 6.0];

/// Strokes beside those that a move has: how much nearer to the optimum they would come.
const MANY: usize = 128;

/// Moves of one length under one arm's limits.
#[derive(Serialize)]
pub(super) struct StraightRow {
    limits: String,
    length_rad: f64,
    ratio: Spread,
    strokes: usize,
    /// Median processor time to find a motion, microseconds.
    timing_us: f64,
    /// Duration of trains of 128 strokes over the optimum.
    with_128_strokes: Spread,
    /// True when the shortest stroke there is, 1 ms, makes the moves longer.
    shortest_strokes: bool,
}

pub(super) fn rows(arm: &LimitedArm, args: &TimingArgs) -> Vec<StraightRow> {
    LENGTHS_RAD.iter().filter_map(|length_rad| row(arm, args, *length_rad)).collect()
}

fn row(arm: &LimitedArm, args: &TimingArgs, length_rad: f64) -> Option<StraightRow> {
    let mut rng = SeededRng::new(args.seed, length_rad.to_bits());
    let (mut ratios, mut times_us, mut of_many) = (Vec::new(), Vec::new(), Vec::new());
    let (mut strokes, mut shortest_strokes) = (0, false);
    for _ in 0..args.moves {
        let mut to_rad: JointArray = [0.0; MAX_JOINTS];
        to_rad.iter_mut().take(arm.joints).for_each(|q| *q = length_rad * rng.within(-1.0, 1.0));
        let corners_rad = [[0.0; MAX_JOINTS], to_rad];
        let path = Path { corners_rad: &corners_rad, joints: arm.joints, limits: &arm.limits };
        let (motion, took_us) = timed(|| path.stopping());
        let motion = motion?.trajectory;
        times_us.push(took_us);
        let line = LineLimits::between(&corners_rad[0], &to_rad, (arm.joints, &arm.limits))?;
        let optimum = line.optimum();
        of_many.push(Train::of_at_most(&line, MANY)?.duration_s() / optimum.duration_s());
        ratios.push(motion.duration_s() / optimum.duration_s());
        strokes = strokes.max(motion.strokes().len());
        shortest_strokes |= motion.strokes().len() < 64;
    }
    let (ratio, timing_us) = (Spread::of(ratios)?, Spread::of(times_us)?.median);
    let (limits, with_128_strokes) = (arm.name.clone(), Spread::of(of_many)?);
    Some(StraightRow { limits, length_rad, ratio, strokes, timing_us, with_128_strokes, shortest_strokes })
}

impl fmt::Display for StraightRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Spread { median, largest } = self.ratio;
        write!(
            f,
            "{:<30} {:>9} {median:>7.3} {largest:>7.3} {:>8} {:>6.0} {:>7.3} {:>7.3}",
            self.limits,
            self.length_rad,
            self.strokes,
            self.timing_us,
            self.with_128_strokes.median,
            self.with_128_strokes.largest
        )?;
        if self.shortest_strokes { write!(f, "  strokes of 1 ms, the shortest there are") } else { Ok(()) }
    }
}
