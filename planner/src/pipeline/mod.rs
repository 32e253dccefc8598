//! The stages of planning, one after the other, each on a budget of evaluations.
//!
//! straight line -> RRT-Connect -> shortcuts -> timing with rounded corners -> proof -> improvement. The first path that is
//! found is shortened, rounded and proven at once; from then on there is an answer, and later stages can only replace it by
//! a better one. A longer deadline does the same work first, then more, so it can only give a better motion.
mod answer;
mod constrained;
mod corners;
mod quick;
mod slower;
mod through;

pub(crate) use corners::blends_rad;

use crate::budget::Budget;
use crate::collide::{Course, StraightEdge, SweepRules, sweep_in_parts};
use crate::constraints::TipRules;
use crate::explain::{Explanation, Stage};
use crate::kind::{Improvement, PlannerKind};
use crate::margin_exit::MarginExit;
use crate::objective::{Evaluator, Objective};
use crate::plan::{Plan, PlanError, PlanOptions};
use crate::refine::{self, PathProblem, refine};
use crate::rng::SeededRng;
use crate::search::Searcher;
use crate::shortcut::shorten;
use crate::timing::{Path, Timed, stand_still};
use crate::torque::TorqueLimits;
use crate::tree::Space;
use crate::verify::{Proof, Stretch, Violation, prove_candidate};
use crate::world::World;
use constrained::is_too_fast;
use rustix::time::{ClockId, clock_gettime};
use std::ops::Range;
use std::time::Duration;
use taustream_motion::limits::Quantity;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Trajectory};
use taustream_optimizers::{METHODS, Method, Optimizer, Setup};

/// Poses that differ by less are one: far below a count of any encoder.
const SAME_RAD: f64 = 1e-12;
/// Independent searches; the best path of them is kept.
const SEARCHES: u64 = 3;
/// Most searches of an improvement by more of them.
const MORE_SEARCHES: u64 = 60;
/// What a corner costs in comparing paths: about what a stop there would (s).
const CORNER_S: f64 = 0.3;
/// A searched path is timed when it is estimated to be better than those before by this factor.
const CLEARLY_LESS: f64 = 0.97;
/// Shortcuts tried a path.
const SHORTCUTS: usize = 120;
/// A motion that misses a limit is made slower by this factor, a few times.
const SLOWER: f64 = 1.002;
const SLOWER_TRIES: usize = 6;
/// Durations that differ by a smaller share are one.
const SAME_SHARE: f64 = 1e-12;
/// Poses of sampled edges granted a millisecond, where the clock does not end the work: about what a small controller checks.
const SAMPLED_A_MS: usize = 2_000;
/// Evaluations of a refinement's first round; each later one has twice as many.
const FIRST_REFINEMENT: usize = 64;

/// Evaluations granted a stage, from the deadline alone: about half of what a small controller does in the time,
/// so that the clock cuts in on slow or busy machines only.
#[derive(Clone, Copy, Debug)]
struct StageBudgets {
    /// Poses checked by all searches.
    search_checks: usize,
    /// Poses of sampled edges.
    sampled_checks: usize,
    /// Evaluations of the refinement.
    refinements: usize,
    /// Timings of one path tried.
    timings: usize,
}

/// The deadline in milliseconds, as far as it counts: a minute is the most that anybody waits for, and beyond it more
/// work finds nothing new.
fn counted_ms(deadline: Duration) -> usize {
    usize::try_from(deadline.as_millis()).unwrap_or(usize::MAX).clamp(1, 60_000)
}

/// Poses that all searches of a plan may check.
#[must_use]
pub fn search_checks(deadline: Duration) -> usize {
    counted_ms(deadline) * 100
}

impl StageBudgets {
    fn of(options: &PlanOptions) -> Self {
        let ms = counted_ms(options.deadline);
        Self {
            search_checks: search_checks(options.deadline),
            // While the clock ends it, nothing else does.
            sampled_checks: if options.keeps_deadline { usize::MAX } else { ms * SAMPLED_A_MS },
            refinements: ms,
            timings: (ms / 150).clamp(6, 12),
        }
    }
}

/// Where a searched path comes from, for users.
fn searched(searcher: Searcher) -> String {
    format!("{} with shortcuts", searcher.title())
}

/// What a refinement of the straight line starts from, for users.
const LINE: &str = "the straight line";
/// The methods that look for less energy and less cost when the options choose none: those that measured best
/// (docs/goals.md, docs/planner.md).
const BY_ENERGY: &str = "gwo";
const BY_COST: &str = "iwo";

/// The best verified motion so far.
struct Best {
    trajectory: Trajectory,
    proof: Proof,
    how: String,
    /// By the objective; less is better.
    score: f64,
}

/// Processor time of this thread so far, s.
fn processor_s() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

fn explained(stages: Vec<Stage>) -> Box<Explanation> {
    Box::new(Explanation { stages })
}

/// One planning run.
pub struct Pipeline<'a> {
    space: Space<'a>,
    options: &'a PlanOptions,
    /// Set when the motion must leave a margin before the pipeline's own path begins.
    margin_exit: Option<MarginExit<'a>>,
    evaluator: &'a Evaluator<'a>,
    stage_budgets: StageBudgets,
    limits: [JointLimits; MAX_JOINTS],
    /// What the tip must keep, where that is asked for.
    rules: Option<TipRules<'a>>,
    /// What the drives can bear, where that is known.
    torque_limits: Option<TorqueLimits<'a>>,
    /// The time of the best motion by time, once motions of less energy are looked for: none of them is faster.
    least_s: Option<f64>,
    /// Optimisers look for less energy.
    refines_by_energy: bool,
    /// The least duration of all proven motions.
    shortest_s: f64,
    /// What was done, as text.
    tried: Vec<String>,
    /// The same with times, and the time of the last of them since the begin, s.
    stages: Vec<Stage>,
    noted_s: f64,
    best: Option<Best>,
    /// Processor time of the thread at the start, and until the first verified motion.
    began_s: f64,
    first_s: f64,
    /// The least estimate of a path that was timed with rounded corners.
    least_estimate_s: f64,
    /// Why the latest motion was not proven.
    violation: Option<Violation>,
    /// A path had no timing.
    untimed: bool,
}

impl<'a> Pipeline<'a> {
    /// Prepares a run.
    #[must_use]
    pub fn new(
        world: &'a World<'a>,
        budget: &'a Budget<'a>,
        options: &'a PlanOptions,
        evaluator: &'a Evaluator<'a>,
    ) -> Self {
        Self {
            space: Space::new(world, budget),
            options,
            margin_exit: None,
            evaluator,
            stage_budgets: StageBudgets::of(options),
            limits: world.robot().limits(),
            // Constraints that make no sense were refused before.
            rules: TipRules::in_world(world, &options.constraints).unwrap_or_default(),
            torque_limits: TorqueLimits::of(world.robot()).ok(),
            least_s: None,
            refines_by_energy: false,
            shortest_s: f64::INFINITY,
            tried: Vec::new(),
            stages: vec![Stage {
                what: "bodies and pairs".to_owned(),
                took_s: budget.elapsed_s(),
                motion_s: None,
            }],
            noted_s: budget.elapsed_s(),
            best: None,
            began_s: processor_s(),
            first_s: 0.0,
            least_estimate_s: f64::INFINITY,
            violation: None,
            untimed: false,
        }
    }

    /// Takes down what was tried, and how long that took.
    fn note(&mut self, what: String) {
        self.note_time(what.clone());
        self.tried.push(what);
    }

    fn note_time(&mut self, what: String) {
        let now_s = self.space.budget.elapsed_s();
        let motion_s = self.best.as_ref().map(|best| best.proof.duration_s);
        self.stages.push(Stage { what, took_s: now_s - self.noted_s, motion_s });
        self.noted_s = now_s;
    }

    /// Has every motion begin where the arm stands, inside the margin, and go straight to where [`Self::run`] starts.
    #[must_use]
    pub fn margin_exit(mut self, margin_exit: MarginExit<'a>) -> Self {
        self.margin_exit = Some(margin_exit);
        self
    }

    /// Runs the stages that the kind of planner asks for.
    ///
    /// # Errors
    /// What was tried in vain.
    pub fn run(mut self, start_rad: &JointArray, goal_rad: &JointArray) -> Result<Plan, PlanError> {
        if start_rad.iter().zip(goal_rad).all(|(a, b)| (a - b).abs() <= SAME_RAD) {
            if self.margin_exit.is_some() {
                self.propose(&[*goal_rad], "straight line");
            } else {
                self.stay(start_rad);
            }
            return self.finish();
        }
        let line = vec![*start_rad, *goal_rad];
        match self.options.planner {
            PlannerKind::Straight => {
                self.straight(&line);
            }
            PlannerKind::Auto => {
                if !self.straight(&line) {
                    self.around(&line);
                } else if self.evaluator.objective != Objective::Time {
                    // Nothing is shorter in time than the line; by another measure something may be better.
                    self.turn_to_energy();
                    self.by_objective(&[(&line, LINE)]);
                }
            }
            PlannerKind::RrtConnect => {
                self.quick(&line, self.stage_budgets.sampled_checks);
            }
            PlannerKind::Rrt => self.search_first(Searcher::Rrt, &line),
            PlannerKind::Rbf => self.search_first(Searcher::Rbf, &line),
            PlannerKind::Bfo => self.search_first(Searcher::Bfo, &line),
            PlannerKind::Optimiser(method) => {
                let evaluations = self.stage_budgets.refinements;
                let setup = Setup { reading: self.options.reading, evaluations: Some(evaluations) };
                let optimizer = (method.make)(setup);
                let refine_line = |pipeline: &mut Self| {
                    if let Some(refined) = pipeline.refine(&line, &*optimizer, evaluations, LINE) {
                        pipeline.round(&refined, &optimizer.name().to_uppercase(), None);
                    }
                };
                refine_line(&mut self);
                if self.turn_to_energy() {
                    refine_line(&mut self);
                }
            }
        }
        self.finish()
    }

    /// What one searcher finds, with rounded corners.
    fn search_first(&mut self, searcher: Searcher, line: &[JointArray]) {
        self.search(searcher, line, 0..SEARCHES, self.stage_budgets.search_checks);
    }

    /// A path round what blocks the straight line: searched, and improved.
    fn around(&mut self, line: &[JointArray]) {
        let Some(path) = self.quick(line, self.stage_budgets.sampled_checks) else { return };
        let starts = [(path.as_slice(), "that"), (line, LINE)];
        if self.evaluator.objective == Objective::Cost {
            self.by_objective(&starts);
            return;
        }
        // What a plan by time does, a plan by energy does too, so that its choice holds that plan.
        match self.options.improvement {
            _ if !self.options.spends_deadline => {}
            Improvement::Nothing => {}
            Improvement::Searches => {
                let more = SEARCHES..SEARCHES + MORE_SEARCHES;
                self.search(Searcher::RrtConnect, line, more, self.stage_budgets.refinements * refine::POSES);
            }
            Improvement::Method(method) => self.refine_around(method, &starts),
        }
        if self.turn_to_energy() {
            self.by_objective(&starts);
        }
    }

    /// Looks for motions that are better by another measure than time.
    fn by_objective(&mut self, starts: &[(&[JointArray], &str)]) {
        let is_chosen = self.options.improvement != Improvement::default();
        let method = match (self.options.improvement, self.evaluator.objective) {
            (Improvement::Method(method), objective) if is_chosen || objective != Objective::Energy => {
                Some(method)
            }
            (_, Objective::Energy) => METHODS.iter().find(|m| m.name == BY_ENERGY),
            (_, Objective::Cost | Objective::Time) => METHODS.iter().find(|m| m.name == BY_COST),
        };
        if let Some(method) = method {
            self.refine_around(method, starts);
        }
    }

    /// Refinements from several paths, since each stays near where it starts: rounds of more and more evaluations, so that
    /// a larger budget begins with what a smaller one does.
    fn refine_around(&mut self, method: &Method, starts: &[(&[JointArray], &str)]) {
        let mut left = self.stage_budgets.refinements;
        let mut each = FIRST_REFINEMENT.min(left / starts.len().max(1));
        while each > 0 && each * starts.len() <= left && !self.space.budget.is_over() {
            left -= each * starts.len();
            let optimizer = (method.make)(Setup { reading: self.options.reading, evaluations: Some(each) });
            let source = optimizer.name().to_uppercase();
            for (path, from) in starts {
                if let Some(refined) = self.refine(path, &*optimizer, each, from) {
                    self.round(&refined, &source, None);
                }
            }
            each *= 2;
        }
    }

    fn path<'p>(&'p self, corners_rad: &'p [JointArray]) -> Path<'p> {
        Path { corners_rad, joints: self.space.world.joints(), limits: &self.limits }
    }

    fn stay(&mut self, pose_rad: &JointArray) {
        let Some(trajectory) = stand_still(self.space.world.joints(), pose_rad) else { return };
        let whole = Stretch { world: self.space.world, span_s: [0.0, trajectory.duration_s()] };
        let proof = prove_candidate(&[whole], &trajectory, self.space.budget);
        match proof.and_then(|proof| self.prove_rules(&trajectory, proof)) {
            Ok(proof) => self.keep(trajectory, proof, "already there".to_owned()),
            Err(violation) => self.blame(violation),
        }
    }

    /// The corners of a whole motion: the exit path from the margin comes before the path.
    fn whole_path(&self, path: &[JointArray]) -> Vec<JointArray> {
        let mut whole: Vec<JointArray> =
            self.margin_exit.iter().flat_map(|l| l.first_rad.iter()).chain(path).copied().collect();
        whole.dedup_by(|b, a| a.iter().zip(b.iter()).all(|(a, b)| (a - b).abs() <= SAME_RAD));
        whole
    }

    /// What a motion must keep, and when; `None` when it does not leave the margin that it begins in.
    fn stretches(&self, motion: &Trajectory) -> Option<Vec<Stretch<'_>>> {
        let (world, duration_s) = (self.space.world, motion.duration_s());
        let Some(margin_exit) = &self.margin_exit else {
            return Some(vec![Stretch { world, span_s: [0.0, duration_s] }]);
        };
        let left_s = margin_exit.left_s(world, motion, self.space.budget)?;
        Some(margin_exit.stretches(world, left_s, duration_s).to_vec())
    }

    /// True when a candidate keeps what it must.
    fn keeps_apart(&self, motion: &Trajectory) -> bool {
        let begins = if self.margin_exit.is_some() { SweepRules::MARGIN_EXIT } else { SweepRules::CANDIDATE };
        let rules = [begins, SweepRules::CANDIDATE];
        let course = Course::new(motion);
        self.stretches(motion).is_some_and(|stretches| {
            let mut parts = stretches.iter().zip(&rules);
            parts.all(|(s, rules)| {
                sweep_in_parts(s.world, &course, s.span_s, rules, self.space.budget).is_ok()
            })
        })
    }

    /// The straight line; true when its motion is proven.
    fn straight(&mut self, line: &[JointArray]) -> bool {
        let [from_rad, to_rad] = line else { return false };
        let edge = StraightEdge { from_rad, to_rad };
        if let Some(why) = self.violating_line(line) {
            self.note(format!("straight line ({why})"));
            return false;
        }
        let result =
            sweep_in_parts(self.space.world, &edge, [0.0, 1.0], &SweepRules::EDGE, self.space.budget);
        match result.map_err(|b| b.pair) {
            Ok(_) => {
                self.note("straight line".to_owned());
                self.propose(line, "straight line");
                if self.margin_exit.is_some() {
                    // The exit path ends in a corner, or on the line: no need to stop there.
                    self.round(line, "straight line", None);
                }
                self.best.is_some()
            }
            Err(Some((pair, _))) => {
                let (a, b) = self.space.world.names(&pair);
                self.note(format!("straight line (blocked: {a} and {b})"));
                false
            }
            Err(None) => {
                self.note("straight line (not proven in time)".to_owned());
                false
            }
        }
    }

    /// Several searches with shortcuts, until `checks_max` poses have been checked; the path that is estimated to be
    /// fastest, with the estimate.
    fn search(
        &mut self,
        searcher: Searcher,
        line: &[JointArray],
        streams: Range<u64>,
        checks_max: usize,
    ) -> Option<(f64, Vec<JointArray>)> {
        let [start, goal] = line else { return None };
        let mut best: Option<(f64, Vec<JointArray>)> = None;
        let (mut nodes, mut found, mut made) = (0, 0, 0);
        let end = self.space.checks().saturating_add(checks_max);
        for stream in streams {
            let left = end.saturating_sub(self.space.checks());
            if made > 0 && (left == 0 || self.space.budget.is_over()) {
                break;
            }
            made += 1;
            let mut rng = SeededRng::new(self.options.seed, 10 + stream);
            let search = self.search_keeping(searcher, [start, goal], left, &mut rng);
            nodes += search.nodes;
            let Some(mut path) = search.path else { continue };
            found += 1;
            shorten(&self.keeping(), &mut path, SHORTCUTS, &mut rng);
            let estimate_s = self.estimate_s(&path);
            let is_new = estimate_s < CLEARLY_LESS * self.least_estimate_s;
            if is_new {
                if self.best.is_none() {
                    // An answer before time is spent on better ones.
                    self.propose(&path, &searched(searcher));
                }
                self.round(&path, &searched(searcher), None);
            }
            if best.as_ref().is_none_or(|(b, _)| estimate_s < *b) {
                best = Some((estimate_s, path));
            }
        }
        let (title, unit) = (searcher.title(), searcher.unit());
        self.note(format!("{title} ({nodes} {unit}, {found} of {made} searches)"));
        best
    }

    /// Time at full speed plus a toll for each corner.
    fn estimate_s(&self, path: &[JointArray]) -> f64 {
        let segment_s = |a: &JointArray, b: &JointArray| {
            let joints = a.iter().zip(b).zip(&self.limits).take(self.space.world.joints());
            joints.map(|((a, b), l)| (a - b).abs() / l.motion.velocity_rad_s).fold(0.0, f64::max)
        };
        let corners = path.len().saturating_sub(2) as f64;
        corners * CORNER_S
            + path.windows(2).map(|p| if let [a, b] = p { segment_s(a, b) } else { 0.0 }).sum::<f64>()
    }

    /// An optimiser around a path; only a path whose every edge is proven comes back.
    fn refine(
        &mut self,
        path: &[JointArray],
        optimizer: &dyn Optimizer,
        evaluations_max: usize,
        from: &str,
    ) -> Option<Vec<JointArray>> {
        let name = optimizer.name().to_uppercase();
        let [Some(start), Some(goal)] = [path.first(), path.last()] else { return None };
        let problem = PathProblem::new(&self.space, *start, *goal)
            .by_energy(self.evaluator.energy().filter(|_| self.refines_by_energy));
        let refined = refine(&problem, path, optimizer, evaluations_max, self.options.seed);
        let (mut corners, found) = match refined {
            Ok(refined) => refined?,
            Err(refusal) => {
                self.note(format!("{name} from {from} (not started: {refusal})"));
                return None;
            }
        };
        let free = corners.windows(2).all(|p| {
            let [a, b] = p else { return false };
            self.is_edge_kept(a, b) && self.space.is_edge_free(a, b)
        });
        let evaluations = found.progress.evaluations;
        self.space.note_checks(evaluations * refine::POSES);
        let verdict = if free { "" } else { ", collides" };
        // Of several rounds the last says enough.
        let start = format!("{name} from {from} (");
        self.tried.retain(|tried| !tried.starts_with(&start));
        self.note(format!("{name} from {from} ({evaluations} evaluations{verdict})"));
        if !free {
            return None;
        }
        // The optimiser always has three control points; those that lie on the way are not needed.
        shorten(&self.keeping(), &mut corners, 0, &mut SeededRng::new(self.options.seed, 2));
        Some(corners)
    }

    /// Times a path with a stop at every corner and proves the motion.
    fn propose(&mut self, path: &[JointArray], how: &str) {
        let corners = self.whole_path(path);
        match self.timed(&corners, &|path: &Path| path.stopping()) {
            Some(timed) => {
                self.prove(&timed, how);
            }
            None => self.untimed = true,
        }
    }

    /// Keeps a verified motion if it is better than what there is.
    fn keep(&mut self, trajectory: Trajectory, proof: Proof, how: String) {
        let score = self.evaluator.score(&trajectory, &proof);
        self.shortest_s = self.shortest_s.min(proof.duration_s);
        if self.best.is_none() {
            self.first_s = processor_s() - self.began_s;
        }
        if self.best.as_ref().is_none_or(|best| score < best.score) {
            self.best = Some(Best { trajectory, proof, how, score });
        }
    }

    /// Proves a timed path, a little slower if its peaks were met between samples, and keeps it if it is better than what there
    /// is; false when it is not proven.
    fn prove(&mut self, timed: &Timed, how: &str) -> bool {
        let mut timed = timed.clone();
        for _ in 0..SLOWER_TRIES {
            let Some(stretches) = self.stretches(&timed.trajectory) else { return false };
            let left_s = stretches.first().map(|s| s.span_s[1]);
            let proof = prove_candidate(&stretches, &timed.trajectory, self.space.budget);
            match proof.and_then(|proof| self.prove_rules(&timed.trajectory, proof)) {
                Ok(proof) => {
                    match self.slowdown(&timed.trajectory, &proof) {
                        Ok(None) => {}
                        Ok(Some(factor)) => {
                            let Some(slower) = timed.slower(factor) else { return false };
                            timed = slower;
                            continue;
                        }
                        Err(overload) => {
                            self.blame(overload.into());
                            return false;
                        }
                    }
                    let note = self.margin_exit.as_ref().and_then(|l| l.note.as_ref());
                    let note = note.map_or_else(String::new, |n| format!("{}; ", n.words(left_s)));
                    self.keep(timed.trajectory, proof, format!("{note}{how}"));
                    return true;
                }
                Err(violation) => {
                    // Slower, a position limit stays in the way.
                    let limit = matches!(&violation, Violation::Limit { violation, .. }
                        if violation.quantity != Quantity::Position)
                        || is_too_fast(&violation);
                    self.blame(violation);
                    let Some(slower) = timed.slower(SLOWER).filter(|_| limit) else { return false };
                    timed = slower;
                }
            }
        }
        false
    }
}
