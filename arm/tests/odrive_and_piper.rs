//! Bad settings of `ODrive` axes and of a Piper, and what they put on a bus.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
use std::path::{Path, PathBuf};
use taustream_arm::Settings;
use taustream_arm::protocol::odrive::Odrive;
use taustream_arm::protocol::piper::{Piper, PiperFollow};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(name)
}

fn edited(name: &str, from: &str, to: &str) -> Result<Settings, taustream_arm::Faults> {
    let text = std::fs::read_to_string(file(name)).unwrap();
    assert!(text.contains(from), "{name} has no {from:?}");
    Settings::from_toml(&file(name), &text.replacen(from, to, 1))
}

/// Each edit is refused at its key, with these words, and nothing else is.
fn refused(name: &str, cases: &[(&str, &str, &str, &str)]) {
    for (from, to, key, words) in cases {
        let faults = edited(name, from, to).map(drop).unwrap_err();
        let found = faults.0.iter().find(|fault| fault.key == *key);
        let fault = found.unwrap_or_else(|| panic!("{from:?} -> {to:?}: no fault at {key}, but {faults}"));
        assert!(fault.to_string().contains(words), "{from:?} -> {to:?}: {fault}");
    }
}

#[test]
fn odrive_settings_say_what_the_drive_must_state() {
    let settings = Settings::load(&file("odrive6.toml")).unwrap_or_else(|faults| panic!("{faults}"));
    let odrive = settings.servos[0].protocol.get::<Odrive>().unwrap();
    assert_eq!((odrive.hardware, odrive.firmware, odrive.watchdog_ms), ([4, 4, 58], [0, 6, 10], 100));
    assert_eq!(odrive.endpoints.map(|endpoints| endpoints.velocity_limit), Some(388));
    assert!(settings.servos[0].protocol.sentence().contains("limp after 100 ms"));
}

#[test]
fn bad_odrive_settings_are_refused_at_their_key() {
    refused(
        "odrive6.toml",
        &[
            ("protocol = \"odrive\"", "protocol = \"cia402\"", "servo[0].hardware", "no such key"),
            ("node_id = 3", "node_id = 63", "servo[2].node_id", "from 0 to 62"),
            ("node_id = 3", "node_id = 2", "servo[2].node_id", "each node id once on a bus"),
            ("hardware = \"4.4.58\"", "hardware = \"4.4\"", "servo[0].hardware", "three numbers"),
            ("hardware = \"4.4.58\"", "hardware = \"4.4.256\"", "servo[0].hardware", "three numbers"),
            ("hardware = \"4.4.58\"", "", "servo[0].hardware", "missing"),
            ("firmware = \"0.6.10\"", "firmware = \"0.5.6\"", "servo[0].firmware", "a firmware 0.6"),
            ("firmware = \"0.6.10\"", "", "servo[0].firmware", "missing"),
            ("gear_ratio = 20.0", "gear_ratio = 0", "servo[0].gear_ratio", "above 0"),
            ("gear_ratio = 20.0", "gear_ratio = 100.0", "servo[0].gear_ratio", "32.767 turns/s"),
            ("gear_ratio = 20.0", "gear_ratio = 20000.0", "servo[0].gear_ratio", "8192 turns"),
            ("encoder_period_ms = 5", "encoder_period_ms = 26", "servo[0].encoder_period_ms", "at most half"),
            (
                "encoder_period_ms = 5",
                "encoder_period_ms = 0",
                "servo[0].encoder_period_ms",
                "from 1 to 1000",
            ),
            (
                "drive_timeout_s = 5.0",
                "drive_timeout_s = 0.4",
                "servo[0].heartbeat_period_ms",
                "at most a fifth of supervision.drive_timeout_s",
            ),
            ("watchdog = \"written\"", "watchdog = \"none\"", "servo[0].watchdog", "\"owner\""),
            (
                "watchdog = \"written\"",
                "watchdog = \"owner\"",
                "servo[0].endpoint_enable_watchdog",
                "no such key",
            ),
            ("watchdog = \"written\"", "", "servo[0].watchdog", "missing"),
            ("endpoint_velocity_limit = 388", "", "servo[0].endpoint_velocity_limit", "missing"),
            (
                "endpoint_velocity_limit = 388",
                "endpoint_velocity_limit = 65536",
                "servo[0].endpoint_velocity_limit",
                "from 1 to 65535",
            ),
            (
                "\nwatchdog_ms = 100",
                "\nwatchdog_ms = 99",
                "servo[0].watchdog_ms",
                "at least cycle.drive_watchdog_ms",
            ),
            (
                "reaction = \"limp\"",
                "reaction = \"hold\"",
                "servo[0].reaction",
                "a odrive servo knows no other",
            ),
        ],
    );
}

#[test]
fn watchdog_of_the_owner_takes_no_endpoints_and_check_says_that_nobody_looks() {
    let text = std::fs::read_to_string(file("odrive6.toml")).unwrap();
    let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with("endpoint_")).collect();
    let text = lines.join("\n").replace("watchdog = \"written\"", "watchdog = \"owner\"");
    let settings =
        Settings::from_toml(&file("odrive6.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"));
    assert!(settings.servos[0].protocol.sentence().contains("this software does not look"));
}

#[test]
fn piper_settings_are_one_arm() {
    let settings = Settings::load(&file("piper.toml")).unwrap_or_else(|faults| panic!("{faults}"));
    let piper = settings.servos[5].protocol.get::<Piper>().unwrap();
    assert_eq!((piper.firmware, piper.speed_percent, piper.follow), (*b"S-V1.6-3", 100, PiperFollow::Fast));
    assert!(settings.servos[0].protocol.sentence().contains("falls when it is disabled"));
}

#[test]
fn bad_piper_settings_are_refused_at_their_key() {
    refused(
        "piper.toml",
        &[
            ("node_id = 3", "node_id = 7", "servo[2].node_id", "from 1 to 6"),
            ("node_id = 3", "node_id = 2", "servo[2].node_id", "each node id once on a bus"),
            ("firmware = \"S-V1.6-3\"", "firmware = \"V1.6-3\"", "servo[0].firmware", "eight characters"),
            (
                "firmware = \"S-V1.6-3\"",
                "firmware = \"S-V1.6-\u{e9}\"",
                "servo[0].firmware",
                "eight characters",
            ),
            ("firmware = \"S-V1.6-3\"", "", "servo[0].firmware", "missing"),
            ("speed_percent = 100", "speed_percent = 0", "servo[0].speed_percent", "from 1 to 100"),
            ("speed_percent = 100", "speed_percent = 50", "servo[1].protocol", "they are one arm"),
            ("follow = \"fast\"", "follow = \"mit\"", "servo[0].follow", "\"smooth\""),
            (
                "reaction = \"hold\"",
                "reaction = \"limp\"",
                "servo[0].reaction",
                "a piper servo knows no other",
            ),
            ("sign = 1\n", "sign = 1\ngear_ratio = 2.0\n", "servo[0].gear_ratio", "no such key"),
        ],
    );
}

/// The arm's frames hold targets of joints in pairs: a joint that another bus has, or nobody, leaves a hole in them.
#[test]
fn piper_of_which_a_joint_is_elsewhere_is_refused() {
    let second =
        "[[bus]]\nname = \"other\"\ninterface = \"can1\"\nbitrate_bit_s = 1000000\n\n# One controller";
    let text = std::fs::read_to_string(file("piper.toml")).unwrap().replacen("# One controller", second, 1);
    let (before, last) = text.rsplit_once("bus = \"arm\"").unwrap();
    let faults =
        Settings::from_toml(&file("piper.toml"), &format!("{before}bus = \"other\"{last}")).unwrap_err();
    assert!(faults.to_string().contains("5 of its joints on this bus"), "{faults}");
}
