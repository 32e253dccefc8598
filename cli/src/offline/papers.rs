//! `taustream bench papers`: checks the claims of the five papers (claims/papers.md).
use crate::args::PapersArgs;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{Form, write_whole};
use serde::Serialize;
use std::fmt;
use std::fs;
use std::io::IsTerminal;
use std::path::Path;
use taustream_claims::{Report, RunContext, Stop};

/// The report, for people and programs.
#[derive(Serialize)]
#[serde(transparent)]
struct Answer(Report);

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.text(terminal_columns()))
    }
}

/// Runs the experiments, prints, and writes files where they are requested.
pub(super) fn run(form: Form, args: &PapersArgs) -> Result<(), Failure> {
    interrupt::watch()?;
    if args.selection().experiments().next().is_none() {
        let why = "--only names no experiment of that --paper; without --paper it finds one";
        return Err(Failure::Usage(why.to_owned()));
    }
    if let Some(directory) = &args.output {
        // Before the work, which may take an hour.
        fs::create_dir_all(directory).map_err(|e| Failure::writing(directory.display().to_string(), e))?;
    }
    let say = |text: &str| form.progress(text);
    let run_context = RunContext::new(args.effort(), &say, &interrupt::has_come);
    let report =
        taustream_claims::run(&run_context, args.effort(), &args.selection()).map_err(|stop| match stop {
            Stop::Interrupted => Failure::Interrupted(format!("{stop}; nothing was written")),
            Stop::Refused(_) => Failure::Failed(stop.to_string()),
        })?;
    if let Some(directory) = &args.output {
        write_all(directory, &report)?;
        form.progress(format_args!("{}: report.md, tables.json, pictures", directory.display()));
    }
    form.print(&Answer(report))
}

/// Columns of the terminal that is written to; those of a page where none is.
fn terminal_columns() -> usize {
    let terminal = std::io::stdout().is_terminal().then(crossterm::terminal::size);
    terminal.and_then(Result::ok).map_or(usize::MAX, |(columns, _)| columns.into())
}

fn write_all(directory: &Path, report: &Report) -> Result<(), Failure> {
    let json = serde_json::to_string_pretty(report)
        .map_err(|e| Failure::Failed(format!("the tables do not fit into JSON: {e}")))?;
    write_whole(&directory.join("report.md"), &report.markdown())?;
    write_whole(&directory.join("tables.json"), &json)?;
    for figure in report.chapters.iter().flat_map(|c| &c.outcome.figures) {
        write_whole(&directory.join(&figure.file), &figure.svg)?;
    }
    Ok(())
}
