//! Buses in `taustream check`: the table, the result, the remedies.
#![expect(clippy::expect_used, reason = "helpers of tests fail by panicking")]
use crate::common::{Scratch, config};

/// The shipped six servos on one bus that `keys` describe; its file names robot and scene by whole paths.
fn one_bus(scratch: &Scratch, keys: &str) -> String {
    let text = std::fs::read_to_string(config().join("settings/vcan6.toml")).expect("shipped settings");
    assert!(text.contains("virtual = true"));
    let text = text.replace("virtual = true", keys).replace("\"../", &format!("\"{}/", config().display()));
    scratch.write("one.toml", &text).display().to_string()
}

#[test]
fn overloaded_bus_is_refused_with_its_table_and_remedies() {
    let scratch = Scratch::new();
    let file = one_bus(&scratch, "bitrate_bit_s = 1000000");
    let text = scratch.run(&["check", &file]);
    assert_eq!(text.code, Some(2), "{}", text.err);
    for word in ["REFUSED", "144.0 %", "2 buses", "74.8 %", "packed = true", "the simulator models 1 Mbit/s"]
    {
        assert!(text.out.contains(word), "no `{word}`: {}", text.out);
    }
    assert!(text.err.contains("bus[0] = 144.0 % full in the worst case"), "{}", text.err);
    let json: serde_json::Value =
        serde_json::from_str(scratch.run(&["check", &file, "--json"]).out.trim()).unwrap();
    let bus = &json["buses"][0];
    assert_eq!(bus["verdict"], "refused");
    let near = |value: &serde_json::Value, want: f64| value.as_f64().is_some_and(|v| (v - want).abs() < 1e-9);
    assert!(near(&bus["load_percent"], 143.955), "{bus}");
    let sync = &bus["frames"][0];
    assert_eq!((sync["what"].as_str(), sync["nominal_bits"].as_u64()), (Some("SYNC"), Some(55)), "{bus}");
    let ways = bus["ways_out"].as_array().unwrap();
    assert!(ways.iter().any(|way| way["suffices"] == true && near(&way["load_percent"], 74.76)), "{bus}");
}

#[test]
fn bus_with_high_load_is_warned_of_and_one_with_low_load_is_not() {
    let scratch = Scratch::new();
    let file = one_bus(&scratch, "bitrate_bit_s = 1000000\npacked = true\nfeedback_every = 2");
    let warned = scratch.run(&["check", &file]);
    assert!(warned.done().contains("86.6 % in the worst case"), "{}", warned.out);
    assert!(warned.out.contains("WARNING, above 80 %") && warned.out.contains("remedies"), "{}", warned.out);
    for shipped in ["dual-bus", "one-bus"] {
        let fits = scratch.run(&["check", shipped]);
        assert!(!fits.done().contains("remedies"), "{}", fits.out);
        assert!(fits.out.contains("no faults"), "{}", fits.out);
    }
}

/// Whoever reads the first line knows what is wrong, and whoever reads the last one that it was refused.
#[test]
fn check_begins_with_the_faults_and_ends_with_the_verdict() {
    let scratch = Scratch::new();
    let file = one_bus(&scratch, "bitrate_bit_s = 1000000");
    let both = scratch.dir.join("both");
    let to = std::fs::File::create(&both).unwrap();
    scratch.command(&["check", &file]).stdout(to.try_clone().unwrap()).stderr(to).status().unwrap();
    let said = std::fs::read_to_string(&both).unwrap();
    let [first, .., last] = said.trim_end().lines().collect::<Vec<_>>()[..] else { panic!("{said}") };
    assert!(first.contains("bus[0] = 144.0 % full in the worst case"), "{said}");
    assert!(last.contains("REFUSED: 1 fault(s), listed first"), "{said}");
}
