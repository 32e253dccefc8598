//! Everything that a user can get wrong: one clear sentence with the offender, exit code 1 or 2, nothing written.
use crate::common::{HOME, Scratch, config, stroke, trajectory};
use std::fs;

/// The words after `taustream` (HOME stands for the pose), the exit code, and what stderr must name.
type Case<'a> = (&'a str, i32, &'a [&'a str]);

/// Runs every case with and without `--json`, and asserts that no file came, went or changed.
#[track_caller]
fn refuse_all(scratch: &Scratch, cases: &[Case<'_>]) {
    assert!(!cases.is_empty());
    let before = scratch.files();
    for (line, code, expected) in cases {
        let words: Vec<&str> = line.split(' ').map(|word| if word == "HOME" { HOME } else { word }).collect();
        scratch.run(&words).refused(*code, expected);

        let with_json: Vec<&str> = words.iter().copied().chain(["--json"]).collect();
        let ran = scratch.run(&with_json);
        ran.refused(*code, &[]);
        let error: serde_json::Value = serde_json::from_str(&ran.err).unwrap_or(serde_json::Value::Null);
        assert!(error.is_object(), "`{}`: stderr is no JSON: {}", ran.words, ran.err);
        let message = error["error"]["message"].as_str().unwrap_or_default();
        assert!(!message.is_empty() && error["error"]["kind"].is_string(), "{error}");
        for word in *expected {
            assert!(message.contains(word), "`{}`: the message lacks `{word}`: {message}", ran.words);
        }
        assert_eq!(scratch.files(), before, "`{line}` left files behind");
    }
}

#[test]
fn words_that_are_wrong_are_refused_by_name() {
    let with = |goal: &str| format!("plan --robot ur5 --scene open --start HOME --goal={goal} -o never.json");
    let to =
        |to: &str| format!("plan --robot ur5 --scene open --start HOME --to-position={to} -o never.json");
    let scratch = Scratch::new();
    refuse_all(
        &scratch,
        &[
            ("fly", 2, &["fly"]),
            ("plan --goal 0", 2, &["--robot"]),
            (&with("0,0,0,0,0"), 2, &["--goal has 5 values", "6 joints", "wrist_3"]),
            (&with("0,0,0,0,0,0,0"), 2, &["--goal has 7 values", "`ur5`"]),
            (&with("0,0,0,0,0,0,0,0,0"), 2, &["--goal", "9 values"]),
            (&with("0,0,nan,0,0,0"), 2, &["--goal", "value 3 is NaN", "finite"]),
            (&with("0,0,0,inf,0,0"), 2, &["--goal", "value 4 is inf"]),
            (&with("0,0,x,0,0,0"), 2, &["--goal", "value 3 is `x`", "rad"]),
            (&with(""), 2, &["--goal"]),
            ("plan --robot ur5 --scene open --start HOME -o never.json", 2, &["--goal"]),
            ("plan --robot ur5 --scene open --start HOME --goal HOME --reach-with de", 2, &["--reach-with"]),
            (&to("0.4,0,0.3 --goal HOME"), 2, &["--goal", "--to-position"]),
            (&to("0.4,0,0.3 --reach-with magic"), 2, &["magic", "spso"]),
            (&to("0.4,0"), 2, &["--to-position", "2 values"]),
            (&to("0.4,0,0.3,1"), 2, &["--to-position", "4 values"]),
            (&to("0.4,nan,0.3"), 2, &["--to-position", "y is NaN"]),
            (&to("inf,0,0"), 2, &["--to-position", "x is inf"]),
            (&to("0.4,0,up"), 2, &["--to-position", "z is `up`"]),
            (&to("400,0,300"), 1, &["out of reach", "too short", "millimetres", "0.4 m"]),
            (&to("0,0,0.75 --seed 3"), 1, &["out of reach", "tries", "0.0268"]),
            (
                "plan --robot ur5 --scene open --start HOME --goal HOME --planner magic",
                2,
                &["magic", "rrt-connect", "ibfoa", "iwo"],
            ),
            (
                "plan --robot ur5 --scene open --start HOME --goal HOME --reading literal",
                2,
                &["literal", "printed", "corrected"],
            ),
            (
                "plan --robot ur5 --scene open --start HOME --goal HOME --objective beauty",
                2,
                &["beauty", "energy", "time"],
            ),
            (
                "plan --robot piper --scene open --start 0,0.5,-0.5,0,0,0 --goal 0,1,-1,0,0,0 --objective energy",
                1,
                &["`piper`", "no mass", "link_mass_kg"],
            ),
            ("plan --robot ur5 --scene open --start HOME --goal HOME --deadline-ms 0", 2, &["--deadline-ms"]),
            ("plan --robot ur5 --scene open --start HOME --goal HOME --seed -1", 2, &["--seed"]),
            ("jog", 2, &["--joint", "--axis"]),
            ("jog --joint 1 --axis x", 2, &["--joint", "--axis"]),
            ("jog --joint 1 --dead-man-ms 201", 2, &["--dead-man-ms", "201"]),
            ("jog --joint 1 --speed-rad-s nan", 2, &["--speed-rad-s"]),
            ("jog --joint nine --settings vcan6", 2, &["nine", "elbow"]),
            ("follow --rate-hz 0", 2, &["--rate-hz"]),
            ("replan --goal HOME --at-once --after-current", 2, &["--at-once", "--after-current"]),
            ("speed 101", 2, &["101", "0 to 100"]),
            ("speed -1", 2, &["-1", "0 to 100"]),
            ("speed nan", 2, &["nan", "0 to 100"]),
            ("stop --wait-s -3", 2, &["--wait-s"]),
            ("completions tcl", 2, &["tcl", "bash"]),
        ],
    );
}

#[test]
fn files_that_do_not_exist_are_refused_by_name() {
    let scratch = Scratch::new();
    refuse_all(
        &scratch,
        &[
            ("plan --robot ur6 --scene open --start HOME --goal HOME", 2, &["ur6", "robots/ur6.toml"]),
            ("plan --robot ur5 --scene no/such.toml --start HOME --goal HOME", 2, &["no/such.toml"]),
            ("sample move.json", 2, &["move.json"]),
            ("sample .", 2, &["."]),
            ("verify --robot ur5 --scene open --trajectory move.json", 2, &["move.json"]),
            ("run move.json", 2, &["move.json"]),
            ("check nothing", 2, &["nothing"]),
            ("status --settings nowhere.toml", 2, &["nowhere.toml"]),
            ("demo --config nowhere.toml", 2, &["nowhere.toml"]),
        ],
    );
}

#[test]
fn configuration_faults_are_refused_with_file_key_and_value() {
    let scratch = Scratch::new();
    scratch.edited("robots/ur5.toml", "unknown.toml", "name = \"ur5\"", "name = \"ur5\"\ncolour = \"red\"");
    scratch.edited("robots/ur5.toml", "nan.toml", "a_m = -0.425", "a_m = nan");
    scratch.edited("robots/ur5.toml", "zero.toml", "velocity_rad_s = 3.14", "velocity_rad_s = 0.0");
    scratch.edited("robots/ur5.toml", "six.toml", "[-3.1416, 3.1416]", "[-3.1416]");
    for (name, from, to) in [
        ("far.toml", "line_to_m = [-0.0183,", "line_to_m = [1000.0,"),
        ("flat.toml", "radius_m = 0.04", "radius_m = 0.0"),
        ("late.toml", "after_s = 0.1", "after_s = nan"),
    ] {
        let demo = scratch.edited("demo.toml", name, from, to);
        let text = fs::read_to_string(&demo).unwrap();
        scratch.write(name, &text.replacen("settings/vcan6.toml", "vcan6", 1));
    }
    scratch.write("half.toml", "name = \"ur5\n");
    scratch.write("binary.toml", "\u{0}\u{1}\u{2}");
    scratch.write("ball.toml", "[[sphere]]\nname = \"ball\"\ncenter_m = [0.5, 0.0, 0.5]\nradius_m = -1\n");
    let settings = scratch.settings("bad-input");
    let text = fs::read_to_string(&settings).unwrap();
    scratch.write("twice.toml", &text.replacen("node_id = 2", "node_id = 1", 1));
    scratch.write(
        "long.toml",
        &text.replacen("interface = \"vcan0\"", "interface = \"an-interface-too-long\"", 1),
    );
    scratch.write(
        "faults.toml",
        &text.replacen("node_id = 2", "node_id = 300", 1).replacen("period_us = 1000", "period_us = 0", 1),
    );
    refuse_all(
        &scratch,
        &[
            ("demo --config far.toml", 2, &["far.toml", "changing_scene.line_to_m", "1000"]),
            ("demo --config flat.toml", 2, &["flat.toml", "changing_scene.radius_m", "above 0"]),
            ("demo --config late.toml", 2, &["late.toml", "changing_scene.after_s", "from 0 to 60"]),
            ("check unknown.toml", 2, &["unknown.toml", "colour", "no such key"]),
            ("check nan.toml", 2, &["nan.toml", "a_m", "NaN"]),
            ("check zero.toml", 2, &["zero.toml", "velocity_rad_s", "above 0"]),
            ("check six.toml", 2, &["six.toml", "position_rad"]),
            ("check half.toml", 2, &["half.toml"]),
            ("check binary.toml", 2, &["binary.toml"]),
            ("check ball.toml", 2, &["ball.toml", "radius_m", "-1"]),
            ("check twice.toml", 2, &["twice.toml", "servo[1].node_id", "once on a bus"]),
            ("check long.toml", 2, &["long.toml", "interface", "an-interface-too-long"]),
            // Every fault at once.
            ("check faults.toml", 2, &["node_id", "300", "period_us"]),
            ("plan --robot zero.toml --scene open --start HOME --goal HOME -o x.json", 2, &["zero.toml"]),
            ("plan --robot ur5 --scene ball.toml --start HOME --goal HOME -o x.json", 2, &["radius_m"]),
        ],
    );
}

#[test]
fn trajectory_files_that_are_wrong_are_refused_by_key() {
    let scratch = Scratch::new();
    scratch.write("n3.json", &trajectory(&stroke("3", "0", "0.5")));
    scratch.write("nan.json", &trajectory(&stroke("10", "0", "NaN")));
    scratch.write("huge.json", &trajectory(&stroke("10", "0", "1e999")));
    let strokes: Vec<String> = (0..600).map(|i| stroke("10", &i.to_string(), "0.001")).collect();
    scratch.write("600.json", &trajectory(&strokes.join(",")));
    scratch
        .write("seven.json", &trajectory(&stroke("10", "0", "0.5")).replace("\"joints\":6", "\"joints\":7"));
    scratch.write("unknown.json", &trajectory("").replace("\"version\":1", "\"version\":1,\"colour\":1"));
    scratch.write("old.json", &trajectory("").replace("\"version\":1", "\"version\":0"));
    scratch.write("cut.json", &trajectory(&stroke("10", "0", "0.5"))[..80]);
    scratch.write("good.json", &trajectory(&stroke("10", "0", "0.5")));
    let other = trajectory("")
        .replace("\"robot\":\"ur5\"", &format!("\"robot\":\"ur5\",\"digest\":\"{}\"", "0".repeat(64)));
    scratch.write("other.json", &other);
    refuse_all(
        &scratch,
        &[
            ("sample n3.json", 2, &["n3.json", "strokes[0]", "3"]),
            ("sample nan.json", 2, &["nan.json"]),
            ("sample huge.json", 2, &["huge.json"]),
            ("sample 600.json", 2, &["600.json", "600", "512"]),
            ("sample seven.json", 2, &["seven.json", "base_rad"]),
            ("sample unknown.json", 2, &["unknown.json", "colour"]),
            ("sample old.json", 2, &["old.json", "version"]),
            ("sample cut.json", 2, &["cut.json"]),
            ("sample good.json --rate-hz 0", 2, &["--rate-hz is 0"]),
            ("sample good.json --rate-hz nan", 2, &["--rate-hz is NaN"]),
            ("sample good.json --at 0,x", 2, &["--at", "`x`"]),
            ("sample good.json --at 0 --rate-hz 5", 2, &["--at", "--rate-hz"]),
            ("verify --robot ur5 --scene open --trajectory other.json", 2, &["other.json", "digest"]),
            ("run good.json", 2, &["good.json", "digest", "taustream plan"]),
            ("run other.json", 2, &["other.json", "digest"]),
            (
                "cost --robot ur5 --scene open --trajectory good.json --weights 1,2",
                2,
                &["--weights", "2 weights"],
            ),
            ("cost --robot ur5 --scene open --trajectory good.json --expansion-m nan", 2, &["expansion_m"]),
        ],
    );
}

#[test]
fn robot_of_seven_joints_refuses_six_values() {
    let scratch = Scratch::new();
    let text = fs::read_to_string(config().join("robots/ur5.toml")).unwrap();
    let last = text.rfind("[[joint]]").expect("the last joint");
    let seventh = text[last..].replacen("wrist_3", "wrist_4", 1);
    scratch.write("seven.toml", &format!("{text}\n{seventh}"));
    scratch.write("six.json", &trajectory(&stroke("10", "0", "0.5")));
    refuse_all(
        &scratch,
        &[
            (
                "plan --robot seven.toml --scene open --start HOME --goal HOME",
                2,
                &["--start has 6 values", "7 joints", "wrist_4"],
            ),
            (
                "verify --robot seven.toml --scene open --trajectory six.json",
                2,
                &["six.json", "6 joints", "7"],
            ),
        ],
    );
}

#[test]
fn poses_that_cannot_be_are_refused_with_joint_or_contact() {
    let scratch = Scratch::new();
    // A ball where the arm's forearm is in its home pose, and a closed shell round the base.
    scratch.write("inside.toml", "[[sphere]]\nname = \"ball\"\ncenter_m = [0.0, 0.0, 0.5]\nradius_m = 0.5\n");
    let plan = |scene: &str, start: &str, goal: &str| {
        format!("plan --robot ur5 --scene {scene} --start {start} --goal {goal} --deadline-ms 1500 -o x.json")
    };
    refuse_all(
        &scratch,
        &[
            (&plan("inside.toml", "HOME", "1,-1.57,1.57,-1.57,-1.57,0"), 1, &["start in collision", "ball"]),
            (
                &plan("open", "HOME", "0,-1.57,9,-1.57,-1.57,0"),
                1,
                &["goal outside limits", "joint 3", "elbow"],
            ),
            (
                &plan("open", "4,-1.57,1.57,-1.57,-1.57,0", "HOME"),
                1,
                &["start outside limits", "joint 1", "shoulder_pan"],
            ),
            (
                &plan("open", "HOME", "0,-90,90,-90,-90,0"),
                1,
                &["goal outside limits", "looks like degrees", "1.5708"],
            ),
            // The arm straight down through the table.
            (&plan("open", "HOME", "0,1.57,0,0,0,0"), 1, &["goal in collision", "correct the scene"]),
            // The elbow folded into the upper arm.
            (
                &plan("open", "HOME", "0,-1.57,3.1,-1.57,-1.57,0"),
                1,
                &["goal in collision", "if the real links do not touch there", "allowed_contacts = [[\"link"],
            ),
        ],
    );
}

/// Goal: an honest no. Method: walls, lid and floor leave only a gap round the base, which no upper arm passes.
#[test]
fn goals_of_the_tip_that_are_wrong_are_refused_by_name() {
    let pose = |to: &str| format!("plan --robot ur5 --scene open --start HOME --to-pose={to} -o never.json");
    refuse_all(
        &Scratch::new(),
        &[
            (&pose("0.49,0.109,0.4,0,0,0 --linear"), 1, &["straight line is left after", "choose"]),
            (&pose("0.4,0,0.3,0,0,0 --linear --tip-speed-m-s=0"), 2, &["speed limit", "is 0", "m/s"]),
            (&pose("0.4,0,0.3,0,0,0 --linear --via HOME"), 2, &["--via"]),
            (&pose("0.4,0,0.3,0,0,0 --tip-speed-rad-s=0.1"), 2, &["--linear"]),
            (&pose("0.4,0,0.3"), 2, &["--to-pose", "3 values", "quaternion"]),
            (&pose("0.4,0,0.3,0,0,0,0"), 2, &["--to-pose", "length is 0"]),
            (&pose("0.4,0,0.3,nan,0,0"), 2, &["--to-pose", "value 4 is NaN"]),
            (&pose("0.4,0,0.3,0,0,0 --tolerance-rad=-1"), 2, &["--tolerance-rad", "0 or more"]),
            (&pose("0.4,0,0.3,0,0,0 --tolerance-rad=1,2"), 2, &["--tolerance-rad", "2 values"]),
            (&pose("0.4,0,0.3,0,0,0 --tolerance-m=-1"), 1, &["tolerance of the position"]),
            (&pose("0.4,0,0.3,0,0,0 --nearest-turn"), 2, &["--nearest-turn"]),
            (&pose("0.4,0,0.3,0,0,0 --reach-with de"), 2, &["--reach-with"]),
            (&pose("0.88,0,0.1,0,-1.5708,0"), 1, &["out of reach", "rad off", "tolerance"]),
            (
                "plan --robot ur5 --scene open --start HOME --to-named nowhere",
                2,
                &["no pose `nowhere`", "[[pose]]"],
            ),
            ("plan --robot ur5 --scene open --start HOME --by 0,0", 2, &["--by has 2 values"]),
        ],
    );
}

#[test]
fn goal_behind_a_closed_wall_is_refused_within_the_deadline() {
    let scratch = Scratch::new();
    let wall = |name: &str, center_m: &str, size_m: &str| {
        format!("[[box]]\nname = \"{name}\"\ncenter_m = {center_m}\nsize_m = {size_m}\n")
    };
    let walls = [
        wall("front", "[1.05, 0.0, 0.9]", "[1.5, 0.05, 2.4]"),
        wall("back", "[-1.05, 0.0, 0.9]", "[1.5, 0.05, 2.4]"),
        wall("lid", "[0.0, 0.0, 1.25]", "[0.6, 0.05, 2.0]"),
        wall("floor", "[0.0, 0.0, -0.145]", "[2.4, 2.4, 0.05]"),
    ];
    scratch.write("wall.toml", &walls.concat());
    let (start, goal) = ("1.57,-0.4,0.6,-1.57,-1.57,0", "-1.57,-0.4,0.6,-1.57,-1.57,0");
    let words = format!(
        "plan --robot ur5 --scene wall.toml --start {start} --goal {goal} --deadline-ms 700 -o x.json"
    );
    refuse_all(&scratch, &[(&words, 1, &["no path found", "blocked: link", "and back", "700 ms", "longer"])]);
}

#[test]
fn motion_beyond_limits_or_through_an_obstacle_is_not_verified() {
    let scratch = Scratch::new();
    scratch.write(
        "fast.json",
        &trajectory(&stroke("10", "0", "3.0").replace("\"duration_s\":4", "\"duration_s\":0.3")),
    );
    scratch.write("far.json", &trajectory(&stroke("10", "0", "3.2")));
    scratch.write("swing.json", &trajectory(&stroke("10", "0", "3.0")));
    scratch.write(
        "post.toml",
        "[[cylinder]]\nname = \"post\"\ncenter_m = [0.0, 0.45, 0.4]\nradius_m = 0.1\nlength_m = 1.2\n\
        [[cylinder]]\nname = \"post2\"\ncenter_m = [0.0, -0.45, 0.4]\nradius_m = 0.1\nlength_m = 1.2\n",
    );
    let verify = |file: &str, scene: &str| format!("verify --robot ur5 --scene {scene} --trajectory {file}");
    refuse_all(
        &scratch,
        &[
            (&verify("fast.json", "open"), 1, &["fast.json", "joint 1", "shoulder_pan"]),
            (&verify("far.json", "open"), 1, &["far.json", "joint 1", "osition"]),
            (&verify("swing.json", "post.toml"), 1, &["swing.json", "collision", "post"]),
        ],
    );
}

#[test]
fn commands_without_a_streamer_say_so() {
    let scratch = Scratch::new();
    let arm = format!("nobody-{}", std::process::id());
    scratch.settings(&arm);
    for command in [
        "enable",
        "disable",
        "pause",
        "resume",
        "stop",
        "stop --fast",
        "torque-off",
        "clear-fault",
        "speed 50",
        "status",
        "replan --goal HOME",
        "jog --joint 1",
    ] {
        let words = format!("{command} --settings settings.toml");
        let case: Case<'_> = (&words, 1, &["taustream-streamer", &arm, "is not running", "start"]);
        refuse_all(&scratch, &[case]);
    }
}

/// A segment of that name is all that the other user's services show to us.
struct OtherUser(std::path::PathBuf);

impl Drop for OtherUser {
    fn drop(&mut self) {
        let _gone = fs::remove_file(&self.0);
    }
}

#[test]
fn services_of_another_user_are_named() {
    let scratch = Scratch::new();
    let arm = format!("theirs-{}", std::process::id());
    scratch.settings(&arm);
    let segment = OtherUser(format!("/dev/shm/taustream.4242.{arm}.test").into());
    fs::write(&segment.0, "").expect("a file in /dev/shm");
    let expected: &[&str] = &["uid 4242", "not running", &arm];
    refuse_all(&scratch, &[("status --settings settings.toml", 1, expected)]);
    refuse_all(&scratch, &[("stop --settings settings.toml", 1, expected)]);
}

#[test]
fn stopping_needs_only_the_name_of_broken_settings() {
    let scratch = Scratch::new();
    let arm = format!("broken-{}", std::process::id());
    let settings = scratch.settings(&arm);
    let text = fs::read_to_string(&settings).unwrap();
    scratch.write("settings.toml", &text.replacen("node_id = 2", "node_id = 1", 1));
    // The fault is mentioned; what keeps the command from its work is only that no process serves.
    scratch
        .run(&["stop", "--settings", "settings.toml"])
        .refused(1, &["note:", "has faults", &arm, "is not running"]);
    // Planning reads everything, so there the fault counts.
    scratch.run(&["replan", "--goal", HOME, "--settings", "settings.toml"]).refused(2, &["node_id"]);
}

/// The checker above must see what it looks for: a case that is no failure makes it fail.
#[test]
#[should_panic(expected = "check")]
fn checker_notices_a_command_that_succeeds() {
    refuse_all(&Scratch::new(), &[("check ur5", 2, &["ur5"])]);
}
