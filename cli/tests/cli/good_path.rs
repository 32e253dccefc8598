//! What users do every day: plan, check, sample, verify, rate.
use crate::common::{HOME, Scratch, config, stroke, trajectory};
use std::fs;

const GOAL: &str = "1.0,-1.2,1.3,-1.6,-1.57,0.4";

fn planned(scratch: &Scratch) -> serde_json::Value {
    let words = [
        "plan",
        "--robot",
        "ur5",
        "--scene",
        "open",
        "--start",
        HOME,
        "--goal",
        GOAL,
        "-o",
        "move.json",
        "--json",
    ];
    scratch.run(&words).json()
}

/// The answer and the refusal both say what was tried and how long it took.
#[test]
fn plan_explains_its_stages() {
    let scratch = Scratch::new();
    let explained = |more: &[&str]| {
        let ends = ["--start", "-0.5,-0.7,0.7,-1.57,-1.57,0", "--goal", "0.5,-0.7,0.7,-1.57,-1.57,0"];
        let words = ["plan", "--robot", "ur5", "--scene", "pillars", "--explain"];
        scratch.run(&[&words, ends.as_slice(), more].concat())
    };
    let ran = explained(&[]);
    let found = ran.done();
    for words in [
        " ms  bodies and pairs",
        "straight line (blocked: link3 and front_pillar)",
        "RRT-Connect (",
        "; best motion ",
    ] {
        assert!(found.contains(words), "{words}: {found}");
    }
    explained(&["--planner", "straight"])
        .refused(1, &["no path found", " ms  straight line (blocked: link3 and front_pillar)"]);
}

#[test]
fn plan_writes_a_file_that_verifies_and_ends_at_the_goal() {
    let scratch = Scratch::new();
    let summary = planned(&scratch);
    for key in ["duration_s", "strokes", "clearance_m", "planner", "planning_s", "digest", "peak_use"] {
        assert!(!summary[key].is_null(), "no {key}: {summary}");
    }
    assert_eq!(scratch.files().len(), 1, "only the trajectory: {:?}", scratch.files());
    for peak in summary["peak_use"].as_array().expect("one entry a joint") {
        for key in ["velocity_percent", "acceleration_percent", "jerk_percent"] {
            let percent = peak[key].as_f64().expect("a number");
            assert!((0.0..=100.1).contains(&percent), "{key}: {peak}");
        }
    }

    let verify = ["verify", "--robot", "ur5", "--scene", "open", "--trajectory", "move.json", "--json"];
    let proof = scratch.run(&verify).json();
    assert_eq!(proof["verified"], true);
    assert_eq!(proof["duration_s"], summary["duration_s"]);

    let end = scratch.run(&["sample", "move.json", "--at", "86400", "--json"]).json();
    let end = end["samples"][0]["position_rad"].as_array().expect("positions").clone();
    let goal: Vec<f64> = GOAL.split(',').map(|q| q.parse().unwrap()).collect();
    for (q, goal) in end.iter().zip(&goal) {
        assert!((q.as_f64().expect("a number") - goal).abs() < 1e-9, "{end:?}");
    }
}

#[test]
fn plan_with_one_seed_is_one_file() {
    let (first, second) = (Scratch::new(), Scratch::new());
    planned(&first);
    planned(&second);
    let read = |s: &Scratch| fs::read_to_string(s.dir.join("move.json")).unwrap();
    assert_eq!(read(&first), read(&second));
}

#[test]
fn plan_to_a_position_says_pose_and_error_and_writes_a_file_that_verifies() {
    let scratch = Scratch::new();
    let words =
        ["plan", "--robot", "ur5", "--scene", "open", "--start", HOME, "--to-position", "0.4,-0.3,0.35"];
    let ran = scratch.run(&[&words[..], &["-o", "move.json"]].concat());
    let text = ran.done();
    assert!(text.contains("position      0.4, -0.3, 0.35 m, at most"), "{text}");
    let verify = ["verify", "--robot", "ur5", "--scene", "open", "--trajectory", "move.json", "--json"];
    assert_eq!(scratch.run(&verify).json()["verified"], true);

    let summary = scratch.run(&[&words[..], &["--reach-with", "iepso", "--json"]].concat()).json();
    let error_m = summary["position_error_m"].as_f64().expect("a number");
    assert!((0.0..=2e-6).contains(&error_m), "{summary}");
    assert_eq!(summary["goal_rad"].as_array().map(Vec::len), Some(6), "{summary}");
    assert_eq!(summary["target_m"][1], -0.3, "{summary}");
}

#[test]
fn plan_to_a_pose_of_the_tip_says_both_errors_and_writes_a_file_that_verifies() {
    let scratch = Scratch::new();
    let plan = |more: &[&str]| -> Vec<String> {
        let words = [&["plan", "--robot", "ur5", "--scene", "open", "--start", HOME], more].concat();
        words.into_iter().map(str::to_owned).collect()
    };
    let run = |more: &[&str]| {
        let words = plan(more);
        scratch.run(&words.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let rpy = "0.4,-0.3,0.35,3.1,0.1,0.2";
    let by_rpy = run(&["--to-pose", rpy, "-o", "move.json", "--json"]).json();
    for (key, most) in [("position_error_m", 2e-6), ("orientation_error_rad", 2e-6)] {
        let error = by_rpy[key].as_f64().expect("a number");
        assert!((0.0..=most).contains(&error), "{key}: {by_rpy}");
    }
    let verify = ["verify", "--robot", "ur5", "--scene", "open", "--trajectory", "move.json", "--json"];
    assert_eq!(scratch.run(&verify).json()["verified"], true);
    // The same pose by its quaternion is the same goal.
    let quaternion: Vec<String> = by_rpy["target_quaternion_xyzw"]
        .as_array()
        .expect("four numbers")
        .iter()
        .map(ToString::to_string)
        .collect();
    let by_quaternion = format!("0.4,-0.3,0.35,{}", quaternion.join(","));
    let again = run(&["--to-pose", &by_quaternion, "--json"]).json();
    for (a, b) in [(0, 0), (3, 3), (5, 5)] {
        let [a, b] =
            [by_rpy["goal_rad"][a].as_f64(), again["goal_rad"][b].as_f64()].map(|q| q.expect("a number"));
        assert!((a - b).abs() < 1e-6, "{by_rpy} {again}");
    }
    assert!(run(&["--to-pose", rpy]).done().contains("turned by"));
}

#[test]
fn plan_leads_the_tip_along_a_straight_line_at_its_speed_and_writes_a_file_that_verifies() {
    let scratch = Scratch::new();
    let start = "0,-1.57,1.57,-1.57,-1.57,0";
    let words = ["plan", "--robot", "ur5", "--scene", "open", "--start", start, "--linear"];
    let to = ["--to-position", "0.45,-0.3,0.35", "--tip-speed-m-s", "0.1", "-o", "move.json", "--json"];
    let summary = scratch.run(&[&words[..], &to].concat()).json();
    let number = |key: &str| summary[key].as_f64().unwrap_or(f64::NAN);
    assert!(number("line_off_m") <= 1e-3 && number("line_m") > 0.1, "{summary}");
    assert!(number("duration_s") >= number("line_m") / 0.1, "no faster than asked: {summary}");
    assert!(number("position_error_m") < 1e-5, "{summary}");
    let verify = ["verify", "--robot", "ur5", "--scene", "open", "--trajectory", "move.json", "--json"];
    assert_eq!(scratch.run(&verify).json()["verified"], true);
}

#[test]
fn plan_takes_named_relative_and_several_goals_and_the_nearest_turn() {
    let scratch = Scratch::new();
    let shipped = fs::read_to_string(config().join("robots/ur5.toml")).unwrap();
    let wide = shipped.replace("position_rad = [-3.1416, 3.1416]", "position_rad = [-6.2832, 6.2832]");
    let pose = "[[pose]]\nname = \"tucked\"\nposition_rad = [0, -2.0, 2.0, -1.57, -1.57, 3.0]\n";
    scratch.write("named.toml", &format!("{wide}\n{pose}"));
    let goal = |more: &[&str]| -> Vec<f64> {
        let start = "0,-1.57,1.57,-1.57,-1.57,-3";
        let words = [&["plan", "--robot", "named.toml", "--scene", "open", "--json", "--start", start], more]
            .concat();
        let summary = scratch.run(&words).json();
        summary["goal_rad"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|q| q.as_f64().expect("a number"))
            .collect()
    };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(near(goal(&["--to-named", "tucked"])[5], 3.0));
    assert!(near(goal(&["--to-named", "tucked", "--nearest-turn"])[5], 3.0 - std::f64::consts::TAU));
    let by = goal(&["--by-deg", "10,0,0,0,0,0"]);
    assert!(near(by[0], 10.0_f64.to_radians()) && near(by[5], -3.0), "{by:?}");
    let (far, close) = ("2,-1.57,1.57,-1.57,-1.57,-3", "0.2,-1.57,1.57,-1.57,-1.57,-3");
    assert!(near(goal(&["--goal", far, "--goal", close])[0], 0.2));
}

/// Goal: energy is stated for robots with masses, chosen by on request, and left out for robots without.
#[test]
fn energy_is_stated_for_robots_with_masses_and_chosen_by_on_request() {
    let scratch = Scratch::new();
    let by_time = planned(&scratch);
    let energy_j = by_time["energy_J"].as_f64().expect("a number");
    assert!(energy_j > 0.0 && by_time["objective"] == "time", "{by_time}");
    let ends = ["--start", HOME, "--goal", GOAL];
    let words =
        [&["plan", "--robot", "ur5", "--scene", "open", "--objective", "energy", "--json"][..], &ends]
            .concat();
    let by_energy = scratch.run(&words).json();
    assert_eq!(by_energy["objective"], "energy");
    assert!(by_energy["energy_J"].as_f64().expect("a number") <= energy_j * (1.0 + 1e-12), "{by_energy}");

    scratch.write("empty.toml", "margin_m = 0.02\n");
    scratch.write("one.json", &trajectory(&stroke("10", "0.25", "0.5")));
    let shipped = fs::read_to_string(config().join("robots/ur5.toml")).unwrap();
    let is_light = |line: &&str| !line.starts_with("link_mass_kg") && !line.starts_with("link_center_m");
    scratch.write("light.toml", &shipped.lines().filter(is_light).collect::<Vec<_>>().join("\n"));
    let cost = |robot| ["cost", "--robot", robot, "--scene", "empty.toml", "--trajectory", "one.json"];
    let text = scratch.run(&cost("ur5")).done().to_owned();
    assert!(text.lines().any(|line| line.starts_with("energy_J ")), "{text}");
    let json = scratch.run(&[&cost("ur5")[..], &["--json"]].concat()).json();
    assert!(json["energy_J"].as_f64().is_some_and(|j| j > 0.0), "{json}");
    let light = scratch.run(&[&cost("light.toml")[..], &["--json"]].concat()).json();
    assert!(light["energy_J"].is_null() && light["cost"] == json["cost"], "{light}");
}

#[test]
fn plan_to_stdout_is_the_file_and_nothing_else() {
    let scratch = Scratch::new();
    let words = ["plan", "--robot", "ur5", "--scene", "open", "--start", HOME, "--goal", GOAL, "-o", "-"];
    let ran = scratch.run(&words);
    let file: serde_json::Value = serde_json::from_str(ran.done()).expect("stdout is the trajectory file");
    assert_eq!(file["version"], 1);
    assert!(ran.err.contains("duration"), "the summary is on stderr: {}", ran.err);
    assert!(scratch.files().is_empty());
}

#[test]
fn sample_prints_the_contract_table_on_the_grid_with_the_end() {
    let scratch = Scratch::new();
    scratch.write("move.json", &trajectory(&stroke("10", "0.25", "0.5")));
    let ran = scratch.run(&["sample", "move.json", "--rate-hz", "10"]);
    let lines: Vec<&str> = ran.done().lines().collect();
    let header = "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,v1_rad_s,v2_rad_s,v3_rad_s,v4_rad_s,v5_rad_s,v6_rad_s,\
        a1_rad_s2,a2_rad_s2,a3_rad_s2,a4_rad_s2,a5_rad_s2,a6_rad_s2,j1_rad_s3,j2_rad_s3,j3_rad_s3,j4_rad_s3,j5_rad_s3,j6_rad_s3";
    assert_eq!(lines.first(), Some(&header));
    // 0, 0.1, .., 4.2 and the end at 4.25.
    assert_eq!(lines.len(), 1 + 43 + 1);
    let row = |i: usize| -> Vec<f64> { lines[i].split(',').map(|v| v.parse().expect("a number")).collect() };
    assert_eq!(row(1)[..3], [0.0, 0.0, -1.57]);
    assert_eq!(row(44)[..3], [4.25, 0.5, -1.57]);
    assert!(row(44)[7..].iter().all(|v| *v == 0.0), "at rest at the end: {}", lines[44]);

    // Goal: an independent formula of the stroke gives the same numbers.
    let s: f64 = (2.0 - 0.25) / 4.0;
    let phi = 1.0 - (1.0 - s.powi(4)).powi(10);
    assert!((row(21)[1] - 0.5 * phi).abs() < 1e-12, "{} against {}", row(21)[1], 0.5 * phi);
}

#[test]
fn sample_at_times_gives_one_line_each_in_their_order() {
    let scratch = Scratch::new();
    scratch.write("move.json", &trajectory(&stroke("10", "0", "0.5")));
    let ran = scratch.run(&["sample", "move.json", "--at", "4,-1,2"]);
    let times: Vec<&str> = ran.done().lines().skip(1).filter_map(|l| l.split(',').next()).collect();
    assert_eq!(times, ["4", "-1", "2"]);
}

#[test]
fn cost_counts_the_papers_481_poses_and_its_parts_add_up() {
    let scratch = Scratch::new();
    let strokes: Vec<String> = (0..4).map(|i| stroke("10", &(4 * i).to_string(), "0.25")).collect();
    scratch.write("move.json", &trajectory(&strokes.join(",")));
    scratch.write("balls.toml", "[[sphere]]\nname = \"ball\"\ncenter_m = [0.4, 0.4, 0.4]\nradius_m = 0.18\n");
    let cost = |weights: &str| {
        let words = [
            "cost",
            "--robot",
            "ur5",
            "--scene",
            "balls.toml",
            "--trajectory",
            "move.json",
            "--weights",
            weights,
            "--json",
        ];
        scratch.run(&words).json()
    };
    let c = cost("7,300,1.2e7");
    assert_eq!(c["poses"], 481);
    let number = |key: &str| c[key].as_f64().expect("a number");
    assert!((number("joint_travel_rad") - 1.0).abs() < 1e-9, "{c}");
    let sum = 7.0 * number("path_length_m") + 300.0 * number("joint_travel_rad") + 1.2e7 * number("penalty");
    assert!((number("cost") - sum).abs() <= 1e-9 * sum, "{c}");
    assert_eq!(cost("0,1,0")["cost"], c["joint_travel_rad"]);
}

#[test]
fn check_prints_allowed_contacts_and_pause_times() {
    let scratch = Scratch::new();
    let text = scratch.run(&["check", "vcan6"]);
    for word in [
        "MAY TOUCH",
        "link4-link6",
        "a pause or stop from full speed takes",
        "VIRTUAL",
        "without torque",
        "wrist_3",
    ] {
        assert!(text.done().contains(word), "no `{word}`: {}", text.out);
    }
    let json = scratch.run(&["check", "vcan6", "--json"]).json();
    assert_eq!(json["servos"].as_array().map(Vec::len), Some(6));
    assert!(json["robot"]["pause_s"].as_f64().is_some_and(|s| s > 0.0 && s < 5.0), "{json}");
    for shipped in ["ur5", "open", "pillars", "shelf", "bracket"] {
        scratch.run(&["check", shipped]).done();
    }
}

#[test]
fn completions_and_help_are_there_for_every_command() {
    let scratch = Scratch::new();
    for shell in ["bash", "zsh", "fish"] {
        assert!(scratch.run(&["completions", shell]).done().contains("clear-fault"), "{shell}");
    }
    let help = scratch.run(&["--help"]);
    assert!(help.done().contains("Exit codes"), "{}", help.out);
    for command in [
        "plan", "import", "sample", "plot", "cost", "verify", "check", "replan", "run", "enable", "speed",
        "stop", "status", "watch", "doctor", "bench", "man", "demo", "follow", "jog",
    ] {
        assert!(scratch.run(&[command, "--help"]).done().contains("--json"), "{command}");
    }
    assert!(scratch.run(&["--version"]).done().starts_with("taustream "));
}
