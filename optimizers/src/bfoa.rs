//! BFOA: bacterial foraging as Passino has it, and a greedy one that takes worsening steps back.
//!
//! Passino's bacteria keep a step that is worse, and anybody may be dispersed, the best one too. Greedy ones move only
//! to where it is better, and the best is exempt: it is lost only to the others' attraction, or to a death for its poor
//! health of before. It is ours, made to see what the decay and elite of Wang et al. (2022) are worth; no paper prints it.
//!
//! The colony is in [`super::bacteria`].
use super::bacteria::{Bacterium, Colony, Exempt, Heading, Parameters, tumble};
use super::problem::Refusal;
use super::session::{Agent, End, Session};
use super::{Optimizer, Reading, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bfoa {
    /// Its numbers.
    pub parameters: Parameters,
    /// Who is exempt from dispersal; Passino exempts none.
    pub exempt: Exempt,
    /// True when a step that worsens is taken back.
    pub greedy: bool,
}

/// A bacterium turns in a random direction and remembers nothing.
pub(super) struct Tumble;

impl Heading for Tumble {
    type Memory = ();

    fn born(&self, _at: &Agent) {}

    fn turn(&self, _bacterium: &mut Bacterium<()>, session: &mut Session) -> Vec<f64> {
        tumble(session)
    }
}

impl Bfoa {
    /// Case 1 of Wang et al. (2022); a budget does not change the schedule, it cuts it.
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        Self { parameters: case_1(setup), exempt: Exempt::Nobody, greedy: false }
    }

    /// The greedy one, with the same numbers.
    #[must_use]
    pub fn greedy(setup: Setup) -> Self {
        Self { parameters: case_1(setup), exempt: Exempt::Best, greedy: true }
    }
}

/// Case 1 in a reading: printed, the bacteria are dispersed after the last reproduction as well.
pub(super) fn case_1(setup: Setup) -> Parameters {
    Parameters { disperses_last: setup.reading == Reading::Printed, ..Parameters::CASE_1 }
}

impl Optimizer for Bfoa {
    fn name(&self) -> &'static str {
        if self.greedy { "greedy-bfoa" } else { "bfoa" }
    }

    fn check(&self) -> Result<(), Refusal> {
        self.parameters.check(self.name())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let &Self { ref parameters, exempt, greedy } = self;
        Colony { parameters, heading: Tumble, decays: false, exempt, greedy }.live(session)
    }
}
