//! Replacements of a motion that runs: when they take over, what they leave as it is, and what is refused.
use crate::harness::{CycleHarness, HOME_RAD, JOINTS, swing};
use crate::{arrived, assert_within_stop_limits};
use taustream_drivers::LinkFault;
use taustream_messages::{Command, Phase};
use taustream_motion::cut::{KeptDifference, kept};
use taustream_motion::limits::check_motion_from;
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory, joint_array};
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::successor::CutRefusal;

/// Well inside the motion limits, so that strokes may be dropped and added.
const SIZE: f64 = 0.3;

/// The strokes that a cut keeps, folded by `folded_s`, and one more stroke from the cut on.
fn replacement(cut: &Trajectory, (at_s, folded_s): (f64, f64), by_rad: f64) -> Trajectory {
    let kept = kept(cut, at_s, folded_s);
    let delta_rad = joint_array([1.0, -0.4, 0.2, -0.3, 0.6, 0.1]).map(|part| part * by_rad);
    let mut strokes = kept.strokes.to_vec();
    strokes.push(Stroke { start_s: at_s, duration_s: 1.1, n: 6, delta_rad });
    Trajectory::new(JOINTS, kept.base_rad, &strokes).unwrap()
}

/// A harness in motion, with every trajectory that was accepted.
struct Moving {
    harness: CycleHarness,
    accepted: Vec<(u64, Trajectory)>,
}

impl Moving {
    fn new() -> Self {
        let mut harness = CycleHarness::new();
        harness.enable();
        let trajectory = swing(&HOME_RAD, SIZE);
        assert!(matches!(harness.offer(trajectory.clone()), Decision::Accepted { .. }));
        let id = harness.newest_id();
        Self { harness, accepted: vec![(id, trajectory)] }
    }

    fn newest(&self) -> (u64, Trajectory) {
        self.accepted.last().unwrap().clone()
    }

    /// Trajectory time of the newest setpoint.
    fn s(&self) -> f64 {
        self.harness.cycles.last().unwrap().s
    }

    /// Replaces the newest one `ahead_s` from now, or from when the change of speed that runs lets it.
    fn replace(&mut self, ahead_s: f64, by_rad: f64) -> f64 {
        let (id, running) = self.newest();
        for _ in 0..400 {
            let at_s = self.s() + ahead_s;
            let trajectory = replacement(&running, (at_s, at_s), by_rad);
            check_motion_from(&trajectory, &self.harness.settings.robot.limits(), at_s).unwrap();
            let decision = self.harness.offer_cut(trajectory.clone(), (id, at_s));
            if decision == Decision::Cut(CutRefusal::SpeedChanges) {
                continue;
            }
            assert!(matches!(decision, Decision::Waits { .. }), "{decision:?}");
            self.accepted.push((self.harness.newest_id(), trajectory));
            return at_s;
        }
        panic!("the speed does not settle");
    }

    fn take(&mut self, cut: u64, at_s: f64, trajectory: Trajectory) {
        let decision = self.harness.offer_cut(trajectory.clone(), (cut, at_s));
        assert!(matches!(decision, Decision::Waits { .. }), "{decision:?}");
        self.accepted.push((self.harness.newest_id(), trajectory));
    }

    /// Every setpoint is, bit for bit, its trajectory at its trajectory time; time never goes back and never jumps; each
    /// trajectory takes over with the first setpoint at or after its cut.
    fn assert_spliced(&self, cuts: &[f64]) {
        let cycles: Vec<_> = self.harness.cycles.iter().filter(|cycle| cycle.trajectory_id != 0).collect();
        for cycle in &cycles {
            let (_, on) = self.accepted.iter().find(|(id, _)| *id == cycle.trajectory_id).unwrap();
            assert_eq!(cycle.position_rad, on.sample(cycle.s).position_rad, "at s = {}", cycle.s);
        }
        let mut cuts = cuts.iter();
        for pair in cycles.windows(2) {
            let [before, after] = pair else { continue };
            let periods = (after.tick - before.tick) as f64;
            let step_s = after.s - before.s;
            assert!((0.0..=periods * 1e-3 + 1e-12).contains(&step_s), "{step_s} s in {periods} periods");
            if before.trajectory_id != after.trajectory_id {
                let cut = cuts.next().expect("a takeover that no cut explains");
                assert!(before.s <= *cut && *cut <= after.s, "{} {cut} {}", before.s, after.s);
            }
        }
        assert_eq!(cuts.next(), None, "a cut without a takeover");
        assert_within_stop_limits(&self.harness);
        assert_eq!(self.harness.cause(), None);
    }

    fn finish(&mut self) {
        self.harness.run_until(Phase::Holding, 12_000);
        self.harness.run(3);
        assert_eq!(arrived(&self.harness), self.newest().1.end_rad());
    }
}

#[test]
fn replacement_takes_over_at_its_cut_and_not_a_setpoint_earlier() {
    for (after, ahead_s) in [(1, 0.0), (1, 0.003), (250, 0.0005), (480, 0.0), (900, 0.35), (1_500, 0.2)] {
        let mut moving = Moving::new();
        moving.harness.run(after);
        let at_s = moving.replace(ahead_s, 0.1);
        moving.finish();
        moving.assert_spliced(&[at_s]);
    }
}

#[test]
fn replacement_at_the_very_end_goes_on_without_holding() {
    let mut moving = Moving::new();
    moving.harness.run(400);
    let (id, running) = moving.newest();
    let end_s = running.duration_s();
    let next = replacement(&running, (end_s, end_s), 0.1);
    assert_eq!(
        (next.strokes().len(), *next.base_rad()),
        (1, running.end_rad()),
        "all ended strokes are folded"
    );
    moving.take(id, end_s, next);
    moving.finish();
    moving.assert_spliced(&[end_s]);
    assert_eq!(moving.harness.phases.iter().filter(|(_, to)| *to == Phase::Holding).count(), 2);
}

/// Goal: a successor waits through a pause, whether it is accepted before, in or after the ramp, and `resume` goes into it.
#[test]
fn replacement_waits_through_pauses_and_speed_0() {
    for (pause_first, wait, ahead_s) in [(true, 1, 0.15), (true, 60, 0.02), (true, 800, 0.0), (false, 1, 0.3)]
    {
        let mut moving = Moving::new();
        moving.harness.run(500);
        let mut at_s = 0.0;
        if !pause_first {
            at_s = moving.replace(ahead_s, 0.1);
        }
        moving.harness.accept(Command::Pause);
        moving.harness.run(wait);
        if pause_first {
            at_s = moving.replace(ahead_s, 0.1);
        }
        moving.harness.run(1_500);
        assert_eq!(moving.harness.phase(), Phase::Paused, "nothing resumes by itself");
        let paused_s = moving.s();
        moving.harness.run(500);
        assert_eq!(moving.s().to_bits(), paused_s.to_bits());
        moving.harness.accept(Command::Resume);
        moving.harness.run(30);
        moving.harness.accept(Command::Speed { percent: 0.0 });
        moving.harness.run(900);
        moving.harness.accept(Command::Speed { percent: 70.0 });
        moving.finish();
        moving.assert_spliced(&[at_s]);
    }
}

#[test]
fn newer_replacement_of_the_running_one_takes_the_place_of_what_waits() {
    let mut moving = Moving::new();
    moving.harness.run(300);
    let (id, running) = moving.newest();
    let first = moving.s() + 0.2;
    moving.take(id, first, replacement(&running, (first, first), 0.1));
    let second = moving.s() + 0.4;
    moving.take(id, second, replacement(&running, (second, second), -0.1));
    assert_eq!(moving.harness.core_waiting().map(|(_, from_s)| from_s), Some(second));
    moving.finish();
    moving.assert_spliced(&[second]);
}

/// Goal: the one that waits is cut in its own time, and what cuts it takes over where it would have.
#[test]
fn replacement_of_the_waiting_one_takes_over_at_the_first_cut() {
    let mut moving = Moving::new();
    moving.harness.run(300);
    let first = moving.replace(0.2, 0.1);
    let (id, waiting) = moving.newest();
    let refused = |moving: &mut Moving, at_s: f64, folded_s: f64| {
        let decision = moving.harness.offer_cut(replacement(&waiting, (at_s, folded_s), -0.1), (id, at_s));
        assert!(matches!(decision, Decision::Cut(_)), "{decision:?}");
        decision
    };
    assert!(matches!(refused(&mut moving, first - 0.01, 0.0), Decision::Cut(CutRefusal::Outside { .. })));
    // Strokes that end only after the takeover must not be folded.
    let late = waiting.duration_s();
    let folded = refused(&mut moving, late, late);
    assert!(matches!(folded, Decision::Cut(CutRefusal::Kept(KeptDifference::Stroke(0)))), "{folded:?}");
    moving.take(id, late, replacement(&waiting, (late, first), -0.1));
    moving.finish();
    moving.assert_spliced(&[first]);
}

/// Goal: under hundreds of replacements in a row strokes do not pile up, and boxes go round.
#[test]
fn chain_of_replacements_stays_short_and_exact() {
    let mut moving = Moving::new();
    let mut cuts = Vec::new();
    let mut most = 0;
    for round in 0..150_u32 {
        moving.harness.run(90);
        cuts.push(moving.replace(0.02, if round % 2 == 0 { 0.06 } else { -0.06 }));
        most = most.max(moving.newest().1.strokes().len());
    }
    moving.finish();
    moving.assert_spliced(&cuts);
    assert!(most < 24, "{most} strokes");
}

/// A message, what it cuts and when, and the reason that it is refused for.
type Row<'a> = (Box<Trajectory>, u64, f64, &'a dyn Fn(CutRefusal) -> bool);

#[test]
fn hostile_replacements_are_refused_with_their_reason_and_change_nothing() {
    let mut moving = Moving::new();
    moving.harness.run(750);
    let (id, running) = moving.newest();
    // Later than the last row, and while two strokes run.
    let at_s = moving.s() + 0.25;
    let good = replacement(&running, (at_s, at_s), 0.1);
    assert!(kept(&running, at_s, at_s).strokes.len() == 2, "two strokes run");
    let spoiled = |change: &dyn Fn(&mut JointArray, &mut Vec<Stroke>)| {
        let (mut base_rad, mut strokes) = (*good.base_rad(), good.strokes().to_vec());
        change(&mut base_rad, &mut strokes);
        Box::new(Trajectory::new(JOINTS, base_rad, &strokes).unwrap())
    };
    let up = |value: &mut f64| *value = f64::from_bits(value.to_bits() + 1);
    let stroke = |index| CutRefusal::Kept(KeptDifference::Stroke(index));
    let passed_s = moving.s() - 0.25;
    let table: [Row<'_>; 12] = [
        (spoiled(&|_, s| up(&mut s[1].delta_rad[3])), id, at_s, &|r| r == stroke(1)),
        (spoiled(&|_, s| up(&mut s[0].duration_s)), id, at_s, &|r| r == stroke(0)),
        (spoiled(&|_, s| up(&mut s[1].start_s)), id, at_s, &|r| r == stroke(1)),
        (spoiled(&|_, s| s[0].n += 1), id, at_s, &|r| r == stroke(0)),
        (spoiled(&|_, s| s[0].delta_rad[2] = -s[0].delta_rad[2]), id, at_s, &|r| r == stroke(0)),
        (spoiled(&|_, s| *s = s.split_off(2)), id, at_s, &|r| r == stroke(0)),
        (spoiled(&|_, s| s.insert(2, Stroke { start_s: 0.9 * at_s, ..s[2] })), id, at_s, &|r| r == stroke(2)),
        (
            spoiled(&|b, _| up(&mut b[5])),
            id,
            at_s,
            &|r| matches!(r, CutRefusal::Kept(KeptDifference::Base { joint: 5, by_rad }) if by_rad > 0.0),
        ),
        (Box::new(good.clone()), id + 7, at_s, &|r| matches!(r, CutRefusal::OtherTrajectory { .. })),
        (
            Box::new(replacement(&running, (passed_s, passed_s), 0.1)),
            id,
            passed_s,
            &|r| matches!(r, CutRefusal::Passed { by_s, .. } if (0.25..0.45).contains(&by_s)),
        ),
        (Box::new(good.clone()), id, f64::NAN, &|r| matches!(r, CutRefusal::Outside { .. })),
        (Box::new(good.clone()), id, running.duration_s() + 0.1, &|r| {
            matches!(r, CutRefusal::Outside { .. })
        }),
    ];
    for (row, (trajectory, cut, at_s, is_reason)) in table.into_iter().enumerate() {
        let decision = moving.harness.offer_cut(*trajectory, (cut, at_s));
        let Decision::Cut(refusal) = decision else { panic!("row {row}: {decision:?}") };
        assert!(is_reason(refusal), "row {row}: {refusal:?}");
        assert!(!refusal.rejection().to_string().is_empty());
        assert_eq!(moving.harness.core_waiting(), None, "row {row}");
    }
    let decision = moving.harness.offer_cut_as(good, (id, at_s), 1);
    assert_eq!(decision, Decision::Stale { newest: 1 });
    moving.finish();
    moving.assert_spliced(&[]);
}

/// Goal: a replacement that comes when the motion has ended, or is being stopped, is refused, and says why.
#[test]
fn replacement_of_what_does_not_go_on_is_refused() {
    let mut moving = Moving::new();
    moving.harness.run(400);
    let (id, running) = moving.newest();
    let at_s = running.duration_s();
    let late = replacement(&running, (at_s, at_s), 0.1);
    moving.harness.accept(Command::Stop);
    let stopping = Decision::Cut(CutRefusal::NothingToCut { phase: Phase::Stopping });
    assert_eq!(moving.harness.offer_cut(late.clone(), (id, at_s)), stopping);
    moving.harness.run_until(Phase::Holding, 3_000);
    let holding = Decision::Cut(CutRefusal::NothingToCut { phase: Phase::Holding });
    assert_eq!(moving.harness.offer_cut(late, (id, at_s)), holding);
}

/// Goal: stops and faults drop what waits, and its box comes back.
#[test]
fn stops_drop_what_waits() {
    for command in [Command::Stop, Command::FastStop, Command::TorqueOff] {
        for _ in 0..8 {
            let mut moving = Moving::new();
            moving.harness.run(500);
            moving.replace(0.4, 0.1);
            moving.harness.accept(command);
            moving.harness.run(1_500);
            assert_eq!(moving.harness.core_waiting(), None, "{command:?}");
            assert!(matches!(moving.harness.phase(), Phase::Holding | Phase::Fault));
            let boxes = std::iter::from_fn(|| moving.harness.command_queue.trajectories.empty_box()).count();
            assert_eq!(boxes, 5, "every box has come back");
        }
    }
}

/// Goal: frames that are refused at the takeover only delay it; a stall in front of it leaves trajectory time before the cut.
#[test]
fn takeover_with_lost_frames_or_a_stall_keeps_the_path() {
    for (lost, stall) in [(1, 0), (2, 0), (0, 10), (0, 40), (1, 12)] {
        let mut moving = Moving::new();
        moving.harness.run(600);
        let at_s = moving.replace(0.005, 0.1);
        moving.harness.run(4);
        moving.harness.script(|world| world.link_fault = (lost > 0).then_some(LinkFault::QueueFull));
        moving.harness.run(lost);
        moving.harness.script(|world| world.link_fault = None);
        if stall > 0 {
            moving.harness.step_after(stall);
        }
        moving.harness.run(400);
        if moving.harness.phase() == Phase::Paused {
            moving.harness.accept(Command::Resume);
        }
        moving.finish();
        let cycles: Vec<_> = moving.harness.cycles.iter().filter(|cycle| cycle.trajectory_id != 0).collect();
        let sent = cycles.iter().filter(|cycle| cycle.joint_sent[0]);
        let ids: Vec<(u64, bool)> = sent.map(|cycle| (cycle.trajectory_id, cycle.s < at_s)).collect();
        let (first, second) = (moving.accepted[0].0, moving.accepted[1].0);
        assert!(ids.iter().all(|(id, before)| *id == if *before { first } else { second }), "{lost} {stall}");
        assert!(ids.is_sorted_by_key(|(id, _)| *id));
        assert_eq!(moving.harness.cause(), None);
    }
}

/// Goal: random replacements at random moments, with pauses, speeds and stalls between, never trip the guard and never leave
/// the paths.
#[test]
fn random_replacements_pauses_and_stalls_never_make_the_guard_trip() {
    let mut replaced = 0;
    for seed in 0..40_u64 {
        let mut moving = Moving::new();
        let mut state = seed * 2 + 1;
        let mut random = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % n
        };
        for _ in 0..80 {
            match random(10) {
                0 => drop(moving.harness.ask(Command::Pause)),
                1 | 2 => drop(moving.harness.ask(Command::Resume)),
                3 => drop(moving.harness.ask(Command::Speed { percent: random(101) as f64 })),
                4 => drop(moving.harness.step_after(1 + random(30))),
                _ => {
                    let (cut, by_rad) =
                        (moving.s() + random(200) as f64 * 1e-3, random(13) as f64 * 0.01 - 0.06);
                    replaced += u32::from(offer_random(&mut moving, cut, by_rad));
                }
            }
            moving.harness.run(random(120));
        }
        assert_eq!(moving.harness.cause(), None, "seed {seed}");
        assert_eq!(moving.harness.report.map(|report| report.guard_trips), Some(0), "seed {seed}");
        for cycle in moving.harness.cycles.iter().filter(|cycle| cycle.trajectory_id != 0) {
            let (_, on) = moving.accepted.iter().find(|(id, _)| *id == cycle.trajectory_id).unwrap();
            let on_path = on.sample(cycle.s).position_rad;
            let beside = (0..MAX_JOINTS)
                .map(|joint| (cycle.position_rad[joint] - on_path[joint] - cycle.off_path_rad[joint]).abs());
            assert!(cycle.sigma == 0.0 || beside.fold(0.0, f64::max) < 1e-12, "seed {seed} {}", cycle.tick);
        }
    }
    assert!(replaced > 500, "only {replaced} replacements");
}

/// Offers a replacement of what runs when it keeps the limits; true when it was accepted.
fn offer_random(moving: &mut Moving, at_s: f64, by_rad: f64) -> bool {
    let running_id = moving.harness.cycles.last().unwrap().trajectory_id;
    let running = moving.accepted.iter().find(|(id, _)| *id == running_id).map(|(_, t)| t.clone());
    let Some(running) = running.filter(|running| at_s <= running.duration_s()) else {
        if moving.harness.phase() == Phase::Holding {
            let trajectory = swing(&arrived(&moving.harness), SIZE * by_rad.signum());
            assert!(matches!(moving.harness.offer(trajectory.clone()), Decision::Accepted { .. }));
            moving.accepted.push((moving.harness.newest_id(), trajectory));
        }
        return false;
    };
    let trajectory = replacement(&running, (at_s, at_s), by_rad);
    if check_motion_from(&trajectory, &moving.harness.settings.robot.limits(), at_s).is_err() {
        return false;
    }
    let decision = moving.harness.offer_cut(trajectory.clone(), (running_id, at_s));
    let taken = matches!(decision, Decision::Waits { .. });
    if taken {
        moving.accepted.push((moving.harness.newest_id(), trajectory));
    } else {
        let cut = matches!(decision, Decision::Cut(_));
        assert!(cut, "{decision:?}");
    }
    taken
}

/// Goal: a replacement that waits is reported, and everything accepted ends where the report says.
#[test]
fn report_says_what_waits_and_where_everything_ends() {
    let mut moving = Moving::new();
    moving.harness.run(300);
    let (first, running) = moving.newest();
    let at_s = moving.replace(0.2, 0.1);
    let (second, waiting) = moving.newest();
    let report = moving.harness.report.unwrap();
    assert_eq!((report.trajectory_id, report.successor_id), (first, second));
    assert_eq!((report.successor_from_s, report.end_s), (at_s, waiting.duration_s()));
    assert_eq!((report.end_rad, report.trajectory_duration_s), (waiting.end_rad(), running.duration_s()));
    moving.harness.run(250);
    let report = moving.harness.report.unwrap();
    assert_eq!((report.trajectory_id, report.successor_id), (second, 0));
}
