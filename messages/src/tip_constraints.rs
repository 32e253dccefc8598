//! What the tip must keep along a whole motion: part of a replan request, and of a plan.
use crate::plan::PlanRequestError;
use iceoryx2::prelude::ZeroCopySend;

/// Constraints of one tip that hold from the begin of a motion to its end. Nothing is asked for by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TipConstraints {
    /// Which tip, counted from 0: a serial arm has one.
    pub tip: u32,
    /// An axis of the tip keeps a direction.
    pub upright: Option<Upright>,
    /// The tip's origin stays inside a box.
    pub inside: Option<TipBox>,
    /// Speed limit of the tip's origin.
    pub speed_m_s: Option<f64>,
}

/// An axis of the tip within an angle of a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Upright {
    /// In the tip's frame, of unit length.
    pub tip_axis: [f64; 3],
    /// In the base's frame, of unit length.
    pub direction: [f64; 3],
    /// Largest angle between the two.
    pub tolerance_rad: f64,
}

/// A box in the base's frame, parallel to its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipBox {
    /// Least x, y and z, m; minus infinity leaves a side open.
    pub low_m: [f64; 3],
    /// Greatest x, y and z, m; infinity leaves a side open.
    pub high_m: [f64; 3],
}

/// Smallest angle that a tip can be asked to keep: a fiftieth of a degree, below which only luck finds a motion.
pub const TOLERANCE_RAD_MIN: f64 = 3.5e-4;
/// Lowest speed limit: slower motions would last for hours.
pub const SPEED_M_S_MIN: f64 = 1e-4;
/// A direction's length may differ from 1 by so much.
const UNIT_MAX: f64 = 1e-6;
/// Bits of `kinds`.
const UPRIGHT: u32 = 1;
const INSIDE: u32 = 2;
const SPEED: u32 = 4;

impl TipConstraints {
    /// True when nothing is asked for.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.upright.is_none() && self.inside.is_none() && self.speed_m_s.is_none()
    }

    /// The first number that makes no sense: its name and value.
    #[must_use]
    pub fn fault(&self) -> Option<(&'static str, f64)> {
        if let Some(Upright { tip_axis, direction, tolerance_rad }) = self.upright {
            for (what, vector) in [
                ("axis (its length; 1 is needed)", tip_axis),
                ("direction (its length; 1 is needed)", direction),
            ] {
                let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
                // A NaN is in no range.
                if !(1.0 - UNIT_MAX..=1.0 + UNIT_MAX).contains(&length) {
                    return Some((what, length));
                }
            }
            if !(TOLERANCE_RAD_MIN..=std::f64::consts::PI).contains(&tolerance_rad) {
                return Some(("angle (3.5e-4 to pi, rad)", tolerance_rad));
            }
        }
        if let Some(TipBox { low_m, high_m }) = self.inside {
            for (low, high) in low_m.into_iter().zip(high_m) {
                if low.is_nan() || low == f64::INFINITY {
                    return Some(("lower bound (m)", low));
                }
                if high.is_nan() || high <= low {
                    return Some(("upper bound (above the lower one, m)", high));
                }
            }
        }
        self.speed_m_s
            .filter(|speed| !(*speed >= SPEED_M_S_MIN && speed.is_finite()))
            .map(|speed| ("speed limit (0.0001 or more, m/s)", speed))
    }
}

/// The constraints on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
pub(crate) struct TipConstraintsWire {
    kinds: u32,
    tip: u32,
    tip_axis: [f64; 3],
    direction: [f64; 3],
    tolerance_rad: f64,
    low_m: [f64; 3],
    high_m: [f64; 3],
    speed_m_s: f64,
}

impl From<&TipConstraints> for TipConstraintsWire {
    fn from(asked: &TipConstraints) -> Self {
        let mut wire = Self { tip: asked.tip, ..Self::default() };
        if let Some(Upright { tip_axis, direction, tolerance_rad }) = asked.upright {
            wire.kinds |= UPRIGHT;
            (wire.tip_axis, wire.direction, wire.tolerance_rad) = (tip_axis, direction, tolerance_rad);
        }
        if let Some(TipBox { low_m, high_m }) = asked.inside {
            wire.kinds |= INSIDE;
            (wire.low_m, wire.high_m) = (low_m, high_m);
        }
        if let Some(speed_m_s) = asked.speed_m_s {
            wire.kinds |= SPEED;
            wire.speed_m_s = speed_m_s;
        }
        wire
    }
}

impl TipConstraintsWire {
    /// The constraints, checked.
    pub(crate) fn read(&self) -> Result<TipConstraints, PlanRequestError> {
        if self.kinds & !(UPRIGHT | INSIDE | SPEED) != 0 {
            return Err(PlanRequestError::ConstraintKind { got: self.kinds });
        }
        let has = |kind: u32| self.kinds & kind != 0;
        let Self { tip, tip_axis, direction, tolerance_rad, low_m, high_m, speed_m_s, .. } = *self;
        let asked = TipConstraints {
            tip,
            upright: has(UPRIGHT).then_some(Upright { tip_axis, direction, tolerance_rad }),
            inside: has(INSIDE).then_some(TipBox { low_m, high_m }),
            speed_m_s: has(SPEED).then_some(speed_m_s),
        };
        match asked.fault() {
            Some((what, value)) => Err(PlanRequestError::Constraint { what, value }),
            None => Ok(asked),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> TipConstraints {
        TipConstraints {
            tip: 1,
            upright: Some(Upright {
                tip_axis: [0.0, 0.0, 1.0],
                direction: [0.0, 0.6, -0.8],
                tolerance_rad: 0.1,
            }),
            inside: Some(TipBox {
                low_m: [f64::NEG_INFINITY, f64::NEG_INFINITY, 0.2],
                high_m: [f64::INFINITY, 1.0, f64::INFINITY],
            }),
            speed_m_s: Some(0.25),
        }
    }

    #[test]
    fn constraints_come_back() {
        let alone = TipConstraints { speed_m_s: Some(0.1), ..TipConstraints::default() };
        for asked in [TipConstraints::default(), alone, all()] {
            assert_eq!(TipConstraintsWire::from(&asked).read(), Ok(asked));
        }
        assert!(TipConstraints::default().is_none() && !alone.is_none());
    }

    #[test]
    fn hostile_constraints_are_refused() {
        let good = TipConstraintsWire::from(&all());
        let cases = [
            (TipConstraintsWire { kinds: 8, ..good }, "kind"),
            (TipConstraintsWire { tip_axis: [0.0; 3], ..good }, "axis"),
            (TipConstraintsWire { direction: [f64::NAN, 0.0, 1.0], ..good }, "direction"),
            (TipConstraintsWire { tolerance_rad: 0.0, ..good }, "angle"),
            (TipConstraintsWire { tolerance_rad: f64::NAN, ..good }, "angle"),
            (TipConstraintsWire { low_m: [f64::NAN, 0.0, 0.0], ..good }, "lower"),
            (TipConstraintsWire { high_m: [1.0, 1.0, 0.2], ..good }, "upper"),
            (TipConstraintsWire { speed_m_s: 0.0, ..good }, "speed"),
            (TipConstraintsWire { speed_m_s: f64::INFINITY, ..good }, "speed"),
        ];
        for (wire, expected) in cases {
            let error = wire.read().unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
