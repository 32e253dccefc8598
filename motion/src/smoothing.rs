//! Any motion as a sum of strokes: smoothed by the kernel phi'.
//!
//! phi' is positive and has unit mass, so strokes of one duration T and one n, evenly spaced, each as far as the motion goes
//! in its spacing, average the motion over T:
//!
//! ```text
//! q(t) = r(0) + sum of (r((k+1) h) - r(k h)) phi((t - k h)/T)  =~  integral of r(t - T s) phi'(s) ds
//! ```
//!
//! So do its derivatives: a motion inside of limits stays inside of them, up to the ripple of the spacing (in the jerk about
//! 1.2 n v h^2/T^4 at a speed of v, because phi' sets out as 4 n s^3), and what comes out is C3 and goes from rest to rest,
//! whatever went in. The price is a delay, and corners that are cut a little: where the
//! motion accelerates by a, q is off by a T^2/2 times the variance of the kernel.
use crate::stroke::{N_MIN, Stroke};
use crate::trajectory::{Trajectory, TrajectoryError};
use crate::{JointArray, MAX_STROKES};

/// What smooths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    /// Exponent of every stroke.
    pub n: u32,
    /// Duration T of every stroke (s).
    pub width_s: f64,
    /// Into how many equal parts the motion is cut. Parts in which nothing moves need no stroke.
    pub parts: u32,
}

impl Kernel {
    /// Distance of neighbouring strokes for a motion of this duration (s); the whole of it for no parts.
    #[must_use]
    pub fn spacing_s(&self, span_s: f64) -> f64 {
        span_s / f64::from(self.parts.max(1))
    }

    /// By how much the smoothed motion lags behind the motion on average (s): the mean of the kernel, less half a spacing,
    /// because a stroke starts at the beginning of what it stands for.
    #[must_use]
    pub fn delay_s(&self, span_s: f64) -> f64 {
        let [mean, _] = moments(self.n);
        mean * self.width_s - 0.5 * self.spacing_s(span_s)
    }
}

/// Mean and standard deviation of the kernel phi' over s in [0, 1], in closed form: the integrals of (1 - s^4)^n and of
/// 2 s (1 - s^4)^n are products over i to n of 4i/(4i + 1) and of 2i/(2i + 1). An `n` below 4 counts as 4.
#[must_use]
pub fn moments(n: u32) -> [f64; 2] {
    let (mut rest, mut square) = (1.0, 1.0);
    for i in 1..=n.max(N_MIN) {
        let i = f64::from(i);
        rest *= 4.0 * i / (4.0 * i + 1.0);
        square *= 2.0 * i / (2.0 * i + 1.0);
    }
    // The mean is the integral of 1 - phi.
    [rest, libm::sqrt((square - rest * rest).max(0.0))]
}

/// Smooths a motion of all joints that lasts from 0 to `span_s`, of which `at` tells the positions.
///
/// The answer starts at the motion's first pose and ends at its last, up to rounding, at rest; a motion that goes nowhere
/// gives a trajectory without strokes.
///
/// # Errors
/// [`TrajectoryError::StrokeCount`] when more parts move than a trajectory has strokes, and whatever else
/// [`Trajectory::new`] refuses: positions that are not finite, a kernel that is no stroke, a span that is too long.
pub fn smooth(
    joints: usize,
    span_s: f64,
    kernel: &Kernel,
    mut at: impl FnMut(f64) -> JointArray,
) -> Result<Trajectory, TrajectoryError> {
    let spacing_s = kernel.spacing_s(span_s);
    let mut strokes = [Stroke::default(); MAX_STROKES];
    let mut count = 0;
    let base_rad = at(0.0);
    let mut from_rad = base_rad;
    for part in 0..kernel.parts {
        let start_s = f64::from(part) * spacing_s;
        let to_rad = at(if part + 1 == kernel.parts { span_s } else { start_s + spacing_s });
        let mut delta_rad = to_rad;
        delta_rad.iter_mut().zip(&from_rad).for_each(|(to, from)| *to -= from);
        from_rad = to_rad;
        // A NaN is no zero: it is refused later.
        if delta_rad.iter().all(|delta| *delta == 0.0) {
            continue;
        }
        let Some(slot) = strokes.get_mut(count) else {
            return Err(TrajectoryError::StrokeCount { strokes: count + 1 });
        };
        *slot = Stroke { start_s, duration_s: kernel.width_s, n: kernel.n, delta_rad };
        count += 1;
    }
    Trajectory::new(joints, base_rad, strokes.get(..count).unwrap_or(&[]))
}
