//! `taustream bench mbm` on problems and a robot that the test writes.
use crate::common::Scratch;

/// Two revolute joints about z, with links of spheres in the plane.
const URDF: &str = r#"<robot name="two">
  <link name="base"/>
  <link name="upper"><collision><origin xyz="0.3 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="fore"><collision><origin xyz="0.3 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="3" effort="10"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="3" effort="10"/></joint>
</robot>"#;

/// One problem whose line is blocked by a box, one that starts in it, one with a free line; joints in another order.
fn problems() -> String {
    let wall =
        r#"{"name": "wall", "type": "box", "p": [0.8, 0, 0], "q": [0, 0, 0, 1], "size": [0.3, 0.1, 1]}"#;
    let ends = [([0.0, 0.8], [0.0, -0.8]), ([0.0, 0.0], [0.0, -0.8]), ([0.0, 0.8], [0.0, 1.2])];
    let one = |(i, (start, goal)): (usize, &([f64; 2], [f64; 2]))| {
        format!(r#"{{"id": {}, "start": {start:?}, "goal": {goal:?}, "obstacles": [{wall}]}}"#, i + 1)
    };
    let all: Vec<String> = ends.iter().enumerate().map(one).collect();
    format!(
        r#"{{"robot": "two", "joints": ["elbow", "shoulder"], "sets": {{"walls": [{}]}}}}"#,
        all.join(", ")
    )
}

#[test]
fn published_problems_are_planned_and_bad_ones_named() {
    let scratch = Scratch::new();
    scratch.write("two_spherized.urdf", URDF);
    scratch.write("problems.json", &problems());
    let words = ["bench", "mbm", "--problems", "problems.json", "--robot", "two_spherized.urdf"];
    let answer = scratch.run(&[words.as_slice(), &["--json"]].concat()).json();
    let sets = answer["sets"].as_array().expect("sets");
    let [walls, all] = sets.as_slice() else { panic!("{answer}") };
    assert_eq!((&walls["set"], &all["set"]), (&"walls".into(), &"all".into()));
    for row in [walls, all] {
        assert_eq!([&row["problems"], &row["valid"], &row["solved"]], [3, 2, 2], "{answer}");
        assert_eq!(row["invalid_ids"], serde_json::json!([2]), "{answer}");
        assert_eq!(row["deadlines"][1]["deadline_ms"], 50, "{answer}");
        // Around the wall is longer than the two straight lines of 1.6 and 0.4 rad.
        assert!(row["length_rad_sum"].as_f64() > Some(2.0), "{answer}");
    }
    let ran = scratch.run(&words);
    let text = ran.done();
    assert!(text.contains("| walls | 2 of 3 | 2 |") && text.contains("nearer than the margin: 2"), "{text}");
}

#[test]
fn files_that_are_no_problems_are_refused_with_the_reason() {
    let scratch = Scratch::new();
    scratch.write("two.urdf", URDF);
    let bad = problems().replace("\"elbow\", \"shoulder\"", "\"elbow\", \"hip\"");
    for (name, text, why) in [
        ("text.json", "no JSON".to_owned(), "text.json"),
        ("joints.json", bad, "hip"),
        ("short.json", problems().replace("[0.0, 0.8]", "[0.0]"), "1 joint values"),
        ("size.json", problems().replace("[0.3, 0.1, 1]", "[0.3, -0.1, 1]"), "its size is"),
    ] {
        scratch.write(name, &text);
        scratch.run(&["bench", "mbm", "--problems", name, "--robot", "two.urdf"]).refused(2, &[why]);
    }
    scratch
        .run(&["bench", "mbm", "--problems", "nowhere.json", "--robot", "two.urdf"])
        .refused(2, &["nowhere"]);
}
