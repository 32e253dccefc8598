//! The CiA 402 master against scripted drives and against frames written out by hand.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
mod cia402_suite;

use cia402_suite::{
    Bench, CountingAllocator, ENABLED, FAULT, FOLLOWS, QUICK_STOP, READY, SWITCH_ON_DISABLED, SWITCHED_ON,
    frame, hex, settings,
};
use taustream_drivers::bring_up::explain_refusal;
use taustream_drivers::codec::cia402::{Cia402Driver, Cia402Error, counts_from_rad};
use taustream_drivers::{DriveState, DriveWish, ServoDriver};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Every frame that node 1 is sent from the first look to NMT start, written out from can-protocols 1.2 to 1.5.
const BRING_UP_OF_NODE_1: &str = "
601 40 41 60 00 00 00 00 00
000 82 01
601 40 00 10 00 00 00 00 00
601 40 18 10 01 00 00 00 00
601 40 02 65 00 00 00 00 00
601 40 41 60 00 00 00 00 00
601 2B 17 10 00 64 00 00 00
601 23 16 10 01 5E 01 7F 00
601 2B 07 60 00 03 00 00 00
601 2F C2 60 01 01 00 00 00
601 2F C2 60 02 FD 00 00 00
601 23 06 10 00 E8 03 00 00
601 2B 5A 60 00 06 00 00 00
601 23 00 14 01 01 02 00 80
601 2F 00 14 02 01 00 00 00
601 2F 00 16 00 00 00 00 00
601 23 00 16 01 10 00 40 60
601 23 00 16 02 20 00 7A 60
601 2F 00 16 00 02 00 00 00
601 23 00 14 01 01 02 00 00
601 23 00 18 01 81 01 00 C0
601 2F 00 18 02 01 00 00 00
601 2F 00 1A 00 00 00 00 00
601 23 00 1A 01 10 00 41 60
601 23 00 1A 02 20 00 64 60
601 2F 00 1A 00 02 00 00 00
601 23 00 18 01 81 01 00 40
601 23 01 14 01 01 03 00 80
601 23 01 18 01 81 02 00 C0
601 23 02 14 01 01 04 00 80
601 23 02 18 01 81 03 00 C0
601 23 03 14 01 01 05 00 80
601 23 03 18 01 81 04 00 C0
601 2F 60 60 00 08 00 00 00
601 40 61 60 00 00 00 00 00
601 40 64 60 00 00 00 00 00
000 01 01
";

#[test]
fn bring_up_of_one_node_sends_the_golden_frames() {
    let mut bench = Bench::new(1);
    bench.until(DriveState::Disabled, 2_000);
    let mut seen: Vec<String> =
        bench.drives[0].seen.iter().filter(|f| f.id().raw() != 0x201).map(hex).collect();
    // The statusword is looked at again for as long as the bus is listened to.
    let looks = seen.iter().take_while(|line| line.contains(" 40 41 60 ")).count();
    seen.drain(1..looks);
    let golden: Vec<&str> = BRING_UP_OF_NODE_1.trim().lines().collect();
    assert_eq!(seen, golden);
}

/// Option code 6 of 0x605A stays energised after a quick stop, 2 switches off: that is only for joints that may go limp.
#[test]
fn bring_up_of_a_joint_that_may_go_limp_lets_a_quick_stop_end_without_torque() {
    let mut safe = settings(2);
    safe.servos[1].limp_is_safe = true;
    let mut bench = Bench::with(safe);
    bench.until(DriveState::Disabled, 2_000);
    let quick_stops: Vec<String> = (bench.drives.iter())
        .flat_map(|drive| drive.seen.iter().map(hex).filter(|line| line.contains(" 2B 5A 60 ")))
        .collect();
    assert_eq!(quick_stops, ["601 2B 5A 60 00 06 00 00 00", "602 2B 5A 60 00 02 00 00 00"]);
}

#[test]
fn bring_up_of_six_nodes_keeps_one_sdo_frame_a_node_and_cycle() {
    let mut bench = Bench::new(6);
    let mut most = 0;
    for _ in 0..2_000 {
        bench.step();
        for node in 1..=6_u32 {
            let count = bench.sent.iter().filter(|f| f.id().raw() == 0x600 + node).count();
            most = most.max(count);
            assert!(count <= 1, "node {node} got {count} SDO frames in one cycle");
        }
    }
    assert_eq!(most, 1, "no SDO frame was seen at all");
    assert_eq!(bench.states(), [DriveState::Disabled; 6]);
}

#[test]
fn bring_up_takes_segmented_answers_and_missing_optional_objects() {
    let mut bench = Bench::new(1);
    bench.drives[0].segments = true;
    for object in [(0x1401, 1), (0x1802, 1), (0x1803, 1), (0x1006, 0), (0x605A, 0)] {
        bench.drives[0].refused.insert(object, 0x0602_0000);
    }
    bench.until(DriveState::Disabled, 2_000);
    assert!(bench.drives[0].seen.iter().any(|f| hex(f) == "601 60 00 00 00 00 00 00 00"));
}

#[test]
fn bring_up_of_a_refused_mandatory_object_reports_code_and_object() {
    for (object, code) in [((0x60C2, 1), 0x0609_0030), ((0x1400, 2), 0x0602_0000), ((0x6060, 0), 0x0800_0022)]
    {
        let mut bench = Bench::new(2);
        bench.drives[1].refused.insert(object, code);
        bench.steps(2_000);
        let status = bench.status(1);
        assert_eq!(status.state, DriveState::Refused);
        assert_eq!(status.error_code, code);
        assert_eq!(status.refused_object, u32::from(object.0) << 8 | u32::from(object.1));
        assert_eq!(bench.status(0).state, DriveState::Disabled, "the other drive comes up all the same");
        let words = bench.driver.explain(code);
        assert!(words.contains("SDO abort") && !words.contains("does not list"), "{words}");

        // Once the cause is gone, clearing tries again from the start.
        bench.drives[1].refused.clear();
        bench.driver.clear_faults();
        bench.until(DriveState::Disabled, 2_000);
    }
}

#[test]
fn bring_up_of_a_wrong_device_is_refused_with_the_reason() {
    let cases = [
        ((0x1000, 0), (4, 0x000F_0191), "CiA 402"),
        ((0x6502, 0), (4, 0x0000_0061), "cyclic synchronous position"),
        ((0x1000, 0), (2, 0x0192), "width"),
    ];
    for (object, value, word) in cases {
        let mut bench = Bench::new(1);
        bench.drives[0].objects.insert(object, value);
        bench.until(DriveState::Refused, 2_000);
        let words = bench.driver.explain(bench.status(0).error_code);
        assert!(words.contains(word), "{words}");
        assert!(bench.sent.iter().all(|f| f.id().raw() != 0x201), "no setpoint to a refused device");
    }
}

/// Goal: an answer that names another object is no answer, be it a value or a confirmation.
#[test]
fn bring_up_of_a_drive_that_answers_for_another_object_is_refused_naming_the_asked_one() {
    for object in [(0x6502, 0), (0x60C2, 1), (0x1600, 2)] {
        let mut bench = Bench::new(1);
        bench.drives[0].misnamed = Some(object);
        bench.until(DriveState::Refused, 4_000);
        let status = bench.status(0);
        let packed = u32::from(object.0) << 8 | u32::from(object.1);
        assert_eq!((status.error_code, status.refused_object), (0x0504_0000, packed));
        let words = explain_refusal(status.error_code, status.refused_object);
        assert!(words.starts_with(&format!("object 0x{:04X}:{:02}: ", object.0, object.1)), "{words}");
        assert!(words.contains("no SDO answer in time"), "{words}");
    }
}

/// Goal: a drive slower than one request's time-out, but not than all its tries, comes up with the right mapping.
///
/// Answers to repeated requests then arrive while another object is being asked for, and must not count for it.
#[test]
fn bring_up_of_a_drive_that_answers_after_the_repetition_takes_time_but_succeeds() {
    let mut bench = Bench::new(1);
    bench.drives[0].answer_ms = 700;
    bench.until(DriveState::Disabled, 60_000);
    assert!(bench.ms > 20_000, "the answers were not late: {} ms", bench.ms);
    for write in ["601 2F 00 16 00 02", "601 2F 00 1A 00 02", "601 2F 60 60 00 08"] {
        let count = bench.drives[0].seen.iter().filter(|sent| hex(sent).starts_with(write)).count();
        assert_eq!(count, 2, "{write}: asked, and once more when no answer had come");
    }
}

#[test]
fn bring_up_with_one_absent_node_brings_the_others_up_and_takes_it_when_it_comes() {
    let mut bench = Bench::new(6);
    bench.drives[3].silent = true;
    bench.steps(4_000);
    for joint in 0..6 {
        let state = bench.status(joint).state;
        assert_eq!(state, if joint == 3 { DriveState::Absent } else { DriveState::Disabled });
    }
    assert!(bench.driver.explain(bench.status(3).error_code).contains("does not answer"));
    bench.drives[3].silent = false;
    bench.until(DriveState::Disabled, 4_000);
}

#[test]
fn bring_up_of_a_node_that_never_answers_sends_three_requests_in_a_round_and_no_reset() {
    let mut bench = Bench::new(1);
    bench.drives[0].silent = true;
    let mut requests = Vec::new();
    for _ in 0..1_400 {
        bench.step();
        for sent in &bench.sent {
            assert_ne!(sent.id().raw(), 0x000, "NMT to a drive that nobody has looked at");
            if sent.id().raw() == 0x601 {
                requests.push((bench.ms, hex(sent)));
            }
        }
    }
    assert_eq!(requests.len(), 3, "{requests:?}");
    assert!(requests.windows(2).all(|pair| pair[1].0 - pair[0].0 == 500), "{requests:?}");
}

#[test]
fn listen_finds_an_energised_drive_and_leaves_it_untouched() {
    for status in [ENABLED, ENABLED | FOLLOWS, QUICK_STOP, 0x021F] {
        let mut bench = Bench::new(2);
        (bench.drives[0].status, bench.drives[0].nmt) = (status, 0x05);
        bench.steps(3_000);
        assert_eq!(bench.status(0).state, DriveState::EnergisedUnowned, "statusword {status:#06x}");
        assert_eq!(bench.status(1).state, DriveState::Disabled);
        let allowed = "601 40 41 60 00 00 00 00 00";
        assert!(bench.drives[0].seen.len() > 10, "it is watched");
        assert!(bench.drives[0].seen.iter().all(|f| hex(f) == allowed), "only read");

        // The same wish that the others follow does not reach it.
        bench.hold();
        bench.wish = DriveWish::Enabled;
        bench.steps(200);
        assert!(bench.drives[0].seen.iter().all(|f| hex(f) == allowed), "only read");

        // The emergency does, at once and by SDO, because nobody knows its process data.
        bench.wish = DriveWish::TorqueOff;
        bench.step();
        assert!(
            bench.sent.iter().any(|f| hex(f) == "601 2B 40 60 00 00 00 00 00"),
            "statusword {status:#06x}"
        );
    }
}

#[test]
fn listen_holds_back_the_reset_while_another_master_sends_sync() {
    let mut bench = Bench::new(1);
    for _ in 0..1_000 {
        bench.decode(&frame(0x080, &[]));
        bench.step();
        assert!(bench.sent.iter().all(|f| f.id().raw() != 0x000), "NMT on a bus with another master");
    }
    assert!(bench.driver.explain(bench.status(0).error_code).contains("another master"));
    bench.until(DriveState::Disabled, 2_000);
}

#[test]
fn listen_wakes_a_node_in_nmt_stopped_without_a_reset() {
    let mut bench = Bench::new(1);
    bench.drives[0].nmt = 0x04;
    bench.steps(50);
    bench.decode(&frame(0x701, &[0x04]));
    bench.step();
    assert!(bench.sent.iter().any(|f| hex(f) == "000 80 01"));
    bench.until(DriveState::Disabled, 3_000);
}

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
    bench.wish = DriveWish::Enabled;
    let mut words = Vec::new();
    for _ in 0..20 {
        bench.step();
        assert_ne!(bench.status(0).state, DriveState::Disabled, "the wish shows at once");
        words.push(bench.rpdo(0).unwrap().0);
    }
    words.dedup();
    assert_eq!(words, [0x0006, 0x0007, 0x000F]);
    assert_eq!(bench.status(0).state, DriveState::Enabled);
}

#[test]
fn enabling_is_not_reported_before_the_drive_follows() {
    let mut bench = Bench::enabled(1);
    bench.drives[0].obeys = false;
    bench.wish = DriveWish::Disabled;
    bench.drives[0].status = SWITCH_ON_DISABLED;
    bench.steps(10);
    bench.wish = DriveWish::Enabled;
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
    bench.wish = DriveWish::Enabled;
    for _ in 0..100 {
        bench.step();
        assert_ne!(bench.rpdo(0).unwrap().0, 0x000F);
    }
    assert_eq!(bench.status(0).state, DriveState::Fault);
    assert!(bench.driver.explain(bench.status(0).error_code).contains("too far"));

    bench.wish = DriveWish::Disabled;
    bench.driver.clear_faults();
    bench.steps(5);
    bench.hold();
    bench.wish = DriveWish::Enabled;
    bench.step();
    bench.until(DriveState::Enabled, 100);
}

#[test]
fn enabling_a_drive_that_does_not_confirm_times_out() {
    let mut bench = Bench::new(1);
    bench.until(DriveState::Disabled, 2_000);
    bench.hold();
    bench.drives[0].obeys = false;
    bench.wish = DriveWish::Enabled;
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
        .map(|joint| counts_from_rad(&bench.settings.servos[joint], bench.commands[joint].position_rad))
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
    bench.wish = DriveWish::Disabled;
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
        (drive.obeys, drive.status) = (false, status);
    }
    bench.steps(3);
    bench.wish = DriveWish::TorqueOff;
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
    bench.wish = DriveWish::TorqueOff;
    bench.step();
    assert!(bench.sent.iter().any(|f| hex(f) == "601 2B 40 60 00 00 00 00 00"));
    bench.until(DriveState::Disabled, 2_000);
    bench.wish = DriveWish::Disabled;
    bench.steps(10);
    assert_eq!(bench.status(0).state, DriveState::Disabled);
}

#[test]
fn drop_out_of_a_drive_shows_and_is_never_energised_again_by_the_standing_wish() {
    for status in [SWITCH_ON_DISABLED, READY, SWITCHED_ON, QUICK_STOP] {
        let mut bench = Bench::enabled(2);
        bench.drives[0].obeys = false;
        bench.drives[0].status = status;
        bench.steps(2);
        let expected = if status == QUICK_STOP { DriveState::Fault } else { DriveState::Disabled };
        assert_eq!(bench.status(0).state, expected, "statusword {status:#06x}");
        assert_ne!(bench.status(0).error_code, 0);
        for _ in 0..300 {
            bench.step();
            let control = bench.rpdo(0).unwrap().0;
            // A quick stop that holds a load is kept; everything else is let go.
            let allowed = if status == QUICK_STOP { 0x0002 } else { 0x0000 };
            assert_eq!(control, allowed, "statusword {status:#06x}");
        }
        assert_eq!(bench.status(1).state, DriveState::Enabled, "the other drive holds");
    }
}

#[test]
fn enabled_drive_that_does_not_follow_is_a_fault_but_stays_energised() {
    let mut bench = Bench::enabled(1);
    bench.drives[0].obeys = false;
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

    bench.wish = DriveWish::Disabled;
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
fn fault_found_at_first_listen_has_its_code_from_the_first_cycle_on() {
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
    let asked: Vec<usize> = (0..seen.len()).filter(|at| seen[*at].starts_with("601 40 3F 60")).collect();
    let reset = seen.iter().position(|line| line == "000 82 01").unwrap();
    assert!(asked.len() == 1 && asked[0] < reset, "asked at {asked:?}, reset at {reset}");
}

#[test]
fn fault_found_without_an_error_code_object_does_not_hold_up_bring_up() {
    let mut bench = Bench::new(1);
    bench.drives[0].status = FAULT;
    bench.drives[0].refused.insert((0x603F, 0), 0x0602_0000);
    bench.until(DriveState::Fault, 2_000);
}

#[test]
fn heartbeat_lost_is_a_fault_yet_the_drive_is_still_told_where_to_go() {
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
    let wanted = counts_from_rad(&bench.settings.servos[0], bench.commands[0].position_rad);
    assert_eq!(bench.rpdo(0), Some((0x000F, wanted)));

    // Disabled by wish: voltage off is sent, then the node is absent, and it is taken again when it returns.
    bench.wish = DriveWish::Disabled;
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
    bench.wish = DriveWish::Disabled;
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
