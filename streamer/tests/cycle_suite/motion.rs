//! Motions from enable to end: pause, speed, stop, and which trajectory is taken over.
use crate::harness::{CycleHarness, HOME_RAD, swing};
use crate::{arrived, assert_on_path, assert_within_stop_limits};
use taustream_messages::{Command, FaultReason, Phase};
use taustream_motion::limits::check_motion;
use taustream_streamer::cycle_state::Decision;

#[test]
fn swing_used_by_these_tests_is_within_the_motion_limits() {
    let harness = CycleHarness::new();
    let peaks = check_motion(&swing(&HOME_RAD, 1.0), &harness.settings.robot.limits()).unwrap();
    assert!(peaks.jerk_rad_s3[0] > 60.0, "too tame to test anything: {peaks:?}");
}

#[test]
fn motion_from_enable_to_end_follows_the_trajectory_bit_by_bit() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    let ticks = harness.tick;
    harness.run_until(Phase::Holding, 5_000);
    let took_s = (harness.tick - ticks) as f64 * 1e-3;
    assert!((took_s - trajectory.duration_s()).abs() < 2e-3, "{took_s} s");
    assert_on_path(&harness, &trajectory);
    assert_within_stop_limits(&harness);
    harness.run(10);
    assert_eq!(arrived(&harness), trajectory.end_rad());
    assert_eq!(harness.cause(), None);
}

#[test]
fn pause_and_resume_at_any_time_stay_on_the_path_within_stop_limits() {
    for pause_after in [1, 137, 300, 700, 1_150, 1_900, 2_500] {
        for paused_for in [5, 200, 2_000] {
            let mut harness = CycleHarness::new();
            let trajectory = harness.move_it();
            harness.run(pause_after);
            harness.accept(Command::Pause);
            harness.run(paused_for);
            if harness.phase() == Phase::Holding {
                continue; // The end came before the pause.
            }
            harness.accept(Command::Resume);
            harness.run_until(Phase::Holding, 6_000);
            assert_on_path(&harness, &trajectory);
            assert_within_stop_limits(&harness);
            assert_eq!(arrived(&harness), trajectory.end_rad());
        }
    }
}

#[test]
fn speed_changed_while_moving_stays_on_the_path_and_is_remembered() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    for (ticks, percent) in [(200, 30.0), (150, 80.0), (100, 0.0), (900, 55.0), (300, 100.0)] {
        harness.run(ticks);
        harness.accept(Command::Speed { percent });
        assert_eq!(harness.phase(), Phase::Moving);
    }
    harness.run_until(Phase::Holding, 8_000);
    assert_on_path(&harness, &trajectory);
    assert_within_stop_limits(&harness);
    harness.accept(Command::Speed { percent: 50.0 });
    let start = harness.tick;
    let back = swing(&trajectory.end_rad(), -0.5);
    assert!(matches!(harness.offer(back.clone()), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 9_000);
    let took_s = (harness.tick - start) as f64 * 1e-3;
    assert!((took_s - 2.0 * back.duration_s()).abs() < 5e-3, "half speed took {took_s} s");
}

#[test]
fn stop_and_fast_stop_end_at_rest_on_the_path() {
    for (command, end) in [(Command::Stop, Phase::Holding), (Command::FastStop, Phase::Fault)] {
        for after in [12, 250, 777, 1_400, 2_200] {
            let mut harness = CycleHarness::new();
            let trajectory = harness.move_it();
            harness.run(after);
            harness.accept(command);
            harness.run_until(end, 1_500);
            harness.run(90); // A stop right after the start is short.
            assert_on_path(&harness, &trajectory);
            assert_within_stop_limits(&harness);
            let (last, before) =
                (&harness.cycles[harness.cycles.len() - 1], &harness.cycles[harness.cycles.len() - 2]);
            assert_eq!(last.position_rad, before.position_rad, "the arm is at rest");
            let reason = harness.cause().map(|c| c.reason);
            assert_eq!(reason, (command == Command::FastStop).then_some(FaultReason::Operator));
        }
    }
}

#[test]
fn trajectory_from_another_base_is_refused_by_how_much() {
    let mut harness = CycleHarness::new();
    harness.enable();
    let mut base = HOME_RAD;
    base[4] += 0.01;
    let Decision::NotAtBase { joint: 4, by_rad } = harness.offer(swing(&base, 0.2)) else { panic!("taken") };
    assert!((by_rad - 0.01).abs() < 1e-12);
    assert_eq!(harness.phase(), Phase::Holding);
}

#[test]
fn trajectory_from_a_base_within_tolerance_starts_without_a_step() {
    let mut harness = CycleHarness::new();
    harness.enable();
    let mut base = HOME_RAD;
    let tolerance = harness.settings.supervision.base_tolerance_rad;
    base[1] += 0.9 * tolerance;
    let trajectory = swing(&base, 1.0);
    assert!(matches!(harness.offer(trajectory.clone()), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 5_000);
    assert_within_stop_limits(&harness);
    assert_eq!((arrived(&harness), harness.cause()), (trajectory.end_rad(), None));
}

#[test]
fn trajectory_of_an_old_generation_is_refused() {
    let mut harness = CycleHarness::new();
    harness.enable();
    assert!(matches!(harness.offer_as(swing(&HOME_RAD, 0.2), 7), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 5_000);
    let base = arrived(&harness);
    assert_eq!(harness.offer_as(swing(&base, 0.2), 7), Decision::Stale { newest: 7 });
    assert!(matches!(harness.offer_as(swing(&base, 0.2), 8), Decision::Accepted { .. }));
}

#[test]
fn trajectory_offered_while_moving_is_refused_and_the_motion_goes_on() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(300);
    let decision = harness.offer(swing(&HOME_RAD, 0.2));
    assert_eq!(decision, Decision::NotReady { phase: Phase::Moving });
    harness.run_until(Phase::Holding, 5_000);
    assert_on_path(&harness, &trajectory);
}

/// Goal: whatever is asked, in whatever order and at whatever time, with stalls and lost cycles in between, what
/// reaches the drives has no step, and the guard never trips. Method: seeded random operators.
#[test]
fn random_operators_and_stalls_never_make_the_guard_trip() {
    let mut moved = 0;
    for seed in 0..60_u64 {
        let mut harness = CycleHarness::new();
        harness.enable();
        let mut state = seed * 2 + 1;
        let mut random = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % n
        };
        for _ in 0..60 {
            match random(12) {
                0 | 1 => drop(harness.ask(Command::Pause)),
                2..=4 => drop(harness.ask(Command::Resume)),
                5 => drop(harness.ask(Command::Stop)),
                6 | 7 => drop(harness.ask(Command::Speed { percent: random(101) as f64 })),
                8 => drop(harness.step_after(1 + random(30))),
                _ if harness.phase() == Phase::Holding => {
                    let base = arrived(&harness);
                    let back = if base[0] > 0.3 { -0.9 } else { 0.9 };
                    moved +=
                        u32::from(matches!(harness.offer(swing(&base, back)), Decision::Accepted { .. }));
                }
                _ => harness.run(random(400)),
            }
        }
        assert_eq!(harness.cause(), None, "seed {seed}");
    }
    assert!(moved > 60, "only {moved} motions");
}
