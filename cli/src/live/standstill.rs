//! The arm at rest: the means of what its drives report there, and whether its torques are those of its masses.
use super::client::{Client, Limit};
use crate::failure::Failure;
use crate::interrupt;
use std::thread;
use std::time::Duration;
use taustream_arm::Settings;
use taustream_messages::{Phase, Report};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Fewest reports that a mean is made of.
const REPORTS_MIN: u32 = 5;
/// After `enable`: how long torques settle, and how long they are read, s.
const SETTLE_S: f64 = 0.3;
const READ_S: f64 = 0.2;

/// Means over the reports of one rest.
pub(crate) struct Rest {
    pub(crate) q_rad: JointArray,
    pub(crate) torque_nm: JointArray,
}

/// How a rest went.
pub(crate) enum Resting {
    /// As it should.
    Held(Box<Rest>),
    /// The arm did not hold all the time.
    Left(Box<Report>, Phase),
    /// Too few reports, or none with numbers.
    Unknown,
}

/// Lets the arm settle, and reads what its drives report while it holds.
pub(crate) fn rest(client: &Client, settle_s: f64, read_s: f64) -> Result<Resting, Failure> {
    let (settled, limit) = (Limit::after_s(settle_s), Limit::after_s(settle_s + read_s));
    let (mut q_rad, mut torque_nm, mut count) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS], 0_u32);
    while !limit.is_over() {
        interrupt::check()?;
        let mut news = Vec::new();
        client.drain_reports(|report, phase| news.push((*report, phase)))?;
        for (report, phase) in news {
            if phase != Phase::Holding {
                return Ok(Resting::Left(Box::new(report), phase));
            }
            if settled.is_over() {
                count += 1;
                add(&mut q_rad, &report.measured_rad);
                add(&mut torque_nm, &report.measured_torque_nm);
            }
        }
        thread::sleep(Duration::from_millis(2));
    }
    if count < REPORTS_MIN {
        return Ok(Resting::Unknown);
    }
    let mean = |sum: JointArray| sum.map(|sum| sum / f64::from(count));
    Ok(Resting::Held(Box::new(Rest { q_rad: mean(q_rad), torque_nm: mean(torque_nm) })))
}

fn add(sum: &mut JointArray, values: &JointArray) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

/// Joints that hold another torque than their masses ask for, as text; empty where no drive reports torques, which takes no time.
pub(crate) fn notices(client: &Client, settings: &Settings) -> Result<Vec<String>, Failure> {
    let (report, phase) = client.report()?;
    let measures = report.measured_torque_nm.iter().take(report.joints()).any(|nm| nm.is_finite());
    if phase != Phase::Holding || !measures || report.robot_digest != settings.robot.message_digest {
        return Ok(Vec::new());
    }
    let Resting::Held(rest) = rest(client, SETTLE_S, READ_S)? else { return Ok(Vec::new()) };
    let found = settings.holding_mismatches(&rest.q_rad, &rest.torque_nm);
    Ok(found
        .iter()
        .map(|mismatch| {
            format!(
                "{mismatch}; before the first motion look at payload and tool, at what the arm touches, and at the sign of the joint \
                 (`taustream calibrate gravity` finds masses)"
            )
        })
        .collect())
}
