//! Drives in operation: setpoints, enabling, disabling, faults and restarts.
use super::{
    Bench, ENABLED, FAULT, FOLLOWS, QUICK_STOP, READY, SWITCH_ON_DISABLED, SWITCHED_ON, frame, hex, settings,
};
use taustream_drivers::codec::cia402::{Cia402Driver, Cia402Error, CountScale, counts_from_rad};
use taustream_drivers::{CanId, DriveState, DriveTarget, ServoDriver};

#[test]
fn cycle_starts_with_sync_then_setpoints_in_joint_order() {
    let mut bench = Bench::enabled(6);
    for _ in 0..500 {
        bench.step();
        let ids: Vec<u32> = bench.sent.iter().map(|f| f.id().raw()).collect();
        assert_eq!(ids[..7], [0x080, 0x201, 0x202, 0x203, 0x204, 0x205, 0x206]);
        assert!(ids[7..].iter().all(|id| *id == 0x77F), "{ids:03X?}");
    }
    let heartbeats: usize = (0..1_000)
        .map(|_| {
            bench.step();
            bench.sent.iter().filter(|f| hex(f) == "77F 05").count()
        })
        .sum();
    assert_eq!(heartbeats, 10, "the master's heartbeat comes every 100 ms");
}

#[test]
fn enabling_climbs_one_confirmed_rung_after_the_other() {
    let mut bench = Bench::new(1);
    bench.until(DriveState::Disabled, 2_000);
    assert_eq!(bench.rpdo(0), Some((0x0000, 1_000)), "at rest: voltage off, target where the drive stands");
    bench.hold();
    bench.drive_target = DriveTarget::Enabled;
    let mut words = Vec::new();
    for _ in 0..20 {
        bench.step();
        assert_ne!(bench.status(0).state, DriveState::Disabled, "the drive target takes effect at once");
        words.push(bench.rpdo(0).unwrap().0);
    }
    words.dedup();
    assert_eq!(words, [0x0006, 0x0007, 0x000F]);
    assert_eq!(bench.status(0).state, DriveState::Enabled);
}

#[test]
fn enabling_is_not_reported_before_the_drive_follows() {
    let mut bench = Bench::enabled(1);
    bench.drives[0].responds = false;
    bench.drive_target = DriveTarget::Disabled;
    bench.drives[0].status = SWITCH_ON_DISABLED;
    bench.steps(10);
    bench.drive_target = DriveTarget::Enabled;
    for status in [READY, SWITCHED_ON, ENABLED] {
        bench.drives[0].status = status;
        bench.steps(10);
        assert_eq!(bench.status(0).state, DriveState::Enabling, "statusword {status:#06x}");
    }
    bench.drives[0].status = ENABLED | FOLLOWS;
    bench.steps(3);
    assert_eq!(bench.status(0).state, DriveState::Enabled);
}

#[test]
fn enabling_far_from_the_command_is_refused_until_cleared() {
    let mut bench = Bench::new(1);
    bench.until(DriveState::Disabled, 2_000);
    bench.hold();
    bench.commands[0].position_rad += 0.06;
    bench.drive_target = DriveTarget::Enabled;
    for _ in 0..100 {
        bench.step();
        assert_ne!(bench.rpdo(0).unwrap().0, 0x000F);
    }
    assert_eq!(bench.status(0).state, DriveState::Fault);
    assert!(bench.driver.explain(bench.status(0).error_code).contains("too far"));

    bench.drive_target = DriveTarget::Disabled;
    bench.driver.clear_faults();
    bench.steps(5);
    bench.hold();
    bench.drive_target = DriveTarget::Enabled;
    bench.step();
    bench.until(DriveState::Enabled, 100);
}

#[test]
fn enabling_a_drive_that_does_not_confirm_times_out() {
    let mut bench = Bench::new(1);
    bench.until(DriveState::Disabled, 2_000);
    bench.hold();
    bench.drives[0].responds = false;
    bench.drive_target = DriveTarget::Enabled;
    bench.steps(4_000);
    assert_eq!(bench.status(0).state, DriveState::Enabling);
    bench.steps(1_500);
    assert_eq!(bench.status(0).state, DriveState::Fault);
    assert_eq!(bench.rpdo(0).unwrap().0, 0x0000);
}

#[test]
fn enabled_drives_get_the_encoded_commands_and_keep_the_last_when_one_is_no_number() {
    let mut bench = Bench::enabled(6);
    for (joint, command) in bench.commands.iter_mut().enumerate().take(6) {
        command.position_rad += 1e-4 * f64::from(u8::try_from(joint).unwrap() + 1);
    }
    bench.step();
    let expected: Vec<i32> = (0..6)
        .map(|joint| {
            counts_from_rad(
                &CountScale::of(&bench.settings.servos[joint]).unwrap(),
                bench.commands[joint].position_rad,
            )
        })
        .collect();
    for (joint, counts) in expected.iter().enumerate() {
        assert_eq!(bench.rpdo(joint), Some((0x000F, *counts)), "joint {joint}");
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for command in &mut bench.commands {
            command.position_rad = bad;
        }
        bench.step();
        for (joint, counts) in expected.iter().enumerate() {
            assert_eq!(bench.rpdo(joint), Some((0x000F, *counts)), "joint {joint}, {bad}");
        }
    }
}

#[test]
fn disabling_steps_down_in_order() {
    let mut bench = Bench::enabled(1);
    bench.drive_target = DriveTarget::Disabled;
    let mut words = Vec::new();
    for _ in 0..20 {
        bench.step();
        words.push(bench.rpdo(0).unwrap().0);
    }
    words.dedup();
    assert_eq!(words, [0x0007, 0x0006, 0x0000]);
    assert_eq!(bench.status(0).state, DriveState::Disabled);
}

#[test]
fn torque_off_reaches_every_operational_drive_in_the_next_cycle_from_any_state() {
    let mut bench = Bench::enabled(6);
    let words = [SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED | FOLLOWS, QUICK_STOP, FAULT];
    for (drive, status) in bench.drives.iter_mut().zip(words) {
        (drive.responds, drive.status) = (false, status);
    }
    bench.steps(3);
    bench.drive_target = DriveTarget::TorqueOff;
    for cycle in 0..50 {
        bench.step();
        for joint in 0..6 {
            let (control, target) = bench.rpdo(joint).unwrap();
            assert_eq!(control, 0x0000, "cycle {cycle}, joint {joint}");
            assert_eq!(target, bench.drives[joint].position, "cycle {cycle}, joint {joint}");
        }
    }
}

#[test]
fn torque_off_during_configuration_interrupts_it_and_configuration_goes_on_after() {
    let mut bench = Bench::new(1);
    bench.steps(130);
    assert_eq!(bench.status(0).state, DriveState::Configuring);
    bench.drive_target = DriveTarget::TorqueOff;
    bench.step();
    assert!(bench.sent.iter().any(|f| hex(f) == "601 2B 40 60 00 00 00 00 00"));
    bench.until(DriveState::Disabled, 2_000);
    bench.drive_target = DriveTarget::Disabled;
    bench.steps(10);
    assert_eq!(bench.status(0).state, DriveState::Disabled);
}

#[test]
fn drop_out_of_a_drive_shows_and_is_never_energised_again_by_the_unchanged_target() {
    for status in [SWITCH_ON_DISABLED, READY, SWITCHED_ON, QUICK_STOP] {
        let mut bench = Bench::enabled(2);
        bench.drives[0].responds = false;
        bench.drives[0].status = status;
        bench.steps(2);
        let expected = if status == QUICK_STOP { DriveState::Fault } else { DriveState::Disabled };
        assert_eq!(bench.status(0).state, expected, "statusword {status:#06x}");
        assert_ne!(bench.status(0).error_code, 0);
        for _ in 0..300 {
            bench.step();
            let control = bench.rpdo(0).unwrap().0;
            // A quick stop that holds a load is kept; everything else is de-energised.
            let allowed = if status == QUICK_STOP { 0x0002 } else { 0x0000 };
            assert_eq!(control, allowed, "statusword {status:#06x}");
        }
        assert_eq!(bench.status(1).state, DriveState::Enabled, "the other drive holds");
    }
}

#[test]
fn enabled_drive_that_does_not_follow_is_a_fault_but_stays_energised() {
    let mut bench = Bench::enabled(1);
    bench.drives[0].responds = false;
    bench.drives[0].status = ENABLED;
    bench.steps(6);
    assert_eq!(bench.status(0).state, DriveState::Fault);
    assert_eq!(bench.rpdo(0).unwrap().0, 0x000F);
}

#[test]
fn fault_reports_its_emergency_code_and_is_reset_by_one_edge() {
    let mut bench = Bench::enabled(2);
    bench.drives[0].status = FAULT;
    bench.decode(&frame(0x081, &[0x11, 0x86, 0x21, 0, 0, 0, 0, 0]));
    bench.steps(3);
    let status = bench.status(0);
    assert_eq!((status.state, status.error_code), (DriveState::Fault, 0x8611));
    assert_eq!(bench.driver.explain(0x8611), "0x8611 following error too large");
    assert_eq!(bench.rpdo(0).unwrap().0, 0x0000);

    bench.drive_target = DriveTarget::Disabled;
    bench.steps(5);
    bench.driver.clear_faults();
    let mut words = Vec::new();
    for _ in 0..20 {
        bench.step();
        words.push(bench.rpdo(0).unwrap().0);
    }
    words.dedup();
    assert_eq!(words, [0x0000, 0x0080, 0x0000]);
    let status = bench.status(0);
    assert_eq!((status.state, status.error_code), (DriveState::Disabled, 0));
}

#[test]
fn fault_without_an_emergency_message_is_asked_for_its_code() {
    let mut bench = Bench::enabled(1);
    bench.drives[0].status = FAULT;
    bench.steps(6);
    assert_eq!(bench.status(0).error_code, 0x7305);
}

/// Whoever reports the fault does so in the first cycle of it: by then the code must have been read.
#[test]
fn fault_found_at_first_feedback_has_its_code_from_the_first_cycle_on() {
    let mut bench = Bench::new(2);
    bench.drives[0].status = FAULT;
    let mut cycles_in_fault = 0;
    for _ in 0..2_000 {
        bench.step();
        if bench.status(0).state == DriveState::Fault {
            cycles_in_fault += 1;
            assert_eq!(bench.status(0).error_code, 0x7305, "cycle {cycles_in_fault} of the fault");
        }
    }
    assert!(cycles_in_fault > 100, "seen in fault for {cycles_in_fault} cycles");
    assert_eq!(bench.status(1).state, DriveState::Disabled);
    let seen: Vec<String> = bench.drives[0].seen.iter().map(hex).collect();
    let requested: Vec<usize> = (0..seen.len()).filter(|at| seen[*at].starts_with("601 40 3F 60")).collect();
    let reset = seen.iter().position(|line| line == "000 82 01").unwrap();
    assert!(requested.len() == 1 && requested[0] < reset, "asked at {requested:?}, reset at {reset}");
}

#[test]
fn fault_found_without_an_error_code_object_does_not_hold_up_bring_up() {
    let mut bench = Bench::new(1);
    bench.drives[0].status = FAULT;
    bench.drives[0].refused.insert((0x603F, 0), 0x0602_0000);
    bench.until(DriveState::Fault, 2_000);
}

#[test]
fn heartbeat_lost_is_a_fault_yet_the_drive_is_still_commanded() {
    let mut bench = Bench::enabled(2);
    bench.drives[0].silent = true;
    bench.steps(300);
    assert_eq!(
        bench.status(0).state,
        DriveState::Enabled,
        "two or three missed heartbeats are none too many"
    );
    bench.steps(200);
    assert_eq!(bench.status(0).state, DriveState::Fault);
    assert!(bench.driver.explain(bench.status(0).error_code).contains("heartbeat"));
    bench.commands[0].position_rad += 1e-3;
    bench.step();
    let wanted =
        counts_from_rad(&CountScale::of(&bench.settings.servos[0]).unwrap(), bench.commands[0].position_rad);
    assert_eq!(bench.rpdo(0), Some((0x000F, wanted)));

    // Disabled on request: voltage off is sent, then the node is absent, and it is taken again when it returns.
    bench.drive_target = DriveTarget::Disabled;
    bench.steps(6_000);
    assert_eq!(bench.status(0).state, DriveState::Absent);
    bench.drives[0].silent = false;
    bench.drives[0].status = SWITCH_ON_DISABLED;
    bench.until(DriveState::Disabled, 4_000);
}

#[test]
fn stall_of_the_master_is_no_lost_heartbeat() {
    let mut bench = Bench::enabled(2);
    for _ in 0..5 {
        bench.now.0 += 2_000_000_000;
        bench.step();
        assert_eq!(bench.states(), [DriveState::Enabled; 2]);
        bench.steps(100);
    }
}

#[test]
fn restart_of_a_drive_in_use_is_a_fault_and_is_configured_again_only_when_disabled() {
    let mut bench = Bench::enabled(2);
    let mut out = Vec::new();
    bench.drives[0].boot(&mut out);
    bench.drives[0].status = SWITCH_ON_DISABLED;
    bench.decode(&out[0]);
    let seen = bench.drives[0].seen.len();
    bench.steps(1_000);
    assert_eq!(bench.status(0).state, DriveState::Fault);
    assert!(bench.driver.explain(bench.status(0).error_code).contains("restarted"));
    assert_eq!(bench.drives[0].seen.len(), seen, "nothing is sent to a drive whose mapping is gone");
    bench.drive_target = DriveTarget::Disabled;
    bench.until(DriveState::Disabled, 2_000);
}

#[test]
fn leaving_operational_while_in_use_is_a_fault() {
    let mut bench = Bench::enabled(1);
    bench.drives[0].nmt = 0x7F;
    bench.steps(250);
    assert_eq!(bench.status(0).state, DriveState::Fault);
    assert!(bench.driver.explain(bench.status(0).error_code).contains("NMT operational"));
}

#[test]
fn settings_that_canopen_cannot_carry_are_refused_with_the_reason() {
    let good = settings(2);
    assert!(Cia402Driver::new(&good, 0).is_ok());
    assert!(matches!(Cia402Driver::new(&good, 9), Err(Cia402Error::NoSuchBus { bus: 9, .. })));
    for node_id in [0, 127, 128, 255] {
        let mut bad = good.clone();
        bad.servos[1].node_id = node_id;
        let error = Cia402Driver::new(&bad, 0).unwrap_err();
        assert_eq!(error, Cia402Error::NodeId { joint: 1, node_id });
        assert!(error.to_string().contains("1 to 126"));
    }
    let mut twice = good.clone();
    twice.servos[1].node_id = twice.servos[0].node_id;
    assert!(matches!(Cia402Driver::new(&twice, 0), Err(Cia402Error::NodeTwice { joint: 1, other: 0, .. })));
    for period_us in [0, 1_001, 256] {
        let mut odd = good.clone();
        odd.cycle.period_us = period_us;
        assert_eq!(Cia402Driver::new(&odd, 0).unwrap_err(), Cia402Error::Period { period_us });
    }
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut odd = good.clone();
        odd.supervision.drive_timeout_s = value;
        assert!(Cia402Driver::new(&odd, 0).is_err(), "drive_timeout_s = {value}");
    }
}

/// Goal: in operation, whoever else sends what only a master sends to these drives is noticed by that frame; the arm's own
/// traffic, and frames of drives and devices that are not this arm's, are not.
#[test]
fn frames_of_another_master_are_noticed_in_operation_and_others_are_not() {
    let ours: [(u16, &[u8]); 6] = [
        (0x080, &[]),
        (0x080, &[7]),
        (0x201, &[0x0F, 0, 0xE8, 3, 0, 0]),
        (0x302, &[1, 0, 0, 0, 2, 0, 0, 0]),
        (0x000, &[0x81, 0]),
        (0x000, &[0x02, 1]),
    ];
    for (id, data) in ours {
        let mut bench = Bench::enabled(2);
        bench.steps(600);
        assert_eq!(bench.driver.other_master(), None, "own traffic");
        bench.decode(&frame(id, data));
        assert_eq!(bench.driver.other_master().map(CanId::raw), Some(u32::from(id)), "{id:#05x} {data:?}");
        bench.steps(400);
        assert!(bench.driver.other_master().is_some(), "{id:#05x}: forgotten at once");
        bench.steps(200);
        assert_eq!(bench.driver.other_master(), None, "{id:#05x}: it has stopped");
    }
    let others: [(u16, &[u8]); 7] = [
        (0x203, &[0x0F, 0, 0xE8, 3, 0, 0]),
        (0x000, &[0x81, 9]),
        (0x000, &[0x77, 0]),
        (0x182, &[0x37, 0x12, 0, 0, 0, 0]),
        (0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0]),
        (0x77F, &[5]),
        (0x123, &[1, 2, 3]),
    ];
    let mut bench = Bench::enabled(2);
    for (id, data) in others {
        bench.decode(&frame(id, data));
        assert_eq!(bench.driver.other_master(), None, "{id:#05x} {data:?}");
    }
}
