//! Bring-up of drives: what is asked, what is refused, and what an energised drive keeps.
use super::{Bench, ENABLED, FOLLOWS, QUICK_STOP, SWITCH_ON_DISABLED, frame, hex, settings};
use taustream_arm::{Cia402, Overruled, Reaction, ScaleObject};
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

/// Every frame that node 1 is sent from the first look to NMT start, written out from CiA 301 and CiA 402-2: each object is
/// read, written because this drive does not have it yet, and read back where nothing else will show it.
const BRING_UP_OF_NODE_1: &str = "
601 40 41 60 00 00 00 00 00
000 82 01
601 40 00 10 00 00 00 00 00
601 40 18 10 01 00 00 00 00
601 40 02 65 00 00 00 00 00
601 40 41 60 00 00 00 00 00
601 40 8F 60 01 00 00 00 00
601 40 8F 60 02 00 00 00 00
601 40 91 60 01 00 00 00 00
601 40 91 60 02 00 00 00 00
601 40 92 60 01 00 00 00 00
601 40 92 60 02 00 00 00 00
601 40 93 60 01 00 00 00 00
601 40 93 60 02 00 00 00 00
601 40 7C 60 00 00 00 00 00
601 40 7E 60 00 00 00 00 00
601 40 7D 60 01 00 00 00 00
601 40 7D 60 02 00 00 00 00
601 40 7B 60 01 00 00 00 00
601 40 7B 60 02 00 00 00 00
601 40 17 10 00 00 00 00 00
601 2B 17 10 00 64 00 00 00
601 40 17 10 00 00 00 00 00
601 40 16 10 01 00 00 00 00
601 23 16 10 01 5E 01 7F 00
601 40 16 10 01 00 00 00 00
601 40 07 60 00 00 00 00 00
601 2B 07 60 00 03 00 00 00
601 40 07 60 00 00 00 00 00
601 40 C2 60 01 00 00 00 00
601 2F C2 60 01 01 00 00 00
601 40 C2 60 01 00 00 00 00
601 40 C2 60 02 00 00 00 00
601 2F C2 60 02 FD 00 00 00
601 40 C2 60 02 00 00 00 00
601 40 06 10 00 00 00 00 00
601 23 06 10 00 E8 03 00 00
601 40 06 10 00 00 00 00 00
601 40 5A 60 00 00 00 00 00
601 2B 5A 60 00 06 00 00 00
601 40 5A 60 00 00 00 00 00
601 40 00 14 01 00 00 00 00
601 40 00 14 02 00 00 00 00
601 40 00 16 00 00 00 00 00
601 40 00 16 01 00 00 00 00
601 40 00 16 02 00 00 00 00
601 23 00 14 01 01 02 00 80
601 2F 00 14 02 01 00 00 00
601 2F 00 16 00 00 00 00 00
601 23 00 16 01 10 00 40 60
601 23 00 16 02 20 00 7A 60
601 2F 00 16 00 02 00 00 00
601 23 00 14 01 01 02 00 00
601 40 00 18 01 00 00 00 00
601 40 00 18 02 00 00 00 00
601 40 00 1A 00 00 00 00 00
601 40 00 1A 01 00 00 00 00
601 40 00 1A 02 00 00 00 00
601 23 00 18 01 81 01 00 C0
601 2F 00 18 02 01 00 00 00
601 2F 00 1A 00 00 00 00 00
601 23 00 1A 01 10 00 41 60
601 23 00 1A 02 20 00 64 60
601 2F 00 1A 00 02 00 00 00
601 23 00 18 01 81 01 00 40
601 40 01 14 01 00 00 00 00
601 23 01 14 01 01 03 00 80
601 40 01 18 01 00 00 00 00
601 23 01 18 01 81 02 00 C0
601 40 02 14 01 00 00 00 00
601 23 02 14 01 01 04 00 80
601 40 02 18 01 00 00 00 00
601 23 02 18 01 81 03 00 C0
601 40 03 14 01 00 00 00 00
601 23 03 14 01 01 05 00 80
601 40 03 18 01 00 00 00 00
601 23 03 18 01 81 04 00 C0
601 40 60 60 00 00 00 00 00
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

/// What each declared reaction writes: option 6 of 0x605A stays energised after a quick stop, 2 switches off; option 3
/// of 0x6007 is quick stop, 2 torque off.
#[test]
fn bring_up_configures_the_declared_reaction() {
    let mut settings = settings(3);
    settings.servos[1].reaction = Reaction::Ramp;
    settings.servos[2].reaction = Reaction::Limp;
    let mut bench = Bench::with(settings);
    bench.until(DriveState::Disabled, 2_000);
    let written = |object: &str| -> Vec<String> {
        let lines = bench.drives.iter().flat_map(|drive| drive.seen.iter().map(hex));
        lines.filter(|line| line.contains(object)).collect()
    };
    assert_eq!(
        written(" 2B 5A 60 "),
        ["601 2B 5A 60 00 06 00 00 00", "602 2B 5A 60 00 02 00 00 00", "603 2B 5A 60 00 02 00 00 00"]
    );
    assert_eq!(
        written(" 2B 07 60 "),
        ["601 2B 07 60 00 03 00 00 00", "602 2B 07 60 00 03 00 00 00", "603 2B 07 60 00 02 00 00 00"]
    );
}

/// A joint that must hold is refused on a drive that cannot hold; one that may fall is accepted.
#[test]
fn bring_up_of_a_drive_without_quick_stop_option_is_refused_where_it_must_hold() {
    let mut settings = settings(2);
    settings.servos[1].reaction = Reaction::Ramp;
    let mut bench = Bench::with(settings);
    for drive in &mut bench.drives {
        drive.refused.insert((0x605A, 0), 0x0602_0000);
    }
    for _ in 0..2_000 {
        bench.step();
    }
    assert_eq!(bench.states(), [DriveState::Refused, DriveState::Disabled]);
    assert_eq!(bench.driver.status(0).refused_object, 0x60_5A00);
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
    for object in [(0x1401, 1), (0x1802, 1), (0x1803, 1), (0x1006, 0)] {
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
        let words = explain_refusal(&status.refusal());
        assert!(words.starts_with(&format!("object 0x{:04X}:{:02}: ", object.0, object.1)), "{words}");
        assert!(words.contains("no SDO answer in time"), "{words}");
    }
}

/// Goal: a node that answers under another's id is as good as absent, and the other comes up as what it is: with its own
/// position, its own state, and nothing energised that did not answer for itself.
#[test]
fn bring_up_of_a_node_that_answers_for_another_leaves_it_absent_and_the_other_whole() {
    let mut bench = Bench::new(3);
    let other = bench.drives[0].id;
    bench.drives[1].answers_as = Some(other);
    bench.steps(4_000);
    assert_eq!(bench.states(), [DriveState::Disabled, DriveState::Absent, DriveState::Disabled]);
    let words = bench.driver.explain(bench.status(1).error_code);
    assert!(words.contains("does not answer"), "{words}");
    let at = |bench: &Bench, joint: usize| bench.last_received[joint].map(|(_, counts)| counts);
    assert_eq!(at(&bench, 0), Some(bench.drives[0].position), "the position is another node's");
    assert!(
        bench.drives[1].seen.iter().all(|f| f.id().raw() != 0),
        "a node that never answered was reset or started"
    );
    bench.drive_target = DriveTarget::Enabled;
    bench.steps(500);
    assert_eq!(bench.status(1).state, DriveState::Absent);
    assert_eq!(bench.drives[1].status, SWITCH_ON_DISABLED);
}

/// Goal: after a bus was lost nothing is taken for granted: until each drive was looked at again, only questions leave, and
/// one that is found energised is left as it is.
#[test]
fn starting_over_asks_before_it_changes_anything() {
    let mut bench = Bench::new(2);
    bench.until(DriveState::Disabled, 2_000);
    for (joint, command) in bench.commands.iter_mut().enumerate().take(2) {
        command.position_rad = bench.driver.status(joint).position_rad;
    }
    bench.drive_target = DriveTarget::Enabled;
    bench.until(DriveState::Enabled, 500);
    // While the bus was away one drive was switched off by its own watchdog; the other holds.
    bench.drives[1].status = SWITCH_ON_DISABLED;
    bench.drives.iter_mut().for_each(|drive| drive.responds = false);
    bench.drive_target = DriveTarget::Disabled;
    bench.driver.start_over();
    assert_eq!(bench.states(), [DriveState::Absent, DriveState::Absent]);
    assert!(
        bench.status(0).position_rad.is_nan() && bench.status(0).received.is_none(),
        "old feedback counts"
    );
    for _ in 0..90 {
        bench.step();
        let is_question =
            |f: &taustream_drivers::CanFrame| f.id().raw() == 0x77F || f.data().first() == Some(&0x40);
        assert!(bench.sent.iter().all(is_question), "in cycle {}: {:?}", bench.ms, bench.sent);
    }
    bench.drives[1].responds = true;
    bench.steps(2_000);
    assert_eq!(bench.states(), [DriveState::EnergisedUnowned, DriveState::Disabled]);
    assert_eq!(bench.drives[0].status & 0x6F, 0x27, "the drive that holds was touched");
}

/// Goal: a drive slower than one request's time-out, but not than all its tries, comes up with the right mapping.
///
/// Answers to repeated requests then arrive while another object is being asked for, and must not count for it.
#[test]
fn bring_up_of_a_drive_that_answers_after_the_repetition_takes_time_but_succeeds() {
    let mut bench = Bench::new(1);
    bench.drives[0].answer_ms = 700;
    bench.until(DriveState::Disabled, 200_000);
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
fn observing_finds_an_energised_drive_and_leaves_it_untouched() {
    for status in [ENABLED, ENABLED | FOLLOWS, QUICK_STOP, 0x021F] {
        let mut bench = Bench::new(2);
        (bench.drives[0].status, bench.drives[0].nmt) = (status, 0x05);
        bench.steps(3_000);
        assert_eq!(bench.status(0).state, DriveState::EnergisedUnowned, "statusword {status:#06x}");
        assert_eq!(bench.status(1).state, DriveState::Disabled);
        let only_read = |bench: &Bench| bench.drives[0].seen.iter().all(|f| hex(f).starts_with("601 40 "));
        assert!(bench.drives[0].seen.len() > 10, "it is watched");
        assert!(only_read(&bench), "only read");
        let words = explain_refusal(&bench.status(0).refusal());
        assert!(words.starts_with("object 0x") && words.contains("torque-off"), "{words}");

        // The target that the others follow does not reach it.
        bench.hold();
        bench.drive_target = DriveTarget::Enabled;
        bench.steps(200);
        assert!(only_read(&bench), "only read");

        // The emergency does, at once and by SDO, because its process data is unknown.
        bench.drive_target = DriveTarget::TorqueOff;
        bench.step();
        assert!(
            bench.sent.iter().any(|f| hex(f) == "601 2B 40 60 00 00 00 00 00"),
            "statusword {status:#06x}"
        );
    }
}

#[test]
fn observing_delays_the_reset_while_another_master_sends_sync() {
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
fn observing_starts_a_node_in_nmt_stopped_without_a_reset() {
    let mut bench = Bench::new(1);
    bench.drives[0].nmt = 0x04;
    bench.steps(50);
    bench.decode(&frame(0x701, &[0x04]));
    bench.step();
    assert!(bench.sent.iter().any(|f| hex(f) == "000 80 01"));
    bench.until(DriveState::Disabled, 3_000);
}

/// Goal: a drive whose objects say another scale, direction or range than the settings is never energised, and says so by
/// object and both numbers; drives without such objects, and those that agree, come up.
/// Method: the arm of these settings counts 131072 a motor revolution behind 101 revolutions.
#[test]
fn bring_up_of_a_drive_that_counts_otherwise_is_refused_by_object_and_numbers() {
    /// Objects of the drive, the object that is named, and its two numbers.
    type Case = (&'static [(u16, u8, u32)], &'static str, [f64; 2]);
    let cases: [Case; 8] = [
        (&[(0x608F, 1, 65_536), (0x608F, 2, 1)], "0x608F", [65_536.0, 131_072.0]),
        (&[(0x6091, 1, 202), (0x6091, 2, 4)], "0x6091", [50.5, 101.0]),
        (&[(0x6092, 1, 360_000), (0x6092, 2, 1)], "0x6092", [360_000.0, 13_238_272.0]),
        (&[(0x6091, 1, 101), (0x6091, 2, 0)], "0x6091", [f64::INFINITY, 101.0]),
        (&[(0x6093, 1, 4096), (0x6093, 2, 360)], "0x6093", [4096.0 / 360.0, 1.0]),
        (&[(0x607C, 0, 0xFFFF_FF00)], "0x607C", [-256.0, 0.0]),
        (&[(0x607E, 0, 0xC0)], "0x607E", [192.0, 0.0]),
        (&[(0x607D, 1, 0x8000_0000), (0x607D, 2, 1000)], "0x607D:02", [1000.0, f64::NAN]),
    ];
    for (objects, name, [stated, expected]) in cases {
        let mut bench = Bench::new(2);
        for (index, sub, value) in objects {
            let width = if *index == 0x607E { 1 } else { 4 };
            bench.drives[1].objects.insert((*index, *sub), (width, *value));
        }
        bench.steps(2_000);
        assert_eq!(bench.states(), [DriveState::Disabled, DriveState::Refused], "{name}");
        let status = bench.status(1);
        let [said, wanted] = status.refused_numbers;
        assert!(said.total_cmp(&stated).is_eq(), "{name}: {said}");
        assert!(expected.is_nan() || wanted.total_cmp(&expected).is_eq(), "{name}: {wanted}");
        let words = explain_refusal(&status.refusal());
        assert!(words.contains(name) && words.contains("overruled_objects = ["), "{words}");
        bench.drive_target = DriveTarget::Enabled;
        bench.steps(500);
        assert!(bench.drives[1].control & 0x08 == 0, "{name}: the refused drive was commanded to enable");
    }
}

/// An object that is overruled is not even read.
#[test]
fn bring_up_with_an_overruled_object_takes_the_drive() {
    let mut settings = settings(1);
    let cia402 = *settings.servos[0].protocol.get::<Cia402>().unwrap();
    let overruled = Overruled::NONE.with(ScaleObject::GearRatio);
    settings.servos[0].protocol = Cia402 { overruled, ..cia402 }.into();
    let mut bench = Bench::with(settings);
    bench.drives[0].objects.insert((0x6091, 1), (4, 1));
    bench.drives[0].objects.insert((0x6091, 2), (4, 1));
    bench.until(DriveState::Disabled, 2_000);
    assert!(bench.drives[0].seen.iter().all(|frame| !hex(frame).contains("91 60")));
}
