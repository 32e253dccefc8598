//! How far an imported motion is from the original.
//!
//! Both are compared at equal times, the original slowed down and delayed as the import was: that is never less than the
//! distance of the one path from the other. Between two instants d apart, neither of which has a corner of the original
//! between them, the difference of the two is at most that at the instants and (its second derivative) d^2/8 more.
use super::reference::Reference;
use taustream_motion::limits::Peaks;
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointArray, Trajectory};

/// Instants a kernel, while something runs.
const INSTANTS: f64 = 64.0;
/// The same of a first look.
const GLANCES: f64 = 16.0;

/// The largest distance of one joint from the original: a proven upper bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// How far (rad).
    pub rad: f64,
    /// Zero-based index of the joint.
    pub joint: usize,
    /// When, in the time of the imported motion (s).
    pub at_s: f64,
}

impl Deviation {
    /// Measures a motion, of which the peaks are proven, that was smoothed by a kernel of `width_s`, delayed by `delay_s`, and slowed down by `scale` after that.
    pub(super) fn measure(
        reference: &Reference,
        (motion, peaks): (&Trajectory, &Peaks),
        (scale, delay_s, width_s): (f64, f64, f64),
    ) -> Self {
        let step_s = width_s / INSTANTS;
        let instants = instants(reference, motion, (scale, delay_s, step_s));
        // Accelerations in the time of the original.
        let own = reference.bend_rad_s2();
        let bend: JointArray =
            std::array::from_fn(|joint| peaks.acceleration_rad_s2[joint] * scale * scale + own[joint]);
        let mut cursor = Cursor::at_start(motion);
        let mut most = Self::default();
        for (i, at_s) in instants.iter().enumerate() {
            let t_s = (at_s + delay_s) * scale;
            let (q, r) = (cursor.sample(motion, t_s).position_rad, reference.at(*at_s));
            // The longer of the two gaps beside it; where nothing runs there is none.
            let gap =
                |j: Option<usize>| j.and_then(|j| instants.get(j)).map_or(0.0, |other| (other - at_s).abs());
            let gap_s = gap(i.checked_sub(1)).max(gap(Some(i + 1))).min(step_s);
            for joint in 0..reference.joints() {
                let rad = (q[joint] - r[joint]).abs() + bend[joint] * gap_s * gap_s / 8.0;
                // A NaN is farther than anything.
                if rad > most.rad || rad.is_nan() {
                    most = Self { rad, joint, at_s: t_s };
                }
            }
        }
        most
    }

    /// The largest difference at some instants, quickly.
    pub(super) fn glance(reference: &Reference, motion: &Trajectory, delay_s: f64, width_s: f64) -> f64 {
        let mut cursor = Cursor::at_start(motion);
        let mut most: f64 = 0.0;
        for at_s in grid(motion, (1.0, delay_s, width_s / GLANCES)) {
            let (q, r) = (cursor.sample(motion, at_s + delay_s).position_rad, reference.at(at_s));
            for (q, r) in q.iter().zip(&r) {
                let off = (q - r).abs();
                most = if off <= most { most } else { off };
            }
        }
        most
    }
}

/// Times of the original: its joins, and a grid wherever a stroke runs. Gaps of the grid are at most `step_s`, and where
/// they are not, the motion stands still between two joins.
fn instants(reference: &Reference, motion: &Trajectory, clock: (f64, f64, f64)) -> Vec<f64> {
    let mut instants = reference.joins_s();
    instants.extend(grid(motion, clock));
    instants.sort_by(f64::total_cmp);
    instants
}

/// A grid over the times in which something runs, in the time of the original and in its order.
fn grid(motion: &Trajectory, (scale, delay_s, step_s): (f64, f64, f64)) -> Vec<f64> {
    let mut grid = Vec::new();
    let (mut at_s, mut end_s) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for stroke in motion.strokes() {
        let from_s = stroke.start_s / scale - delay_s;
        if from_s > end_s {
            grid.push(end_s); // Nothing ran in between.
            at_s = from_s;
        }
        end_s = stroke.end_s() / scale - delay_s;
        while at_s < end_s {
            grid.push(at_s);
            at_s += step_s;
        }
    }
    grid.push(end_s);
    grid.retain(|at_s| at_s.is_finite());
    grid
}
