//! Feed-forward torques against the robot whose masses make them.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
use std::path::{Path, PathBuf};
use taustream_arm::{Faults, Settings};

const SECTION: &str = "[feed_forward]\ngravity = true\ninertia = false\nshare = 0.9\n[[feed_forward.joint]]\njoint = \"elbow\"\n\
    torque_nm_max = 20.0\nrate_nm_s_max = 50.0\ncoulomb_nm = 0.3\n[cycle]";

fn config(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config").join(file)
}

/// The shipped Damiao arm with edits of its settings, and a robot file of its own where that is edited.
fn damiao(name: &str, settings: &[(&str, &str)], robot: impl Fn(&str) -> String) -> Result<Settings, Faults> {
    let folder = std::env::temp_dir().join(format!("taustream-feed-forward-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let text = |file: &str| std::fs::read_to_string(config(file)).expect("shipped");
    std::fs::write(folder.join("robot.toml"), robot(&text("robots/ur5.toml"))).expect("written");
    let mut all = text("settings/damiao6.toml");
    let scene = config("scenes/pillars.toml");
    let files =
        [("../robots/ur5.toml", "robot.toml"), ("../scenes/pillars.toml", scene.to_str().expect("UTF-8"))];
    for (from, to) in files.iter().chain(settings) {
        assert!(all.contains(from), "no {from:?}");
        all = all.replacen(from, to, 1);
    }
    let read = Settings::from_toml(&folder.join("arm.toml"), &all);
    std::fs::remove_dir_all(&folder).expect("removed");
    read
}

fn refused(name: &str, settings: &[(&str, &str)], robot: impl Fn(&str) -> String) -> String {
    match damiao(name, settings, robot) {
        Err(faults) => faults.to_string(),
        Ok(_) => panic!("{name} was taken"),
    }
}

fn without_masses(text: &str) -> String {
    let weighs = |line: &&str| line.starts_with("link_mass_kg") || line.starts_with("link_center_m");
    text.lines().filter(|line| !weighs(line)).map(|line| format!("{line}\n")).collect()
}

#[test]
fn section_is_read_joint_by_joint() {
    let settings =
        damiao("read", &[("[cycle]", SECTION)], str::to_owned).unwrap_or_else(|faults| panic!("{faults}"));
    let read = settings.feed_forward.expect("the section");
    assert!(read.gravity && !read.inertia && (read.share - 0.9).abs() < 1e-15);
    let elbow = read.joints[2].expect("the elbow");
    let numbers = [elbow.torque_nm_max, elbow.rate_nm_s_max, elbow.coulomb_nm, elbow.viscous_nm_s_rad];
    assert_eq!(numbers.map(f64::to_bits), [20.0, 50.0, 0.3, 0.0].map(f64::to_bits));
    assert_eq!(read.joints.iter().flatten().count(), 1);
    assert_eq!(damiao("none", &[], str::to_owned).expect("shipped").feed_forward, None);
}

#[test]
fn torque_from_masses_that_are_not_known_or_plainly_wrong_is_refused() {
    let words = refused("massless", &[("[cycle]", SECTION)], without_masses);
    assert!(words.contains("feed_forward.gravity") && words.contains("states no mass"), "{words}");
    let light = |text: &str| text.replace("link_mass_kg = 8.393", "link_mass_kg = 0.0");
    let words = refused("light", &[("[cycle]", SECTION)], light);
    assert!(words.contains("feed_forward.gravity") && words.contains("masses INCOMPLETE"), "{words}");
    let inertia = SECTION.replace("gravity = true\ninertia = false", "gravity = false\ninertia = true");
    let words = refused("inertia", &[("[cycle]", &inertia)], without_masses);
    assert!(words.contains("feed_forward.inertia") && words.contains("states no mass"), "{words}");
    // Friction alone needs no masses.
    let friction = SECTION.replace("gravity = true", "gravity = false");
    damiao("friction", &[("[cycle]", &friction)], without_masses).unwrap_or_else(|faults| panic!("{faults}"));
}

#[test]
fn motor_in_a_mode_without_torque_is_refused() {
    let elbow = "mode = \"mit\"\nposition_range_rad = 12.5\nvelocity_range_rad_s = 45.0\ntorque_range_nm = 54.0\nwatchdog_ms = 100\n\
        stiffness_nm_rad = 400.0\ndamping_nm_s_rad = 5.0\ngain_ramp_ms = 200";
    let pos_vel = "mode = \"pos_vel\"\nposition_range_rad = 12.5\nvelocity_range_rad_s = 45.0\ntorque_range_nm = 54.0\nwatchdog_ms = 100";
    let pan = SECTION.replace("\"elbow\"", "\"shoulder_pan\"");
    let words = refused("pos-vel", &[("[cycle]", &pan), (elbow, pos_vel)], str::to_owned);
    assert!(words.contains("feed_forward.joint[0].joint") && words.contains("mode \"mit\""), "{words}");
}

/// Goal: a planner with other masses or another gravity than the streamer's is refused, and files run as before.
#[test]
fn digest_of_messages_covers_the_torque_model_only_with_the_section() {
    let plain = damiao("plain", &[], str::to_owned).expect("shipped").robot;
    let fed = damiao("fed", &[("[cycle]", SECTION)], str::to_owned).expect("good").robot;
    assert_eq!((plain.message_digest, fed.digest), (plain.digest, plain.digest));
    assert_ne!(fed.message_digest, plain.message_digest);
    let on_a_wall = |text: &str| format!("gravity_m_s2 = [9.8, 0.0, 0.0]\n{text}");
    let turned = damiao("wall", &[("[cycle]", SECTION)], on_a_wall).expect("good").robot;
    assert_eq!(turned.digest, plain.digest);
    assert_ne!(turned.message_digest, fed.message_digest);
    let heavier = |text: &str| text.replacen("link_mass_kg = 2.33", "link_mass_kg = 2.34", 1);
    let heavy = damiao("heavy", &[("[cycle]", SECTION)], heavier).expect("good").robot;
    assert!(heavy.digest != plain.digest && heavy.message_digest != fed.message_digest);
}
