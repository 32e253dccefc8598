//! What commands say: sentences for people, or one JSON object for programs, on stdout.
use crate::args::Cli;
use crate::failure::Failure;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;
use std::{fs, process};
use taustream_arm::printable::{printable, printable_json};

/// The form of the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// Sentences and tables.
    Text,
    /// One JSON object on one line; numbers that are not finite are null.
    Json,
}

impl Form {
    /// As the command line asks for it.
    pub(crate) fn of(cli: &Cli) -> Self {
        if cli.json { Self::Json } else { Self::Text }
    }

    /// Prints an answer on stdout.
    pub(crate) fn print(self, answer: &(impl Serialize + Display)) -> Result<(), Failure> {
        let line = match self {
            Self::Text => answer.to_string(),
            Self::Json => to_json(answer)?,
        };
        self.print_line(line.trim_end())
    }

    /// Prints a line that is made already.
    pub(crate) fn print_line(self, line: &str) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        writeln!(out, "{}", self.shown(line))
            .and_then(|()| out.flush())
            .map_err(|e| Failure::writing("standard output", e))
    }

    /// The line as a terminal may get it.
    fn shown(self, line: &str) -> Cow<'_, str> {
        match self {
            Self::Text => printable(line),
            Self::Json => printable_json(line),
        }
    }

    /// Prints progress on stderr where it does not disturb other output; silent for programs.
    pub(crate) fn progress(self, text: impl Display) {
        if self == Self::Text {
            note(text);
        }
    }
}

/// Writes a result where `-o` says: to a file, with the summary on stdout; to stdout for `-`, with the summary on stderr; or
/// nowhere.
pub(crate) fn deliver(
    form: Form,
    output: Option<&Path>,
    text: &str,
    summary: &(impl Serialize + Display),
) -> Result<(), Failure> {
    match output {
        None => form.print(summary),
        Some(path) if path == Path::new("-") => {
            Form::Json.print_line(text.trim_end())?;
            form.progress(summary);
            Ok(())
        }
        Some(path) => {
            write_whole(path, text)?;
            form.print(summary)
        }
    }
}

/// Writes a line to stderr. A stderr that is closed is no reason to stop.
pub(crate) fn note(text: impl Display) {
    let _closed = writeln!(io::stderr(), "{}", printable(&text.to_string()));
}

/// The number of the form in which every JSON object of this release is written; docs/json.md has the keys. It rises when a
/// key changes its meaning or goes; new keys leave it as it is.
pub(crate) const SCHEMA: u32 = 1;

/// The JSON of an answer, with `schema` as its first key.
pub(crate) fn to_json(answer: &impl Serialize) -> Result<String, Failure> {
    let text = serde_json::to_string(answer)
        .map_err(|e| Failure::Failed(format!("the answer does not fit into JSON: {e}")))?;
    Ok(match text.strip_prefix('{') {
        Some("}") => format!("{{\"schema\":{SCHEMA}}}"),
        Some(rest) => format!("{{\"schema\":{SCHEMA},{rest}"),
        None => text,
    })
}

/// Writes a file as a whole or not at all: a reader, or a crash, never meets half of it.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), Failure> {
    let fail = |e| Failure::writing(path.display().to_string(), e);
    let name = path.file_name().ok_or_else(|| {
        Failure::Usage(format!("{} is no name of a file; give -o the file to write", path.display()))
    })?;
    // A device or a pipe is written into: the rename below would put a file in its place, and as root `-o /dev/null`
    // would take that from everybody on the machine.
    if fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        let written = fs::OpenOptions::new().write(true).open(path);
        return written.and_then(|mut file| file.write_all(text.as_bytes())).map_err(fail);
    }
    let mut beside = name.to_owned();
    beside.push(format!(".{}.part", process::id()));
    let part = path.with_file_name(beside);
    let written = fs::File::create_new(&part)
        .and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&part, path));
    written.map_err(|e| {
        // What we made ourselves may go; a failure to remove it changes nothing for the caller.
        let _left = fs::remove_file(&part);
        fail(e)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pipe stands for every device: a test must not risk a real one.
    #[test]
    fn pipe_is_written_into_and_stays_a_pipe() {
        use std::os::unix::fs::FileTypeExt;
        let pipe = std::env::temp_dir().join(format!("taustream-output-pipe-{}", process::id()));
        assert!(process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read_to_string(pipe)
        });
        write_whole(&pipe, "text").unwrap();
        let is_pipe = fs::metadata(&pipe).unwrap().file_type().is_fifo();
        fs::remove_file(&pipe).unwrap();
        assert!(is_pipe, "a file has replaced the pipe");
        assert_eq!(reader.join().unwrap().unwrap(), "text");
    }

    #[test]
    fn file_that_cannot_be_written_leaves_nothing_behind() {
        let dir = std::env::temp_dir().join(format!("taustream-output-{}", process::id()));
        fs::create_dir_all(dir.join("taken/inside")).unwrap();
        let failure = write_whole(&dir.join("taken"), "text").unwrap_err();
        assert_eq!(failure.exit_code(), 1, "{failure}");
        let left: Vec<_> = fs::read_dir(&dir).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["taken"]);
        write_whole(&dir.join("new"), "text").unwrap();
        assert_eq!(fs::read_to_string(dir.join("new")).unwrap(), "text");
        fs::remove_dir_all(&dir).unwrap();
    }
}
