//! What is wrong with a file: every fault at once.
use std::fmt;
use std::path::PathBuf;

/// One fault of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// The file.
    pub file: PathBuf,
    /// The key, as a path: `joint[2].motion.velocity_rad_s`. Empty when the whole file is at fault.
    pub key: String,
    /// The value that stands there, or "missing".
    pub value: String,
    /// What was expected.
    pub expected: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.file.display();
        let (key, value, expected) = (&self.key, &self.value, &self.expected);
        if key.is_empty() {
            write!(f, "{file}: {value}: expected {expected}")
        } else {
            write!(f, "{file}: {key} = {value}: expected {expected}")
        }
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
