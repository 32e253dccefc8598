//! `taustream calibrate gravity --from`: the fit of what was measured before.
use crate::common::{Scratch, config};
use serde_json::{Value, json};
use taustream_arm::{LinkMass, Settings};
use taustream_motion::MAX_JOINTS;

const SETTINGS: &str = "openarm-left";

/// The answer of a calibration of an arm that carries 0.8 kg which its file does not state.
#[expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]
fn measured(edit: impl Fn(usize, usize, f64) -> f64) -> Value {
    let settings = Settings::load(&config().join(format!("settings/{SETTINGS}.toml"))).unwrap();
    let mut truth = settings.robot.clone();
    let tip = *truth.masses.iter().rfind(|mass| mass.frame == 7).unwrap();
    truth.masses.push(LinkMass { mass_kg: 0.8, center_m: [0.0, 0.01, 0.06].into(), ..tip });
    let dynamics = truth.dynamics().unwrap();
    let held = (0..10_u16).map(|pose| {
        let mut q = [0.0; MAX_JOINTS];
        let joints = q.iter_mut().zip(&settings.robot.joints).enumerate();
        joints.for_each(|(j, (q, joint))| {
            let [low, high] = joint.limits.position_rad;
            let j = u16::try_from(j).unwrap();
            *q = low + (high - low) * f64::from((37 * pose + 61 * j + 13 * pose * j) % 101) / 101.0;
        });
        let torque: Vec<f64> = dynamics.holding_nm(&q)[..7].to_vec();
        let torque: Vec<f64> =
            torque.into_iter().enumerate().map(|(j, nm)| edit(usize::from(pose), j, nm)).collect();
        json!({ "q_rad": q[..7], "torque_nm": torque, "friction_nm": [0.1, 0.1, 0.1, 0.1, 0.02, 0.02, 0.02] })
    });
    let held: Vec<Value> = held.collect();
    json!({ "robot": "openarm-left", "digest": settings.robot.digest_hex(), "held": held })
}

fn from(scratch: &Scratch, held: &Value) -> String {
    scratch.write("held.json", &held.to_string()).display().to_string()
}

#[test]
fn payload_is_fitted_from_what_was_measured_before() {
    let scratch = Scratch::new();
    let file = from(&scratch, &measured(|_, _, nm| nm));
    let words = ["calibrate", "gravity", "--payload", "--from", &file, "--settings", SETTINGS];
    let text = scratch.run(&words);
    assert!(text.done().contains("mass_kg = 0.8000"), "{}", text.done());
    assert!(text.done().contains("center_m = [0.0000, 0.0100, 0.0600]"), "{}", text.done());
    assert!(!text.done().contains("NOTICE"), "{}", text.done());
    let json = scratch.run(&[&words[..], &["--json"]].concat());
    let said: Value = serde_json::from_str(json.done()).unwrap();
    assert_eq!(said["fitted"], "payload");
    assert!(said["joints"][1]["unseen_rms_nm"].as_f64().unwrap() < 1e-3, "{said}");
    // The answer can be fitted again, as what was measured.
    scratch.run(&[&words[..5], &["--settings", SETTINGS, "-o", "again.json"]].concat()).done();
    let again = scratch.run(&["calibrate", "gravity", "--from", "again.json", "--settings", SETTINGS]);
    assert!(again.done().contains("link openarm_left_link7: "), "{}", again.done());
}

/// Goal: masses that do not explain the torques are not recommended.
#[test]
fn joint_whose_torque_has_the_wrong_scale_is_named() {
    let scratch = Scratch::new();
    let file = from(&scratch, &measured(|_, joint, nm| if joint == 3 { 2.5 * nm } else { nm }));
    let ran = scratch.run(&["calibrate", "gravity", "--payload", "--from", &file, "--settings", SETTINGS]);
    assert!(ran.done().contains("NOTICE: joint openarm_left_joint4"), "{}", ran.done());
    assert!(ran.done().contains("do not use these masses"), "{}", ran.done());
}

#[test]
fn files_that_are_no_measurement_are_refused_with_the_reason() {
    let scratch = Scratch::new();
    let good = measured(|_, _, nm| nm);
    let edited = |edit: &dyn Fn(&mut Value)| {
        let mut held = good.clone();
        edit(&mut held);
        held
    };
    let cases: [(Value, i32, &str); 5] = [
        (json!([1, 2]), 2, "is no answer of"),
        (edited(&|held| held["digest"] = json!("00")), 2, "was measured on robot"),
        (edited(&|held| held["held"][2]["torque_nm"] = json!([1.0])), 2, "pose 3 has not 7 numbers"),
        (edited(&|held| held["held"] = json!([])), 1, "0 poses"),
        (edited(&|held| held["held"][1]["q_rad"][4] = json!(1e9)), 1, "pose 2: the position of joint 5"),
    ];
    for (held, code, reason) in cases {
        let file = from(&scratch, &held);
        let ran = scratch.run(&["calibrate", "gravity", "--from", &file, "--settings", SETTINGS]);
        ran.refused(code, &[reason]);
    }
    let ran = scratch.run(&["calibrate", "gravity", "--poses", "3", "--settings", SETTINGS]);
    ran.refused(2, &["4..=100"]);
    // No masses to begin with.
    let piper = scratch.run(&["calibrate", "gravity", "--settings", "piper"]);
    piper.refused(1, &["states no mass"]);
    // Nobody drives that arm.
    let idle = scratch.settings("idle");
    let absent = scratch.run(&["calibrate", "gravity", "--settings", &idle.display().to_string()]);
    absent.refused(1, &["taustream-streamer"]);
}
