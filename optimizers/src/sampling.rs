//! Uniform random sampling: what every method has to beat.
//!
//! Not registered: not for planning. Claims about methods are compared with it.
//!
//! Random numbers: a population, and another.
use super::Optimizer;
use super::problem::Refusal;
use super::session::{End, Schedule, Session, costs};

/// The baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Points at once, and how often after the first time.
    pub schedule: Schedule,
}

impl Optimizer for Sampling {
    fn name(&self) -> &'static str {
        "sampling"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 1)
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        for _ in 0..=self.schedule.iterations {
            let points = (0..self.schedule.population).map(|_| session.random_point()).collect();
            let agents = session.weigh(points)?;
            session.iterated(costs(&agents));
        }
        Ok(())
    }
}
