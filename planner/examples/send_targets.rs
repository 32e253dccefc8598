//! A program that streams targets to a running planner: the whole arm swings by a tenth of a radian for ten seconds.
//!
//! ```sh
//! cargo run -p taustream-planner --example send_targets -- vcan6
//! ```
//!
//! Each target is one message of fixed size in shared memory. The planner answers each; nothing here waits for it, because a
//! newer target counts more than the answer to an older one. When this program dies the arm goes to the last target and holds.
use anyhow::{Context, Result, anyhow};
use std::time::{Duration, Instant};
use std::{env, thread};
use taustream_arm::runtime;
use taustream_messages::clock::now_ns;
use taustream_messages::service::Wire;
use taustream_messages::target::{CheckedTargets, Target, TargetOutcome};
use taustream_messages::{Report, TargetRequest};

const RATE_HZ: f64 = 50.0;
const DURATION: Duration = Duration::from_secs(10);

fn main() -> Result<()> {
    let arm = env::args().nth(1).context("usage: send_targets ARM")?;
    let wire = Wire::join(&arm, "send-targets", &runtime::directory()?)?;
    let reports = wire.report_subscriber()?;
    let targets = wire.target_client()?;
    let from = first_report(|| Ok(reports.receive()?.map(|sample| *sample.payload())))?;
    let joints = usize::try_from(from.joint_count)?;

    let begun = Instant::now();
    let mut waiting = Vec::new();
    let mut sequence = 0;
    while begun.elapsed() < DURATION {
        let swing_rad = 0.1 * (begun.elapsed().as_secs_f64() * std::f64::consts::PI).sin();
        let mut position_rad = from.command_rad;
        position_rad.iter_mut().take(joints).for_each(|q| *q += swing_rad);
        // Due at once, and not to move the arm after half a second; several targets with rising times are a chunk.
        let target = Target { due_s: 0.0, position_rad, velocity_rad_s: None };
        sequence += 1;
        let request =
            CheckedTargets { joints, sequence, sent_ns: now_ns(), valid_s: 0.5, targets: vec![target] };
        // A client may have two requests on their way: the older answer is given up.
        if waiting.len() > 1 {
            waiting.remove(0);
        }
        let pending = targets.send_copy(TargetRequest::new(&request))?;
        if pending.number_of_server_connections() == 0 {
            return Err(anyhow!("no planner serves arm `{arm}`"));
        }
        waiting.push(pending);

        let mut unanswered = Vec::new();
        for pending in waiting {
            match pending.receive()?.map(|reply| reply.payload().outcome()) {
                Some(TargetOutcome::Refused { reason }) => eprintln!("refused: {reason}"),
                Some(TargetOutcome::Taken { .. } | TargetOutcome::Superseded) => {}
                None => unanswered.push(pending),
            }
        }
        waiting = unanswered;
        thread::sleep(Duration::from_secs_f64(1.0 / RATE_HZ));
    }
    Ok(())
}

/// The streamer's first report: it tells where the arm is commanded to be.
fn first_report(mut receive: impl FnMut() -> Result<Option<Report>>) -> Result<Report> {
    let since = Instant::now();
    while since.elapsed() < Duration::from_secs(2) {
        if let Some(report) = receive()?
            && report.checked().is_some()
        {
            return Ok(report);
        }
        thread::sleep(Duration::from_millis(5));
    }
    Err(anyhow!("the streamer does not report"))
}
