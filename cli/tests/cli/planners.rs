//! `taustream bench planners`, quickly.
use crate::common::Scratch;
use serde_json::Value;

const NAMES: &str = "auto,rrt-connect,rbf,auto+searches";

#[test]
fn planners_are_compared_and_the_tables_written() {
    let scratch = Scratch::new();
    let words = ["bench", "planners", "--quick", "--planners", NAMES, "-o", "out", "--json"];
    let answer = scratch.run(&words).json();
    let tables = answer["tables"].as_array().expect("tables");
    assert_eq!(tables.len(), 3, "{answer}");
    let rows = |table: &Value| table["rows"].as_array().expect("rows").len();
    assert_eq!([rows(&tables[0]), rows(&tables[1]), rows(&tables[2])], [4, 4, 5]);
    let share = &tables[0]["rows"][0]["cells"][0]["share"];
    assert_eq!(share["of"], 8, "two problems of four sets: {share}");
    assert!(share["count"].as_u64() >= Some(7), "the default finds what has a solution: {share}");
    let text = std::fs::read_to_string(scratch.dir.join("out/planners.md")).expect("written");
    assert!(text.contains("--quick") && text.contains("| rbf |"), "{text}");
    assert!(scratch.dir.join("out/planners.json").exists());
}

#[test]
fn planners_bad_words_are_refused_with_what_there_is() {
    let scratch = Scratch::new();
    for (words, why) in [
        (["--planners", "teleport"], "auto+METHOD"),
        (["--planners", "auto+teleport"], "auto+METHOD"),
        (["--problems", "0"], "1 to 10000"),
        (["--deadline-ms", "0"], "1..=60000"),
        (["--published", "nowhere"], "nowhere"),
        (["--robot", "nobody"], "nobody"),
        (["--scene", "nowhere"], "nowhere"),
    ] {
        scratch.run(&[["bench", "planners", "--quick"].as_slice(), &words].concat()).refused(2, &[why]);
    }
}
