//! The exit path from the margin, for an arm that is nearer to something than the margin.
//!
//! After a stop or a sag an arm may touch nothing and still be inside the margin, or so close to its edge that no
//! motion of the search's wary steps begins there. Then a short straight exit path is found first; planning continues
//! from its end with the full margin. Only until the arm has left are the distances those that the start has.
use crate::budget::Budget;
use crate::collide::{StraightEdge, SweepRules, sweep};
use crate::plan::{PlanError, PoseOf};
use crate::rng::SeededRng;
use crate::tree::Space;
use crate::verify::Stretch;
use crate::world::{Snapshot, World};
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};

/// A start that is nearer to an obstacle counts as touching it: encoders and models are no better.
const FLOOR_M: f64 = 1e-3;
/// How much less than the start's own distance is requested, so that a step away from it can be proven.
const SLACK_M: f64 = 5e-4;
/// From here on the steps of the search can be proven: twice what [`SweepRules::EDGE`] keeps and resolves.
const CLEAR_M: f64 = 8e-4;
/// A motion has left when it keeps this beyond the margin: above what candidates of timing keep and resolve.
const LEFT_M: f64 = 5e-5;
/// How long the exit path may be, in metres of weighted distance; the shortest rings come first.
const RINGS_M: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.8];
/// Directions that are tried a ring.
const DIRECTIONS: u32 = 48;
/// Poses per exit path.
const STEPS: u32 = 24;
/// Instants a motion at which it is checked whether the margin holds again.
const INSTANTS: u32 = 2_000;

/// The world as a start inside the margin has it.
pub struct Relaxed<'a> {
    /// The world, in which pairs that are too near at the start keep what they have there.
    pub world: World<'a>,
    /// What is reported.
    pub note: Note,
}

/// That a margin is reduced, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// The least that is kept.
    margin_m: f64,
    /// What the start is near to.
    near_to: String,
    /// The margin that it should keep.
    required_m: f64,
}

impl<'a> Relaxed<'a> {
    /// Reduces the margins to the distances of a start.
    ///
    /// # Errors
    /// When the start touches something, or nearly.
    pub fn around(world: &World<'a>, start_rad: &JointArray) -> Result<Self, PlanError> {
        let relaxed = world.relaxed(start_rad, FLOOR_M, SLACK_M);
        if let Some(contact) = relaxed.contact(start_rad) {
            return Err(PlanError::too_close(PoseOf::Start, contact));
        }
        let pairs = world.pairs().iter().zip(relaxed.pairs());
        let worst = pairs
            .max_by(|(a, b), (c, d)| (a.required_m - b.required_m).total_cmp(&(c.required_m - d.required_m)));
        let (near_to, required_m, margin_m) = worst.map_or((String::new(), 0.0, 0.0), |(before, after)| {
            (world.names(before).1, before.required_m, after.required_m)
        });
        Ok(Self { world: relaxed, note: Note { margin_m, near_to, required_m } })
    }
}

impl Note {
    /// In words; `until_s` is when the full margin holds again, `None` for a motion that keeps it reduced.
    #[must_use]
    pub fn words(&self, until_s: Option<f64>) -> String {
        let Self { margin_m, near_to, required_m } = self;
        let span = until_s
            .map_or_else(|| "along the whole motion".to_owned(), |t_s| format!("for the first {t_s:.2} s"));
        format!("margin {margin_m:.4} m {span}: the start is nearer to {near_to} than {required_m:.4} m")
    }
}

/// A motion that begins inside the margin, or at its edge.
pub struct MarginExit<'a> {
    /// What it must keep until it has left.
    pub near: &'a World<'a>,
    /// Where it begins, and what it passes before the pipeline's own path.
    pub first_rad: Vec<JointArray>,
    /// What is reported when less than the margin is kept.
    pub note: Option<Note>,
}

impl MarginExit<'_> {
    /// When a motion has left the margin of a world; `None` when it never does, or the clock cuts in.
    #[must_use]
    pub fn left_s(&self, world: &World, motion: &Trajectory, budget: &Budget) -> Option<f64> {
        let (duration_s, mut snapshot) = (motion.duration_s(), Snapshot::default());
        let mut instants = (0..=INSTANTS).map(|i| duration_s * f64::from(i) / f64::from(INSTANTS));
        let left_s = instants.find(|t_s| {
            budget.is_over_after(world.pairs().len())
                || world.is_free(&motion.sample(*t_s).position_rad, LEFT_M, &mut snapshot)
        });
        left_s.filter(|_| !budget.was_cut())
    }

    /// What a motion that leaves at an instant must keep, and when.
    #[must_use]
    pub fn stretches<'s>(&'s self, world: &'s World<'s>, left_s: f64, duration_s: f64) -> [Stretch<'s>; 2] {
        [Stretch { world: self.near, span_s: [0.0, left_s] }, Stretch { world, span_s: [left_s, duration_s] }]
    }
}

/// True when a pose keeps enough beyond everything for the search to begin there.
#[must_use]
pub fn is_clear(world: &World, pose_rad: &JointArray) -> bool {
    world.is_free(pose_rad, CLEAR_M, &mut Snapshot::default())
}

/// The end of a short straight exit path, clear in the second world and proven in the first: the one that makes the
/// least detour to the goal among the shortest. `None` when there is none nearby.
#[must_use]
pub fn find_margin_exit(
    [near, world]: [&World; 2],
    [start_rad, goal_rad]: [&JointArray; 2],
    seed: u64,
    budget: &Budget,
) -> Option<JointArray> {
    let space = Space::new(world, budget);
    let mut rng = SeededRng::new(seed, 20);
    for ring_m in RINGS_M {
        let mut best: Option<(f64, JointArray)> = None;
        for direction in 0..=DIRECTIONS {
            // Towards the goal first: what leads there is no detour.
            let target = if direction == 0 { *goal_rad } else { random_target(&space, start_rad, &mut rng) };
            let share = (ring_m / space.distance_m(start_rad, &target)).min(1.0);
            let end = Space::between(start_rad, &target, share);
            let Some(pose) = first_clear(world, start_rad, &end, budget) else { continue };
            let distance_m = space.distance_m(start_rad, &pose) + space.distance_m(&pose, goal_rad);
            let edge = StraightEdge { from_rad: start_rad, to_rad: &pose };
            if best.as_ref().is_none_or(|(b, _)| distance_m < *b)
                && sweep(near, &edge, [0.0, 1.0], &SweepRules::MARGIN_EXIT, budget).is_ok()
            {
                best = Some((distance_m, pose));
            }
        }
        if let Some((_, pose)) = best {
            return Some(pose);
        }
    }
    None
}

/// A pose inside the position limits, in a random direction.
fn random_target(space: &Space, start_rad: &JointArray, rng: &mut SeededRng) -> JointArray {
    let mut target = [0.0; MAX_JOINTS];
    let joints = &space.world.robot().joints;
    for ((q, start), joint) in target.iter_mut().zip(start_rad).zip(joints) {
        let [low, high] = joint.limits.position_rad;
        *q = (start + rng.within(-1.0, 1.0)).clamp(low, high);
    }
    target
}

/// The first clear pose of a straight line.
fn first_clear(
    world: &World,
    from_rad: &JointArray,
    to_rad: &JointArray,
    budget: &Budget,
) -> Option<JointArray> {
    let mut poses = (1..=STEPS).map(|i| Space::between(from_rad, to_rad, f64::from(i) / f64::from(STEPS)));
    poses.find(|pose| !budget.is_over_after(world.pairs().len()) && is_clear(world, pose))
}
