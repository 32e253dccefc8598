//! Which kernel: the shortest motion that comes near enough.
//!
//! A wide kernel cuts corners and takes longer; a narrow one has room for few strokes, whose ripple eats the limits, so
//! that the whole has to run slower. Both ends are found by trying.
use super::ImportError;
use super::deviation::Deviation;
use super::reference::Reference;
use crate::timing::{SLACK, scale_to_fit};
use taustream_motion::smoothing::{Kernel, moments, smooth};
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointLimits, MAX_JOINTS, MAX_STROKES, Stroke, Trajectory, TrajectoryError};

/// Strokes that run at once where there is room for them; with fewer the ripple grows, with more nothing is gained.
const OVERLAP: f64 = 24.0;
/// Least of them.
const OVERLAP_MIN: f64 = 4.0;
/// Exponents that are tried: for k = 1/n from 0.12 to 0.24 the durations differ by a few percent only.
const EXPONENTS: [u32; 3] = [5, 6, 8];
/// From one width to the next.
const STEP: f64 = 1.2;
/// Widths that are tried at most: 0.001 s to 100 s.
const WIDTHS: u32 = 64;
/// Most parts of a motion: those that rest take no stroke, but a look.
const PARTS_MAX: f64 = 100_000.0;
/// Room for parts that move a little at one edge only.
const ROOM: f64 = (MAX_STROKES - 12) as f64;

/// A kernel, and what it makes of a motion.
pub(super) struct Candidate {
    pub(super) kernel: Kernel,
    /// The factor on all times that the limits ask for.
    pub(super) scale: f64,
    /// How long the motion takes then.
    pub(super) total_s: f64,
    /// How far it is from the original, at the instants of a first look.
    pub(super) off_rad: f64,
}

impl Candidate {
    fn of(reference: &Reference, limits: &[JointLimits; MAX_JOINTS], kernel: Kernel) -> Option<Self> {
        let smoothed = smooth_by(reference, &kernel).ok()?;
        let needed = scale_to_fit(smoothed.strokes(), reference.joints(), limits, kernel.width_s / 64.0);
        let scale = (needed * (1.0 + SLACK)).max(1.0);
        let total_s = smoothed.duration_s() * scale;
        let delay_s = kernel.delay_s(reference.duration_s());
        let off_rad = Deviation::glance(reference, &smoothed, delay_s, kernel.width_s);
        (total_s.is_finite() && off_rad.is_finite()).then_some(Self { kernel, scale, total_s, off_rad })
    }

    /// The motion, not slowed down yet.
    pub(super) fn smoothed(&self, reference: &Reference) -> Result<Trajectory, ImportError> {
        Ok(smooth_by(reference, &self.kernel)?)
    }
}

fn smooth_by(reference: &Reference, kernel: &Kernel) -> Result<Trajectory, TrajectoryError> {
    smooth(reference.joints(), reference.duration_s(), kernel, |t| reference.at(t))
}

/// Kernels from narrow to wide, until they come nowhere near the motion any more; then other exponents at the best width.
pub(super) fn candidates(
    reference: &Reference,
    limits: &[JointLimits; MAX_JOINTS],
    tolerance_rad: f64,
) -> Vec<Candidate> {
    let mut found: Vec<Candidate> = Vec::new();
    let narrowest_s = narrowest_s(reference);
    let mut width_s = narrowest_s;
    for _ in 0..WIDTHS {
        let Some(kernel) = kernel(reference, EXPONENTS[1], width_s) else { break };
        found.extend(Candidate::of(reference, limits, kernel));
        let too_far = found.last().is_some_and(|last| last.off_rad > 4.0 * tolerance_rad);
        let shortest_s = found.iter().map(|c| c.total_s).fold(f64::INFINITY, f64::min);
        // Once smoothing alone takes longer than all of the best motion, nothing wider can be better.
        if too_far || width_s > shortest_s {
            break;
        }
        width_s *= STEP;
    }
    let near = found.iter().filter(|c| c.off_rad <= tolerance_rad);
    let best = near.min_by(|a, b| a.total_s.total_cmp(&b.total_s)).map(|c| c.kernel.width_s);
    let Some(best_s) = best else { return found };
    let [_, spread] = moments(EXPONENTS[1]);
    for n in EXPONENTS {
        // Of the same spread, which decides how corners are cut.
        let like_s = best_s * spread / moments(n)[1];
        for factor in [0.94, 1.0, 1.06] {
            let other = kernel(reference, n, (like_s * factor).max(narrowest_s));
            found.extend(other.and_then(|kernel| Candidate::of(reference, limits, kernel)));
        }
    }
    found
}

/// The least spacing of strokes for which there is room.
fn least_spacing_s(reference: &Reference) -> f64 {
    (reference.moving_s() / ROOM).max(reference.duration_s() / PARTS_MAX)
}

fn narrowest_s(reference: &Reference) -> f64 {
    (OVERLAP_MIN * least_spacing_s(reference)).max(DURATION_S_MIN)
}

fn kernel(reference: &Reference, n: u32, width_s: f64) -> Option<Kernel> {
    let spacing_s = (width_s / OVERLAP).max(least_spacing_s(reference));
    let parts = (reference.duration_s() / spacing_s).ceil().max(1.0);
    if parts.is_nan() || parts > PARTS_MAX + 1.0 {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 1 to 100,001")]
    let parts = parts as u32;
    Some(Kernel { n, width_s, parts })
}

/// The same motion, slower by a factor.
pub(super) fn scaled(motion: &Trajectory, factor: f64) -> Result<Trajectory, TrajectoryError> {
    let slower = |s: &Stroke| Stroke { start_s: s.start_s * factor, duration_s: s.duration_s * factor, ..*s };
    let strokes: Vec<Stroke> = motion.strokes().iter().map(slower).collect();
    Trajectory::new(motion.joints(), *motion.base_rad(), &strokes)
}
