//! Which constraint of the tip is not kept, and by how much.
use taustream_motion::digits::Amount;

/// One constraint that is not kept.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TipFault {
    /// The tip's axis is too far from its direction.
    #[error("{}", turned(*angle_rad, *tolerance_rad))]
    Tilted {
        /// Angle between the two.
        angle_rad: f64,
        /// What is allowed.
        tolerance_rad: f64,
    },
    /// The tip is outside its box.
    #[error("{}", outside(*axis, *value_m, *bound_m, *is_low))]
    Outside {
        /// x, y or z.
        axis: char,
        /// Where the tip is.
        value_m: f64,
        /// The side of the box.
        bound_m: f64,
        /// True for the lower side.
        is_low: bool,
    },
    /// The tip is too fast.
    #[error(
        "the tip goes at {speed_m_s:.4} m/s, {} m/s more than the {limit_m_s} m/s {}",
        Amount(speed_m_s - limit_m_s), whose(zone.as_deref())
    )]
    Fast {
        /// Its speed.
        speed_m_s: f64,
        /// The limit there.
        limit_m_s: f64,
        /// The zone whose limit it is; `None` for that of the whole motion.
        zone: Option<String>,
    },
    /// A tip that the robot does not have.
    #[error("there is no tip {}; the robot has {tips}", u64::from(*tip) + 1)]
    NoSuchTip {
        /// Counted from 0.
        tip: u32,
        /// How many there are.
        tips: usize,
    },
    /// A number that makes no sense.
    #[error("the constraint of the tip: {what} is {value}")]
    Number {
        /// Which one.
        what: &'static str,
        /// The value.
        value: f64,
    },
}

impl TipFault {
    /// Of a tip without constraints.
    pub(crate) const NONE: Self = Self::Number { what: "nothing", value: 0.0 };
}

fn turned(angle_rad: f64, tolerance_rad: f64) -> String {
    let (angle, tolerance) = (angle_rad.to_degrees(), tolerance_rad.to_degrees());
    let by = angle - tolerance;
    if by > 0.0 {
        format!(
            "the tip's axis is {angle:.3} deg from its direction, {} deg more than the {tolerance:.3} deg allowed",
            Amount(by)
        )
    } else {
        format!(
            "the tip's axis is {angle:.3} deg from its direction, at the very edge of the {tolerance:.3} deg allowed"
        )
    }
}

fn outside(axis: char, value_m: f64, bound_m: f64, is_low: bool) -> String {
    let by_m = if is_low { bound_m - value_m } else { value_m - bound_m };
    let (side, most) = if is_low { ("below", "least") } else { ("above", "most") };
    if by_m > 0.0 {
        format!(
            "the tip's {axis} is {value_m:.4} m, {} m {side} the {bound_m} m that it must be at {most}",
            Amount(by_m)
        )
    } else {
        format!(
            "the tip's {axis} is {value_m:.4} m, at the very edge of the {bound_m} m that it must be at {most}"
        )
    }
}

fn whose(zone: Option<&str>) -> String {
    zone.map_or_else(|| "allowed".to_owned(), |zone| format!("of zone {zone}"))
}

/// Why a motion is not proven to keep its constraints.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConstraintViolation {
    /// The constraints themselves make no sense.
    #[error(transparent)]
    Asked(#[from] TipFault),
    /// One is not kept.
    #[error("{fault}, at t = {at_s:.3} s")]
    Broken {
        /// The worst instant of a sampling.
        at_s: f64,
        /// Which one.
        fault: TipFault,
    },
    /// The proof ran out of work; nothing is known to be wrong.
    #[error("{checks} checks did not settle the constraints of the tip at t = {at_s:.3} s")]
    Unresolved {
        /// How many instants were checked.
        checks: usize,
        /// The instant that the proof had reached.
        at_s: f64,
    },
}
