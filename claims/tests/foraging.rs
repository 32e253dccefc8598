//! Papers 000 and 002, quickly: whole tables, one answer for one seed on any number of threads, no constants of ours.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
use taustream_claims::{Cell, Effort, Report, RunContext, Selection, Stop, Verdict, run};

fn quick(seed: u64, jobs: usize, paper: u8) -> Report {
    let effort = Effort { runs: None, quick: true, seed, jobs };
    run(
        &RunContext::new(effort, &|_| (), &|| false),
        effort,
        &Selection { paper: Some(paper), ..Selection::default() },
    )
    .expect("sane numbers")
}

/// The tables and verdicts, without how many threads made them.
fn claims_of(report: &Report) -> Vec<String> {
    report.chapters.iter().map(ToString::to_string).collect()
}

#[test]
fn experiments_of_papers_000_and_002_are_whole_and_repeat_on_any_number_of_threads() {
    for (paper, chapters) in [(0, 7), (2, 3)] {
        let report = quick(1, 1, paper);
        assert_eq!(report.chapters.len(), chapters);
        for chapter in &report.chapters {
            let outcome = &chapter.outcome;
            assert!(!outcome.claims.is_empty(), "{}: nothing is checked", chapter.name);
            for table in &outcome.tables {
                assert!(!table.rows.is_empty(), "{}: empty", table.name);
                for row in &table.rows {
                    assert_eq!(row.cells.len() + 1, table.columns.len(), "{}: {}", table.name, row.label);
                    assert!(row.cells.iter().all(Cell::is_finite), "{}: {}", table.name, row.label);
                }
            }
            for figure in &outcome.figures {
                assert!(figure.svg.contains("</svg>"), "{} is empty", figure.file);
            }
        }
        assert_eq!(
            claims_of(&quick(1, 3, paper)),
            claims_of(&report),
            "paper {paper}: threads change the answer"
        );
        // Only the interpolators and the potential field have nothing random.
        let other = claims_of(&quick(2, 1, paper));
        let same = claims_of(&report).iter().zip(&other).filter(|(a, b)| a == b).count();
        assert_eq!(same, usize::from(paper == 0), "paper {paper}: another seed, the same numbers");
    }
}

/// Goal: verdicts follow from numbers: those that are a matter of calculation, and not of the number of runs, come out
/// as they must.
#[test]
fn verdicts_that_need_no_runs_are_those_of_calculation() {
    let report = quick(3, 1, 0);
    let claims = || report.chapters.iter().flat_map(|c| &c.outcome.claims);
    let verdict = |start: &str| {
        let mut found = claims().filter(|c| c.says.starts_with(start));
        let claim = found.next().expect("a claim");
        assert!(found.next().is_none(), "{start}: claimed twice");
        claim.verdict
    };
    let known = [
        ("Tau-J* has zero jerk", Verdict::Holds),
        ("Tau-J has non-zero jerk", Verdict::DoesNotHold),
        ("The cubic spline's acceleration", Verdict::Holds),
        ("Tau-J* guides the more compliant", Verdict::DoesNotHold),
        ("The penalty of eq. 3.8 and 3.9", Verdict::CannotBeChecked),
        ("Table 2 shows IBFOA to be better than BFOA and BSO (case 1)", Verdict::DoesNotHold),
    ];
    for (start, expected) in known {
        assert_eq!(verdict(start), expected, "{start}");
    }
}

#[test]
fn experiments_end_on_request() {
    let effort = Effort { runs: None, quick: true, seed: 1, jobs: 2 };
    for paper in [0, 2] {
        let over = RunContext::new(effort, &|_| (), &|| true);
        assert_eq!(
            run(&over, effort, &Selection { paper: Some(paper), ..Selection::default() }).err(),
            Some(Stop::Interrupted),
            "paper {paper}"
        );
    }
}
