//! The load of the buses of settings: what is refused, what is warned of, and the remedies.
#![expect(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail by panicking")]
use std::path::{Path, PathBuf};
use taustream_arm::Settings;

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml")
}

/// The shipped six servos with their bus described by `bus`.
fn text_with(bus: &str) -> String {
    let text = std::fs::read_to_string(file()).unwrap();
    assert!(text.contains("virtual = true"));
    text.replace("virtual = true", bus)
}

fn load_of(bus: &str) -> taustream_arm::BusLoad {
    let settings = Settings::from_toml(&file(), &text_with(bus)).unwrap_or_else(|faults| panic!("{faults}"));
    settings.bus_load(0).unwrap()
}

#[test]
fn six_servos_at_1_khz_are_refused_on_one_classic_bus_with_what_would_do() {
    let faults = Settings::from_toml(&file(), &text_with("bitrate_bit_s = 1000000")).unwrap_err().to_string();
    // 143.5 % of process data, and 7 heartbeats of 65 bits every 100 ms.
    for words in ["bus[0] = 144.0 % full in the worst case", "by 2 buses, at most 3 servos on each"] {
        assert!(faults.contains(words), "{faults}");
    }
}

#[test]
fn slower_cycle_and_rarer_frames_bring_six_servos_onto_one_bus() {
    let slower = text_with("bitrate_bit_s = 1000000").replace("period_us = 1000", "period_us = 2000");
    let slower = Settings::from_toml(&file(), &slower).unwrap().bus_load(0).unwrap();
    assert!((slower.percent - 71.75 - 0.455).abs() < 1e-9, "{slower:?}");
    assert!(!slower.is_warned());
    let packed = load_of("bitrate_bit_s = 1000000\npacked = true\nfeedback_every = 2");
    // SYNC 55, 3 x 135, 6 x 115 / 2; heartbeats; six controlwords of 75 bits in every eighth cycle.
    assert!((packed.percent - 80.5 - 0.455 - 5.625).abs() < 1e-9, "{packed:?}");
    assert!(packed.is_warned() && !packed.is_refused());
    let rare = load_of("bitrate_bit_s = 1000000\nsetpoint_every = 2\nstagger = true\nfeedback_every = 2");
    assert!((rare.percent - 5.5 - 34.5 - 34.5 - 0.455).abs() < 1e-9, "{rare:?}");
    assert!(rare.fullest_cycle_percent > 100.0, "all six may answer the same SYNC: {rare:?}");
}

#[test]
fn virtual_bus_is_never_refused_but_measured_against_a_usual_one() {
    let load = load_of("virtual = true");
    assert!(load.is_virtual && !load.is_refused() && !load.is_warned());
    assert!((load.percent - 143.955).abs() < 1e-9, "{load:?}");
}

#[test]
fn remedies_state_the_load_that_the_settings_then_have() {
    let settings = Settings::load(&file()).unwrap();
    let remedies = settings.remedies(0);
    for (what, bus) in [
        ("packed = true", "virtual = true\npacked = true"),
        ("feedback_every = 2", "virtual = true\nfeedback_every = 2"),
        ("setpoint_every = 2", "virtual = true\nsetpoint_every = 2"),
        ("packed = true and feedback_every = 2", "virtual = true\npacked = true\nfeedback_every = 2"),
    ] {
        let remedy = remedies
            .iter()
            .find(|remedy| remedy.what == what)
            .unwrap_or_else(|| panic!("no {what}: {remedies:?}"));
        assert!((remedy.percent - load_of(bus).percent).abs() < 1e-9, "{remedy:?}");
    }
    let two = remedies.iter().find(|remedy| remedy.what.starts_with("2 buses")).unwrap();
    assert!((two.percent - 74.5 - 0.26).abs() < 1e-9 && two.suffices, "{two:?}");
    assert_eq!(settings.bus_load(7), None);
    assert!(settings.remedies(7).is_empty());
}

/// The faults of a text, which has some.
fn faults_of(file: &Path, text: &str) -> String {
    Settings::from_toml(file, text).unwrap_err().to_string()
}

#[test]
fn rare_setpoints_and_answers_must_fit_the_watchdogs_and_the_supervision() {
    let edited = |bus: &str, from: &str, to: &str| {
        let text = text_with(bus);
        assert!(text.contains(from), "no `{from}`");
        text.replace(from, to)
    };
    let slow =
        edited("virtual = true\nsetpoint_every = 10", "drive_watchdog_ms = 100", "drive_watchdog_ms = 11");
    let slow = slow.replace("stall_resume_ms = 20", "stall_resume_ms = 5");
    let said = faults_of(&file(), &slow);
    assert!(said.contains("bus[0].setpoint_every = 10") && said.contains("now 11 ms"), "{said}");
    let late = edited(
        "virtual = true\nfeedback_every = 10",
        "feedback_age_s_max = 0.05",
        "feedback_age_s_max = 0.01",
    );
    let said = faults_of(&file(), &late);
    assert!(said.contains("bus[0].feedback_every = 10") && said.contains("0.011 s or more"), "{said}");
}

#[test]
fn one_servo_alone_shares_no_frame() {
    let two = file().with_file_name("dual-bus.toml");
    let mut text = std::fs::read_to_string(&two).unwrap();
    for (from, to) in [
        ("bus = \"wrist\"\nnode_id = 1\n", "bus = \"base\"\nnode_id = 4\n"),
        ("bus = \"wrist\"\nnode_id = 2\n", "bus = \"base\"\nnode_id = 5\n"),
        ("interface = \"vcan0\"\nbitrate_bit_s = 1000000", "interface = \"vcan0\"\nvirtual = true"),
        ("interface = \"vcan1\"\n", "interface = \"vcan1\"\npacked = true\n"),
    ] {
        assert!(text.contains(from), "no `{from}`");
        text = text.replace(from, to);
    }
    let said = faults_of(&two, &text);
    assert!(said.contains("bus[1].packed = true") && said.contains("two servos on the bus"), "{said}");
}
