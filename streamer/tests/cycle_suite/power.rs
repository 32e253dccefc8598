//! Enabling and disabling drives, torque off, and the streamer's end.
use crate::harness::{CycleHarness, HOME_RAD};
use crate::{assert_on_path, assert_within_stop_limits};
use taustream_drivers::{DriveState, DriveTarget, Nanos};
use taustream_messages::{Command, FaultReason, Phase};
use taustream_streamer::answer::AnswerReason;
use taustream_streamer::cycle::Next;
use taustream_streamer::intake::Shutdown;
use taustream_streamer::names::Names;

#[test]
fn enable_is_refused_with_the_reason_while_the_arm_is_not_fit() {
    let mut harness = CycleHarness::new();
    harness.script(|w| w.forced[5] = Some(DriveState::Configuring));
    harness.run(5);
    let why = harness.ask(Command::Enable).why;
    assert!(
        matches!(why, AnswerReason::NotConfigured { joint: 5, state: DriveState::Configuring, .. }),
        "{why:?}"
    );
    // What the drive's driver has found is said at once, before it becomes a fault.
    harness.script(|w| w.error_code = 0x0001_0010);
    let said = harness.ask(Command::Enable).why.sentence(&Names::of(&harness.settings));
    assert!(said.contains("joint 6 `wrist_3`") && said.contains("another master sends SYNC"), "{said}");
    harness.script(|w| w.error_code = 0);
    harness.script(|w| w.forced[5] = None);
    harness.run(5);
    assert_eq!(harness.ask(Command::Enable).why, AnswerReason::SpeedUnknown);
    harness.run_until(Phase::Disabled, 60);
    harness.script(|w| w.warning = Some(1));
    assert!(matches!(harness.ask(Command::Enable).why, AnswerReason::Warns { joint: 1, .. }));
    harness.script(|w| w.warning = None);
    harness.script(|w| w.silent = Some(0));
    harness.run(30);
    assert!(matches!(harness.ask(Command::Enable).why, AnswerReason::NoFeedback { joint: 0, .. }));
    harness.script(|w| w.silent = None);
    harness.run(40);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
}

#[test]
fn first_enable_in_the_first_cycle_of_disabled_is_taken() {
    let mut harness = CycleHarness::new();
    harness.run_until(Phase::Disabled, 60);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
}

/// A drive that restarts tells its pose again; the step from the old one is no speed.
#[test]
fn drive_that_is_configured_again_elsewhere_delays_disabled_until_its_speed_is_known() {
    let mut harness = CycleHarness::new();
    harness.run_until(Phase::Disabled, 60);
    harness.script(|w| w.forced[2] = Some(DriveState::Configuring));
    harness.run_until(Phase::Configuring, 5);
    harness.script(|w| w.pipeline.iter_mut().for_each(|pose| pose[2] += 0.3));
    harness.run(5);
    harness.script(|w| w.forced[2] = None);
    harness.run(2);
    assert_eq!(harness.ask(Command::Enable).why, AnswerReason::SpeedUnknown);
    harness.run_until(Phase::Disabled, 60);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
}

#[test]
fn enable_starts_from_the_measured_pose() {
    let mut harness = CycleHarness::new();
    harness.script(|w| w.pipeline.iter_mut().for_each(|pose| pose[1] += 0.123));
    harness.enable();
    let first = harness.world.lock().unwrap().arrived[0].1;
    assert!((first[1] - (HOME_RAD[1] + 0.123)).abs() < 1e-12);
}

#[test]
fn drive_that_does_not_get_enabled_in_time_is_a_fault_and_all_go_off() {
    let mut harness = CycleHarness::new();
    harness.run_until(Phase::Disabled, 60);
    harness.run(40);
    harness.accept(Command::Enable);
    harness.script(|w| w.forced[3] = Some(DriveState::Enabling));
    harness.run_until(Phase::Fault, 6_000);
    let cause = harness.cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::BringUp, Some(3)));
    harness.run(1);
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::Disabled));
}

/// Goal: who commissions an arm reads which object a drive refused and why, not a bare number.
#[test]
fn drive_that_refuses_its_configuration_is_a_fault_that_names_object_and_code() {
    let mut harness = CycleHarness::new();
    harness.script(|w| {
        w.forced[2] = Some(DriveState::Refused);
        (w.error_code, w.refused_object) = (0x0604_0041, 0x16_0002);
    });
    harness.run_until(Phase::Fault, 20);
    let cause = harness.cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::ConfigurationRefused, Some(2)));
    let said = harness.ask(Command::Enable).why.sentence(&Names::default());
    assert!(said.contains("SDO abort 0x06040041") && said.contains("`clear-fault`"), "{said}");
    let text = Names::default().fault(&cause);
    assert!(text.contains("joint 3: object 0x1600:02: SDO abort 0x06040041"), "{text}");
    assert!(text.contains("cannot be mapped"), "{text}");
}

#[test]
fn drive_found_energised_is_reported_and_left_alone() {
    let mut harness = CycleHarness::new();
    harness.script(|w| w.forced[2] = Some(DriveState::EnergisedUnowned));
    harness.run_until(Phase::Fault, 20);
    assert_eq!(harness.cause().unwrap().reason, FaultReason::EnergisedUnowned);
    harness.run(3);
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::Disabled));
    assert_eq!(harness.ask(Command::ClearFault).why, AnswerReason::Unowned { joint: 2 });
    assert_eq!(harness.world.lock().unwrap().clears, 0);
}

#[test]
fn torque_off_in_any_phase_reaches_the_drives_in_the_next_cycle() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(400);
    harness.accept(Command::TorqueOff);
    assert_eq!(harness.phase(), Phase::Fault);
    harness.run(1);
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::TorqueOff));
    harness.run(20);
    harness.accept(Command::ClearFault);
    harness.run_until(Phase::Disabled, 60);
}

/// Goal: a drive that restarts after torque off can be cleared. Drivers look at such a drive again when the target is
/// disabled, and not before.
#[test]
fn drive_that_is_lost_after_torque_off_is_cleared() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.accept(Command::TorqueOff);
    harness.script(|w| w.forced[2] = Some(DriveState::Fault));
    harness.run(20);
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::TorqueOff));
    assert_eq!(harness.ask(Command::ClearFault).why, AnswerReason::Resetting);
    harness.run(1);
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::Disabled));
    assert_eq!(harness.phase(), Phase::Fault, "it is not cleared before its drives are");
    harness.script(|w| w.forced[2] = None);
    harness.run_until(Phase::Disabled, 60);
    harness.run(40);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
}

#[test]
fn disable_is_refused_while_moving_and_done_at_rest() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(100);
    assert_eq!(harness.ask(Command::Disable).why, AnswerReason::StopFirst);
    harness.accept(Command::Pause);
    harness.run_until(Phase::Paused, 1_500);
    harness.accept(Command::Disable);
    harness.run_until(Phase::Disabled, 50);
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::Disabled));
}

#[test]
fn orderly_shutdown_stops_disables_and_ends() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(500);
    harness.shutdown(Shutdown::Orderly);
    let ended = (0..3_000).find_map(|_| Some(harness.step_after(1)).filter(|n| *n != Next::Go));
    assert_eq!(ended, Some(Next::Ended));
    assert_on_path(&harness, &trajectory);
    assert_within_stop_limits(&harness);
    assert_eq!(harness.world.lock().unwrap().states[0], DriveState::Disabled);
    assert!(harness.phases.contains(&(Phase::Stopping, Phase::Holding)), "{:?}", harness.phases);
}

#[test]
fn shutdown_at_once_switches_torque_off() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(500);
    harness.shutdown(Shutdown::AtOnce);
    let ended = (0..200).find_map(|_| Some(harness.step_after(1)).filter(|n| *n != Next::Go));
    assert_eq!(ended, Some(Next::EndedAtOnce));
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::TorqueOff));
}

#[test]
fn speed_floods_never_keep_a_stop_from_stopping() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(300);
    let mut refused = 0;
    for i in 0..120 {
        let percent = if i % 2 == 0 { 20.0 } else { 90.0 };
        refused += u32::from(!harness.ask(Command::Speed { percent }).accepted);
    }
    assert!(refused > 0, "the flood was meant to fill every slot");
    harness.accept(Command::Stop);
    harness.run_until(Phase::Holding, 1_500);
    assert_on_path(&harness, &trajectory);
    assert_within_stop_limits(&harness);
}

/// Goal: a drive that counts otherwise than the settings say is a fault that shows object and both numbers, wherever it is
/// shown, and nothing is energised.
#[test]
fn drive_that_counts_otherwise_is_a_fault_with_both_numbers() {
    let mut harness = CycleHarness::new();
    harness.script(|w| {
        w.forced[2] = Some(DriveState::Refused);
        (w.error_code, w.refused_object) = (0x0001_0012, 0x60_9101);
        w.refused_numbers = [50.5, 101.0];
    });
    harness.run_until(Phase::Fault, 20);
    let text = Names::of(&harness.settings).fault(&harness.cause().unwrap());
    for words in
        ["joint 3 `elbow`", "0x6091", "50.5", "101", "2.000000 times", "overruled_objects = [0x6091]"]
    {
        assert!(text.contains(words), "no {words} in: {text}");
    }
    assert_eq!(harness.world.lock().unwrap().drive_target, Some(DriveTarget::Disabled));
}

/// Goal: an arm whose joints fall when commands stop says so at each enable and begins slowly each time.
#[test]
fn acknowledged_risk_is_named_by_each_enable_which_begins_slowly() {
    let mut settings = crate::harness::shipped_settings();
    settings.supervision.first_speed_percent = 20.0;
    settings.servos[1].limp_risk_acknowledged = true;
    let names = Names::of(&settings);
    let mut rig = CycleHarness::with(settings);
    for _ in 0..2 {
        rig.run_until(Phase::Disabled, 200);
        rig.run(60);
        let answer = rig.ask(Command::Enable);
        let said = answer.why.sentence(&names);
        assert!(answer.accepted && said.contains("shoulder_lift") && said.contains("KEEP CLEAR"), "{said}");
        assert!(said.len() <= 240, "cut off in the answer: {said}");
        rig.run_until(Phase::Holding, 60);
        assert!((rig.core.supervisor().speed() - 0.2).abs() < 1e-12);
        rig.accept(Command::Speed { percent: 100.0 });
        rig.accept(Command::Disable);
    }
}

/// Goal: what its sender has given up is not carried out, in any phase and whatever it is, unless it stops the arm.
#[test]
fn command_that_was_given_up_is_not_carried_out_unless_it_stops_the_arm() {
    const GIVEN_UP: Nanos = Nanos(0);
    let refused = [
        Command::Enable,
        Command::Disable,
        Command::Resume,
        Command::TorqueOff,
        Command::Speed { percent: 50.0 },
        Command::ClearFault,
        Command::Reference { joint: 0, at_rad: 0.0 },
    ];
    for stop in [Command::Pause, Command::Stop, Command::FastStop] {
        let mut harness = CycleHarness::new();
        harness.run_until(Phase::Disabled, 60);
        assert!(matches!(harness.ask_until(Command::Enable, GIVEN_UP).why, AnswerReason::TooLate { .. }));
        harness.move_it();
        harness.run(300);
        assert!(harness.ask_until(stop, GIVEN_UP).accepted, "{stop:?}");
        let rest = [(Command::Pause, Phase::Paused), (Command::Stop, Phase::Holding)];
        let rest = rest.into_iter().find(|(command, _)| *command == stop).map_or(Phase::Fault, |(_, at)| at);
        harness.run_until(rest, 1_500);
        for command in refused {
            let answer = harness.ask_until(command, GIVEN_UP);
            assert!(matches!(answer.why, AnswerReason::TooLate { .. }), "{command:?}: {answer:?}");
            assert!(!answer.accepted);
            harness.run(20);
            assert_eq!(harness.phase(), rest, "{command:?}");
        }
    }
}
