//! BOA: butterflies fly to the best, or past two others, as strongly as they smell.
//!
//! Fragrance f = c `I^a` with the butterfly's cost as stimulus I. With probability p it flies to x + (r² best - x) f,
//! else to x + (r² `x_j` - `x_k`) f, and stays where it was unless the new place is better.
//!
//! Source: Arora and Singh, "Butterfly Optimization Algorithm", Soft Computing 23, 2019; Li, Xing and Qin (2025) compares with
//! it. Read as: c starts at 0.01 and grows by 0.025/(c T) an iteration; a = 0.1; p = 0.8 (some ports have 0.6); I is
//! the cost's magnitude, since a negative one has no root; one r a butterfly; j and k differ from each other, not
//! from the butterfly; everybody moves, and then all are evaluated.
//!
//! Random numbers of a butterfly: which flight, r; then j and k if it is the second one.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, costs, keep_better};
use super::{Gwo, Optimizer, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boa {
    /// Butterflies and iterations.
    pub schedule: Schedule,
    /// Probability of the flight to the best, p.
    pub to_best: f64,
    /// Sensory modality c at the start.
    pub modality: f64,
    /// Power exponent a.
    pub exponent: f64,
}

impl Boa {
    /// The authors' p, c and a.
    pub const AUTHORS: [f64; 3] = [0.8, 0.01, 0.1];
    /// What c grows by, times c T.
    const GROWTH: f64 = 0.025;

    /// The authors' numbers, population and iterations of Li, Xing and Qin (2025).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let [to_best, modality, exponent] = Self::AUTHORS;
        let schedule = Gwo::PAPER_001.fitted(setup.evaluations, Gwo::PAPER_001.population);
        Self { schedule, to_best, modality, exponent }
    }
}

impl Optimizer for Boa {
    fn name(&self) -> &'static str {
        "boa"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 2)?;
        let within = Refusal::check_number;
        within(self.name(), "p", self.to_best, [0.0, 1.0], "from 0 to 1 is possible")?;
        within(self.name(), "c", self.modality, [1e-12, 1e12], "from 1e-12 to 1e12 is possible")?;
        within(self.name(), "a", self.exponent, [0.0, 1.0], "from 0 to 1 is possible")
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Schedule { population, iterations } = self.schedule;
        let mut swarm = session.scatter(population)?;
        let mut c = self.modality;
        for _ in 0..iterations {
            let moved = (0..swarm.len()).map(|i| self.fly(session, &swarm, i, c)).collect();
            let moved = session.weigh(moved)?;
            keep_better(&mut swarm, moved);
            c += Self::GROWTH / (c * iterations as f64);
            session.iterated(costs(&swarm));
        }
        Ok(())
    }
}

impl Boa {
    fn fly(&self, session: &mut Session, swarm: &[Agent], i: usize, c: f64) -> Vec<f64> {
        let fragrance = c * swarm[i].cost.abs().powf(self.exponent);
        let is_to_best = session.rng.unit() < self.to_best;
        let r = session.rng.unit();
        let x = &swarm[i].x;
        let (there, here) = if is_to_best {
            (session.best().x.clone(), x)
        } else {
            let j = session.rng.index(swarm.len());
            let k = session.rng.index_except(swarm.len(), &[j]);
            (swarm[j].x.clone(), &swarm[k].x)
        };
        let flight = there.iter().zip(here).map(|(there, here)| (r * r * there - here) * fragrance);
        x.iter().zip(flight).map(|(x, f)| x + f).collect()
    }
}
