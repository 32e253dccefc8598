//! Reports and receipts as text, with the names of the joints.
use crate::arm::ArmName;
use crate::live::replan::from_words;
use taustream_messages::{Outcome, Pause, PauseReason, Rejection, Report};

/// What went wrong, where, by how much: "tracking error (rad) at joint elbow: 0.12 against 0.05".
pub(crate) fn fault_sentence(report: &Report, arm: &ArmName) -> String {
    let Some(cause) = report.cause() else {
        return match report.fault_reason {
            0 => "no fault is reported".to_owned(),
            code => format!("unknown fault code {code}; use command line and streamer of one release"),
        };
    };
    arm.names_in(report).fault(&cause)
}

/// How often the computer stalled and what that did to the joints; `None` where it did not.
pub(crate) fn stalls_sentence(stalls: u64) -> Option<String> {
    let gaps = if stalls == 1 { "gap" } else { "gaps" };
    (stalls > 0).then(|| {
        format!(
            "{stalls} {gaps} between setpoints longer than the drives bridge: the computer was busy; there the joints may have left \
             the stop limits (`after_stall` in the settings)"
        )
    })
}

/// Why the arm is paused, and how it continues; `None` for an arm that is not.
pub(crate) fn pause_sentence(report: &Report) -> Option<String> {
    let Pause { reason, gap_s } = report.pause()?;
    Some(match reason {
        PauseReason::Operator => "paused by command; `taustream resume` continues".to_owned(),
        PauseReason::Stall => format!(
            "paused because no setpoint left for {:.1} ms (the computer was busy or asleep); `taustream resume` continues",
            gap_s * 1e3
        ),
    })
}

/// The receipt in one sentence.
pub(crate) fn receipt_sentence(outcome: Option<&Outcome>, arm: &ArmName) -> String {
    match outcome {
        None => "receipt: not readable; use command line and streamer of one release".to_owned(),
        Some(Outcome::Accepted { from_s, tick }) => {
            format!("receipt: accepted, {}", from_words(*from_s, *tick))
        }
        Some(Outcome::Rejected(rejection)) => {
            format!("receipt: rejected, {rejection}{}", joint_clause(rejection, arm))
        }
    }
}

fn joint_clause(rejection: &Rejection, arm: &ArmName) -> String {
    let (Rejection::Limit { joint, .. }
    | Rejection::NotAtBase { joint, .. }
    | Rejection::KeptBaseDiffers { joint, .. }) = rejection
    else {
        return String::new();
    };
    usize::try_from(*joint).map_or_else(|_| String::new(), |j| format!(" ({})", arm.joint(j)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_messages::{Cause, FaultReason};

    fn arm() -> ArmName {
        ArmName { name: "a".into(), joints: vec!["pan".into(), "lift".into()], ..ArmName::default() }
    }

    /// Goal: a received report is printed with this arm's names, and what another release wrote is not taken for "no fault".
    #[test]
    fn fault_sentence_reads_the_report_of_this_arm() {
        let mut report = Report { joint_count: 2, ..Report::default() };
        assert_eq!(fault_sentence(&report, &arm()), "no fault is reported");
        report
            .set_cause(Some(Cause::new(FaultReason::DriveFault).at_joint(1).code(0x8611).amount(24.0, 0.0)));
        let text = fault_sentence(&report, &arm());
        assert_eq!(text, "drive fault at joint 2 `lift`: 0x8611 following error too large (status 0x0018)");
        report.fault_reason = 99;
        assert!(fault_sentence(&report, &arm()).contains("code 99"));
    }

    #[test]
    fn pause_sentence_says_who_or_what_paused_and_how_to_go_on() {
        let mut report = Report::default();
        assert_eq!(pause_sentence(&report), None);
        report.set_pause(Some(Pause { reason: PauseReason::Operator, gap_s: 0.0 }));
        assert!(pause_sentence(&report).unwrap().contains("by command"));
        report.set_pause(Some(Pause { reason: PauseReason::Stall, gap_s: 0.0461 }));
        let text = pause_sentence(&report).unwrap();
        assert!(text.contains("no setpoint left for 46.1 ms") && text.contains("taustream resume"), "{text}");
    }

    #[test]
    fn receipt_sentence_names_the_joint_of_a_rejection() {
        let rejected = Outcome::Rejected(Rejection::NotAtBase { joint: 1, by_rad: 0.25 });
        let text = receipt_sentence(Some(&rejected), &arm());
        assert!(text.contains("0.2500 rad") && text.contains("`lift`"), "{text}");
    }
}
