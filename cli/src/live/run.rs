//! `taustream run`: executes a saved trajectory from its base pose, after verification.
use super::client::Client;
use super::follow::{Executed, follow, say_pauses};
use super::replan::{accepted, from_words};
use crate::args::RunArgs;
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::offline::verify::Unmodelled;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use std::time::Duration;
use taustream_arm::{Settings, TrajectoryFile};
use taustream_messages::{Phase, Report};
use taustream_motion::digits::Amount;
use taustream_planner::neighbours::{Neighbours, settle};
use taustream_planner::send::{SendError, send_trajectory};
use taustream_planner::verify;

/// Longest wait for the receipt; the streamer checks a trajectory within milliseconds.
const RECEIPT: Duration = Duration::from_secs(5);

/// What became of it.
#[derive(Debug, Serialize)]
struct Answer {
    arm: String,
    trajectory: String,
    trajectory_id: u64,
    generation: u64,
    duration_s: f64,
    clearance_m: f64,
    unmodelled_links: Vec<String>,
    accepted: bool,
    from_s: f64,
    tick: u64,
    #[serde(flatten)]
    executed: Option<Executed>,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "verified      {}: {:.3} s, clearance {:.4} m",
            self.trajectory, self.duration_s, self.clearance_m
        )?;
        write!(f, "{}", Unmodelled(&self.unmodelled_links))?;
        write!(
            f,
            "receipt       accepted: trajectory {} (generation {}) {}",
            self.trajectory_id,
            self.generation,
            from_words(self.from_s, self.tick)
        )?;
        if let Some(e) = &self.executed {
            write!(f, "\n{e}")?;
        }
        Ok(())
    }
}

/// Verifies, sends and prints the receipt.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &RunArgs) -> Result<(), Failure> {
    let settings = arm::settings(settings)?;
    let arm = ArmName::of(&settings);
    let file = load(args, &settings)?;
    let proof = verify(&settings.robot, &settings.scene, &file.trajectory).map_err(|v| {
        Failure::Refused(format!("{}: not safe, nothing was sent: {v}", args.trajectory.path().display()))
    })?;

    let client = Client::join(&arm.name)?;
    let (report, phase) = client.report()?;
    check_ready(&report, phase, &file, &settings)?;
    let neighbours = open_neighbours(&settings)?;
    let turn = neighbours.commit_one((&settings.robot, &settings.scene), &file.trajectory, RECEIPT).map_err(
        |why| Failure::Refused(format!("{}: nothing was sent: {why}", args.trajectory.path().display())),
    )?;
    let sent = send_trajectory(client.wire(), &settings.robot, &file.trajectory, RECEIPT);
    if let Some(turn) = turn {
        settle(&turn, &sent).map_err(|e| Failure::Failed(e.to_string()))?;
    }
    let sent = sent.map_err(explain)?;
    let Some(receipt) = sent.receipt else {
        return Err(Failure::Failed(format!(
            "trajectory {} was sent, but the streamer gave no receipt within {} s; `taustream status` shows whether it runs",
            sent.trajectory_id,
            RECEIPT.as_secs()
        )));
    };
    let (from_s, tick) = accepted(&receipt, &arm)?;
    let executed = if args.wait {
        form.progress(format_args!("accepted; moving, {:.1} s at full speed ..", proof.duration_s));
        Some(follow(&client, &arm, sent.trajectory_id, say_pauses(form))?)
    } else {
        None
    };
    form.print(&Answer {
        arm: arm.name,
        trajectory: args.trajectory.path().display().to_string(),
        trajectory_id: sent.trajectory_id,
        generation: sent.generation,
        duration_s: proof.duration_s,
        clearance_m: proof.clearance_m,
        unmodelled_links: settings.robot.unmodelled_links.clone(),
        accepted: true,
        from_s,
        tick,
        executed,
    })
}

/// The other arms in the room; their first reports come soon.
pub(crate) fn open_neighbours(settings: &Settings) -> Result<Neighbours, Failure> {
    let runtime = taustream_arm::runtime::directory().map_err(|e| Failure::Failed(e.to_string()))?;
    Neighbours::open(&settings.name, &settings.neighbours, &runtime).map_err(Failure::Failed)
}

/// A trajectory file that says which robot it was made for; offline use may leave that out, the streamer may not.
fn load(args: &RunArgs, settings: &Settings) -> Result<TrajectoryFile, Failure> {
    let path = args.trajectory.path();
    let file = match &args.text {
        Some(text) => arm::trajectory_from(path, text, &settings.robot)?,
        None => arm::trajectory_for(path, &settings.robot)?,
    };
    if file.digest.is_none() {
        let why = "has no `digest`, so its robot is unknown; `taustream plan` writes one";
        return Err(Failure::unfit(path, why));
    }
    Ok(file)
}

/// Says before anything is sent what the streamer would refuse anyway, in the user's terms.
fn check_ready(
    report: &Report,
    phase: Phase,
    file: &TrajectoryFile,
    settings: &Settings,
) -> Result<(), Failure> {
    if report.robot_digest != settings.robot.message_digest {
        return Err(Failure::Refused(format!(
            "the streamer of arm `{}` drives another robot than {}; start it with these settings, or name its settings",
            settings.name,
            settings.robot.file.display()
        )));
    }
    if phase != Phase::Holding {
        return Err(Failure::Refused(format!(
            "the arm is {}; a saved motion begins at rest, so it must be holding: {}",
            phase.word(),
            match phase {
                Phase::Moving | Phase::Pausing | Phase::Paused => {
                    "wait for the end of the motion, or `taustream cancel`; `taustream replan --queue` goes on from a running motion"
                }
                Phase::Stopping | Phase::FastStopping | Phase::Braking | Phase::Homing => {
                    "wait until the arm is at rest"
                }
                Phase::Configuring
                | Phase::Disabled
                | Phase::Enabling
                | Phase::Holding
                | Phase::Fault
                | Phase::Locked
                | Phase::Disabling => "`taustream enable`",
            }
        )));
    }
    let away = |(command, base): (&f64, &f64)| (command - base).abs();
    let worst = report
        .command_rad
        .iter()
        .zip(file.trajectory.base_rad())
        .map(away)
        .enumerate()
        .take(report.joints())
        .max_by(|a, b| a.1.total_cmp(&b.1));
    match worst {
        Some((joint, by_rad)) if by_rad > settings.supervision.base_tolerance_rad => {
            let arm = ArmName::of(settings);
            let base: Vec<String> =
                file.trajectory.base_rad().iter().take(report.joints()).map(f64::to_string).collect();
            Err(Failure::Refused(format!(
                "the arm is not at the trajectory's base pose: {} is {} rad away; go there first: taustream replan --wait --goal \"{}\"",
                arm.joint(joint),
                Amount(by_rad),
                base.join(",")
            )))
        }
        _ => Ok(()),
    }
}

fn explain(error: SendError) -> Failure {
    if let SendError::Service(error) = error {
        Failure::Service(error)
    } else {
        Failure::Refused(error.to_string())
    }
}
