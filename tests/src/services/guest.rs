//! Commands in the guest, and what systemd says of a unit.
use anyhow::{Context, Result, bail, ensure};
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How long anything may take before it is called stuck. Generous: it bounds a hang, it checks no speed.
pub const TIMEOUT: Duration = Duration::from_secs(30);
const LOOK: Duration = Duration::from_millis(50);

/// What a command left.
#[derive(Debug)]
pub struct Answer {
    /// Exit status; none when a signal ended it.
    pub status: Option<i32>,
    /// Its standard output.
    pub out: String,
    /// Its standard error.
    pub err: String,
}

/// Runs a command to its end.
///
/// # Errors
/// When it cannot be started.
pub fn run(words: &[&str]) -> Result<Answer> {
    let (program, rest) = words.split_first().context("no program")?;
    let output =
        Command::new(program).args(rest).output().with_context(|| format!("cannot start {program}"))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ok(Answer { status: output.status.code(), out: text(&output.stdout), err: text(&output.stderr) })
}

/// Runs a command that has to succeed; what it printed.
///
/// # Errors
/// When it fails, with its words.
pub fn done(words: &[&str]) -> Result<String> {
    let Answer { status, out, err } = run(words)?;
    ensure!(status == Some(0), "`{}` ended with {status:?}: {} {}", words.join(" "), out.trim(), err.trim());
    Ok(out)
}

/// Runs a command as another user, in that user's home and with the environment of a login.
///
/// # Errors
/// When it cannot be started.
pub fn as_user(user: &str, words: &[&str]) -> Result<Answer> {
    let home = format!("HOME=/home/{user}");
    let name = format!("USER={user}");
    let mut all =
        vec!["runuser", "-u", user, "--", "env", "-C", home.get(5..).unwrap_or("/"), "-i", &home, &name];
    all.push("PATH=/usr/local/bin:/usr/bin:/bin");
    all.extend(words);
    run(&all)
}

/// A property of a unit.
///
/// # Errors
/// When systemd gives none.
pub fn show(unit: &str, property: &str) -> Result<String> {
    let text = done(&["systemctl", "show", "--value", "--property", property, unit])?;
    Ok(text.trim().to_owned())
}

/// A property that is a number.
///
/// # Errors
/// When it is none.
pub fn number(unit: &str, property: &str) -> Result<u64> {
    let text = show(unit, property)?;
    text.parse().with_context(|| format!("{property} of {unit} is {text:?}"))
}

/// Waits until something is so.
///
/// # Errors
/// When it is not in time; `what` then says what was waited for.
pub fn wait(what: &str, limit: Duration, mut is_so: impl FnMut() -> Result<bool>) -> Result<()> {
    let since = Instant::now();
    while !is_so()? {
        if since.elapsed() > limit {
            bail!("{what}: not within {} s", limit.as_secs());
        }
        sleep(LOOK);
    }
    Ok(())
}

/// Waits until a unit was restarted and has said that it is ready.
///
/// # Errors
/// When it has not in time.
pub fn wait_restarted(unit: &str, restarts_before: u64, limit: Duration) -> Result<()> {
    wait(&format!("{unit} is ready again"), limit, || {
        Ok(number(unit, "NRestarts")? > restarts_before && show(unit, "ActiveState")? == "active")
    })
}

/// Entries of the journal of a unit, oldest first, as JSON.
///
/// # Errors
/// When the journal cannot be read.
pub fn journal(unit: &str) -> Result<Vec<serde_json::Value>> {
    done(&["journalctl", "--sync"])?;
    let text = done(&["journalctl", "--boot", "--no-pager", "--output=json", "--unit", unit])?;
    text.lines().map(|line| serde_json::from_str(line).context("a line of the journal")).collect()
}
