//! Every supervised fault, stall and guard trip, and the way back.
use crate::rig::{HOME_RAD, JOINTS, Rig, World, swing};
use crate::{arrived, assert_on_path, assert_within_stop_limits};
use taustream_drivers::{DriveState, DriveWish, LinkFault};
use taustream_messages::{Command, FaultReason, Phase};
use taustream_motion::{Stroke, Trajectory};
use taustream_streamer::facts::Decision;
use taustream_streamer::names::Names;
use taustream_streamer::words::Why;

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
        let mut rig = Rig::new();
        let trajectory = rig.move_it();
        rig.run(600);
        rig.script(plant);
        rig.run_until(Phase::FastStopping, 40);
        let cause = rig.cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (reason, joint), "{name}");
        if name == "warning" {
            let said = Names::default().fault(&cause);
            assert_eq!(said, "drive warns (statusword) at joint 5: 0x1237");
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

/// Drives answer SYNC, and none leaves during a stall; the answer to the first one after it comes a cycle later.
#[test]
fn stall_of_the_loop_is_no_silence_of_a_drive() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(600);
    rig.script(|w| w.silent = Some(3));
    rig.step_after(40);
    rig.script(|w| w.silent = None);
    rig.run(50);
    assert_eq!((rig.phase(), rig.cause()), (Phase::Paused, None));
    rig.script(|w| w.silent = Some(3));
    rig.run_until(Phase::Fault, 40);
    assert_eq!(rig.cause().unwrap().reason, FaultReason::FeedbackLate);
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
