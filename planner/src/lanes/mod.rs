//! Many poses at once, in f32 vectors: which of them keep every distance.
//!
//! The answer for each pose is the exact model's ([`World`]). Links are covered by spheres: larger ones that hold the whole shape, and
//! smaller ones that lie within it. A pose whose larger spheres keep every distance, and more by what f32 can be wrong, is
//! free. A pose in which a smaller sphere does not keep it, by as much, is not. For the few poses between the two, the pairs of bodies
//! in question are measured by the exact model.
//!
//! Of an interval of a motion they tell what every pair surely keeps ([`Lanes::keep`]).
mod arithmetic;
mod cover;
mod grid;
mod intervals;
mod kernel;
mod model;
mod rounding;

use crate::collide::StraightEdge;
use crate::world::{Frames, Other, Pair, World};
use kernel::{Along, Pass, Poses, Question, Suspect};
pub(crate) use model::Model;
use pulp::Arch;
use std::cell::RefCell;
use taustream_motion::JointArray;

/// The world in f32, beside the exact one.
pub struct Lanes<'a> {
    world: &'a World<'a>,
    model: &'a Model,
    arch: Arch,
    scratch: RefCell<Scratch>,
}

/// What is kept throughout an interval: lower bounds. Those that are not positive say nothing of how deep bodies overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    /// The least distance of all pairs (m).
    pub least_m: f32,
    /// The least of what a pair keeps beyond what it must (m).
    pub spare_m: f32,
}

/// Memory that is used again.
#[derive(Default)]
struct Scratch {
    /// Centres of the spheres, x, y and z of each in turn.
    centres: Vec<f32>,
    /// Obstacles near a group.
    near: Vec<u32>,
    suspects: Vec<Suspect>,
}

impl<'a> Lanes<'a> {
    /// Prepares a world.
    #[must_use]
    pub fn new(world: &'a World<'a>) -> Self {
        Self { world, model: world.model(), arch: Arch::new(), scratch: RefCell::default() }
    }

    /// The same on plain arithmetic, one pose at a time: to compare.
    #[must_use]
    pub fn scalar(self) -> Self {
        Self { arch: Arch::Scalar, ..self }
    }

    /// True when every one of the poses keeps what every pair must, and `extra_m` more.
    #[must_use]
    pub fn are_free(&self, poses_rad: &[JointArray], extra_m: f64) -> bool {
        self.all_free(poses_rad, extra_m)
    }

    /// The same of so many poses at even distances on an edge, of which the last is its end.
    #[must_use]
    pub fn is_edge_free(&self, edge: StraightEdge, count: usize, extra_m: f64) -> bool {
        self.all_free(&Along { edge, count }, extra_m)
    }

    fn all_free(&self, poses: &(impl Poses + ?Sized), extra_m: f64) -> bool {
        if poses.count() == 0 {
            return true;
        }
        let scratch = &mut *self.scratch.borrow_mut();
        scratch.suspects.clear();
        let pass = Pass { model: self.model, poses, extra_m, scratch };
        if !self.arch.dispatch(pass) {
            return false;
        }
        self.are_suspects_free(poses, extra_m, &mut scratch.suspects)
    }

    /// The first of the poses that is not free.
    #[must_use]
    pub fn first_blocked(&self, poses_rad: &[JointArray], extra_m: f64) -> Option<usize> {
        if self.are_free(poses_rad, extra_m) {
            return None;
        }
        let (mut free, mut blocked) = (0, poses_rad.len());
        // Poses before `free` are free, one of those before `blocked` is not.
        while free + 1 < blocked {
            let middle = usize::midpoint(free, blocked);
            if self.are_free(&poses_rad[free..middle], extra_m) { free = middle } else { blocked = middle }
        }
        Some(free)
    }

    /// What all pairs surely keep while each joint is within `turns_rad` of a pose, one for each of `poses_rad`; up to `enough_m`.
    pub fn keep(
        &self,
        (poses_rad, turns_rad): (&[JointArray], &[JointArray]),
        enough_m: f64,
        kept: &mut Vec<Kept>,
    ) {
        let scratch = &mut *self.scratch.borrow_mut();
        let model = self.model;
        self.arch.dispatch(intervals::Pass { model, poses_rad, turns_rad, enough_m, scratch, kept });
    }

    fn pair(&self, question: Question) -> Option<Pair> {
        match question {
            Question::Obstacle(link, obstacle) => {
                let exception = self.model.exceptions.get(&(link, obstacle)).copied();
                let required_m = exception.unwrap_or(self.world.margin_m());
                Some(Pair { link, other: Other::Obstacle(obstacle), required_m })
            }
            Question::Pair(index) => self.world.pairs().get(index).copied(),
        }
    }

    /// Measures the pairs that f32 leaves open.
    fn are_suspects_free(
        &self,
        poses: &(impl Poses + ?Sized),
        extra_m: f64,
        suspects: &mut [Suspect],
    ) -> bool {
        suspects.sort_unstable_by_key(|suspect| suspect.pose);
        let mut placed: Option<(u32, Frames)> = None;
        suspects.iter().all(|suspect| {
            let frames = match &placed {
                Some((pose, frames)) if *pose == suspect.pose => frames,
                Some(_) | None => {
                    &placed.insert((suspect.pose, self.world.frames(&poses.pose(suspect.pose as usize)))).1
                }
            };
            self.pair(suspect.question).is_some_and(|pair| self.world.keeps(&pair, frames, extra_m))
        })
    }
}
