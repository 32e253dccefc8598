//! Arguments of `taustream bench papers`.
use clap::Args;
use std::path::PathBuf;
use taustream_claims::{EXPERIMENTS, Effort, PAPERS, Selection};

const PAPERS_HELP: &str = "\
Examples:
  taustream bench papers --quick                        all five papers in half a minute; proves nothing
  taustream bench papers --paper 3 -o paper-003         report.md, tables.json and pictures in that directory
  taustream bench papers --paper 1 --runs 5 --jobs 2    fewer runs than the paper's 30
  taustream bench papers --only energy                  one experiment
  taustream bench papers --seeds 4 -o page              the page claims/papers.md, with four master seeds
  taustream bench papers --quick --json | jq '.chapters[].claims[] | {says, verdict}'

Papers: 0 or 000_518aefc8cd38e163 (IBFOA, Tau-J*), 1 or 001_5e4af5ebec08e134 (ISMA, B-splines), 2 or
002_3862cf3632de683b (virtual obstacles), 3 or 003_b15e0e655e3bf4df (IEPSO, reward), 4 or 004_e19ad8423bd62d7d (IWO).

Each table has the value that the paper prints, ours to the letter of the paper (printed) and ours with its errors
corrected (corrected). Two methods are compared pair by pair at equal evaluations; an effect stands with its 95 %
interval and the margin below which it counts as none. The result of a claim (holds, does not hold, not told apart,
cannot be checked) follows from the numbers by the rule beside it. The papers' own values are the only constants.
One seed gives one result with any --jobs. Ctrl-C aborts without output. With --quick nothing random is decided.
A full run takes about ten minutes, mostly papers 0 and 1; each further master seed takes as long again. Where master
seeds give different verdicts, the result is not told apart, and the report names the row.";

/// `taustream bench papers`
#[derive(Args, Debug)]
#[command(after_help = PAPERS_HELP)]
pub(crate) struct PapersArgs {
    /// Run one paper only, by its number; without it all five.
    #[arg(long, value_name = "N", value_parser = paper)]
    pub(crate) paper: Option<u8>,
    /// Run only the experiments whose name contains this: "case 1", "via points", "spline".
    #[arg(long, value_name = "NAME", value_parser = experiment)]
    pub(crate) only: Option<String>,
    /// Number of master seeds, counting up from --seed; a verdict that they do not all give is "not told apart".
    #[arg(long, value_name = "K", allow_negative_numbers = true, default_value_t = 1, value_parser = seeds)]
    pub(crate) seeds: u64,
    /// Number of runs of each experiment; without it the papers' own numbers (or, with --quick, few).
    #[arg(long, value_name = "R", allow_negative_numbers = true, value_parser = runs)]
    pub(crate) runs: Option<usize>,
    /// Do few and short runs.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Threads.
    #[arg(long, value_name = "J", allow_negative_numbers = true, default_value_t = 1, value_parser = jobs)]
    pub(crate) jobs: usize,
    /// Directory to write report.md, tables.json and the pictures into; created if missing.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
}

impl PapersArgs {
    /// Which experiments, and with how many master seeds.
    pub(crate) fn selection(&self) -> Selection {
        Selection { paper: self.paper, only: self.only.clone(), other_seeds: self.seeds - 1 }
    }

    /// The extent of the experiments.
    pub(crate) fn effort(&self) -> Effort {
        Effort { runs: self.runs, quick: self.quick, seed: self.seed, jobs: self.jobs }
    }
}

/// A paper by number, or by the name of its file with or without an ending.
fn paper(text: &str) -> Result<u8, String> {
    let word = text.rsplit('/').next().unwrap_or(text);
    let word = word.strip_suffix(".txt").unwrap_or(word);
    let is_meant = |p: &&taustream_claims::Paper| p.file == word || word.parse() == Ok(p.number);
    PAPERS.iter().find(is_meant).map(|p| p.number).ok_or_else(|| {
        let all: Vec<String> = PAPERS.iter().map(|p| format!("{} ({})", p.number, p.file)).collect();
        format!("there is no such paper; there are {}", all.join(", "))
    })
}

/// A part of the name of some experiment.
fn experiment(text: &str) -> Result<String, String> {
    let word = text.trim().to_lowercase();
    if !word.is_empty() && EXPERIMENTS.iter().any(|e| e.name.contains(&word)) {
        return Ok(word);
    }
    let names: Vec<String> = EXPERIMENTS.iter().map(|e| format!("{:?}", e.name)).collect();
    Err(format!("there is no such experiment; there are {}", names.join(", ")))
}

fn seeds(text: &str) -> Result<u64, String> {
    whole(text, 100).map(|seeds| seeds as u64)
}

fn runs(text: &str) -> Result<usize, String> {
    whole(text, 100_000)
}

fn jobs(text: &str) -> Result<usize, String> {
    whole(text, 256)
}

fn whole(text: &str, most: usize) -> Result<usize, String> {
    match text.parse() {
        Ok(number) if (1..=most).contains(&number) => Ok(number),
        _ => Err(format!("expected a whole number from 1 to {most}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_is_known_by_number_and_by_file() {
        for (text, number) in [
            ("0", 0),
            ("003", 3),
            ("4", 4),
            ("001_5e4af5ebec08e134", 1),
            ("seeds/002_3862cf3632de683b.txt", 2),
        ] {
            assert_eq!(paper(text), Ok(number), "{text}");
        }
        for text in ["", "5", "-1", "one", "003_", "999999999999999999999"] {
            assert!(paper(text).is_err(), "{text}");
        }
    }
}
