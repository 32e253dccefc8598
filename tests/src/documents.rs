//! The command blocks of the documentation, run as printed.
//!
//! Every block of shell commands in a Markdown file says in its fence how it is tested: `sh run` blocks are run here, by
//! `bash`, in an empty directory, with the built programs on the path; `sh checkout` blocks hold commands of the source
//! tree that another step runs, and each of their lines must be one of the lines listed in this file. A block that says neither fails
//! the run, and so does a command in an indented block, which cannot say it.
use anyhow::{Context, Result, bail, ensure};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Commands of the source tree, and the step of `cargo xtask test` that covers each of them.
const CHECKOUT_LINES: [(&str, &str); 14] = [
    ("cargo test --workspace --test histories", "tests"),
    ("cargo test --workspace --test virtual_arm", "tests"),
    ("cargo xtask planted --check", "planted faults"),
    ("cargo xtask planted", "nothing: it takes hours"),
    ("cargo xtask demo", "the demo as an ordinary user"),
    ("cargo xtask test", "this run"),
    ("cargo build --release && export PATH=\"$PWD/target/release:$PATH\"", "programs"),
    ("cargo xtask install", "the installed services under systemd"),
    ("cargo xtask uninstall", "the installed services under systemd"),
    ("sudo systemctl enable --now systemd-networkd", "the installed services under systemd"),
    ("sudo cp /usr/share/taustream/network/", "the installed services under systemd"),
    ("cargo mutants -p taustream-", "nothing: it takes hours"),
    ("cargo build --workspace --bins", "programs"),
    ("target/debug/vcan-machine", "the scenarios of each protocol"),
];

/// How a block is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Run here.
    Run,
    /// Commands of the source tree or of an installed system, covered by another step.
    Checkout,
}

/// A block of commands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The file that it stands in.
    pub file: PathBuf,
    /// Line of its first command, from 1.
    pub line: usize,
    /// How it is tested.
    pub kind: Kind,
    /// Its lines, without the indentation of the fence.
    pub lines: Vec<String>,
}

/// The command blocks of a Markdown text.
///
/// # Errors
/// For a shell block that does not say how it is tested, an indented command block, and a fence without an end.
pub fn blocks(file: &Path, text: &str) -> Result<Vec<Block>> {
    let mut found = Vec::new();
    // The indentation of the fence, and the block for commands.
    let mut open: Option<(usize, Option<Block>)> = None;
    for (index, line) in text.lines().enumerate() {
        let at = || format!("{}:{}", file.display(), index + 1);
        let indentation = line.len() - line.trim_start().len();
        if let Some(info) = line.trim_start().strip_prefix("```") {
            if let Some((_, block)) = open.take() {
                found.extend(block);
            } else {
                let kind = kind_of(info.trim()).with_context(at)?;
                let line = index + 2;
                let block = kind.map(|kind| Block { file: file.to_owned(), line, kind, lines: Vec::new() });
                open = Some((indentation, block));
            }
            continue;
        }
        match &mut open {
            Some((depth, Some(block))) => block.lines.push(line.get(*depth..).unwrap_or("").to_owned()),
            Some((_, None)) => {}
            None => ensure!(
                !(line.starts_with("    ") && is_command(line.trim_start())),
                "{}: a command in an indented block: use a fence that says how it is tested",
                at()
            ),
        }
    }
    ensure!(open.is_none(), "{}: a fence without an end", file.display());
    Ok(found)
}

fn is_command(line: &str) -> bool {
    ["taustream ", "taustream-", "cargo ", "sudo "].iter().any(|start| line.starts_with(start))
}

/// What the words after a fence say; `None` for blocks that are no commands.
fn kind_of(info: &str) -> Result<Option<Kind>> {
    match info {
        "sh run" => Ok(Some(Kind::Run)),
        "sh checkout" => Ok(Some(Kind::Checkout)),
        other if ["sh", "bash", "shell", "console"].iter().any(|shell| other.starts_with(shell)) => {
            bail!("`{other}`: a shell block is `sh run` or `sh checkout`")
        }
        _ => Ok(None),
    }
}

impl Block {
    /// Checks that every command of a `sh checkout` block is one that another step runs.
    ///
    /// # Errors
    /// With the line that no step runs.
    pub fn check_covered(&self) -> Result<()> {
        for (offset, line) in self.lines.iter().enumerate() {
            let command = without_comment(line);
            let covered = CHECKOUT_LINES.iter().any(|(start, _)| command.starts_with(start));
            ensure!(
                command.is_empty() || covered,
                "{}:{}: no step of the test runs `{command}`",
                self.file.display(),
                self.line + offset
            );
        }
        Ok(())
    }

    /// The block as a script that stops at the first failure and names its line. A reader types the line after a
    /// background program when that has printed its ready line, and so does the script.
    #[must_use]
    pub fn script(&self) -> String {
        let mut script = PROLOGUE.to_owned();
        for (offset, line) in self.lines.iter().enumerate() {
            let command = without_comment(line);
            let _infallible = writeln!(script, "at={}:{}", self.file.display(), self.line + offset);
            let _infallible = match command.strip_suffix('&').filter(|rest| !rest.ends_with('&')) {
                Some(program) => writeln!(script, "begin {}", program.trim_end()),
                None => writeln!(script, "{line}"),
            };
        }
        script
    }

    /// Runs the block in `directory` with these variables of the environment; its output goes to files there.
    ///
    /// # Errors
    /// With the line that failed and the end of what was printed.
    pub fn run(&self, directory: &Path, environment: &[(&str, &Path)]) -> Result<()> {
        fs::create_dir_all(directory)?;
        let output = directory.join("output.txt");
        let file = fs::File::create(&output)?;
        let status = Command::new("bash")
            .args(["-c", &self.script()])
            .current_dir(directory)
            .envs(environment.iter().copied())
            .stdin(Stdio::null())
            .stderr(file.try_clone()?)
            .stdout(file)
            .status()
            .context("bash cannot be started")?;
        let text = fs::read_to_string(&output)?;
        let tail: Vec<&str> = text.lines().rev().take(12).collect::<Vec<_>>().into_iter().rev().collect();
        ensure!(
            status.success(),
            "the block at {}:{} failed ({status}):\n{}",
            self.file.display(),
            self.line,
            tail.join("\n")
        );
        Ok(())
    }
}

/// Ends background programs by pid, newest first, whatever happens.
const PROLOGUE: &str = r#"set -uo pipefail
pids=()
end() {
  code=$?
  for ((i = ${#pids[@]} - 1; i >= 0; i--)); do kill "${pids[i]}" 2>/dev/null; wait "${pids[i]}" 2>/dev/null; done
  exit "$code"
}
trap end EXIT
trap 'echo "FAILED at $at (exit $?)"; exit 1' ERR
begin() {
  "$@" >"background-${#pids[@]}.txt" 2>&1 &
  local pid=$! log="background-${#pids[@]}.txt"
  pids+=("$pid")
  for ((try = 0; try < 3000; try++)); do
    grep -q "ready" "$log" && return 0
    kill -0 "$pid" 2>/dev/null || break
    sleep 0.02
  done
  cat "$log"
  echo "not ready: $*"
  return 1
}
"#;

/// A line without the comment at its end. Quoted `#` does not occur in the documentation, and would fail as a command.
fn without_comment(line: &str) -> &str {
    let comment = line.find(" #").or_else(|| line.starts_with('#').then_some(0));
    line.get(..comment.unwrap_or(line.len())).unwrap_or(line).trim_end()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Block>> {
        blocks(Path::new("page.md"), text)
    }

    #[test]
    fn blocks_of_commands_are_found_with_their_lines_and_others_passed_over() {
        let text = "# Page\n\n```toml\nname = 1\n```\n1. step\n\n   ```sh run\n   taustream check  # what\n   taustream-planner &\n   ```\n```sh checkout\ncargo xtask demo\n```\n";
        let found = read(text).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].kind, found[0].line), (Kind::Run, 9));
        assert_eq!(found[0].lines, ["taustream check  # what", "taustream-planner &"]);
        assert_eq!((found[1].kind, found[1].line), (Kind::Checkout, 13));
    }

    #[test]
    fn block_that_nothing_tests_is_refused() {
        for text in ["```sh\nls\n```", "```bash run\nls\n```", "```sh ran\nls\n```", "```sh run\nls\n"] {
            assert!(read(text).is_err(), "{text}");
        }
        assert!(read("text\n\n    taustream check x\n").is_err(), "an indented command");
        let uncovered = read("```sh checkout\nmake install\n```").unwrap();
        assert!(uncovered[0].check_covered().unwrap_err().to_string().contains("page.md:2"));
    }

    #[test]
    fn failing_line_fails_the_block_and_is_named() {
        let directory = std::env::temp_dir().join(format!("taustream-documents-{}", std::process::id()));
        let block = |text: &str| read(&format!("```sh run\n{text}\n```")).unwrap().remove(0);
        block("echo hello > f\ngrep -q hello f # it is there").run(&directory, &[]).unwrap();
        let failed = block("true\nfalse\ntrue").run(&directory, &[]).unwrap_err().to_string();
        assert!(failed.contains("FAILED at page.md:3"), "{failed}");
        let failed = block("false || true\nno-such-program").run(&directory, &[]).unwrap_err();
        assert!(failed.to_string().contains("FAILED at page.md:3"), "{failed}");
        let failed = block("sh -c 'exit 3' &").run(&directory, &[]).unwrap_err().to_string();
        assert!(failed.contains("not ready"), "{failed}");
        block("sh -c 'echo ready; exec sleep 600' &\ntrue").run(&directory, &[]).unwrap();
        fs::remove_dir_all(directory).unwrap();
    }
}
