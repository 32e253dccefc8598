//! /proc and /sys below a root that tests can choose. What stands there is text of other programs: it is bounded, and
//! nothing in it is an error here, only unknown.
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// More of one file tells nothing that is looked for here.
const BYTES_MAX: u64 = 1 << 20;
/// More entries of one directory are not looked at.
const ENTRIES_MAX: usize = 8192;
/// Longest piece of such text that is shown.
const SHOWN_MAX: usize = 80;

/// A file system as the kernel shows it.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    root: PathBuf,
}

impl Tree {
    /// Below a root; `/` is this computer.
    pub(crate) fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The path of an entry. Paths are written without their first slash.
    pub(crate) fn path(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    /// The text of a file without blanks at its ends; `None` when it cannot be read.
    pub(crate) fn text(&self, path: &str) -> Option<String> {
        let mut bytes = Vec::new();
        File::open(self.path(path)).ok()?.take(BYTES_MAX).read_to_end(&mut bytes).ok()?;
        // Words in the kernel's files may end in a zero byte.
        Some(
            String::from_utf8_lossy(&bytes).trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned(),
        )
    }

    /// A file that is one number.
    pub(crate) fn number(&self, path: &str) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// True when there is such an entry.
    pub(crate) fn has(&self, path: &str) -> bool {
        self.path(path).symlink_metadata().is_ok()
    }

    /// Names in a directory, sorted; none when it cannot be read.
    pub(crate) fn names(&self, path: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(path)).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.take(ENTRIES_MAX).filter_map(|e| e.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// Where a link leads to, as it stands in the link.
    pub(crate) fn target(&self, path: &str) -> Option<PathBuf> {
        fs::read_link(self.path(path)).ok()
    }

    /// The last word of where a link leads to.
    pub(crate) fn target_name(&self, path: &str) -> Option<String> {
        Some(
            self.target(path)?
                .file_name()
                .unwrap_or(Path::new("").as_os_str())
                .to_string_lossy()
                .into_owned(),
        )
    }
}

/// Text of other programs, harmless and short enough to be shown.
pub(crate) fn shown(text: &str) -> String {
    let mut harmless = text.chars().filter(|c| !c.is_control());
    let mut shown: String = harmless.by_ref().take(SHOWN_MAX).collect();
    if harmless.next().is_some() {
        shown.push_str("..");
    }
    shown
}

/// CPUs of a list like "0-3,6"; what makes no sense in it is left out.
pub(crate) fn cpu_list(text: &str) -> Vec<usize> {
    /// Linux has no more.
    const CPUS_MAX: usize = 8192;
    let mut cpus = Vec::new();
    for piece in text.split(',').take(CPUS_MAX) {
        let (first, last) = piece.trim().split_once('-').unwrap_or((piece.trim(), piece.trim()));
        if let (Ok(first), Ok(last)) = (first.parse::<usize>(), last.parse::<usize>()) {
            cpus.extend(first.min(CPUS_MAX)..=last.min(CPUS_MAX));
        }
    }
    cpus.sort_unstable();
    cpus.dedup();
    cpus
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_list_takes_ranges_and_leaves_nonsense_out() {
        assert_eq!(cpu_list("0-2,6"), [0, 1, 2, 6]);
        for text in ["", "\n", "x", "3-1", "-", "99999999999999999999", "1-", "-1"] {
            assert!(cpu_list(text).is_empty(), "{text:?}: {:?}", cpu_list(text));
        }
        assert!(cpu_list("0-18446744073709551615").len() <= 8193);
    }

    #[test]
    fn text_that_is_shown_has_no_escapes_and_an_end() {
        assert_eq!(shown("a\u{1b}[31mb"), "a[31mb");
        assert!(shown(&"x".repeat(5000)).len() < 100);
    }
}
