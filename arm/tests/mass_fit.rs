//! Masses by measured torques, on arms whose true masses are known.
#![expect(clippy::unwrap_used, reason = "helpers of tests; a failure in them fails the test")]
use nalgebra::Vector3;
use std::path::{Path, PathBuf};
use taustream_arm::mass_fit::{HeldPose, MassFitError, POSES_MIN, Unknown, fit};
use taustream_arm::rng::SeededRng;
use taustream_arm::{LinkMass, Robot};
use taustream_motion::{JointArray, MAX_JOINTS};

fn robot(name: &str) -> Robot {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config/robots").join(name);
    Robot::load(&file).unwrap()
}

fn random_pose(robot: &Robot, rng: &mut SeededRng) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    for (q, joint) in pose.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        *q = rng.within(low, high);
    }
    pose
}

/// What drives of the true arm report, off by at most a share of the greatest torque of the joint.
fn measured(truth: &Robot, count: usize, (seed, off_nm): (u64, f64)) -> Vec<HeldPose> {
    let (dynamics, mut rng) = (truth.dynamics().unwrap(), SeededRng::new(seed, 0));
    let pose = |_| {
        let q_rad = random_pose(truth, &mut rng);
        let torque_nm = dynamics.holding_nm(&q_rad).map(|nm| nm + off_nm * (2.0 * rng.unit() - 1.0));
        HeldPose { q_rad, torque_nm }
    };
    (0..count).map(pose).collect()
}

/// Largest difference of the torques of two models over poses that no fit has seen.
fn apart_nm(a: &Robot, b: &Robot) -> f64 {
    let (of_a, of_b, mut rng) = (a.dynamics().unwrap(), b.dynamics().unwrap(), SeededRng::new(99, 0));
    let worst = |_| {
        let q = random_pose(a, &mut rng);
        let pairs = of_a.holding_nm(&q).into_iter().zip(of_b.holding_nm(&q));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    (0..200).map(worst).fold(0.0, f64::max)
}

/// The arm with what a fit found instead of its bodies.
fn corrected(file: &Robot, found: &taustream_arm::mass_fit::MassFit) -> Robot {
    let mut robot = file.clone();
    for body in &found.bodies {
        let frame = body.joint + 1;
        robot.masses.retain(|mass| mass.frame != frame);
        robot.masses.push(LinkMass {
            link: frame,
            frame,
            mass_kg: body.after.mass_kg,
            center_m: body.after.center_m.into(),
            inertia_kg_m2: nalgebra::Matrix3::zeros(),
        });
    }
    robot
}

/// Goal: a payload that nobody stated is found, by mass and by place, on arms with 6 and 7 joints.
#[test]
fn payload_is_found_that_the_file_does_not_state() {
    for (name, seed) in [("ur5.toml", 1), ("openarm-left.toml", 2)] {
        let file = robot(name);
        let frame = file.joints.len();
        let mut truth = file.clone();
        let center_m = Vector3::new(0.02, -0.03, 0.08);
        truth.masses.push(LinkMass {
            link: frame,
            frame,
            mass_kg: 1.3,
            center_m: center_m.into(),
            inertia_kg_m2: nalgebra::Matrix3::zeros(),
        });
        let found = fit(&file, &measured(&truth, 12, (seed, 0.0)), Unknown::Payload).unwrap();
        let [payload] = found.bodies.as_slice() else { panic!("{name}: {:?}", found.bodies) };
        assert!(payload.is_determined && payload.before.mass_kg == 0.0, "{name}");
        assert!((payload.after.mass_kg - 1.3).abs() < 1e-3, "{name}: {payload:?}");
        assert!((payload.after.center_m - center_m).norm() < 1e-3, "{name}: {payload:?}");
        let worst = found.joints.iter().map(|joint| joint.unseen_rms_nm).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{name}: {:?}", found.joints);
        assert!(
            found.joints.iter().any(|joint| joint.before_rms_nm > 1.0),
            "{name}: nothing was to be found"
        );
    }
}

/// Goal: with readings that are off, the true payload is within four of the stated standard deviations.
#[test]
fn stated_uncertainty_covers_the_truth() {
    let file = robot("ur5.toml");
    let mut truth = file.clone();
    truth.masses.push(LinkMass { mass_kg: 2.0, ..*truth.masses.last().unwrap() });
    for seed in 0..20 {
        let found = fit(&file, &measured(&truth, 16, (seed, 0.8)), Unknown::Payload).unwrap();
        let payload = found.bodies[0];
        let off_kg = (payload.after.mass_kg - 2.0).abs();
        assert!(off_kg < 4.0 * payload.mass_sigma_kg, "seed {seed}: {payload:?}");
        assert!(payload.mass_sigma_kg < 0.2, "seed {seed}: {payload:?}");
    }
}

/// Goal: wrong masses of all links are corrected as far as torques at rest show them: the model predicts poses that it has not seen.
#[test]
fn links_are_fitted_so_that_unseen_poses_agree() {
    let file = robot("ur5.toml");
    let mut truth = file.clone();
    for (i, mass) in truth.masses.iter_mut().enumerate() {
        mass.mass_kg *= [1.15, 0.85, 1.25][i % 3];
        mass.center_m.x += [0.01, -0.02][i % 2];
    }
    let before_nm = apart_nm(&truth, &file);
    for off_nm in [0.0, 0.5] {
        let found = fit(&file, &measured(&truth, 24, (3, off_nm)), Unknown::Links).unwrap();
        let after_nm = apart_nm(&truth, &corrected(&file, &found));
        let asked_nm = if off_nm == 0.0 { 0.02 * before_nm } else { 0.25 * before_nm };
        assert!(after_nm < asked_nm, "off {off_nm}: {before_nm} before, {after_nm} after");
        let base = found.bodies[0];
        // A body that turns about gravity alone is not determined by torques at rest, and stays as it was.
        assert!(!base.is_determined, "{base:?}");
        assert!((base.after.mass_kg - base.before.mass_kg).abs() < 1e-6, "{base:?}");
    }
}

/// Goal: a stated payload is not mistaken for a part of the link that carries it.
#[test]
fn payload_of_the_file_is_kept_apart_from_its_link() {
    let text =
        std::fs::read_to_string(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml"))
            .unwrap();
    let text = format!("{text}\n[payload]\nmass_kg = 1.0\ncenter_m = [0.0, 0.0, 0.05]\n");
    let bare = robot("ur5.toml");
    let loaded = Robot::from_toml(Path::new("ur5.toml"), &text).unwrap();
    let held = measured(&loaded, 12, (5, 0.0));
    let links = fit(&loaded, &held, Unknown::Links).unwrap();
    let last = links.bodies.last().unwrap();
    let flange_kg: f64 = bare.masses.iter().filter(|m| m.frame == 6).map(|m| m.mass_kg).sum();
    assert!((last.before.mass_kg - flange_kg).abs() < 1e-12, "{last:?}");
    assert!((last.after.mass_kg - flange_kg).abs() < 1e-6, "{last:?}");
    let payload = fit(&loaded, &held, Unknown::Payload).unwrap().bodies[0];
    assert!((payload.before.mass_kg - 1.0).abs() < 1e-12, "{payload:?}");
    assert!((payload.after.mass_kg - 1.0).abs() < 1e-6, "{payload:?}");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let file = robot("ur5.toml");
    let held = measured(&file, 12, (7, 0.0));
    let few = fit(&file, &held[..POSES_MIN - 1], Unknown::Payload);
    assert_eq!(few, Err(MassFitError::TooFewPoses { got: POSES_MIN - 1 }));
    let mut broken = held.clone();
    broken[3].torque_nm[2] = f64::NAN;
    let error = fit(&file, &broken, Unknown::Links).unwrap_err();
    assert!(matches!(error, MassFitError::Implausible { pose: 3, joint: 2, what: "torque", .. }), "{error}");
    let mut massless = file.clone();
    massless.masses.clear();
    assert!(matches!(fit(&massless, &held, Unknown::Links), Err(MassFitError::NoMasses(_))));
    // All torques with the wrong sign: no body weighs less than nothing.
    let mut turned = held.clone();
    turned.iter_mut().for_each(|held| held.torque_nm = held.torque_nm.map(|nm| -nm));
    let error = fit(&file, &turned, Unknown::Payload).unwrap_err();
    assert!(matches!(error, MassFitError::Negative { mass_kg, .. } if mass_kg < -1.0), "{error}");
    let mut huge = held;
    huge.iter_mut().for_each(|held| held.torque_nm = held.torque_nm.map(|nm| nm * 1e300));
    assert!(fit(&file, &huge, Unknown::Links).is_err());
}
