//! Two arms as one robot: plans for one group while the other holds, and for both at once.
use crate::common::{Scratch, config};

const LENGTH_M: f64 = 0.35;
const RADIUS_M: f64 = 0.03;
/// The left arm stretched ahead; the right one bent, so that its forearm stands before the left arm like a post.
const START: &str = "0,0,0,0.8,-0.6,1.4";

fn robot() -> String {
    config().join("../tests/robots/two_arms.toml").display().to_string()
}

/// Shoulder, elbow and tip of an arm, by its angles.
fn points_m(y_m: f64, [yaw, pitch, elbow]: [f64; 3]) -> [[f64; 3]; 3] {
    let along = |at: [f64; 3], down: f64| {
        let flat_m = LENGTH_M * down.cos();
        [at[0] + flat_m * yaw.cos(), at[1] + flat_m * yaw.sin(), at[2] - LENGTH_M * down.sin()]
    };
    let shoulder = [0.0, y_m, 0.0];
    let bent = along(shoulder, pitch);
    [shoulder, bent, along(bent, pitch + elbow)]
}

/// Distance of the rods of both arms, by points 2 mm apart.
fn apart_m(q: &[f64; 6]) -> f64 {
    let arms = [points_m(0.3, [q[0], q[1], q[2]]), points_m(-0.3, [q[3], q[4], q[5]])];
    let rods = arms.map(|p| {
        let rod = |a: [f64; 3], b: [f64; 3]| {
            (0..=175).map(move |i| {
                let share = f64::from(i) / 175.0;
                [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * share)
            })
        };
        rod(p[0], p[1]).chain(rod(p[1], p[2])).collect::<Vec<_>>()
    });
    let mut least_m = f64::INFINITY;
    for a in &rods[0] {
        for b in &rods[1] {
            least_m = least_m.min((0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt());
        }
    }
    least_m - 2.0 * RADIUS_M
}

/// The poses of a trajectory file, with their text.
#[expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]
fn samples(scratch: &Scratch, file: &str) -> Vec<([f64; 6], Vec<String>)> {
    let csv = scratch.run(&["sample", file, "--rate-hz", "50"]);
    let rows = csv.done().lines().skip(1).map(|line| {
        let words: Vec<String> = line.split(',').skip(1).take(6).map(str::to_owned).collect();
        let q: Vec<f64> = words.iter().map(|word| word.parse().unwrap()).collect();
        (q.try_into().unwrap(), words)
    });
    rows.collect()
}

/// Goal: the left arm goes round the right one, which does not move by a bit; the motion keeps away from it in the geometry of this
/// test, which knows nothing of the planner's; and it verifies.
#[test]
fn one_arm_goes_round_the_other_while_that_holds_still() {
    let scratch = Scratch::new();
    let robot = robot();
    let plan = |more: &[&str]| {
        let words = ["plan", "--robot", &robot, "--scene", "open", "--start", START, "--group", "left"];
        scratch.run(&[words.as_slice(), more].concat())
    };
    plan(&["--goal", "-1.3,0,0", "--planner", "straight"]).refused(1, &["left_", "right_lower"]);
    let planned = plan(&["--goal", "-1.3,0,0", "-o", "round.json", "--json"]).json();
    assert_eq!(planned["group"], "left");
    let rows = samples(&scratch, "round.json");
    assert!(rows.len() > 20);
    for (q, words) in &rows {
        assert_eq!(words[3..], rows[0].1[3..], "the right arm moves: {q:?}");
        assert!(apart_m(q) > 0.0, "{q:?}: {} m", apart_m(q));
    }
    let [first, last] = [rows.first().unwrap().0, rows.last().unwrap().0];
    assert!((first[3] - 0.8).abs() < 1e-12 && (first[5] - 1.4).abs() < 1e-12, "{first:?}");
    assert!((last[0] + 1.3).abs() < 1e-6 && last[1].abs() < 1e-6 && last[2].abs() < 1e-6, "{last:?}");
    let least_m = rows.iter().map(|(q, _)| apart_m(q)).fold(f64::INFINITY, f64::min);
    let proven_m = planned["clearance_m"].as_f64().unwrap();
    assert!(proven_m <= least_m + 3e-3, "{proven_m} m proven, {least_m} m here");
    let verify = ["verify", "--robot", &robot, "--scene", "open", "--trajectory", "round.json", "--json"];
    assert_eq!(scratch.run(&verify).json()["verified"], true);
    let picture =
        ["plot", "--robot", &robot, "--scene", "open", "--trajectory", "round.json", "-o", "round.svg"];
    scratch.run(&picture).done();
}

#[test]
fn named_poses_steps_way_points_and_tips_of_a_group_lead_that_group_alone() {
    let scratch = Scratch::new();
    let robot = robot();
    let start = "-0.9,-0.4,0.2,-1.2,-0.3,0.5";
    let plan = |more: &[&str]| {
        let words =
            ["plan", "--robot", &robot, "--scene", "open", "--start", start, "-o", "m.json", "--json"];
        scratch.run(&[words.as_slice(), more].concat())
    };
    let tip_of = |y_m: f64, q: &[f64]| points_m(y_m, [q[0], q[1], q[2]])[2];
    for (more, held) in [
        (&["--group", "left", "--to-named", "aside"][..], 3..6),
        (&["--group", "right", "--by", "0.1,0,-0.2"], 0..3),
        (&["--group", "right", "--goal", "-0.5,0,0", "--via", "-0.8,-0.2,0"], 0..3),
        (&["--group", "right", "--to-position", "0.3,-0.6,0.2"], 0..3),
        (&["--group", "left", "--to-position", "0.3,0.5,0.3", "--reach-with", "gwo"], 3..6),
        (&["--group", "right", "--goal-deg", "-30,-10,10"], 0..3),
    ] {
        plan(more).done();
        let rows = samples(&scratch, "m.json");
        for (q, words) in &rows {
            assert_eq!(words[held.clone()], rows[0].1[held.clone()], "{more:?}: {q:?}");
        }
        let last = rows.last().unwrap().0;
        match more {
            [_, _, "--to-position", "0.3,-0.6,0.2", ..] => {
                let tip = tip_of(-0.3, &last[3..]);
                assert!((tip[0] - 0.3).abs() < 1e-5 && (tip[1] + 0.6).abs() < 1e-5, "{tip:?}");
            }
            [_, _, "--to-position", ..] => {
                let tip = tip_of(0.3, &last[..3]);
                assert!((tip[0] - 0.3).abs() < 1e-5 && (tip[2] - 0.3).abs() < 1e-5, "{tip:?}");
            }
            [_, _, "--by", ..] => assert!((last[3] + 1.1).abs() < 1e-6 && (last[5] - 0.3).abs() < 1e-6),
            _ => {}
        }
    }
    // Both at once: all joints of both arms.
    plan(&["--goal", "0.9,-0.4,0.2,-0.2,-0.3,0.5"]).done();
    let rows = samples(&scratch, "m.json");
    let last = rows.last().unwrap().0;
    assert!((last[0] - 0.9).abs() < 1e-6 && (last[3] + 0.2).abs() < 1e-6, "{last:?}");
    for (q, _) in &rows {
        assert!(apart_m(q) > 0.0, "{q:?}");
    }
}

#[test]
fn groups_and_tips_that_are_not_there_are_refused_with_those_that_are() {
    let scratch = Scratch::new();
    let robot = robot();
    let plan = |more: &[&str]| {
        let words = ["plan", "--robot", &robot, "--scene", "open", "--start", START];
        scratch.run(&[words.as_slice(), more].concat())
    };
    plan(&["--to-position", "0.3,0.5,0.3"])
        .refused(2, &["several tips (left_tcp, right_tcp)", "--group: left (left_tcp), right (right_tcp)"]);
    plan(&["--group", "middle", "--goal", "0,0,0"]).refused(2, &["no group `middle`", "left, right"]);
    plan(&["--group", "left", "--goal", "0,0,0,0,0,0"])
        .refused(2, &["6 values", "group `left` has 3 joints", "left_yaw"]);
    plan(&["--goal", "0,0,0"]).refused(2, &["3 values", "6 joints"]);
    plan(&["--group", "right", "--to-named", "aside"])
        .refused(2, &["no pose `aside`", "aside (--group left)"]);
    plan(&["--to-named", "aside"]).refused(2, &["aside (--group left)"]);
    let words = ["plan", "--robot", "ur5", "--scene", "open", "--start", "0,-1.57,1.57,-1.57,-1.57,0"];
    let ur5 = [words.as_slice(), &["--group", "left", "--goal", "0,0,0,0,0,0"]].concat();
    scratch.run(&ur5).refused(2, &["no group `left`", "add [[group]] tables"]);
    // The arm that holds stands in the way of the goal.
    plan(&["--group", "left", "--goal", "-0.65,0,0"]).refused(1, &["no plan", "left_", "right_lower"]);
}

#[test]
fn check_shows_tips_groups_and_what_is_kept_apart_between_them() {
    let scratch = Scratch::new();
    let checked = scratch.run(&["check", &robot()]);
    for words in [
        "2 tips: left_tcp, right_tcp",
        "group left, leads left_tcp: left_yaw, left_pitch, left_elbow",
        "groups left and right: 9 pairs of links are kept apart, 0 may touch",
        "left_lower                 moves with left_elbow",
    ] {
        assert!(checked.done().contains(words), "no {words:?} in:\n{}", checked.out);
    }
    let json = scratch.run(&["check", &robot(), "--json"]).json();
    assert_eq!((&json["tips"][1], &json["groups"][1]["tip"]), (&"right_tcp".into(), &"right_tcp".into()));
    assert_eq!(
        (&json["across_groups"][0]["pairs"], &json["groups"][0]["joints"][2]),
        (&9.into(), &"left_elbow".into())
    );
}
