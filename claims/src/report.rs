//! All experiments of some papers, one after another, as text, Markdown and data.
use crate::registry::{EXPERIMENTS, Outcome, PAPERS};
use crate::run_context::{Effort, RunContext, Stop};
use std::fmt;

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

/// Everything.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// How much work it was.
    pub effort: Effort,
    /// Experiment by experiment.
    pub chapters: Vec<Chapter>,
}

/// Runs the experiments of a paper, or of all five.
///
/// # Errors
/// When the user ended it, or an experiment was refused.
pub fn run(run_context: &RunContext, effort: Effort, paper: Option<u8>) -> Result<Report, Stop> {
    let mut chapters = Vec::new();
    for experiment in EXPERIMENTS.iter().filter(|e| paper.is_none_or(|p| p == e.paper)) {
        let file = PAPERS.iter().find(|p| p.number == experiment.paper).map_or("", |p| p.file);
        run_context.say(&format!("paper {:03}: {} ..", experiment.paper, experiment.name));
        let outcome = (experiment.run)(run_context)?;
        chapters.push(Chapter { paper: experiment.paper, file, name: experiment.name, outcome });
    }
    Ok(Report { effort, chapters })
}

impl Report {
    /// The command that repeats it.
    #[must_use]
    pub fn command(&self) -> String {
        let Effort { runs, quick, seed, .. } = self.effort;
        let mut command = format!("taustream bench papers --seed {seed}");
        let first = self.chapters.first().map(|c| c.paper);
        if let Some(paper) = first.filter(|p| self.chapters.iter().all(|c| c.paper == *p)) {
            command += &format!(" --paper {paper}");
        }
        if let Some(runs) = runs {
            command += &format!(" --runs {runs}");
        }
        command + if quick { " --quick" } else { "" }
    }

    /// As Markdown; pictures are referred to by their file names.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!("Made by `{}`.\n", self.command());
        if self.effort.quick {
            text += "\nA quick run: it shows that the experiments work, and proves nothing.\n";
        }
        for chapter in &self.chapters {
            text += &chapter.markdown();
        }
        text
    }
}

impl Chapter {
    fn markdown(&self) -> String {
        let outcome = &self.outcome;
        let mut text = format!("\n## {:03}: {}\n", self.paper, self.name);
        if !outcome.ours.is_empty() {
            text += &format!("\nNot in the paper, ours: {}.\n", outcome.ours.join("; "));
        }
        if !outcome.claims.is_empty() {
            text += "\n| the paper says | verdict | rule | numbers |\n|---|---|---|---|\n";
        }
        for claim in &outcome.claims {
            let [says, rule, numbers] =
                [&claim.says, &claim.rule, &claim.numbers].map(|t| t.replace('|', "\\|"));
            text += &format!("| {says} | **{}** | {rule} | {numbers} |\n", claim.verdict);
        }
        for table in &outcome.tables {
            text += &format!("\n{}", table.markdown());
        }
        for figure in &outcome.figures {
            text += &format!("\n![{}]({})\n", figure.title, figure.file);
        }
        text
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for chapter in &self.chapters {
            write!(f, "{chapter}")?;
        }
        let verdicts = self.chapters.iter().flat_map(|c| &c.outcome.claims).map(|c| c.verdict.to_string());
        let mut counts = std::collections::BTreeMap::new();
        for verdict in verdicts {
            *counts.entry(verdict).or_insert(0) += 1;
        }
        let counts: Vec<String> = counts.into_iter().map(|(v, n)| format!("{n} {v}")).collect();
        write!(f, "claims: {}", counts.join(", "))
    }
}

impl fmt::Display for Chapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let outcome = &self.outcome;
        writeln!(f, "== paper {:03}, {} ==\n", self.paper, self.name)?;
        for ours in &outcome.ours {
            writeln!(f, "not in the paper, ours: {ours}")?;
        }
        for table in &outcome.tables {
            writeln!(f, "\n{table}")?;
        }
        for claim in &outcome.claims {
            writeln!(f, "{:>17}: {}", claim.verdict.to_string().to_uppercase(), claim.says)?;
            writeln!(f, "{:>19}rule: {}\n{:>19}{}", "", claim.rule, "", claim.numbers)?;
        }
        writeln!(f)
    }
}
