//! PSO and SPSO: particles drawn to their own best and to the best of all.
//!
//! v = w v + `c_1` `r_1` (own best - x) + `c_2` `r_2` (best - x), then x + v.
//!
//! Source: Kennedy and Eberhart, "Particle Swarm Optimization", ICNN 1995 (w = 1, c = 2: nothing damps it); Clerc and
//! Kennedy, IEEE Transactions on Evolutionary Computation 6(1), 2002 (constriction, w = 0.729, c = 1.494).
//! Lv et al. (2019) compares with both and gives no numbers but its population and iterations. Read as: fresh random numbers for
//! every coordinate; the first velocity is half the way to a random point; a particle stops at the box but keeps its
//! velocity; everybody moves, and then all are evaluated.
//!
//! Random numbers: first population; for each particle and coordinate its first velocity; then for each particle and
//! coordinate `r_1`, `r_2`.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session};
use super::{Optimizer, Setup};

/// What a velocity is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Inertia w at the start and at the end, linear between.
    pub inertia: [f64; 2],
    /// Pull of a particle's own best, `c_1`, and of the best of all, `c_2`.
    pub pulls: [f64; 2],
}

impl Constants {
    /// Kennedy and Eberhart's.
    pub const ORIGINAL: Self = Self { inertia: [1.0; 2], pulls: [2.0; 2] };
    /// Clerc and Kennedy's constriction.
    pub const STANDARD: Self = Self { inertia: [0.729; 2], pulls: [1.494; 2] };

    pub(super) fn check(&self, method: &'static str) -> Result<(), Refusal> {
        let ([w, v], [c1, c2]) = (self.inertia, self.pulls);
        Refusal::check_finite(method, "the inertia or a pull", &[w, v, c1, c2])
    }
}

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pso {
    /// Particles and iterations.
    pub schedule: Schedule,
    /// What a velocity is made of.
    pub constants: Constants,
}

impl Pso {
    /// Population and iterations of Lv et al. (2019).
    pub const PAPER_003: Schedule = Schedule { population: 40, iterations: 1000 };

    /// The one of 1995.
    #[must_use]
    pub fn original(setup: Setup) -> Self {
        Self { schedule: Self::schedule(setup), constants: Constants::ORIGINAL }
    }

    /// The one with constriction.
    #[must_use]
    pub fn standard(setup: Setup) -> Self {
        Self { schedule: Self::schedule(setup), constants: Constants::STANDARD }
    }

    fn schedule(setup: Setup) -> Schedule {
        Self::PAPER_003.fitted(setup.evaluations, Self::PAPER_003.population)
    }
}

impl Optimizer for Pso {
    fn name(&self) -> &'static str {
        if self.constants == Constants::STANDARD { "spso" } else { "pso" }
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 1)?;
        self.constants.check(self.name())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Constants { inertia, pulls } = self.constants;
        let mut swarm = launch(session, self.schedule.population)?;
        for t in 1..=self.schedule.iterations {
            let w = ramp(inertia, t, self.schedule.iterations);
            for particle in &mut swarm {
                particle.steer(session, w, pulls, |_, _| 0.0);
            }
            fly(session, &mut swarm)?;
            session.iterated(swarm.iter().map(|p| p.at.cost));
        }
        Ok(())
    }
}

/// A particle.
#[derive(Clone, Debug)]
pub(super) struct Particle {
    pub(super) at: Agent,
    pub(super) velocity: Vec<f64>,
    pub(super) own_best: Agent,
}

impl Particle {
    /// Gives it its next velocity; `exchange` adds a term from the gap between the best and its own best.
    pub(super) fn steer(
        &mut self,
        session: &mut Session,
        inertia: f64,
        [c1, c2]: [f64; 2],
        exchange: impl Fn(&mut Session, f64) -> f64,
    ) {
        for (j, v) in self.velocity.iter_mut().enumerate() {
            let (x, own, best) = (self.at.x[j], self.own_best.x[j], session.best().x[j]);
            let (r1, r2) = (session.rng.unit(), session.rng.unit());
            *v = inertia * *v + c1 * r1 * (own - x) + c2 * r2 * (best - x) + exchange(session, best - own);
        }
    }
}

/// A first swarm with its velocities.
pub(super) fn launch(session: &mut Session, count: usize) -> Result<Vec<Particle>, End> {
    let agents = session.scatter(count)?;
    let launched = agents.into_iter().map(|at| {
        let aim = session.random_point();
        let velocity = aim.iter().zip(&at.x).map(|(a, x)| 0.5 * (a - x)).collect();
        Particle { own_best: at.clone(), at, velocity }
    });
    Ok(launched.collect())
}

/// Moves everybody by its velocity.
pub(super) fn fly(session: &mut Session, swarm: &mut [Particle]) -> Result<(), End> {
    let places = swarm.iter().map(|p| p.at.x.iter().zip(&p.velocity).map(|(x, v)| x + v).collect());
    let places = session.weigh(places.collect())?;
    for (particle, at) in swarm.iter_mut().zip(places) {
        if at.cost < particle.own_best.cost {
            particle.own_best = at.clone();
        }
        particle.at = at;
    }
    Ok(())
}

/// Linear from the first iteration, 1, to the last.
pub(super) fn ramp([start, end]: [f64; 2], t: usize, all: usize) -> f64 {
    let share = if all > 1 { (t - 1) as f64 / (all - 1) as f64 } else { 0.0 };
    start + (end - start) * share
}
