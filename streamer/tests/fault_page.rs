//! The page for users against the code: every reason in its exact words, and no row for a reason that does not exist.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test ends by panicking")]
use std::collections::BTreeSet;
use taustream_drivers::bring_up::BringUpFault;
use taustream_messages::{BusFault, FaultReason, Phase, Rejection};

const PAGE: &str = include_str!("../../docs/faults.md");

/// The first cells of a section's table, without their back-ticks.
fn rows(page: &str, section: &str) -> BTreeSet<String> {
    let heading = format!("\n## {section}\n");
    let rest = page.split_once(&heading).unwrap_or_else(|| panic!("the page has no section `{section}`")).1;
    let body = rest.split_once("\n## ").map_or(rest, |(body, _)| body);
    let cells = body.lines().filter_map(|line| line.strip_prefix("| `")?.split_once('`'));
    cells.map(|(word, _)| word.to_owned()).collect()
}

/// Every rejection, with numbers that do not matter; a new variant makes the match below fail to compile.
fn rejections() -> Vec<String> {
    let all = [
        Rejection::Malformed("x".into()),
        Rejection::WrongRobot,
        Rejection::JointCount { got: 0, expected: 0 },
        Rejection::StaleGeneration { got: 0, newest: 0 },
        Rejection::Limit { joint: 0, at_s: 0.0, value: 0.0, limit: 0.0, what: String::new() },
        Rejection::NotAtBase { joint: 0, by_rad: 0.0 },
        Rejection::NotReady { phase: Some(Phase::Paused) },
        Rejection::CutPassed { at_s: 0.0, by_s: 0.0 },
        Rejection::CutOutside { at_s: 0.0, begins_s: 0.0, ends_s: 0.0 },
        Rejection::OtherTrajectory { cut: 0, running: 0 },
        Rejection::NothingToCut { phase: Some(Phase::Holding) },
        Rejection::SpeedChanges,
        Rejection::KeptStrokesDiffer { stroke: 0 },
        Rejection::KeptBaseDiffers { joint: 0, by_rad: 0.0 },
        Rejection::TooLate { late_s: 0.0 },
        Rejection::Busy,
    ];
    for rejection in &all {
        match rejection {
            Rejection::Malformed(_)
            | Rejection::WrongRobot
            | Rejection::JointCount { .. }
            | Rejection::StaleGeneration { .. }
            | Rejection::Limit { .. }
            | Rejection::NotAtBase { .. }
            | Rejection::NotReady { .. }
            | Rejection::CutPassed { .. }
            | Rejection::CutOutside { .. }
            | Rejection::OtherTrajectory { .. }
            | Rejection::NothingToCut { .. }
            | Rejection::SpeedChanges
            | Rejection::KeptStrokesDiffer { .. }
            | Rejection::KeptBaseDiffers { .. }
            | Rejection::TooLate { .. }
            | Rejection::Busy => {}
        }
    }
    all.iter().map(ToString::to_string).collect()
}

/// What page and code disagree about; empty when they agree.
fn differences(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut compare = |section: &str, requested: BTreeSet<String>| {
        let written = rows(page, section);
        found.extend(requested.difference(&written).map(|word| format!("{section}: no row for `{word}`")));
        found.extend(written.difference(&requested).map(|word| format!("{section}: nothing says `{word}`")));
    };
    compare("Reasons", FaultReason::ALL.iter().map(|r| r.word().to_owned()).collect());
    compare("Buses", BusFault::ALL.iter().map(|t| t.word().to_owned()).collect());
    let finding = |t: &BringUpFault| t.sentence().split(';').next().unwrap().to_owned();
    compare("What is found about a drive", BringUpFault::ALL.iter().map(finding).collect());
    // Receipts carry numbers: each begins with its row's words, and each row begins one.
    let (receipts, rows) = (rejections(), rows(page, "Rejected trajectories"));
    let begins = |receipt: &String| rows.iter().any(|row| receipt.starts_with(row.as_str()));
    found.extend(receipts.iter().filter(|r| !begins(r)).map(|r| format!("no row for the receipt `{r}`")));
    let used = |row: &&String| receipts.iter().any(|receipt| receipt.starts_with(row.as_str()));
    found.extend(rows.iter().filter(|row| !used(row)).map(|row| format!("no receipt says `{row}`")));
    found
}

#[test]
fn fault_page_has_every_reason_of_the_code_and_no_other() {
    assert_eq!(differences(PAGE), Vec::<String>::new());
}

/// Goal: the comparison can fail, both ways, in each section.
#[test]
fn fault_page_that_was_corrupted_is_noticed() {
    for word in ["loop stalled (s)", "controller is bus-off", "the drive does not answer", "busy: "] {
        let row = format!("\n| `{word}`");
        assert!(PAGE.contains(&row), "`{word}` is not on the page");
        let other = PAGE.replacen(&row, "\n| `an invented word`", 1);
        assert_eq!(differences(&other).len(), 2, "{word}: {:?}", differences(&other));
    }
}
