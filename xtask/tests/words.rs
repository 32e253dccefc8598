//! House rule: one concept has one term, the field's. This test finds private words in sources and documents, and names the
//! replacement. docs/glossary.md has the few terms that are ours.
#![expect(clippy::expect_used, reason = "a test ends by panicking")]
use std::fs;
use std::path::{Path, PathBuf};

/// A word that is not used here, and what is written instead. Words are found in prose, identifiers and messages alike.
const BANNED: [(&str, &str); 22] = [
    ("wish", "request, or target"),
    ("wishes", "requests, or targets"),
    ("wished", "requested"),
    ("told", "commanded, sent, or reported"),
    ("obey", "apply, or execute"),
    ("obeys", "applies, or executes"),
    ("patience", "timeout"),
    ("patient", "stall-free, or waiting"),
    ("whence", "source"),
    ("lest", "so that .. not"),
    ("cure", "remedy"),
    ("cures", "remedies"),
    ("mend", "fix, or correct"),
    ("mends", "fixes"),
    ("mended", "fixed, or corrected"),
    ("trouble", "fault, or error"),
    ("troubles", "faults, or errors"),
    ("judge", "evaluate, check, or checker"),
    ("judged", "evaluated, or checked"),
    ("doctored", "corrupted"),
    ("aloud", "with a message"),
    ("yardstick", "reference"),
];

/// The same for phrases.
const BANNED_PHRASES: [(&str, &str); 4] = [
    ("seed paper", "author and year, with the DOI in docs/papers.md"),
    ("lets go", "loses torque, or releases"),
    ("way out of", "remedy for, or exit path from"),
    ("moves metal", "moves an arm"),
];

/// Names that other programs read, which therefore stay: the line that contains one of them is not checked.
/// What statistics calls it when two samples may be one stays too.
const EXEMPT: [&str; 4] = ["\"cure\"", "--seed", "told apart", "told_apart"];

const ENDINGS: [&str; 8] = ["rs", "md", "toml", "py", "sh", "conf", "service", "target"];
const SKIPPED: [&str; 2] = ["target", ".git"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").to_owned()
}

/// Sources and documents below a folder. The tree has no symbolic links to folders.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a readable folder").flatten() {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        // This file has to name the words.
        if SKIPPED.contains(&name.as_str()) || path.ends_with("xtask/tests/words.rs") {
            continue;
        }
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            files(&path, found);
        } else if path.extension().is_some_and(|e| ENDINGS.iter().any(|ending| e == *ending)) {
            found.push(path);
        }
    }
}

/// The words of a line in lower case; `snake_case` and `CamelCase` are taken apart.
fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for c in line.chars() {
        let begins = !before.is_ascii_alphabetic() || (before.is_ascii_lowercase() && c.is_ascii_uppercase());
        if c.is_ascii_alphabetic() {
            if begins {
                words.push(String::new());
            }
            if let Some(word) = words.last_mut() {
                word.push(c.to_ascii_lowercase());
            }
        }
        before = c;
    }
    words
}

/// The first banned word of a line, and its replacement.
fn banned(line: &str) -> Option<(&'static str, &'static str)> {
    if EXEMPT.iter().any(|name| line.contains(name)) {
        return None;
    }
    let words = words(line);
    let text = words.join(" ");
    let word = BANNED.into_iter().find(|(word, _)| words.iter().any(|w| w == word));
    word.or_else(|| {
        BANNED_PHRASES.into_iter().find(|(phrase, _)| format!(" {text} ").contains(&format!(" {phrase} ")))
    })
}

#[test]
fn sources_and_documents_use_the_words_of_the_field() {
    let (root, mut paths) = (root(), Vec::new());
    files(&root, &mut paths);
    assert!(paths.len() > 300, "only {} files found below {}", paths.len(), root.display());
    let mut found = Vec::new();
    for path in paths {
        let text = fs::read_to_string(&path).unwrap_or_default();
        let place = path.strip_prefix(&root).unwrap_or(&path).display();
        for (number, line) in text.lines().enumerate() {
            if let Some((word, instead)) = banned(line) {
                found.push(format!("{place}:{}: `{word}`: write {instead}: {}", number + 1, line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{} lines with private words:\n{}", found.len(), found.join("\n"));
}

/// Goal: the test can fail, in prose and in names, and leaves other words alone.
#[test]
fn banned_word_is_found_in_prose_and_in_names() {
    for line in [
        "// Asks what the drive was told.",
        "let last_told = 1;",
        "struct DriveWish;",
        "the seed papers' claims of seed paper 1",
    ] {
        assert!(banned(line).is_some(), "{line}");
    }
    for line in ["untold", "the wishbone", "\"cure\": null", "bench papers --seed 1 --paper 4"] {
        assert_eq!(banned(line), None, "{line}");
    }
}
