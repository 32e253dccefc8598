//! A bus with servos of two protocols: accepted when no identifiers collide, refused by name when they do.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]
use std::path::{Path, PathBuf};
use taustream_arm::{Damiao, Settings};

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml")
}

/// The shipped CiA 402 arm with a Damiao motor at the elbow.
fn mixed(node_id: u8, feedback_id: u16) -> String {
    let cia402 =
        "node_id = 3\nprotocol = \"cia402\"\nsign = 1\ngear_ratio = 101.0\ncounts_per_rev = 131072.0\n";
    let damiao = format!(
        "node_id = {node_id}\nprotocol = \"damiao\"\nsign = 1\nfeedback_id = {feedback_id}\nmode = \"pos_vel\"\n\
         position_range_rad = 12.5\nvelocity_range_rad_s = 10.0\ntorque_range_nm = 28.0\nwatchdog_ms = 100\n"
    );
    let text = std::fs::read_to_string(file()).unwrap();
    let (before, elbow) = text.split_once(cia402).unwrap();
    let elbow = elbow.replacen("reaction = \"ramp\"", "reaction = \"limp\"", 1);
    format!("{before}{damiao}{elbow}")
}

#[test]
fn bus_of_two_protocols_is_taken_when_no_identifiers_meet() {
    let settings = Settings::from_toml(&file(), &mixed(9, 0x019)).unwrap();
    let names: Vec<&str> = settings.servos.iter().map(|servo| servo.protocol.name()).collect();
    assert_eq!(names, ["cia402", "cia402", "damiao", "cia402", "cia402", "cia402"]);
    assert_eq!(settings.servos[2].protocol.get::<Damiao>().unwrap().feedback_id, 0x19);
}

#[test]
fn identifiers_that_meet_across_protocols_are_refused_with_joint_and_number() {
    for (node_id, feedback_id, words) in [
        (
            2,
            0x019,
            "0x202 for VEL commands: expected an identifier of its own on the bus: joint shoulder_lift has it for RPDO 1",
        ),
        (
            9,
            0x181,
            "0x181 for feedback: expected an identifier of its own on the bus: joint shoulder_pan has it for TPDO 1",
        ),
        (9, 0x080, "joint shoulder_pan has it for SYNC"),
        (9, 0x77F, "joint shoulder_pan has it for the master's heartbeat"),
        // The servo that comes later in the file is the one that is named.
        (
            9,
            0x585,
            "0x585 for the SDO reply: expected an identifier of its own on the bus: joint elbow has it for feedback",
        ),
        (
            4,
            0x019,
            "0x204 for RPDO 1: expected an identifier of its own on the bus: joint elbow has it for VEL commands",
        ),
    ] {
        let faults = Settings::from_toml(&file(), &mixed(node_id, feedback_id)).unwrap_err();
        assert!(faults.to_string().contains(words), "{node_id} {feedback_id:#x}: {faults}");
        assert_eq!(faults.0.len(), 1, "one sentence a clash: {faults}");
    }
}
