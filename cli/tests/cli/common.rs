//! Runs the real `taustream` as a user would, in a directory of its own.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests, outside of any #[test] function")]
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};

/// The shipped configuration.
pub(crate) fn config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../config")
        .canonicalize()
        .expect("the shipped config directory")
}

/// A directory that goes with the test.
pub(crate) struct Scratch {
    pub(crate) dir: PathBuf,
    arms: RefCell<Vec<String>>,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let dir = std::env::temp_dir().join(format!("taustream-cli-{}-{number}", std::process::id()));
        fs::create_dir_all(&dir).expect("a scratch directory");
        Self { dir, arms: RefCell::default() }
    }

    /// Writes a file; its name.
    pub(crate) fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.dir.join(name);
        fs::write(&path, text).expect("a file in the scratch directory");
        path
    }

    /// A shipped file with one text replaced, which must be there; its name.
    pub(crate) fn edited(&self, shipped: &str, name: &str, from: &str, to: &str) -> PathBuf {
        let text = fs::read_to_string(config().join(shipped)).expect("a shipped file");
        assert!(text.contains(from), "{shipped} has no `{from}`: the test edits nothing");
        self.write(name, &text.replacen(from, to, 1))
    }

    /// Settings of an arm with a name of its own: vcan6 under another name.
    pub(crate) fn settings(&self, arm: &str) -> PathBuf {
        self.arms.borrow_mut().push(arm.to_owned());
        let text = fs::read_to_string(config().join("settings/vcan6.toml")).expect("shipped settings");
        let dir = config();
        let text = text
            .replacen("name = \"vcan6\"", &format!("name = \"{arm}\""), 1)
            .replace("\"../", &format!("\"{}/", dir.display()));
        self.write("settings.toml", &text)
    }

    pub(crate) fn files(&self) -> BTreeSet<String> {
        let entries = fs::read_dir(&self.dir).expect("the scratch directory");
        entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    }

    /// Runs `taustream` there.
    pub(crate) fn run(&self, words: &[&str]) -> Ran {
        Ran::of(words, self.command(words).output().expect("taustream can be started"))
    }

    /// `taustream` as it will be run there.
    pub(crate) fn command(&self, words: &[&str]) -> Command {
        self.program(env!("CARGO_BIN_EXE_taustream"), words)
    }

    /// Another program in the same surroundings.
    pub(crate) fn program(&self, program: &str, words: &[&str]) -> Command {
        let mut command = Command::new(program);
        command
            .args(words)
            .current_dir(&self.dir)
            .env_remove("TAUSTREAM_SETTINGS")
            .env_remove("TAUSTREAM_MBM_DIR")
            .env("TAUSTREAM_CONFIG_DIR", config());
        command
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _left = fs::remove_dir_all(&self.dir);
        // iceoryx2 leaves a small file of every arm that was requested.
        for arm in self.arms.borrow().iter() {
            let mine = format!(".{arm}.");
            for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
                if entry.file_name().to_string_lossy().contains(&mine) {
                    let _left = fs::remove_file(entry.path());
                }
            }
        }
    }
}

/// What a run said.
pub(crate) struct Ran {
    pub(crate) words: String,
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Ran {
    pub(crate) fn of(words: &[&str], output: Output) -> Self {
        Self {
            words: words.join(" "),
            code: output.status.code(),
            out: String::from_utf8(output.stdout).expect("stdout is text"),
            err: String::from_utf8(output.stderr).expect("stderr is text"),
        }
    }

    /// Asserts a clear refusal: this code, these words on stderr, nothing on stdout, no panic.
    #[track_caller]
    pub(crate) fn refused(&self, code: i32, expected: &[&str]) {
        let Self { words, out, err, .. } = self;
        assert_eq!(self.code, Some(code), "`{words}` said: {err}{out}");
        assert_eq!(out, "", "`{words}` wrote to stdout");
        for word in ["panicked", "RUST_BACKTRACE", "unwrap", ".rs:"] {
            assert!(!err.contains(word), "`{words}` panicked: {err}");
        }
        for word in expected {
            assert!(err.contains(word), "`{words}`: stderr lacks `{word}`: {err}");
        }
    }

    /// Asserts that all went well; what it said on stdout.
    #[track_caller]
    pub(crate) fn done(&self) -> &str {
        assert_eq!(self.code, Some(0), "`{}` said: {}{}", self.words, self.err, self.out);
        &self.out
    }

    /// Like [`Self::done`], as JSON.
    #[track_caller]
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(self.done()).unwrap_or_else(|e| panic!("`{}`: {e}: {}", self.words, self.out))
    }
}

/// A pose of the UR5 that is free of everything.
pub(crate) const HOME: &str = "0,-1.57,1.57,-1.57,-1.57,0";

/// One stroke of a six-joint arm: `n`, and how far the first joint goes.
pub(crate) fn stroke(n: &str, start_s: &str, delta: &str) -> String {
    format!(r#"{{"start_s":{start_s},"duration_s":4,"n":{n},"delta_rad":[{delta},0,0,0,0,0]}}"#)
}

/// A trajectory file from HOME with these strokes.
pub(crate) fn trajectory(strokes: &str) -> String {
    format!(r#"{{"version":1,"robot":"ur5","joints":6,"base_rad":[{HOME}],"strokes":[{strokes}]}}"#)
}
