//! Poses of an arm whose tip is at a point, found by a swarm under the cost of Lv et al. (2019).
//!
//! The paper's cost is of one arm in free space; here it has the arm's own joint ranges, each joint's own speed and, once
//! the tip is near, a toll for whatever is nearer than it may be. Its constants keep the paper's values and units:
//! ε = 5e-6 m and s = 5e-10 m are precisions, `e_max` is twice the arm's reach, K and j are in seconds like the time
//! of the joint that has farthest to go.
use crate::budget::Budget;
use crate::world::{Snapshot, World};
use std::cell::RefCell;
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::papers::reach::{Reach, Reward};
use taustream_optimizers::{Method, Problem, Progress, Reading, Refusal, Run, Setup};

/// Evaluations a try: the paper's population for fifty generations. From there polishing is quicker.
pub(super) const EVALUATIONS: usize = 2_000;
/// Share of the reach below which the tip is near: farther away contacts are not evaluated.
const NEAR: f64 = 0.1;
/// What touching costs: between the punishments of 0.1 and of 0.3 of the reach, and far above any way's time.
const TOLL: [f64; 2] = [100.0, 200.0];

/// What a swarm is asked.
pub(super) struct Swarm<'a> {
    /// What the pose must keep from.
    pub(super) world: &'a World<'a>,
    /// The clock.
    pub(super) budget: &'a Budget<'a>,
    /// Where the arm starts.
    pub(super) start_rad: JointArray,
    /// The frame that is led there.
    pub(super) tip_frame: usize,
    /// Where the tip shall be, in the base's frame.
    pub(super) target_m: [f64; 3],
    /// Farthest that the tip can be from its first joint.
    pub(super) reach_m: f64,
    /// Which reading of the paper.
    pub(super) reading: Reading,
}

impl Swarm<'_> {
    /// The best pose of one run.
    ///
    /// # Errors
    /// When the numbers make no sense together, say a joint without speed.
    pub(super) fn run(&self, method: &Method, seed: u64) -> Result<Option<JointArray>, Refusal> {
        let joints = &self.world.robot().joints;
        let chain = &self.world.robot().chain;
        let frame = self.tip_frame;
        let position_m = |angles: &[f64]| chain.frame(frame, &pose_of(angles)).translation.vector.into();
        let bounds_rad: Vec<[f64; 2]> = joints.iter().map(|j| j.limits.position_rad).collect();
        let speeds_rad_s: Vec<f64> = joints.iter().map(|j| j.limits.motion.velocity_rad_s).collect();
        let start_rad: Vec<f64> = self.start_rad.iter().take(joints.len()).copied().collect();
        let reach = Reach {
            position_m: &position_m,
            bounds_rad: &bounds_rad,
            start_rad: &start_rad,
            target_m: self.target_m,
            speeds_rad_s: &speeds_rad_s,
            reward: Reward { error_max_m: 2.0 * self.reach_m, reading: self.reading, ..Reward::PAPER_003 },
        }
        .checked()?;
        let problem = ClearReach { reach, swarm: self, snapshot: RefCell::default() };
        let optimizer = (method.make)(Setup { reading: self.reading, evaluations: Some(EVALUATIONS) });
        let (is_over, mut watch) = (|| self.budget.is_over(), |_: &Progress| ());
        let run = Run {
            seed,
            evaluations_max: EVALUATIONS,
            guesses: std::slice::from_ref(&start_rad),
            is_over: &is_over,
            watch: &mut watch,
        };
        let found = optimizer.minimise(&problem, run)?;
        Ok((!found.x.is_empty()).then(|| pose_of(&found.x)))
    }
}

/// The paper's problem with obstacles.
struct ClearReach<'a> {
    reach: Reach<'a>,
    swarm: &'a Swarm<'a>,
    /// Scratch memory; the trait's evaluation takes no mutable access.
    snapshot: RefCell<Snapshot>,
}

impl Problem for ClearReach<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        self.reach.bounds()
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let cost = self.reach.cost(x);
        if self.reach.error_m(x) > NEAR * self.swarm.reach_m {
            return cost;
        }
        let (world, snapshot) = (self.swarm.world, &mut *self.snapshot.borrow_mut());
        world.place(&pose_of(x), snapshot);
        let hinges: f64 = world.pairs().iter().map(|pair| world.hinge(pair, snapshot)).sum();
        let [least, more] = TOLL;
        if hinges > 0.0 { cost + least + more * hinges.min(1.0) } else { cost }
    }
}

fn pose_of(angles: &[f64]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().zip(angles).for_each(|(slot, angle)| *slot = *angle);
    pose
}
