//! A checked sum of strokes over a base pose.
//!
//! `q(t) = base + sum of delta_i * phi_i(t)`, added in the order of the strokes, so that every reader of the
//! same message computes the same bits.
use crate::joint_array::{add_magnitude, add_scaled};
use crate::stroke::{Stroke, StrokeError};
use crate::{JointArray, MAX_JOINTS, MAX_STROKES, Setpoint};

/// A checked trajectory: 1 to [`MAX_JOINTS`] joints, up to 512 strokes sorted by start. Fields are private so that an
/// unchecked one cannot exist.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    joints: usize,
    base_rad: JointArray,
    strokes: [Stroke; MAX_STROKES],
    count: usize,
}

/// Why numbers do not make a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// Not 1 to [`MAX_JOINTS`] joints.
    #[error("{joints} joints; an arm has 1 to {MAX_JOINTS}")]
    JointCount {
        /// The count that was given.
        joints: usize,
    },
    /// Too many strokes.
    #[error("{strokes} strokes; a trajectory has at most {MAX_STROKES}")]
    StrokeCount {
        /// The count that was given.
        strokes: usize,
    },
    /// The base pose is not finite, or an unused joint of it is not zero.
    #[error("base_rad of joint {} is {value_rad}; it must be finite, and zero beyond the arm's joints", joint + 1)]
    Base {
        /// Zero-based index of the joint.
        joint: usize,
        /// The value that was given.
        value_rad: f64,
    },
    /// Strokes are not sorted by start.
    #[error("stroke {stroke} starts before the one in front of it; strokes are sorted by start_s")]
    NotSorted {
        /// Zero-based index of the later stroke.
        stroke: usize,
    },
    /// One stroke is at fault.
    #[error("stroke {stroke}: {error}")]
    Stroke {
        /// Zero-based index of the stroke.
        stroke: usize,
        /// What is wrong with it.
        error: StrokeError,
    },
}

impl Trajectory {
    /// Checks the numbers and makes a trajectory of them.
    ///
    /// # Errors
    /// The first fault, with the stroke and the joint.
    pub fn new(joints: usize, base_rad: JointArray, strokes: &[Stroke]) -> Result<Self, TrajectoryError> {
        if !(1..=MAX_JOINTS).contains(&joints) {
            return Err(TrajectoryError::JointCount { joints });
        }
        if strokes.len() > MAX_STROKES {
            return Err(TrajectoryError::StrokeCount { strokes: strokes.len() });
        }
        for (joint, &value_rad) in base_rad.iter().enumerate() {
            if !value_rad.is_finite() || (joint >= joints && value_rad != 0.0) {
                return Err(TrajectoryError::Base { joint, value_rad });
            }
        }
        let mut kept = [Stroke::default(); MAX_STROKES];
        let mut last_start_s = 0.0;
        for (index, (slot, stroke)) in kept.iter_mut().zip(strokes).enumerate() {
            stroke.check(joints).map_err(|error| TrajectoryError::Stroke { stroke: index, error })?;
            if stroke.start_s < last_start_s {
                return Err(TrajectoryError::NotSorted { stroke: index });
            }
            last_start_s = stroke.start_s;
            *slot = *stroke;
        }
        Ok(Self { joints, base_rad, strokes: kept, count: strokes.len() })
    }

    /// How many joints the arm has.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
    }
    /// The pose before the first stroke.
    #[must_use]
    pub fn base_rad(&self) -> &JointArray {
        &self.base_rad
    }
    /// The strokes, sorted by start.
    #[must_use]
    pub fn strokes(&self) -> &[Stroke] {
        self.strokes.get(..self.count).unwrap_or(&[])
    }
    /// When the last stroke has ended; 0 without strokes.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.strokes().iter().map(Stroke::end_s).fold(0.0, f64::max)
    }
    /// The pose after the last stroke.
    #[must_use]
    pub fn end_rad(&self) -> JointArray {
        let mut end_rad = self.base_rad;
        for stroke in self.strokes() {
            add_scaled(&mut end_rad, &stroke.delta_rad, 1.0, self.joints);
        }
        end_rad
    }
    /// Position, velocity, acceleration and jerk at trajectory time `t_s`; at rest before and after. A `t_s` that
    /// is NaN gives NaN for every joint that moves, so that no caller takes it for a pose.
    ///
    /// Real time: no allocation; time grows with the number of strokes (see [`Cursor`]).
    #[must_use]
    pub fn sample(&self, t_s: f64) -> Setpoint {
        self.sample_from(0, &self.base_rad, t_s)
    }

    /// Proven bound of how far each joint moves between two instants, in either order (rad).
    ///
    /// phi is monotone, so the sum of |delta| (phi(t2) - phi(t1)) is at least the total variation of the joint: every
    /// position between the two instants is within it of both ends. Grown by what rounding can take away.
    #[must_use]
    pub fn travel_bound_rad(&self, t1_s: f64, t2_s: f64) -> JointArray {
        self.travel_bound_after(0, t1_s, t2_s)
    }

    /// The same for whoever knows that the strokes in front of `first` have ended before both instants.
    #[must_use]
    pub fn travel_bound_after(&self, first: usize, t1_s: f64, t2_s: f64) -> JointArray {
        let (from_s, to_s) = if t1_s <= t2_s { (t1_s, t2_s) } else { (t2_s, t1_s) };
        let mut bound_rad = [0.0; MAX_JOINTS];
        for stroke in self.strokes().get(first..).unwrap_or(&[]) {
            if stroke.start_s >= to_s {
                break;
            }
            if stroke.has_ended(from_s) {
                continue;
            }
            // |error of phi| <= about 4 n epsilon < 6e-14 for n <= 64, at each of the two ends.
            let part = (stroke.phi(to_s).value - stroke.phi(from_s).value + PHI_ROUNDING).clamp(0.0, 1.0);
            add_magnitude(&mut bound_rad, &stroke.delta_rad, part, self.joints);
        }
        bound_rad
    }

    /// The position of [`Self::sample`], with the same bits, for whoever knows that the strokes in front of `first` have ended and have
    /// led to `reached_rad`.
    #[must_use]
    pub fn position_after(&self, first: usize, reached_rad: &JointArray, t_s: f64) -> JointArray {
        let mut position_rad = *reached_rad;
        for stroke in self.strokes().get(first..).unwrap_or(&[]) {
            let share = if stroke.has_ended(t_s) {
                1.0
            } else if t_s <= stroke.start_s {
                break; // Sorted by start: nothing behind it has begun.
            } else {
                stroke.running_phi(t_s, 1.0 / stroke.duration_s).value
            };
            add_scaled(&mut position_rad, &stroke.delta_rad, share, self.joints);
        }
        position_rad
    }

    /// The one sampling loop: `reached_rad` is the pose after the strokes in front of `first`, which have ended.
    fn sample_from(&self, first: usize, reached_rad: &JointArray, t_s: f64) -> Setpoint {
        let mut reached_rad = *reached_rad;
        let mut strokes = self.strokes().get(first..).unwrap_or(&[]);
        let stroke = loop {
            let [stroke, behind @ ..] = strokes else { return at_rest(&reached_rad) };
            strokes = behind;
            if !stroke.has_ended(t_s) {
                break stroke;
            }
            add_scaled(&mut reached_rad, &stroke.delta_rad, 1.0, self.joints);
        };
        if t_s <= stroke.start_s {
            return at_rest(&reached_rad); // Sorted by start: nothing behind it has begun.
        }
        let alone = strokes.first().is_none_or(|next| t_s <= next.start_s);
        if alone {
            // The common case writes the setpoint once: nothing is cleared first only to be added to.
            return of_stroke(&reached_rad, stroke, t_s);
        }
        let mut setpoint = of_stroke(&reached_rad, stroke, t_s);
        add_running(&mut setpoint, (strokes, self.joints), t_s);
        setpoint
    }
}

/// What one running stroke does to a pose.
#[inline(always)]
fn of_stroke(from_rad: &JointArray, stroke: &Stroke, t_s: f64) -> Setpoint {
    let [p, v, a, j] = stroke.shares(t_s);
    let mut position_rad = *from_rad;
    add_scaled(&mut position_rad, &stroke.delta_rad, p, MAX_JOINTS);
    Setpoint {
        position_rad,
        velocity_rad_s: stroke.delta_rad.map(|delta| delta * v),
        acceleration_rad_s2: stroke.delta_rad.map(|delta| delta * a),
        jerk_rad_s3: stroke.delta_rad.map(|delta| delta * j),
    }
}

/// Adds the strokes behind the first running one, in their order.
fn add_running(setpoint: &mut Setpoint, (strokes, joints): (&[Stroke], usize), t_s: f64) {
    for stroke in strokes {
        if t_s <= stroke.start_s {
            break;
        }
        if stroke.has_ended(t_s) {
            add_scaled(&mut setpoint.position_rad, &stroke.delta_rad, 1.0, joints);
            continue;
        }
        let [p, v, a, j] = stroke.shares(t_s);
        add_scaled(&mut setpoint.position_rad, &stroke.delta_rad, p, joints);
        add_scaled(&mut setpoint.velocity_rad_s, &stroke.delta_rad, v, joints);
        add_scaled(&mut setpoint.acceleration_rad_s2, &stroke.delta_rad, a, joints);
        add_scaled(&mut setpoint.jerk_rad_s3, &stroke.delta_rad, j, joints);
    }
}

fn at_rest(position_rad: &JointArray) -> Setpoint {
    Setpoint { position_rad: *position_rad, ..Setpoint::default() }
}

/// What rounding can take from a difference of two values of phi.
const PHI_ROUNDING: f64 = 2e-13;

/// Samples one trajectory at times that seldom fall; skips strokes that have ended, with the same bits as
/// [`Trajectory::sample`]. A cursor belongs to one trajectory: another one needs [`Cursor::at_start`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor {
    /// Strokes in front of this one have ended.
    pub first: usize,
    /// Pose after the strokes that have ended.
    pub reached_rad: JointArray,
    /// The latest instant that was requested; a default cursor has none, and starts at the base.
    last_t_s: Option<f64>,
}

impl Cursor {
    /// Starts at the base of a trajectory.
    #[must_use]
    pub fn at_start(trajectory: &Trajectory) -> Self {
        Self { first: 0, reached_rad: *trajectory.base_rad(), last_t_s: None }
    }

    /// Like [`Trajectory::sample`]; a `t_s` that went back starts over.
    ///
    /// Real time: no allocation; touches the strokes that run, that end in this step, and those that ended
    /// behind one that still runs (at most all of them, one addition a joint).
    pub fn sample(&mut self, trajectory: &Trajectory, t_s: f64) -> Setpoint {
        // Written so that a NaN starts over too, and leaves no trace in the sums.
        if !self.last_t_s.is_some_and(|last_t_s| t_s >= last_t_s) {
            *self = Self::at_start(trajectory);
        }
        self.last_t_s = Some(t_s);
        while let Some(stroke) = trajectory.strokes().get(self.first) {
            if !stroke.has_ended(t_s) {
                break;
            }
            add_scaled(&mut self.reached_rad, &stroke.delta_rad, 1.0, trajectory.joints);
            self.first += 1;
        }
        trajectory.sample_from(self.first, &self.reached_rad, t_s)
    }
}
