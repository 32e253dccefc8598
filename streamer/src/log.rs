//! Notes of the cycle as lines of the log.
use crate::facts::{Cause, Transition, TripKind};
use crate::report::Note;
use taustream_drivers::bring_up::{explain, explain_refusal};
use taustream_messages::{FaultReason, Phase};
use tracing::{error, info, warn};

/// Writes a note. `name` gives a joint's name.
pub fn note(note: &Note, name: impl Fn(usize) -> String) {
    match note {
        Note::Transition(transition) => write_transition(transition, name),
        Note::Trip { trip, sweep_rad } => {
            let joint = name(trip.joint);
            let what = match trip.kind {
                TripKind::NotFinite => "is not a finite number".to_owned(),
                TripKind::Limit(quantity) => format!("breaks its {quantity:?} limit"),
                TripKind::Inconsistent(quantity) => {
                    format!("has a {quantity:?} that its positions do not show")
                }
                TripKind::CannotStop => "cannot stop before its position limit".to_owned(),
            };
            let (value, limit) = (trip.value, trip.limit);
            error!(
                "guard: setpoint of joint {joint} {what} ({value} against {limit}); all joints brake over {sweep_rad:?} rad"
            );
        }
        Note::Stall { gap_s } => warn!("no setpoint left for {gap_s:.4} s: trajectory time stands still"),
    }
}

fn write_transition(t: &Transition, name: impl Fn(usize) -> String) {
    let (from, to, tick) = (t.from.word(), t.to.word(), t.tick);
    if let (Phase::Fault | Phase::FastStopping | Phase::Braking, Some(cause)) = (t.to, t.cause) {
        error!(tick, "{from} -> {to}: {}", cause_sentence(&cause, name));
    } else {
        info!(tick, "{from} -> {to}: {}", t.event.word());
    }
}

/// "feedback late (s): joint 3 (elbow), 0.021 against 0.02".
pub fn cause_sentence(cause: &Cause, name: impl Fn(usize) -> String) -> String {
    let joint = cause.joint.map_or(String::new(), |joint| format!(" joint {},", name(joint)));
    let value = match cause.reason {
        // With a limit it is a warning, and the value a statusword.
        FaultReason::DriveFault if cause.limit <= 0.0 => explain(code(cause.value)),
        FaultReason::ConfigurationRefused => explain_refusal(code(cause.value), code(cause.limit)),
        FaultReason::DriveFault | FaultReason::DriveDropped => format!("{:#06x}", code(cause.value)),
        FaultReason::FeedbackLate
        | FaultReason::TrackingError
        | FaultReason::PositionJump
        | FaultReason::Guard
        | FaultReason::BusFault
        | FaultReason::Stall
        | FaultReason::BringUp
        | FaultReason::NotTrusted
        | FaultReason::TorqueOff
        | FaultReason::Operator => format!("{} against {}", cause.value, cause.limit),
    };
    format!("{}:{joint} {value}", cause.reason.word(cause.limit))
}

fn code(value: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a u32 was stored; `as` saturates"
    )]
    let code = value as u32;
    code
}
