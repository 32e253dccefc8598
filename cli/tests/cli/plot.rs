//! `taustream plot`: pictures of trajectory files, and what it refuses to draw.
use crate::common::{Scratch, stroke, trajectory};
use std::fs;

fn run(scratch: &Scratch, words: &str) -> crate::common::Ran {
    scratch.run(&words.split(' ').collect::<Vec<_>>())
}

#[test]
fn plot_draws_curves_and_with_a_robot_the_arm_in_three_views() {
    let scratch = Scratch::new();
    scratch.write("move.json", &trajectory(&stroke("10", "0", "0.5")));
    scratch.write("elsewhere.json", &trajectory(&stroke("10", "0", "0.5")).replace("ur5", "nobody"));
    let curves = run(&scratch, "plot elsewhere.json -o move.svg --json").json();
    assert_eq!(curves["picture"], "move.svg");
    assert!(curves["robot"].is_null(), "{curves}");
    let svg = fs::read_to_string(scratch.dir.join("move.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    assert!(svg.contains("acceleration (rad/s^2)") && !svg.contains("limit of all joints"));

    let whole = run(&scratch, "plot move.json --robot ur5 --scene pillars -o whole.svg --json").json();
    assert_eq!((&whole["robot"], &whole["picture"]), (&"ur5".into(), &"whole.svg".into()));
    assert!(whole["obstacles"].as_u64().is_some_and(|n| n > 0), "{whole}");
    let svg = fs::read_to_string(scratch.dir.join("whole.svg")).unwrap();
    for word in ["top", "front", "side", "limit of all joints", "left_pillar", "shoulder_pan"] {
        assert!(svg.contains(word), "no `{word}`");
    }

    let out = run(&scratch, "plot move.json -o -");
    assert!(out.done().starts_with("<svg"), "{}", out.out);
}

#[test]
fn plot_refuses_what_it_cannot_draw_and_leaves_no_picture() {
    let scratch = Scratch::new();
    scratch.write("move.json", &trajectory(&stroke("10", "0", "0.5")));
    scratch.write("nan.json", &trajectory(&stroke("10", "0", "NaN")));
    scratch.write(
        "other.json",
        &trajectory("")
            .replace("\"robot\":\"ur5\"", &format!("\"robot\":\"ur5\",\"digest\":\"{}\"", "0".repeat(64))),
    );
    fs::create_dir(scratch.dir.join("taken.svg")).unwrap();
    let before = scratch.files();
    run(&scratch, "plot nothing.json").refused(2, &["nothing.json"]);
    run(&scratch, "plot nan.json").refused(2, &["nan.json"]);
    scratch.write("elsewhere.json", &trajectory(&stroke("10", "0", "0.5")).replace("ur5", "nobody"));
    let before: std::collections::BTreeSet<_> =
        before.into_iter().chain(["elsewhere.json".to_owned()]).collect();
    run(&scratch, "plot elsewhere.json --scene pillars").refused(2, &["nobody", "--robot"]);
    run(&scratch, "plot move.json --robot ur9").refused(2, &["ur9"]);
    run(&scratch, "plot other.json --robot ur5").refused(2, &["other.json", "digest"]);
    run(&scratch, "plot move.json -o taken.svg").refused(1, &["taken.svg", "cannot be written"]);
    assert_eq!(scratch.files(), before);
}
