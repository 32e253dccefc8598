//! What is wrong with a file: every fault at once.
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};

/// One fault of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// The file.
    pub file: PathBuf,
    /// Line of the file, from 1, where it is known.
    pub line: Option<usize>,
    /// The key, as a path: `joint[2].motion.velocity_rad_s`. Empty when the whole file is at fault.
    pub key: String,
    /// The value that stands there, or "missing".
    pub value: String,
    /// What was expected.
    pub expected: String,
}

impl Fault {
    /// A fault without a line.
    #[must_use]
    pub fn new(file: &Path, key: &str, value: &str, expected: &str) -> Self {
        let (key, value, expected) = (key.to_owned(), value.to_owned(), expected.to_owned());
        Self { file: file.to_owned(), line: None, key, value, expected }
    }
}

impl fmt::Display for Fault {
    /// One line; what a hostile file smuggles in stands escaped, so that it cannot steer a terminal.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = self.line.map(|line| format!(":{line}")).unwrap_or_default();
        let key = if self.key.is_empty() { String::new() } else { format!("{} = ", self.key) };
        let text = format!("{}{line}: {key}{}: expected {}", self.file.display(), self.value, self.expected);
        for character in text.chars() {
            if character.is_control() {
                write!(f, "{}", character.escape_default())?;
            } else {
                f.write_char(character)?;
            }
        }
        Ok(())
    }
}

/// Every fault of a file and of the files that it names. Never empty.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct Faults(pub Vec<Fault>);

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, fault) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{fault}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fault_shown_names_file_line_key_value_and_expectation() {
        let mut fault = Fault::new(Path::new("ur5.toml"), "joint[0].name", "3", "a name");
        assert_eq!(fault.to_string(), "ur5.toml: joint[0].name = 3: expected a name");
        fault.line = Some(7);
        assert_eq!(fault.to_string(), "ur5.toml:7: joint[0].name = 3: expected a name");
        fault.key = String::new();
        let both = Faults(vec![fault.clone(), fault]);
        assert_eq!(both.to_string().lines().count(), 2);
        assert!(both.to_string().starts_with("ur5.toml:7: 3: expected a name"), "{both}");
    }

    #[test]
    fn fault_shown_escapes_what_would_steer_a_terminal() {
        let fault = Fault::new(Path::new("a\0b.toml"), "", "\u{1b}[2J", "a name");
        assert_eq!(fault.to_string(), "a\\u{0}b.toml: \\u{1b}[2J: expected a name");
    }
}
