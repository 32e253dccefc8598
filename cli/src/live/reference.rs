//! `taustream reference`: shows which joints are referenced, and sets references.
use super::client::Client;
use crate::args::ReferenceArgs;
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use std::thread;
use std::time::Duration;
use taustream_arm::revolution::possible_rad;
use taustream_arm::{Feedback, Servo, Settings};
use taustream_messages::{Command, ReferenceState, Report};

/// Most angles that are listed: a single-turn encoder behind a gear can allow a hundred.
const ANGLES_MAX: usize = 12;

/// What is known of one joint.
#[derive(Debug, Serialize)]
struct JointReference {
    joint: String,
    referenced: bool,
    known: &'static str,
    feedback: &'static str,
    /// Its shown angle; only valid when referenced.
    measured_rad: f64,
    /// The angles that its feedback allows, inside its range.
    possible_rad: Vec<f64>,
    /// What was answered to the word that was given.
    answer: Option<String>,
}

/// What is known of the arm.
#[derive(Debug, Serialize)]
struct References {
    arm: String,
    joints: Vec<JointReference>,
}

/// Shows what is known, or gives the operator's word for one joint or all that lack it.
pub(crate) fn run(form: Form, given: Option<&Path>, args: &ReferenceArgs) -> Result<(), Failure> {
    let settings = arm::settings(given)?;
    let names = ArmName::of(&settings);
    let client = Client::join(&settings.name)?;
    let (report, _) = client.report()?;
    let chosen = args.joint.as_deref().map(|word| joint_of(&settings, word)).transpose()?;
    if !args.confirm && args.at_rad.is_none() {
        let mut shown = References::of(&settings, &report);
        if let Some(only) = chosen {
            shown.joints = shown.joints.into_iter().skip(only).take(1).collect();
        }
        return form.print(&shown);
    }
    let words = match (chosen, args.at_rad) {
        (Some(joint), Some(at_rad)) => vec![(joint, at_rad)],
        (None, Some(_)) => {
            return Err(Failure::Usage("--at-rad sets the angle of one joint: name it with --joint".into()));
        }
        (chosen, None) => confirmed(&settings, &report, chosen)?,
    };
    let mut answers = Vec::new();
    for (joint, at_rad) in words {
        let requested = Command::Reference { joint: u32::try_from(joint).unwrap_or(u32::MAX), at_rad };
        let reply = client.command(requested)?;
        if !reply.is_accepted() {
            return Err(Failure::Refused(format!("reference refused: {}", reply.text())));
        }
        answers.push((joint, reply.text()));
    }
    // The next reports show what has become of it.
    thread::sleep(Duration::from_millis(50));
    let mut shown = References::of(&settings, &client.report()?.0);
    for (joint, text) in answers {
        if let Some(line) = shown.joints.get_mut(joint) {
            line.answer = Some(text);
        }
    }
    shown.arm = names.name;
    form.print(&shown)
}

/// A joint or an axis by its name, or by its number from 1; axes follow the joints.
pub(super) fn joint_of(settings: &Settings, word: &str) -> Result<usize, Failure> {
    let joints: Vec<_> = settings.all_slots().collect();
    let by_name = joints.iter().position(|joint| joint.name == word);
    let by_number = || word.parse::<usize>().ok()?.checked_sub(1).filter(|joint| *joint < joints.len());
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
        Failure::Usage(format!(
            "there is no joint `{word}`; the joints are {}, or 1 to {}",
            names.join(", "),
            joints.len()
        ))
    })
}

/// The angles that `--confirm` confirms: the shown ones, where the feedback allows one angle only.
fn confirmed(
    settings: &Settings,
    report: &Report,
    chosen: Option<usize>,
) -> Result<Vec<(usize, f64)>, Failure> {
    let mut words = Vec::new();
    for (joint, line) in References::of(settings, report).joints.into_iter().enumerate() {
        let meant = chosen.map_or(!line.referenced, |only| only == joint);
        if !meant {
            continue;
        }
        let [at_rad] = line.possible_rad.as_slice() else {
            let why = match line.possible_rad.len() {
                0 => "its feedback allows no angle in or near its range".to_owned(),
                _ => format!("its feedback allows {}", angles(&line.possible_rad)),
            };
            let text =
                format!("joint {}: {why}; set its angle with --joint {} --at-rad X", line.joint, line.joint);
            return Err(Failure::Refused(text));
        };
        words.push((joint, *at_rad));
    }
    if words.is_empty() {
        return Err(Failure::Refused("every joint is referenced; there is nothing to confirm".into()));
    }
    Ok(words)
}

impl References {
    fn of(settings: &Settings, report: &Report) -> Self {
        let line = |servo: &Servo| {
            let at = |values: &[f64]| values.get(servo.joint).copied().unwrap_or(f64::NAN);
            let reference_state = ReferenceState::from_code(
                report.reference_state.get(servo.joint).copied().unwrap_or_default(),
            );
            let measured_rad = at(&report.measured_rad);
            let joint = settings.slot(servo.joint);
            let range_rad = joint.map_or([0.0; 2], |joint| joint.limits.position_rad);
            let reading_rad = measured_rad - at(&report.multi_turn_offset_rad);
            let possible = match servo.feedback {
                Feedback::Incremental if reference_state.is_referenced() => vec![measured_rad],
                Feedback::Incremental | Feedback::MultiTurn | Feedback::Wraps if !reading_rad.is_finite() => {
                    Vec::new()
                }
                Feedback::Incremental | Feedback::MultiTurn | Feedback::Wraps => {
                    possible_rad(servo, reading_rad, range_rad, ANGLES_MAX)
                }
            };
            JointReference {
                joint: joint.map(|joint| joint.name.clone()).unwrap_or_default(),
                referenced: reference_state.is_referenced(),
                known: reference_state.word(),
                feedback: servo.feedback.word(),
                measured_rad,
                possible_rad: possible,
                answer: None,
            }
        };
        Self { arm: settings.name.clone(), joints: settings.servos.iter().map(line).collect() }
    }
}

impl fmt::Display for References {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "arm {}", self.arm)?;
        for line in &self.joints {
            let state = if line.referenced { "referenced" } else { "NOT REFERENCED" };
            write!(f, "\n  {:<18} {:>10.6} rad  {state}: {}", line.joint, line.measured_rad, line.known)?;
            if !line.referenced && line.feedback == Feedback::Wraps.word() {
                write!(f, "\n      possible angles: {}", angles(&line.possible_rad))?;
            }
            if let Some(answer) = &line.answer {
                write!(f, "\n      {answer}")?;
            }
        }
        Ok(())
    }
}

fn angles(angles_rad: &[f64]) -> String {
    let list: Vec<String> = angles_rad.iter().map(|angle| format!("{angle:.4}")).collect();
    let more = if angles_rad.len() == ANGLES_MAX { ", .." } else { "" };
    if list.is_empty() {
        "no angle in or near its range".to_owned()
    } else {
        format!("{}{more} rad", list.join(", "))
    }
}
