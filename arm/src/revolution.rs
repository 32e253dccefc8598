//! The multi-turn offset of a reading, when the feedback wraps.
//!
//! A feedback that wraps leaves whole periods open. A wrong offset looks valid and moves the joint the wrong way
//! round, so an offset is only used where it is the only possible one, with a margin; else the operator has to set it.
use crate::Servo;
use crate::trust::Feedback;

/// Largest part of a period by which a recorded or stated angle may differ from the angle that it selects. Half would be the
/// point where two angles are equally near; the rest is margin for motion meanwhile, and for measurement by eye.
pub const PERIOD_SHARE_MAX: f64 = 0.4;

/// How far outside its range a joint can stand (rad): past its software limit, up to its hard stop.
pub const OUTSIDE_RAD_MAX: f64 = 0.5;

/// Largest part of the angles that the range leaves free by which a joint may be outside on one side and its turn still
/// be taken: on the other side it would then be outside by three times as much.
const GAP_PART_MAX: f64 = 0.25;

/// What is to be added to `reading_rad`, a whole number of periods, to come nearest to `near_rad`.
///
/// Real time: arithmetic only.
#[must_use]
pub fn nearest_offset_rad(reading_rad: f64, period_rad: f64, near_rad: f64) -> f64 {
    ((near_rad - reading_rad) / period_rad).round() * period_rad
}

/// The offset when the joint's range allows only one: its range, with the margin on both sides, must fit in one period, and
/// the joint must be inside or clearly nearer to one end than to the other.
///
/// Real time: arithmetic only.
///
/// # Errors
/// When several offsets are possible, or none.
pub fn only_offset_rad(reading_rad: f64, period_rad: f64, range_rad: [f64; 2]) -> Result<f64, OffsetError> {
    let [low_rad, high_rad] = range_rad;
    if high_rad - low_rad > 2.0 * PERIOD_SHARE_MAX * period_rad {
        return Err(OffsetError::Several);
    }
    let margin_rad = (period_rad - (high_rad - low_rad)) * GAP_PART_MAX;
    let offset_rad = nearest_offset_rad(reading_rad, period_rad, low_rad.midpoint(high_rad));
    let inside = (low_rad - margin_rad..=high_rad + margin_rad).contains(&(reading_rad + offset_rad));
    if inside { Ok(offset_rad) } else { Err(OffsetError::None) }
}

/// Why there is not one offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OffsetError {
    /// None puts the joint inside its range.
    None,
    /// More than one does, or nearly does.
    Several,
}

/// The angles that a reading can mean, inside the joint's range or outside by at most [`OUTSIDE_RAD_MAX`], lowest first; at
/// most `most` of them.
#[must_use]
pub fn possible_rad(servo: &Servo, reading_rad: f64, range_rad: [f64; 2], most: usize) -> Vec<f64> {
    let (low_rad, high_rad) = (range_rad[0] - OUTSIDE_RAD_MAX, range_rad[1] + OUTSIDE_RAD_MAX);
    match servo.feedback {
        Feedback::MultiTurn => vec![reading_rad],
        Feedback::Incremental => Vec::new(),
        Feedback::Wraps => {
            let period_rad = servo.feedback_period_rad();
            let first = ((low_rad - reading_rad) / period_rad).ceil();
            let turns = std::iter::successors(Some(first), |turn| Some(turn + 1.0));
            let angles = turns.map(|turn| reading_rad + turn * period_rad);
            angles.take_while(|angle_rad| *angle_rad <= high_rad).take(most).collect()
        }
    }
}
