//! A path with rounded corners: strokes of one kernel for all joints, fitted to the limits inside a tube around the path.
//!
//! The fit is that of [`super::fit`] with one more bound, which couples the joints: every sampled pose is projected into the
//! tube around its segment and the two beside it. Where along the path the arm is at which time is left free, so speeds,
//! accelerations and the shape of the corners come from the fit; [`Law`] only says where it begins and how long the motion
//! shall take. The tube is a little narrower than what is allowed, as a fit ends near its bounds; what comes out is measured,
//! and made slower until it keeps to the path.
use super::fit::{Bounds, Fit, Fitter, Grid};
use super::law::Law;
use super::{Path, SLACK, distance};
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointArray, MAX_STROKES, Stroke};

/// Strokes of a path, and of each segment more.
const STROKES: [usize; 2] = [32, 16];
/// Duration of a kernel in spacings.
const OVERLAP: usize = 10;
/// Exponent of the strokes.
const EXPONENT: u32 = 7;
/// Rounds of a fit.
const ROUNDS: usize = 16;
/// Durations that are tried, in durations of the law.
const AIMS: [f64; 4] = [0.92, 1.0, 1.1, 1.3];
/// Width of the tube of a fit, in what is allowed.
const NARROWER: f64 = 0.7;
/// Poses a spacing at which the distance from the path is measured.
const PHASES: usize = 8;
/// Largest share of the deviation there: a little more is possible between them.
const USED_MAX: f64 = 0.99;
/// What leaving the tube by its radius counts, against exceeding a limit by itself.
const TUBE_WEIGHT: f64 = 2.0;

/// Strokes through a path, and how far from it they are at most.
pub(super) struct Rounded {
    pub(super) strokes: Vec<Stroke>,
    pub(super) deviation_rad: f64,
    /// The largest share of the tube's radius.
    used: f64,
}

/// The shortest of the fits that keep within the deviation of each inner corner; `None` when none does in less than `most_s`.
pub(super) fn through(path: &Path, deviations_rad: &[f64], most_s: f64) -> Option<Rounded> {
    let law = Law::new(path, deviations_rad)?;
    let segments = path.corners_rad.len().checked_sub(1)?;
    let strokes = (STROKES[0] + STROKES[1] * segments).min(MAX_STROKES);
    let grid = Grid { strokes, overlap: OVERLAP, n: EXPONENT };
    let tube = Tube::new(path, deviations_rad);
    AIMS.iter().filter(|aim| **aim * law.duration_s() < most_s).find_map(|aim| {
        let rounded = Fitted::new(path, &law, grid, *aim)?.run(&tube)?;
        (rounded.used <= USED_MAX).then_some(rounded)
    })
}

/// What is allowed around a path.
pub(super) struct Tube<'a> {
    pub(super) corners_rad: &'a [JointArray],
    /// At each corner, the ends included; in between it changes evenly.
    pub(super) radii_rad: Vec<f64>,
}

impl<'a> Tube<'a> {
    fn new(path: &Path<'a>, deviations_rad: &[f64]) -> Self {
        let (first, last) = (deviations_rad.first(), deviations_rad.last());
        let radii_rad = first.into_iter().chain(deviations_rad).chain(last).copied().collect();
        Self { corners_rad: path.corners_rad, radii_rad }
    }

    /// The nearest point of a segment, and the tube's radius there.
    fn nearest(&self, segment: usize, pose_rad: &JointArray) -> (JointArray, f64) {
        let (from, to) = (&self.corners_rad[segment], &self.corners_rad[segment + 1]);
        let (mut along, mut square) = (0.0, 0.0);
        for ((from, to), pose) in from.iter().zip(to).zip(pose_rad) {
            along += (to - from) * (pose - from);
            square += (to - from) * (to - from);
        }
        let share = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
        let point = std::array::from_fn(|j| from[j] + share * (to[j] - from[j]));
        let radius_rad = (1.0 - share) * self.radii_rad[segment] + share * self.radii_rad[segment + 1];
        (point, radius_rad)
    }

    /// The segment that is nearest to a pose.
    pub(super) fn nearest_segment(&self, pose_rad: &JointArray) -> usize {
        let off_rad = |segment: &usize| distance(&self.nearest(*segment, pose_rad).0, pose_rad);
        let segments = 0..self.corners_rad.len().saturating_sub(1);
        segments.min_by(|a, b| off_rad(a).total_cmp(&off_rad(b))).unwrap_or(0)
    }

    /// The pose in the tube, narrower by a factor, that is nearest to a pose, near a segment.
    pub(super) fn project(&self, segment: usize, pose_rad: &JointArray, factor: f64) -> JointArray {
        let near = segment.saturating_sub(1)..(segment + 2).min(self.corners_rad.len() - 1);
        let each = near.map(|k| {
            let (point, radius_rad) = self.nearest(k, pose_rad);
            (distance(&point, pose_rad), point, radius_rad * factor)
        });
        let nearest = each.min_by(|a, b| (a.0 - a.2).total_cmp(&(b.0 - b.2)));
        match nearest {
            Some((off_rad, point, radius_rad)) if off_rad > radius_rad => {
                let share = radius_rad / off_rad;
                std::array::from_fn(|j| point[j] + share * (pose_rad[j] - point[j]))
            }
            Some(_) | None => *pose_rad,
        }
    }

    /// How far a pose is from the path near a segment, and which share of the tube's radius that is.
    pub(super) fn off(&self, segment: usize, pose_rad: &JointArray) -> [f64; 2] {
        let near = segment.saturating_sub(1)..(segment + 2).min(self.corners_rad.len() - 1);
        near.fold([f64::INFINITY; 2], |least, k| {
            let (point, radius_rad) = self.nearest(k, pose_rad);
            let off_rad = distance(&point, pose_rad);
            [least[0].min(off_rad), least[1].min(off_rad / radius_rad)]
        })
    }
}

/// A fit of all joints under way.
struct Fitted<'a> {
    path: &'a Path<'a>,
    grid: Grid,
    spacing_s: f64,
    /// Of each joint.
    deltas: Vec<Vec<f64>>,
    /// Near which segment each sample is.
    segments: Vec<usize>,
}

impl<'a> Fitted<'a> {
    fn new(path: &'a Path<'a>, law: &Law, grid: Grid, aim: f64) -> Option<Self> {
        let duration_s = law.duration_s();
        let parts = grid.spacings() as f64;
        let spacing_s = (aim * duration_s / parts).max(DURATION_S_MIN / grid.overlap as f64);
        let mut deltas = vec![Vec::with_capacity(grid.strokes); path.joints];
        let mut last = *path.corners_rad.first()?;
        for i in 1..=grid.strokes {
            let on_law = law.at(i as f64 / grid.strokes as f64 * duration_s).1;
            let here = if i == grid.strokes { *path.corners_rad.last()? } else { on_law };
            for (deltas, (here, last)) in deltas.iter_mut().zip(here.iter().zip(&last)) {
                deltas.push(here - last);
            }
            last = here;
        }
        let near = |sample: usize| law.at(grid.sample_at(sample) / parts * duration_s).0;
        let segments = (0..grid.samples()).map(near).collect();
        Some(Self { path, grid, spacing_s, deltas, segments })
    }

    /// A joint's bounds, from velocity to jerk.
    fn bounds(&self, joint: usize) -> [Bounds; 3] {
        let (motion, h) = (self.path.limits[joint].motion, self.spacing_s);
        [
            Bounds::even(&self.grid, 1, motion.velocity_rad_s * h),
            Bounds::even(&self.grid, 2, motion.acceleration_rad_s2 * h * h),
            Bounds::even(&self.grid, 3, motion.jerk_rad_s3 * h * h * h),
        ]
    }

    fn run(mut self, tube: &Tube) -> Option<Rounded> {
        let bounds: Vec<[Bounds; 3]> = (0..self.path.joints).map(|joint| self.bounds(joint)).collect();
        let radius_rad = tube.radii_rad.iter().copied().fold(f64::INFINITY, f64::min);
        let fitter = |bounds: &[Bounds; 3]| {
            let [v, a, j] = bounds.each_ref().map(|b| (b.order, b.weight));
            Fitter::new(self.grid, &[v, a, j, (0, TUBE_WEIGHT / radius_rad)])
        };
        let fitters: Vec<Fitter> = bounds.iter().map(fitter).collect::<Option<_>>()?;
        let mut fits: Vec<Fit> = fitters.iter().zip(&self.deltas).map(|(f, d)| Fit::new(f, d)).collect();
        for round in 0..=ROUNDS {
            for (fit, bounds) in fits.iter_mut().zip(&bounds) {
                if round > 0 {
                    fit.advance();
                }
                fit.parts.iter_mut().zip(bounds).for_each(|(part, bounds)| part.clamp(bounds));
            }
            self.keep_in(tube, &mut fits);
        }
        fits.iter().zip(&mut self.deltas).for_each(|(fit, deltas)| fit.write(deltas));
        self.scaled(tube, &bounds)
    }

    /// Projects all samples of all joints into the tube: the last part of each fit is its position.
    fn keep_in(&self, tube: &Tube, fits: &mut [Fit]) {
        let base_rad = &self.path.corners_rad[0];
        for (sample, segment) in self.segments.iter().enumerate() {
            let mut pose_rad = *base_rad;
            for (pose, fit) in pose_rad.iter_mut().zip(fits.iter()) {
                *pose += fit.parts[3].excess[sample];
            }
            let inside_rad = tube.project(*segment, &pose_rad, NARROWER);
            for (j, fit) in fits.iter_mut().enumerate() {
                let part = &mut fit.parts[3];
                part.target[sample] = inside_rad[j] - base_rad[j];
                part.excess[sample] = pose_rad[j] - inside_rad[j];
            }
        }
    }

    /// The strokes, as fast as the limits allow, and how far they are from the path.
    fn scaled(&self, tube: &Tube, bounds: &[[Bounds; 3]]) -> Option<Rounded> {
        let mut scale: f64 = 0.0;
        for (deltas, bounds) in self.deltas.iter().zip(bounds) {
            for (order, bound) in (1..).zip(bounds) {
                let most = bound.high.first()?;
                scale = scale.max((self.grid.peak(deltas, order) / most).powf(1.0 / order as f64));
            }
        }
        let spacing_s =
            self.spacing_s * (scale * (1.0 + SLACK)).max(DURATION_S_MIN / (self.spacing_s * OVERLAP as f64));
        let duration_s = (spacing_s * self.grid.overlap as f64).max(DURATION_S_MIN);
        let stroke = |i: usize| Stroke {
            start_s: spacing_s * i as f64,
            duration_s,
            n: self.grid.n,
            delta_rad: std::array::from_fn(|j| self.deltas.get(j).map_or(0.0, |deltas| deltas[i])),
        };
        let strokes: Vec<Stroke> = (0..self.grid.strokes).map(stroke).collect();
        let [deviation_rad, used] = self.off(tube);
        (spacing_s.is_finite() && used.is_finite()).then_some(Rounded { strokes, deviation_rad, used })
    }

    /// Farthest from the path, and the largest share of the tube's radius, at a fine sampling.
    fn off(&self, tube: &Tube) -> [f64; 2] {
        let values: Vec<Vec<f64>> = self.deltas.iter().map(|d| self.grid.values(d, PHASES)).collect();
        let base_rad = &self.path.corners_rad[0];
        let spacings = self.grid.spacings();
        (0..spacings * PHASES).fold([0.0; 2], |most, sample| {
            let mut pose_rad = *base_rad;
            pose_rad.iter_mut().zip(&values).for_each(|(pose, values)| *pose += values[sample]);
            let [off_rad, used] = tube.off(self.segments[sample % spacings], &pose_rad);
            [f64::max(most[0], off_rad), f64::max(most[1], used)]
        })
    }
}
