//! IEPSO: particles that also exchange their bests, and of which the worst are replaced.
//!
//! To PSO's velocity comes `c_3` `r_3` (best - own best), and in every iteration the worst particles start again.
//!
//! Source: Lv et al. (2019), eq. 3 to 5 and table 4. Corrected against printed: the exchange has a sign (printed:
//! |best - own best|, which pushes every coordinate to its upper bound). In both readings: w falls from 0.9 to 0.4
//! and `c_3` from 2 to 0, linearly from the first iteration to the last; four of forty are replaced (the paper gives
//! no number), those with the highest cost now; they start at rest, at a random point that is their own best. The
//! rest as in [`super::pso`].
//!
//! Random numbers: as PSO's, with `r_3` after `r_2`; then the points of the replaced, the worst one first.
use super::problem::Refusal;
use super::pso::{Constants, Particle, Pso, fly, launch, ramp};
use super::session::{End, Schedule, Session};
use super::{Optimizer, Reading, Setup};

/// How the gap between the best and a particle's own best counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// With its sign.
    Signed,
    /// Its magnitude, as printed.
    Magnitude,
}

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iepso {
    /// Particles and iterations.
    pub schedule: Schedule,
    /// What it shares with PSO.
    pub constants: Constants,
    /// How the exchange counts.
    pub exchange: Exchange,
    /// Weight of the exchange, `c_3`, at the start and at the end.
    pub weight: [f64; 2],
    /// Particles replaced in every iteration.
    pub replaced: usize,
}

impl Iepso {
    /// Inertia and pulls of the paper.
    pub const CONSTANTS: Constants = Constants { inertia: [0.9, 0.4], pulls: [2.0; 2] };
    /// `c_3` of the paper.
    pub const WEIGHT: [f64; 2] = [2.0, 0.0];
    /// Our number; the paper gives none.
    pub const REPLACED: usize = 4;

    /// The numbers of the paper.
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let exchange = match setup.reading {
            Reading::Corrected => Exchange::Signed,
            Reading::Printed => Exchange::Magnitude,
        };
        let per_iteration = Pso::PAPER_003.population + Self::REPLACED;
        let schedule = Pso::PAPER_003.fitted(setup.evaluations, per_iteration);
        let (constants, weight, replaced) = (Self::CONSTANTS, Self::WEIGHT, Self::REPLACED);
        Self { schedule, constants, exchange, weight, replaced }
    }
}

impl Optimizer for Iepso {
    fn name(&self) -> &'static str {
        "iepso"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 1)?;
        Refusal::check_finite(self.name(), "the exchange's weight", &self.weight)?;
        self.constants.check(self.name())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Constants { inertia, pulls } = self.constants;
        let mut swarm = launch(session, self.schedule.population)?;
        for t in 1..=self.schedule.iterations {
            let w = ramp(inertia, t, self.schedule.iterations);
            let c3 = ramp(self.weight, t, self.schedule.iterations);
            let exchange = |session: &mut Session, gap: f64| {
                let gap = match self.exchange {
                    Exchange::Signed => gap,
                    Exchange::Magnitude => gap.abs(),
                };
                c3 * session.rng.unit() * gap
            };
            for particle in &mut swarm {
                particle.steer(session, w, pulls, exchange);
            }
            fly(session, &mut swarm)?;
            self.replace(session, &mut swarm)?;
            session.iterated(swarm.iter().map(|p| p.at.cost));
        }
        Ok(())
    }
}

impl Iepso {
    fn replace(&self, session: &mut Session, swarm: &mut [Particle]) -> Result<(), End> {
        let mut by_cost: Vec<usize> = (0..swarm.len()).collect();
        by_cost.sort_by(|a, b| swarm[*b].at.cost.total_cmp(&swarm[*a].at.cost));
        // At least one stays, however small the swarm is.
        by_cost.truncate(self.replaced.min(swarm.len() - 1));
        let points = by_cost.iter().map(|_| session.random_point()).collect();
        for (i, at) in by_cost.into_iter().zip(session.weigh(points)?) {
            swarm[i] = Particle { velocity: vec![0.0; at.x.len()], own_best: at.clone(), at };
        }
        Ok(())
    }
}
