//! The fast evaluation of the cost: the kernel sorts out the poses that are surely free, the reference evaluates the others.
//!
//! So penalty and collision are the reference's own, to the last bit: only the tip's path is f32. A pose that is
//! sorted out by mistake would be a collision called free; [`super::margin`] has the proof that none is.
use super::flat::Flat;
use super::level::Level;
use super::margin::Limits;
use super::prefilter::{Angles, CELL, Cells, PADDING, Pass, Passed, Sweep};
use super::skeleton::Skeleton;
use super::{CostModel, Point};
use crate::Reading;
use std::f64::consts::PI;
use taustream_motion::chain::Chain;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Longest travel of an angle in half turns that the kernel takes.
const DISTANCE_MAX: f32 = 64.0;

/// The constants of one problem.
#[derive(Clone, Debug)]
pub(super) struct Fast {
    level: Level,
    flat: Flat,
    sums: bool,
    steps: usize,
    phases: Vec<f32>,
    cells: Cells,
}

/// What the kernel says about a motion.
#[derive(Clone, Debug)]
pub(super) struct Prefiltered {
    /// Length of the tip's path.
    pub(super) length_m: f64,
    /// The poses that are not surely free, in order: segment and step. The last segment's step behind its last one is
    /// the goal.
    pub(super) suspects: Vec<(usize, usize)>,
}

impl Fast {
    /// `None` for an arm or spheres that the kernel cannot see; it sees serial arms of revolute joints only.
    pub(super) fn new(
        chain: &Chain,
        spheres: &[(Point, f64)],
        model: &CostModel,
        phases: &[f64],
    ) -> Option<Self> {
        if !chain.is_serial() || chain.has_prismatic() {
            return None;
        }
        let sums = model.reading == Reading::Printed;
        let flat = Flat::new(&Skeleton::new(chain), spheres, model.expansion_m, sums)?;
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let mut padded: Vec<f32> = phases.iter().map(|phase| *phase as f32).collect();
        padded.resize((phases.len() / PADDING + 1) * PADDING, 1.0);
        let cells = cells(&padded);
        Some(Self { level: Level::best(), flat, sums, steps: phases.len(), phases: padded, cells })
    }

    /// The same on another level.
    pub(super) fn on(self, level: Level) -> Self {
        Self { level, ..self }
    }

    /// Looks through a motion; `None` when its angles are beyond all measure.
    pub(super) fn prefilter(&self, corners: &[JointArray]) -> Option<Prefiltered> {
        let angles = self.motion_angles(corners)?;
        let limits = Limits::new(&self.flat, &angles, self.sums);
        Some(self.prefilter_within(&angles, &self.sweeps(corners), &limits))
    }

    /// How far each segment moves anything at most.
    #[expect(clippy::cast_possible_truncation, reason = "rounded up before")]
    fn sweeps(&self, corners: &[JointArray]) -> Vec<Sweep> {
        let sweep = |pair: &[JointArray]| {
            let [from, to] = pair else { return f64::INFINITY };
            let travels = from.iter().zip(to).map(|(p, q)| (q - p).abs());
            travels
                .zip(self.flat.link_segments())
                .map(|(travel, link_segment)| travel * link_segment.reach_m)
                .sum()
        };
        // A cell is called far on the strength of it.
        corners.windows(2).map(|pair| (sweep(pair) * (1.0 + 1e-6)) as f32).collect()
    }

    /// Looks through a motion with given limits.
    fn prefilter_within(&self, angles: &[Angles], sweeps: &[Sweep], limits: &Limits) -> Prefiltered {
        let row = self.phases.len();
        let mut slack = vec![0.0_f32; row * angles.len()];
        let (flat, phases) = (&self.flat, self.phases.as_slice());
        let cells = &self.cells;
        let pass = Pass { flat, phases, cells, angles, sweeps, limits, slack: &mut slack };
        let Passed { length_m, has_suspects } = self.level.run(pass);
        let mut suspects = Vec::new();
        if has_suspects {
            let last = angles.len().saturating_sub(1);
            for (segment, slack) in slack.chunks_exact(row).enumerate() {
                // The padding repeats the segment's end, which is the next one's first pose; the goal has no next one.
                let poses = self.steps + usize::from(segment == last);
                let steps = slack.iter().take(poses).enumerate().filter(|(_, slack)| **slack < 0.0);
                suspects.extend(steps.map(|(step, _)| (segment, step)));
            }
        }
        Prefiltered { length_m, suspects }
    }

    fn motion_angles(&self, corners: &[JointArray]) -> Option<Vec<Angles>> {
        let segments = corners.windows(2);
        segments.map(|pair| if let [from, to] = pair { self.angles(from, to) } else { None }).collect()
    }

    /// Start and travel of every angle that the kernel uses, in half turns.
    fn angles(&self, from_rad: &JointArray, to_rad: &JointArray) -> Option<Angles> {
        let mut angles = [[0.0; 2]; MAX_JOINTS];
        let (mut start, mut travel) = (0.0, 0.0);
        let joints = from_rad.iter().zip(to_rad).enumerate();
        for ((link_segment, slot), (joint, (from, to))) in
            self.flat.link_segments().zip(&mut angles).zip(joints)
        {
            if link_segment.group == joint {
                (start, travel) = (0.0, 0.0);
            }
            start += (from + link_segment.offset_rad) / PI;
            travel += (to - from) / PI;
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            let pair = [within_one(start) as f32, travel as f32];
            *slot = pair;
            if pair[1].abs() > DISTANCE_MAX {
                return None;
            }
        }
        Some(angles)
    }
}

/// The cells of a segment's poses.
fn cells(phases: &[f32]) -> Cells {
    /// More than the rounding of a middle.
    const ROUNDING: f32 = 1e-6;
    let (mut middles, mut halves) = (Vec::new(), Vec::new());
    for cell in phases.chunks(CELL) {
        let least = cell.iter().copied().fold(f32::INFINITY, f32::min);
        let most = cell.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        middles.push(0.5 * (least + most));
        halves.push(0.5 * (most - least) + ROUNDING);
    }
    let padded = middles.len().next_multiple_of(PADDING);
    middles.resize(padded, 1.0);
    halves.resize(padded, 0.0);
    Cells { middles, halves }
}

/// An angle in half turns, taken into [-1, 1].
fn within_one(half_turns: f64) -> f64 {
    half_turns - 2.0 * (0.5 * half_turns).round()
}

#[cfg(test)]
impl Fast {
    /// A planted fault: the kernel's numbers against the plain limits.
    pub(super) fn prefilter_without_margin(&self, corners: &[JointArray]) -> Prefiltered {
        let angles = self.motion_angles(corners).expect("angles of an arm");
        let mut limits = Limits::new(&self.flat, &angles, self.sums);
        for (limit, sphere) in limits.spheres.iter_mut().zip(&self.flat.spheres) {
            let free_from = if self.sums { sphere.limit_m } else { sphere.limit_m.powi(2) };
            #[expect(clippy::cast_possible_truncation, reason = "this is the fault")]
            let free_from = free_from as f32;
            limit.free_from = free_from;
            limit.distance = free_from.sqrt();
        }
        self.prefilter_within(&angles, &self.sweeps(corners), &limits)
    }
}
