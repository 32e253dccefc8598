//! All experiments, quickly: every table is there, has finite numbers, and comes from the run and its seed alone.
use std::sync::OnceLock;
use taustream_claims::{
    Cell, EXPERIMENTS, Effort, PAPERS, Report, RunContext, Selection, Stop, Table, Verdict, run,
};

#[expect(clippy::unwrap_used, reason = "a helper of tests, outside of any #[test] function")]
fn report(seed: u64, jobs: usize, paper: Option<u8>) -> Report {
    let effort = Effort { runs: None, quick: true, seed, jobs };
    run(&RunContext::new(effort, &|_| (), &|| false), effort, &Selection { paper, ..Selection::default() })
        .unwrap()
}

/// One run for all tests: it is what takes the time.
fn first() -> &'static Report {
    static FIRST: OnceLock<Report> = OnceLock::new();
    FIRST.get_or_init(|| report(1, 1, None))
}

fn tables(report: &Report) -> impl Iterator<Item = (&'static str, &Table)> {
    report.chapters.iter().flat_map(|c| c.outcome.tables.iter().map(|t| (c.name, t)))
}

fn is_sample(cell: &&Cell) -> bool {
    matches!(cell, Cell::Mean(_) | Cell::Median(_) | Cell::Test(_))
}

#[test]
fn every_experiment_has_tables_with_finite_numbers_in_every_column() {
    assert_eq!(first().chapters.len(), EXPERIMENTS.len());
    for chapter in &first().chapters {
        assert!(!chapter.outcome.tables.is_empty(), "{}: no table", chapter.name);
        assert!(PAPERS.iter().any(|p| p.number == chapter.paper && p.file == chapter.file));
    }
    for (name, table) in tables(first()) {
        assert!(!table.rows.is_empty(), "{name}, {}: no rows", table.name);
        for row in &table.rows {
            let place = format!("{name}, {}, {}", table.name, row.label);
            assert_eq!(row.cells.len() + 1, table.columns.len(), "{place}: fields and columns");
            for (cell, column) in row.cells.iter().zip(&table.columns[1..]) {
                assert!(cell.is_finite(), "{place}, {column}: {cell:?}");
            }
        }
    }
}

#[test]
fn another_seed_changes_every_table_with_samples_and_no_value_of_a_paper() {
    let other = report(2, 1, None);
    let mut samples = 0;
    for ((name, a), (_, b)) in tables(first()).zip(tables(&other)) {
        let cells = |t: &'_ Table| t.rows.iter().flat_map(|r| r.cells.clone()).collect::<Vec<Cell>>();
        let papers = |t| cells(t).into_iter().filter(|c| matches!(c, Cell::Paper(_))).collect::<Vec<_>>();
        assert_eq!(papers(a), papers(b), "{name}, {}", a.name);
        let [a_samples, b_samples] =
            [a, b].map(|t| cells(t).iter().filter(is_sample).cloned().collect::<Vec<_>>());
        samples += a_samples.len();
        assert!(
            a_samples.is_empty() || a_samples != b_samples,
            "{name}, {}: the seed changes nothing",
            a.name
        );
    }
    assert!(samples > 100, "{samples} samples in all tables");
}

#[test]
fn number_of_threads_changes_nothing() {
    for paper in [3, 4] {
        let several = report(1, 3, Some(paper));
        let one: Vec<_> = first().chapters.iter().filter(|c| c.paper == paper).collect();
        assert_eq!(one, several.chapters.iter().collect::<Vec<_>>());
    }
}

#[test]
fn every_claim_has_its_rule_and_its_numbers_and_pictures_are_drawn() {
    for chapter in &first().chapters {
        for claim in &chapter.outcome.claims {
            let place = format!("{}: {}", chapter.name, claim.says);
            assert!(!claim.rule.is_empty(), "{place}: no rule");
            assert!(!claim.evidence().is_empty() || claim.verdict == Verdict::Holds, "{place}: no numbers");
        }
        for figure in &chapter.outcome.figures {
            assert!(figure.svg.contains("</svg>"), "{} is not drawn", figure.file);
            assert!(figure.svg.len() < 3_000_000, "{} has {} bytes", figure.file, figure.svg.len());
        }
    }
    let files = || first().chapters.iter().flat_map(|c| c.outcome.figures.iter().map(|f| &f.file));
    let mut unique: Vec<_> = files().collect();
    unique.sort();
    unique.dedup();
    assert_eq!(unique.len(), files().count(), "two pictures have one name");
}

#[test]
fn markdown_names_command_and_every_claim() {
    let text = first().markdown();
    assert!(text.contains("`taustream bench papers --seed 1 --quick`"), "no command");
    for claim in first().chapters.iter().flat_map(|c| &c.outcome.claims) {
        assert!(text.contains(&claim.verdict.to_string()), "{}", claim.says);
    }
    let data = serde_json::to_value(first()).unwrap();
    assert_eq!(data["chapters"].as_array().unwrap().len(), EXPERIMENTS.len());
    assert!(data["chapters"][0]["tables"][0]["rows"][0]["cells"].is_array());
}

/// Goal: a quick run proves nothing: nothing that a run decides is decided, and every chapter says why.
#[test]
fn quick_run_judges_calculations_only_and_every_chapter_says_so() {
    const SAYS: &str = "A quick run: it shows that the experiments work, and proves nothing.";
    let [text, markdown] = [first().text(120), first().markdown()];
    assert_eq!(markdown.matches(SAYS).count(), first().chapters.len() + 1);
    assert_eq!(text.matches(SAYS).count(), first().chapters.len() + 1);
    let (mut calculated, mut random) = (0, 0);
    for claim in first().chapters.iter().flat_map(|c| &c.outcome.claims) {
        let is_decided = claim.verdict != Verdict::CannotBeChecked;
        assert!(!is_decided || claim.is_exact, "{} is decided by a quick run", claim.says);
        *(if claim.is_exact { &mut calculated } else { &mut random }) += 1;
    }
    assert!(calculated > 15 && random > 30, "{calculated} calculations, {random} others");
}

#[test]
fn text_fits_into_any_terminal() {
    for columns in [60, 80, 120, 500] {
        for line in first().text(columns).lines() {
            assert!(line.chars().count() <= columns.min(120), "{columns}: {line}");
        }
    }
}

#[test]
fn page_opens_each_paper_with_source_and_index() {
    let text = first().markdown();
    for paper in &PAPERS {
        assert!(text.contains(paper.source) && text.contains(paper.did), "{}", paper.number);
    }
    // The index has two columns, the claims have five.
    let index: Vec<&str> =
        text.lines().filter(|l| l.starts_with("| ") && l.matches('|').count() == 3).collect();
    for experiment in EXPERIMENTS {
        assert!(index.iter().any(|line| line.contains(experiment.name)), "{}", experiment.name);
    }
}

#[test]
fn selection_by_name_runs_that_experiment_and_other_seeds_stand_beside() {
    let effort = Effort { runs: None, quick: true, seed: 1, jobs: 1 };
    let selection = Selection { only: Some("own rows".to_owned()), other_seeds: 2, ..Selection::default() };
    let report = run(&RunContext::new(effort, &|_| (), &|| false), effort, &selection).unwrap();
    assert_eq!(report.chapters.len(), 1);
    assert_eq!(report.other_seeds, [2, 3]);
    let command = "taustream bench papers --seed 1 --paper 3 --only \"own rows\" --seeds 3 --quick";
    assert_eq!(report.command(), command);
    for claim in &report.chapters[0].outcome.claims {
        assert_eq!(claim.agreement(), Some([2, 2]), "{}: a calculation depends on the seed", claim.says);
    }
}

/// Goal: a further master seed leaves out what no claim looks at, and no claim.
#[test]
fn further_master_seed_has_every_claim_of_the_first() {
    let effort = Effort { runs: None, quick: true, seed: 1, jobs: 1 };
    let selection = Selection { only: Some("case 1".to_owned()), other_seeds: 1, ..Selection::default() };
    let report = run(&RunContext::new(effort, &|_| (), &|| false), effort, &selection).unwrap();
    let says = |chapters: &[taustream_claims::Chapter]| -> Vec<String> {
        chapters.iter().flat_map(|c| c.outcome.claims.iter().map(|claim| claim.says.clone())).collect()
    };
    let context = RunContext::new(effort, &|_| (), &|| false);
    let experiment = EXPERIMENTS.iter().find(|e| e.name == "case 1").unwrap();
    let repeated = (experiment.run)(&context.repeated(2)).unwrap();
    assert_eq!(says(&report.chapters), repeated.claims.iter().map(|c| c.says.clone()).collect::<Vec<_>>());
    let rows = |outcome: &taustream_claims::Outcome| outcome.tables[0].rows.len();
    assert!(rows(&repeated) < rows(&report.chapters[0].outcome), "nothing was left out");
    assert!(report.chapters[0].outcome.claims.iter().all(|c| c.other_seeds.len() == 1));
}

#[test]
fn experiments_end_when_the_user_ends_them() {
    let effort = Effort { runs: None, quick: true, seed: 1, jobs: 1 };
    for paper in PAPERS.iter().filter(|p| EXPERIMENTS.iter().any(|e| e.paper == p.number)) {
        let ended = run(
            &RunContext::new(effort, &|_| (), &|| true),
            effort,
            &Selection { paper: Some(paper.number), ..Selection::default() },
        );
        assert_eq!(ended, Err(Stop::Interrupted), "paper {}", paper.number);
    }
}
