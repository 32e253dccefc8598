//! Stops and changes of speed at any instant of any motion: their limits by differences of positions alone, and their durations
//! against an independent solver.
#![expect(clippy::unwrap_used, reason = "a case that cannot be made fails its test")]
mod common;
use common::{SeededRng, random_limits, ur5_limits};
use rsruckig::prelude::{
    ControlInterface, InputParameter, Ruckig, Synchronization, ThrowErrorHandler,
    Trajectory as RuckigTrajectory,
};
use taustream_motion::limits::check_motion;
use taustream_motion::peaks_ahead::{AT_REST, PeaksAhead, Stretch, cell_count, fill, span_s};
use taustream_motion::stopping::{Situation, SpeedRequest, StopRules, stop_duration_s};
use taustream_motion::time_scale::TimeScale;
use taustream_motion::{JointLimits, MAX_JOINTS, Stroke, Trajectory};

const PERIOD_S: f64 = 1e-3;
type Limits = [JointLimits; MAX_JOINTS];

/// A motion of overlapping strokes whose time is scaled so that one motion limit is just kept.
fn motion(rng: &mut SeededRng, limits: &Limits) -> Trajectory {
    let count = rng.whole(1, 6);
    let drawn = rng.trajectory(4, count, 1.5);
    let mut no_limits = *limits;
    for joint in &mut no_limits {
        joint.position_rad = [-100.0, 100.0];
        joint.motion.velocity_rad_s = 1e6;
        joint.motion.acceleration_rad_s2 = 1e6;
        joint.motion.jerk_rad_s3 = 1e9;
    }
    let peaks = check_motion(&drawn, &no_limits).unwrap();
    let mut slower = 0.0_f64;
    for (joint, JointLimits { motion, .. }) in limits.iter().enumerate().take(4) {
        slower = slower
            .max(peaks.velocity_rad_s[joint] / motion.velocity_rad_s)
            .max((peaks.acceleration_rad_s2[joint] / motion.acceleration_rad_s2).sqrt())
            .max((peaks.jerk_rad_s3[joint] / motion.jerk_rad_s3).cbrt());
    }
    let scaled = |stroke: &Stroke| Stroke {
        start_s: stroke.start_s * slower,
        duration_s: stroke.duration_s * slower,
        ..*stroke
    };
    let strokes: Vec<Stroke> = drawn.strokes().iter().map(scaled).collect();
    let trajectory = Trajectory::new(4, *drawn.base_rad(), &strokes).unwrap();
    check_motion(&trajectory, limits).unwrap();
    trajectory
}

fn table(trajectory: &Trajectory, limits: &Limits) -> Vec<Stretch> {
    let mut cells = vec![AT_REST; cell_count(trajectory)];
    fill(&mut cells, trajectory, limits);
    cells
}

/// A motion that runs at a scale, one setpoint a period, as the streamer samples it.
struct Run<'a> {
    trajectory: &'a Trajectory,
    cells: &'a [Stretch],
    scale: TimeScale,
    tick: u32,
    s: f64,
    positions: Vec<[f64; MAX_JOINTS]>,
}

impl<'a> Run<'a> {
    fn new(trajectory: &'a Trajectory, cells: &'a [Stretch], (s, sigma): (f64, f64)) -> Self {
        let scale = TimeScale::settled(sigma);
        // What came before, at constant speed.
        let before =
            [-3.0, -2.0, -1.0, 0.0].map(|k| trajectory.sample(s + k * sigma * PERIOD_S).position_rad);
        Self { trajectory, cells, scale, tick: 0, s, positions: before.to_vec() }
    }

    fn now_s(&self) -> f64 {
        f64::from(self.tick) * PERIOD_S
    }

    fn step(&mut self) {
        let from_s = self.now_s();
        self.tick += 1;
        self.s += self.scale.advance_s(from_s, self.now_s());
        self.positions.push(self.trajectory.sample(self.s).position_rad);
    }

    fn ask(&mut self, rules: &StopRules, request: SpeedRequest) {
        let ahead = PeaksAhead::new(self.cells, span_s(self.trajectory));
        let situation = Situation { now_s: self.now_s(), s: self.s, ahead, approaching: false, waits_s: 0.0 };
        rules.apply(request, &mut self.scale, &situation);
    }

    fn rest(&mut self) {
        while !self.scale.is_settled(self.now_s()) {
            self.step();
        }
        (0..4).for_each(|_| self.step());
    }

    /// The largest part of a stop limit that the setpoints use, by their differences.
    fn stop_limit_use(&self, limits: &Limits) -> f64 {
        let mut most = 0.0_f64;
        for w in self.positions.windows(4) {
            for (joint, JointLimits { stop, .. }) in limits.iter().enumerate().take(4) {
                let [p, q, r, s] = [w[0][joint], w[1][joint], w[2][joint], w[3][joint]];
                let v = (s - r) / PERIOD_S;
                let a = (s - 2.0 * r + q) / (PERIOD_S * PERIOD_S);
                let j = (s - 3.0 * r + 3.0 * q - p) / (PERIOD_S * PERIOD_S * PERIOD_S);
                // Rounding of positions of some rad.
                most = most
                    .max(v.abs() / stop.velocity_rad_s)
                    .max(a.abs() / stop.acceleration_rad_s2)
                    .max((j.abs() - 1e-4) / stop.jerk_rad_s3);
            }
        }
        most
    }
}

/// Rules that take the stop limits for higher than they are, by a factor.
fn rules_knowing(limits: &Limits, factor: f64) -> StopRules {
    let mut taken = *limits;
    for joint in &mut taken {
        joint.stop.acceleration_rad_s2 *= factor;
        joint.stop.jerk_rad_s3 *= factor;
    }
    StopRules::new(&taken, 4)
}

/// A random history: pauses, resumptions, speeds, stops, at random moments, often many in a row.
fn history_use(seed: u64) -> (f64, bool) {
    let mut rng = SeededRng::from_seed(seed);
    let limits = random_limits(&mut rng);
    let trajectory = motion(&mut rng, &limits);
    let cells = table(&trajectory, &limits);
    let rules = StopRules::new(&limits, 4);
    let sigma = [1.0, rng.within(0.05, 1.0)][rng.whole(0, 1) as usize];
    let mut run = Run::new(&trajectory, &cells, (0.0, sigma));
    let most_ticks = if rng.whole(0, 1) == 0 { 40 } else { 400 };
    for _ in 0..rng.whole(1, 30) {
        for _ in 0..rng.whole(0, most_ticks) {
            run.step();
        }
        let request = match rng.whole(0, 5) {
            0 => SpeedRequest::FastStop,
            1 | 2 => SpeedRequest::Stop,
            3 => SpeedRequest::Change(1.0),
            _ => SpeedRequest::Change(rng.within(0.0, 1.0)),
        };
        run.ask(&rules, request);
    }
    let asked_s = run.now_s();
    run.ask(&rules, SpeedRequest::FastStop);
    let in_time = run.scale.requested() <= 0.0
        && (run.scale.settles_s() - asked_s <= rules.longest_stop_s() + 1e-9
            || run.scale.is_settled(asked_s));
    run.rest();
    (run.stop_limit_use(&limits), in_time)
}

#[test]
fn motion_under_any_history_of_requests_keeps_its_stop_limits_and_every_stop_ends_in_time() {
    let seeds = std::env::var("TAUSTREAM_SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(400);
    let mut highest = 0.0_f64;
    for seed in 0..seeds {
        let (most, in_time) = history_use(seed);
        assert!(most <= 1.0 + 1e-5, "seed {seed}: {most} of a stop limit");
        assert!(in_time, "seed {seed}: the last stop takes longer than any");
        highest = highest.max(most);
    }
    assert!(highest > 0.9, "{highest}: stops are gentler than they need to be");
}

/// The largest part of a stop limit that fast stops use, begun every few setpoints all along a motion.
fn fast_stops_use(seed: u64, known: f64) -> f64 {
    let mut rng = SeededRng::from_seed(seed);
    let limits = random_limits(&mut rng);
    let trajectory = motion(&mut rng, &limits);
    let cells = table(&trajectory, &limits);
    let rules = rules_knowing(&limits, known);
    let sigma = [1.0, 0.5, 0.1][usize::try_from(seed).unwrap() % 3];
    let (mut s, mut highest) = (0.0, 0.0_f64);
    while s < trajectory.duration_s() {
        let mut run = Run::new(&trajectory, &cells, (s, sigma));
        run.ask(&rules, SpeedRequest::FastStop);
        assert!(run.scale.settles_s() <= stop_duration_s(&limits, 4) + 1e-9, "seed {seed} at {s} s");
        run.rest();
        highest = highest.max(run.stop_limit_use(&limits));
        s += 7.0 * PERIOD_S * sigma;
    }
    highest
}

/// Goal: wherever a motion is, and however fast it runs, a fast stop from there keeps the stop limits, and takes no longer than
/// the arm's files are accepted for.
#[test]
fn fast_stop_all_along_a_motion_keeps_the_stop_limits() {
    for seed in 0..9 {
        let most = fast_stops_use(seed, 1.0);
        assert!(most <= 1.0 + 1e-5, "seed {seed}: {most} of a stop limit");
    }
}

/// The check above must be able to fail: rules that take the stop limits for a tenth higher than they are break them on every motion.
#[test]
fn fast_stops_under_rules_of_higher_limits_are_seen_to_break_stop_limits() {
    for seed in 0..9 {
        let most = fast_stops_use(seed, 1.1);
        assert!(most > 1.0 + 1e-5, "seed {seed}: {most} of a stop limit");
    }
}

/// Bounds of cells hold against a dense scan, and are not much wider.
#[test]
fn tables_hold_what_the_motion_does_in_each_stretch() {
    for seed in 0..40 {
        let mut rng = SeededRng::from_seed(seed);
        let limits = random_limits(&mut rng);
        let trajectory = motion(&mut rng, &limits);
        let cells = table(&trajectory, &limits);
        let end_s = trajectory.duration_s();
        let ahead = PeaksAhead::new(&cells, span_s(&trajectory));
        for _ in 0..300 {
            let from_s = rng.within(0.0, end_s * 1.05);
            let to_s = from_s + rng.within(0.0, 0.02);
            let mut stretch = AT_REST;
            ahead.between([from_s, to_s], trajectory.joints(), &mut stretch);
            for step in 0..=20 {
                let at = trajectory.sample(from_s + (to_s - from_s) * f64::from(step) / 20.0);
                for (joint, ranges) in stretch.iter().enumerate().take(4) {
                    let pairs = [
                        (ranges.velocity_rad_s, at.velocity_rad_s[joint]),
                        (ranges.acceleration_rad_s2, at.acceleration_rad_s2[joint]),
                        (ranges.jerk_rad_s3, at.jerk_rad_s3[joint]),
                    ];
                    for (index, ([low, high], value)) in pairs.into_iter().enumerate() {
                        let slack = 1e-9;
                        assert!(
                            low - slack <= value && value <= high + slack,
                            "seed {seed}, {index} at {from_s}: {value} in {low}..{high}"
                        );
                    }
                }
            }
        }
        let narrow = cells.iter().filter(|cell| {
            let [low, high] = cell[0].acceleration_rad_s2;
            high - low < 0.2 * limits[0].motion.acceleration_rad_s2
        });
        assert!(narrow.count() * 10 > cells.len() * 9, "seed {seed}: cells say little");
    }
}

/// Duration and distance of the optimum: rsruckig's velocity control of the one joint that moves.
fn optimum(velocity: f64, acceleration: f64, limits: &JointLimits) -> f64 {
    let mut solver = Ruckig::<1, ThrowErrorHandler>::new(None, PERIOD_S);
    let mut input = InputParameter::<1>::new(None);
    input.control_interface = ControlInterface::Velocity;
    input.synchronization = Synchronization::None;
    input.current_velocity[0] = velocity;
    input.current_acceleration[0] = acceleration;
    input.max_acceleration[0] = limits.stop.acceleration_rad_s2;
    input.max_jerk[0] = limits.stop.jerk_rad_s3;
    let mut trajectory = RuckigTrajectory::<1>::new(None);
    solver.calculate(&input, &mut trajectory).unwrap();
    trajectory.get_duration()
}

/// A straight move of one joint: equal strokes, close together, as many as give it a cruise.
fn straight(travel_rad: f64, count: u32) -> Trajectory {
    let strokes = |duration_s: f64, spacing_s: f64| -> Vec<Stroke> {
        let mut delta_rad = [0.0; MAX_JOINTS];
        delta_rad[0] = travel_rad / f64::from(count);
        (0..count)
            .map(|k| Stroke { start_s: f64::from(k) * spacing_s, duration_s, n: 5, delta_rad })
            .collect()
    };
    let limits = ur5_limits();
    let mut slow = 0.2;
    loop {
        let trajectory = Trajectory::new(1, [0.0; MAX_JOINTS], &strokes(0.5 * slow, 0.09 * slow)).unwrap();
        if check_motion(&trajectory, &limits).is_ok() {
            return trajectory;
        }
        slow *= 1.02;
    }
}

#[test]
fn fast_stop_at_every_speed_takes_at_most_1_3_times_the_optimum_at_the_median() {
    let limits = ur5_limits();
    let rules = StopRules::new(&limits, 1);
    for (travel_rad, strokes) in [(0.1, 1), (0.3, 1), (1.0, 1), (3.0, 18), (6.0, 36)] {
        let trajectory = straight(travel_rad, strokes);
        let cells = table(&trajectory, &limits);
        for sigma in [0.05, 0.2, 0.5, 1.0] {
            let mut ratios: Vec<f64> = (1..50)
                .map(|phase| {
                    let s = trajectory.duration_s() * f64::from(phase) / 50.0;
                    let at = trajectory.sample(s);
                    let mut run = Run::new(&trajectory, &cells, (s, sigma));
                    run.ask(&rules, SpeedRequest::FastStop);
                    // The motion may end by itself before.
                    while !run.scale.is_settled(run.now_s()) && run.s < trajectory.duration_s() {
                        run.step();
                    }
                    let stop_s = run.scale.settles_s().min(run.now_s());
                    let best_s = optimum(
                        at.velocity_rad_s[0] * sigma,
                        at.acceleration_rad_s2[0] * sigma * sigma,
                        &limits[0],
                    );
                    stop_s / best_s
                })
                .collect();
            ratios.sort_by(f64::total_cmp);
            println!("{travel_rad} rad at {sigma}: {:.2} {:.2} {:.2}", ratios[24], ratios[46], ratios[48]);
            assert!(ratios[24] <= 1.3, "{travel_rad} rad at {sigma}: median {}", ratios[24]);
        }
    }
}

/// Goal: the time axis of a chain of replacements goes on for as long as the arm does not rest, and a stop stays as short as in the first
/// second of it.
/// Method: the same motion late on the axis, as the replacement of one whose strokes have been folded.
#[test]
fn stop_an_hour_into_a_chain_of_replacements_takes_as_long_as_at_its_begin() {
    const LATER_S: f64 = 3_600.0;
    let limits = ur5_limits();
    let rules = StopRules::new(&limits, 1);
    let trajectory = straight(3.0, 18);
    let shifted: Vec<Stroke> = trajectory
        .strokes()
        .iter()
        .map(|stroke| Stroke { start_s: stroke.start_s + LATER_S, ..*stroke })
        .collect();
    let later = Trajectory::new(1, *trajectory.base_rad(), &shifted).unwrap();
    let tables = [table(&trajectory, &limits), table(&later, &limits)];
    assert_eq!(tables[0].len().abs_diff(tables[1].len()) / 2, 0);
    for phase in 1..20 {
        let s = trajectory.duration_s() * f64::from(phase) / 20.0;
        let [at_first, an_hour_later] = [(&trajectory, 0.0), (&later, LATER_S)].map(|(motion, from_s)| {
            let cells = if from_s == 0.0 { &tables[0] } else { &tables[1] };
            let mut run = Run::new(motion, cells, (from_s + s, 1.0));
            run.ask(&rules, SpeedRequest::FastStop);
            run.scale.settles_s()
        });
        // Cells are a millisecond wide, and may begin anywhere in one.
        assert!((an_hour_later / at_first - 1.0).abs() < 0.02, "{s}: {an_hour_later} for {at_first}");
    }
}
