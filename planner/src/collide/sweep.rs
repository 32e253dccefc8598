//! The proof that a whole motion keeps every distance: recursive bisection with a proven step.
//!
//! At the middle of an interval the exact distance of a pair is compared with how far its points can move until
//! the interval's ends ([`World::moves_m`]). A pair whose distance is larger is settled for the whole interval; the
//! others are handed to the two halves. Nothing that happens between samples can be missed.
use crate::budget::Budget;
use crate::world::{Concerned, Pair, Snapshot, World};
use taustream_motion::{JointArray, MAX_JOINTS};

/// A motion over a parameter.
pub trait Motion {
    /// The pose at a parameter.
    fn at(&self, t: f64) -> JointArray;
    /// Upper bound of every joint's travel from one parameter to a later one (rad).
    fn travel_rad(&self, from: f64, to: f64) -> JointArray;
}

/// A straight joint-space line over [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct StraightEdge<'a> {
    /// Pose at 0.
    pub from_rad: &'a JointArray,
    /// Pose at 1.
    pub to_rad: &'a JointArray,
}

impl Motion for StraightEdge<'_> {
    fn at(&self, t: f64) -> JointArray {
        std::array::from_fn(|j| self.from_rad[j] + (self.to_rad[j] - self.from_rad[j]) * t)
    }
    fn travel_rad(&self, from: f64, to: f64) -> JointArray {
        std::array::from_fn(|j| (self.to_rad[j] - self.from_rad[j]).abs() * (to - from))
    }
}

/// What a sweep shall prove, and how hard it may try.
#[derive(Clone, Copy, Debug)]
pub struct SweepRules {
    /// Kept beyond what every pair must keep.
    pub extra_m: f64,
    /// Below this travel a pair that is not settled counts as blocked.
    pub resolution_m: f64,
    /// Most poses.
    pub checks_max: usize,
    /// Bracket within which the least distance is found; infinite when it is not wanted.
    pub bracket_m: f64,
    /// True to continue to the first contact in time; false to end at any.
    pub first_contact: bool,
}

impl SweepRules {
    /// For the edges of a search: quick, and a bit wary so that the timed motion can be proven later.
    pub const EDGE: Self = Self {
        extra_m: 2e-4,
        resolution_m: 2e-4,
        checks_max: 4_000,
        bracket_m: f64::INFINITY,
        first_contact: false,
    };
    /// What the pose at an end of an edge must keep beyond every pair, so that an edge to it can be proven.
    pub const EDGE_END_M: f64 = Self::EDGE.extra_m + Self::EDGE.resolution_m;
    /// For the proof of a motion.
    pub const PROOF: Self = Self {
        extra_m: 0.0,
        resolution_m: 1e-6,
        checks_max: 400_000,
        bracket_m: f64::INFINITY,
        first_contact: true,
    };
    /// For its least distance.
    pub const LEAST_DISTANCE: Self = Self { bracket_m: 1e-3, ..Self::PROOF };
    /// For the exit path from the margin, which begins at its edge: as fine as the proof.
    pub const MARGIN_EXIT: Self = Self {
        extra_m: 0.0,
        resolution_m: 1e-6,
        checks_max: 20_000,
        bracket_m: f64::INFINITY,
        first_contact: false,
    };
    /// For what runs while the scene changes: the first contact in time counts.
    pub const SCENE_CHANGE: Self = Self { resolution_m: 1e-5, first_contact: true, ..Self::MARGIN_EXIT };
    /// For candidates of timing, whose geometry is new.
    pub const CANDIDATE: Self = Self {
        extra_m: 1e-5,
        resolution_m: 1e-5,
        checks_max: 20_000,
        bracket_m: f64::INFINITY,
        first_contact: false,
    };
}

/// The least distance of a motion that was proven.
#[derive(Clone, Copy, Debug)]
pub struct Clearance {
    /// Proven lower bound; infinite when nothing can collide.
    pub proven_m: f64,
    /// The least distance that was met.
    pub sampled_m: f64,
    /// Where it was met.
    pub at: f64,
    /// Between which.
    pub pair: Option<Pair>,
    /// How many poses were checked.
    pub checks: usize,
}

impl Clearance {
    /// Where the bracket of the least distance begins: not below what its pair must keep, or a proven motion would seem to keep too little.
    pub(super) fn bracket_from_m(&self, rules: &SweepRules) -> f64 {
        /// A bracket has some width.
        const LEAST_M: f64 = 1e-5;
        if rules.bracket_m.is_infinite() {
            return f64::NEG_INFINITY;
        }
        let required_m = self.pair.map_or(0.0, |pair| pair.required_m);
        (self.sampled_m - rules.bracket_m).max(required_m.min(self.sampled_m - LEAST_M))
    }
}

/// Why a motion is not proven.
#[derive(Clone, Copy, Debug)]
pub struct Blocked {
    /// The parameter.
    pub at: f64,
    /// What is too close there, and its distance; `None` when the work ran out.
    pub pair: Option<(Pair, f64)>,
    /// How many poses were checked.
    pub checks: usize,
}

/// Proves that a motion keeps every distance from `from` to `to`.
///
/// # Errors
/// The first parameter (to the rules' resolution) at which a distance is not proven, or where the work ended.
pub fn sweep(
    world: &World,
    motion: &dyn Motion,
    [from, to]: [f64; 2],
    rules: &SweepRules,
    budget: &Budget,
) -> Result<Clearance, Blocked> {
    let met =
        Clearance { proven_m: f64::INFINITY, sampled_m: f64::INFINITY, at: from, pair: None, checks: 0 };
    sweep_knowing(met, (world, motion), [from, to], rules, budget)
}

/// The same, knowing a distance that is met somewhere: what is farther off than that need not be bracketed.
///
/// # Errors
/// As for [`sweep`].
pub fn sweep_knowing(
    met: Clearance,
    (world, motion): (&World, &dyn Motion),
    [from, to]: [f64; 2],
    rules: &SweepRules,
    budget: &Budget,
) -> Result<Clearance, Blocked> {
    let mut state = State {
        world,
        motion,
        rules,
        budget,
        snapshot: Snapshot::default(),
        concerned: Concerned::default(),
        moves_m: Vec::new(),
        active: (0..world.pairs().len()).collect(),
        found: met,
    };
    let all = 0..state.active.len();
    state.visit([from, to], all, 0)?;
    Ok(state.found)
}

/// Deeper than this, an interval is shorter than the spacing of numbers in it.
const DEPTH_MAX: u32 = 50;

struct State<'a> {
    world: &'a World<'a>,
    motion: &'a dyn Motion,
    rules: &'a SweepRules,
    budget: &'a Budget<'a>,
    snapshot: Snapshot,
    concerned: Concerned,
    moves_m: Vec<[f64; MAX_JOINTS + 1]>,
    /// A stack of the pairs that are not settled, one range an open interval.
    active: Vec<usize>,
    found: Clearance,
}

impl State<'_> {
    fn visit(
        &mut self,
        [from, to]: [f64; 2],
        open: std::ops::Range<usize>,
        depth: u32,
    ) -> Result<(), Blocked> {
        if self.found.checks >= self.rules.checks_max || self.budget.is_over_after(open.len()) {
            return Err(self.blocked(from, None));
        }
        self.found.checks += 1;
        let middle = 0.5 * (from + to);
        let settled = self.settle([from, middle, to], open);
        // What is still open lies behind everybody else's ranges.
        let open = settled.start..self.active.len();
        if open.is_empty() {
            return Ok(());
        }
        let result = self.descend([from, middle, to], open, (settled.moves_m, depth));
        self.active.truncate(settled.start);
        result
    }

    /// Checks the open pairs in the middle of an interval; pushes those that are not settled.
    fn settle(&mut self, [from, middle, to]: [f64; 3], open: std::ops::Range<usize>) -> Settled {
        let (before, after) = (self.motion.travel_rad(from, middle), self.motion.travel_rad(middle, to));
        let turn_rad: JointArray = std::array::from_fn(|j| before[j].max(after[j]));
        let pairs = self.active[open.clone()].iter().map(|index| &self.world.pairs()[*index]);
        self.world.concerned(pairs, &mut self.concerned);
        self.world.place_concerned(&self.motion.at(middle), &self.concerned, &mut self.snapshot);
        self.world.moves_m((&self.snapshot, &self.concerned), &turn_rad, &mut self.moves_m);
        let mut settled = Settled { start: self.active.len(), moves_m: 0.0 };
        for slot in open {
            let index = self.active[slot];
            let pair = self.world.pairs()[index];
            let moves_m = self.world.pair_moves_m(&pair, &self.moves_m);
            let keep_m = pair.required_m + self.rules.extra_m;
            let bound_m = self.world.distance_bound_m(&pair, &self.snapshot) - moves_m;
            if self.is_settled(bound_m, keep_m) {
                self.found.proven_m = self.found.proven_m.min(bound_m);
                continue;
            }
            let distance_m = self.world.distance_m(&pair, &self.snapshot);
            if distance_m < self.found.sampled_m {
                (self.found.sampled_m, self.found.at, self.found.pair) = (distance_m, middle, Some(pair));
            }
            if self.is_settled(distance_m - moves_m, keep_m) {
                self.found.proven_m = self.found.proven_m.min(distance_m - moves_m);
            } else {
                self.active.push(index);
                settled.moves_m = settled.moves_m.max(moves_m);
            }
        }
        settled
    }

    /// True when a lower bound over the interval is enough: for the pair, and for the bracket of the least distance.
    fn is_settled(&self, bound_m: f64, keep_m: f64) -> bool {
        bound_m > keep_m && bound_m >= self.found.bracket_from_m(self.rules)
    }

    /// Goes on in the halves, the earlier one first: the first contact in time is reported.
    fn descend(
        &mut self,
        [from, middle, to]: [f64; 3],
        open: std::ops::Range<usize>,
        (moves_m, depth): (f64, u32),
    ) -> Result<(), Blocked> {
        let contact = open.clone().find_map(|slot| self.contact_now(self.active[slot]));
        if let (Some(pair), false) = (contact, self.rules.first_contact) {
            return Err(self.blocked(middle, Some(pair)));
        }
        let stuck = moves_m < self.rules.resolution_m || depth >= DEPTH_MAX;
        if stuck && contact.is_none() {
            let pair = self.nearest_open(open);
            return Err(self.blocked(middle, pair));
        }
        if !stuck {
            self.visit([from, middle], open.clone(), depth + 1)?;
        }
        if let Some(pair) = contact {
            return Err(self.blocked(middle, Some(pair)));
        }
        self.visit([middle, to], open, depth + 1)
    }

    fn contact_now(&self, index: usize) -> Option<(Pair, f64)> {
        let pair = self.world.pairs()[index];
        let distance_m = self.world.distance_m(&pair, &self.snapshot);
        (distance_m <= pair.required_m + self.rules.extra_m).then_some((pair, distance_m))
    }

    fn nearest_open(&self, open: std::ops::Range<usize>) -> Option<(Pair, f64)> {
        let pairs = open.map(|slot| self.world.pairs()[self.active[slot]]);
        let measured = pairs.map(|p| (p, self.world.distance_m(&p, &self.snapshot)));
        measured.min_by(|(p, d), (q, e)| (d - p.required_m).total_cmp(&(e - q.required_m)))
    }

    fn blocked(&self, at: f64, pair: Option<(Pair, f64)>) -> Blocked {
        Blocked { at, pair, checks: self.found.checks }
    }
}

/// What settling one interval left open.
struct Settled {
    /// Where the open pairs begin on the stack.
    start: usize,
    /// The furthest that one of them can move within half of the interval.
    moves_m: f64,
}
