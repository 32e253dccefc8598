//! The product's planners against each other, by name, on the same problems.
//!
//! What they find is decided by the work that a deadline grants, never by the clock, so that every figure but the times
//! is the same on any machine. Times are processor time of the planning thread: on a busy machine they say more than a
//! clock on the wall. docs/planner.md holds what a full run said, and what the default was chosen by.
mod contest;
mod entrant;
mod escape;
pub mod mbm;
mod problem_file;
mod problems;
mod published;
mod standings;

pub use contest::{Contest, Run};
pub use entrant::Entrant;
pub use problems::{Problem, ProblemSet, Surroundings};
pub use published::published;

use crate::run_context::{RunContext, Stop};
use crate::table::Table;

/// What a contest came to.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Standings {
    /// What was left out of the sets, as text.
    pub notes: Vec<String>,
    /// The tables.
    pub tables: Vec<Table>,
}

/// Runs a contest.
///
/// # Errors
/// When the user ended it, or a robot's shapes cannot be built.
pub fn compare(run_context: &RunContext, contest: &Contest) -> Result<Standings, Stop> {
    let runs = contest.run(run_context)?;
    let mut tables = vec![standings::overall(contest, &runs), standings::by_set(contest, &runs)];
    run_context.say("foraging with and without virtual obstacles ..");
    tables.push(escape::table(run_context, contest)?);
    Ok(Standings { notes: contest.notes(), tables })
}

impl Standings {
    /// As Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let notes: Vec<String> = self.notes.iter().map(|note| format!("- {note}\n")).collect();
        let tables: Vec<String> = self.tables.iter().map(Table::markdown).collect();
        format!("{}\n{}", notes.concat(), tables.join("\n"))
    }
}

impl std::fmt::Display for Standings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        for table in &self.tables {
            writeln!(f, "\n{table}")?;
        }
        Ok(())
    }
}
