//! BFOA: bacterial foraging as Passino has it. The colony is in [`super::bacteria`].
use super::bacteria::{Bacterium, Colony, Exempt, Heading, Parameters, tumble};
use super::problem::Refusal;
use super::session::{Agent, End, Session};
use super::{Optimizer, Reading, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bfoa {
    /// Its numbers.
    pub parameters: Parameters,
}

/// A bacterium turns in a random direction and remembers nothing.
pub(super) struct Tumble;

impl Heading for Tumble {
    type Memory = ();

    fn born(&self, _at: &Agent) {}

    fn turn(&self, _bacterium: &mut Bacterium<()>, session: &mut Session) -> Vec<f64> {
        tumble(session)
    }

    fn moved(&self, _bacterium: &mut Bacterium<()>) {}
}

impl Bfoa {
    /// Case 1 of seed paper 000; a budget does not change the schedule, it cuts it.
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        Self { parameters: case_1(setup) }
    }
}

/// Case 1 in a reading: printed, the bacteria are dispersed after the last reproduction as well.
pub(super) fn case_1(setup: Setup) -> Parameters {
    Parameters { disperses_last: setup.reading == Reading::Printed, ..Parameters::CASE_1 }
}

impl Optimizer for Bfoa {
    fn name(&self) -> &'static str {
        "bfoa"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.parameters.check(self.name())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let (parameters, exempt) = (&self.parameters, Exempt::Nobody);
        Colony { parameters, heading: Tumble, decays: false, exempt }.live(session)
    }
}
