//! The shipped cycle over scripted drives: every stop, every supervised fault, stalls, and the way back.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    unreachable_pub,
    reason = "helpers of tests fail by panicking; what reaches the drives is compared bit by bit"
)]
mod rig;

use rig::{HOME_RAD, JOINTS, Rig, swing};
use taustream_drivers::{DriveState, DriveWish, LinkFault};
use taustream_messages::{Command, FaultReason, Phase};
use taustream_motion::limits::check_motion;
use taustream_motion::{Stroke, Trajectory};
use taustream_streamer::cycle::Next;
use taustream_streamer::facts::Decision;
use taustream_streamer::intake::Leave;
use taustream_streamer::log::cause_sentence;
use taustream_streamer::words::Why;

/// Room for rounding only: a difference over a period averages the derivative, it cannot exceed it.
const ROUNDING: f64 = 1.0 + 1e-6;

fn assert_within_stop_limits(rig: &Rig) {
    let worst = rig.worst_use_of_stop_limits();
    assert!(worst.iter().all(|w| *w <= ROUNDING), "use of stop limits (v, a, j): {worst:?}");
}

/// Every setpoint that a trajectory made is, bit for bit, that trajectory at the logged time.
fn assert_on_path(rig: &Rig, trajectory: &Trajectory) {
    let mut seen = 0;
    for cycle in rig.cycles.iter().filter(|c| c.trajectory_id != 0) {
        let expected = trajectory.sample(cycle.s).position_rad;
        assert_eq!(cycle.position_rad, expected, "tick {} at s = {}", cycle.tick, cycle.s);
        seen += 1;
    }
    assert!(seen > 10, "only {seen} setpoints of a trajectory");
}

fn arrived(rig: &Rig) -> taustream_motion::JointArray {
    rig.world.lock().unwrap().arrived.last().unwrap().1
}

#[test]
fn swing_used_by_these_tests_is_within_the_motion_limits() {
    let rig = Rig::new();
    let peaks = check_motion(&swing(&HOME_RAD, 1.0), &rig.settings.robot.limits()).unwrap();
    assert!(peaks.jerk_rad_s3[0] > 60.0, "too tame to test anything: {peaks:?}");
}

#[test]
fn motion_from_enable_to_end_follows_the_trajectory_bit_by_bit() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    let ticks = rig.tick;
    rig.run_until(Phase::Holding, 5_000);
    let took_s = (rig.tick - ticks) as f64 * 1e-3;
    assert!((took_s - trajectory.duration_s()).abs() < 2e-3, "{took_s} s");
    assert_on_path(&rig, &trajectory);
    assert_within_stop_limits(&rig);
    rig.run(10);
    assert_eq!(arrived(&rig), trajectory.end_rad());
    assert_eq!(rig.cause(), None);
}

#[test]
fn pause_and_resume_at_any_time_stay_on_the_path_within_stop_limits() {
    for pause_after in [1, 137, 300, 700, 1_150, 1_900, 2_500] {
        for paused_for in [5, 200, 2_000] {
            let mut rig = Rig::new();
            let trajectory = rig.move_it();
            rig.run(pause_after);
            rig.accept(Command::Pause);
            rig.run(paused_for);
            if rig.phase() == Phase::Holding {
                continue; // The end came before the pause.
            }
            rig.accept(Command::Resume);
            rig.run_until(Phase::Holding, 6_000);
            assert_on_path(&rig, &trajectory);
            assert_within_stop_limits(&rig);
            assert_eq!(arrived(&rig), trajectory.end_rad());
        }
    }
}

#[test]
fn speed_changed_while_moving_stays_on_the_path_and_is_remembered() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    for (ticks, percent) in [(200, 30.0), (150, 80.0), (100, 0.0), (900, 55.0), (300, 100.0)] {
        rig.run(ticks);
        rig.accept(Command::Speed { percent });
        assert_eq!(rig.phase(), Phase::Moving);
    }
    rig.run_until(Phase::Holding, 8_000);
    assert_on_path(&rig, &trajectory);
    assert_within_stop_limits(&rig);
    rig.accept(Command::Speed { percent: 50.0 });
    let start = rig.tick;
    let back = swing(&trajectory.end_rad(), -0.5);
    assert!(matches!(rig.offer(back.clone()), Decision::Accepted { .. }));
    rig.run_until(Phase::Holding, 9_000);
    let took_s = (rig.tick - start) as f64 * 1e-3;
    assert!((took_s - 2.0 * back.duration_s()).abs() < 5e-3, "half speed took {took_s} s");
}

#[test]
fn stop_and_fast_stop_end_at_rest_on_the_path() {
    for (command, end) in [(Command::Stop, Phase::Holding), (Command::FastStop, Phase::Fault)] {
        for after in [3, 250, 777, 1_400, 2_200] {
            let mut rig = Rig::new();
            let trajectory = rig.move_it();
            rig.run(after);
            rig.accept(command);
            rig.run_until(end, 1_500);
            rig.run(5);
            assert_on_path(&rig, &trajectory);
            assert_within_stop_limits(&rig);
            let (last, before) = (&rig.cycles[rig.cycles.len() - 1], &rig.cycles[rig.cycles.len() - 2]);
            assert_eq!(last.position_rad, before.position_rad, "the arm rests");
            let reason = rig.cause().map(|c| c.reason);
            assert_eq!(reason, (command == Command::FastStop).then_some(FaultReason::Operator));
        }
    }
}

/// Every supervised fault, planted in the middle of a motion: fast stop on the path, then fault, drives holding.
#[test]
fn fault_of_any_kind_while_moving_stops_the_arm_on_the_path_and_names_the_joint() {
    type Plant = fn(&mut rig::World);
    let table: [(&str, Plant, FaultReason, Option<usize>); 8] = [
        ("drive fault", |w| w.forced[2] = Some(DriveState::Fault), FaultReason::DriveFault, Some(2)),
        ("warning", |w| w.warning = Some(4), FaultReason::DriveFault, Some(4)),
        ("dropped", |w| w.forced[1] = Some(DriveState::Disabled), FaultReason::DriveDropped, Some(1)),
        ("silent", |w| w.silent = Some(3), FaultReason::FeedbackLate, Some(3)),
        ("jump", |w| w.offset_rad[5] = 0.08, FaultReason::PositionJump, Some(5)),
        ("bus off", |w| w.error_frame = Some(0x040), FaultReason::BusFault, None),
        ("error passive", |w| w.error_frame = Some(0x004), FaultReason::BusFault, None),
        ("restarted", |w| w.error_frame = Some(0x100), FaultReason::BusFault, None),
    ];
    for (name, plant, reason, joint) in table {
        let mut rig = Rig::new();
        let trajectory = rig.move_it();
        rig.run(600);
        rig.script(plant);
        rig.run_until(Phase::FastStopping, 40);
        let cause = rig.cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (reason, joint), "{name}");
        if name == "warning" {
            let said = cause_sentence(&cause, |joint| joint.to_string());
            assert_eq!(said, "drive warns (statusword): joint 4, 0x1237");
        }
        rig.run_until(Phase::Fault, 1_500);
        rig.run(50);
        assert_eq!(rig.phase(), Phase::Fault, "{name}: nothing resumes by itself");
        assert_eq!(rig.world.lock().unwrap().wish, Some(DriveWish::Enabled), "{name}: the drives hold");
        assert_on_path(&rig, &trajectory);
        assert_within_stop_limits(&rig);
        let answer = rig.ask(Command::ClearFault);
        let gone = name == "jump"; // The joint stands still at its new place, within the tracking limit.
        assert_eq!(answer.accepted, gone, "{name}: clear-fault while the cause persists: {:?}", answer.why);
    }
}

#[test]
fn tracking_error_that_creeps_stops_the_arm() {
    let mut rig = Rig::new();
    rig.move_it();
    for _ in 0..400 {
        rig.script(|w| w.offset_rad[0] += 0.001);
        rig.step_after(1);
    }
    let cause = rig.cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::TrackingError, Some(0)));
    rig.run_until(Phase::Fault, 1_500);
}

#[test]
fn fault_cleared_while_drives_hold_locks_and_enable_makes_ready() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(500);
    rig.script(|w| w.silent = Some(3));
    rig.run_until(Phase::Fault, 2_000);
    let held = arrived(&rig);
    assert!(!rig.ask(Command::Enable).accepted);
    rig.script(|w| w.silent = None);
    rig.run(5);
    rig.accept(Command::ClearFault);
    assert_eq!(rig.phase(), Phase::Locked);
    assert!(matches!(rig.offer(swing(&held, 0.2)), Decision::NotReady { phase: Phase::Locked }));
    rig.accept(Command::Enable);
    assert_eq!(rig.phase(), Phase::Holding);
    rig.run(3);
    assert_eq!(arrived(&rig), held, "the commanded pose stays the truth");
    assert!(matches!(rig.offer(swing(&held, 0.2)), Decision::Accepted { .. }));
    rig.run_until(Phase::Holding, 5_000);
    assert_within_stop_limits(&rig);
}

#[test]
fn fault_of_one_drive_is_cleared_only_after_the_others_were_disabled() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(500);
    rig.script(|w| w.forced[2] = Some(DriveState::Fault));
    rig.run_until(Phase::Fault, 2_000);
    assert!(matches!(rig.ask(Command::ClearFault).why, Why::PartlyEnergised { joint: 2, .. }));
    rig.accept(Command::Disable);
    rig.run(20);
    assert_eq!(rig.phase(), Phase::Fault);
    rig.accept(Command::ClearFault);
    assert_eq!(rig.world.lock().unwrap().clears, 1);
    assert_eq!(rig.phase(), Phase::Fault, "the drive is still being reset");
    rig.script(|w| w.forced[2] = None);
    rig.run_until(Phase::Disabled, 60);
    rig.run(40);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
}

#[test]
fn reset_that_does_not_help_leaves_the_fault() {
    let mut rig = Rig::new();
    rig.run_until(Phase::Disabled, 60);
    rig.script(|w| w.forced[0] = Some(DriveState::Fault));
    rig.run_until(Phase::Fault, 20);
    rig.accept(Command::ClearFault);
    rig.run(6_000);
    assert_eq!((rig.phase(), rig.cause().unwrap().joint), (Phase::Fault, Some(0)));
}

#[test]
fn bus_that_takes_nothing_freezes_the_path_and_becomes_a_bus_fault() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(600);
    rig.script(|w| w.link_fault = Some(LinkFault::QueueFull));
    rig.run(3);
    assert_eq!(rig.cause().unwrap().reason, FaultReason::BusFault);
    rig.run(50);
    assert_eq!(rig.phase(), Phase::Fault);
    assert!(!rig.ask(Command::ClearFault).accepted);
    rig.script(|w| w.link_fault = None);
    rig.run(3);
    assert_on_path(&rig, &trajectory);
    // What the drives got last is what they go on getting: nothing jumped while nobody listened.
    let world = rig.world.lock().unwrap();
    let (last, before) = (world.arrived[world.arrived.len() - 1], world.arrived[world.arrived.len() - 4]);
    assert_eq!(last.1, before.1);
}

/// Goal: a link that has ended never passes for a bus whose drives are off: what they last said is old.
#[test]
fn fault_of_a_bus_that_is_gone_is_not_cleared_and_says_what_helps() {
    let mut rig = Rig::new();
    rig.enable();
    rig.script(|w| (w.link_fault, w.link_takes) = (Some(LinkFault::Gone), 0));
    rig.run_until(Phase::Fault, 50);
    let answer = rig.ask(Command::ClearFault);
    let sentence = answer.why.sentence(|joint| joint.to_string());
    assert!(!answer.accepted && sentence.contains("restart the streamer"), "{sentence}");
    rig.run(20);
    assert_eq!(rig.phase(), Phase::Fault);
}

#[test]
fn one_lost_cycle_is_made_up_for_by_a_longer_step() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(600);
    rig.script(|w| w.link_fault = Some(LinkFault::QueueFull));
    rig.run(1);
    rig.script(|w| w.link_fault = None);
    rig.run_until(Phase::Holding, 5_000);
    assert_on_path(&rig, &trajectory);
    assert_eq!(rig.cause(), None);
}

#[test]
fn stall_within_tolerance_goes_on_in_true_time() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(600);
    let before = rig.cycles.last().unwrap().s;
    rig.step_after(2);
    let after = rig.cycles.last().unwrap().s;
    assert!((after - before - 2e-3).abs() < 1e-12, "{before} to {after}");
    rig.run_until(Phase::Holding, 5_000);
    assert_on_path(&rig, &trajectory);
}

#[test]
fn stall_beyond_tolerance_freezes_and_ramps_up_again() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(600);
    let before = *rig.cycles.last().unwrap();
    rig.step_after(12);
    let after = rig.cycles.last().unwrap();
    assert_eq!((after.s, after.position_rad), (before.s, before.position_rad));
    assert_eq!(after.sigma.to_bits(), 0.0_f64.to_bits());
    let resumed_at = rig.world.lock().unwrap().arrived.len();
    rig.run_until(Phase::Holding, 6_000);
    assert_on_path(&rig, &trajectory);
    rig.world.lock().unwrap().arrived.drain(..resumed_at);
    assert_within_stop_limits(&rig);
}

#[test]
fn stall_longer_than_allowed_stays_paused_until_resume() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(600);
    rig.step_after(40);
    assert_eq!(rig.phase(), Phase::Paused);
    rig.run(300);
    assert_eq!(rig.phase(), Phase::Paused);
    rig.accept(Command::Resume);
    rig.run_until(Phase::Holding, 6_000);
    assert_on_path(&rig, &trajectory);
}

#[test]
fn stall_longer_than_the_drives_watchdog_is_a_fault() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(600);
    rig.step_after(150);
    assert_eq!(rig.cause().unwrap().reason, FaultReason::Stall);
    rig.run_until(Phase::Fault, 100);
}

#[test]
fn trajectory_from_another_base_is_refused_by_how_much() {
    let mut rig = Rig::new();
    rig.enable();
    let mut base = HOME_RAD;
    base[4] += 0.01;
    let Decision::NotAtBase { joint: 4, by_rad } = rig.offer(swing(&base, 0.2)) else { panic!("taken") };
    assert!((by_rad - 0.01).abs() < 1e-12);
    assert_eq!(rig.phase(), Phase::Holding);
}

#[test]
fn trajectory_from_a_base_within_tolerance_starts_without_a_step() {
    let mut rig = Rig::new();
    rig.enable();
    let mut base = HOME_RAD;
    let tolerance = rig.settings.supervision.base_tolerance_rad;
    base[1] += 0.9 * tolerance;
    let trajectory = swing(&base, 1.0);
    assert!(matches!(rig.offer(trajectory.clone()), Decision::Accepted { .. }));
    rig.run_until(Phase::Holding, 5_000);
    assert_within_stop_limits(&rig);
    assert_eq!((arrived(&rig), rig.cause()), (trajectory.end_rad(), None));
}

#[test]
fn trajectory_of_an_old_generation_is_refused() {
    let mut rig = Rig::new();
    rig.enable();
    assert!(matches!(rig.offer_as(swing(&HOME_RAD, 0.2), 7), Decision::Accepted { .. }));
    rig.run_until(Phase::Holding, 5_000);
    let base = arrived(&rig);
    assert_eq!(rig.offer_as(swing(&base, 0.2), 7), Decision::Stale { newest: 7 });
    assert!(matches!(rig.offer_as(swing(&base, 0.2), 8), Decision::Accepted { .. }));
}

#[test]
fn trajectory_offered_while_moving_is_refused_and_the_motion_goes_on() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(300);
    let decision = rig.offer(swing(&HOME_RAD, 0.2));
    assert_eq!(decision, Decision::NotReady { phase: Phase::Moving });
    rig.run_until(Phase::Holding, 5_000);
    assert_on_path(&rig, &trajectory);
}

/// Plants for the guard: motions that intake would never let through, put into the cycle's own queue.
#[test]
fn guard_trips_on_a_doctored_trajectory_and_every_joint_brakes_within_stop_limits() {
    let fast = |duration_s: f64, delta: f64| {
        let stroke =
            Stroke { start_s: 0.0, duration_s, n: 6, delta_rad: [0.2, 0.0, 0.0, delta, 0.0, 0.1, 0.0, 0.0] };
        Trajectory::new(JOINTS, HOME_RAD, &[stroke]).unwrap()
    };
    // Too fast; jerk far beyond; out of the position range at legal rates.
    for (trajectory, joint) in [(fast(0.5, 1.5), 3), (fast(0.05, 0.3), 0), (fast(3.0, -2.5), 3)] {
        let mut rig = Rig::new();
        rig.enable();
        assert!(matches!(rig.offer(trajectory), Decision::Accepted { .. }));
        rig.run_until(Phase::Fault, 4_000);
        assert!(rig.phases.contains(&(Phase::Moving, Phase::Braking)), "{:?}", rig.phases);
        let cause = rig.cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (FaultReason::Guard, Some(joint)));
        rig.run(150);
        // The last setpoint let through, from which the brake starts, may use the guard's slack of 0.1 %.
        let worst = rig.worst_use_of_stop_limits();
        assert!(worst.iter().all(|w| *w <= 1.0015), "use of stop limits (v, a, j): {worst:?}");
        let limits = rig.settings.robot.limits();
        let world = rig.world.lock().unwrap();
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
    let mut rig = Rig::new();
    rig.enable();
    let stroke = Stroke { start_s: 0.0, duration_s: 0.3, n: 6, delta_rad: [1.5, 0., 0., 0., 0., 0., 0., 0.] };
    rig.offer(Trajectory::new(JOINTS, HOME_RAD, &[stroke]).unwrap());
    rig.run_until(Phase::Fault, 2_000);
    rig.run(5);
    rig.accept(Command::ClearFault);
    rig.accept(Command::Enable);
    let base = arrived(&rig);
    let next = swing(&base, 0.5);
    assert!(matches!(rig.offer(next.clone()), Decision::Accepted { .. }));
    rig.run_until(Phase::Holding, 5_000);
    assert_eq!(arrived(&rig), next.end_rad());
    assert_eq!(rig.cause(), None);
}

#[test]
fn enable_is_refused_with_the_reason_while_the_arm_is_not_fit() {
    let mut rig = Rig::new();
    rig.script(|w| w.forced[5] = Some(DriveState::Configuring));
    rig.run(5);
    let why = rig.ask(Command::Enable).why;
    assert_eq!(why, Why::NotConfigured { joint: 5, state: DriveState::Configuring });
    rig.script(|w| w.forced[5] = None);
    rig.run(5);
    assert_eq!(rig.ask(Command::Enable).why, Why::SpeedUnknown);
    rig.run_until(Phase::Disabled, 60);
    rig.script(|w| w.warning = Some(1));
    assert!(matches!(rig.ask(Command::Enable).why, Why::Warns { joint: 1, .. }));
    rig.script(|w| w.warning = None);
    rig.script(|w| w.offset_rad[2] = 3.0);
    assert!(matches!(rig.ask(Command::Enable).why, Why::OutOfRange { joint: 2, .. }));
    rig.script(|w| w.offset_rad[2] = 0.0);
    rig.run(40);
    rig.script(|w| w.silent = Some(0));
    rig.run(30);
    assert!(matches!(rig.ask(Command::Enable).why, Why::NoFeedback { joint: 0, .. }));
    rig.script(|w| w.silent = None);
    rig.run(40);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
}

#[test]
fn first_enable_in_the_first_cycle_of_disabled_is_taken() {
    let mut rig = Rig::new();
    rig.run_until(Phase::Disabled, 60);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
}

/// A drive that restarts tells its pose anew; the step from the old one is no speed.
#[test]
fn drive_that_is_configured_again_elsewhere_delays_disabled_until_its_speed_is_known() {
    let mut rig = Rig::new();
    rig.run_until(Phase::Disabled, 60);
    rig.script(|w| w.forced[2] = Some(DriveState::Configuring));
    rig.run_until(Phase::Configuring, 5);
    rig.script(|w| w.pipeline.iter_mut().for_each(|pose| pose[2] += 0.3));
    rig.run(5);
    rig.script(|w| w.forced[2] = None);
    rig.run(2);
    assert_eq!(rig.ask(Command::Enable).why, Why::SpeedUnknown);
    rig.run_until(Phase::Disabled, 60);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
}

#[test]
fn enable_starts_from_the_measured_pose() {
    let mut rig = Rig::new();
    rig.script(|w| w.pipeline.iter_mut().for_each(|pose| pose[1] += 0.123));
    rig.enable();
    let first = rig.world.lock().unwrap().arrived[0].1;
    assert!((first[1] - (HOME_RAD[1] + 0.123)).abs() < 1e-12);
}

#[test]
fn drive_that_does_not_get_enabled_in_time_is_a_fault_and_all_go_off() {
    let mut rig = Rig::new();
    rig.run_until(Phase::Disabled, 60);
    rig.run(40);
    rig.accept(Command::Enable);
    rig.script(|w| w.forced[3] = Some(DriveState::Enabling));
    rig.run_until(Phase::Fault, 6_000);
    let cause = rig.cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::BringUp, Some(3)));
    rig.run(1);
    assert_eq!(rig.world.lock().unwrap().wish, Some(DriveWish::Disabled));
}

/// Goal: who commissions an arm reads which object a drive refused and why, not a bare number.
#[test]
fn drive_that_refuses_its_configuration_is_a_fault_that_names_object_and_code() {
    let mut rig = Rig::new();
    rig.script(|w| {
        w.forced[2] = Some(DriveState::Refused);
        (w.error_code, w.refused_object) = (0x0604_0041, 0x16_0002);
    });
    rig.run_until(Phase::Fault, 20);
    let cause = rig.cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::ConfigurationRefused, Some(2)));
    let text = cause_sentence(&cause, |joint| format!("{joint}"));
    assert!(text.contains("joint 2, object 0x1600:02: SDO abort 0x06040041"), "{text}");
    assert!(text.contains("cannot be mapped"), "{text}");
}

#[test]
fn drive_found_energised_is_reported_and_left_alone() {
    let mut rig = Rig::new();
    rig.script(|w| w.forced[2] = Some(DriveState::EnergisedUnowned));
    rig.run_until(Phase::Fault, 20);
    assert_eq!(rig.cause().unwrap().reason, FaultReason::NotTrusted);
    rig.run(3);
    assert_eq!(rig.world.lock().unwrap().wish, Some(DriveWish::Disabled));
    assert_eq!(rig.ask(Command::ClearFault).why, Why::Unowned { joint: 2 });
    assert_eq!(rig.world.lock().unwrap().clears, 0);
}

#[test]
fn torque_off_in_any_phase_reaches_the_drives_in_the_next_cycle() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(400);
    rig.accept(Command::TorqueOff);
    assert_eq!(rig.phase(), Phase::Fault);
    rig.run(1);
    assert_eq!(rig.world.lock().unwrap().wish, Some(DriveWish::TorqueOff));
    rig.run(20);
    rig.accept(Command::ClearFault);
    rig.run_until(Phase::Disabled, 60);
}

#[test]
fn disable_is_refused_while_moving_and_done_at_rest() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(100);
    assert_eq!(rig.ask(Command::Disable).why, Why::StopFirst);
    rig.accept(Command::Pause);
    rig.run_until(Phase::Paused, 1_500);
    rig.accept(Command::Disable);
    rig.run_until(Phase::Disabled, 50);
    assert_eq!(rig.world.lock().unwrap().wish, Some(DriveWish::Disabled));
}

#[test]
fn leaving_orderly_stops_disables_and_ends() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(500);
    rig.leave(Leave::Orderly);
    let ended = (0..3_000).find_map(|_| Some(rig.step_after(1)).filter(|n| *n != Next::Go));
    assert_eq!(ended, Some(Next::Ended));
    assert_on_path(&rig, &trajectory);
    assert_within_stop_limits(&rig);
    assert_eq!(rig.world.lock().unwrap().states[0], DriveState::Disabled);
    assert!(rig.phases.contains(&(Phase::Stopping, Phase::Holding)), "{:?}", rig.phases);
}

#[test]
fn leaving_at_once_switches_torque_off() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(500);
    rig.leave(Leave::AtOnce);
    let ended = (0..200).find_map(|_| Some(rig.step_after(1)).filter(|n| *n != Next::Go));
    assert_eq!(ended, Some(Next::EndedAtOnce));
    assert_eq!(rig.world.lock().unwrap().wish, Some(DriveWish::TorqueOff));
}

#[test]
fn speed_floods_never_keep_a_stop_from_stopping() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(300);
    let mut refused = 0;
    for i in 0..120 {
        let percent = if i % 2 == 0 { 20.0 } else { 90.0 };
        refused += u32::from(!rig.ask(Command::Speed { percent }).accepted);
    }
    assert!(refused > 0, "the flood was meant to fill every slot");
    rig.accept(Command::Stop);
    rig.run_until(Phase::Holding, 1_500);
    assert_on_path(&rig, &trajectory);
    assert_within_stop_limits(&rig);
}

/// Goal: whatever is asked, in whatever order and at whatever time, with stalls and lost cycles in between, what
/// reaches the drives has no step, and the guard never trips. Method: seeded random operators.
#[test]
fn random_operators_and_stalls_never_make_the_guard_trip() {
    let mut moved = 0;
    for seed in 0..60_u64 {
        let mut rig = Rig::new();
        rig.enable();
        let mut state = seed * 2 + 1;
        let mut draw = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % n
        };
        for _ in 0..60 {
            match draw(12) {
                0 | 1 => drop(rig.ask(Command::Pause)),
                2..=4 => drop(rig.ask(Command::Resume)),
                5 => drop(rig.ask(Command::Stop)),
                6 | 7 => drop(rig.ask(Command::Speed { percent: draw(101) as f64 })),
                8 => drop(rig.step_after(1 + draw(30))),
                _ if rig.phase() == Phase::Holding => {
                    let base = arrived(&rig);
                    let back = if base[0] > 0.3 { -0.9 } else { 0.9 };
                    moved += u32::from(matches!(rig.offer(swing(&base, back)), Decision::Accepted { .. }));
                }
                _ => rig.run(draw(400)),
            }
        }
        assert_eq!(rig.cause(), None, "seed {seed}");
    }
    assert!(moved > 60, "only {moved} motions");
}
