//! Enabling and disabling drives, torque off, and the streamer's end.
use crate::rig::{HOME_RAD, Rig};
use crate::{assert_on_path, assert_within_stop_limits};
use taustream_drivers::{DriveState, DriveWish};
use taustream_messages::{Command, FaultReason, Phase};
use taustream_streamer::cycle::Next;
use taustream_streamer::intake::Leave;
use taustream_streamer::names::Names;
use taustream_streamer::words::Why;

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
    let text = Names::default().fault(&cause);
    assert!(text.contains("joint 3: object 0x1600:02: SDO abort 0x06040041"), "{text}");
    assert!(text.contains("cannot be mapped"), "{text}");
}

#[test]
fn drive_found_energised_is_reported_and_left_alone() {
    let mut rig = Rig::new();
    rig.script(|w| w.forced[2] = Some(DriveState::EnergisedUnowned));
    rig.run_until(Phase::Fault, 20);
    assert_eq!(rig.cause().unwrap().reason, FaultReason::EnergisedUnowned);
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
