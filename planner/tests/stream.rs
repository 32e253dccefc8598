//! Streams of targets: whatever arrives, the motion stays inside the limits and ends at rest at the last target.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
use proptest::prelude::*;
use taustream_messages::target::Target;
use taustream_motion::cut::kept;
use taustream_motion::limits::{LimitSet, check_motion_from};
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Trajectory};
use taustream_planner::stream::{Follower, Piece, Reference, Trend};

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> [JointLimits; MAX_JOINTS] {
    let motion = LimitSet { velocity_rad_s: velocity, acceleration_rad_s2: acceleration, jerk_rad_s3: jerk };
    [JointLimits { position_rad: [-1e3, 1e3], motion, stop: motion }; MAX_JOINTS]
}

fn pose(q: &[f64]) -> JointArray {
    let mut all = [0.0; MAX_JOINTS];
    all[..q.len()].copy_from_slice(q);
    all
}

fn target(due_s: f64, q: &[f64]) -> Target {
    Target { due_s, position_rad: pose(q), velocity_rad_s: None }
}

/// What is planted to show that the checks find it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    /// Goes on from the pose at the cut as if the arm stood there.
    FromRest,
    /// Drops what pends at every third cut, and adds nothing in its place.
    DropsPending,
    /// Does not go on from the reference, but from its end.
    SkipsReference,
}

/// An arm that runs whatever is accepted, and logs its setpoints.
struct Arm {
    follower: Follower,
    running: Trajectory,
    reference: Reference,
    trend: Trend,
    fault: Fault,
    taken: u32,
    log: Vec<JointArray>,
}

const TICK_S: f64 = 1e-3;

impl Arm {
    fn new(joints: usize, limits: &[JointLimits; MAX_JOINTS], fault: Fault) -> Self {
        let rest = Trajectory::new(joints, [0.0; MAX_JOINTS], &[]).unwrap();
        let reference = Reference::at_rest(&[0.0; MAX_JOINTS]);
        let (follower, trend) = (Follower::new(joints, limits), Trend::default());
        Self { follower, running: rest, reference, trend, fault, taken: 0, log: Vec::new() }
    }

    /// One target is wanted as soon as possible; several are due that long after `sent_s`.
    fn take(&mut self, (sent_s, cut_s): (f64, f64), targets: &[Target]) -> bool {
        self.run_until(cut_s);
        let kept = kept(&self.running, self.reference.kept_until_s(cut_s), cut_s);
        let reference = match self.fault {
            Fault::None | Fault::DropsPending => self.reference.clone(),
            Fault::FromRest => Reference::at_rest_from(cut_s, &self.running.sample(cut_s).position_rad),
            Fault::SkipsReference => Reference::at_rest_from(cut_s, self.reference.end_rad().unwrap()),
        };
        let from = (&reference, cut_s);
        let piece = match targets {
            [one] => {
                let lead = self.trend.note(sent_s, one);
                self.follower.to_pose(&kept, from, (&one.position_rad, lead.as_ref()))
            }
            chunk => self.follower.through(&kept, from, (chunk, &|due_s| sent_s + due_s)),
        };
        let Some(Piece { trajectory, reference, .. }) = piece else { return false };
        self.reference = reference;
        self.taken += 1;
        self.running = match self.fault {
            Fault::DropsPending if self.taken.is_multiple_of(3) => {
                Trajectory::new(trajectory.joints(), kept.base_rad, kept.strokes).unwrap()
            }
            Fault::None | Fault::DropsPending | Fault::FromRest | Fault::SkipsReference => trajectory,
        };
        true
    }

    /// Logs the setpoints up to an instant.
    fn run_until(&mut self, until_s: f64) {
        while self.log.len() as f64 * TICK_S < until_s {
            self.log.push(self.running.sample(self.log.len() as f64 * TICK_S).position_rad);
        }
    }

    /// Lets the last motion end.
    fn run_to_rest(&mut self) {
        self.run_until(self.running.duration_s() + 0.01);
    }

    /// Finite differences of the logged setpoints, over their limits: the largest.
    fn over_limits(&self, motion: &LimitSet) -> f64 {
        let limits = [motion.velocity_rad_s, motion.acceleration_rad_s2, motion.jerk_rad_s3];
        let mut worst: f64 = 0.0;
        for joint in 0..2 {
            let mut row: Vec<f64> = self.log.iter().map(|q| q[joint]).collect();
            for limit in limits {
                row = row.windows(2).map(|pair| (pair[1] - pair[0]) / TICK_S).collect();
                worst = row.iter().fold(worst, |worst, value| worst.max(value.abs() / limit));
            }
        }
        worst
    }
}

#[derive(Clone, Debug)]
struct Arrival {
    /// After the one before, s.
    after_s: f64,
    /// How much of the way from the last target to the drawn one is gone.
    share: f64,
    targets: Vec<(f64, [f64; 2])>,
}

fn arrivals() -> impl Strategy<Value = Vec<Arrival>> {
    let q = || prop::array::uniform2(-1.0..1.0);
    let chunk = prop::collection::vec((0.005..0.2, q()), 2..12).prop_map(|mut targets| {
        let mut sum_s = 0.0;
        for (due_s, _) in &mut targets {
            sum_s += *due_s;
            *due_s = sum_s;
        }
        targets
    });
    let one = q().prop_map(|q| vec![(0.0, q)]);
    let share = prop_oneof![4 => Just(1.0), 1 => Just(0.0), 1 => 1e-6..0.1_f64];
    let arrival = (prop_oneof![0.002..0.4, Just(0.02)], share, prop_oneof![3 => one, 1 => chunk]);
    let arrival = arrival.prop_map(|(after_s, share, targets)| Arrival { after_s, share, targets });
    prop::collection::vec(arrival, 1..20)
}

#[derive(Clone, Debug)]
struct Stream {
    arrivals: Vec<Arrival>,
    size_rad: f64,
    motion: LimitSet,
}

fn streams() -> impl Strategy<Value = Stream> {
    let motion = (0.3..6.0_f64, 2.0..40.0_f64, 20.0..2000.0_f64);
    (arrivals(), 0.01..2.0_f64, motion).prop_map(|(arrivals, size_rad, (v, a, j))| {
        let motion = LimitSet { velocity_rad_s: v, acceleration_rad_s2: a, jerk_rad_s3: j };
        Stream { arrivals, size_rad, motion }
    })
}

/// Runs a stream; `check` sees the arm after every target.
fn run(
    stream: &Stream,
    fault: Fault,
    mut check: impl FnMut(&Arm, f64) -> Result<(), TestCaseError>,
) -> Result<Arm, TestCaseError> {
    let m = &stream.motion;
    let limits = limits(m.velocity_rad_s, m.acceleration_rad_s2, m.jerk_rad_s3);
    let mut arm = Arm::new(2, &limits, fault);
    let (mut now_s, mut last_rad) = (0.0, [0.0; 2]);
    for arrival in &stream.arrivals {
        now_s += arrival.after_s;
        let mut targets = Vec::new();
        for (due_s, q) in &arrival.targets {
            for (last_rad, q) in last_rad.iter_mut().zip(q) {
                *last_rad += arrival.share * (q * stream.size_rad - *last_rad);
            }
            targets.push(target(*due_s, &last_rad));
        }
        let cut_s = now_s + 0.004;
        prop_assert!(arm.take((now_s, cut_s), &targets) || fault != Fault::None, "refused at {now_s}");
        check(&arm, cut_s)?;
    }
    arm.run_to_rest();
    Ok(arm)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    #[test]
    fn every_stream_keeps_the_limits_and_ends_at_its_last_target(stream in streams()) {
        let m = stream.motion;
        let limits = limits(m.velocity_rad_s, m.acceleration_rad_s2, m.jerk_rad_s3);
        let arm = run(&stream, Fault::None, |arm, cut_s| {
            check_motion_from(&arm.running, &limits, cut_s).map(|_| ()).map_err(|e| TestCaseError::fail(e.to_string()))
        })?;
        let over = arm.over_limits(&m);
        prop_assert!(over <= 1.0 + 1e-6, "{over} of a limit by finite differences");
        for (q, wanted) in arm.running.end_rad().iter().zip(arm.reference.end_rad().unwrap()) {
            prop_assert!((q - wanted).abs() < 1e-9, "{q} {wanted}");
        }
    }

    /// Goal: no stream makes the arm swing. Nothing goes beyond the targets by more than the lead, and after the last target
    /// each joint turns back twice at most: it brakes, comes back, and rests.
    #[test]
    fn no_stream_makes_the_arm_swing(stream in streams()) {
        let arm = run(&stream, Fault::None, |_, _| Ok(()))?;
        let lead_rad = arm.follower.delay_s() * stream.motion.velocity_rad_s;
        let all = || stream.arrivals.iter().flat_map(|arrival| &arrival.targets);
        let last_s: f64 = stream.arrivals.iter().map(|arrival| arrival.after_s).sum();
        for joint in 0..2 {
            let farthest = |sign: f64| all().map(|(_, q)| sign * q[joint] * stream.size_rad).fold(0.0, f64::max);
            for sign in [1.0, -1.0] {
                let reached = arm.log.iter().map(|q| sign * q[joint]).fold(0.0, f64::max);
                prop_assert!(reached <= farthest(sign) + lead_rad + 1e-6, "{reached} {}", farthest(sign));
            }
            if stream.arrivals.last().is_some_and(|arrival| arrival.targets.len() > 1) {
                continue;
            }
            let after: Vec<f64> = arm.log.iter().enumerate().filter(|(k, _)| *k as f64 * TICK_S >= last_s).map(|(_, q)| q[joint]).collect();
            let moves: Vec<f64> =
                after.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| step.abs() > 1e-8).collect();
            let turns = moves.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
            prop_assert!(turns <= 3, "joint {joint} turns {turns} times");
        }
    }
}

#[test]
fn planted_faults_are_found_by_finite_differences() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;
    let mut runner = TestRunner::deterministic();
    let streams: Vec<Stream> = (0..40).map(|_| streams().new_tree(&mut runner).unwrap().current()).collect();
    for fault in [Fault::FromRest, Fault::DropsPending, Fault::SkipsReference] {
        let found = streams.iter().filter(|stream| {
            let arm = run(stream, fault, |_, _| Ok(())).unwrap();
            arm.over_limits(&stream.motion) > 1.0 + 1e-6
        });
        assert!(found.count() > 10, "{fault:?}");
    }
}
