//! A path with rounded corners: strokes of one kernel for all joints, fitted to the limits inside a tube around the path.
//!
//! The fit is that of [`super::fit`] with one more bound, which couples the joints: every sampled pose is projected into the
//! tube around its segment and the two beside it. Where along the path the arm is at which time is left free, so speeds,
//! accelerations and the shape of the corners come from the fit; [`Law`] only says where it begins and how long the motion
//! shall take. The tube is a little narrower than what is allowed, as a fit ends near its bounds; what comes out is measured,
//! and made slower until it keeps to the path.
use super::fit::{Bounds, Fit, Fitter, Grid, Lane, PerJoint, Vectorized, vectorized};
use super::law::Law;
use super::{Path, SLACK};
use pulp::{Scalar, Simd};
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointArray, MAX_JOINTS, MAX_STROKES, Stroke, USUAL_JOINTS};

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
    if path.joints <= USUAL_JOINTS {
        shortest::<USUAL_JOINTS>(path, deviations_rad, most_s)
    } else {
        shortest::<MAX_JOINTS>(path, deviations_rad, most_s)
    }
}

fn shortest<const JOINTS: usize>(path: &Path, deviations_rad: &[f64], most_s: f64) -> Option<Rounded> {
    let law = Law::new(path, deviations_rad)?;
    let segments = path.corners_rad.len().checked_sub(1)?;
    let strokes = (STROKES[0] + STROKES[1] * segments).min(MAX_STROKES);
    let grid = Grid { strokes, overlap: OVERLAP, n: EXPONENT };
    let tube = Tube::<JOINTS>::around(path, deviations_rad);
    AIMS.iter().filter(|aim| **aim * law.duration_s() < most_s).find_map(|aim| {
        let rounded = Fitted::new(path, &law, grid, *aim)?.run(&tube)?;
        (rounded.used <= USED_MAX).then_some(rounded)
    })
}

/// What is allowed around a path.
pub(super) struct Tube<const JOINTS: usize> {
    sections: Vec<Section<JOINTS>>,
}

/// The tube round one segment; its radius changes evenly.
#[derive(Clone, Copy)]
struct Section<const JOINTS: usize> {
    from_rad: PerJoint<JOINTS>,
    change_rad: PerJoint<JOINTS>,
    /// 1 over the square of the segment's length, or 0.
    per_square: f64,
    /// At both ends.
    radii_rad: [f64; 2],
}

impl<const JOINTS: usize> Section<JOINTS> {
    /// The nearest point of the segment, its distance, and the tube's radius there.
    #[inline(always)]
    fn nearest<S: Simd>(&self, simd: S, pose_rad: &PerJoint<JOINTS>) -> (PerJoint<JOINTS>, f64, f64) {
        let along = self.change_rad.by(simd, pose_rad.minus(simd, self.from_rad)).sum();
        let share = (along * self.per_square).clamp(0.0, 1.0);
        let point = self.from_rad.plus(simd, self.change_rad.times(simd, share));
        let off_rad = pose_rad.minus(simd, point);
        let [from, to] = self.radii_rad;
        (point, off_rad.by(simd, off_rad).sum().sqrt(), (1.0 - share) * from + share * to)
    }
}

impl<const JOINTS: usize> Tube<JOINTS> {
    /// Around the segments between corners, with a radius at each corner.
    pub(super) fn new(corners_rad: &[JointArray], radii_rad: &[f64]) -> Self {
        let section = |(pair, radii): (&[JointArray], &[f64])| {
            let ([from, to], [radius, next]) = (pair, radii) else { return None };
            let (from_rad, to_rad) = (PerJoint::of(from), PerJoint::of(to));
            let change_rad = to_rad.minus(Scalar::new(), from_rad);
            let square = change_rad.by(Scalar::new(), change_rad).sum();
            let per_square = if square > 0.0 { 1.0 / square } else { 0.0 };
            Some(Section { from_rad, change_rad, per_square, radii_rad: [*radius, *next] })
        };
        Self { sections: corners_rad.windows(2).zip(radii_rad.windows(2)).filter_map(section).collect() }
    }

    /// Around a path whose inner corners may be cut by so much.
    fn around(path: &Path, deviations_rad: &[f64]) -> Self {
        let (first, last) = (deviations_rad.first(), deviations_rad.last());
        let radii_rad: Vec<f64> = first.into_iter().chain(deviations_rad).chain(last).copied().collect();
        Self::new(path.corners_rad, &radii_rad)
    }

    /// The same tube, narrower by a factor.
    pub(super) fn narrower(&self, factor: f64) -> Self {
        let narrower = |section: &Section<JOINTS>| Section {
            radii_rad: section.radii_rad.map(|radius| radius * factor),
            ..*section
        };
        Self { sections: self.sections.iter().map(narrower).collect() }
    }

    /// The least radius.
    fn narrowest_rad(&self) -> f64 {
        self.sections.iter().flat_map(|section| section.radii_rad).fold(f64::INFINITY, f64::min)
    }

    /// The segment that is nearest to a pose.
    pub(super) fn nearest_segment(&self, pose_rad: &JointArray) -> usize {
        let off_rad =
            |segment: &usize| self.sections[*segment].nearest(Scalar::new(), &PerJoint::of(pose_rad)).1;
        (0..self.sections.len()).min_by(|a, b| off_rad(a).total_cmp(&off_rad(b))).unwrap_or(0)
    }

    /// The sections of a segment and of its neighbours.
    #[inline(always)]
    fn near(&self, segment: usize) -> &[Section<JOINTS>] {
        &self.sections[segment.saturating_sub(1)..(segment + 2).min(self.sections.len())]
    }

    /// The pose in the tube that is nearest to a pose, near a segment.
    #[inline(always)]
    pub(super) fn project<S: Simd>(
        &self,
        simd: S,
        segment: usize,
        pose_rad: &PerJoint<JOINTS>,
    ) -> PerJoint<JOINTS> {
        let (mut inside_rad, mut least_rad) = (*pose_rad, f64::INFINITY);
        for section in self.near(segment) {
            let (point, off_rad, radius_rad) = section.nearest(simd, pose_rad);
            if off_rad <= radius_rad {
                return *pose_rad;
            }
            if off_rad - radius_rad < least_rad {
                least_rad = off_rad - radius_rad;
                let off = pose_rad.minus(simd, point).times(simd, radius_rad / off_rad);
                inside_rad = point.plus(simd, off);
            }
        }
        inside_rad
    }

    /// How far a pose is from the path near a segment, and which share of the tube's radius that is.
    #[inline(always)]
    pub(super) fn off<S: Simd>(&self, simd: S, segment: usize, pose_rad: &PerJoint<JOINTS>) -> [f64; 2] {
        let mut least = [f64::INFINITY; 2];
        for section in self.near(segment) {
            let (_, off_rad, radius_rad) = section.nearest(simd, pose_rad);
            least = [least[0].min(off_rad), least[1].min(off_rad / radius_rad)];
        }
        least
    }
}

/// A fit of all joints under way.
struct Fitted<'a, const JOINTS: usize> {
    path: &'a Path<'a>,
    grid: Grid,
    spacing_s: f64,
    deltas: Vec<PerJoint<JOINTS>>,
    /// Near which segment each sample is.
    segments: Vec<usize>,
}

impl<'a, const JOINTS: usize> Fitted<'a, JOINTS> {
    fn new(path: &'a Path<'a>, law: &Law, grid: Grid, aim: f64) -> Option<Self> {
        let duration_s = law.duration_s();
        let parts = grid.spacings() as f64;
        let spacing_s = (aim * duration_s / parts).max(DURATION_S_MIN / grid.overlap as f64);
        let mut deltas = Vec::with_capacity(grid.strokes);
        let mut last = PerJoint::of(path.corners_rad.first()?);
        for i in 1..=grid.strokes {
            let on_law = law.at(i as f64 / grid.strokes as f64 * duration_s).1;
            let here = if i == grid.strokes {
                PerJoint::of(path.corners_rad.last()?)
            } else {
                PerJoint::of(&on_law)
            };
            deltas.push(here.minus(Scalar::new(), last));
            last = here;
        }
        let near = |sample: usize| law.at(grid.sample_at(sample) / parts * duration_s).0;
        let segments = (0..grid.samples()).map(near).collect();
        Some(Self { path, grid, spacing_s, deltas, segments })
    }

    /// What each joint may do, from velocity to jerk. Lanes beyond the last joint stand still.
    fn bounds(&self) -> [Bounds<PerJoint<JOINTS>>; 3] {
        let h = self.spacing_s;
        let mut most = [PerJoint::all(1.0); 3];
        for (joint, limits) in self.path.limits.iter().enumerate().take(self.path.joints) {
            let motion = limits.motion;
            most[0].0[joint] = motion.velocity_rad_s * h;
            most[1].0[joint] = motion.acceleration_rad_s2 * h * h;
            most[2].0[joint] = motion.jerk_rad_s3 * h * h * h;
        }
        let [v, a, j] = most;
        [Bounds::even(&self.grid, 1, v), Bounds::even(&self.grid, 2, a), Bounds::even(&self.grid, 3, j)]
    }

    fn run(mut self, tube: &Tube<JOINTS>) -> Option<Rounded> {
        let bounds = self.bounds();
        let [v, a, j] = bounds.each_ref().map(|b| (b.order, b.weight));
        let of_tube = PerJoint::all(TUBE_WEIGHT / tube.narrowest_rad());
        let fitter = Fitter::new(self.grid, &[v, a, j, (0, of_tube)])?;
        let mut fit = Fit::new(&fitter, &self.deltas);
        vectorized(Rounds { of: &self, fit: &mut fit, bounds: &bounds, tube: &tube.narrower(NARROWER) });
        fit.write(&mut self.deltas);
        self.scaled(tube, &bounds)
    }

    /// Projects all samples into the tube: the last part of the fit is the position.
    #[inline(always)]
    fn keep_in<S: Simd>(&self, simd: S, tube: &Tube<JOINTS>, fit: &mut Fit<PerJoint<JOINTS>>) {
        let base_rad = PerJoint::of(&self.path.corners_rad[0]);
        let Some(part) = fit.parts.last_mut() else { return };
        let samples = part.target.iter_mut().zip(&mut part.excess).zip(&self.segments);
        for ((target, excess), segment) in samples {
            let pose_rad = base_rad.plus(simd, *excess);
            let inside_rad = tube.project(simd, *segment, &pose_rad);
            (*target, *excess) = (inside_rad.minus(simd, base_rad), pose_rad.minus(simd, inside_rad));
        }
    }

    /// The strokes, as fast as the limits allow, and how far they are from the path.
    fn scaled(&self, tube: &Tube<JOINTS>, bounds: &[Bounds<PerJoint<JOINTS>>; 3]) -> Option<Rounded> {
        let mut scale: f64 = 0.0;
        for (order, bounds) in (1..).zip(bounds) {
            let of_limits = self.grid.peak(&self.deltas, order).by(Scalar::new(), bounds.weight).greatest();
            scale = scale.max(of_limits.powf(1.0 / order as f64));
        }
        let spacing_s =
            self.spacing_s * (scale * (1.0 + SLACK)).max(DURATION_S_MIN / (self.spacing_s * OVERLAP as f64));
        let duration_s = (spacing_s * self.grid.overlap as f64).max(DURATION_S_MIN);
        let stroke = |(i, delta_rad): (usize, &PerJoint<JOINTS>)| Stroke {
            start_s: spacing_s * i as f64,
            duration_s,
            n: self.grid.n,
            delta_rad: delta_rad.joints(),
        };
        let strokes: Vec<Stroke> = self.deltas.iter().enumerate().map(stroke).collect();
        let [deviation_rad, used] = self.off(tube);
        (spacing_s.is_finite() && used.is_finite()).then_some(Rounded { strokes, deviation_rad, used })
    }

    /// Farthest from the path, and the largest share of the tube's radius, at a fine sampling.
    fn off(&self, tube: &Tube<JOINTS>) -> [f64; 2] {
        let values = self.grid.values(&self.deltas, PHASES);
        vectorized(Farthest { of: self, tube, values: &values })
    }
}

/// All rounds of a fit.
struct Rounds<'r, 'a, 'f, const JOINTS: usize> {
    of: &'r Fitted<'a, JOINTS>,
    fit: &'r mut Fit<'f, PerJoint<JOINTS>>,
    bounds: &'r [Bounds<PerJoint<JOINTS>>; 3],
    tube: &'r Tube<JOINTS>,
}

impl<const JOINTS: usize> Vectorized for Rounds<'_, '_, '_, JOINTS> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for round in 0..=ROUNDS {
            if round > 0 {
                self.fit.advance(simd);
            }
            for (part, bounds) in self.fit.parts.iter_mut().zip(self.bounds) {
                part.clamp(simd, bounds);
            }
            self.of.keep_in(simd, self.tube, self.fit);
        }
    }
}

/// The largest of [`Tube::off`] over a motion.
struct Farthest<'r, 'a, const JOINTS: usize> {
    of: &'r Fitted<'a, JOINTS>,
    tube: &'r Tube<JOINTS>,
    values: &'r [PerJoint<JOINTS>],
}

impl<const JOINTS: usize> Vectorized for Farthest<'_, '_, JOINTS> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [f64; 2] {
        let base_rad = PerJoint::of(&self.of.path.corners_rad[0]);
        let spacings = self.of.grid.spacings();
        let mut most = [0.0; 2];
        for (sample, value) in self.values.iter().enumerate() {
            let segment = self.of.segments[sample % spacings];
            let [off_rad, used] = self.tube.off(simd, segment, &base_rad.plus(simd, *value));
            most = [f64::max(most[0], off_rad), f64::max(most[1], used)];
        }
        most
    }
}
