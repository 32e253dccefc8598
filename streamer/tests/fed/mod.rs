//! The shipped arm of Damiao motors with masses that its motors can carry, and torques beside its positions.
use crate::arm::{Arm, shipped};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use taustream_arm::{Robot, Settings};

/// Share of the UR5's masses: a light arm's.
const LIGHT: f64 = 0.25;
/// Joints, greatest torque and rate.
pub(crate) const JOINTS: [(&str, f64, f64); 6] = [
    ("shoulder_pan", 30.0, 60.0),
    ("shoulder_lift", 30.0, 60.0),
    ("elbow", 30.0, 60.0),
    ("wrist_1", 8.0, 15.0),
    ("wrist_2", 8.0, 15.0),
    ("wrist_3", 8.0, 15.0),
];

fn config(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config").join(file)
}

/// The UR5 with a light arm's masses and a payload of so many kg.
pub(crate) fn light_robot(payload_kg: f64) -> String {
    let shipped = std::fs::read_to_string(config("robots/ur5.toml")).unwrap();
    let mut text = String::new();
    for line in shipped.lines() {
        match line.strip_prefix("link_mass_kg = ") {
            Some(mass) => writeln!(text, "link_mass_kg = {}", LIGHT * mass.parse::<f64>().unwrap()),
            None => writeln!(text, "{line}"),
        }
        .unwrap();
    }
    format!("payload = {{ mass_kg = {payload_kg:?}, center_m = [0.0, 0.0, 0.05] }}\n{text}")
}

/// A section for all joints, with friction as the simulated joints have it and rates times `hurry`.
pub(crate) fn section(inertia: bool, hurry: f64) -> String {
    let mut text = format!("[feed_forward]\ngravity = true\ninertia = {inertia}\nshare = 1.0\n");
    for (at, (joint, torque_nm_max, rate_nm_s)) in JOINTS.iter().enumerate() {
        let (coulomb, viscous) = if at < 3 { (0.3, 1.0) } else { (0.05, 0.1) };
        let rate_nm_s_max = hurry * rate_nm_s;
        writeln!(
            text,
            "[[feed_forward.joint]]\njoint = \"{joint}\"\ntorque_nm_max = {torque_nm_max:?}\nrate_nm_s_max = {rate_nm_s_max:?}\n\
             coulomb_nm = {coulomb:?}\nviscous_nm_s_rad = {viscous:?}"
        )
        .unwrap();
    }
    text
}

/// Settings of the light arm, as whoever wrote them believes it to be, with this section before `[cycle]`.
pub(crate) fn settings(name: &str, payload_kg: f64, section: &str) -> Settings {
    let robot = std::env::temp_dir().join(format!("taustream-{name}-{}.toml", std::process::id()));
    std::fs::write(&robot, light_robot(payload_kg)).unwrap();
    let edit = |text: &str| {
        let text = text.replacen("../robots/ur5.toml", robot.to_str().unwrap(), 1);
        text.replacen("[cycle]", &format!("{section}[cycle]"), 1)
    };
    let settings = shipped("damiao6.toml", edit);
    std::fs::remove_file(robot).unwrap();
    settings
}

/// That arm in the simulator, on whose joints its true masses act.
pub(crate) fn arm(name: &str, settings: Settings, true_payload_kg: f64) -> Arm {
    let truth = Robot::from_toml(Path::new("light.toml"), &light_robot(true_payload_kg));
    let masses = truth.unwrap_or_else(|faults| panic!("{faults}")).dynamics().unwrap();
    let mut arm = Arm::new(name, settings);
    arm.simulator.simulator = arm.simulator.simulator.clone().with_masses(masses).unwrap();
    arm
}
