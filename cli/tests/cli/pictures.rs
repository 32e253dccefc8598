//! `taustream bench pictures`.
use crate::common::Scratch;
use std::fs;

#[test]
fn both_pictures_are_drawn_and_every_motion_keeps_its_limits() {
    let scratch = Scratch::new();
    let answer = scratch.run(&["bench", "pictures", "--json"]).json();
    let pictures = answer["pictures"].as_array().unwrap();
    assert_eq!(pictures.len(), 2);
    for (picture, name) in pictures.iter().zip(["via.svg", "replan.svg"]) {
        let svg = fs::read_to_string(scratch.dir.join(name)).unwrap();
        for motion in picture["motions"].as_array().unwrap() {
            assert!(svg.contains(motion["what"].as_str().unwrap()), "{name}: no curve of {motion}");
            for peak in motion["peaks"].as_array().unwrap() {
                assert!(peak.as_f64().unwrap() <= 1.0 + 1e-9, "{name}: {motion}");
            }
        }
    }
    let duration_s = |motion: usize| pictures[0]["motions"][motion]["duration_s"].as_f64().unwrap();
    assert!(duration_s(2) < duration_s(1) && duration_s(1) < duration_s(0), "{answer}");
}

#[test]
fn robots_and_directories_that_do_not_fit_are_refused() {
    let scratch = Scratch::new();
    scratch.run(&["bench", "pictures", "--robot", "nobody"]).refused(2, &["nobody"]);
    scratch.run(&["bench", "pictures", "-o", "nowhere"]).refused(1, &["nowhere"]);
}
