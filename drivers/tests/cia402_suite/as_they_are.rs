//! Drives as they are sold: what is right already is left alone, what is missing is stated or refused, what is slow is waited for.
use super::{Bench, ENABLED, FAULT, FOLLOWS, READY, SWITCH_ON_DISABLED, SWITCHED_ON, hex, settings};
use taustream_arm::{AbsentObjects, Cia402, DriveFeatures, MasterSupervision, OptionalObject};
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

/// Codes with which drives refuse what they do not have: CiA 301's, and what else was met.
const REFUSALS: [u32; 8] =
    [0x0601_0000, 0x0601_0002, 0x0602_0000, 0x0604_0043, 0x0609_0011, 0x0609_0030, 0x0800_0000, 0x0800_0020];

/// What the master of these settings wants of node 1, by object: width and value.
const CONFIGURED: [(u16, u8, usize, u32); 25] = [
    (0x1017, 0, 2, 100),
    (0x1016, 1, 4, 0x007F_015E),
    (0x6007, 0, 2, 3),
    (0x60C2, 1, 1, 1),
    (0x60C2, 2, 1, 0xFD),
    (0x1006, 0, 4, 1000),
    (0x605A, 0, 2, 6),
    (0x1400, 1, 4, 0x201),
    (0x1400, 2, 1, 1),
    (0x1600, 0, 1, 2),
    (0x1600, 1, 4, 0x6040_0010),
    (0x1600, 2, 4, 0x607A_0020),
    // Without the bit that forbids remote requests, which some drives drop.
    (0x1800, 1, 4, 0x181),
    (0x1800, 2, 1, 1),
    (0x1A00, 0, 1, 2),
    (0x1A00, 1, 4, 0x6041_0010),
    (0x1A00, 2, 4, 0x6064_0020),
    (0x1401, 1, 4, 0x8000_0301),
    (0x1801, 1, 4, 0xC000_0281),
    (0x1402, 1, 4, 0x8000_0401),
    (0x1802, 1, 4, 0x8000_0381),
    (0x1403, 1, 4, 0x8000_0501),
    // One that is off need not have the identifier that this master would give it.
    (0x1803, 1, 4, 0x8000_0000),
    (0x6060, 0, 1, 8),
    (0x6061, 0, 1, 8),
];

fn with(features: DriveFeatures) -> Bench {
    let mut settings = settings(1);
    let cia402 = *settings.servos[0].protocol.get::<Cia402>().unwrap();
    settings.servos[0].protocol = Cia402 { features, ..cia402 }.into();
    Bench::with(settings)
}

fn configured(bench: &mut Bench) {
    for (index, sub, width, value) in CONFIGURED {
        bench.drives[0].objects.insert((index, sub), (width, value));
    }
}

/// Writes that node 1 was sent, as index and subindex.
fn written(bench: &Bench) -> Vec<(u16, u8)> {
    let writes = bench.drives[0]
        .seen
        .iter()
        .filter(|frame| frame.id().raw() == 0x601 && frame.data()[0] & 0xE0 == 0x20);
    writes.map(|frame| (u16::from_le_bytes([frame.data()[1], frame.data()[2]]), frame.data()[3])).collect()
}

fn refusal(bench: &Bench) -> String {
    explain_refusal(&bench.status(0).refusal())
}

/// Goal: a drive that holds everything already is not written at all, so one whose objects are all fixed comes up.
#[test]
fn configuration_that_is_there_already_is_left_alone() {
    for code in REFUSALS {
        let mut bench = Bench::new(1);
        configured(&mut bench);
        bench.drives[0].read_only = code;
        bench.until(DriveState::Disabled, 2_000);
        assert_eq!(written(&bench), [], "{code:08X}");
    }
}

/// Goal: unused PDOs that are fixed under their drive's own identifiers stay on and are named; under any other they are refused.
#[test]
fn unused_pdos_that_are_fixed_are_tolerated_where_they_do_no_harm() {
    let fixed = |identifiers: &[((u16, u8), u32)]| {
        let mut bench = Bench::new(1);
        configured(&mut bench);
        bench.drives[0].keeps = true;
        for (at, identifier) in identifiers {
            bench.drives[0].objects.insert(*at, (4, *identifier));
            bench.drives[0].fixed.push(*at);
        }
        bench
    };
    let mut bench = fixed(&[((0x1401, 1), 0x301), ((0x1801, 1), 0x4000_0281), ((0x1803, 1), 0x481)]);
    bench.until(DriveState::Disabled, 2_000);
    assert_eq!(bench.status(0).fixed_pdos.words(), "RPDO 2, TPDO 2 and TPDO 4");
    // The identifier of another drive, of a 29-bit frame, and of SYNC.
    for identifier in [0x302, 0x2000_0301, 0x080] {
        let mut bench = fixed(&[((0x1401, 1), identifier)]);
        bench.until(DriveState::Refused, 2_000);
        assert!(refusal(&bench).contains("0x1401:01"), "{}", refusal(&bench));
    }
    assert_eq!(Bench::new(1).status(0).fixed_pdos.words(), "");
}

/// Goal: one part of a PDO that differs is changed alone, with the PDO switched off before and on after.
#[test]
fn pdo_that_differs_in_one_part_is_switched_off_changed_there_and_switched_on() {
    /// The object that differs, what it holds, and what is written.
    type Case = ((u16, u8), u32, &'static [(u16, u8)]);
    let cases: [Case; 4] = [
        ((0x1400, 2), 255, &[(0x1400, 1), (0x1400, 2), (0x1400, 1)]),
        (
            (0x1600, 2),
            0x6081_0020,
            &[(0x1400, 1), (0x1600, 0), (0x1600, 1), (0x1600, 2), (0x1600, 0), (0x1400, 1)],
        ),
        ((0x1800, 1), 0x8000_0181, &[(0x1800, 1), (0x1800, 1)]),
        ((0x1801, 1), 0x4000_0281, &[(0x1801, 1)]),
    ];
    for ((index, sub), value, expected) in cases {
        let mut bench = Bench::new(1);
        // The communication reset forgets communication objects: the fixed ones of a real drive do not change by it.
        bench.drives[0].keeps = true;
        configured(&mut bench);
        bench.drives[0].objects.get_mut(&(index, sub)).unwrap().1 = value;
        bench.until(DriveState::Disabled, 2_000);
        assert_eq!(written(&bench), expected, "{index:04X}:{sub}");
        let off = bench.drives[0].seen.iter().map(hex).find(|line| line.starts_with("601 23 00 14 01"));
        assert!(off.is_none_or(|line| line == "601 23 00 14 01 01 02 00 80"), "changed while it was on");
    }
}

/// Goal: a fixed identifier that is right does not stand in the way of a type that is not.
#[test]
fn pdo_with_a_fixed_identifier_is_changed_in_its_other_parts() {
    let mut bench = Bench::new(1);
    bench.drives[0].keeps = true;
    configured(&mut bench);
    bench.drives[0].objects.get_mut(&(0x1800, 2)).unwrap().1 = 254;
    bench.drives[0].fixed = vec![(0x1800, 1)];
    bench.until(DriveState::Disabled, 2_000);
    assert_eq!(written(&bench), [(0x1800, 1), (0x1800, 2)], "the identifier is not written a second time");

    // One that is wrong is refused by the object that cannot be changed.
    let mut bench = Bench::new(1);
    bench.drives[0].keeps = true;
    configured(&mut bench);
    bench.drives[0].objects.get_mut(&(0x1800, 1)).unwrap().1 = 0x481;
    bench.drives[0].fixed = vec![(0x1800, 1)];
    bench.until(DriveState::Refused, 2_000);
    assert!(refusal(&bench).starts_with("object 0x1800:01"), "{}", refusal(&bench));
}

/// Goal: what a drive need not have is missing by whatever code it is refused with; what must not be missing in silence is
/// refused with the key that states it, and is then neither read nor written.
#[test]
fn objects_that_are_missing_are_stated_or_refused_with_the_key() {
    for code in REFUSALS {
        let mut bench = Bench::new(1);
        let gone = [(0x1006, 0), (0x1401, 1), (0x1803, 1), (0x6091, 1), (0x6091, 2), (0x607E, 0)];
        bench.drives[0].refused.extend(gone.map(|object| (object, code)));
        bench.until(DriveState::Disabled, 2_000);
    }
    let demanded = [(0x1017, 0), (0x6007, 0), (0x605A, 0), (0x60C2, 2), (0x6502, 0)];
    for ((index, sub), code) in demanded.into_iter().flat_map(|object| REFUSALS.map(|code| (object, code))) {
        let missing = |bench: &mut Bench| {
            bench.drives[0].refused.insert((index, 1), code);
            bench.drives[0].refused.insert((index, sub), code);
        };
        let mut bench = Bench::new(1);
        missing(&mut bench);
        bench.until(DriveState::Refused, 2_000);
        let words = refusal(&bench);
        assert!(words.contains(&format!("absent_objects = [0x{index:04X}]")), "{words}");
        assert_eq!(bench.status(0).error_code, code);

        let object = OptionalObject::from_index(index).unwrap();
        let absent = AbsentObjects::NONE.with(object);
        let mut bench = with(DriveFeatures { absent, ..DriveFeatures::default() });
        missing(&mut bench);
        bench.until(DriveState::Disabled, 2_000);
        let [low, high] = index.to_le_bytes();
        let named = |line: &String| line.contains(&format!("{low:02X} {high:02X} "));
        assert!(!bench.drives[0].seen.iter().map(hex).any(|line| named(&line)), "{index:04X} was touched");
    }
}

/// Goal: without a heartbeat to watch the drive needs another supervision of its master, by name.
#[test]
fn drive_without_consumer_heartbeat_needs_another_supervision() {
    let missing = |bench: &mut Bench| bench.drives[0].refused.extend([((0x1016, 1), 0x0602_0000)]);
    let mut bench = Bench::new(1);
    missing(&mut bench);
    bench.until(DriveState::Refused, 2_000);
    assert!(refusal(&bench).contains("master_supervision = \"setpoint-timer\""), "{}", refusal(&bench));
    for master_supervision in [MasterSupervision::SetpointTimer, MasterSupervision::Drive] {
        let mut bench = with(DriveFeatures { master_supervision, ..DriveFeatures::default() });
        missing(&mut bench);
        bench.until(DriveState::Disabled, 2_000);
        let timed = written(&bench).contains(&(0x1400, 5));
        assert_eq!(timed, master_supervision == MasterSupervision::SetpointTimer);
        let watchdog_ms = u16::try_from(bench.settings.cycle.drive_watchdog_ms).unwrap();
        let [low, high] = watchdog_ms.to_le_bytes();
        let line = format!("601 2B 00 14 05 {low:02X} {high:02X} 00 00");
        assert_eq!(timed, bench.drives[0].seen.iter().any(|frame| hex(frame) == line), "{line}");
    }
}

/// Goal: a drive that confirms a write and holds something else is refused with both numbers.
#[test]
fn write_that_is_confirmed_and_not_taken_is_refused_with_both_numbers() {
    let mut bench = Bench::new(1);
    bench.drives[0].stuck.insert((0x6007, 0), 1);
    bench.until(DriveState::Refused, 2_000);
    let words = refusal(&bench);
    assert!(words.contains("0x6007:00: the drive confirmed the write of 3 and holds 1"), "{words}");
    assert_eq!(format!("{:?}", bench.status(0).refused_numbers), "[1.0, 3.0]");
}

/// Goal: a drive that shows its mode only in operation enabled is energised only when its settings say so, and counts as
/// enabled only once it shows cyclic synchronous position.
#[test]
fn late_modes_display_is_looked_at_in_operation_enabled() {
    let mut bench = Bench::new(1);
    bench.drives[0].stuck.insert((0x6061, 0), 0);
    bench.drives[0].shows_mode = false;
    bench.until(DriveState::Refused, 8_000);
    assert!(refusal(&bench).contains("late_mode_display = true"), "{}", refusal(&bench));

    let late = DriveFeatures { late_mode_display: true, ..DriveFeatures::default() };
    for (shown, expected) in [(8, DriveState::Enabled), (1, DriveState::Fault)] {
        let mut bench = with(late);
        bench.drives[0].shows_mode = false;
        bench.until(DriveState::Disabled, 2_000);
        bench.hold();
        bench.drive_target = DriveTarget::Enabled;
        bench.steps(500);
        assert_eq!(bench.drives[0].status, ENABLED | FOLLOWS);
        assert_eq!(bench.status(0).state, DriveState::Enabling, "not before it shows the mode");
        bench.drives[0].objects.insert((0x6061, 0), (1, shown));
        bench.steps(6_000);
        assert_eq!(bench.status(0).state, expected, "shows mode {shown}");
        if expected == DriveState::Fault {
            assert_eq!(bench.drives[0].status, SWITCH_ON_DISABLED, "left energised in another mode");
            assert!(bench.driver.explain(bench.status(0).error_code).contains("the mode of its settings"));
            continue;
        }
        // It shows it anew each time.
        bench.drive_target = DriveTarget::Disabled;
        bench.drives[0].objects.insert((0x6061, 0), (1, 0));
        bench.until(DriveState::Disabled, 100);
        bench.steps(10);
        bench.drive_target = DriveTarget::Enabled;
        bench.steps(500);
        assert_eq!(bench.status(0).state, DriveState::Enabling);
    }
}

/// Goal: the statusword is understood in four bytes too, whatever the vendor has in the upper two.
#[test]
fn statusword_in_four_bytes_is_read_by_its_lower_two() {
    let mut bench = Bench::new(1);
    bench.drives[0].status_bytes = 4;
    bench.until(DriveState::Disabled, 2_000);
}

/// Goal: a fault whose reset takes two rising edges is reset by one command; one whose cause stays gets only so many.
#[test]
fn fault_reset_repeats_its_edge() {
    let mut bench = Bench::new(1);
    bench.until(DriveState::Disabled, 2_000);
    bench.drives[0].responds = false;
    bench.drives[0].status = FAULT;
    bench.steps(10);
    assert_eq!(bench.status(0).state, DriveState::Fault);
    bench.driver.clear_faults();
    let (mut edges, mut before) = (0, 0);
    for _ in 0..8_000 {
        bench.step();
        let control = bench.rpdo(0).unwrap().0;
        edges += u32::from(control & 0x80 != 0 && before & 0x80 == 0);
        before = control;
        assert!(control == 0 || control == 0x80, "{control:#06x}");
    }
    assert!((10..=25).contains(&edges), "{edges} edges in the 5 s that a step may take");
    assert_eq!(before, 0, "the reset ends");
}

/// Goal: on its way up a drive may fall back twice while it has no torque; more often, or from torque, it has dropped out.
#[test]
fn drive_may_fall_back_twice_before_it_has_torque() {
    for (falls, expected) in [(1, DriveState::Enabled), (2, DriveState::Enabled), (3, DriveState::Disabled)] {
        let mut bench = Bench::new(1);
        bench.until(DriveState::Disabled, 2_000);
        bench.hold();
        bench.drives[0].responds = false;
        bench.drive_target = DriveTarget::Enabled;
        for status in [READY, SWITCHED_ON].into_iter().cycle().take(falls) {
            for status in [SWITCH_ON_DISABLED, status] {
                bench.drives[0].status = status;
                bench.steps(20);
            }
        }
        for status in [SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED | FOLLOWS] {
            bench.drives[0].status = status;
            bench.steps(20);
        }
        let words = bench.driver.explain(bench.status(0).error_code);
        if expected == DriveState::Enabled {
            assert_eq!(bench.status(0).state, expected, "{falls} falls: {words}");
        } else {
            assert!(words.contains("by itself"), "{falls} falls: {words}");
        }
    }
}
