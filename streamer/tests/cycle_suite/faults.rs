//! Every supervised fault, stall and guard trip, and the way back.
use crate::harness::{CycleHarness, HOME_RAD, JOINTS, World, shipped_settings, swing};
use crate::{arrived, assert_on_path, assert_within_stop_limits};
use taustream_arm::AfterStall;
use taustream_drivers::{DriveState, DriveTarget, LinkFault};
use taustream_messages::{Command, FaultReason, PauseReason, Phase};
use taustream_motion::{Stroke, Trajectory, joint_array};
use taustream_streamer::answer::AnswerReason;
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::names::Names;

/// Every supervised fault, planted in the middle of a motion: fast stop on the path, then fault, drives holding.
#[test]
fn fault_of_any_kind_while_moving_stops_the_arm_on_the_path_and_names_the_joint() {
    type Plant = fn(&mut World);
    let table: [(&str, Plant, FaultReason, Option<usize>); 5] = [
        ("drive fault", |w| w.forced[2] = Some(DriveState::Fault), FaultReason::DriveFault, Some(2)),
        ("warning", |w| w.warning = Some(4), FaultReason::DriveWarning, Some(4)),
        ("dropped", |w| w.forced[1] = Some(DriveState::Disabled), FaultReason::DriveDropped, Some(1)),
        ("silent", |w| w.silent = Some(3), FaultReason::FeedbackLate, Some(3)),
        ("jump", |w| w.offset_rad[5] = 0.08, FaultReason::PositionJump, Some(5)),
    ];
    for (name, plant, reason, joint) in table {
        let mut harness = CycleHarness::new();
        let trajectory = harness.move_it();
        harness.run(600);
        harness.script(plant);
        harness.run_until(Phase::FastStopping, 40);
        let cause = harness.cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (reason, joint), "{name}");
        if name == "warning" {
            let said = Names::default().fault(&cause);
            assert_eq!(said, "drive warns (statusword) at joint 5: 0x1237");
        }
        harness.run_until(Phase::Fault, 1_500);
        harness.run(50);
        assert_eq!(harness.phase(), Phase::Fault, "{name}: nothing resumes by itself");
        assert_eq!(
            harness.world.lock().unwrap().drive_target,
            Some(DriveTarget::Enabled),
            "{name}: the drives hold"
        );
        assert_on_path(&harness, &trajectory);
        assert_within_stop_limits(&harness);
        let answer = harness.ask(Command::ClearFault);
        let gone = name == "jump"; // The joint stands still at its new place, within the tracking limit.
        assert_eq!(answer.accepted, gone, "{name}: clear-fault while the cause persists: {:?}", answer.why);
    }
}

#[test]
fn tracking_error_that_creeps_stops_the_arm() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    for _ in 0..400 {
        harness.script(|w| w.offset_rad[0] += 0.001);
        harness.step_after(1);
    }
    let cause = harness.cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::TrackingError, Some(0)));
    harness.run_until(Phase::Fault, 1_500);
}

#[test]
fn fault_cleared_while_drives_hold_locks_and_enable_makes_ready() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(500);
    harness.script(|w| w.silent = Some(3));
    harness.run_until(Phase::Fault, 2_000);
    let held = arrived(&harness);
    assert!(!harness.ask(Command::Enable).accepted);
    harness.script(|w| w.silent = None);
    harness.run(5);
    harness.accept(Command::ClearFault);
    assert_eq!(harness.phase(), Phase::Locked);
    assert!(matches!(harness.offer(swing(&held, 0.2)), Decision::NotReady { phase: Phase::Locked }));
    harness.accept(Command::Enable);
    assert_eq!(harness.phase(), Phase::Holding);
    harness.run(3);
    assert_eq!(arrived(&harness), held, "the commanded pose stays the truth");
    assert!(matches!(harness.offer(swing(&held, 0.2)), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 5_000);
    assert_within_stop_limits(&harness);
}

#[test]
fn fault_of_one_drive_is_cleared_only_after_the_others_were_disabled() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(500);
    harness.script(|w| w.forced[2] = Some(DriveState::Fault));
    harness.run_until(Phase::Fault, 2_000);
    assert!(matches!(harness.ask(Command::ClearFault).why, AnswerReason::PartlyEnergised { joint: 2, .. }));
    harness.accept(Command::Disable);
    harness.run(20);
    assert_eq!(harness.phase(), Phase::Fault);
    harness.accept(Command::ClearFault);
    assert_eq!(harness.world.lock().unwrap().clears, 1);
    assert_eq!(harness.phase(), Phase::Fault, "the drive is still being reset");
    harness.script(|w| w.forced[2] = None);
    harness.run_until(Phase::Disabled, 60);
    harness.run(40);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
}

#[test]
fn reset_that_does_not_help_leaves_the_fault() {
    let mut harness = CycleHarness::new();
    harness.run_until(Phase::Disabled, 60);
    harness.script(|w| w.forced[0] = Some(DriveState::Fault));
    harness.run_until(Phase::Fault, 20);
    harness.accept(Command::ClearFault);
    harness.run(6_000);
    assert_eq!((harness.phase(), harness.cause().unwrap().joint), (Phase::Fault, Some(0)));
}

#[test]
fn one_lost_cycle_is_made_up_for_by_a_longer_step() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(600);
    harness.script(|w| w.link_fault = Some(LinkFault::QueueFull));
    harness.run(1);
    harness.script(|w| w.link_fault = None);
    harness.run_until(Phase::Holding, 5_000);
    assert_on_path(&harness, &trajectory);
    assert_eq!(harness.cause(), None);
}

#[test]
fn stall_within_tolerance_goes_on_in_true_time() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(600);
    let before = harness.cycles.last().unwrap().s;
    harness.step_after(2);
    let after = harness.cycles.last().unwrap().s;
    assert!((after - before - 2e-3).abs() < 1e-12, "{before} to {after}");
    harness.run_until(Phase::Holding, 5_000);
    assert_on_path(&harness, &trajectory);
}

/// Goal: where every servo continues, a stall that the settings let resume costs no time on the path, and is counted; a longer
/// one freezes; and one servo that freezes freezes the arm.
#[test]
fn stall_of_an_arm_that_goes_on_is_bridged_in_time_and_counted() {
    for (gap, freezes, bridged) in
        [(12, None, true), (20, None, true), (21, None, false), (12, Some(4), false)]
    {
        let mut settings = shipped_settings();
        settings.servos.iter_mut().for_each(|servo| servo.after_stall = AfterStall::GoOn);
        if let Some(joint) = freezes {
            settings.servos[joint].after_stall = AfterStall::Freeze;
        }
        let mut harness = CycleHarness::with(settings);
        let trajectory = harness.move_it();
        harness.run(600);
        let before = *harness.cycles.last().unwrap();
        harness.step_after(gap);
        let after = *harness.cycles.last().unwrap();
        let passed_s = if bridged { gap as f64 * 1e-3 } else { 0.0 };
        assert!((after.s - before.s - passed_s).abs() < 1e-9, "a gap of {gap}: {} to {}", before.s, after.s);
        assert_eq!(after.sigma > 0.0, bridged, "a gap of {gap}");
        harness.run(10);
        assert_eq!(harness.report.unwrap().stalls, 1, "a gap of {gap}");
        if bridged {
            harness.run_until(Phase::Holding, 5_000);
            assert_eq!(harness.report.unwrap().guard_trips, 0, "a gap of {gap}");
        }
        assert_on_path(&harness, &trajectory);
    }
}

#[test]
fn stall_beyond_tolerance_freezes_and_ramps_up_again() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(600);
    let before = *harness.cycles.last().unwrap();
    harness.step_after(12);
    let after = harness.cycles.last().unwrap();
    assert_eq!((after.s, after.position_rad), (before.s, before.position_rad));
    assert_eq!(after.sigma.to_bits(), 0.0_f64.to_bits());
    let resumed_at = harness.world.lock().unwrap().arrived.len();
    harness.run_until(Phase::Holding, 6_000);
    assert_on_path(&harness, &trajectory);
    harness.world.lock().unwrap().arrived.drain(..resumed_at);
    assert_within_stop_limits(&harness);
}

#[test]
fn stall_longer_than_allowed_stays_paused_until_resume() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(600);
    harness.step_after(40);
    assert_eq!(harness.phase(), Phase::Paused);
    let pause = harness.core.supervisor().paused_by().expect("a pause has a reason");
    assert_eq!(pause.reason, PauseReason::Stall);
    assert!((pause.gap_s - 0.04).abs() < 1e-9, "{pause:?}");
    harness.run(300);
    assert_eq!(harness.phase(), Phase::Paused);
    assert_eq!(harness.core.supervisor().paused_by(), Some(pause));
    harness.accept(Command::Resume);
    assert_eq!(harness.core.supervisor().paused_by(), None);
    harness.accept(Command::Pause);
    assert_eq!(harness.core.supervisor().paused_by().map(|pause| pause.reason), Some(PauseReason::Operator));
    harness.run_until(Phase::Paused, 2_000);
    assert_eq!(harness.core.supervisor().paused_by().map(|pause| pause.reason), Some(PauseReason::Operator));
    harness.accept(Command::Resume);
    harness.run_until(Phase::Holding, 6_000);
    assert_on_path(&harness, &trajectory);
}

/// Drives answer SYNC, and none leaves during a stall; the answer to the first one after it comes a cycle later.
#[test]
fn stall_of_the_loop_is_no_missing_feedback_of_a_drive() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(600);
    harness.script(|w| w.silent = Some(3));
    harness.step_after(40);
    harness.script(|w| w.silent = None);
    harness.run(50);
    assert_eq!((harness.phase(), harness.cause()), (Phase::Paused, None));
    harness.script(|w| w.silent = Some(3));
    harness.run_until(Phase::Fault, 40);
    assert_eq!(harness.cause().unwrap().reason, FaultReason::FeedbackLate);
}

#[test]
fn stall_longer_than_the_drives_watchdog_is_a_fault() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(600);
    harness.step_after(150);
    assert_eq!(harness.cause().unwrap().reason, FaultReason::Stall);
    harness.run_until(Phase::Fault, 100);
}

/// Plants for the guard: motions that intake would never let through, put into the cycle's own queue.
#[test]
fn guard_trips_on_a_corrupted_trajectory_and_every_joint_brakes_within_stop_limits() {
    let fast = |duration_s: f64, delta: f64| {
        let stroke = Stroke {
            start_s: 0.0,
            duration_s,
            n: 6,
            delta_rad: joint_array([0.2, 0.0, 0.0, delta, 0.0, 0.1]),
        };
        Trajectory::new(JOINTS, HOME_RAD, &[stroke]).unwrap()
    };
    // Too fast; jerk far beyond; out of the position range at legal rates.
    for (trajectory, joint) in [(fast(0.5, 1.5), 3), (fast(0.05, 0.3), 0), (fast(3.0, -2.5), 3)] {
        let mut harness = CycleHarness::new();
        harness.enable();
        assert!(matches!(harness.offer(trajectory), Decision::Accepted { .. }));
        harness.run_until(Phase::Fault, 4_000);
        assert!(harness.phases.contains(&(Phase::Moving, Phase::Braking)), "{:?}", harness.phases);
        let cause = harness.cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (FaultReason::Guard, Some(joint)));
        harness.run(150);
        // The last setpoint let through, from which the brake starts, may use the guard's slack of 0.1 %.
        let worst = harness.worst_use_of_stop_limits();
        assert!(worst.iter().all(|w| *w <= 1.0015), "use of stop limits (v, a, j): {worst:?}");
        let limits = harness.settings.robot.limits();
        let world = harness.world.lock().unwrap();
        for (tick, pose) in &world.arrived {
            let [low, high] = limits[3].position_rad;
            let (a, j) = (limits[3].stop.acceleration_rad_s2, limits[3].stop.jerk_rad_s3);
            let swing_out_rad = a * a * a / (24.0 * j * j);
            assert!(
                (low - swing_out_rad..=high + swing_out_rad).contains(&pose[3]),
                "tick {tick}: {} rad",
                pose[3]
            );
        }
    }
}

#[test]
fn guard_trip_can_be_cleared_and_the_arm_moves_again_from_where_it_braked() {
    let mut harness = CycleHarness::new();
    harness.enable();
    let stroke =
        Stroke { start_s: 0.0, duration_s: 0.3, n: 6, delta_rad: joint_array([1.5, 0., 0., 0., 0., 0.]) };
    harness.offer(Trajectory::new(JOINTS, HOME_RAD, &[stroke]).unwrap());
    harness.run_until(Phase::Fault, 2_000);
    harness.run(5);
    harness.accept(Command::ClearFault);
    harness.accept(Command::Enable);
    let base = arrived(&harness);
    let next = swing(&base, 0.5);
    assert!(matches!(harness.offer(next.clone()), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 5_000);
    assert_eq!(arrived(&harness), next.end_rad());
    assert_eq!(harness.cause(), None);
}

/// Goal: a drive that stops because its master was silent is not blamed for a stall of this loop, whether it says so at
/// once or a while later; without a stall it is.
#[test]
fn drive_that_lost_its_master_in_a_stall_of_the_loop_is_not_blamed() {
    for (gap, later, reason) in [
        (60, 0, FaultReason::Stall),
        (60, 500, FaultReason::Stall),
        (60, 1_500, FaultReason::DriveFault),
        (1, 0, FaultReason::DriveFault),
    ] {
        let mut harness = CycleHarness::new();
        harness.enable();
        harness.run(100);
        harness.step_after(gap);
        harness.run(later);
        harness.script(|w| (w.forced[3], w.lost_master) = (Some(DriveState::Fault), Some(3)));
        harness.run(3);
        let cause = harness.cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (reason, Some(3)), "a gap of {gap}, {later} cycles before");
        if reason == FaultReason::Stall {
            assert!((cause.value - 0.06).abs() < 1e-9, "{cause:?}");
        }
    }
}

/// Goal: the time that a failed bus was silent is no stall of this loop: the drive's own words stay.
#[test]
fn drive_that_lost_its_master_while_its_bus_was_down_is_no_stall_of_the_loop() {
    let mut harness = CycleHarness::new();
    harness.enable();
    harness.run(100);
    harness.script(|w| w.link_fault = Some(LinkFault::Down));
    harness.run_until(Phase::Fault, 40);
    harness.run(600);
    harness.script(|w| w.link_fault = None);
    assert!(harness.queue_request(Command::ClearFault).is_none());
    assert!(harness.restore_buses());
    assert!(harness.step_to_answer().accepted);
    harness.script(|w| (w.forced[3], w.lost_master) = (Some(DriveState::Fault), Some(3)));
    harness.run_until(Phase::Fault, 400);
    let cause = harness.cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::DriveFault, Some(3)), "{cause:?}");
}

/// Goal: a drive's fault shows what tripped: its statusword then, and its code even when that comes later.
#[test]
fn drive_fault_keeps_the_statusword_that_tripped_and_gets_its_code_later() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(600);
    harness.script(|w| w.forced[2] = Some(DriveState::Fault));
    harness.run_until(Phase::FastStopping, 40);
    let names = Names::of(&harness.settings);
    let said = names.fault(&harness.cause().unwrap());
    assert!(said.contains("no error code yet; status 0x1237"), "{said}");
    harness.script(|w| w.error_code = 0x8611);
    harness.run(1);
    let said = names.fault(&harness.cause().unwrap());
    assert!(said.contains("0x8611 following error too large (status 0x1237"), "{said}");
    // The first code is the one that tripped.
    harness.script(|w| w.error_code = 0x3220);
    harness.run_until(Phase::Fault, 1_500);
    assert!(names.fault(&harness.cause().unwrap()).contains("0x8611"));
}

/// Goal: what healthy drives report is noted, new codes soon, the same again at most once a second, and nothing stops.
#[test]
fn emergency_messages_of_healthy_drives_are_noted_at_a_bounded_rate() {
    let mut harness = CycleHarness::new();
    harness.run(100);
    assert_eq!(harness.emergencies, []);
    harness.script(|w| w.emergency = (0x8130, 1));
    harness.run(1);
    let first: Vec<(usize, u32, u32)> = (0..6).map(|joint| (joint, 0x8130, 1)).collect();
    assert_eq!(harness.emergencies, first);
    harness.emergencies.clear();
    for count in 2..=500 {
        harness.script(|w| w.emergency = (0x8130, count));
        harness.run(1);
    }
    assert_eq!(harness.emergencies, []);
    harness.run(600);
    let again: Vec<(usize, u32, u32)> = (0..6).map(|joint| (joint, 0x8130, 499)).collect();
    assert_eq!(harness.emergencies, again);
    assert_eq!(harness.phase(), Phase::Disabled);
}
