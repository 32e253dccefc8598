//! What the tip must keep on the way: options, summary, refusals.
use crate::common::{HOME, Scratch};

const GOAL: &str = "1.2,-1.3,1.4,-1.67,-1.57,0";

fn plan<'a>(scene: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let words = ["plan", "--robot", "ur5", "--scene", scene, "--start", HOME, "--goal", GOAL];
    [&words[..], more].concat()
}

/// Goal: one command plans within constraints, says what they use, and `verify` proves the same from the file.
#[test]
fn plan_keeps_constraints_of_the_tip_and_verify_proves_them() {
    let scratch = Scratch::new();
    let upright =
        ["--upright-deg", "10", "--tool-axis", "-z", "--tip-above-m", "0.2", "--tip-speed-m-s", "0.5"];
    let said = scratch.run(&plan("pillars", &upright)).done().to_owned();
    for words in ["tip upright", "(proven: 10 deg)", "tip inside", "(proven: 0.5 m/s)"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let summary =
        scratch.run(&plan("pillars", &[&upright[..], &["-o", "move.json", "--json"]].concat())).json();
    let number = |key: &str| summary[key].as_f64().unwrap_or(f64::NAN);
    assert!(number("tip_tilt_rad") <= number("tip_tilt_allowed_rad"), "{summary}");
    assert!(number("tip_speed_m_s") <= 0.5 && number("tip_inside_m") >= 0.0, "{summary}");
    let verify = ["verify", "move.json", "--scene", "pillars"];
    scratch.run(&[&verify[..], &upright].concat()).done();
    let slower = scratch.run(&[&verify[..], &["--tip-speed-m-s", "0.1"]].concat());
    slower.refused(1, &["constraint of the tip", "0.1 m/s allowed", "at t ="]);
    let narrower = scratch.run(&[&verify[..], &["--upright-deg", "0.1", "--tool-axis", "-z"]].concat());
    narrower.refused(1, &["deg from its direction", "0.100 deg allowed"]);
    let none = scratch.run(&plan("pillars", &["--json"])).json();
    assert!(none["tip_tilt_rad"].is_null() && none["tip_speed_m_s"].is_null(), "{none}");
}

/// Goal: a zone of the scene slows every motion through it.
#[test]
fn zone_of_a_scene_slows_plans_and_refuses_files() {
    let scratch = Scratch::new();
    let zone = "[[zone]]\nname = \"cell\"\ncenter_m = [0, 0, 0]\nsize_m = [3, 3, 3]\nspeed_m_s = 0.2\n";
    scratch.write("zoned.toml", zone);
    scratch.run(&plan("open", &["-o", "fast.json"])).done();
    scratch
        .run(&["verify", "fast.json", "--scene", "zoned.toml"])
        .refused(1, &["constraint of the tip", "0.2 m/s of zone cell"]);
    let said = scratch.run(&plan("zoned.toml", &["-o", "slow.json"])).done().to_owned();
    assert!(said.contains("the zones' limits"), "{said}");
    scratch.run(&["verify", "slow.json", "--scene", "zoned.toml"]).done();
}

/// Goal: a pose that violates is refused by place, value and limit; options that make no sense by their name.
#[test]
fn constraints_that_cannot_be_kept_or_make_no_sense_are_refused() {
    let scratch = Scratch::new();
    let refusals: [(&[&str], i32, &[&str]); 8] = [
        (&["--upright-deg", "10"], 1, &["the start violates", "10.000 deg allowed", "choose another start"]),
        (
            &["--tip-above-m", "0.9"],
            1,
            &["the start violates", "the tip's z is", "0.9 m that it must be at least"],
        ),
        (
            &["--upright-deg", "10", "--tool-axis", "-z", "--planner", "rrt"],
            1,
            &["planner rrt", "rrt-connect"],
        ),
        (&["--upright-deg", "0"], 2, &["--upright-deg", "0.05 to 180 degrees"]),
        (&["--tool-axis", "x"], 2, &["--upright-deg"]),
        (&["--upright-deg", "5", "--tool-axis", "w"], 2, &["--tool-axis", "is no axis"]),
        (&["--tip-box-m", "0,0,0,0,1,1"], 2, &["--tip-box-m", "x goes from 0 to 0 m"]),
        (&["--tip-speed-m-s", "0"], 2, &["speed limit", "is 0"]),
    ];
    for (options, code, words) in refusals {
        scratch.run(&plan("open", options)).refused(code, words);
    }
}
