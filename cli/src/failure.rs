//! Why a command did not do its work, and what the process says and returns then.
//!
//! Exit codes: 1 refused or failed, 2 bad usage or bad file; 130 after Ctrl-C,
//! as shells have it. The reason goes to stderr, as one sentence or, with `--json`, as one JSON object.
use crate::output::SCHEMA;
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};
use taustream_arm::{Faults, RuntimeError};
use taustream_messages::service::ServiceError;

/// Every way in which a command ends without having done its work.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// The words on the command line do not fit together, or do not fit the files that they name.
    #[error("{0}")]
    Usage(String),
    /// A file has faults; each is one line.
    #[error("{0}")]
    File(#[from] Faults),
    /// A file is sound in itself but is no use here.
    #[error("{}: {why}", path.display())]
    Unfit {
        /// The file.
        path: PathBuf,
        /// What is wrong with it for this command, and what to do.
        why: String,
    },
    /// A file or a pipe could not be written.
    #[error("{what} cannot be written: {error}")]
    Write {
        /// The file, or "standard output".
        what: String,
        /// The operating system's reason.
        error: io::Error,
    },
    /// The reader of our output has closed; no message can be written.
    #[error("the reader of the output has gone")]
    BrokenPipe,
    /// Shared memory cannot be used, or no process serves.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// There is no runtime directory to meet the streamer in.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// A process took the request and did not answer.
    #[error(
        "{who} of arm `{arm}` did not answer within {waited_s:.1} s; look at its log, and restart it if it hangs"
    )]
    NoAnswer {
        /// `taustream-streamer` or `taustream-planner`.
        who: &'static str,
        /// The arm's name.
        arm: String,
        /// How long we waited.
        waited_s: f64,
    },
    /// The streamer's own socket, the second way to stop, could not be used either.
    #[error("the streamer's own socket: {0}")]
    Socket(String),
    /// Planner or streamer said no, or a verification found a violation. Nothing moved because of us.
    #[error("{0}")]
    Refused(String),
    /// It was begun and did not come to its end.
    #[error("{0}")]
    Failed(String),
    /// The demo did not come to its end; its last line is the result.
    #[error("{verdict}: {why}")]
    Demo {
        /// `DEMO FAILED` or `DEMO INTERRUPTED`.
        verdict: &'static str,
        /// The reason.
        why: Box<Self>,
    },
    /// Ctrl-C.
    #[error("{0}")]
    Interrupted(String),
}

impl Failure {
    /// A failure to write `what`; a reader that has gone is a kind of its own because it is no error of a filter.
    pub(crate) fn writing(what: impl Into<String>, error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Self::BrokenPipe
        } else {
            Self::Write { what: what.into(), error }
        }
    }

    /// A file that is sound in itself and is no use here.
    pub(crate) fn unfit(path: &Path, why: impl Into<String>) -> Self {
        Self::Unfit { path: path.to_owned(), why: why.into() }
    }

    /// The result of the demo after a failure of any kind.
    pub(crate) fn of_demo(self) -> Self {
        let verdict = if matches!(self, Self::Interrupted(_)) { "DEMO INTERRUPTED" } else { "DEMO FAILED" };
        Self::Demo { verdict, why: Box::new(self) }
    }

    /// The request did not reach anybody who answers: another way may.
    pub(crate) fn is_of_transport(&self) -> bool {
        matches!(self, Self::Service(_) | Self::Runtime(_) | Self::NoAnswer { .. })
    }

    /// The second way to stop has failed.
    pub(crate) fn is_of_socket(&self) -> bool {
        matches!(self, Self::Socket(_))
    }

    /// The exit code of the process.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::BrokenPipe => 0,
            Self::Usage(_) | Self::File(_) | Self::Unfit { .. } => 2,
            Self::Write { .. }
            | Self::Service(_)
            | Self::Runtime(_)
            | Self::NoAnswer { .. }
            | Self::Socket(_)
            | Self::Refused(_)
            | Self::Failed(_) => 1,
            Self::Interrupted(_) => 130,
            Self::Demo { why, .. } => why.exit_code(),
        }
    }

    /// The word that scripts tell failures apart by.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Usage(_) => "usage",
            Self::File(_) | Self::Unfit { .. } => "file",
            Self::Write { .. } | Self::BrokenPipe => "write",
            Self::Service(ServiceError::NotRunning { .. }) => "not-running",
            Self::Service(_) | Self::Runtime(_) => "service",
            Self::NoAnswer { .. } | Self::Socket(_) => "no-answer",
            Self::Refused(_) => "refused",
            Self::Failed(_) => "failed",
            Self::Interrupted(_) => "interrupted",
            Self::Demo { why, .. } => why.kind(),
        }
    }

    /// The JSON object that `--json` prints on stderr. Faults of files come one by one as well.
    pub(crate) fn to_json(&self) -> Value {
        let mut error = json!({ "kind": self.kind(), "message": self.to_string() });
        if let Self::File(Faults(faults)) = self {
            error["faults"] = faults
                .iter()
                .map(|f| {
                    json!({ "file": f.file.display().to_string(), "line": f.line, "key": f.key, "value": f.value,
                            "expected": f.expected })
                })
                .collect();
        }
        json!({ "schema": SCHEMA, "error": error })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_arm::Fault;

    fn fault(key: &str) -> Fault {
        Fault::new(Path::new("arm.toml"), key, "NaN", "a number")
    }

    #[test]
    fn failure_of_a_file_names_every_fault_in_text_and_json() {
        let failure = Failure::File(Faults(vec![fault("joint[0].dh.a_m"), fault("joint[1].dh.a_m")]));
        assert_eq!(failure.exit_code(), 2);
        let text = failure.to_string();
        assert!(text.contains("joint[0].dh.a_m") && text.contains("joint[1].dh.a_m"), "{text}");
        let json = failure.to_json();
        assert_eq!(json["error"]["kind"], "file");
        assert_eq!(json["error"]["faults"].as_array().map(Vec::len), Some(2));
        assert_eq!(json["error"]["faults"][1]["key"], "joint[1].dh.a_m");
    }

    #[test]
    fn failure_to_write_distinguishes_a_closed_reader() {
        let gone = Failure::writing("standard output", io::ErrorKind::BrokenPipe.into());
        assert_eq!((gone.exit_code(), gone.kind()), (0, "write"));
        let full = Failure::writing("F", io::ErrorKind::StorageFull.into());
        assert_eq!(full.exit_code(), 1);
    }
}
