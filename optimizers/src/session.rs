//! One run of an optimiser: the only way in which a method reaches its problem.
use super::problem::{Problem, Refusal};
use taustream_arm::rng::SeededRng;

/// The cost of a point whose cost is not finite: the largest number, so that methods which calculate with costs stay
/// finite, and so that an objective that answers minus infinity cannot win.
pub const WORTHLESS: f64 = f64::MAX;

/// How to run.
pub struct Run<'a> {
    /// Seed of every random choice.
    pub seed: u64,
    /// Most evaluations of the cost.
    pub evaluations_max: usize,
    /// Points of the first population; the rest is uniform random. Clamped to the bounds; one with another number
    /// of coordinates is not used.
    pub guesses: &'a [Vec<f64>],
    /// Called before every batch of evaluations; true ends the run.
    pub is_over: &'a dyn Fn() -> bool,
    /// Called after every iteration.
    pub watch: &'a mut dyn FnMut(&Progress),
}

/// The state of a run after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Iterations done.
    pub iteration: usize,
    /// Evaluations done.
    pub evaluations: usize,
    /// Least cost in the population now.
    pub current: f64,
    /// Least cost ever seen.
    pub best: f64,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The method's own schedule is done.
    Done,
    /// The evaluations are used up.
    Budget,
    /// [`Run::is_over`] said so.
    Cut,
}

/// What a run found.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The best point ever seen; empty when not one could be evaluated.
    pub x: Vec<f64>,
    /// Its cost, by [`Problem::exact_cost`] where the problem has one; [`WORTHLESS`] when no cost was finite.
    pub cost: f64,
    /// Where the run stood at its end.
    pub progress: Progress,
    /// Why it ended.
    pub end: End,
}

/// A point and its cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agent {
    /// The point.
    pub x: Vec<f64>,
    /// Its cost.
    pub cost: f64,
}

/// Largest population; a bound against absurd arguments.
const POPULATION_MAX: usize = 10_000;

/// How many points, and for how long: methods fit their decays to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Points.
    pub population: usize,
    /// Iterations after the first population.
    pub iterations: usize,
}

impl Schedule {
    /// The same population with as many iterations as a number of evaluations allows.
    #[must_use]
    pub fn fitted(self, evaluations: Option<usize>, per_iteration: usize) -> Self {
        let iterations = evaluations.map_or(self.iterations, |all| {
            (all.saturating_sub(self.population) / per_iteration.max(1)).max(1)
        });
        Self { iterations, ..self }
    }

    pub(super) fn check(&self, method: &'static str, least: usize) -> Result<(), Refusal> {
        if self.population < least {
            let (what, value) = ("the population", self.population as f64);
            let expected = match least {
                0 | 1 => "at least 1 is needed",
                2 => "at least 2 are needed",
                3 => "at least 3 are needed",
                _ => "at least 4 are needed",
            };
            return Err(Refusal::Parameter { method, what, value, expected });
        }
        check_population(method, self.population)
    }
}

/// Refuses populations that would only fill the memory.
pub(super) fn check_population(method: &'static str, population: usize) -> Result<(), Refusal> {
    let bounds = [1.0, POPULATION_MAX as f64];
    Refusal::check_number(method, "the population", population as f64, bounds, "from 1 to 10000 is possible")
}

/// One run: the problem behind a meter, and the stream of random choices.
pub struct Session<'a> {
    /// Every random choice of the run comes from here.
    pub rng: SeededRng,
    problem: &'a dyn Problem,
    run: Run<'a>,
    evaluations: usize,
    best: Agent,
    current: f64,
    iteration: usize,
}

impl<'a> Session<'a> {
    /// Opens a run.
    ///
    /// # Errors
    /// When the box is none.
    pub fn new(problem: &'a dyn Problem, run: Run<'a>) -> Result<Self, Refusal> {
        Refusal::check_box(problem.bounds())?;
        let best = Agent { x: Vec::new(), cost: WORTHLESS };
        let rng = SeededRng::new(run.seed, 0);
        Ok(Self { rng, problem, run, evaluations: 0, best, current: WORTHLESS, iteration: 0 })
    }

    /// The box.
    #[must_use]
    pub fn bounds(&self) -> &'a [[f64; 2]] {
        self.problem.bounds()
    }

    /// How many coordinates.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.bounds().len()
    }

    /// The best point ever seen.
    #[must_use]
    pub fn best(&self) -> &Agent {
        &self.best
    }

    /// Iterations done.
    #[must_use]
    pub fn iteration(&self) -> usize {
        self.iteration
    }

    /// A uniform random point.
    pub fn random_point(&mut self) -> Vec<f64> {
        self.bounds().iter().map(|[low, high]| self.rng.within(*low, *high)).collect()
    }

    /// Guess number `i`, if there is one that fits.
    #[must_use]
    pub fn guess(&self, i: usize) -> Option<Vec<f64>> {
        self.run.guesses.get(i).filter(|g| g.len() == self.dimensions()).cloned()
    }

    /// A first population: the guesses, then uniform random points.
    ///
    /// # Errors
    /// When the run is over.
    pub fn scatter(&mut self, count: usize) -> Result<Vec<Agent>, End> {
        let points = (0..count).map(|i| self.guess(i).unwrap_or_else(|| self.random_point())).collect();
        self.weigh(points)
    }

    /// Clamps and evaluates one point.
    ///
    /// # Errors
    /// When the run is over.
    pub fn weigh_one(&mut self, x: Vec<f64>) -> Result<Agent, End> {
        self.weigh(vec![x])?.pop().ok_or(End::Done)
    }

    /// Clamps points to the box (NaN to its lower bound) and evaluates them, in batches as large as the problem
    /// likes.
    ///
    /// # Errors
    /// When the run is over. What was evaluated before that counts for the best.
    pub fn weigh(&mut self, mut points: Vec<Vec<f64>>) -> Result<Vec<Agent>, End> {
        for point in &mut points {
            for (x, [low, high]) in point.iter_mut().zip(self.problem.bounds()) {
                *x = x.max(*low).min(*high);
            }
        }
        let mut agents = Vec::with_capacity(points.len());
        for batch in points.chunks(self.problem.batch().max(1)) {
            let left = self.run.evaluations_max - self.evaluations;
            let granted = &batch[..batch.len().min(left)];
            if (self.run.is_over)() {
                // A budget that is used up is the reason, whatever the clock says now.
                return Err(if left == 0 { End::Budget } else { End::Cut });
            }
            let costs = if granted.is_empty() { Vec::new() } else { self.problem.costs(granted) };
            self.evaluations += granted.len();
            for (i, x) in granted.iter().enumerate() {
                let cost = costs.get(i).copied().map_or(WORTHLESS, worth);
                self.remember(x, cost);
                agents.push(Agent { x: x.clone(), cost });
            }
            if granted.len() < batch.len() {
                return Err(End::Budget);
            }
        }
        Ok(agents)
    }

    fn remember(&mut self, x: &[f64], cost: f64) {
        if cost < self.best.cost || self.best.x.is_empty() {
            self.best = Agent { x: x.to_vec(), cost };
        }
    }

    /// Ends an iteration whose population has these costs; tells who watches.
    pub fn iterated(&mut self, costs: impl Iterator<Item = f64>) {
        self.iteration += 1;
        self.note(costs);
        let progress = self.progress();
        (self.run.watch)(&progress);
    }

    /// Notes the costs of the population without ending an iteration.
    pub fn note(&mut self, costs: impl Iterator<Item = f64>) {
        self.current = costs.fold(WORTHLESS, f64::min);
    }

    fn progress(&self) -> Progress {
        let (iteration, evaluations) = (self.iteration, self.evaluations);
        Progress { iteration, evaluations, current: self.current, best: self.best.cost }
    }

    /// What the run found, with the cost that the problem reports.
    pub(super) fn found(mut self, end: End) -> Solution {
        if !self.best.x.is_empty() {
            self.best.cost = self.problem.exact_cost(&self.best.x).map_or(self.best.cost, worth);
        }
        let progress = self.progress();
        Solution { x: self.best.x, cost: self.best.cost, progress, end }
    }
}

/// A cost that methods can calculate with.
fn worth(cost: f64) -> f64 {
    if cost.is_finite() { cost } else { WORTHLESS }
}

/// Costs of a population, for [`Session::iterated`].
pub(super) fn costs(agents: &[Agent]) -> impl Iterator<Item = f64> + '_ {
    agents.iter().map(|a| a.cost)
}

/// Sorts a population, best first; equals keep their order, and so the seed its answer.
pub(super) fn sort(agents: &mut [Agent]) {
    agents.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}

/// Replaces the agents whose child is better.
pub(super) fn keep_better(agents: &mut [Agent], children: Vec<Agent>) {
    for (agent, child) in agents.iter_mut().zip(children) {
        if child.cost < agent.cost {
            *agent = child;
        }
    }
}
