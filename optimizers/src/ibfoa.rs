//! IBFOA: bacterial foraging with a decay and an elite.
//!
//! The improvement over BFOA: survivors and the probability of dispersal shrink with the running iteration n by
//! exp((1 - n)/N), and one bacterium is exempt from dispersal. As printed that is the first of the list sorted by
//! health; it need not be the best, and chemotaxis may worsen it, so what counts is the best ever seen, which every
//! run returns. [`Exempt::Best`] is what the paper's text describes.
//!
//! Source: Wang et al. (2022), section 3.2 and algorithm 1. The colony is in [`super::bacteria`].
use super::bacteria::{Colony, Exempt, Parameters};
use super::bfoa::{Tumble, case_1};
use super::problem::Refusal;
use super::session::{End, Session};
use super::{Optimizer, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ibfoa {
    /// Its numbers.
    pub parameters: Parameters,
    /// Who is exempt from dispersal.
    pub elite: Exempt,
}

impl Ibfoa {
    /// Case 1 of the paper with its printed elite, and no dispersal after the last reproduction.
    pub const CASE_1: Self = Self { parameters: Parameters::CASE_1, elite: Exempt::Healthiest };

    /// Case 1 of the paper; a budget does not change the schedule, it cuts it.
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        Self { parameters: case_1(setup), ..Self::CASE_1 }
    }
}

impl Optimizer for Ibfoa {
    fn name(&self) -> &'static str {
        "ibfoa"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.parameters.check(self.name())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let (parameters, exempt) = (&self.parameters, self.elite);
        Colony { parameters, heading: Tumble, decays: true, exempt, greedy: false }.live(session)
    }
}
