//! BSO: bacteria that turn where a particle's velocity points.
//!
//! Everything is BFOA's but the direction: v = w v + `c_1` `r_1` (own best - x) + `c_2` `r_2` (best - x), of which
//! only the direction counts; the step stays. A velocity of nothing gives a random direction.
//!
//! Source: Wang et al. (2022) compares with it and gives neither w nor c; `c_1` = 1.2 and `c_2` = 0.5 are those of the
//! widely copied Matlab program, w = 0.9 is ours. Korani, "Bacterial Foraging Oriented by Particle Swarm
//! Optimization Strategy for PID Tuning", GECCO 2008. Read as: fresh random numbers for every coordinate; survivors
//! pass velocity and own best on to their copies; who is dispersed starts again. This is the reading that "bso" means,
//! since the paper's own reference for BSO (Abd-Elazim and Ali 2013) has it; the other one, of Biswas et al. (2007), is
//! [`super::bso_step`].
//!
//! Random numbers of a turn: `r_1`, `r_2` for each coordinate in turn; then a tumble's if the velocity is nothing.
use super::bacteria::{Bacterium, Colony, Exempt, Heading, Parameters, normalised, tumble};
use super::bfoa::case_1;
use super::problem::Refusal;
use super::session::{Agent, End, Session};
use super::{Optimizer, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bso {
    /// The colony's numbers.
    pub parameters: Parameters,
    /// Inertia w.
    pub inertia: f64,
    /// Pull of a bacterium's own best, `c_1`, and of the best of all, `c_2`.
    pub pulls: [f64; 2],
}

impl Bso {
    /// The inertia when nothing else is said.
    pub const INERTIA: f64 = 0.9;
    /// The pulls when nothing else is said.
    pub const PULLS: [f64; 2] = [1.2, 0.5];

    /// Case 1 of Wang et al. (2022); a budget does not change the schedule, it cuts it.
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        Self { parameters: case_1(setup), inertia: Self::INERTIA, pulls: Self::PULLS }
    }
}

/// Velocity, and the best point of its own life and its ancestors'.
#[derive(Clone)]
struct Flight {
    velocity: Vec<f64>,
    own_best: Agent,
}

struct Fly<'a>(&'a Bso);

impl Heading for Fly<'_> {
    type Memory = Flight;

    fn born(&self, at: &Agent) -> Flight {
        Flight { velocity: vec![0.0; at.x.len()], own_best: at.clone() }
    }

    fn turn(&self, bacterium: &mut Bacterium<Flight>, session: &mut Session) -> Vec<f64> {
        let (w, [c1, c2]) = (self.0.inertia, self.0.pulls);
        let Flight { velocity, own_best } = &mut bacterium.memory;
        for (j, v) in velocity.iter_mut().enumerate() {
            let x = bacterium.at.x[j];
            let (r1, r2) = (session.rng.unit(), session.rng.unit());
            *v = w * *v + c1 * r1 * (own_best.x[j] - x) + c2 * r2 * (session.best().x[j] - x);
        }
        if velocity.iter().all(|v| v.abs() == 0.0) {
            return tumble(session);
        }
        normalised(velocity.clone())
    }

    fn moved(&self, bacterium: &mut Bacterium<Flight>) {
        if bacterium.at.cost < bacterium.memory.own_best.cost {
            bacterium.memory.own_best = bacterium.at.clone();
        }
    }
}

impl Optimizer for Bso {
    fn name(&self) -> &'static str {
        "bso"
    }

    fn check(&self) -> Result<(), Refusal> {
        let [c1, c2] = self.pulls;
        Refusal::check_finite(self.name(), "the inertia or a pull", &[self.inertia, c1, c2])?;
        self.parameters.check(self.name())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let (parameters, exempt) = (&self.parameters, Exempt::Nobody);
        Colony { parameters, heading: Fly(self), decays: false, exempt, greedy: false }.live(session)
    }
}
