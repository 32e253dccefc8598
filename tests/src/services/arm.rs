//! The arm as an operator of the machine sees and commands it: by the command line, as a user of their own.
use super::OPERATOR;
use super::guest::{self, Answer, TIMEOUT};
use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Where the arm is sent, rad. Both are clear of everything, and a second or two apart.
pub const GOALS: [[f64; 6]; 2] = [[0.5, -1.4, 1.4, -1.6, -1.57, 0.2], [-0.3, -1.6, 1.5, -1.5, -1.57, -0.2]];
/// A command ends where it says it does, to an encoder count.
const AT_GOAL_RAD: f64 = 1e-5;

/// `taustream` with these words, as the operator.
///
/// # Errors
/// When it cannot be started.
pub fn taustream(words: &[&str]) -> Result<Answer> {
    guest::as_user(OPERATOR, &[&["taustream"], words].concat())
}

/// One report.
///
/// # Errors
/// When there is none.
pub fn status() -> Result<Value> {
    let Answer { status, out, err } = taustream(&["status", "--json"])?;
    ensure!(status == Some(0), "status ended with {status:?}: {err}");
    serde_json::from_str(&out).with_context(|| format!("status printed {out:?}"))
}

/// The word of the phase in a report.
#[must_use]
pub fn phase(report: &Value) -> &str {
    report["phase"].as_str().unwrap_or("?")
}

/// Gets the arm to hold, by what the resumption table says; never by waiting for a fault to go away.
///
/// # Errors
/// When it does not hold in time, with the last refusal.
pub fn make_ready() -> Result<Vec<String>> {
    let since = Instant::now();
    let (mut done, mut last) = (Vec::new(), String::new());
    while since.elapsed() < TIMEOUT {
        // A streamer that is just being restarted answers no request.
        let Ok(report) = status() else { continue };
        let command = match phase(&report) {
            "holding" => return Ok(done),
            "fault" => "clear-fault",
            "disabled" | "locked" => "enable",
            "paused" => "stop",
            other => {
                last = format!("the arm is {other}");
                sleep(Duration::from_millis(100));
                continue;
            }
        };
        let answer = taustream(&[command])?;
        last = answer.err.trim().to_owned();
        if answer.status == Some(0) {
            done.push(command.to_owned());
        }
    }
    bail!("the arm does not hold after {done:?}: {last}")
}

/// Asks the planner for a motion to a goal; returns when it was accepted.
///
/// # Errors
/// When it was not.
pub fn send_to(goal_rad: &[f64]) -> Result<()> {
    let text: Vec<String> = goal_rad.iter().map(f64::to_string).collect();
    let answer = taustream(&["replan", "--deadline-ms", "8000", "--goal", &text.join(",")])?;
    ensure!(answer.status == Some(0), "replan ended with {:?}: {}", answer.status, answer.err.trim());
    Ok(())
}

/// Waits until the arm holds at a pose. Where the host has stalled the machine the arm is paused, and resumed with a message.
///
/// # Errors
/// When it does not get there, or faults.
pub fn wait_at(goal_rad: &[f64]) -> Result<()> {
    let since = Instant::now();
    loop {
        let report = status()?;
        match phase(&report) {
            "holding" if is_at(&report, goal_rad) => return Ok(()),
            "holding" | "moving" | "pausing" if since.elapsed() < TIMEOUT => {}
            "paused" => {
                println!("       the host stalled the machine; resuming");
                taustream(&["resume"])?;
            }
            other => bail!("the arm is {other} and not at its goal: {}", report["fault"]["message"]),
        }
        sleep(Duration::from_millis(100));
    }
}

/// Goes to a goal by a motion that is planned.
///
/// # Errors
/// When it does not get there.
pub fn go_to(goal_rad: &[f64]) -> Result<()> {
    send_to(goal_rad)?;
    wait_at(goal_rad)
}

fn is_at(report: &Value, goal_rad: &[f64]) -> bool {
    let Some(joints) = report["joints"].as_array() else { return false };
    let is_near = |(joint, goal): (&Value, &f64)| {
        joint["command_rad"].as_f64().is_some_and(|angle| (angle - goal).abs() < AT_GOAL_RAD)
    };
    joints.len() == goal_rad.len() && joints.iter().zip(goal_rad).all(is_near)
}
