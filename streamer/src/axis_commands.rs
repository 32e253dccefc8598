//! What the operator may ask of an axis beside the path, and the answer. Every refusal says who, what, and by how much.
use crate::answer::AnswerReason;
use crate::axes::AxisRequest;
use crate::cycle_state::CycleState;
use crate::supervise::{Actions, Supervisor};
use taustream_arm::Axis;
use taustream_drivers::DriveState;
use taustream_messages::{AxisGoal, Phase};
use taustream_motion::axis::STROKE_S_MAX;
use taustream_motion::duration::stroke_duration_s;
use taustream_motion::stroke::N_MIN;

/// Excess of a position over its limit that is rounding of the text that stated it, of the range.
const ROUNDING: f64 = 1e-9;

impl Supervisor {
    /// Leads an axis somewhere, or says why not.
    ///
    /// Real time: bounded work, no allocation.
    pub(crate) fn axis(
        &self,
        (number, goal, force): (u32, AxisGoal, Option<f64>),
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        let index = usize::try_from(number).unwrap_or(usize::MAX);
        let (Some(axis), Some(request)) = (self.axes.get(index), actions.axes.each.get_mut(index)) else {
            return Err(AnswerReason::NoSuchAxis { axis: index, axes: self.axes.len() });
        };
        self.may_lead(index, cycle_state)?;
        let to = match goal {
            AxisGoal::Stop => {
                *request = Some(AxisRequest::Stop);
                return Ok(AnswerReason::AxisStops { axis: index });
            }
            AxisGoal::Open => axis.in_unit(axis.open_rad),
            AxisGoal::Closed => axis.in_unit(axis.closed_rad),
            AxisGoal::At(position) => position,
        };
        let target_rad = target_rad(axis, index, to)?;
        let torque_nm = torque_nm(axis, index, force)?;
        let from_rad = cycle_state.commanded_rad.get(self.joints + index).copied().unwrap_or(f64::NAN);
        let stroke_s = stroke_duration_s(target_rad - from_rad, &axis.output.limits.motion, N_MIN);
        if stroke_s.is_nan() || stroke_s > STROKE_S_MAX {
            return Err(AnswerReason::AxisTakesLong { axis: index, stroke_s });
        }
        *request = Some(AxisRequest::GoTo { target_rad, torque_nm });
        Ok(AnswerReason::AxisGoes { axis: index, to })
    }

    /// Whether the arm is in a phase in which axes are led, and the axis's servo follows.
    fn may_lead(&self, index: usize, cycle_state: &CycleState) -> Result<(), AnswerReason> {
        match self.phase {
            Phase::Holding | Phase::Moving | Phase::Pausing | Phase::Paused | Phase::Stopping => {}
            Phase::Fault | Phase::FastStopping | Phase::Braking => {
                return Err(AnswerReason::ClearFirst { cause: self.cause() });
            }
            Phase::Enabling | Phase::Disabling | Phase::Homing => return Err(AnswerReason::Wait),
            Phase::Configuring | Phase::Disabled | Phase::Locked => return Err(AnswerReason::EnableFirst),
        }
        let joint = self.joints + index;
        let state = cycle_state.servos.get(joint).map_or(DriveState::Absent, |servo| servo.state);
        if state == DriveState::Enabled {
            Ok(())
        } else {
            Err(AnswerReason::PartlyEnergised { joint, state })
        }
    }

    /// The first axis whose command moves.
    pub(crate) fn moving_axis(&self, cycle_state: &CycleState) -> Option<usize> {
        cycle_state.axes_moving.iter().take(self.axes.len()).position(|moving| *moving)
    }
}

/// A position in the axis's own unit as an angle inside its limits.
fn target_rad(axis: &Axis, index: usize, to: f64) -> Result<f64, AnswerReason> {
    let range = axis.range();
    let [low, high] = range;
    let tolerance = ROUNDING * (high - low);
    if !(low - tolerance..=high + tolerance).contains(&to) {
        return Err(AnswerReason::AxisOutside { axis: index, at: to, range });
    }
    let [low_rad, high_rad] = axis.output.limits.position_rad;
    Ok(axis.to_rad(to).max(low_rad).min(high_rad))
}

/// The torque that is contact: the force that was asked for, or the settings'.
fn torque_nm(axis: &Axis, index: usize, force: Option<f64>) -> Result<f64, AnswerReason> {
    let most_nm = axis.contact.and_then(|contact| contact.torque_nm);
    match (force, most_nm) {
        (None, most_nm) => Ok(most_nm.unwrap_or(f64::INFINITY)),
        (Some(_), None) => Err(AnswerReason::AxisFeelsNoForce { axis: index }),
        (Some(force), Some(most_nm)) => {
            let most = axis.force_of(most_nm);
            if force > 0.0 && force <= most * (1.0 + ROUNDING) {
                Ok(axis.torque_nm_of(force).min(most_nm))
            } else {
                Err(AnswerReason::AxisForce { axis: index, force, most })
            }
        }
    }
}
