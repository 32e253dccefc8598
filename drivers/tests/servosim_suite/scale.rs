//! Drives that count otherwise than the settings say: what they would do, and that they are refused.
use super::adopt::{orphaned, restart_as};
use super::arm::{Arm, shipped};
use taustream_arm::{Cia402, Overruled, Reaction, ScaleObject, Settings};
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{DriveState, DriveTarget};
use toml::Value;

/// Changes how the elbow's drive counts.
fn change_elbow(settings: &mut Settings, change: impl FnOnce(&mut Cia402)) {
    let mut cia402 = *settings.servos[2].protocol.get::<Cia402>().unwrap();
    change(&mut cia402);
    settings.servos[2].protocol = cia402.into();
}

/// The shipped arm whose elbow's drive has these objects.
fn with_objects(texts: &[&str]) -> Settings {
    let mut settings = shipped();
    let list = texts.iter().map(|text| Value::String(format!("joint=elbow,{text}"))).collect();
    settings.simulator.get_or_insert_default().insert("objects".to_owned(), Value::Array(list));
    settings
}

/// Goal: each object that contradicts refuses that drive before anything is energised, and no other.
#[test]
fn planted_contradictions_are_refused_at_the_one_joint_that_has_them() {
    let cases: [(&[&str], &str); 11] = [
        (&["object=0x608F:01,value=65536"], "0x608F (position encoder resolution) of the drive says 65536"),
        (&["object=0x608F:02,value=2"], "0x608F (position encoder resolution) of the drive says 65536"),
        (&["object=0x6091:01,value=50"], "0x6091 (gear ratio) of the drive says 50"),
        (&["object=0x6091:02,value=0"], "a zero in it"),
        (&["object=0x6092:01,value=1000000"], "0x6092 (feed constant) of the drive says 1000000"),
        (&["object=0x6093:01,value=2"], "0x6093 (position factor) of the drive says 2 increments"),
        (&["object=0x6093:02,value=0"], "a zero in it"),
        (&["object=0x607C,value=-4096"], "0x607C (home offset) of the drive is -4096 counts"),
        (&["object=0x607E,value=0x80"], "0x607E (polarity) of the drive is 128"),
        (
            &["object=0x607D:02,value=1000"],
            "0x607D:02 (software position limit, highest) of the drive is 1000",
        ),
        (&["object=0x607B:01,value=-65536", "object=0x607B:02,value=65535"], "0x607B:01"),
    ];
    for (objects, words) in cases {
        let mut arm = Arm::with(with_objects(objects));
        for _ in 0..3_000 {
            arm.cycle(DriveTarget::Disabled);
        }
        let mut expected = [DriveState::Disabled; 6];
        expected[2] = DriveState::Refused;
        assert_eq!(arm.states(), expected, "{objects:?}");
        let said = explain_refusal(&arm.status(2).refusal());
        assert!(said.contains(words), "{said}");
    }
}

/// Goal: drives that do not have the objects come up as they always did.
#[test]
fn drives_without_the_objects_come_up() {
    let gone: Vec<String> = ["0x608F", "0x6091", "0x6092", "0x6093", "0x607D", "0x607B"]
        .iter()
        .flat_map(|index| [1, 2].map(|sub| format!("object={index}:{sub:02},value=absent")))
        .chain(["0x607C", "0x607E"].map(|index| format!("object={index},value=absent")))
        .collect();
    let gone: Vec<&str> = gone.iter().map(String::as_str).collect();
    let mut arm = Arm::with(with_objects(&gone));
    arm.enable();
}

/// Goal: what the comparison is for. A gear that the drive has otherwise, overruled against better knowledge, moves the
/// joint by another angle, and its feedback agrees with the command all the same.
#[test]
fn overruled_gear_moves_the_joint_by_another_angle_with_feedback_that_agrees() {
    let mut settings = with_objects(&["object=0x6091:01,value=202", "object=0x607D:01,value=absent"]);
    change_elbow(&mut settings, |cia402| {
        for object in [ScaleObject::GearRatio, ScaleObject::FeedConstant, ScaleObject::SoftLimit] {
            cia402.overruled = cia402.overruled.with(object);
        }
        assert_ne!(cia402.overruled, Overruled::NONE);
    });
    let mut arm = Arm::with(settings);
    let moved_rad = moved_by_fifth_of_a_radian(&mut arm);
    // Half the units a motor revolution: 0.2 rad commanded are 0.4 rad of the link.
    assert!((moved_rad - 0.4).abs() < 0.02, "moved by {moved_rad} rad");
}

/// Commands the elbow 0.2 rad on, with feedback that agrees; by how much its link has moved, rad.
fn moved_by_fifth_of_a_radian(arm: &mut Arm) -> f64 {
    arm.enable();
    let before_rad = arm.simulator.drive(2).unwrap().position_rad();
    for _ in 0..400 {
        arm.commands[2].position_rad += 0.5e-3;
        arm.cycle(DriveTarget::Enabled);
    }
    for _ in 0..200 {
        arm.cycle(DriveTarget::Enabled);
    }
    let moved_rad = arm.simulator.drive(2).unwrap().position_rad() - before_rad;
    let error_rad = (arm.status(2).position_rad - arm.commands[2].position_rad).abs();
    assert!(error_rad < 0.005, "feedback differs by {error_rad} rad");
    moved_rad
}

/// The settings with these objects of the elbow's drive overruled.
fn overruling(objects: &[ScaleObject], mut settings: Settings) -> Settings {
    change_elbow(&mut settings, |cia402| {
        for object in objects {
            cia402.overruled = cia402.overruled.with(*object);
        }
    });
    settings
}

/// Goal: the same for the position factor.
#[test]
fn overruled_position_factor_moves_the_joint_by_another_angle_with_feedback_that_agrees() {
    let settings = with_objects(&["object=0x6093:01,value=2", "object=0x607D:01,value=absent"]);
    let mut arm = Arm::with(overruling(&[ScaleObject::PositionFactor, ScaleObject::SoftLimit], settings));
    let moved_rad = moved_by_fifth_of_a_radian(&mut arm);
    assert!((moved_rad - 0.4).abs() < 0.02, "moved by {moved_rad} rad");
}

/// Goal: a home offset shifts where the drive says that the joint is; one that the settings state is part of its zero.
#[test]
fn home_offset_shifts_the_zero_unless_the_settings_state_it() {
    const OFFSET_COUNTS: i32 = 1_000_000;
    let shift_rad = f64::from(OFFSET_COUNTS) / (131_072.0 * 101.0) * std::f64::consts::TAU;
    let planted = || with_objects(&["object=0x607C,value=1000000"]);
    let mut lying = Arm::with(overruling(&[ScaleObject::HomeOffset], planted()));
    lying.reach(DriveTarget::Disabled, DriveState::Disabled);
    let off_rad = lying.simulator.drive(2).unwrap().position_rad() - lying.status(2).position_rad;
    assert!((off_rad.abs() - shift_rad).abs() < 1e-4, "off by {off_rad} rad instead of {shift_rad}");

    let mut stated = shipped();
    change_elbow(&mut stated, |cia402| cia402.home_offset_counts = OFFSET_COUNTS);
    let mut arm = Arm::with(stated.clone());
    arm.enable();
    let off_rad = arm.simulator.drive(2).unwrap().position_rad() - arm.status(2).position_rad;
    assert!(off_rad.abs() < 1e-3, "off by {off_rad} rad");
}

/// Goal: an energised drive that counts otherwise is not taken over.
#[test]
fn energised_drive_that_counts_otherwise_is_not_adopted() {
    let mut arm = orphaned(Reaction::Hold, 40);
    // The next master has other settings for the same drives.
    let mut other = arm.settings.clone();
    change_elbow(&mut other, |cia402| cia402.gear_ratio = 50.0);
    restart_as(&mut arm, &other);
    for _ in 0..3_000 {
        arm.cycle(DriveTarget::Disabled);
    }
    let status = arm.status(2);
    assert_eq!(status.state, DriveState::EnergisedUnowned);
    let said = explain_refusal(&status.refusal());
    assert!(said.contains("0x6091") && said.contains("101") && said.contains("50"), "{said}");
}
