//! Motions from elsewhere: a table, way points, the shipped path; and what users get wrong.
use crate::common::{HOME, Scratch};
use std::fs;

const THERE: &str = "0.5,-1.4,1.5,-1.6,-1.5,0.2";

/// The words of a line, two poses by their names.
fn words_of(line: &str) -> Vec<&str> {
    let pose = |word| match word {
        "HOME" => HOME,
        "THERE" => THERE,
        other => other,
    };
    line.split(' ').map(pose).collect()
}

#[test]
fn imported_table_verifies_and_its_deviation_is_that_of_the_samples() {
    let scratch = Scratch::new();
    let words = "import --via HOME --via THERE --profile tau-j-star --k 1/8 --robot ur5 --scene open -o a.json --json";
    let exact = scratch.run(&words_of(words)).json();
    assert_eq!(
        (&exact["exact"], &exact["strokes"], &exact["deviation_rad"]),
        (&true.into(), &1.into(), &0.0.into())
    );
    let table = scratch.run(&["sample", "a.json", "--rate-hz", "200"]);
    fs::write(scratch.dir.join("a.csv"), table.done()).unwrap();
    let again = scratch.run(&["import", "a.csv", "--robot", "ur5", "--scene", "open", "-o", "b.json"]);
    for word in ["imported", "deviation     at most", "ignored columns: j1_rad_s3", "written to    b.json"] {
        assert!(again.done().contains(word), "no `{word}`: {}", again.out);
    }
    scratch.run(&["verify", "--robot", "ur5", "--scene", "open", "--trajectory", "b.json"]).done();
}

#[test]
fn shipped_path_is_imported_by_its_name() {
    let scratch = Scratch::new();
    let words = "import --path eight_points --timed-by isma --evaluations 200 --robot ur5 --scene open -o e.json --json";
    let summary = scratch.run(&words_of(words)).json();
    assert!(summary["deviation_rad"].as_f64().is_some_and(|rad| rad > 0.0 && rad <= 0.005), "{summary}");
    assert!(summary["notes"][0].as_str().is_some_and(|note| note.contains("by isma (seed 1)")), "{summary}");
    assert!(scratch.files().contains("e.json"));
}

#[test]
fn what_is_no_motion_for_the_arm_is_refused_and_nothing_is_written() {
    let scratch = Scratch::new();
    scratch.write("jump.csv", "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad\n0,0,-1.57,1.57,-1.57,-1.57,0\n0.01,1,-1.57,1.57,-1.57,-1.57,0\n");
    scratch.write("two.csv", "t_s,q1_rad,q2_rad\n0,0,0\n1,1,1\n");
    scratch.write("back.csv", "t_s,q1_rad\n1,0\n0,1\n");
    let before = scratch.files();
    let cases: [(&str, i32, &[&str]); 14] = [
        ("import", 2, &["--via"]),
        ("import none.csv", 2, &["none.csv", "no such file"]),
        ("import jump.csv", 1, &["joint 1 (shoulder_pan)", "jumps by 1.0000 rad", "t = 0.010 s"]),
        ("import two.csv", 2, &["2 joints, the robot has 6"]),
        ("import back.csv", 2, &["back.csv:3", "t_s = 0"]),
        ("import jump.csv --tolerance-rad 0", 2, &["--tolerance-rad", "1e-9"]),
        ("import --via HOME --via THERE --k 0.1", 2, &["--profile", "quintic"]),
        ("import --via HOME --via THERE --profile quintic --blend-rad 0.1", 2, &["blend", "--profile"]),
        ("import --via HOME --via 9,9,9,9,9,9 --blend-rad 0.1", 1, &["goal", "outside"]),
        ("import --via HOME --profile quintic", 2, &["one --via"]),
        ("import --via HOME --via HOME --profile quintic", 1, &["nothing moves"]),
        ("import --via HOME --via THERE --profile tau-j --k 0.5", 2, &["0.5", "below 1/3"]),
        ("import --via HOME --via THERE --profile quintic --durations 1,2", 2, &["2 durations for 2 points"]),
        ("import --path nowhere", 2, &["paths/nowhere.toml"]),
    ];
    for (line, code, expected) in cases {
        let line = format!("{line} --robot ur5 --scene open -o never.json");
        scratch.run(&words_of(&line)).refused(code, expected);
        assert_eq!(scratch.files(), before, "`{line}` left files behind");
    }
}

/// Goal: points without a profile become the motion that `plan --via` makes of them: corners rounded within the blend, or a stop
/// at each.
#[test]
fn points_without_a_profile_are_timed_and_rounded_as_by_plan() {
    let scratch = Scratch::new();
    let via = "--via HOME --via 0.4,-1.2,1.5,-1.57,-1.57,0.3 --via THERE";
    let mut durations_s = Vec::new();
    for blend in ["--blend-rad 0.1", "--blend-rad 0"] {
        let line = format!("import {via} {blend} --robot ur5 --scene open -o a.json --json");
        let summary = scratch.run(&words_of(&line)).json();
        let off_rad = summary["deviation_rad"].as_f64().unwrap();
        assert!(
            if blend.ends_with('0') { off_rad == 0.0 } else { off_rad > 0.0 && off_rad <= 0.1 },
            "{summary}"
        );
        durations_s.push(summary["duration_s"].as_f64().unwrap());
        scratch.run(&words_of("verify --robot ur5 --scene open --trajectory a.json")).done();
    }
    assert!(durations_s[0] < 0.95 * durations_s[1], "{durations_s:?}");
    let line = "plan --robot ur5 --scene open --start HOME --via 0.4,-1.2,1.5,-1.57,-1.57,0.3 --goal THERE --blend-rad 0.1 --json";
    let planned_s = scratch.run(&words_of(line)).json()["duration_s"].as_f64().unwrap();
    assert!(
        (planned_s - durations_s[0]).abs() < 0.05 * planned_s,
        "{planned_s} s planned, {durations_s:?} s imported"
    );
}
