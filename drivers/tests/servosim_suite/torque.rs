//! Torques of a drive: the offset beside its target (0x60B2), and what it measures (0x6077), in thousandths of its rated torque.
use super::arm::{Arm, level, shipped};
use super::quirks::{ELBOW, said_when};
use taustream_arm::{AbsentObjects, Cia402, OptionalObject, Settings, TorqueSettings};
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};
use toml::Value;

const GEAR: f64 = 101.0;
const RATED_NM: f64 = 1.3;

fn with_torque(offset: bool, actual: bool, objects: &[&str]) -> Settings {
    let mut settings = shipped();
    for servo in &mut settings.servos {
        let cia402 = *servo.protocol.get::<Cia402>().unwrap();
        let torque = Some(TorqueSettings { rated_nm: RATED_NM, offset, actual });
        servo.protocol = Cia402 { torque, ..cia402 }.into();
    }
    let list = objects.iter().map(|text| Value::String(format!("joint=elbow,{text}"))).collect();
    settings.simulator.get_or_insert_default().insert("objects".to_owned(), Value::Array(list));
    settings
}

/// Torque offset in the newest setpoint of a joint's drive, thousandths.
fn sent(arm: &Arm, joint: u32) -> Option<i16> {
    let frame = arm.sent.iter().find(|frame| frame.id().raw() == 0x201 + joint)?;
    Some(i16::from_le_bytes(frame.data().get(6..8)?.try_into().unwrap()))
}

/// Goal: a torque is sent in the drive's direction and unit, to a drive that follows and to no other, and not in the cycle in
/// which torque is switched off.
#[test]
fn torque_goes_to_drives_that_follow_in_their_unit_and_direction() {
    let mut arm = Arm::with(with_torque(true, false, &[]));
    for command in &mut arm.commands {
        command.torque_nm = 20.0;
    }
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    for joint in 0..6 {
        arm.commands[joint].position_rad = arm.status(joint).position_rad;
    }
    let mut followed = 0;
    for _ in 0..2_000 {
        arm.cycle(DriveTarget::Enabled);
        for joint in 0..6 {
            let torque = sent(&arm, joint).unwrap();
            let sign = arm.settings.servos[joint as usize].sign;
            let expected = (20.0 * sign / (GEAR * RATED_NM) * 1000.0).round() as i16;
            assert!(expected.abs() > 100, "the case tells nothing");
            let follows = arm.status(joint as usize).state == DriveState::Enabled;
            assert_eq!(torque, if follows { expected } else { 0 }, "joint {joint}");
            followed += u32::from(follows);
        }
    }
    assert!(followed > 6 * 1_000);
    arm.commands[ELBOW].torque_nm = f64::NAN;
    arm.cycle(DriveTarget::Enabled);
    assert_eq!(sent(&arm, ELBOW as u32), Some(0), "what is no number is no torque");
    arm.commands[ELBOW].torque_nm = 1e9;
    arm.cycle(DriveTarget::Enabled);
    assert_eq!(sent(&arm, ELBOW as u32).map(i16::unsigned_abs).map(|torque| torque >= 0x7FFF), Some(true));
    arm.cycle(DriveTarget::TorqueOff);
    assert_eq!((0..6).map(|joint| sent(&arm, joint)).collect::<Vec<_>>(), [Some(0); 6]);
}

/// Goal: what is measured is the torque at the joint, and an offset of that size is what the drive's own loop gives up: sign, gear and
/// rated torque are those of the joint in both directions, also where the motor turns the other way.
#[test]
fn measured_torque_is_that_of_the_joint_and_the_offset_takes_its_place() {
    let mut settings = with_torque(true, true, &[]);
    level(&mut settings);
    let signs: Vec<f64> = settings.servos.iter().map(|servo| servo.sign).collect();
    assert!(signs.contains(&1.0) && signs.contains(&-1.0));
    let mut arm = Arm::with(settings);
    assert!(arm.status(ELBOW).torque_nm.is_nan());
    arm.enable();
    let rest = |arm: &mut Arm| -> [f64; 6] {
        for _ in 0..1_500 {
            arm.cycle(DriveTarget::Enabled);
        }
        std::array::from_fn(|joint| arm.status(joint).torque_nm)
    };
    let held_nm = rest(&mut arm);
    assert!(held_nm.iter().any(|nm| nm.abs() > 5.0), "nothing hangs on the joints: {held_nm:?}");
    // The motor still gives what the load needs; an offset with another sign or scale would move the joint on the way.
    let mut worst_rad = 0.0_f64;
    for joint in 0..6 {
        arm.commands[joint].torque_nm = held_nm[joint];
    }
    for _ in 0..200 {
        arm.cycle(DriveTarget::Enabled);
        for joint in 0..6 {
            let away_rad = (arm.status(joint).position_rad - arm.commands[joint].position_rad).abs();
            worst_rad = worst_rad.max(away_rad);
        }
    }
    assert!(worst_rad < 0.02, "pushed by {worst_rad} rad");
    let again_nm = rest(&mut arm);
    for joint in 0..6 {
        let off_nm = (again_nm[joint] - held_nm[joint]).abs();
        // Dry friction of 2 Nm may hold a joint from either side.
        assert!(off_nm < 4.5, "joint {joint}: {} and then {} Nm", held_nm[joint], again_nm[joint]);
    }
}

/// Goal: torques in thousandths of another rated torque are refused with both numbers; an object that is missing needs its owner's word.
#[test]
fn rated_torque_of_another_motor_is_refused_with_both_numbers() {
    let refused = |object: &str| {
        said_when(&mut Arm::with(with_torque(true, true, &[object])), DriveState::Refused, 3_000)
    };
    let said = refused("object=0x6076,value=2600");
    for part in ["0x6076 (rated torque)", "2.6 Nm", "is 1.3 Nm", "2.000 times"] {
        assert!(said.contains(part), "no {part:?} in: {said}");
    }
    let said = refused("object=0x6076,value=absent");
    assert!(said.contains("absent_objects = [0x6076]"), "{said}");
    let mut settings = with_torque(true, true, &["object=0x6076,value=absent"]);
    let mut cia402 = *settings.servos[ELBOW].protocol.get::<Cia402>().unwrap();
    cia402.features.absent = AbsentObjects::NONE.with(OptionalObject::RatedTorque);
    settings.servos[ELBOW].protocol = cia402.into();
    said_when(&mut Arm::with(settings), DriveState::Disabled, 3_000);
    // Within the rounding of a data sheet.
    said_when(
        &mut Arm::with(with_torque(true, true, &["object=0x6076,value=1305"])),
        DriveState::Disabled,
        3_000,
    );
}

/// Goal: without the table the frames are those of before, and no torque is known.
#[test]
fn without_the_table_nothing_is_sent_or_measured() {
    let mut arm = Arm::with(shipped());
    arm.enable();
    arm.commands[ELBOW].torque_nm = 20.0;
    arm.cycle(DriveTarget::Enabled);
    assert_eq!(sent(&arm, ELBOW as u32), None);
    assert!(arm.driver.status(ELBOW).torque_nm.is_nan());
}
