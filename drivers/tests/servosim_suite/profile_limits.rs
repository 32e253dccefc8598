//! A drive's own limits of speed and acceleration: compared, written, and what becomes of a motion that they cut off.
use super::adopt::restart_as;
use super::arm::{Arm, shipped};
use super::quirks::{ELBOW, said_when, state, with_key, with_objects};
use std::f64::consts::TAU;
use taustream_arm::{
    AbsentObjects, LimitUse, OptionalObject, ProfileLimits, Reaction, Settings, VelocityUnit,
};
use taustream_drivers::{DriveState, DriveTarget};

const COUNTS_PER_RAD: f64 = 131_072.0 * 101.0 / TAU;
const MOTOR_RPM_PER_RAD_S: f64 = 101.0 * 60.0 / TAU;
const OBJECTS: [OptionalObject; 7] = [
    OptionalObject::MaxProfileVelocity,
    OptionalObject::MaxMotorSpeed,
    OptionalObject::ProfileAcceleration,
    OptionalObject::ProfileDeceleration,
    OptionalObject::QuickStopDeceleration,
    OptionalObject::MaxAcceleration,
    OptionalObject::MaxDeceleration,
];

fn with_limits(mut settings: Settings, apply: LimitUse, velocity_unit: VelocityUnit) -> Settings {
    state(&mut settings, |features| {
        features.profile_limits = Some(ProfileLimits { apply, velocity_unit });
    });
    settings
}

/// What the streamer may command, in rad/s or rad/s^2: the stop limits, and of the drive's own profiles the motion limits.
fn commanded(settings: &Settings, object: OptionalObject) -> f64 {
    let limits = settings.slot(ELBOW).unwrap().limits;
    match object.index() {
        0x607F | 0x6080 => limits.stop.velocity_rad_s,
        0x6083 | 0x6084 => limits.motion.acceleration_rad_s2,
        _ => limits.stop.acceleration_rad_s2,
    }
}

/// Goal: a limit that is just enough is taken, and one below is refused with both values in units of the joint and the object.
#[test]
fn limit_below_what_is_commanded_is_refused_with_both_values() {
    for object in OBJECTS {
        let index = object.index();
        let per_unit = if index == 0x6080 { MOTOR_RPM_PER_RAD_S } else { COUNTS_PER_RAD };
        let needed = commanded(&shipped(), object);
        for (share, state) in [(1.001, DriveState::Disabled), (0.9, DriveState::Refused)] {
            let value = (needed * share * per_unit).ceil();
            let settings = with_objects(&[&format!("object=0x{index:04X},value={value}")]);
            let settings = with_limits(settings, LimitUse::Compare, VelocityUnit::CountsPerSecond);
            let said = said_when(&mut Arm::with(settings), state, 3_000);
            if state == DriveState::Refused {
                let unit = if matches!(index, 0x607F | 0x6080) { "rad/s" } else { "rad/s^2" };
                let stated = format!("is {:.3} {unit} of the joint", value / per_unit);
                let wanted = format!("may command {needed:.3} {unit}");
                for part in [format!("0x{index:04X} ({})", object.name()), stated, wanted] {
                    assert!(said.contains(&part), "no {part:?} in: {said}");
                }
                assert!(said.contains("apply = \"write\""), "{said}");
            }
        }
    }
}

/// Goal: the unit of the settings is the one in which the drive is understood; 0x6080 is in revolutions of the motor all the same.
#[test]
fn limits_are_understood_in_the_unit_of_the_drive() {
    let rpm = MOTOR_RPM_PER_RAD_S;
    let objects = |factor: f64| -> Vec<String> {
        let settings = shipped();
        let value = |object: &OptionalObject| {
            let unit = if object.index() == 0x6080 { rpm } else { rpm * factor };
            (commanded(&settings, *object) * 1.01 * unit).ceil()
        };
        OBJECTS.iter().map(|o| format!("object=0x{:04X},value={}", o.index(), value(o))).collect()
    };
    for (unit, factor, state) in [
        (VelocityUnit::Rpm, 1.0, DriveState::Disabled),
        (VelocityUnit::TenthRpm, 10.0, DriveState::Disabled),
        (VelocityUnit::TenthRpm, 1.0, DriveState::Refused),
        (VelocityUnit::CountsPerSecond, 10.0, DriveState::Refused),
    ] {
        let texts = objects(factor);
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        let settings = with_limits(with_objects(&texts), LimitUse::Compare, unit);
        said_when(&mut Arm::with(settings), state, 3_000);
    }
}

/// Goal: a drive without the objects is taken where they are compared, and refused with the key where they are to be written.
#[test]
fn absent_limits_are_taken_or_refused_with_the_key() {
    for object in OBJECTS {
        let index = object.index();
        let absent = || with_objects(&[&format!("object=0x{index:04X},value=absent")]);
        let compared = with_limits(absent(), LimitUse::Compare, VelocityUnit::CountsPerSecond);
        said_when(&mut Arm::with(compared), DriveState::Disabled, 3_000);
        let mut written = with_limits(absent(), LimitUse::Write, VelocityUnit::CountsPerSecond);
        let said = said_when(&mut Arm::with(written.clone()), DriveState::Refused, 3_000);
        assert!(said.contains(&format!("absent_objects = [0x{index:04X}]")), "{said}");
        state(&mut written, |features| features.absent = AbsentObjects::NONE.with(object));
        said_when(&mut Arm::with(written), DriveState::Disabled, 3_000);
    }
}

/// Goal: what is written stands in the drive, in its unit: a fifth and the rounding of setpoints above the limits that cut off,
/// the joint's own limits where the drive makes a ramp of it.
#[test]
fn limits_are_written_from_those_of_the_joint() {
    let settings = with_limits(shipped(), LimitUse::Write, VelocityUnit::CountsPerSecond);
    let mut arm = Arm::with(settings);
    let mut written = Vec::new();
    for _ in 0..3_000 {
        arm.cycle(DriveTarget::Disabled);
        let writes = arm.sent.iter().filter(|frame| frame.id().raw() == 0x603 && frame.data()[0] == 0x23);
        written.extend(writes.map(|frame| {
            let data = frame.data();
            let number = u32::from_le_bytes(data[4..8].try_into().unwrap());
            (u16::from_le_bytes([data[1], data[2]]), number)
        }));
    }
    assert_eq!(arm.states(), [DriveState::Disabled; 6]);
    for object in OBJECTS {
        let needed = commanded(&arm.settings, object);
        let (per_unit, rounding, factor) = match object.index() {
            0x607F => (COUNTS_PER_RAD, 1.0 / 1e-3, 1.2),
            0x6080 => (MOTOR_RPM_PER_RAD_S, 1.0 / 1e-3 / 131_072.0 * 60.0, 1.2),
            0x60C5 | 0x60C6 => (COUNTS_PER_RAD, 2.0 / 1e-6, 1.2),
            _ => (COUNTS_PER_RAD, 0.0, 1.0),
        };
        let expected = needed * factor * per_unit + rounding;
        let found = written.iter().find(|(index, _)| *index == object.index()).map(|(_, number)| *number);
        // Ramps that are right already are left alone.
        let there = matches!(object.index(), 0x6083..=0x6085) && found.is_none();
        let off = found.map_or(f64::INFINITY, |found| f64::from(found) - expected);
        assert!(there || (-1e-3..=1.001).contains(&off), "{}: {found:?} for {expected}", object.name());
    }
}

/// Goal: what the comparison is for. A drive that cuts setpoints off at half the speed lags; with the limits written it follows.
#[test]
fn drive_that_cuts_setpoints_off_follows_once_its_limits_are_written() {
    let mut settings = with_key("limits_setpoints", true, false);
    let half = format!("joint=elbow,object=0x607F,value={}", (0.75 * COUNTS_PER_RAD).ceil());
    let list = vec![toml::Value::String(half)];
    settings.simulator.get_or_insert_default().insert("objects".to_owned(), toml::Value::Array(list));
    let mut arm = Arm::with(settings.clone());
    arm.enable();
    let cut_rad = arm.move_and_measure(0.4)[ELBOW];
    assert!(cut_rad > 0.05, "the drive does not cut off: {cut_rad} rad behind");
    let mut arm = Arm::with(with_limits(settings, LimitUse::Write, VelocityUnit::CountsPerSecond));
    arm.enable();
    let worst_rad = arm.move_and_measure(0.4)[ELBOW];
    assert!((1e-9..0.005).contains(&worst_rad), "lags {worst_rad} rad");
}

/// Goal: a drive that holds its load is taken over only if its limits are those that would have been accepted.
#[test]
fn drive_that_holds_with_a_limit_below_what_is_commanded_is_not_taken_over() {
    for (value, expected) in [(1_000_000_000_u32, DriveState::Adopted), (100, DriveState::EnergisedUnowned)] {
        let mut settings = with_objects(&[&format!("object=0x607F,value={value}")]);
        for servo in &mut settings.servos {
            servo.reaction = Reaction::Hold;
        }
        let mut arm = Arm::with(settings.clone());
        arm.enable();
        arm.alone(40);
        restart_as(&mut arm, &with_limits(settings, LimitUse::Compare, VelocityUnit::CountsPerSecond));
        for _ in 0..3_000 {
            arm.cycle(DriveTarget::Disabled);
        }
        let status = arm.status(ELBOW);
        assert_eq!(status.state, expected, "0x607F = {value}: {status:?}");
        assert_eq!(status.refused_object, if value == 100 { 0x60_7F00 } else { 0 });
    }
}
