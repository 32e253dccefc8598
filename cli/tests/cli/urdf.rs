//! Robots from URDF files through every command that reads a robot.
use crate::common::{HOME, Scratch, config};
use std::fs;
use std::path::PathBuf;

fn robots() -> PathBuf {
    config().join("../tests/robots")
}

#[test]
fn check_of_a_urdf_says_what_was_found_what_was_left_out_and_what_may_touch() {
    let scratch = Scratch::new();
    let robot = robots().join("nasty.toml");
    let checked = scratch.run(&["check", robot.to_str().unwrap()]);
    for words in [
        "robot nasty",
        "base link plinth, tip link tool0",
        "4.900 kg by the links that state a mass",
        "moves with turn: 1 sphere, 1 hull",
        "is fixed: 1 cylinder",
        "links WITHOUT collision geometry: world, bracket_frame, tool0, camera_cover",
        "links that the file lists in unmodelled_links: camera_cover",
        "note: joint \"right_finger_slide\" (prismatic) is to follow joint \"left_finger_slide\", which is ignored",
        "NOTHING keeps it from being hit",
        "MAY TOUCH by the robot file: palm-camera",
        "MAY TOUCH by the SRDF: ",
        "MAY TOUCH by the contact rule",
    ] {
        assert!(checked.done().contains(words), "no {words:?} in:\n{}", checked.out);
    }
    let json = scratch.run(&["check", robot.to_str().unwrap(), "--json"]).json();
    assert_eq!(json["base_and_tip"][1], "tool0");
    assert_eq!(json["notices"].as_array().map(Vec::len), Some(7), "{json}");
    assert_eq!(json["links_without_shape"][3], "camera_cover");
    assert_eq!(json["may_touch_by_file"][0][1], "camera");
    assert!(json["may_touch_by_srdf"].as_array().is_some_and(|pairs| pairs.len() > 5), "{json}");
}

/// The files of one motion, from planning to its cost; the robot in the scene that the shipped UR5 has.
#[test]
fn plan_verify_sample_and_cost_work_with_a_urdf_and_refuse_another_one() {
    let scratch = Scratch::new();
    let robot = robots().join("ur5_balls.toml");
    let robot = robot.to_str().unwrap();
    // Half a turn about the column: the URDF looks along +x where the rows look along -x.
    let goal = "-2.0,-1.2,1.3,-1.6,-1.57,0.4";
    let start = "3.1,-1.57,1.57,-1.57,-1.57,0";
    let plan = [
        "plan", "--robot", robot, "--scene", "pillars", "--start", start, "--goal", goal, "-o", "m.json",
        "--json",
    ];
    let planned = scratch.run(&plan).json();
    assert!(planned["clearance_m"].as_f64().is_some_and(|m| m > 0.0), "{planned}");
    let verify = ["verify", "--robot", robot, "--scene", "pillars", "--trajectory", "m.json", "--json"];
    assert_eq!(scratch.run(&verify).json()["verified"], true);
    scratch.run(&["sample", "m.json", "--at", "0.5"]).done();
    let balls = scratch.write("balls.toml", "[[sphere]]\ncenter_m = [1.5, 1.5, 1.5]\nradius_m = 0.1\n");
    let plan = [
        "plan",
        "--robot",
        robot,
        "--scene",
        balls.to_str().unwrap(),
        "--start",
        HOME,
        "--goal",
        "0.3,-1.5,1.5,-1.5,-1.5,0.1",
        "-o",
        "n.json",
    ];
    scratch.run(&[&plan[..], &["--planner", "straight"]].concat()).done();
    let cost = scratch.run(&[
        "cost",
        "--robot",
        robot,
        "--scene",
        balls.to_str().unwrap(),
        "--trajectory",
        "n.json",
        "--json",
    ]);
    // A train of strokes has no cost in the paper's model, and the message says so.
    if cost.code == Some(0) {
        assert!(cost.json()["path_length_m"].as_f64().is_some_and(|m| m > 0.01));
    } else {
        assert!(cost.err.contains("overlap"), "{}", cost.err);
    }

    // The same words with another finger: another robot.
    for file in ["ur5_balls.toml", "ur5_balls.urdf", "ur5_balls.srdf"] {
        let text = fs::read_to_string(robots().join(file)).unwrap();
        scratch.write(file, &text.replacen("radius=\"0.012\"", "radius=\"0.0125\"", 1));
    }
    let other = ["verify", "--robot", "ur5_balls.toml", "--scene", "pillars", "--trajectory", "m.json"];
    scratch.run(&other).refused(2, &["another description of robot `ur5_balls`", "plan again"]);
}

#[test]
fn settings_with_a_urdf_robot_are_sound() {
    let scratch = Scratch::new();
    let settings = scratch.settings("urdfarm");
    let text = fs::read_to_string(&settings).unwrap();
    let rows = format!("{}/robots/ur5.toml", config().display());
    assert!(text.contains(&rows));
    let urdf = robots().canonicalize().unwrap().join("ur5_balls.toml");
    fs::write(&settings, text.replacen(&rows, &urdf.display().to_string(), 1)).unwrap();
    let checked = scratch.run(&["check", "settings.toml"]);
    assert!(
        checked.done().contains("robot ur5_balls") && checked.out.contains("no faults"),
        "{}",
        checked.out
    );
}

#[test]
fn piper_can_be_planned_for_and_its_settings_are_checked() {
    let scratch = Scratch::new();
    let words = [
        "plan",
        "--robot",
        "piper",
        "--scene",
        "open",
        "--start",
        "0,0.5,-0.5,0,0,0",
        "--goal",
        "1.0,1.4,-1.2,0.4,0.5,-0.6",
        "-o",
        "p.json",
        "--json",
    ];
    assert!(scratch.run(&words).json()["duration_s"].as_f64().is_some_and(|s| s > 0.1));
    scratch.run(&["verify", "--robot", "piper", "--scene", "open", "--trajectory", "p.json"]).done();
    let path = config().join("settings/piper.toml");
    let checked = scratch.run(&["check", path.to_str().unwrap()]);
    let text = checked.done();
    for part in ["firmware S-V1.6-3", "falls when it is disabled"] {
        assert!(text.contains(part), "{part:?} is missing in {text}");
    }
}

/// A URDF is not a robot file: it has no limits that anything could be planned with.
#[test]
fn urdf_in_place_of_a_robot_file_is_refused() {
    let scratch = Scratch::new();
    let urdf = robots().join("ur5_balls.urdf");
    scratch.run(&["check", urdf.to_str().unwrap()]).refused(2, &["urdf = \"ur5_balls.urdf\"", "tip_link"]);
    scratch
        .run(&["plan", "--robot", urdf.to_str().unwrap(), "--scene", "open", "--start", HOME, "--goal", HOME])
        .refused(2, &["tip_link"]);
}
