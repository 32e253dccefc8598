//! SDO, PDO, NMT, heartbeats and emergencies.
use super::bench::{Bench, NODE, START_RAD, counts, enabled, parameters};
use taustream_drivers::sim::{Disturbance, PowerState};

#[test]
fn device_name_is_read_in_segments() {
    let mut bench = Bench::new(parameters());
    let answer = bench.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(answer, [0x41, 0x08, 0x10, 0, 25, 0, 0, 0]);
    let mut name = Vec::new();
    for toggle in [0x00, 0x10, 0x00, 0x10] {
        let segment = bench.sdo([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(segment[0] & 0xF0, toggle);
        let unused = usize::from(segment[0] >> 1 & 7);
        name.extend_from_slice(&segment[1..8 - unused]);
        assert_eq!(segment[0] & 1 == 1, name.len() == 25);
    }
    assert_eq!(name, b"taustream simulated drive");
}

#[test]
fn identity_and_modes_are_those_of_a_csp_servo_drive() {
    let mut bench = Bench::new(parameters());
    assert_eq!(bench.read(0x1000, 0), 0x0002_0192);
    assert_eq!(
        bench.read(0x6502, 0),
        0xE5,
        "profile position and velocity, homing, interpolated and cyclic position"
    );
    assert_eq!(bench.read(0x1018, 4), i64::from(NODE));
    assert_eq!(bench.read(0x6041, 0) & 0x4F, 0x40, "switch on disabled");
    assert_eq!(bench.read(0x6064, 0) as u32 as i32, counts(START_RAD));
    bench.must_write(0x6060, 0, 1, 8);
    assert_eq!(bench.read(0x6061, 0), 8);
}

/// Goal: the abort codes of CiA 301 that a master may meet, each provoked.
#[test]
fn wrong_sdo_requests_are_refused_with_the_code_that_says_why() {
    let mut bench = Bench::new(parameters());
    for (request, code, why) in [
        ([0x40, 0x34, 0x12, 0, 0, 0, 0, 0], 0x0602_0000, "no such object"),
        ([0x40, 0x18, 0x10, 9, 0, 0, 0, 0], 0x0609_0011, "no such subindex"),
        ([0x40, 0x02, 0x20, 0, 0, 0, 0, 0], 0x0601_0001, "read of write-only"),
        ([0x23, 0x00, 0x10, 0, 1, 0, 0, 0], 0x0601_0002, "write of read-only"),
        ([0x23, 0x40, 0x60, 0, 6, 0, 0, 0], 0x0607_0012, "four bytes for two"),
        ([0x2F, 0x40, 0x60, 0, 6, 0, 0, 0], 0x0607_0013, "one byte for two"),
        ([0x21, 0x40, 0x60, 0, 9, 0, 0, 0], 0x0607_0012, "segmented, nine bytes"),
        ([0x21, 0x34, 0x12, 0, 4, 0, 0, 0], 0x0602_0000, "segmented, no such object"),
        ([0x2F, 0x60, 0x60, 0, 2, 0, 0, 0], 0x0609_0030, "velocity mode"),
        ([0x2B, 0x5E, 0x60, 0, 4, 0, 0, 0], 0x0609_0031, "fault reaction 4"),
        ([0x2B, 0x5E, 0x60, 0, 0xFF, 0xFF, 0, 0], 0x0609_0032, "fault reaction -1"),
        ([0x2F, 0x03, 0x10, 0, 1, 0, 0, 0], 0x0609_0030, "history count set to 1"),
        ([0x23, 0x10, 0x10, 1, b'l', b'o', b'v', b'e'], 0x0800_0020, "wrong signature for storing"),
        ([0x2F, 0x19, 0x10, 0, 1, 0, 0, 0], 0x0609_0030, "SYNC counter of 1"),
        ([0xA0, 0x00, 0x10, 0, 0, 0, 0, 0], 0x0504_0002, "block upload in blocks of none"),
        ([0xC0, 0x00, 0x10, 0, 4, 0, 0, 0], 0x0504_0001, "block download"),
        ([0xFF, 0x00, 0x10, 0, 0, 0, 0, 0], 0x0504_0001, "no command at all"),
        ([0x60, 0, 0, 0, 0, 0, 0, 0], 0x0504_0001, "segment without a transfer"),
        ([0x00, 0, 0, 0, 0, 0, 0, 0], 0x0504_0001, "written segment without a transfer"),
    ] {
        assert_eq!(bench.abort(request), code, "{why}: {request:02X?}");
    }
    // Both consumers on one node.
    bench.must_write(0x1016, 1, 4, 0x7F_0064);
    assert_eq!(bench.write(0x1016, 2, 4, 0x7F_0064), 0x0604_0043);
    // SYNC counter while a SYNC period is set.
    bench.must_write(0x1006, 0, 4, 1000);
    assert_eq!(bench.write(0x1019, 0, 1, 10), 0x0800_0022);
    // The codes that only a broken drive gives are given on request.
    for code in [0x060A_0023, 0x0800_0000, 0x0800_0021] {
        bench.drive.disturb(Disturbance::RefuseWrites(code), &mut Vec::new());
        assert_eq!(bench.write(0x1017, 0, 2, 100), code);
    }
    bench.drive.disturb(Disturbance::RefuseWrites(0), &mut Vec::new());
    bench.must_write(0x1017, 0, 2, 100);
}

#[test]
fn segmented_read_with_a_wrong_toggle_or_a_pause_is_given_up() {
    let mut bench = Bench::new(parameters());
    bench.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(bench.abort([0x70, 0, 0, 0, 0, 0, 0, 0]), 0x0503_0000);
    assert_eq!(bench.abort([0x60, 0, 0, 0, 0, 0, 0, 0]), 0x0504_0001, "given up");

    bench.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    bench.pass_ms(990);
    assert_eq!(bench.take(0x583).len(), 0);
    bench.pass_ms(20);
    assert_eq!(bench.take(0x583), [vec![0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05]]);
}

/// Goal: a client may write short values by segments, and is held to length, toggle, access and pace all the same.
#[test]
fn segmented_write_takes_a_short_value_and_refuses_what_does_not_fit() {
    let mut bench = Bench::new(parameters());
    let taken = [0x20, 0, 0, 0, 0, 0, 0, 0];
    for (size, begin) in [(4, 0x21), (0, 0x20)] {
        assert_eq!(bench.sdo([begin, 0x65, 0x60, 0, size, 0, 0, 0]), [0x60, 0x65, 0x60, 0, 0, 0, 0, 0]);
        assert_eq!(bench.sdo([0x07, 0x44, 0x33, 0x22, size, 0, 0, 0]), taken);
        assert_eq!(bench.read(0x6065, 0), i64::from(size) << 24 | 0x22_3344);
    }
    // Two segments of two bytes, the toggle alternating.
    bench.sdo([0x21, 0x65, 0x60, 0, 4, 0, 0, 0]);
    assert_eq!(bench.sdo([0x0A, 1, 2, 0, 0, 0, 0, 0]), taken);
    assert_eq!(bench.sdo([0x1B, 3, 4, 0, 0, 0, 0, 0]), [0x30, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.read(0x6065, 0), 0x0403_0201);
    for (begin, segment, code, why) in [
        ([0x21, 0x65, 0x60, 0, 4, 0, 0, 0], [0x17, 1, 2, 3, 4, 0, 0, 0], 0x0503_0000, "toggle"),
        ([0x21, 0x65, 0x60, 0, 4, 0, 0, 0], [0x0B, 1, 2, 0, 0, 0, 0, 0], 0x0607_0010, "less than announced"),
        ([0x20, 0x65, 0x60, 0, 0, 0, 0, 0], [0x05, 1, 2, 3, 4, 5, 0, 0], 0x0607_0012, "five bytes for four"),
        ([0x20, 0x65, 0x60, 0, 0, 0, 0, 0], [0x0B, 1, 2, 0, 0, 0, 0, 0], 0x0607_0013, "two bytes for four"),
        ([0x21, 0x41, 0x60, 0, 2, 0, 0, 0], [0x0B, 1, 2, 0, 0, 0, 0, 0], 0x0601_0002, "read-only"),
    ] {
        assert_eq!(bench.sdo(begin)[0], 0x60, "{why}");
        assert_eq!(bench.abort(segment), code, "{why}");
        assert_eq!(bench.abort(segment), 0x0504_0001, "{why}: given up");
    }
    assert_eq!(bench.read(0x6065, 0), 0x0403_0201, "a refused write left something behind");
    // One that is abandoned, for another transfer and for none.
    bench.sdo([0x21, 0x65, 0x60, 0, 4, 0, 0, 0]);
    bench.read(0x6041, 0);
    assert_eq!(bench.abort([0x07, 1, 2, 3, 4, 0, 0, 0]), 0x0504_0001);
    bench.sdo([0x21, 0x65, 0x60, 0, 4, 0, 0, 0]);
    bench.take(0x583);
    bench.pass_ms(1010);
    assert_eq!(bench.take(0x583), [vec![0x80, 0x65, 0x60, 0, 0, 0, 0x04, 0x05]]);
}

#[test]
fn pdo_is_remapped_only_while_it_does_not_exist_and_its_count_is_zero() {
    let mut bench = Bench::new(parameters());
    let node = i64::from(NODE);
    // As shipped, PDO1 exists.
    assert_eq!(bench.write(0x1600, 0, 1, 0), 0x0800_0022);
    assert_eq!(bench.write(0x1600, 1, 4, 0x607A_0020), 0x0800_0022);
    assert_eq!(bench.write(0x1400, 1, 4, 0x280 + node), 0x0800_0022, "moved while it exists");
    bench.must_write(0x1400, 1, 4, 0x8000_0200 + node);
    assert_eq!(bench.write(0x1600, 1, 4, 0x607A_0020), 0x0601_0000, "count is not 0");
    bench.must_write(0x1600, 0, 1, 0);
    for (entry, code, why) in [
        (0x6041_0010, 0x0604_0041, "statusword in an RPDO"),
        (0x6040_0020, 0x0604_0041, "wrong width"),
        (0x1017_0010, 0x0604_0041, "a parameter"),
        (0x1234_0010, 0x0602_0000, "no such object"),
        (0x6040_0110, 0x0609_0011, "no such subindex"),
    ] {
        assert_eq!(bench.write(0x1600, 1, 4, entry), code, "{why}");
    }
    // A gap of 32 bits, then 32 + 16: too much for a frame only with one more.
    bench.must_write(0x1600, 1, 4, 0x0007_0020);
    bench.must_write(0x1600, 2, 4, 0x607A_0020);
    bench.must_write(0x1600, 3, 4, 0x6040_0010);
    assert_eq!(bench.write(0x1600, 0, 1, 3), 0x0604_0042);
    assert_eq!(bench.write(0x1600, 0, 1, 9), 0x0609_0031);
    bench.must_write(0x1600, 0, 1, 2);
    assert_eq!(bench.write(0x1400, 2, 1, 252), 0x0609_0030, "RTR type");
    for id in [0x000, 0x080, 0x100, 0x583, 0x603, 0x703, 0x2000_0000 + 0x203] {
        assert_eq!(bench.write(0x1400, 1, 4, id), 0x0609_0030, "identifier {id:03X}");
    }
    bench.must_write(0x1400, 1, 4, 0x203);
    // Dummies have no place in a TPDO.
    bench.must_write(0x1800, 1, 4, 0x8000_0183);
    bench.must_write(0x1A00, 0, 1, 0);
    assert_eq!(bench.write(0x1A00, 1, 4, 0x0005_0008), 0x0604_0041);
}

#[test]
fn rpdo_with_a_gap_takes_only_its_own_part() {
    let mut bench = Bench::new(parameters());
    bench.configure();
    bench.must_write(0x1400, 1, 4, 0x8000_0203);
    bench.must_write(0x1600, 0, 1, 0);
    bench.must_write(0x1600, 1, 4, 0x0007_0020);
    bench.must_write(0x1600, 2, 4, 0x607A_0020);
    bench.must_write(0x1600, 0, 1, 2);
    bench.must_write(0x1400, 1, 4, 0x203);
    bench.send(0x203, &[1, 2, 3, 4, 0x44, 0x33, 0x22, 0x11]);
    assert_eq!(bench.read(0x607A, 0), 0, "acted before the SYNC");
    bench.send(0x080, &[]);
    assert_eq!(bench.read(0x607A, 0), 0x1122_3344);
    // Event-driven: at once.
    bench.must_write(0x1400, 2, 1, 255);
    bench.send(0x203, &[1, 2, 3, 4, 5, 0, 0, 0]);
    assert_eq!(bench.read(0x607A, 0), 5);
}

#[test]
fn short_rpdo_is_ignored_and_reported_once_a_long_one_taken() {
    let mut bench = Bench::new(parameters());
    bench.configure();
    for _ in 0..3 {
        bench.send(0x203, &[6, 0, 1, 2, 3]);
        bench.send(0x080, &[]);
    }
    assert_eq!(bench.take(0x083), [vec![0x10, 0x82, 0x11, 0, 0, 0, 0, 0]]);
    assert_eq!(bench.read(0x607A, 0), 0);
    bench.send(0x203, &[6, 0, 1, 0, 0, 0, 9, 9]);
    bench.send(0x080, &[]);
    assert_eq!(bench.read(0x607A, 0), 1);
}

#[test]
fn tpdo_of_type_n_answers_every_nth_sync_and_type_0_only_changes() {
    let mut bench = Bench::new(parameters());
    bench.configure();
    bench.must_write(0x1800, 2, 1, 3);
    bench.sent.clear();
    let mut answered = Vec::new();
    for sync in 1..=9 {
        bench.pass_ms(1);
        bench.send(0x080, &[]);
        answered.extend(bench.take(0x183).iter().map(|_| sync));
    }
    assert_eq!(answered, [3, 6, 9]);
    bench.must_write(0x1800, 2, 1, 0);
    let mut count = 0;
    for _ in 0..10 {
        bench.pass_ms(1);
        bench.send(0x080, &[]);
        count += bench.take(0x183).len();
    }
    assert_eq!(count, 1, "a braked joint does not change");
}

#[test]
fn sync_with_a_counter_starts_at_its_start_value_and_one_without_is_reported() {
    let mut bench = Bench::new(parameters());
    bench.must_write(0x1019, 0, 1, 10);
    bench.configure();
    bench.send(0x000, &[0x80, NODE]);
    bench.must_write(0x1800, 1, 4, 0x8000_0183);
    bench.must_write(0x1800, 6, 1, 4);
    bench.must_write(0x1800, 1, 4, 0x183);
    bench.send(0x000, &[0x01, NODE]);
    let mut answered = Vec::new();
    for counter in 1..=6 {
        bench.send(0x080, &[counter]);
        answered.extend(bench.take(0x183).iter().map(|_| counter));
    }
    assert_eq!(answered, [4, 5, 6]);
    bench.send(0x080, &[]);
    bench.send(0x080, &[]);
    let sent = std::mem::take(&mut bench.sent);
    assert_eq!(sent.len(), 1, "{sent:?}");
    assert_eq!(sent[0].data()[..2], [0x40, 0x82]);
}

#[test]
fn pdos_rest_outside_operational_and_sdo_rests_in_stopped() {
    let mut bench = Bench::new(parameters());
    bench.configure();
    bench.send(0x000, &[0x80, NODE]);
    bench.send(0x080, &[]);
    bench.send(0x203, &[6, 0, 1, 0, 0, 0]);
    assert!(bench.sent.is_empty());
    bench.send(0x000, &[0x02, 0]);
    bench.send(0x603, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    assert!(bench.sent.is_empty(), "answers while stopped");
    bench.send(0x000, &[0x01, NODE + 1]);
    bench.send(0x080, &[]);
    assert!(bench.sent.is_empty(), "follows a command for another node");
    bench.send(0x000, &[0x01, 0]);
    bench.send(0x080, &[]);
    assert_eq!(bench.take(0x183).len(), 1);
    assert_eq!(bench.read(0x607A, 0), 0, "an RPDO from before operational was applied");
}

#[test]
fn heartbeat_is_produced_in_its_period_with_the_state() {
    let mut bench = Bench::new(parameters());
    bench.must_write(0x1017, 0, 2, 10);
    bench.pass_ms(100);
    let beats = bench.take(0x703);
    assert!((9..=10).contains(&beats.len()), "{} heartbeats", beats.len());
    assert!(beats.iter().all(|beat| beat == &[0x7F]));
    bench.send(0x000, &[0x01, NODE]);
    bench.pass_ms(15);
    assert_eq!(bench.take(0x703).last(), Some(&vec![5]));
}

/// Goal: each reaction to a lost master (0x6007), and the communication state after it (0x1029).
#[test]
fn lost_master_heartbeat_is_reported_and_reacted_to_as_set() {
    for (option, end) in [
        (0, PowerState::OperationEnabled),
        (1, PowerState::Fault),
        (2, PowerState::SwitchOnDisabled),
        (3, PowerState::SwitchOnDisabled),
    ] {
        let mut bench = Bench::new(parameters());
        bench.must_write(0x1016, 1, 4, 0x7F_0032);
        bench.must_write(0x6007, 0, 2, option);
        bench.must_write(0x1029, 1, 1, 1);
        bench.configure();
        bench.enable();
        bench.send(0x77F, &[5]);
        let here = counts(START_RAD);
        for _ in 0..45 {
            bench.cycle(0x0F, here);
        }
        assert_eq!(bench.drive.power_state(), PowerState::OperationEnabled, "option {option}: too early");
        bench.sent.clear();
        for _ in 0..80 {
            bench.cycle(0x0F, here);
        }
        let emergencies = bench.take(0x083);
        assert_eq!(emergencies.len(), 1, "option {option}: {emergencies:02X?}");
        assert_eq!(emergencies[0][..3], [0x30, 0x81, 0x11]);
        // 0x000F means nothing in switch on disabled, so the state shows what the reaction did.
        assert_eq!(bench.drive.power_state(), end, "option {option}");
    }
}

#[test]
fn stop_and_reset_commands_take_an_energised_drive_out_of_operation() {
    for (command, end) in [
        (0x02, PowerState::Fault),
        (0x80, PowerState::Fault),
        (0x82, PowerState::Fault),
        (0x81, PowerState::SwitchOnDisabled),
    ] {
        let mut bench = enabled(parameters());
        bench.sent.clear();
        bench.send(0x000, &[command, NODE]);
        bench.pass_ms(100);
        assert_eq!(bench.drive.power_state(), end, "NMT {command:02X}");
        let boots = bench.take(0x703).len();
        assert_eq!(boots, usize::from(command > 0x80), "boot-ups after NMT {command:02X}");
    }
}

#[test]
fn reset_brings_back_what_was_stored_and_forgets_the_rest() {
    let mut bench = Bench::new(parameters());
    bench.must_write(0x1017, 0, 2, 500);
    bench.must_write(0x1010, 1, 4, 0x6576_6173);
    bench.must_write(0x1017, 0, 2, 700);
    bench.must_write(0x605A, 0, 2, 6);
    bench.send(0x000, &[0x82, NODE]);
    bench.pass_ms(30);
    assert_eq!(bench.read(0x1017, 0), 500);
    assert_eq!(bench.read(0x605A, 0), 6, "a communication reset leaves the drive's own parameters");
    bench.send(0x000, &[0x81, NODE]);
    bench.pass_ms(30);
    assert_eq!(bench.read(0x605A, 0), 2);
    bench.must_write(0x1011, 1, 4, 0x6461_6F6C);
    bench.send(0x000, &[0x81, 0]);
    bench.pass_ms(30);
    assert_eq!(bench.read(0x1017, 0), 0);
}

#[test]
fn error_history_holds_the_newest_first_and_is_cleared_by_zero() {
    let mut bench = Bench::new(parameters());
    bench.configure();
    for code in [0x2310, 0x4310] {
        bench.must_write(0x2002, 0, 2, code);
        bench.pass_ms(2);
        assert_eq!(bench.read(0x603F, 0), code);
        for word in [0x00, 0x80, 0x00] {
            bench.must_write(0x6040, 0, 2, word);
        }
    }
    assert_eq!(bench.read(0x1001, 0), 0);
    assert_eq!((bench.read(0x1003, 0), bench.read(0x1003, 1), bench.read(0x1003, 2)), (2, 0x4310, 0x2310));
    // An entry that has not been made is "no data"; one that could never be made is no subindex.
    assert_eq!(bench.abort([0x40, 0x03, 0x10, 3, 0, 0, 0, 0]), 0x0800_0024);
    assert_eq!(bench.abort([0x40, 0x03, 0x10, 9, 0, 0, 0, 0]), 0x0609_0011);
    bench.must_write(0x1003, 0, 1, 0);
    assert_eq!(bench.read(0x1003, 0), 0);
    assert_eq!(bench.abort([0x40, 0x03, 0x10, 1, 0, 0, 0, 0]), 0x0800_0024);
}

#[test]
fn rpdo_deadline_of_the_master_is_watched_too() {
    let mut parameters = parameters();
    parameters.watchdog_ms = 0;
    let mut bench = Bench::new(parameters);
    bench.must_write(0x1400, 5, 2, 20);
    bench.configure();
    bench.enable();
    bench.sent.clear();
    bench.pass_ms(18);
    assert_eq!(bench.drive.power_state(), PowerState::OperationEnabled);
    bench.pass_ms(100);
    assert_eq!(bench.take(0x083)[0][..2], [0x50, 0x82]);
    assert_eq!(bench.drive.power_state(), PowerState::Fault);
}
