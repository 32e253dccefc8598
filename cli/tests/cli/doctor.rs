//! `taustream doctor` on the computer that runs the tests, whatever that is: its grades are its own, its form is not.
use crate::common::{Ran, Scratch};

fn run(scratch: &Scratch, words: &str) -> Ran {
    scratch.run(&words.split(' ').collect::<Vec<_>>())
}

#[test]
fn doctor_grades_this_computer_and_ends_with_1_on_a_problem() {
    let scratch = Scratch::new();
    let ran = run(&scratch, "doctor --seconds 0.3 --json");
    let d: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    let problems = d["problems"].as_u64().unwrap();
    assert_eq!(ran.code, Some(i32::from(problems > 0)), "{}", ran.out);
    assert_eq!(d["grade"] == "problem", problems > 0, "{}", ran.out);
    assert!(d["latency"]["lateness"]["count"].as_u64().is_some_and(|n| n >= 250), "{}", d["latency"]);
    let binned: u64 =
        d["latency"]["histogram"].as_array().unwrap().iter().filter_map(|b| b["count"].as_u64()).sum();
    assert_eq!(Some(binned), d["latency"]["lateness"]["count"].as_u64(), "every wake-up is in one bin");
    for finding in d["findings"].as_array().unwrap() {
        let needs_remedy = matches!(finding["grade"].as_str(), Some("warning" | "problem"));
        assert_eq!(finding["cure"].is_string(), needs_remedy, "{finding}");
    }
    if problems > 0 {
        let error: serde_json::Value = serde_json::from_str(&ran.err).unwrap();
        assert_eq!(error["error"]["kind"], "failed");
    }
}

#[test]
fn doctor_says_that_it_is_no_safety_function_and_what_was_not_measured() {
    let scratch = Scratch::new();
    let ran = run(&scratch, "doctor --seconds 0");
    for word in ["not a safety function", "not measured", "kernel", "memory lock", "wake-up latency"] {
        assert!(ran.out.contains(word), "no `{word}`: {}", ran.out);
    }
}

#[test]
fn doctor_refuses_what_it_cannot_use() {
    let scratch = Scratch::new();
    scratch.write("broken.toml", "name = 5\n");
    run(&scratch, "doctor --settings broken.toml").refused(2, &["broken.toml", "name"]);
    run(&scratch, "doctor --seconds -1").refused(2, &["--seconds"]);
    run(&scratch, "doctor --seconds nan").refused(2, &["--seconds"]);
    run(&scratch, "doctor --priority 100").refused(2, &["--priority"]);
}
