//! Reports and receipts in words, with the names of the joints.
use crate::arm::ArmName;
use taustream_drivers::bring_up::{explain, explain_refusal};
use taustream_messages::{FaultReason, Outcome, Rejection, Report};

/// What went wrong, where, by how much: "tracking error (rad) at joint elbow: 0.12 against 0.05".
pub(crate) fn fault_sentence(report: &Report, arm: &ArmName) -> String {
    let Some(reason) = report.fault() else {
        return match report.fault_reason {
            0 => "no fault is reported".to_owned(),
            code => format!("unknown fault code {code}; use command line and streamer of one release"),
        };
    };
    let joint = match usize::try_from(report.fault_joint) {
        Ok(joint) if joint < report.joints() => format!(" at {}", arm.joint(joint)),
        _ => String::new(),
    };
    let (value, limit) = (report.fault_value, report.fault_limit);
    let amount = match reason {
        FaultReason::TorqueOff | FaultReason::Operator => String::new(),
        // With a limit it is a warning, and the value a statusword.
        FaultReason::DriveFault if limit <= 0.0 => {
            code(value).map_or_else(String::new, |code| format!(": {}", explain(code)))
        }
        FaultReason::ConfigurationRefused => {
            let (code, object) = (code(value).unwrap_or(0), code(limit).unwrap_or(0));
            format!(": {}", explain_refusal(code, object))
        }
        FaultReason::DriveFault | FaultReason::DriveDropped => {
            code(value).map_or_else(String::new, |word| format!(": {word:#06x}"))
        }
        FaultReason::FeedbackLate
        | FaultReason::TrackingError
        | FaultReason::PositionJump
        | FaultReason::Guard
        | FaultReason::BusFault
        | FaultReason::Stall
        | FaultReason::BringUp
        | FaultReason::NotTrusted
            if limit > 0.0 =>
        {
            format!(": {value:.6} against {limit:.6}")
        }
        FaultReason::FeedbackLate
        | FaultReason::TrackingError
        | FaultReason::PositionJump
        | FaultReason::Guard
        | FaultReason::BusFault
        | FaultReason::Stall
        | FaultReason::BringUp
        | FaultReason::NotTrusted => format!(": {value:.6}"),
    };
    format!("{}{joint}{amount}", reason.word(limit))
}

/// A code that crossed the wire as a float; `None` when it is none.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be a u32")]
fn code(value: f64) -> Option<u32> {
    (0.0..=f64::from(u32::MAX)).contains(&value).then_some(value as u32)
}

/// The receipt in one sentence.
pub(crate) fn receipt_sentence(outcome: Option<&Outcome>, arm: &ArmName) -> String {
    match outcome {
        None => "receipt: not readable; use command line and streamer of one release".to_owned(),
        Some(Outcome::Accepted { from_s, tick }) => {
            format!("receipt: accepted, runs from trajectory time {from_s:.3} s at cycle {tick}")
        }
        Some(Outcome::Rejected(rejection)) => {
            format!("receipt: rejected, {rejection}{}", joint_clause(rejection, arm))
        }
    }
}

fn joint_clause(rejection: &Rejection, arm: &ArmName) -> String {
    let (Rejection::Limit { joint, .. } | Rejection::NotAtBase { joint, .. }) = rejection else {
        return String::new();
    };
    usize::try_from(*joint).map_or_else(|_| String::new(), |j| format!(" ({})", arm.joint(j)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_messages::DRIVE_WARNING;

    fn arm() -> ArmName {
        ArmName { name: "a".into(), joints: vec!["pan".into(), "lift".into()] }
    }

    fn report(reason: FaultReason, joint: u32, value: f64, limit: f64) -> Report {
        Report {
            joint_count: 2,
            fault_reason: reason.code(),
            fault_joint: joint,
            fault_value: value,
            fault_limit: limit,
            ..Report::default()
        }
    }

    #[test]
    fn fault_sentence_names_reason_joint_and_amount() {
        let cases = [
            (
                report(FaultReason::TrackingError, 1, 0.12, 0.05),
                "tracking error (rad) at joint 2 `lift`: 0.120000 against 0.050000",
            ),
            (
                report(FaultReason::DriveFault, 0, f64::from(0x8611_u16), 0.0),
                "drive fault (error code) at joint 1 `pan`: 0x8611 following error too large",
            ),
            (
                report(FaultReason::ConfigurationRefused, 1, f64::from(0x0604_0041), f64::from(0x16_0002)),
                "drive refused its configuration at joint 2 `lift`: object 0x1600:02: SDO abort 0x06040041 object \
                 cannot be mapped into a PDO",
            ),
            (
                report(FaultReason::ConfigurationRefused, 0, f64::from(0x1_0008), f64::from(0x65_0200)),
                "drive refused its configuration at joint 1 `pan`: object 0x6502:00: the drive does not offer cyclic \
                 synchronous position (object 0x6502, bit 7)",
            ),
            (
                report(FaultReason::DriveDropped, 0, f64::from(0x0250), 0.0),
                "drive left operation by itself (statusword) at joint 1 `pan`: 0x0250",
            ),
            (
                report(FaultReason::DriveFault, 0, f64::from(0x12B7_u16), DRIVE_WARNING),
                "drive warns (statusword) at joint 1 `pan`: 0x12b7",
            ),
            (report(FaultReason::Operator, u32::MAX, 0.0, 0.0), "fast stop by the operator"),
            (report(FaultReason::Guard, 7, f64::NAN, 1.0), "setpoint failed the guard: NaN against 1.000000"),
        ];
        for (report, expected) in cases {
            assert_eq!(fault_sentence(&report, &arm()), expected);
        }
        assert!(
            fault_sentence(&Report { fault_reason: 99, ..Report::default() }, &arm()).contains("code 99")
        );
    }

    #[test]
    fn receipt_sentence_names_the_joint_of_a_rejection() {
        let rejected = Outcome::Rejected(Rejection::NotAtBase { joint: 1, by_rad: 0.25 });
        let text = receipt_sentence(Some(&rejected), &arm());
        assert!(text.contains("0.250000 rad") && text.contains("`lift`"), "{text}");
    }
}
