//! What an examination found, what it means, and what helps.
use serde::Serialize;
use std::fmt;

/// How good or bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Grade {
    /// As it should be.
    Ok,
    /// This computer does not say; nothing is known.
    Unknown,
    /// An arm can be driven, less well than it could be.
    Warning,
    /// An arm should not be driven.
    Problem,
}

impl Grade {
    /// As it stands at the beginning of a line.
    fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Unknown => "unknown",
            Self::Warning => "WARNING",
            Self::Problem => "PROBLEM",
        }
    }
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Finding {
    /// What was looked at.
    pub(crate) name: &'static str,
    /// How it is.
    pub(crate) grade: Grade,
    /// What was found.
    pub(crate) what: String,
    /// What to do; none where nothing needs to be done.
    #[serde(rename = "cure")]
    pub(crate) remedy: Option<String>,
}

impl Finding {
    /// All is well.
    pub(crate) fn ok(name: &'static str, what: impl Into<String>) -> Self {
        Self { name, grade: Grade::Ok, what: what.into(), remedy: None }
    }
    /// Nothing is known.
    pub(crate) fn unknown(name: &'static str, what: impl Into<String>) -> Self {
        Self { name, grade: Grade::Unknown, what: what.into(), remedy: None }
    }
    /// It could be better.
    pub(crate) fn warning(name: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { name, grade: Grade::Warning, what: what.into(), remedy: Some(remedy.into()) }
    }
    /// It must be fixed.
    pub(crate) fn problem(name: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { name, grade: Grade::Problem, what: what.into(), remedy: Some(remedy.into()) }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<8} {:<20} {}", self.grade.word(), self.name, self.what)?;
        match &self.remedy {
            Some(remedy) => write!(f, "\n{:<30}remedy: {remedy}", ""),
            None => Ok(()),
        }
    }
}
