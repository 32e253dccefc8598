//! Where the tip shall end: a goal of a replan request that is no pose of the joints.
use crate::plan::PlanRequestError;
use iceoryx2::prelude::ZeroCopySend;

/// A position or a pose of a tip, in the base's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipGoal {
    /// Which tip, counted from 0: a serial arm has one.
    pub tip: u32,
    /// Where it shall be.
    pub position_m: [f64; 3],
    /// How far off it may be.
    pub tolerance_m: f64,
    /// How it shall be turned; `None` leaves that free.
    pub orientation: Option<TipOrientation>,
    /// How it goes along a straight line; `None` takes any way.
    pub line: Option<TipLine>,
}

/// How the tip shall be turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipOrientation {
    /// Its axes in the base's frame: a unit quaternion x, y, z, w.
    pub quaternion_xyzw: [f64; 4],
    /// How far it may be turned about its own axes; infinite is free.
    pub tolerance_rad: [f64; 3],
}

/// How the tip goes along a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipLine {
    /// Speed of the position.
    pub linear_m_s: f64,
    /// Speed of the orientation.
    pub angular_rad_s: f64,
    /// How far it may be from the line.
    pub off_m_max: f64,
}

/// A quaternion's length may differ from 1 by so much.
const UNIT_MAX: f64 = 1e-6;
/// Bits of `kind`.
const TIP: u32 = 1;
const TURNED: u32 = 2;
const STRAIGHT: u32 = 4;

/// The goal on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
pub(crate) struct TipGoalWire {
    /// 0 for a pose of the joints.
    kind: u32,
    tip: u32,
    position_m: [f64; 3],
    tolerance_m: f64,
    quaternion_xyzw: [f64; 4],
    tolerance_rad: [f64; 3],
    /// Linear, angular, distance.
    line: [f64; 3],
}

impl From<Option<&TipGoal>> for TipGoalWire {
    fn from(goal: Option<&TipGoal>) -> Self {
        let Some(goal) = goal else { return Self::default() };
        let mut wire = Self {
            kind: TIP,
            tip: goal.tip,
            position_m: goal.position_m,
            tolerance_m: goal.tolerance_m,
            ..Self::default()
        };
        if let Some(o) = goal.orientation {
            wire.kind |= TURNED;
            (wire.quaternion_xyzw, wire.tolerance_rad) = (o.quaternion_xyzw, o.tolerance_rad);
        }
        if let Some(line) = goal.line {
            wire.kind |= STRAIGHT;
            wire.line = [line.linear_m_s, line.angular_rad_s, line.off_m_max];
        }
        wire
    }
}

impl TipGoalWire {
    /// The goal, checked; `None` for a pose of the joints.
    pub(crate) fn read(&self) -> Result<Option<TipGoal>, PlanRequestError> {
        if self.kind == 0 {
            return Ok(None);
        }
        if self.kind & TIP == 0 || self.kind & !(TIP | TURNED | STRAIGHT) != 0 {
            return Err(PlanRequestError::GoalKind { got: self.kind });
        }
        let bad = |what, value| Err(PlanRequestError::Tip { what, value });
        if let Some(value) = self.position_m.into_iter().find(|x| !x.is_finite()) {
            return bad("position (m)", value);
        }
        if !(self.tolerance_m.is_finite() && self.tolerance_m >= 0.0) {
            return bad("tolerance of the position (m)", self.tolerance_m);
        }
        let mut goal = TipGoal {
            tip: self.tip,
            position_m: self.position_m,
            tolerance_m: self.tolerance_m,
            orientation: None,
            line: None,
        };
        if self.kind & TURNED != 0 {
            let length = self.quaternion_xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
            // A NaN is near to nothing.
            if (length - 1.0).abs().partial_cmp(&UNIT_MAX).is_none_or(std::cmp::Ordering::is_gt) {
                return bad("length of the quaternion (1 is needed)", length);
            }
            if let Some(value) = self.tolerance_rad.into_iter().find(|t| t.is_nan() || *t < 0.0) {
                return bad("tolerance of the orientation (rad)", value);
            }
            let (quaternion_xyzw, tolerance_rad) = (self.quaternion_xyzw, self.tolerance_rad);
            goal.orientation = Some(TipOrientation { quaternion_xyzw, tolerance_rad });
        }
        if self.kind & STRAIGHT != 0 {
            let [linear_m_s, angular_rad_s, off_m_max] = self.line;
            if let Some(value) = self.line.into_iter().find(|x| !(x.is_finite() && *x > 0.0)) {
                return bad("speed or distance of the straight line", value);
            }
            goal.line = Some(TipLine { linear_m_s, angular_rad_s, off_m_max });
        }
        Ok(Some(goal))
    }
}
