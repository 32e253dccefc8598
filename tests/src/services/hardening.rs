//! What systemd thinks of the units, what the kernel enforces, and which threads are real-time.
use super::guest::{done, number, run, wait};
use super::{PLANNER, SERVOSIM, STREAMER, stall};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::time::Duration;

/// The most exposure, of 10, that `systemd-analyze security` may see.
pub const EXPOSURE_MAX: f64 = 1.5;

/// Everything that a probe may find allowed in the streamer's sandbox; whatever else it finds is a hole.
const STREAMER_MAY: [&str; 8] = [
    "lock-memory",
    "realtime",
    "socket-can",
    "socket-netlink",
    "socket-unix",
    "write-runtime",
    "write-shm",
    "write-tmp",
];
/// The same for the planner's.
const PLANNER_MAY: [&str; 4] = ["socket-unix", "write-runtime", "write-shm", "write-tmp"];
/// Lines that the probe prints.
const PROBES: usize = 28;
/// Its last line.
const PROBES_ENDED: &str = "probes ended";
/// How long a line may take from a program that has ended to the journal.
const JOURNAL_LIMIT: Duration = Duration::from_secs(30);

/// `systemd-analyze verify` has nothing to say.
///
/// # Errors
/// What it says.
pub fn verified() -> Result<String> {
    let units = [STREAMER, PLANNER, SERVOSIM, "taustream@arm1.target"];
    let answer = run(&[&["systemd-analyze", "verify", "--man=no"][..], &units].concat())?;
    let words = format!("{}{}", answer.out, answer.err);
    ensure!(answer.status == Some(0) && words.trim().is_empty(), "{:?}: {words}", answer.status);
    let complaints =
        done(&["journalctl", "--boot", "--no-pager", "--priority=warning", "--unit=systemd-networkd"])?;
    ensure!(!complaints.contains("taustream"), "networkd complains of our files: {complaints}");
    Ok(format!("{} units", units.len()))
}

/// The exposure of every service is small.
///
/// # Errors
/// When one is too exposed.
pub fn exposures() -> Result<String> {
    let mut all = Vec::new();
    for unit in [STREAMER, PLANNER, SERVOSIM] {
        let exposure = exposure(unit)?;
        ensure!(exposure <= EXPOSURE_MAX, "{unit}: exposure {exposure}, more than {EXPOSURE_MAX}");
        all.push(format!("{unit} {exposure}"));
    }
    Ok(all.join(", "))
}

/// The overall exposure of a unit, from the last line of the report.
///
/// # Errors
/// When there is no such line.
pub fn exposure(unit: &str) -> Result<f64> {
    let text = done(&["systemd-analyze", "security", "--no-pager", unit])?;
    fs::write(format!("/machine/output/security-{unit}.txt"), &text)?;
    let line = text.lines().rev().find(|line| line.contains("Overall exposure level"));
    let line = line.with_context(|| format!("no overall exposure in {text}"))?;
    let value = line.rsplit(": ").next().and_then(|rest| rest.split_whitespace().next());
    value.and_then(|word| word.parse().ok()).with_context(|| format!("no number in {line:?}"))
}

/// The sandboxes hold, tried from inside.
///
/// # Errors
/// Every hole, and every right that is missing.
pub fn enforced() -> Result<String> {
    // Outside of any sandbox everything goes: a probe that cannot succeed would prove nothing.
    let control = done(&["bash", "/opt/probe.sh"])?;
    let results = results(control.lines());
    let failed: Vec<&(&str, bool)> = results.iter().filter(|(_, yes)| !yes).collect();
    ensure!(failed.is_empty() && results.len() == PROBES, "without a sandbox: {failed:?}");
    let streamer = probe("taustream-streamer@probe.service", &STREAMER_MAY)?;
    let planner = probe("taustream-planner@probe.service", &PLANNER_MAY)?;
    Ok(format!("{streamer} and {planner} probes"))
}

/// Starts the probe in a service's sandbox and compares what it may with what it should.
///
/// # Errors
/// Every difference.
pub fn probe(unit: &str, may: &[&str]) -> Result<usize> {
    done(&["systemctl", "start", unit])?;
    let mut lines = Vec::new();
    wait(&format!("{unit}: the last line of the probe is in the journal"), JOURNAL_LIMIT, || {
        lines = lines_since_start(unit)?;
        Ok(lines.iter().any(|line| line == PROBES_ENDED))
    })?;
    let results = results(lines.iter().map(String::as_str));
    ensure!(results.len() == PROBES, "{unit}: {} of {PROBES} probes: {results:?}", results.len());
    let wrong: Vec<String> = results
        .iter()
        .filter(|(name, yes)| may.contains(name) != *yes)
        .map(|(name, yes)| format!("{name} is {}", if *yes { "allowed" } else { "refused" }))
        .collect();
    ensure!(wrong.is_empty(), "{unit}: {}", wrong.join(", "));
    Ok(results.len())
}

/// What a unit has written to the journal since it was started last.
fn lines_since_start(unit: &str) -> Result<Vec<String>> {
    let entries = super::guest::journal(unit)?;
    let messages: Vec<&str> = entries.iter().filter_map(|entry| entry["MESSAGE"].as_str()).collect();
    let start = messages.iter().rposition(|message| message.starts_with("Starting")).unwrap_or(0);
    Ok(messages.into_iter().skip(start).map(str::to_owned).collect())
}

/// The probes among the lines, each with what it found: allowed or not.
fn results<'a>(lines: impl Iterator<Item = &'a str>) -> Vec<(&'a str, bool)> {
    lines
        .filter_map(|line| {
            let (name, word) = line.split_once(' ')?;
            matches!(word, "yes" | "no").then_some((name, word == "yes"))
        })
        .collect()
}

/// The thread of the cycle is `SCHED_FIFO` with the priority of the settings, and no other is; memory is locked.
///
/// # Errors
/// Which thread is not.
pub fn real_time() -> Result<String> {
    let process = number(STREAMER, "MainPID")?;
    let mut all = Vec::new();
    for (thread, name) in stall::threads(process)? {
        let said = done(&["chrt", "-p", &thread.to_string()])?;
        let is_fifo = said.contains("SCHED_FIFO");
        ensure!(is_fifo == (name == "cycle"), "thread {name}: {said}");
        ensure!(!is_fifo || said.contains("priority: 80"), "thread {name}: {said}");
        all.push(name);
    }
    ensure!(all.iter().any(|name| name == "cycle"), "no thread is called cycle: {all:?}");
    let status_text = fs::read_to_string(format!("/proc/{process}/status"))?;
    let locked =
        status_text.lines().find_map(|line| line.strip_prefix("VmLck:")).map(str::trim).unwrap_or_default();
    ensure!(!locked.is_empty() && !locked.starts_with("0 "), "no memory is locked: {locked:?}");
    Ok(format!("{} threads, {locked} locked", all.len()))
}
