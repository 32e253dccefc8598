//! BSO of 2007: bacteria that, after each step of chemotaxis, take a particle's step towards the best of all.
//!
//! Chemotaxis is BFOA's, with its random turns. Then, one bacterium after another, v = w v + c r (best - x), and x + v
//! is where it continues from, better or worse.
//!
//! Source: Biswas, Dasgupta, Das and Abraham, "Synergy of PSO and Bacterial Foraging Optimization", 2007: the best of
//! all pulls, a bacterium's own best does not. w = 0.729 and c = 1.494 are Clerc and Kennedy's; the step is as long as
//! the velocity says. Read as [`super::bso`] is: a random number for every coordinate, velocity starts at nothing,
//! survivors pass it on, who is dispersed starts again.
//!
//! Random numbers of a drift: r for each coordinate.
use super::bacteria::{Bacterium, Colony, Exempt, Heading, Parameters, tumble};
use super::bfoa::case_1;
use super::problem::Refusal;
use super::session::{Agent, End, Session};
use super::{Optimizer, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsoStep {
    /// The colony's numbers.
    pub parameters: Parameters,
    /// Inertia w.
    pub inertia: f64,
    /// Pull of the best of all, c.
    pub pull: f64,
}

impl BsoStep {
    /// Case 1 of Wang et al. (2022); a budget does not change the schedule, it cuts it.
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        Self { parameters: case_1(setup), inertia: 0.729, pull: 1.494 }
    }
}

struct Drift<'a>(&'a BsoStep);

impl Heading for Drift<'_> {
    /// The velocity.
    type Memory = Vec<f64>;

    fn born(&self, at: &Agent) -> Vec<f64> {
        vec![0.0; at.x.len()]
    }

    fn turn(&self, _bacterium: &mut Bacterium<Vec<f64>>, session: &mut Session) -> Vec<f64> {
        tumble(session)
    }

    fn drift(&self, bacterium: &mut Bacterium<Vec<f64>>, session: &mut Session) -> Option<Vec<f64>> {
        let &BsoStep { inertia: w, pull: c, .. } = self.0;
        let (velocity, x) = (&mut bacterium.memory, &bacterium.at.x);
        for (j, v) in velocity.iter_mut().enumerate() {
            let r = session.rng.unit();
            *v = w * *v + c * r * (session.best().x[j] - x[j]);
        }
        Some(x.iter().zip(velocity).map(|(x, v)| x + *v).collect())
    }
}

impl Optimizer for BsoStep {
    fn name(&self) -> &'static str {
        "bso-step"
    }

    fn check(&self) -> Result<(), Refusal> {
        Refusal::check_finite(self.name(), "the inertia or the pull", &[self.inertia, self.pull])?;
        self.parameters.check(self.name())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let (parameters, exempt) = (&self.parameters, Exempt::Nobody);
        Colony { parameters, heading: Drift(self), decays: false, exempt, greedy: false }.live(session)
    }
}
