//! `taustream bench papers`.
use crate::common::Scratch;
use std::fs;

#[test]
fn bench_papers_answers_in_words_and_data_and_writes_what_it_is_asked_for() {
    let scratch = Scratch::new();
    let text =
        scratch.run(&["bench", "papers", "--quick", "--paper", "4", "-o", "checked"]).done().to_owned();
    for word in ["paper 004", "CANNOT BE CHECKED", "rule:", "claims:"] {
        assert!(text.contains(word), "no `{word}`: {text}");
    }
    let checked = scratch.dir.join("checked");
    let report = fs::read_to_string(checked.join("report.md")).unwrap();
    assert!(report.contains("`taustream bench papers --seed 1 --paper 4 --quick`"), "{report}");
    let data: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(checked.join("tables.json")).unwrap()).unwrap();
    let mut pictures = 0;
    for chapter in data["chapters"].as_array().unwrap() {
        assert_eq!(chapter["paper"], 4);
        for figure in chapter["figures"].as_array().unwrap() {
            let svg = fs::read_to_string(checked.join(figure["file"].as_str().unwrap())).unwrap();
            assert!(svg.contains("</svg>"), "{figure}");
            pictures += 1;
        }
    }
    assert!(pictures > 0, "no pictures");

    let by_name = ["bench", "papers", "--quick", "--paper", "004_e19ad8423bd62d7d", "--jobs", "3", "--json"];
    let answer: serde_json::Value = serde_json::from_str(scratch.run(&by_name).done()).unwrap();
    assert_eq!(answer["chapters"], data["chapters"], "threads or the form of the answer change it");
}

#[test]
fn bench_papers_refuses_papers_runs_and_jobs_that_make_no_sense() {
    let scratch = Scratch::new();
    for (words, reason) in [
        (["--paper", "5"], "there is no such paper"),
        (["--paper", "nan"], "there is no such paper"),
        (["--runs", "0"], "from 1 to 100000"),
        (["--runs", "-1"], "from 1 to 100000"),
        (["--runs", "1e9"], "from 1 to 100000"),
        (["--jobs", "0"], "from 1 to 256"),
        (["--jobs", "257"], "from 1 to 256"),
        (["--seed", "-1"], "invalid value"),
    ] {
        scratch.run(&["bench", "papers", words[0], words[1], "--quick"]).refused(2, &[reason]);
    }
    let file = scratch.write("taken", "");
    let directory = file.display().to_string();
    let run = scratch.run(&["bench", "papers", "--quick", "--paper", "4", "-o", &directory]);
    run.refused(1, &["cannot be written", &directory]);
}
