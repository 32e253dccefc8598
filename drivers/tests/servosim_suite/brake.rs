//! A brake that the master works: released once the drive holds, closed before it loses its torque, or at once when it has lost it.
//!
//! Method: the shoulder, whose load falls where neither motor nor brake holds it. Frames are read as bytes.
use super::arm::{Arm, level, shipped};
use taustream_arm::{BrakeSettings, Cia402, Reaction, Settings};
use taustream_drivers::sim::FaultRequest;
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{CanFrame, DriveState, DriveTarget, ServoDriver};
use toml::Value;

const LIFT: usize = 1;
/// The simulated brake moves within 50 ms.
const BRAKE: BrakeSettings = BrakeSettings { output_bit: 0, released_by: true, release_ms: 60, close_ms: 80 };
/// A joint that is held moves by less; one that nothing holds, with 60 Nm on 2 kg m2, falls by 0.037 rad while its brake closes.
const HELD_RAD: f64 = 0.01;

fn with_brake() -> Settings {
    let mut settings = shipped();
    let servo = &mut settings.servos[LIFT];
    let cia402 = *servo.protocol.get::<Cia402>().unwrap();
    servo.protocol = Cia402 { brake: Some(BRAKE), ..cia402 }.into();
    servo.reaction = Reaction::Hold;
    level(&mut settings);
    settings.simulator.get_or_insert_default().insert("brake_delay_ms".to_owned(), Value::Integer(50));
    settings
}

/// What was sent to the shoulder in a cycle: a write to 0x60FE:01, and its controlword.
fn sent(arm: &Arm) -> (Option<u32>, Option<u16>) {
    let data = |id: u32| arm.sent.iter().filter(move |frame| frame.id().raw() == id).map(CanFrame::data);
    let output = data(0x602)
        .find(|data| data.starts_with(&[0x23, 0xFE, 0x60, 0x01]))
        .map(|data| u32::from_le_bytes(data[4..8].try_into().unwrap()));
    (output, data(0x202).next().map(|data| u16::from_le_bytes([data[0], data[1]])))
}

fn place_rad(arm: &Arm) -> f64 {
    arm.simulator.drive(LIFT).unwrap().position_rad()
}

fn disturb(arm: &mut Arm, kind: &str) {
    let names = arm.simulator.joints();
    let request = FaultRequest::parse(&format!("joint={},kind={kind}", LIFT + 1), &names).unwrap();
    arm.simulator.request(arm.now, request);
}

fn said(arm: &Arm) -> String {
    explain_refusal(&arm.status(LIFT).refusal())
}

/// Goal: the order of enabling and disabling, and that the load is held all the way. A planted fault that releases the brake with the
/// controlword, or closes it with the torque, lets the joint fall by more than is allowed.
#[test]
fn brake_is_released_after_torque_and_closed_before_it_ends() {
    let mut arm = Arm::with(with_brake());
    let mut outputs = Vec::new();
    for _ in 0..3_000 {
        arm.cycle(DriveTarget::Disabled);
        outputs.extend(sent(&arm).0);
    }
    assert_eq!(arm.states(), [DriveState::Disabled; 6]);
    assert!(outputs.iter().all(|output| *output == 0), "released while it was off: {outputs:?}");
    let start_rad = place_rad(&arm);
    for joint in 0..6 {
        arm.commands[joint].position_rad = arm.status(joint).position_rad;
    }
    let (mut released_at, mut enabled_at) = (None, None);
    for ms in 0..2_000 {
        arm.cycle(DriveTarget::Enabled);
        if sent(&arm).0 == Some(1) {
            assert!(arm.simulator.drive(LIFT).unwrap().is_enabled(), "released without torque");
            released_at = released_at.or(Some(ms));
        }
        if arm.status(LIFT).state == DriveState::Enabled {
            enabled_at = enabled_at.or(Some(ms));
        }
        assert!((place_rad(&arm) - start_rad).abs() < HELD_RAD, "{ms} ms: it fell");
    }
    let (released_at, enabled_at) = (released_at.unwrap(), enabled_at.unwrap());
    assert!(
        (60..80).contains(&(enabled_at - released_at)),
        "released at {released_at}, enabled at {enabled_at} ms"
    );

    arm.move_and_measure(2.0 * std::f64::consts::PI / 6.0);
    let rest_rad = place_rad(&arm);
    let (mut closed_at, mut down_at) = (None, None);
    for ms in 0..2_000 {
        arm.cycle(DriveTarget::Disabled);
        let (output, control) = sent(&arm);
        if output == Some(0) {
            closed_at = closed_at.or(Some(ms));
        }
        if control.is_some_and(|control| control != 0x0F) {
            down_at = down_at.or(Some(ms));
        }
        assert!((place_rad(&arm) - rest_rad).abs() < HELD_RAD, "{ms} ms: it fell");
    }
    let (closed_at, down_at) = (closed_at.unwrap(), down_at.unwrap());
    assert!(
        closed_at <= 3 && (80..100).contains(&(down_at - closed_at)),
        "closed at {closed_at}, down at {down_at} ms"
    );
    assert_eq!(arm.states(), [DriveState::Disabled; 6]);
}

/// Goal: where the torque is gone, by a fault of the drive or by the operator, the brake is closed within milliseconds.
#[test]
fn brake_is_closed_at_once_when_torque_is_gone() {
    for (kind, target) in [("fault,value=0x4310", DriveTarget::Enabled), ("", DriveTarget::TorqueOff)] {
        let mut arm = Arm::with(with_brake());
        arm.enable();
        if !kind.is_empty() {
            disturb(&mut arm, kind);
        }
        let mut closed_at = None;
        for ms in 0..200 {
            arm.cycle(target);
            let (output, control) = sent(&arm);
            assert!(target != DriveTarget::TorqueOff || control == Some(0), "{ms} ms: {control:?}");
            closed_at = closed_at.or(output.filter(|output| *output == 0).map(|_| ms));
        }
        assert!(closed_at.is_some_and(|ms| ms <= 5), "{kind}: closed at {closed_at:?} ms");
        let rest_rad = place_rad(&arm);
        for _ in 0..500 {
            arm.cycle(DriveTarget::TorqueOff);
        }
        assert!((place_rad(&arm) - rest_rad).abs() < HELD_RAD, "{kind}: it falls");
    }
}

/// Goal: a brake that cannot be released leaves the drive off and is named; one that cannot be closed leaves the load held.
#[test]
fn brake_that_is_not_moved_is_named_and_the_load_is_held() {
    let mut arm = Arm::with(with_brake());
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    for joint in 0..6 {
        arm.commands[joint].position_rad = arm.status(joint).position_rad;
    }
    let start_rad = place_rad(&arm);
    disturb(&mut arm, "refuse");
    for _ in 0..1_000 {
        arm.cycle(DriveTarget::Enabled);
    }
    assert_eq!(arm.status(LIFT).state, DriveState::Fault);
    assert!(said(&arm).contains("release its brake"), "{}", said(&arm));
    assert!(!arm.simulator.drive(LIFT).unwrap().is_enabled());
    assert!((place_rad(&arm) - start_rad).abs() < HELD_RAD);

    let mut arm = Arm::with(with_brake());
    arm.enable();
    let start_rad = place_rad(&arm);
    disturb(&mut arm, "refuse");
    for _ in 0..8_000 {
        arm.cycle(DriveTarget::Disabled);
    }
    assert_eq!(arm.status(LIFT).state, DriveState::Fault);
    assert!(said(&arm).contains("close its brake"), "{}", said(&arm));
    assert!(arm.simulator.drive(LIFT).unwrap().is_enabled(), "it dropped its load");
    assert!((place_rad(&arm) - start_rad).abs() < HELD_RAD);
    arm.simulator.clear(Some(LIFT));
    arm.driver.clear_faults();
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    assert!((place_rad(&arm) - start_rad).abs() < HELD_RAD);
}

/// Goal: a streamer that is killed leaves the drive holding; the next one takes it over with its brake released, and closes it in order.
#[test]
fn drive_that_holds_with_a_released_brake_is_taken_over() {
    let mut settings = with_brake();
    for servo in &mut settings.servos {
        servo.reaction = Reaction::Hold;
    }
    let mut arm = Arm::with(settings.clone());
    arm.enable();
    arm.alone(40);
    super::adopt::restart_as(&mut arm, &settings);
    arm.reach(DriveTarget::Disabled, DriveState::Adopted);
    let rest_rad = place_rad(&arm);
    arm.reach(DriveTarget::Keep, DriveState::Adopted);
    for _ in 0..500 {
        arm.cycle(DriveTarget::Keep);
        assert_eq!(sent(&arm).0, None, "the brake of a drive that is kept is left as it is");
    }
    let mut outputs = Vec::new();
    for _ in 0..2_000 {
        arm.cycle(DriveTarget::Disabled);
        outputs.extend(sent(&arm).0);
        assert!((place_rad(&arm) - rest_rad).abs() < HELD_RAD, "it fell");
    }
    assert_eq!(arm.states(), [DriveState::Disabled; 6]);
    assert_eq!(outputs.first(), Some(&0));
}

/// Goal: nothing is released, read or written without the table; with it a drive without the object is refused.
#[test]
fn outputs_are_written_by_key_alone() {
    let mut arm = Arm::with(shipped());
    let mut touched = 0;
    for _ in 0..3_000 {
        arm.cycle(DriveTarget::Disabled);
        touched += arm.sent.iter().filter(|frame| frame.data().get(1..3) == Some(&[0xFE, 0x60])).count();
    }
    assert_eq!((arm.states(), touched), ([DriveState::Disabled; 6], 0));

    let mut settings = with_brake();
    let absent = Value::String(format!("joint={},object=0x60FE:01,value=absent", LIFT + 1));
    let list = Value::Array(vec![absent]);
    settings.simulator.get_or_insert_default().insert("objects".to_owned(), list);
    let mut arm = Arm::with(settings);
    for _ in 0..3_000 {
        arm.cycle(DriveTarget::Disabled);
    }
    assert_eq!(arm.status(LIFT).state, DriveState::Refused);
    assert!(said(&arm).contains("take [servo.brake] out"), "{}", said(&arm));
}
