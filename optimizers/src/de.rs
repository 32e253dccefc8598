//! DE: differences of two members move a third.
//!
//! Trial = a + F (b - c) in coordinates that are drawn with probability CR, and in one at least; it replaces its
//! parent unless it is worse.
//!
//! Source: Storn and Price, "Differential Evolution", Journal of Global Optimization 11, 1997, as rand/1/bin;
//! Lv et al. (2019) compares with a "DE" and defines nothing. Read as: F = 0.5, CR = 0.9; a, b, c differ from each other and
//! from the parent; all trials are made, then evaluated.
//!
//! Random numbers of a trial: a, b, c, the coordinate that is certain; then one for each coordinate.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, costs};
use super::{Optimizer, Pso, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct De {
    /// Members and iterations.
    pub schedule: Schedule,
    /// Factor F of the difference.
    pub factor: f64,
    /// Probability CR that a coordinate is the trial's.
    pub crossover: f64,
}

impl De {
    /// F and CR, ours; the paper gives none.
    pub const NUMBERS: [f64; 2] = [0.5, 0.9];

    /// Population and iterations of Lv et al. (2019).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let [factor, crossover] = Self::NUMBERS;
        let schedule = Pso::PAPER_003.fitted(setup.evaluations, Pso::PAPER_003.population);
        Self { schedule, factor, crossover }
    }
}

impl Optimizer for De {
    fn name(&self) -> &'static str {
        "de"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 4)?;
        Refusal::check_finite(self.name(), "F", &[self.factor])?;
        Refusal::check_number(self.name(), "CR", self.crossover, [0.0, 1.0], "from 0 to 1 is possible")
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Schedule { population, iterations } = self.schedule;
        let mut members = session.scatter(population)?;
        for _ in 0..iterations {
            let trials = (0..members.len()).map(|i| self.trial(session, &members, i)).collect();
            let trials = session.weigh(trials)?;
            for (member, trial) in members.iter_mut().zip(trials) {
                // An equal one is taken: on a plain, standing still finds nothing.
                if trial.cost <= member.cost {
                    *member = trial;
                }
            }
            session.iterated(costs(&members));
        }
        Ok(())
    }
}

impl De {
    fn trial(&self, session: &mut Session, members: &[Agent], i: usize) -> Vec<f64> {
        let mut taken = vec![i];
        let mut other = |session: &mut Session| {
            let index = session.rng.index_except(members.len(), &taken);
            let at = taken.partition_point(|t| *t < index);
            taken.insert(at, index);
            &members[index].x
        };
        let (a, b, c) = (other(session), other(session), other(session));
        let certain = session.rng.index(session.dimensions());
        let mut trial = members[i].x.clone();
        for (j, x) in trial.iter_mut().enumerate() {
            if session.rng.unit() < self.crossover || j == certain {
                *x = a[j] + self.factor * (b[j] - c[j]);
            }
        }
        trial
    }
}
