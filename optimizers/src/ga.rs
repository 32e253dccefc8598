//! GA: a real-coded genetic algorithm.
//!
//! The best survives; everybody else is the child of two winners of tournaments of two. Each coordinate is uniform
//! between the parents' and half their distance beyond, and mutates with a probability of a tenth by a normal number
//! with a deviation of a tenth of the box's side.
//!
//! Source: Lv et al. (2019) compares with a "GA" and defines nothing; this is the textbook's: blend crossover of Eshelman
//! and Schaffer, "Real-coded genetic algorithms and interval-schemata", FOGA 2, 1993, with α = 0.5.
//!
//! Random numbers of a child: two for each tournament; then for each coordinate the blend, whether it mutates, the
//! mutation.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, costs, sort};
use super::{Optimizer, Pso, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ga {
    /// Individuals and iterations.
    pub schedule: Schedule,
    /// How far beyond its parents a child may lie, α, in their distance.
    pub blend: f64,
    /// Probability that a coordinate mutates, and the deviation in sides of the box.
    pub mutation: [f64; 2],
}

impl Ga {
    /// Our numbers; the paper gives none.
    pub const BLEND: f64 = 0.5;
    /// Our numbers; the paper gives none.
    pub const MUTATION: [f64; 2] = [0.1, 0.1];

    /// Population and iterations of Lv et al. (2019).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let schedule = Pso::PAPER_003.fitted(setup.evaluations, Pso::PAPER_003.population - 1);
        Self { schedule, blend: Self::BLEND, mutation: Self::MUTATION }
    }
}

impl Optimizer for Ga {
    fn name(&self) -> &'static str {
        "ga"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 2)?;
        let (within, [chance, deviation]) = (Refusal::check_number, self.mutation);
        within(self.name(), "the blend", self.blend, [0.0, 1e6], "from 0 to 1e6 is possible")?;
        within(self.name(), "the probability of mutation", chance, [0.0, 1.0], "from 0 to 1 is possible")?;
        within(self.name(), "the deviation of a mutation", deviation, [0.0, 1e6], "from 0 to 1e6 is possible")
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Schedule { population, iterations } = self.schedule;
        let mut people = session.scatter(population)?;
        for _ in 0..iterations {
            let children = (1..people.len()).map(|_| self.child(session, &people)).collect();
            let children = session.weigh(children)?;
            sort(&mut people);
            people.truncate(1);
            people.extend(children);
            session.iterated(costs(&people));
        }
        Ok(())
    }
}

impl Ga {
    fn child(&self, session: &mut Session, people: &[Agent]) -> Vec<f64> {
        let (father, mother) = (tournament(session, people), tournament(session, people));
        let [chance, deviation] = self.mutation;
        let mut child = Vec::with_capacity(father.x.len());
        for (j, [low, high]) in session.bounds().iter().enumerate() {
            let (a, b) = (father.x[j].min(mother.x[j]), father.x[j].max(mother.x[j]));
            let beyond = self.blend * (b - a);
            let mut x = session.rng.within(a - beyond, b + beyond);
            if session.rng.unit() < chance {
                x += deviation * (high - low) * session.rng.normal();
            }
            child.push(x);
        }
        child
    }
}

fn tournament<'a>(session: &mut Session, people: &'a [Agent]) -> &'a Agent {
    let (a, b) = (session.rng.index(people.len()), session.rng.index(people.len()));
    if people[b].cost < people[a].cost { &people[b] } else { &people[a] }
}
