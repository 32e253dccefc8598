//! What comes back by itself, and what waits for an operator (docs/resumption.md).
use super::guest::{TIMEOUT, done, number, show, wait, wait_restarted};
use super::{PLANNER, SERVOSIM, STREAMER, arm, guest};
use anyhow::{Context, Result, ensure};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Servos, streamer and planner came up in this order at boot, each ready before the next was started.
///
/// # Errors
/// Which was not.
pub fn order() -> Result<String> {
    for unit in [SERVOSIM, STREAMER, PLANNER] {
        wait(&format!("{unit} is ready"), TIMEOUT, || Ok(show(unit, "ActiveState")? == "active"))?;
    }
    for (first, then) in [(SERVOSIM, STREAMER), (STREAMER, PLANNER)] {
        let ready_us = number(first, "ActiveEnterTimestampMonotonic")?;
        let started_us = number(then, "InactiveExitTimestampMonotonic")?;
        ensure!(number(first, "NRestarts")? == 0, "{first} needed several starts");
        ensure!(
            ready_us <= started_us,
            "{then} was started {} us before {first} was ready",
            ready_us - started_us
        );
    }
    let status = show(STREAMER, "StatusText")?;
    ensure!(status.starts_with("arm arm1: "), "the streamer says {status:?} of itself");
    Ok(format!("streamer ready {} ms after boot", number(STREAMER, "ActiveEnterTimestampMonotonic")? / 1000))
}

/// The planner is killed while the arm moves: the motion ends where it should, the planner comes back and plans on.
///
/// # Errors
/// What did not.
pub fn planner_killed() -> Result<String> {
    arm::make_ready()?;
    arm::send_to(&arm::GOALS[0])?;
    let restarts = number(PLANNER, "NRestarts")?;
    done(&["systemctl", "kill", "--signal=KILL", PLANNER])?;
    arm::wait_at(&arm::GOALS[0])?;
    wait_restarted(PLANNER, restarts, TIMEOUT)?;
    arm::go_to(&arm::GOALS[1])?;
    Ok("the motion ended at its goal, the next was planned".to_owned())
}

/// The planner stands still: its watchdog brings it back.
///
/// # Errors
/// When it does not.
pub fn planner_hung() -> Result<String> {
    wait(&format!("{PLANNER} is ready"), TIMEOUT, || Ok(show(PLANNER, "ActiveState")? == "active"))?;
    let restarts = number(PLANNER, "NRestarts")?;
    done(&["systemctl", "kill", "--signal=STOP", PLANNER])?;
    wait_restarted(PLANNER, restarts, TIMEOUT)?;
    watchdog_set(PLANNER)?;
    arm::make_ready()?;
    arm::go_to(&arm::GOALS[0])?;
    Ok("killed by its watchdog".to_owned())
}

/// The streamer is killed: it is back, has moved nothing, tells its state, and moves the arm once it is enabled again.
///
/// # Errors
/// What did not.
pub fn streamer_killed() -> Result<String> {
    arm::make_ready()?;
    let restarts = number(STREAMER, "NRestarts")?;
    done(&["systemctl", "kill", "--signal=KILL", STREAMER])?;
    wait_restarted(STREAMER, restarts, TIMEOUT)?;
    back_on_command()
}

/// The thread of the cycle is held while all others run: the service thread must not feed the watchdog for it.
///
/// # Errors
/// When nothing happens within `limit`, or the arm does not recover.
pub fn cycle_stalled(limit: Duration) -> Result<String> {
    arm::make_ready()?;
    let restarts = number(STREAMER, "NRestarts")?;
    let process = number(STREAMER, "MainPID")?;
    let mut debugger = Debugger::hold(process, "cycle")?;
    let back = wait_restarted(STREAMER, restarts, limit);
    debugger.detach();
    back?;
    watchdog_set(STREAMER)?;
    ensure!(number(STREAMER, "MainPID")? != process, "the same process goes on");
    back_on_command()
}

/// After a restart nothing has been enabled by itself; the operator enables, and the arm moves.
fn back_on_command() -> Result<String> {
    let found = arm::status()?;
    let phase = arm::phase(&found).to_owned();
    ensure!(phase != "moving" && phase != "enabling", "the arm is {phase} after a restart, and nobody asked");
    let how = arm::make_ready()?;
    arm::go_to(&arm::GOALS[1])?;
    arm::go_to(&arm::GOALS[0])?;
    Ok(format!("found {phase}; {how:?}, moved"))
}

fn watchdog_set(unit: &str) -> Result<()> {
    let entries = guest::journal(unit)?;
    let reported =
        entries.iter().any(|e| e["MESSAGE"].as_str().is_some_and(|m| m.contains("Watchdog timeout")));
    ensure!(reported, "systemd does not speak of the watchdog of {unit}");
    Ok(())
}

/// A word for it, the command that loses the link, and those that bring it back.
type Loss = (&'static str, &'static [&'static str], &'static [&'static [&'static str]]);

/// The interface goes down and up, then vanishes and comes back: a fault each time, and recovery on command.
///
/// # Errors
/// What did not happen.
pub fn link_lost() -> Result<String> {
    let mut reported = Vec::new();
    let losses: [Loss; 2] = [
        ("down", &["ip", "link", "set", "vcan0", "down"], &[&["ip", "link", "set", "vcan0", "up"]]),
        (
            "deleted",
            &["ip", "link", "delete", "vcan0"],
            &[
                &["ip", "link", "add", "vcan0", "type", "vcan"],
                &["ip", "link", "set", "vcan0", "mtu", "72", "up"],
            ],
        ),
    ];
    for (what, lose, regain) in losses {
        arm::make_ready()?;
        let restarts = number(STREAMER, "NRestarts")?;
        done(lose)?;
        wait(
            &format!("a fault, the link is {what}"),
            TIMEOUT,
            || Ok(arm::phase(&arm::status()?) == "fault"),
        )?;
        let fault = arm::status()?["fault"]["message"].as_str().unwrap_or("?").to_owned();
        for command in regain {
            done(command)?;
        }
        let how = arm::make_ready()?;
        ensure!(
            how.contains(&"enable".to_owned()),
            "the arm came back by itself from a link that was {what}"
        );
        arm::go_to(&arm::GOALS[0])?;
        arm::go_to(&arm::GOALS[1])?;
        ensure!(
            number(STREAMER, "NRestarts")? == restarts,
            "the streamer did not outlive a link that was {what}"
        );
        reported.push(format!("{what}: {fault}, {how:?}"));
    }
    Ok(reported.join("; "))
}

/// The journal has what happened: ordinary lines with fields, faults with their priority.
///
/// # Errors
/// What is missing.
pub fn journal() -> Result<String> {
    let entries = guest::journal(STREAMER)?;
    let has = |field: &str, value: &str| entries.iter().any(|e| e[field].as_str() == Some(value));
    let own: Vec<_> = entries.iter().filter(|e| e["SYSLOG_IDENTIFIER"] == "taustream-streamer").collect();
    ensure!(!own.is_empty(), "the streamer has written nothing");
    ensure!(own.iter().any(|e| e["TAUSTREAM_TICK"].is_string()), "no entry has a field TAUSTREAM_TICK");
    ensure!(own.iter().any(|e| e["TAUSTREAM_GENERATION"].is_string()), "no entry has a generation");
    ensure!(own.iter().any(|e| e["PRIORITY"] == "3"), "no fault of the streamer has priority err");
    ensure!(has("TAUSTREAM_ACCEPTED", "true"), "no answer to a command was logged");
    let orders = done(&["journalctl", "--boot", "--no-pager", "--identifier=sudo"])?;
    ensure!(orders.contains("handed-over"), "sudo has not written who commanded");
    Ok(format!("{} entries of the streamer", own.len()))
}

/// A program of ours that holds a thread as a debugger would.
struct Debugger(Child);

impl Debugger {
    fn hold(process: u64, thread: &str) -> Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["stall", &process.to_string(), thread]).stdout(Stdio::piped());
        let mut child = command.spawn().context("cannot start the debugger")?;
        let mut line = String::new();
        let stdout = child.stdout.take().context("no stdout")?;
        BufReader::new(stdout).read_line(&mut line)?;
        ensure!(line.trim() == "stalled", "the debugger could not hold thread {thread}");
        Ok(Self(child))
    }

    fn detach(&mut self) {
        // Either may say that it has ended by itself, its thread being gone.
        let _ended = self.0.kill();
        let _reaped = self.0.wait();
    }
}

impl Drop for Debugger {
    fn drop(&mut self) {
        self.detach();
    }
}
