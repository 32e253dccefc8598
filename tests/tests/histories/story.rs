//! One history: an arm with random limits, and what is done to it.
use crate::harness::{CycleHarness, HOME_RAD, JOINTS, shipped_settings};
use crate::log::{Cycle, Log, Motion};
use std::sync::OnceLock;
use taustream_arm::Settings;
use taustream_arm::rng::SeededRng;
use taustream_drivers::{DriveState, LinkFault};
use taustream_messages::trajectory::Corrupted;
use taustream_messages::{CheckedTrajectory, Command, Phase, Replaces, TrajectoryMessage};
use taustream_motion::cut::kept;
use taustream_motion::limits::{check_motion, check_motion_from};
use taustream_motion::stopping::StopRules;
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, Stroke, Trajectory};
use taustream_planner::replacement::{replacement, to_rest};
use taustream_streamer::check::Rules;
use taustream_streamer::cycle_state::Decision;

/// Arms that need longer for a stop are refused by `check`, s.
const STOP_S_MAX: f64 = 1.0;
/// Cycles in which a motion may come to its own end, before it is stopped.
const RUNS_ON: u64 = 250;
/// A stop brings rest within so many cycles: of a stop, a brake, and what waits for a stall to end.
const REST_CYCLES: u64 = 3_000;
/// Stretches that are tried until new strokes keep the limits.
const STRETCHES: u32 = 5;

/// Runs the history of a seed.
pub fn tell(seed: u64) -> Log {
    let mut story = Story::begin(seed);
    let deeds = 4 + story.rng.index(10);
    for _ in 0..deeds {
        let cycles = story.rng.index(90) as u64;
        story.harness.run(cycles);
        story.act();
    }
    story.end()
}

fn shipped() -> Settings {
    static SHIPPED: OnceLock<Settings> = OnceLock::new();
    SHIPPED.get_or_init(shipped_settings).clone()
}

/// Limits over some decades, alike for all joints or not.
fn random_limits(rng: &mut SeededRng) -> [JointLimits; MAX_JOINTS] {
    let spread = rng.within(1.0, 3.0);
    let mut power = |low: f64, high: f64| low * (high / low).powf(rng.unit());
    let [velocity, a_over_v, j_over_a] = [power(0.3, 6.0), power(3.0, 40.0), power(8.0, 60.0)];
    let [stop_a, stop_j] = [power(1.2, 4.0), power(1.5, 8.0)];
    std::array::from_fn(|joint| {
        let velocity_rad_s = velocity * power(1.0, spread);
        let acceleration_rad_s2 = velocity_rad_s * a_over_v;
        let motion =
            LimitSet { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3: acceleration_rad_s2 * j_over_a };
        let stop = LimitSet {
            velocity_rad_s,
            acceleration_rad_s2: motion.acceleration_rad_s2 * stop_a,
            jerk_rad_s3: motion.jerk_rad_s3 * stop_j,
        };
        let reach_rad = power(0.3, 2.0);
        JointLimits { position_rad: [HOME_RAD[joint] - reach_rad, HOME_RAD[joint] + reach_rad], motion, stop }
    })
}

struct Story {
    rng: SeededRng,
    harness: CycleHarness,
    limits: [JointLimits; MAX_JOINTS],
    rules: Rules,
    log: Log,
}

impl Story {
    fn begin(seed: u64) -> Self {
        let mut rng = SeededRng::new(seed, 0);
        let mut settings = shipped();
        let limits = loop {
            let limits = random_limits(&mut rng);
            if StopRules::new(&limits, JOINTS).longest_stop_s() <= STOP_S_MAX {
                break limits;
            }
        };
        for (joint, limits) in settings.robot.joints.iter_mut().zip(limits) {
            joint.limits = limits;
        }
        let period_s = f64::from(settings.cycle.period_us) * 1e-6;
        let stop_cycles = (StopRules::new(&limits, JOINTS).longest_stop_s() / period_s).ceil();
        let log = Log {
            limits,
            period_s,
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a second at most")]
            stop_cycles: stop_cycles as u64 + 3,
            drives: Default::default(),
            cycles: Vec::new(),
            motions: Vec::new(),
            swallowed: Vec::new(),
            refused: 0,
            stalls: 0,
            guard_trips: 0,
            faulted: false,
            end: Phase::Disabled,
            story: Vec::new(),
        };
        let rules = Rules::of(&settings.robot);
        let mut harness = CycleHarness::with(settings);
        harness.enable();
        let mut story = Self { rng, harness, limits, rules, log };
        story.start();
        story
    }

    fn note(&mut self, text: &str) {
        self.log.story.push(format!("{:6} {:?}: {text}", self.harness.tick, self.harness.phase()));
    }

    fn act(&mut self) {
        match self.rng.index(24) {
            0 | 1 => self.command(Command::Pause),
            2..=4 => self.command(Command::Resume),
            5 | 6 => {
                let percent = if self.rng.unit() < 0.3 { 100.0 } else { 100.0 * self.rng.unit() };
                self.command(Command::Speed { percent });
            }
            7 => self.command(Command::Stop),
            8 => self.rarely(Command::FastStop),
            9 | 10 => self.stall(),
            11 => self.lose_frames(),
            12 => self.fault(),
            13 | 14 => self.offer_spoiled(),
            15 => self.rarely(Command::TorqueOff),
            _ if self.harness.phase() == Phase::Holding => self.start(),
            _ => self.replace(),
        }
    }

    fn command(&mut self, command: Command) {
        let answer = self.harness.ask(command);
        self.note(&format!("{command:?}, accepted {}", answer.accepted));
    }

    /// What ends a history for good is left out of most.
    fn rarely(&mut self, command: Command) {
        if self.rng.unit() < 0.3 {
            self.command(command);
        }
    }

    fn stall(&mut self) {
        let long = self.rng.unit() < 0.5;
        let periods = 2 + self.rng.index(if long { 60 } else { 3 }) as u64;
        self.harness.step_after(periods);
        self.log.stalls += 1;
        self.note(&format!("the loop stalls for {periods} cycles"));
    }

    fn lose_frames(&mut self) {
        let cycles = 1 + self.rng.index(5) as u64;
        self.harness.script(|world| world.link_fault = Some(LinkFault::QueueFull));
        self.harness.run(cycles);
        self.harness.script(|world| world.link_fault = None);
        self.note(&format!("no frame leaves in {cycles} cycles"));
    }

    fn fault(&mut self) {
        let joint = self.rng.index(JOINTS);
        let which = self.rng.index(4);
        self.harness.script(|world| match which {
            0 => world.silent = Some(joint),
            1 => world.warning = Some(joint),
            2 => world.forced[joint] = Some(DriveState::Fault),
            _ => world.offset_rad[joint] = 0.5,
        });
        self.log.faulted = true;
        self.note(&format!("fault {which} of joint {joint}"));
    }

    /// A motion from rest.
    fn start(&mut self) {
        let Some(base_rad) = self.harness.report.map(|report| report.command_rad) else { return };
        let Some(trajectory) = self.motion(&base_rad) else { return };
        self.offer(&trajectory, Replaces::Rest, None);
    }

    /// Strokes that overlap, as fast as one of the motion limits lets them be.
    fn motion(&mut self, base_rad: &JointArray) -> Option<Trajectory> {
        let count = 1 + self.rng.index(5);
        let strokes = self.strokes(base_rad, count)?;
        let drawn = Trajectory::new(JOINTS, *base_rad, &strokes).ok()?;
        let mut free = self.limits;
        for limits in &mut free {
            limits.motion = LimitSet { velocity_rad_s: 1e6, acceleration_rad_s2: 1e7, jerk_rad_s3: 1e9 };
        }
        let peaks = check_motion(&drawn, &free).ok()?;
        let mut slower = 0.0_f64;
        for (joint, JointLimits { motion, .. }) in self.limits.iter().enumerate().take(JOINTS) {
            slower = slower
                .max(peaks.velocity_rad_s[joint] / motion.velocity_rad_s)
                .max((peaks.acceleration_rad_s2[joint] / motion.acceleration_rad_s2).sqrt())
                .max((peaks.jerk_rad_s3[joint] / motion.jerk_rad_s3).cbrt());
        }
        let slower = slower.max(0.02);
        let scaled = |stroke: &Stroke| Stroke {
            start_s: stroke.start_s * slower,
            duration_s: stroke.duration_s * slower,
            ..*stroke
        };
        Trajectory::new(JOINTS, *base_rad, &strokes.iter().map(scaled).collect::<Vec<_>>()).ok()
    }

    /// Strokes of about a second each, from one pose inside the limits to the next.
    fn strokes(&mut self, from_rad: &JointArray, count: usize) -> Option<Vec<Stroke>> {
        let size = self.rng.within(0.02, 0.6);
        let (mut at_rad, mut start_s) = (*from_rad, 0.0);
        let mut strokes = Vec::new();
        for _ in 0..count {
            let mut delta_rad = [0.0; MAX_JOINTS];
            for joint in 0..JOINTS {
                let [low, high] = self.limits[joint].position_rad;
                let inside = 0.05 * (high - low);
                let goal_rad = at_rad[joint] + self.rng.within(-size, size);
                delta_rad[joint] = goal_rad.clamp(low + inside, high - inside) - at_rad[joint];
                at_rad[joint] += delta_rad[joint];
            }
            let duration_s = self.rng.within(0.6, 1.4);
            let n = u32::try_from(4 + self.rng.index(9)).ok()?;
            strokes.push(Stroke { start_s, duration_s, n, delta_rad });
            start_s += duration_s * self.rng.within(0.3, 1.1);
        }
        Some(strokes)
    }

    /// The trajectory that runs, or waits for its cut, and its trajectory time.
    fn running(&self) -> Option<(Motion, f64)> {
        let last = self.harness.cycles.last().filter(|cycle| cycle.trajectory_id != 0)?;
        let waiting = self.harness.report.map_or(0, |report| report.successor_id);
        let motion = |id: u64| self.log.motions.iter().find(|motion| motion.id == id).cloned();
        motion(waiting).or_else(|| motion(last.trajectory_id)).map(|motion| (motion, last.s))
    }

    fn replace(&mut self) {
        let Some((cut, s)) = self.running() else { return };
        let end_s = cut.trajectory.duration_s();
        // A little ahead, seldom at the very end, sometimes too late.
        let ahead_s =
            if self.rng.unit() < 0.1 { self.rng.within(-0.05, 0.0) } else { self.rng.within(0.0, 0.2) };
        let at_s = if self.rng.unit() < 0.1 { end_s } else { (s.max(cut.from_s) + ahead_s).min(end_s) };
        let waits = self.harness.report.is_some_and(|report| report.successor_id == cut.id);
        let made = match self.rng.index(10) {
            0 => to_rest(&cut.trajectory, at_s, &self.limits),
            1 => {
                let mut goal_rad = cut.trajectory.sample(at_s).position_rad;
                for (goal_rad, limits) in goal_rad.iter_mut().zip(&self.limits).take(JOINTS) {
                    let [low, high] = limits.position_rad;
                    *goal_rad = (*goal_rad + self.rng.within(-0.1, 0.1)).clamp(low, high);
                }
                replacement(&cut.trajectory, at_s, &goal_rad, &self.limits)
            }
            _ => self.random_replacement(&cut, at_s),
        };
        let Some(trajectory) = made else { return };
        let changed = self.rng.unit() < 0.1;
        if changed && at_s > 0.0 {
            let mut base_rad = *trajectory.base_rad();
            base_rad[0] = f64::from_bits(base_rad[0].to_bits() ^ 1);
            if let Ok(changed) = Trajectory::new(JOINTS, base_rad, trajectory.strokes()) {
                let wrong = Some("a base that is one bit off".to_owned());
                return self.offer(&changed, Replaces::Cut { trajectory_id: cut.id, at_s }, wrong);
            }
        }
        // What waits takes over where it would have.
        let late = at_s < s - 1e-9 && cut.from_s < s && !waits;
        let wrong = late.then(|| format!("a cut at {at_s} s, {} s too late", s - at_s));
        self.offer(&trajectory, Replaces::Cut { trajectory_id: cut.id, at_s }, wrong);
    }

    /// What has begun is kept; the rest is dropped, or kept, too; strokes are added that bring the motion on.
    fn random_replacement(&mut self, cut: &Motion, at_s: f64) -> Option<Trajectory> {
        // What waits is folded by when it takes over, what runs by the cut.
        let waits = self.harness.report.is_some_and(|report| report.successor_id == cut.id);
        let kept = kept(&cut.trajectory, at_s, if waits { cut.from_s } else { at_s });
        let mut old = kept.strokes.to_vec();
        if self.rng.unit() < 0.5 {
            old.extend(cut.trajectory.strokes().iter().filter(|stroke| stroke.start_s >= at_s));
        }
        let mut ends_rad = kept.base_rad;
        for stroke in &old {
            for (end, delta) in ends_rad.iter_mut().zip(&stroke.delta_rad) {
                *end += delta;
            }
        }
        let count = 1 + self.rng.index(2);
        let mut new = self.strokes(&ends_rad, count)?;
        for stroke in &mut new {
            (stroke.start_s, stroke.duration_s) = (0.2 * stroke.start_s, 0.2 * stroke.duration_s);
        }
        for _ in 0..STRETCHES {
            let added = new.iter().map(|stroke| Stroke { start_s: at_s + stroke.start_s, ..*stroke });
            let mut strokes: Vec<Stroke> = old.iter().copied().chain(added).collect();
            strokes.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
            let trajectory = Trajectory::new(JOINTS, kept.base_rad, &strokes).ok()?;
            if check_motion_from(&trajectory, &self.limits, at_s).is_ok() {
                return Some(trajectory);
            }
            for stroke in &mut new {
                (stroke.start_s, stroke.duration_s) = (1.7 * stroke.start_s, 1.7 * stroke.duration_s);
            }
        }
        None
    }

    fn message(&self, trajectory: &Trajectory, replaces: Replaces) -> Box<TrajectoryMessage> {
        TrajectoryMessage::new(&CheckedTrajectory {
            trajectory_id: 1,
            generation: 1,
            robot_digest: self.harness.settings.robot.digest,
            replaces,
            trajectory: trajectory.clone(),
        })
    }

    /// Takes a message the way of the intake: checked, then offered to the cycle. `wrong` says why it may not be accepted.
    fn offer(&mut self, trajectory: &Trajectory, replaces: Replaces, wrong: Option<String>) {
        let message = self.message(trajectory, replaces);
        self.offer_message(&message, replaces, wrong);
    }

    fn offer_message(&mut self, message: &TrajectoryMessage, replaces: Replaces, wrong: Option<String>) {
        let checked = match self.rules.check(message) {
            Ok(checked) => checked,
            Err(why) => {
                self.log.refused += 1;
                return self.note(&format!("{replaces:?} refused: {why}"));
            }
        };
        let trajectory = checked.trajectory.clone();
        let decision = self.harness.offer_checked(*checked);
        let (cuts, cut_s) = match replaces {
            Replaces::Rest => (0, None),
            Replaces::Cut { trajectory_id, at_s } => (trajectory_id, Some(at_s)),
        };
        let from_s = match decision {
            Decision::Accepted { .. } => 0.0,
            Decision::Waits { from_s } => from_s,
            Decision::Cut(_)
            | Decision::Stale { .. }
            | Decision::NotAtBase { .. }
            | Decision::NotReady { .. } => {
                self.log.refused += 1;
                return self.note(&format!("{replaces:?} refused: {decision:?}"));
            }
        };
        let id = self.harness.newest_id();
        self.log.swallowed.extend(wrong);
        self.log.motions.push(Motion { id, cuts, trajectory, cut_s, from_s });
        self.note(&format!("{replaces:?} accepted as {id}: {decision:?}"));
    }

    /// A message with a field that no message may have.
    fn offer_spoiled(&mut self) {
        let base_rad = self.harness.report.map_or(HOME_RAD, |report| report.command_rad);
        let Some(trajectory) = self.motion(&base_rad) else { return };
        let how = match self.rng.index(10) {
            0 => Corrupted::Layout(77),
            1 => Corrupted::Joints([0, 5, 7, 9, u32::MAX][self.rng.index(5)]),
            2 => Corrupted::StrokeCount([513, u32::MAX][self.rng.index(2)]),
            3 => Corrupted::Exponent([0, 3, 65, u32::MAX][self.rng.index(4)]),
            4 => Corrupted::Delta([f64::NAN, f64::INFINITY, 1e300][self.rng.index(3)]),
            5 => Corrupted::Duration([0.0, -1.0, f64::NAN, 1e-300][self.rng.index(4)]),
            6 => Corrupted::Start([-1.0, f64::NAN, 1e300][self.rng.index(3)]),
            7 => Corrupted::Base([f64::NAN, 100.0, -1e300][self.rng.index(3)]),
            8 => Corrupted::Replaces(2 + u32::try_from(self.rng.index(1_000)).unwrap()),
            _ => Corrupted::Digest(1),
        };
        let message = self.message(&trajectory, Replaces::Rest).corrupted(how);
        self.offer_message(&message, Replaces::Rest, Some(format!("{how:?}")));
    }

    /// Runs until the arm rests; gives up after some cycles.
    fn rest(&mut self, cycles: u64) {
        for _ in 0..cycles {
            let moves = matches!(
                self.harness.phase(),
                Phase::Moving | Phase::Pausing | Phase::Stopping | Phase::FastStopping | Phase::Braking
            );
            if !moves {
                return;
            }
            self.harness.step_after(1);
        }
    }

    /// Lets what runs come to rest.
    fn end(mut self) -> Log {
        self.rest(RUNS_ON);
        if self.harness.phase() == Phase::Moving {
            self.command(Command::Stop);
        }
        self.rest(REST_CYCLES);
        self.harness.run(15);
        self.note("the end");
        let mut log = self.log;
        log.end = self.harness.phase();
        log.guard_trips = self.harness.report.map_or(0, |report| report.guard_trips);
        log.cycles = self
            .harness
            .cycles
            .iter()
            .map(|cycle| Cycle {
                tick: cycle.tick,
                phase: cycle.phase,
                id: cycle.trajectory_id,
                s: cycle.s,
                sigma: cycle.sigma,
                position_rad: cycle.position_rad,
                off_path_rad: cycle.off_path_rad,
                sent: cycle.joint_sent[0],
            })
            .collect();
        let mut world = self.harness.world.lock().unwrap();
        for (to, from) in log.drives.iter_mut().zip(&mut world.drives) {
            *to = std::mem::take(from);
        }
        drop(world);
        log
    }
}
