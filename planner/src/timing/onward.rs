//! Going on from the end of one motion with another: the corner between them is rounded, without a stop.
//!
//! The second motion begins before the first one ends, so their sum is C3 but may leave the limits and the paths of both. A
//! third part is added around the corner, which moves nothing in all: strokes of one kernel, fitted ([`super::fit`]) so that
//! the sum keeps the limits and stays in a tube around both paths. The earliest start of the second motion is taken for which
//! such a fit is found. The strokes of both motions stay as they are, so the first one may be under way.
use super::fit::{Bounds, Fit, Fitter, Grid, Lane, PerJoint, Vectorized, vectorized};
use super::tube::Tube;
use super::{Timed, distance};
use pulp::{Scalar, Simd};
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Setpoint, Stroke, Trajectory, USUAL_JOINTS};

/// Starts of the second motion that are tried.
const STARTS: u32 = 16;
/// The earliest of them before the end of the first motion, in ramps.
const EARLIEST: f64 = 1.6;
/// .. and the latest.
const LEAST: f64 = 0.05;
/// The earliest in durations of either motion.
const SHARE: f64 = 0.85;
/// How far around the corner strokes are added, in ramps.
const AROUND: f64 = 2.5;
/// A motion that is this near to its highest speed does not ramp.
const CRUISE: f64 = 0.98;
/// Instants at which speeds and paths are looked at.
const LOOKS: u32 = 64;
/// Duration of an added stroke in spacings, and its exponent.
const OVERLAP: usize = 10;
const EXPONENT: u32 = 7;
/// Added strokes, at least and at most.
const STROKES: [f64; 2] = [12.0, 120.0];
/// Rounds of a fit.
const ROUNDS: usize = 60;
/// What leaving the tube by its radius counts, against exceeding a limit by itself.
const TUBE_WEIGHT: f64 = 0.6;
/// Share of the limits, and of the tube, that the fit aims at ..
const MARGIN: f64 = 0.985;
const NARROWER: f64 = 0.8;
/// .. that it has to keep at its samples ..
const NEAR: f64 = 0.995;
/// .. and at finer ones: so many a spacing.
const CEILING: f64 = 0.9993;
const PHASES: usize = 12;
/// In how many rounds one is checked there.
const CHECK_EVERY: usize = 4;
/// How much further bounds go down than what exceeds them.
const TIGHTEN: f64 = 0.999;
/// After how many rounds a fit is given up that uses more than this share of a limit.
const HOPELESS: [(usize, f64); 3] = [(12, 1.3), (24, 1.1), (40, 1.04)];
/// How far the paths around which the tube lies are simplified, in its radii.
const SIMPLER: f64 = 0.05;

/// Two motions, the second one from where the first one ends.
pub struct Onward<'a> {
    /// The first one, which may be under way.
    pub first: &'a Trajectory,
    /// The second one, from rest.
    pub then: &'a Trajectory,
    /// When strokes may be added to the first one at the earliest.
    pub from_s: f64,
    /// Limits of each joint.
    pub limits: &'a [JointLimits; MAX_JOINTS],
}

/// How a motion begins or ends.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    duration_s: f64,
    /// Duration of its shortest stroke there.
    kernel_s: f64,
}

impl Onward<'_> {
    /// Both motions as one that stays within a distance of their paths; `None` where the arm has to stop between them.
    #[must_use]
    pub fn rounded(&self, blend_rad: f64) -> Option<Timed> {
        if self.first.joints() <= USUAL_JOINTS {
            self.earliest::<USUAL_JOINTS>(blend_rad)
        } else {
            self.earliest::<MAX_JOINTS>(blend_rad)
        }
    }

    fn earliest<const JOINTS: usize>(&self, blend_rad: f64) -> Option<Timed> {
        let ramps = [self.slowing(), self.rising()];
        let left_s = self.first.duration_s() - self.from_s;
        let longest_s = ramps.iter().fold(0.0, |most: f64, ramp| most.max(ramp.duration_s));
        let most_s = (EARLIEST * longest_s).min(SHARE * left_s).min(SHARE * self.then.duration_s());
        // What begins hardly earlier than at the end is a stop all the same.
        if !(blend_rad > 0.0 && most_s.is_finite() && most_s > LEAST * longest_s) {
            return None;
        }
        let mut found = None;
        let (mut fits, mut fails) = (0, STARTS + 1);
        while fails - fits > 1 {
            let start = fits.midpoint(fails);
            let share = f64::from(start) / f64::from(STARTS);
            let overlap_s = LEAST * longest_s + share * (most_s - LEAST * longest_s);
            if let Some(timed) =
                Corner::<JOINTS>::new(self, overlap_s, (&ramps, blend_rad)).and_then(|c| c.fit())
            {
                (found, fits) = (Some(timed), start);
            } else {
                fails = start;
            }
        }
        found
    }

    /// The last ramp of the first motion, from `from_s` on.
    fn slowing(&self) -> Ramp {
        let (end_s, motion) = (self.first.duration_s(), self.first);
        let looks = looks(self.from_s, end_s);
        let highest = looks.iter().fold(0.0, |most: f64, t_s| most.max(speed(motion, *t_s)));
        let cruises = |t_s: &&f64| speed(motion, **t_s) >= CRUISE * highest;
        let from_s = looks.iter().rev().find(cruises).copied().unwrap_or(self.from_s);
        Ramp { duration_s: end_s - from_s, kernel_s: shortest(motion, [from_s, end_s]) }
    }

    /// The first ramp of the second motion.
    fn rising(&self) -> Ramp {
        let (end_s, motion) = (self.then.duration_s(), self.then);
        let looks = looks(0.0, end_s);
        let highest = looks.iter().fold(0.0, |most: f64, t_s| most.max(speed(motion, *t_s)));
        let cruises = |t_s: &&f64| speed(motion, **t_s) >= CRUISE * highest;
        let duration_s = looks.iter().find(cruises).copied().unwrap_or(end_s);
        Ramp { duration_s, kernel_s: shortest(motion, [0.0, duration_s]) }
    }
}

fn looks(from_s: f64, to_s: f64) -> Vec<f64> {
    (0..=LOOKS).map(|i| from_s + (to_s - from_s) * f64::from(i) / f64::from(LOOKS)).collect()
}

fn speed(motion: &Trajectory, t_s: f64) -> f64 {
    motion.sample(t_s).velocity_rad_s.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Shortest stroke that runs within a span.
fn shortest(motion: &Trajectory, [from_s, to_s]: [f64; 2]) -> f64 {
    let runs = motion.strokes().iter().filter(|s| s.end_s() > from_s && s.start_s < to_s);
    runs.map(|s| s.duration_s).fold(f64::INFINITY, f64::min)
}

/// Both motions with one start of the second, and what is added to them.
struct Corner<'a, const JOINTS: usize> {
    onward: &'a Onward<'a>,
    /// When the second one begins.
    then_s: f64,
    /// When the added strokes begin, and how far apart they start.
    from_s: f64,
    spacing_s: f64,
    grid: Grid,
    /// Both paths around the corner, and how far from them the sum may be.
    path_rad: Vec<JointArray>,
    radius_rad: f64,
    /// When the sum is checked, in spacings.
    instants: Vec<f64>,
    /// Both motions at the samples of the fit, and near which segment of the path each is.
    sum: Vec<Setpoint>,
    segments: Vec<usize>,
}

impl<'a, const JOINTS: usize> Corner<'a, JOINTS> {
    fn new(
        onward: &'a Onward<'a>,
        overlap_s: f64,
        ([slowing, rising], radius_rad): (&[Ramp; 2], f64),
    ) -> Option<Self> {
        let end_s = onward.first.duration_s();
        let then_s = end_s - overlap_s;
        let from_s = onward.from_s.max(then_s.min(end_s - AROUND * slowing.duration_s));
        let until_s = (then_s + AROUND * rising.duration_s).max(end_s).min(then_s + onward.then.duration_s());
        let kernel_s = slowing.kernel_s.min(rising.kernel_s);
        let wanted = (until_s - from_s) * OVERLAP as f64 / kernel_s - OVERLAP as f64;
        let wanted = wanted.clamp(STROKES[0], STROKES[1]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 12 to 120")]
        let grid = Grid { strokes: wanted.ceil() as usize, overlap: OVERLAP, n: EXPONENT };
        let spacing_s = (until_s - from_s) / grid.spacings() as f64;
        if !(spacing_s.is_finite() && spacing_s * OVERLAP as f64 >= DURATION_S_MIN) {
            return None;
        }
        let before = looks(from_s, end_s).into_iter().map(|t_s| onward.first.sample(t_s).position_rad);
        let after = looks(0.0, until_s - then_s).into_iter().map(|t_s| onward.then.sample(t_s).position_rad);
        let mut path_rad = simplified::<JOINTS>(&before.collect::<Vec<_>>(), SIMPLER * radius_rad);
        path_rad.extend(
            simplified::<JOINTS>(&after.collect::<Vec<_>>(), SIMPLER * radius_rad).into_iter().skip(1),
        );
        let (instants, sum, segments) = (Vec::new(), Vec::new(), Vec::new());
        let mut corner =
            Self { onward, then_s, from_s, spacing_s, grid, path_rad, radius_rad, instants, sum, segments };
        corner.sum = (0..grid.samples()).map(|i| corner.at(grid.sample_at(i))).collect();
        corner.instants = corner.fine();
        let tube = corner.tube();
        corner.segments = corner.sum.iter().map(|at| tube.nearest_segment(&at.position_rad)).collect();
        Some(corner)
    }

    /// Both motions at a time in spacings, without what is added.
    fn at(&self, spacings: f64) -> Setpoint {
        let t_s = self.from_s + spacings * self.spacing_s;
        let (mut sum, then) = (self.onward.first.sample(t_s), self.onward.then.sample(t_s - self.then_s));
        let add = |to: &mut JointArray, more: &JointArray| {
            to.iter_mut().zip(more).for_each(|(to, more)| *to += more);
        };
        add(&mut sum.velocity_rad_s, &then.velocity_rad_s);
        add(&mut sum.acceleration_rad_s2, &then.acceleration_rad_s2);
        add(&mut sum.jerk_rad_s3, &then.jerk_rad_s3);
        let base_rad = self.onward.then.base_rad();
        let moved = then.position_rad.iter().zip(base_rad);
        sum.position_rad.iter_mut().zip(moved).for_each(|(sum, (then, base))| *sum += then - base);
        sum
    }

    /// Closely spaced instants, and the ends of all strokes, where the jerk has its kinks, in spacings.
    fn fine(&self) -> Vec<f64> {
        let spacings = self.grid.spacings();
        let even = (0..spacings * PHASES).map(|i| i as f64 / PHASES as f64);
        let ends = |motion: &'a Trajectory, from_s: f64| {
            let both = motion.strokes().iter().flat_map(|stroke| [stroke.start_s, stroke.end_s()]);
            both.map(move |t_s| (t_s + from_s - self.from_s) / self.spacing_s)
        };
        let kinks = ends(self.onward.first, 0.0).chain(ends(self.onward.then, self.then_s));
        even.chain(kinks.filter(|at| (0.0..spacings as f64).contains(at))).collect()
    }

    fn tube(&self) -> Tube<JOINTS> {
        Tube::new(&self.path_rad, &vec![self.radius_rad; self.path_rad.len()])
    }

    /// A joint's limits in spacings, from velocity to jerk.
    fn limits(&self, joint: usize) -> [f64; 3] {
        let (motion, h) = (self.onward.limits[joint].motion, self.spacing_s);
        [motion.velocity_rad_s * h, motion.acceleration_rad_s2 * h * h, motion.jerk_rad_s3 * h * h * h]
    }

    /// What both motions take of them at a sample.
    fn taken(&self, at: &Setpoint, joint: usize) -> [f64; 3] {
        let h = self.spacing_s;
        let (v, a, j) = (at.velocity_rad_s[joint], at.acceleration_rad_s2[joint], at.jerk_rad_s3[joint]);
        [v * h, a * h * h, j * h * h * h]
    }

    /// What is left for the added strokes, from velocity to jerk. Lanes beyond the last joint stand still.
    fn bounds(&self) -> [Bounds<PerJoint<JOINTS>>; 3] {
        std::array::from_fn(|order| {
            let mut most = PerJoint::all(1.0);
            for joint in 0..self.onward.first.joints() {
                most.0[joint] = MARGIN * self.limits(joint)[order];
            }
            let mut bounds = Bounds::even(&self.grid, order + 1, most);
            for joint in 0..self.onward.first.joints() {
                self.leave(&mut bounds, joint);
            }
            bounds
        })
    }

    /// Takes what both motions use of a joint from its bounds.
    fn leave(&self, bounds: &mut Bounds<PerJoint<JOINTS>>, joint: usize) {
        let (order, limit) = (bounds.order - 1, self.limits(joint)[bounds.order - 1]);
        let both = bounds.low.iter_mut().zip(&mut bounds.high);
        for (sample, ((low, high), at)) in both.zip(&self.sum).enumerate() {
            let (taken, mut most) = (self.taken(at, joint)[order], MARGIN * limit);
            let t_s = self.from_s + self.spacing_s * self.grid.sample_at(sample);
            if t_s < self.then_s || t_s > self.onward.first.duration_s() {
                // One of the motions alone may use what it uses.
                most = most.max(taken.abs().min(limit));
            }
            (low.0[joint], high.0[joint]) = (-most - taken, most - taken);
        }
    }

    fn fit(&self) -> Option<Timed> {
        let (tube, mut bounds) = (self.tube(), self.bounds());
        let narrower = tube.narrower(NARROWER);
        let [v, a, j] = bounds.each_ref().map(|b| (b.order, b.weight));
        let fitter = Fitter::new(self.grid, &[v, a, j, (0, PerJoint::all(TUBE_WEIGHT / self.radius_rad))])?;
        let mut deltas = vec![PerJoint::ZERO; self.grid.strokes];
        let mut fit = Fit::new(&fitter, &deltas);
        for round in 0..=ROUNDS {
            let used = vectorized(Round {
                of: self,
                advances: round > 0,
                fit: &mut fit,
                bounds: &bounds,
                tube: &narrower,
            });
            if used <= NEAR && round % CHECK_EVERY == 0 {
                fit.write(&mut deltas);
                if let Some(timed) = self.checked(&tube, &deltas, &mut bounds) {
                    return Some(timed);
                }
            }
            if HOPELESS.iter().any(|(rounds, most)| round == *rounds && used > *most) {
                return None;
            }
        }
        None
    }

    /// Projects all samples into the tube: the last part of the fit is the position.
    #[inline(always)]
    fn keep_in<S: Simd>(&self, simd: S, tube: &Tube<JOINTS>, fit: &mut Fit<PerJoint<JOINTS>>) {
        let Some(part) = fit.parts.last_mut() else { return };
        let samples = part.target.iter_mut().zip(&mut part.excess);
        for ((target, excess), (at, segment)) in samples.zip(self.sum.iter().zip(&self.segments)) {
            let at_rad = PerJoint::of(&at.position_rad);
            let pose_rad = at_rad.plus(simd, *excess);
            let inside_rad = tube.project(simd, *segment, &pose_rad);
            (*target, *excess) = (inside_rad.minus(simd, at_rad), pose_rad.minus(simd, inside_rad));
        }
    }

    /// The whole motion, if it keeps the limits and the tube at closely spaced instants. Otherwise bounds are lowered next to what does not.
    fn checked(
        &self,
        tube: &Tube<JOINTS>,
        deltas: &[PerJoint<JOINTS>],
        bounds: &mut [Bounds<PerJoint<JOINTS>>; 3],
    ) -> Option<Timed> {
        let trajectory = self.trajectory(deltas)?;
        // Share of its ceiling that each joint uses most in each spacing, from velocity to jerk.
        let mut used = vec![vec![[0.0; 3]; self.grid.spacings()]; trajectory.joints()];
        let (mut deviation_rad, mut of_tube): (f64, f64) = (0.0, 0.0);
        for spacings in &self.instants {
            let at = trajectory.sample(self.from_s + spacings * self.spacing_s);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 200")]
            let spacing = *spacings as usize;
            for (joint, used) in used.iter_mut().enumerate() {
                let Some(most) = used.get_mut(spacing) else { continue };
                let limits = self.limits(joint);
                for ((most, taken), limit) in most.iter_mut().zip(self.taken(&at, joint)).zip(limits) {
                    *most = f64::max(*most, taken.abs() / (CEILING * limit));
                }
            }
            let segment = tube.nearest_segment(&at.position_rad);
            let [off_rad, share] = tube.off(Scalar::new(), segment, &PerJoint::of(&at.position_rad));
            (deviation_rad, of_tube) = (deviation_rad.max(off_rad), of_tube.max(share));
        }
        let mut holds = of_tube <= CEILING;
        for (joint, used) in used.iter().enumerate() {
            for (spacing, used) in used.iter().enumerate() {
                for (order, used) in used.iter().enumerate().filter(|(_, used)| **used > 1.0) {
                    holds = false;
                    self.lower(&mut bounds[order], (joint, spacing), TIGHTEN / used);
                }
            }
        }
        holds.then_some(Timed { trajectory, deviation_rad })
    }

    /// Lowers what a joint may do in a spacing to a share of it.
    fn lower(&self, bounds: &mut Bounds<PerJoint<JOINTS>>, (joint, spacing): (usize, usize), share: f64) {
        for sample in (spacing..self.sum.len()).step_by(self.grid.spacings()) {
            let taken = self.taken(&self.sum[sample], joint)[bounds.order - 1];
            for bound in [&mut bounds.low[sample].0[joint], &mut bounds.high[sample].0[joint]] {
                *bound = (*bound + taken) * share - taken;
            }
        }
    }

    fn trajectory(&self, deltas: &[PerJoint<JOINTS>]) -> Option<Trajectory> {
        let (first, then) = (self.onward.first, self.onward.then);
        let duration_s = (self.spacing_s * OVERLAP as f64).max(DURATION_S_MIN);
        let added = deltas.iter().enumerate().map(|(i, delta_rad)| Stroke {
            start_s: self.from_s + self.spacing_s * i as f64,
            duration_s,
            n: EXPONENT,
            delta_rad: delta_rad.joints(),
        });
        let later = then.strokes().iter().map(|s| Stroke { start_s: s.start_s + self.then_s, ..*s });
        let mut strokes: Vec<Stroke> = first.strokes().iter().copied().chain(later).chain(added).collect();
        // Stable: what has begun stays in its order, before everything else.
        strokes.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        let last = strokes.len().checked_sub(1)?;
        crate::replacement::end_at(first.base_rad(), &mut strokes, last, &then.end_rad());
        Trajectory::new(first.joints(), *first.base_rad(), &strokes).ok()
    }
}

/// One round of a fit; which share of the limits it uses most.
struct Round<'r, 'a, 'f, const JOINTS: usize> {
    of: &'r Corner<'a, JOINTS>,
    advances: bool,
    fit: &'r mut Fit<'f, PerJoint<JOINTS>>,
    bounds: &'r [Bounds<PerJoint<JOINTS>>; 3],
    tube: &'r Tube<JOINTS>,
}

impl<const JOINTS: usize> Vectorized for Round<'_, '_, '_, JOINTS> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> f64 {
        if self.advances {
            self.fit.advance(simd);
        }
        let mut used: f64 = 0.0;
        for (part, bounds) in self.fit.parts.iter_mut().zip(self.bounds) {
            used = used.max(part.beyond(simd, bounds) * MARGIN + MARGIN);
            part.clamp(simd, bounds);
        }
        self.of.keep_in(simd, self.tube, self.fit);
        used
    }
}

/// Points of a path that leave none of the others farther off than a distance (Douglas and Peucker).
fn simplified<const JOINTS: usize>(path_rad: &[JointArray], most_rad: f64) -> Vec<JointArray> {
    let mut keeps = vec![false; path_rad.len()];
    let mut spans = vec![(0, path_rad.len().saturating_sub(1))];
    while let Some((from, to)) = spans.pop() {
        keeps[from] = true;
        keeps[to] = true;
        let chord = [path_rad[from], path_rad[to]];
        let tube = Tube::<JOINTS>::new(&chord, &[1.0; 2]);
        let off = |i: &usize| tube.off(Scalar::new(), 0, &PerJoint::of(&path_rad[*i]))[0];
        let farthest = (from + 1..to).max_by(|a, b| off(a).total_cmp(&off(b)));
        if let Some(farthest) = farthest.filter(|i| off(i) > most_rad) {
            spans.extend([(from, farthest), (farthest, to)]);
        }
    }
    let kept = path_rad.iter().zip(keeps).filter(|(_, keep)| *keep).map(|(pose, _)| *pose);
    let mut kept: Vec<JointArray> = kept.collect();
    kept.dedup_by(|b, a| distance(a, b) <= f64::EPSILON);
    kept
}
