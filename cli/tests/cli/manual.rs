//! Manual pages as a packager and a reader meet them.
use crate::common::Scratch;
use std::process::Command;

#[test]
fn manual_is_written_for_every_program_and_command() {
    let scratch = Scratch::new();
    let written = scratch.run(&["man", "share/man1", "--json"]).json();
    let pages: Vec<&str> = written["pages"].as_array().unwrap().iter().filter_map(|p| p.as_str()).collect();
    for page in [
        "taustream.1",
        "taustream-plan.1",
        "taustream-streamer.1",
        "taustream-planner.1",
        "taustream-servosim.1",
    ] {
        assert!(pages.contains(&page), "no {page}: {pages:?}");
    }
    for page in &pages {
        let text = std::fs::read_to_string(scratch.dir.join("share/man1").join(page)).unwrap();
        for word in [".TH", ".SH SYNOPSIS", ".SH \"EXIT STATUS\"", "not a safety function"] {
            assert!(text.contains(word), "{page} lacks `{word}`");
        }
    }
}

#[test]
fn manual_without_a_directory_is_the_page_of_taustream() {
    let scratch = Scratch::new();
    let ran = scratch.run(&["man"]);
    assert!(ran.done().contains("taustream\\-clear\\-fault"), "{}", ran.out);
    scratch.write("file", "");
    scratch.run(&["man", "file/below"]).refused(1, &["file/below", "cannot be written"]);
}

/// Goal: a formatter takes every page without a warning. Method: groff where there is one (Debian's base has it); a
/// page with a macro that does not exist must be noticed.
#[test]
fn manual_is_formatted_without_a_warning() {
    if Command::new("groff").arg("--version").output().is_err() {
        eprintln!("NOT CHECKED: groff is not installed, so nobody formatted the pages");
        return;
    }
    let scratch = Scratch::new();
    scratch.run(&["man", "."]).done();
    let warnings = |file: &str| {
        let words = ["-man", "-Tutf8", "-wmac", "-wdelim", "-wsyntax", "-wescape", file];
        let ran = Command::new("groff").args(words).current_dir(&scratch.dir).output().unwrap();
        String::from_utf8_lossy(&ran.stderr).into_owned()
    };
    for file in scratch.files() {
        assert_eq!(warnings(&file), "", "{file}");
    }
    scratch.write("corrupted.1", ".TH corrupted 1\n.SH NAME\n.NOSUCHMACRO\n");
    assert!(warnings("corrupted.1").contains("NOSUCHMACRO"), "{}", warnings("corrupted.1"));
}
