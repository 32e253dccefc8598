//! The position range of a joint, and the one tolerance with which every part of the system reads it.
//!
//! Planner, verification, the streamer's intake, its guard and `enable` all use this module, so that what one of them
//! accepts is not refused by the next. A pose counts as inside up to [`POSITION_TOLERANCE_RAD`] beyond a limit. Plans end
//! [`INSIDE_RAD`] inside of it. A joint that stands further outside may stay there or move inwards: each command narrows
//! what is permitted to what was reached, and never widens it.
use crate::JointLimits;

/// How far outside its range a joint may be and still count as at its limit (rad). It covers what separates a command at
/// the limit from the angle that is measured afterwards: rounding of the sum of strokes (below 1e-12), one count of the
/// encoder (up to 4e-4 for 14 bit behind no gear), and the sag of a stiff joint when its brake takes over.
pub const POSITION_TOLERANCE_RAD: f64 = 1e-3;

/// How far inside the range a plan ends whose goal is at the limit, or outside by no more than the tolerance (rad): more
/// than rounding, less than a count of any encoder.
pub const INSIDE_RAD: f64 = 1e-9;

impl JointLimits {
    /// How far an angle lies outside the range: positive above, negative below, 0 inside. No tolerance is applied.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn outside_rad(&self, position_rad: f64) -> f64 {
        let [low_rad, high_rad] = self.position_rad;
        (position_rad - high_rad).max(0.0) + (position_rad - low_rad).min(0.0)
    }

    /// True when an angle is inside the range, or outside by no more than the tolerance. Not a number is not.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn is_inside(&self, position_rad: f64) -> bool {
        PermittedRange::new(self).contains(position_rad)
    }

    /// The nearest angle at which a plan may end.
    #[must_use]
    pub fn nearest_inside(&self, position_rad: f64) -> f64 {
        let [low_rad, high_rad] = self.position_rad;
        if high_rad - low_rad <= 2.0 * INSIDE_RAD {
            return 0.5 * (low_rad + high_rad);
        }
        position_rad.max(low_rad + INSIDE_RAD).min(high_rad - INSIDE_RAD)
    }
}

/// The angles that a joint may be commanded to: its range with the tolerance, or up to where it stands outside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PermittedRange {
    /// The range with the tolerance.
    tolerated_rad: [f64; 2],
    low_rad: f64,
    high_rad: f64,
}

impl PermittedRange {
    /// For a joint inside its range.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn new(limits: &JointLimits) -> Self {
        let [low_rad, high_rad] = limits.position_rad;
        let (low_rad, high_rad) = (low_rad - POSITION_TOLERANCE_RAD, high_rad + POSITION_TOLERANCE_RAD);
        Self { tolerated_rad: [low_rad, high_rad], low_rad, high_rad }
    }

    /// For a joint that stands anywhere: outside, up to where it stands. Not a number permits no more than the range.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn around(limits: &JointLimits, position_rad: f64) -> Self {
        let range = Self::new(limits);
        Self { low_rad: range.low_rad.min(position_rad), high_rad: range.high_rad.max(position_rad), ..range }
    }

    /// After a command: what lies further outside than it is permitted no more.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn narrowed_to(self, position_rad: f64) -> Self {
        let [low_rad, high_rad] = self.tolerated_rad;
        Self {
            low_rad: self.low_rad.max(low_rad.min(position_rad)),
            high_rad: self.high_rad.min(high_rad.max(position_rad)),
            ..self
        }
    }

    /// Lowest and highest permitted angle.
    ///
    /// Real time: a copy.
    #[must_use]
    pub fn ends_rad(&self) -> [f64; 2] {
        [self.low_rad, self.high_rad]
    }

    /// False for what is not a number.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn contains(&self, position_rad: f64) -> bool {
        (self.low_rad..=self.high_rad).contains(&position_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LimitSet;

    const NONE: LimitSet = LimitSet { velocity_rad_s: 0.0, acceleration_rad_s2: 0.0, jerk_rad_s3: 0.0 };
    const RANGE: JointLimits = JointLimits { position_rad: [-1.0, 2.0], motion: NONE, stop: NONE };

    #[test]
    fn range_includes_its_ends_and_the_tolerance_and_nothing_more() {
        for inside in [-1.0, 2.0, 0.3, -1.0 - 0.999e-3, 2.0 + 0.999e-3] {
            assert!(RANGE.is_inside(inside), "{inside}");
        }
        for outside in [-1.001_001, 2.001_001, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(!RANGE.is_inside(outside), "{outside}");
        }
        assert!(
            (RANGE.outside_rad(2.25) - 0.25).abs() < 1e-15 && (RANGE.outside_rad(-1.5) + 0.5).abs() < 1e-15
        );
        assert!(RANGE.outside_rad(2.0).abs() < f64::MIN_POSITIVE);
    }

    #[test]
    fn plans_end_inside_of_a_limit_and_leave_other_goals_alone() {
        assert!(RANGE.nearest_inside(2.0) < 2.0 && RANGE.nearest_inside(2.0) > 2.0 - 2e-9);
        assert!(RANGE.nearest_inside(-7.0) > -1.0);
        assert_eq!(RANGE.nearest_inside(0.3).to_bits(), 0.3_f64.to_bits());
        let fixed = JointLimits { position_rad: [0.5, 0.5], ..RANGE };
        assert_eq!(fixed.nearest_inside(9.0).to_bits(), 0.5_f64.to_bits());
    }

    /// Goal: a joint outside may only come in, however small the steps are, on either side.
    #[test]
    fn permitted_range_follows_inwards_and_never_back() {
        for (start, inwards, outwards) in [(2.5, 2.3, 2.4), (-1.5, -1.2, -1.3)] {
            let range = PermittedRange::around(&RANGE, start);
            assert!(range.contains(start) && range.contains(0.0));
            let range = range.narrowed_to(inwards);
            assert!(range.contains(inwards) && !range.contains(outwards), "{start}");
            let range = range.narrowed_to(0.0).narrowed_to(start);
            assert_eq!(range, PermittedRange::new(&RANGE), "inside, the range is the stated one for good");
        }
        let both = PermittedRange::around(&RANGE, 2.5).narrowed_to(f64::NAN);
        assert!(!both.contains(2.6) && both.contains(1.0));
        assert_eq!(PermittedRange::around(&RANGE, f64::NAN), PermittedRange::new(&RANGE));
    }
}
