//! Torques at rest against the masses of the robot file.
#![expect(clippy::unwrap_used, reason = "helpers of tests; a failure in them fails the test")]
use std::path::PathBuf;
use taustream_arm::{LinkMass, Settings};
use taustream_motion::{JointArray, MAX_JOINTS, joint_array};

fn settings() -> Settings {
    let config = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config");
    Settings::load(&config.join("settings/vcan6.toml")).unwrap()
}

const POSE_RAD: [f64; 6] = [0.3, -1.0, 1.2, -0.6, -1.2, 0.4];

fn pose() -> JointArray {
    joint_array(POSE_RAD)
}

#[test]
fn torques_of_the_masses_agree_and_a_payload_that_nobody_stated_does_not() {
    let settings = settings();
    let right_nm = settings.robot.dynamics().unwrap().holding_nm(&pose());
    assert_eq!(settings.holding_mismatches(&pose(), &right_nm), []);
    let mut loaded = settings.robot.clone();
    let last = *loaded.masses.last().unwrap();
    loaded.masses.push(LinkMass { mass_kg: 8.0, ..last });
    let loaded_nm = loaded.dynamics().unwrap().holding_nm(&pose());
    let found = settings.holding_mismatches(&pose(), &loaded_nm);
    let shoulder = found.iter().find(|m| m.joint == 1).unwrap();
    assert_eq!((shoulder.measured_nm, shoulder.modelled_nm), (loaded_nm[1], right_nm[1]));
    assert!((loaded_nm[1] - right_nm[1]).abs() > shoulder.tolerance_nm, "{shoulder}");
    let said = shoulder.to_string();
    assert!(said.starts_with("joint 2 (") && said.contains("Nm apart"), "{said}");
    // The axis of the first joint is upright: no payload shows there.
    assert!(found.iter().all(|m| m.joint != 0), "{found:?}");
}

#[test]
fn friction_and_readings_that_are_a_little_off_are_no_mismatch() {
    let settings = settings();
    let right_nm = settings.robot.dynamics().unwrap().holding_nm(&pose());
    for off in [0.9, 1.1] {
        assert_eq!(settings.holding_mismatches(&pose(), &right_nm.map(|nm| off * nm)), []);
    }
    // The sign of a joint that bears weight is another matter.
    let mut turned_nm = right_nm;
    turned_nm[1] = -turned_nm[1];
    assert_eq!(settings.holding_mismatches(&pose(), &turned_nm).len(), 1);
}

#[test]
fn what_is_not_measured_or_not_known_is_not_checked() {
    let mut settings = settings();
    assert_eq!(settings.holding_mismatches(&pose(), &[f64::NAN; MAX_JOINTS]), []);
    settings.robot.joints.iter_mut().for_each(|joint| joint.torque_nm_max = None);
    assert_eq!(settings.holding_mismatches(&pose(), &[1e3; MAX_JOINTS]), []);
    settings.robot.masses.clear();
    assert_eq!(settings.holding_mismatches(&pose(), &[1e3; MAX_JOINTS]), []);
}
