//! All experiments of some papers, one after another, as text, Markdown and data.
use crate::claim::{Claim, Verdict};
use crate::index;
use crate::looks::design;
use crate::registry::{EXPERIMENTS, Experiment, Outcome, PAPERS, Paper};
use crate::run_context::{Effort, RunContext, Stop};
use crate::wrap::wrapped;
use rustix::time::{ClockId, clock_gettime};
use std::fmt::{self, Write};

/// What a quick run says of itself, wherever it says something.
const QUICK: &str = "A quick run: it shows that the experiments work, and proves nothing.";
/// What a reader of the page needs to know first; `{design}` is the numbers of runs.
const GUIDE: &str = "\
# The five papers: which of their claims hold

How to read the rows:

- A verdict has four words. *Holds*: the interval of the effect lies on the claimed side. *Does not hold*: it lies below the margin, or a \
  calculation or a counterexample refutes the claim. *Not told apart*: neither, after all runs that the row may have. *Cannot be checked*: the \
  paper does not give what a check needs.
- An effect stands with its interval in brackets and, where it is a test, with p and the number of pairs; the margin stands in the rule. \
  Medians stand beside means.
- More evidence goes where it is needed. These experiments are looked at after so many runs or scenes: {design}. A row whose word is settled \
  at a look keeps that look's word and numbers and asks for no more; the others go on. Each look has its share of the 5 % (5 % over the number \
  of looks, Bonferroni), so that all looks together err no more often than one: the intervals of these rows are wider than those of 95 %, and \
  the tables', which have 95 % and all runs, are not. All other intervals are those of 95 %.
- A number that a paper does not print is swept over a decade round ours; *at some value* is the best that can be said for a claim, *whatever \
  is not printed* the most. Among many values some words come by chance. What one value decides alone is held to 5 % over the number of values: \
  that the claim holds at some value, or that it does not hold at every one. What has to be so at all values needs 5 % at each.
- Margins, looks and numbers of runs were set on 30 November 2026 before the runs of this page and are the same for all seeds. No margin was \
  changed after a run. How far the looks of case 1 and of the reward go was set after trials with the same seeds, which left rows open. These rules are younger than a first page of that day, in which 24 of 126 rows depended on the seed: the looks and the \
  shares of the 5 %; functions of paper 001 are moved by another vector in each run instead of one for each master seed, which made the words \
  those of one place; each of the six functions has a sixth of the level where wins are counted (*improves SMA's search*); a collision of the \
  three planners is looked for in up to 240 scenes instead of 30; the number of virtual obstacles is compared with medians over sizes instead \
  of the least and the most of 30 runs; intervals of signed ranks are exact up to 50 pairs, which makes them a little wider. The rows \
  *more stable* leave out scenes in which a population ends in collision, since one such scene decided them in a first run of 40 scenes (seed 1); \
  that they ask for no scenes of their own was set after such a trial as well.
- The experiment runs again with other master seeds. The column *other seeds* says how many of them give the word of the first one. Where one \
  of them gives another word, the claim is *not told apart*, whatever the first seed says, and the row is listed below with its words.
- *Printed* follows the paper to the letter. *Corrected* replaces an error of print by what must have been meant; the files of \
  `optimizers/src` and `optimizers/src/papers` say what. The papers' own values are the only constants.
- Methods are compared run by run with the same random numbers, at equal evaluations where that is said. Costs and numbers of evaluations do \
  not depend on the machine; times are ratios.

";
/// Width of a page that no terminal states.
const COLUMNS: usize = 120;

/// One experiment's outcome.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Chapter {
    /// Number of the paper.
    pub paper: u8,
    /// The paper's file.
    pub file: &'static str,
    /// Name of the experiment.
    pub name: &'static str,
    /// What came of it.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What to run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Number of the paper; all five without.
    pub paper: Option<u8>,
    /// What the experiment's name contains; all without.
    pub only: Option<String>,
    /// Further master seeds whose verdicts stand beside.
    pub other_seeds: u64,
}

impl Selection {
    /// The experiments, in the order of the papers.
    pub fn experiments(&self) -> impl Iterator<Item = &'static Experiment> + '_ {
        let is_paper = |e: &Experiment| self.paper.is_none_or(|paper| paper == e.paper);
        let is_named = |e: &Experiment| self.only.as_ref().is_none_or(|only| e.name.contains(only.as_str()));
        EXPERIMENTS.iter().filter(move |e| is_paper(e) && is_named(e))
    }
}

/// Everything.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// How much work it was.
    pub effort: Effort,
    /// What the experiments' names contain; none for all.
    pub only: Option<String>,
    /// Further master seeds whose verdicts stand beside.
    pub other_seeds: Vec<u64>,
    /// Processor time of all of it (s).
    pub took_s: f64,
    /// Experiment by experiment.
    pub chapters: Vec<Chapter>,
}

/// Runs the selected experiments.
///
/// # Errors
/// When the user ended it, or an experiment was refused.
pub fn run(run_context: &RunContext, effort: Effort, selection: &Selection) -> Result<Report, Stop> {
    let began_s = processor_s();
    let mut chapters = chapters(run_context, effort, selection)?;
    let other_seeds: Vec<u64> = (1..=selection.other_seeds).map(|i| effort.seed.wrapping_add(i)).collect();
    for seed in &other_seeds {
        run_context.say(&format!("master seed {seed} .."));
        let others = self::chapters(&run_context.repeated(*seed), effort, selection)?;
        for (chapter, other) in chapters.iter_mut().zip(others) {
            for (claim, again) in chapter.outcome.claims.iter_mut().zip(other.outcome.claims) {
                claim.repeat([again.verdict]);
            }
        }
    }
    let took_s = processor_s() - began_s;
    Ok(Report { effort, only: selection.only.clone(), other_seeds, took_s, chapters })
}

/// Processor time of the process so far, s.
fn processor_s() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

fn chapters(run_context: &RunContext, effort: Effort, selection: &Selection) -> Result<Vec<Chapter>, Stop> {
    let mut chapters = Vec::new();
    for experiment in selection.experiments() {
        let file = paper(experiment.paper).map_or("", |p| p.file);
        run_context.say(&format!("paper {:03}: {} ..", experiment.paper, experiment.name));
        let mut outcome = (experiment.run)(run_context)?;
        if effort.quick {
            outcome.claims.iter_mut().for_each(Claim::unproven);
        }
        chapters.push(Chapter { paper: experiment.paper, file, name: experiment.name, outcome });
    }
    Ok(chapters)
}

fn paper(number: u8) -> Option<&'static Paper> {
    PAPERS.iter().find(|p| p.number == number)
}

impl Report {
    /// The command that repeats it.
    #[must_use]
    pub fn command(&self) -> String {
        let Effort { runs, quick, seed, .. } = self.effort;
        let mut command = format!("taustream bench papers --seed {seed}");
        let first = self.chapters.first().map(|c| c.paper);
        if let Some(paper) = first.filter(|p| self.chapters.iter().all(|c| c.paper == *p)) {
            let _ = write!(command, " --paper {paper}");
        }
        if let Some(only) = &self.only {
            let _ = write!(command, " --only \"{only}\"");
        }
        if !self.other_seeds.is_empty() {
            let _ = write!(command, " --seeds {}", self.other_seeds.len() + 1);
        }
        if let Some(runs) = runs {
            let _ = write!(command, " --runs {runs}");
        }
        command + if quick { " --quick" } else { "" }
    }

    /// Where it comes from: command, time, and how far the words depend on the seed.
    fn origin(&self) -> String {
        let mut text = format!("Made by `{}` in {:.0} s of one processor.", self.command(), self.took_s);
        let claims = || self.chapters.iter().flat_map(|c| &c.outcome.claims);
        if !self.other_seeds.is_empty() {
            let (of, exact) = (claims().count(), claims().filter(|c| c.is_exact).count());
            let each = self.other_seeds.iter().enumerate().map(|(i, seed)| {
                let same = claims().filter(|c| c.other_seeds.get(i) == Some(&c.first_seed)).count();
                let share = 100.0 * same as f64 / of.max(1) as f64;
                format!(
                    "master seed {seed} gives the word of seed {} in {same} of {of} rows ({share:.1} %)",
                    self.effort.seed
                )
            });
            text += &format!(
                " {}. {exact} of the rows are calculations, which no seed changes.",
                each.collect::<Vec<_>>().join("; ")
            );
        }
        text
    }

    /// Rows whose word depends on the master seed, with the words.
    fn wavering(&self) -> Vec<String> {
        let rows = self.chapters.iter().flat_map(|c| c.outcome.claims.iter().map(move |claim| (c, claim)));
        let words = |(chapter, claim): (&Chapter, &Claim)| {
            let others: Vec<String> = claim.other_seeds.iter().map(Verdict::to_string).collect();
            let (paper, name, says) = (chapter.paper, chapter.name, &claim.says);
            format!("{paper:03}, {name}: {says}: {}, then {}", claim.first_seed, others.join(", "))
        };
        rows.filter(|(_, claim)| claim.depends_on_the_seed()).map(words).collect()
    }

    /// As Markdown; pictures are named by their files.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = GUIDE.replace("{design}", &design()) + &self.origin() + "\n";
        if self.effort.quick {
            let _ = write!(text, "\n{QUICK}\n");
        }
        let wavering = self.wavering();
        if !wavering.is_empty() {
            text += "\nRows whose word depends on the master seed, which are therefore not told apart:\n\n";
            wavering.iter().for_each(|row| text += &format!("- {row}\n"));
        }
        let mut last = None;
        for chapter in &self.chapters {
            if last.replace(chapter.paper) != Some(chapter.paper)
                && let Some(paper) = paper(chapter.paper)
            {
                text += &opening(paper);
            }
            text += &chapter.markdown(self.effort.quick);
        }
        text
    }

    /// As text for a terminal of so many columns; 120 at most.
    #[must_use]
    pub fn text(&self, columns: usize) -> String {
        let columns = columns.clamp(40, COLUMNS);
        let mut text = String::new();
        for chapter in &self.chapters {
            text += &chapter.text(columns, self.effort.quick);
        }
        for row in self.wavering() {
            text += &wrapped(&format!("depends on the seed: {row}"), columns, "  ");
        }
        text += &wrapped(&self.origin(), columns, "");
        if self.effort.quick {
            text += &wrapped(QUICK, columns, "");
        }
        text.trim_end().to_owned()
    }
}

/// Title, source, what the paper did, and where each of its systems, tables and figures is checked.
fn opening(paper: &Paper) -> String {
    let Paper { number, about, source, did, .. } = paper;
    let mut text = format!("\n## {number:03}: {about}\n\n{source}\n\n{did}\n");
    text += "\n| system, table or figure | row, or the reason for none |\n|---|---|\n";
    for (what, row) in index::of(*number) {
        let _ = writeln!(text, "| {what} | {row} |");
    }
    text
}

impl Chapter {
    fn markdown(&self, is_quick: bool) -> String {
        let outcome = &self.outcome;
        let mut text = format!("\n### {:03}: {}\n", self.paper, self.name);
        if is_quick {
            let _ = write!(text, "\n{QUICK}\n");
        }
        if !outcome.ours.is_empty() {
            let _ = write!(text, "\nNot in the paper, ours: {}.\n", outcome.ours.join("; "));
        }
        if !outcome.claims.is_empty() {
            text += "\n| the paper says | verdict | other seeds | rule | numbers |\n|---|---|---|---|---|\n";
        }
        for claim in &outcome.claims {
            let evidence = claim.evidence();
            let [says, rule, numbers] = [&claim.says, &claim.rule, &evidence].map(|t| t.replace('|', "\\|"));
            let seeds = claim.agreement().map_or("-".to_owned(), |[same, of]| format!("{same} of {of}"));
            let _ = writeln!(text, "| {says} | **{}** | {seeds} | {rule} | {numbers} |", claim.verdict);
        }
        for table in &outcome.tables {
            let _ = write!(text, "\n{}", table.markdown());
        }
        for figure in &outcome.figures {
            // The page stands where the pictures do not.
            let _ =
                write!(text, "\nPicture `{}` (written beside the report): {}.\n", figure.file, figure.title);
        }
        text
    }

    fn text(&self, columns: usize, is_quick: bool) -> String {
        let outcome = &self.outcome;
        let title = format!("paper {:03} ({}): {}", self.paper, self.file, self.name);
        let mut text = wrapped(&title, columns, "  ");
        if is_quick {
            text += &wrapped(QUICK, columns, "");
        }
        if !outcome.ours.is_empty() {
            text += &wrapped(&format!("not in the paper, ours: {}", outcome.ours.join("; ")), columns, "  ");
        }
        for table in &outcome.tables {
            let _ = write!(text, "\n{}", table.text(columns));
        }
        text.push('\n');
        if !outcome.claims.is_empty() {
            text += "claims:\n";
        }
        for claim in &outcome.claims {
            text += &wrapped(
                &format!("{}: {}", claim.verdict.to_string().to_uppercase(), claim.says),
                columns,
                "  ",
            );
            let lines =
                [Some(format!("rule: {}", claim.rule)), Some(claim.evidence()).filter(|t| !t.is_empty())];
            for line in lines.into_iter().flatten() {
                text += &wrapped(&format!("    {line}"), columns, "      ");
            }
        }
        text.push('\n');
        text
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(COLUMNS))
    }
}

impl fmt::Display for Chapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(COLUMNS, false))
    }
}
