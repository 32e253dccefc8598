//! Notes of the cycle as lines of the log.
use crate::cycle_state::{Transition, TripKind};
use crate::names::Names;
use crate::report::Note;
use taustream_arm::text::counted;
use taustream_messages::Phase;
use tracing::{error, info, warn};

/// Writes a note.
pub fn note(note: &Note, names: &Names) {
    match note {
        Note::Transition(transition) => write_transition(transition, names),
        Note::Trip { trip, sweep_rad } => {
            let joint = names.joint(trip.joint);
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
                "guard: setpoint of {joint} {what} ({value} against {limit}); all joints brake over {sweep_rad:?} rad"
            );
        }
        Note::BusError { bus, error, count } => warn!(
            "{}: {} ({} since the last such line); {}",
            names.bus(*bus),
            error.sentence(),
            counted(*count, "error frame"),
            error.remedy()
        ),
        Note::BusFailed { bus, bus_fault } => error!(
            "{}: {}; nothing is sent on it until `clear-fault`; {}",
            names.bus(*bus),
            bus_fault.word(),
            bus_fault.remedy(names.interface(*bus))
        ),
        Note::Stall { gap_s } => {
            warn!("no setpoint was sent for {gap_s:.4} s: trajectory time does not advance");
        }
    }
}

fn write_transition(t: &Transition, names: &Names) {
    let (from, to, tick) = (t.from.word(), t.to.word(), t.tick);
    if let (Phase::Fault | Phase::FastStopping | Phase::Braking, Some(cause)) = (t.to, t.cause) {
        error!(tick, "{from} -> {to}: {}", names.fault(&cause));
    } else {
        info!(tick, "{from} -> {to}: {}", t.event.word());
    }
}
