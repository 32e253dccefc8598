//! What every simulated servo is made of, whatever it speaks: one joint's mechanics, and the encoder on it.
use super::plant::{Plant, PlantParameters};
use crate::servo::Nanos;

/// Time that is simulated after a pause of the process; what is longer is skipped.
const CATCH_UP_NS: u64 = 1_000_000_000;

/// The mechanics of one joint, and how far they have been moved on.
#[derive(Clone, Debug)]
pub(crate) struct Mechanics {
    pub(crate) plant: Plant,
    /// The encoder reads this much too far.
    pub(crate) encoder_shift_rad: f64,
    /// Time up to which they have been moved; `None` before the first call.
    pub(crate) moved: Option<Nanos>,
    step_ns: u64,
}

impl Mechanics {
    /// At rest.
    pub(crate) fn new(parameters: PlantParameters, start_rad: f64, step_ns: u64) -> Self {
        let plant = Plant::new(parameters, start_rad);
        Self { plant, encoder_shift_rad: 0.0, moved: None, step_ns }
    }

    /// The whole steps that are due by `now`: when each ends. They count as made.
    pub(crate) fn due(&mut self, now: Nanos) -> impl Iterator<Item = Nanos> + use<> {
        let (step_ns, end) = (self.step_ns, now.0);
        let from = self.moved.unwrap_or(now).0.max(now.0.saturating_sub(CATCH_UP_NS));
        let steps = end.saturating_sub(from) / step_ns;
        self.moved = Some(Nanos(from + steps * step_ns));
        (1..=steps).map(move |step| Nanos(from + step * step_ns))
    }

    /// Length of a step.
    pub(crate) fn step_s(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "at most a million")]
        let step_s = self.step_ns as f64 * 1e-9;
        step_s
    }

    /// Link angle as an encoder with no end of digits reads it, `ahead_s` after the last whole step.
    pub(crate) fn read_rad(&self, ahead_s: f64) -> f64 {
        self.plant.position_rad + ahead_s * self.plant.velocity_rad_s + self.encoder_shift_rad
    }

    /// How long after the last whole step `now` is.
    pub(crate) fn ahead_s(&self, now: Nanos) -> f64 {
        self.moved.map_or(0.0, |moved| now.since_s(moved))
    }
}
