//! Manual pages and completion scripts, made of the definitions that read the command line: neither can grow old.
use crate::args::{Cli, EXIT_CODES, ManArgs, SAFETY};
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use serde::Serialize;
use std::fmt;
use std::fs;
use std::io;

/// What the pages are about, in their headers.
const MANUAL: &str = "taustream manual";
/// Where they come from, in their footers.
const SOURCE: &str = concat!("taustream ", env!("CARGO_PKG_VERSION"));
/// Beginnings of a paragraph of the help, and the section that it becomes.
const SECTIONS: [(&str, &str); 4] = [
    ("Example", "EXAMPLES"),
    ("Exit code", "EXIT STATUS"),
    ("Exit status", "EXIT STATUS"),
    ("taustream is not a safety function", "SAFETY"),
];

/// One manual page.
struct Page {
    /// Its file: "taustream-plan.1".
    file: String,
    roff: String,
}

/// What was written.
#[derive(Debug, Serialize)]
struct Written {
    directory: String,
    pages: Vec<String>,
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} pages in {}: {}", self.pages.len(), self.directory, self.pages.join(", "))
    }
}

/// A text that is the whole answer.
#[derive(Serialize)]
struct Text {
    name: String,
    text: String,
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Writes all pages, or prints that of `taustream`.
pub(crate) fn run(form: Form, args: &ManArgs) -> Result<(), Failure> {
    let pages = pages().map_err(|e| Failure::writing("the manual", e))?;
    let Some(directory) = &args.directory else {
        let first = pages.into_iter().next().map(|page| Text { name: page.file, text: page.roff });
        return first.map_or(Ok(()), |text| form.print(&text));
    };
    fs::create_dir_all(directory).map_err(|e| Failure::writing(directory.display().to_string(), e))?;
    for page in &pages {
        write_whole(&directory.join(&page.file), &page.roff)?;
    }
    let pages = pages.into_iter().map(|page| page.file).collect();
    form.print(&Written { directory: directory.display().to_string(), pages })
}

/// Prints a completion script.
pub(crate) fn completions(form: Form, shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::definition(), "taustream", &mut script);
    let text = String::from_utf8_lossy(&script).into_owned();
    form.print(&Text { name: shell.to_string(), text })
}

/// The programs, the command line first.
fn programs() -> [Command; 4] {
    [
        Cli::definition(),
        taustream_streamer::arguments::Arguments::command(),
        taustream_planner::arguments::Arguments::command(),
        taustream_drivers::sim::arguments::Arguments::command(),
    ]
}

fn pages() -> io::Result<Vec<Page>> {
    let names: Vec<String> = programs().iter().map(|p| p.get_name().to_owned()).collect();
    let mut pages = Vec::new();
    for program in programs() {
        let mut program = program.disable_help_subcommand(true);
        program.build();
        add_pages(&program, &names, &mut pages)?;
    }
    Ok(pages)
}

/// The page of a command, then those of its commands.
fn add_pages(command: &Command, programs: &[String], pages: &mut Vec<Page>) -> io::Result<()> {
    pages.push(page(command, programs)?);
    for below in command.get_subcommands().filter(|c| !c.is_hide_set()) {
        add_pages(below, programs, pages)?;
    }
    Ok(())
}

fn page(command: &Command, programs: &[String]) -> io::Result<Page> {
    let man = Man::new(command.clone()).manual(MANUAL).source(SOURCE);
    let mut out = Vec::new();
    man.render_title(&mut out)?;
    man.render_name_section(&mut out)?;
    man.render_synopsis_section(&mut out)?;
    man.render_description_section(&mut out)?;
    man.render_options_section(&mut out)?;
    if command.has_subcommands() {
        man.render_subcommands_section(&mut out)?;
    }
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let mut sections = sections_of(&help);
    for (title, text) in [("EXIT STATUS", EXIT_CODES), ("SAFETY", SAFETY)] {
        if !sections.iter().any(|(there, _)| *there == title) {
            sections.push((title, text));
        }
    }
    let mut before = "";
    for (title, text) in sections {
        add_section(if title == before { None } else { Some(title) }, text).to_writer(&mut out)?;
        before = title;
    }
    let own = command.get_display_name().unwrap_or(command.get_name());
    see_also(own, programs).to_writer(&mut out)?;
    let roff = String::from_utf8_lossy(&out).into_owned();
    Ok(Page { file: format!("{own}.1"), roff })
}

/// The paragraphs of a help text with the sections that they belong to.
fn sections_of(help: &str) -> Vec<(&'static str, &str)> {
    let mut sections = Vec::new();
    for paragraph in help.split("\n\n").filter(|p| !p.trim().is_empty()) {
        let known = SECTIONS.iter().find(|(beginning, _)| paragraph.starts_with(beginning));
        sections.push((known.map_or("NOTES", |(_, title)| *title), paragraph));
    }
    sections
}

/// A paragraph, under a heading if it is the first of its section. Lines that are indented stay lines.
fn add_section(title: Option<&str>, text: &str) -> Roff {
    let mut roff = Roff::new();
    match title {
        Some(title) => roff.control("SH", [title]),
        None => roff.control("PP", []),
    };
    let as_it_stands = text.lines().any(|line| line.starts_with(' '));
    if as_it_stands {
        roff.control("nf", []);
    }
    // The heading says it already.
    for line in text.lines().filter(|line| !matches!(*line, "Example:" | "Examples:")) {
        roff.text([roman(line)]);
    }
    if as_it_stands {
        roff.control("fi", []);
    }
    roff
}

fn see_also(own: &str, programs: &[String]) -> Roff {
    let others: Vec<String> = programs.iter().filter(|p| *p != own).map(|p| format!("{p}(1)")).collect();
    add_section(Some("SEE ALSO"), &others.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What stands in a page, without its escapes.
    fn plain(page: &Page) -> String {
        page.roff.replace("\\-", "-").replace("\\fB", "").replace("\\fR", "").replace("\\fI", "")
    }

    fn check(command: &Command, pages: &[Page]) -> Result<(), String> {
        let name = command.get_display_name().unwrap_or(command.get_name());
        let page = pages.iter().find(|p| p.file == format!("{name}.1")).ok_or(format!("no page {name}"))?;
        let text = plain(page);
        let mut wanted: Vec<String> =
            ["EXIT STATUS", "not a safety function", "SEE ALSO"].map(String::from).to_vec();
        let arguments = command.get_arguments().filter(|a| !a.is_hide_set());
        wanted.extend(arguments.filter_map(|a| a.get_long().map(|long| format!("--{long}"))));
        for below in command.get_subcommands().filter(|c| !c.is_hide_set()) {
            wanted.push(below.get_display_name().unwrap_or(below.get_name()).to_owned());
            check(below, pages)?;
        }
        match wanted.iter().find(|word| !text.contains(*word)) {
            Some(word) => Err(format!("page {name} lacks `{word}`")),
            None => Ok(()),
        }
    }

    fn built(command: Command) -> Command {
        let mut command = command.disable_help_subcommand(true);
        command.build();
        command
    }

    /// Goal: nothing that can be typed is missing in the manual. Method: every page against the parser's definition;
    /// one page taken away, or one option renamed, must be noticed.
    #[test]
    fn every_command_option_and_exit_status_stands_in_the_manual() {
        let mut pages = pages().unwrap();
        for program in programs() {
            check(&built(program), &pages).unwrap();
        }
        let corrupted = programs()[0].clone().arg(clap::Arg::new("new").long("brand-new"));
        assert!(check(&built(corrupted), &pages).unwrap_err().contains("--brand-new"));
        pages.retain(|p| p.file != "taustream-plan.1");
        assert!(check(&built(programs()[0].clone()), &pages).unwrap_err().contains("taustream-plan"));
    }

    #[test]
    fn pages_of_programs_have_their_own_exit_status_and_examples() {
        let pages = pages().unwrap();
        let text = |file: &str| plain(pages.iter().find(|p| p.file == file).unwrap());
        assert!(
            text("taustream-streamer.1").contains("drives were seen"),
            "{}",
            text("taustream-streamer.1")
        );
        assert!(text("taustream-servosim.1").contains("kind=silence"));
        assert!(text("taustream.1").contains("130 interrupted"));
        assert!(text("taustream-bench-cycle.1").contains("--slices"));
        for page in &pages {
            assert_eq!(page.roff.matches(".SH \"EXIT STATUS\"").count(), 1, "{}", page.roff);
        }
    }
}
