//! The JSON answers beside the page that documents them, and text that a terminal must not get.
#![expect(clippy::unwrap_used, clippy::panic, reason = "helpers of a test fail by panicking")]
use crate::common::{HOME, Scratch, stroke, trajectory};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The keys that docs/json.md states for a heading.
fn documented(heading: &str) -> BTreeSet<String> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/json.md");
    let page = fs::read_to_string(page).unwrap();
    let section = page.split("\n## ").find(|section| section.lines().next() == Some(heading));
    let section = section.unwrap_or_else(|| panic!("docs/json.md has no section {heading:?}"));
    let line = section.lines().find_map(|line| line.strip_prefix("Keys: ")).unwrap();
    line.split(' ').map(|word| word.trim_matches('`').to_owned()).collect()
}

fn keys(value: &serde_json::Value) -> BTreeSet<String> {
    value.as_object().unwrap().keys().cloned().collect()
}

#[test]
fn answers_have_the_keys_of_the_page_and_a_schema() {
    let scratch = Scratch::new();
    scratch.write("move.json", &trajectory(&stroke("10", "0", "0.1")));
    scratch.write("move.csv", &scratch.run(&["sample", "move.json", "--rate-hz", "50"]).out.clone());
    scratch.write("balls.toml", "[[sphere]]\ncenter_m = [0.9, 0.9, 0.9]\nradius_m = 0.1\n");
    let cases: &[(&str, &[&str])] = &[
        (
            "plan",
            &[
                "plan",
                "--robot",
                "ur5",
                "--scene",
                "open",
                "--start",
                HOME,
                "--goal",
                "0.1,-1.57,1.57,-1.57,-1.57,0",
            ],
        ),
        ("import", &["import", "move.csv", "--robot", "ur5", "--scene", "open"]),
        ("sample", &["sample", "move.json", "--at", "0"]),
        ("plot", &["plot", "move.json"]),
        ("cost", &["cost", "move.json", "--scene", "balls.toml"]),
        ("verify", &["verify", "move.json", "--scene", "open"]),
        ("check, a trajectory", &["check", "move.json"]),
        ("check, a scene", &["check", "pillars"]),
        ("check, a robot", &["check", "ur5"]),
        ("check, settings", &["check", "vcan6"]),
        ("doctor", &["doctor", "--seconds", "0"]),
        ("man, completions", &["man"]),
        ("man, completions", &["completions", "bash"]),
    ];
    for (heading, words) in cases {
        let ran = scratch.run(&[words, &["--json"][..]].concat());
        // `doctor` may find problems on this computer, and says so by its exit code.
        let answer: serde_json::Value =
            serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{heading}: {e}: {}", ran.err));
        assert_eq!(answer["schema"], 1, "{heading}");
        assert_eq!(keys(&answer), documented(heading), "{heading}");
    }
    let refused = scratch.run(&["check", "nothing", "--json"]);
    let error: serde_json::Value = serde_json::from_str(&refused.err).unwrap();
    assert_eq!((keys(&error), &error["schema"]), (documented("error"), &1.into()));
    assert!(!documented("status and watch").is_empty());
}

/// The robot that a trajectory names serves when none is given; what it names is never taken for a path.
#[test]
fn trajectory_names_its_robot_and_degrees_have_their_unit() {
    let scratch = Scratch::new();
    scratch.write("move.json", &trajectory(&stroke("10", "0", "0.1")));
    let plain = scratch
        .run(&["verify", "--robot", "ur5", "--scene", "open", "--trajectory", "move.json"])
        .done()
        .to_owned();
    assert_eq!(scratch.run(&["verify", "move.json", "--scene", "open"]).done(), plain);
    scratch.run(&["plot", "--trajectory", "move.json"]).done();
    let svg = fs::read_to_string(scratch.dir.join("move.svg")).unwrap();
    scratch.run(&["plot", "move.json", "--robot", "ur5", "-o", "other.svg"]).done();
    assert_eq!(fs::read_to_string(scratch.dir.join("other.svg")).unwrap(), svg, "limits and views are drawn");
    let elsewhere = trajectory(&stroke("10", "0", "0.1")).replace("\"ur5\"", "\"../ur5\"");
    scratch.write("path.json", &elsewhere);
    scratch.run(&["verify", "path.json", "--scene", "open"]).refused(2, &["path.json", "robot = \"../ur5\""]);
    scratch.write("none.json", &elsewhere.replace("../ur5", "nobody"));
    scratch.run(&["verify", "none.json", "--scene", "open"]).refused(2, &["nobody", "--robot"]);

    let plan = |words: &[&str]| {
        let words = [&["plan", "--robot", "ur5", "--scene", "open"], words, &["-o", "-"]].concat();
        scratch.run(&words).done().to_owned()
    };
    let degrees = plan(&["--start-deg", "0,-90,90,-90,-90,0", "--goal-deg", "10,-90,90,-90,-90,0"]);
    let mixed =
        plan(&["--start", "0,-90deg,90deg,-90deg,-90deg,0", "--goal", "10deg,-90deg,90deg,-90deg,-90deg,0"]);
    assert_eq!(degrees, mixed);
    scratch
        .run(&[
            "plan",
            "--robot",
            "ur5",
            "--scene",
            "open",
            "--start",
            HOME,
            "--goal",
            HOME,
            "--goal-deg",
            "0",
        ])
        .refused(2, &["--goal-deg"]);
}

/// Names in files and words on the command line may hold anything; a terminal gets no control character of them.
#[test]
fn no_control_character_of_a_file_or_word_reaches_the_terminal() {
    let scratch = Scratch::new();
    let evil = "\u{1b}]0;x\u{7}\u{1b}[2J\u{9b}31m\u{202e}";
    let json = serde_json::to_string(evil).unwrap();
    let file = trajectory(&stroke("10", "0", "0.1")).replace("\"ur5\"", &json);
    scratch.write("evil.json", &file);
    scratch.write("evil.toml", &format!("{evil} = 1\n"));
    scratch.write("evil.csv", &format!("t_s,q1_rad,{evil}\n0,0,0\n1,{evil},0\n"));
    let named = format!("no{evil}such");
    let cases: &[&[&str]] = &[
        &["check", "evil.json"],
        &["check", "evil.json", "--json"],
        &["check", "evil.toml"],
        &["check", "evil.toml", "--json"],
        &["sample", "evil.json", "--at", "0", "--json"],
        &["verify", "evil.json", "--scene", "open"],
        &["plot", "evil.json", "-o", "-"],
        &["plot", "evil.json", "--json"],
        &["import", "evil.csv", "--robot", "ur5", "--scene", "open"],
        &["check", &named],
        &["check", &named, "--json"],
        &[&named],
        &["status", "--settings", &named],
        &["plan", "--robot", &named, "--scene", "open", "--start", &named, "--goal", HOME],
    ];
    for words in cases {
        let ran = scratch.run(words);
        for (stream, text) in [("stdout", &ran.out), ("stderr", &ran.err)] {
            let obeyed = text.chars().find(|c| (c.is_control() && !"\n\t".contains(*c)) || *c == '\u{202e}');
            assert_eq!(obeyed, None, "`{}` on {stream}: {text:?}", ran.words.escape_debug());
        }
        assert!(!ran.out.is_empty() || !ran.err.is_empty(), "{}", ran.words.escape_debug());
    }
}

/// A file in the working directory is taken by its path only, and shipped files are there from anywhere.
#[test]
fn nothing_in_the_working_directory_is_taken_in_silence() {
    let scratch = Scratch::new();
    fs::create_dir_all(scratch.dir.join("config/robots")).unwrap();
    for place in ["config/robots/ur5.toml", "ur5"] {
        fs::write(scratch.dir.join(place), "name = \"trap\"\n").unwrap();
    }
    let check = |words: &[&str]| {
        let mut command = scratch.command(words);
        command.env_remove("TAUSTREAM_CONFIG_DIR");
        crate::common::Ran::of(words, command.output().unwrap())
    };
    for (name, words) in [("ur5", "robot ur5"), ("vcan6", "settings vcan6"), ("pillars", "scene")] {
        let ran = check(&["check", name]);
        assert!(ran.done().contains(words) && ran.out.trim_end().ends_with("no faults"), "{}", ran.out);
    }
    check(&["check", "./ur5"]).refused(2, &["./ur5", "REFUSED"]);
    check(&["check", "config/robots/ur5.toml"]).refused(2, &["config/robots/ur5.toml", "REFUSED"]);
}
