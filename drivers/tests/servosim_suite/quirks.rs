//! Simulated drives that depart from what masters expect, each by one switch, and the master that takes them all the same.
use super::arm::{Arm, shipped};
use taustream_arm::{
    AbsentObjects, Cia402, DriveFeatures, OptionalObject, PositionMode, Settings, WrittenLimits,
};
use taustream_drivers::sim::FaultRequest;
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};
use toml::Value;

/// The joint whose drive is the odd one.
pub(super) const ELBOW: usize = 2;

/// The shipped arm whose elbow's drive has this key of `[simulator]` at this value, and all others at the other.
pub(super) fn with_key(key: &str, elbow: impl Into<Value>, others: impl Into<Value>) -> Settings {
    let (elbow, others) = (elbow.into(), others.into());
    let list = (0..6).map(|joint| if joint == ELBOW { elbow.clone() } else { others.clone() }).collect();
    let mut settings = shipped();
    settings.simulator.get_or_insert_default().insert(key.to_owned(), Value::Array(list));
    settings
}

pub(super) fn with_objects(texts: &[&str]) -> Settings {
    let mut settings = shipped();
    let list = texts.iter().map(|text| Value::String(format!("joint=elbow,{text}"))).collect();
    settings.simulator.get_or_insert_default().insert("objects".to_owned(), Value::Array(list));
    settings
}

/// Changes what the settings state of the elbow's drive.
pub(super) fn state(settings: &mut Settings, change: impl FnOnce(&mut DriveFeatures)) {
    let mut cia402 = *settings.servos[ELBOW].protocol.get::<Cia402>().unwrap();
    change(&mut cia402.features);
    settings.servos[ELBOW].protocol = cia402.into();
}

/// What the master says of the elbow, once it is in this state and all others are configured.
pub(super) fn said_when(arm: &mut Arm, state: DriveState, most: u32) -> String {
    let mut expected = [DriveState::Disabled; 6];
    expected[ELBOW] = state;
    for _ in 0..most {
        arm.cycle(DriveTarget::Disabled);
        if arm.states() == expected {
            return explain_refusal(&arm.status(ELBOW).refusal());
        }
    }
    panic!("not {state:?} after {most} cycles: {:?}", arm.status(ELBOW));
}

#[test]
fn drive_with_fixed_pdos_that_are_right_comes_up() {
    let mut arm = Arm::with(with_key("fixed_pdos", true, false));
    arm.enable();
    let worst_rad = arm.move_and_measure(0.5)[ELBOW];
    assert!((1e-9..0.005).contains(&worst_rad), "lags {worst_rad} rad");
}

/// Each object, absent by CiA 301's code and by another, or fixed with another value.
#[test]
fn objects_that_are_absent_or_fixed_are_refused_with_the_key_and_taken_with_it() {
    for object in
        OptionalObject::ALL.into_iter().filter(|object| !object.is_of_homing() && !object.is_of_a_table())
    {
        let index = object.index();
        let subs: &[u8] = if index == 0x60C2 { &[1, 2] } else { &[0] };
        let planted = |change: &str| -> Vec<String> {
            subs.iter().map(|sub| format!("object=0x{index:04X}:{sub:02},{change}")).collect()
        };
        // For 0x605A 0 is to coast; this joint ramps down and ends limp.
        for change in ["value=absent", "value=absent,abort=0x08000000", "access=read-only,value=0"] {
            let read_only = change.starts_with("access");
            if read_only && subs.len() > 1 {
                continue; // Its value as shipped is right.
            }
            let texts = planted(change);
            let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
            // Absent, the period of SYNC is none of the drive's business, nor is how a quick stop ends where it ends limp.
            let taken = matches!(index, 0x1006 | 0x605A) && !read_only;
            let mut arm = Arm::with(with_objects(&texts));
            if taken {
                said_when(&mut arm, DriveState::Disabled, 3_000);
            } else {
                let said = said_when(&mut arm, DriveState::Refused, 3_000);
                let key = format!("absent_objects = [0x{index:04X}]");
                let no_csp = index == 0x6502 && read_only && said.contains("does not offer cyclic");
                assert!(said.contains(&key) || no_csp, "{change}: {said}");
            }
            let mut settings = with_objects(&texts);
            state(&mut settings, |features| features.absent = AbsentObjects::NONE.with(object));
            Arm::with(settings).enable();
        }
    }
}

#[test]
fn drive_that_shows_its_mode_only_in_operation_comes_up_when_its_settings_say_so() {
    let settings = || with_key("late_mode_display", true, false);
    let said = said_when(&mut Arm::with(settings()), DriveState::Refused, 8_000);
    assert!(said.contains("late_mode_display = true"), "{said}");
    let mut settings = settings();
    state(&mut settings, |features| features.late_mode_display = true);
    let mut arm = Arm::with(settings);
    arm.enable();
    arm.move_and_measure(0.3);
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    arm.enable();
}

/// Goal: a boot-up that comes after its time is still the end of the reset, not the begin of another one.
#[test]
fn boot_up_that_comes_late_is_taken_and_said_only_beyond_its_timeout() {
    for (timeout_s, is_said) in [(5.0, true), (12.0, false)] {
        let mut settings = with_key("boot_ms", 8_000, 20);
        state(&mut settings, |features| features.boot_timeout_s = timeout_s);
        let mut arm = Arm::with(settings);
        let mut said = false;
        // It powers up, is reset, and boots again.
        for _ in 0..19_000 {
            arm.cycle(DriveTarget::Disabled);
            let words = explain_refusal(&arm.status(ELBOW).refusal());
            said |= words.contains("boot_timeout_s");
        }
        assert_eq!(said, is_said, "within {timeout_s} s");
        assert_eq!(arm.states(), [DriveState::Disabled; 6], "{:?}", arm.status(ELBOW));
    }
}

#[test]
fn drive_that_switches_on_slowly_comes_up_within_the_drive_timeout() {
    let settings = || with_key("switch_on_ms", 6_000, 0);
    let mut arm = Arm::with(settings());
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    for _ in 0..5_500 {
        arm.cycle(DriveTarget::Enabled);
    }
    assert_eq!(arm.status(ELBOW).state, DriveState::Fault);
    let said = explain_refusal(&arm.status(ELBOW).refusal());
    assert!(said.contains("supervision.drive_timeout_s"), "{said}");

    let mut settings = settings();
    settings.supervision.drive_timeout_s = 8.0;
    Arm::with(settings).enable();
}

/// Goal: answers after 450 ms are in time, and no request is repeated.
#[test]
fn drive_that_answers_sdo_after_450_ms_comes_up_without_a_repeated_request() {
    let mut arm = Arm::with(with_key("sdo_answer_ms", 450, 0));
    let mut asked: Vec<Vec<u8>> = Vec::new();
    for _ in 0..80_000 {
        arm.cycle(DriveTarget::Disabled);
        let to_elbow = arm.sent.iter().filter(|frame| frame.id().raw() == 0x603);
        asked.extend(to_elbow.map(|frame| frame.data().to_vec()));
        if arm.states() == [DriveState::Disabled; 6] {
            break;
        }
    }
    assert_eq!(arm.states(), [DriveState::Disabled; 6], "{:?}", arm.status(ELBOW));
    assert!(arm.now.0 > 20_000_000_000, "it was not slow");
    let repeated =
        asked.windows(2).filter(|pair| pair[0] == pair[1] && pair[0][..3] != [0x40, 0x41, 0x60]).count();
    assert_eq!(repeated, 0, "of {} requests", asked.len());
}

#[test]
fn fault_reset_that_takes_two_edges_is_one_command() {
    for edges in [1, 2, 3] {
        let mut arm = Arm::with(with_key("reset_edges", edges, 1));
        arm.reach(DriveTarget::Disabled, DriveState::Disabled);
        let names = arm.simulator.joints();
        let order = FaultRequest::parse("joint=elbow,kind=fault,value=0x4310", &names).unwrap();
        arm.simulator.request(arm.now, order);
        arm.cycle(DriveTarget::Disabled);
        for _ in 0..20 {
            arm.cycle(DriveTarget::Disabled);
        }
        assert_eq!(arm.status(ELBOW).state, DriveState::Fault);
        arm.simulator.clear(Some(ELBOW));
        arm.driver.clear_faults();
        for _ in 0..2_000 {
            arm.cycle(DriveTarget::Disabled);
        }
        assert_eq!(arm.status(ELBOW).state, DriveState::Disabled, "{edges} edges");
    }
}

#[test]
fn drive_that_falls_back_to_switch_on_disabled_comes_up() {
    for times in [1, 2] {
        let mut arm = Arm::with(with_key("falls_back", times, 0));
        arm.enable();
        assert_eq!(arm.status(ELBOW).error_code, 0, "{times}");
    }
}

/// Goal: a drive without cyclic synchronous position follows in interpolated position, when its settings say so.
#[test]
fn drive_with_interpolated_position_alone_follows_as_well_as_the_others() {
    let settings = || with_objects(&["object=0x6502,value=0x40"]);
    let said = said_when(&mut Arm::with(settings()), DriveState::Refused, 3_000);
    assert!(said.contains("position_mode = \"interpolated\""), "{said}");
    let mut settings = settings();
    state(&mut settings, |features| features.position_mode = PositionMode::Interpolated);
    let mut arm = Arm::with(settings);
    arm.enable();
    let worst_rad = arm.move_and_measure(0.5);
    assert!(worst_rad.iter().all(|worst_rad| (1e-9..0.005).contains(worst_rad)), "{worst_rad:?}");
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    arm.enable();
}

/// Goal: limits that the settings want are in the drive, in its counts; a drive that cannot take them is refused.
#[test]
fn limits_of_the_settings_are_written_and_read_back() {
    let limits =
        WrittenLimits { following_window_rad: Some(0.1), following_timeout_ms: Some(25), soft_limits: true };
    let mut settings = shipped();
    state(&mut settings, |features| features.limits = limits);
    let counts_per_rad = 131_072.0 * 101.0 / std::f64::consts::TAU;
    let mut arm = Arm::with(settings);
    let mut written = Vec::new();
    for _ in 0..3_000 {
        arm.cycle(DriveTarget::Disabled);
        let writes =
            arm.sent.iter().filter(|frame| frame.id().raw() == 0x603 && frame.data()[0] & 0xE0 == 0x20);
        written.extend(writes.map(|frame| {
            let data = frame.data();
            let number = i32::from_le_bytes(data[4..8].try_into().unwrap());
            (u16::from_le_bytes([data[1], data[2]]), data[3], number)
        }));
    }
    assert_eq!(arm.states(), [DriveState::Disabled; 6]);
    let value =
        |index, sub| written.iter().find(|(i, s, _)| (*i, *s) == (index, sub)).map(|(.., number)| *number);
    assert_eq!(value(0x6065, 0), Some((0.1 * counts_per_rad).round() as i32));
    assert_eq!(value(0x6066, 0), Some(25));
    let (low, high) = (value(0x607D, 1).unwrap(), value(0x607D, 2).unwrap());
    assert!(low < high && f64::from(high) <= 6.3 * counts_per_rad, "{low} {high}");

    let mut settings = with_objects(&["object=0x6065,access=read-only"]);
    state(&mut settings, |features| features.limits = limits);
    let said = said_when(&mut Arm::with(settings), DriveState::Refused, 3_000);
    assert!(said.starts_with("object 0x6065:00"), "{said}");
}

#[test]
fn drive_whose_statusword_has_four_bytes_comes_up() {
    Arm::with(with_objects(&["object=0x6041,bytes=4"])).enable();
}
