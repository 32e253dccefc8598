//! What a proven motion uses of the constraints of its tip: a line each for people, a key each for programs.
use serde::Serialize;
use std::fmt;
use taustream_planner::TipConstraints;
use taustream_planner::constraints::TipUse;

/// Constraints and use; null where nothing is asked for. The constraints are proven, the use is measured at dense samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct TipLines {
    /// Largest angle between the tip's axis and its direction.
    tip_tilt_rad: Option<f64>,
    tip_tilt_allowed_rad: Option<f64>,
    /// Least distance of the tip to a side of its box.
    tip_inside_m: Option<f64>,
    /// Largest speed of the tip.
    tip_speed_m_s: Option<f64>,
    tip_speed_allowed_m_s: Option<f64>,
    #[serde(skip)]
    zones: usize,
}

impl TipLines {
    pub(crate) fn of(asked: &TipConstraints, used: Option<TipUse>) -> Self {
        Self {
            tip_tilt_rad: used.and_then(|used| used.tilt_rad),
            tip_tilt_allowed_rad: asked.upright.map(|upright| upright.tolerance_rad),
            tip_inside_m: used.and_then(|used| used.inside_m),
            tip_speed_m_s: used.map(|used| used.speed_m_s),
            tip_speed_allowed_m_s: asked.speed_m_s,
            zones: used.map_or(0, |used| used.zones),
        }
    }
}

impl fmt::Display for TipLines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let (Some(tilt_rad), Some(allowed_rad)) = (self.tip_tilt_rad, self.tip_tilt_allowed_rad) {
            let (tilt, allowed) = (tilt_rad.to_degrees(), allowed_rad.to_degrees());
            writeln!(f, "tip upright   within {tilt:.2} deg of its direction (proven: {allowed} deg)")?;
        }
        if let Some(inside_m) = self.tip_inside_m {
            writeln!(f, "tip inside    its box, by {inside_m:.4} m at least (proven: inside)")?;
        }
        if let Some(speed_m_s) = self.tip_speed_m_s {
            write!(f, "tip speed     at most {speed_m_s:.4} m/s")?;
            match (self.tip_speed_allowed_m_s, self.zones) {
                (Some(allowed_m_s), 0) => writeln!(f, " (proven: {allowed_m_s} m/s)")?,
                (Some(allowed_m_s), _) => writeln!(f, " (proven: {allowed_m_s} m/s, and the zones' limits)")?,
                (None, 0) => writeln!(f)?,
                (None, _) => writeln!(f, " (proven: the zones' limits)")?,
            }
        }
        Ok(())
    }
}
