//! Metaheuristics over a box: one trait, one file a method, one line each in the [registry](by_name).
//!
//! A method moves points; everything else is done once, in [`Session`]: seeding, clamping, counting evaluations,
//! budget and cancellation, the best point ever seen beside the best of the population now (the papers' methods
//! lose their best, which is worth seeing). A population is evaluated as one batch whose random numbers were drawn
//! before, so that a [`Problem`] may spread it over threads or vector lanes without changing the answer.
//!
//! What is minimised lives elsewhere: the problems of five papers in [`papers`], the cost of one of them over an arm in
//! [`cost`], the product's own in the planner.
#![forbid(unsafe_code)]
mod bacteria;
mod bfoa;
mod boa;
mod bso;
mod bso_step;
pub mod cost;
mod de;
mod ga;
mod gwo;
mod ibfoa;
mod iepso;
mod isma;
mod iwo;
pub mod papers;
mod problem;
mod pso;
mod registry;
mod sampling;
mod session;
mod sma;
mod ssa;

pub use bacteria::{Exempt, Parameters, Swarming};
pub use bfoa::Bfoa;
pub use boa::Boa;
pub use bso::Bso;
pub use bso_step::BsoStep;
pub use de::De;
pub use ga::Ga;
pub use gwo::Gwo;
pub use ibfoa::Ibfoa;
pub use iepso::{Exchange, Iepso};
pub use isma::{Addition, Isma};
pub use iwo::Iwo;
pub use problem::{Parallel, Problem, Refusal};
pub use pso::{Constants, Pso};
pub use registry::{METHODS, Method, Reading, Setup, Unknown, by_name};
pub use sampling::Sampling;
pub use session::{Agent, End, Progress, Run, Schedule, Session, Solution, WORTHLESS};
pub use sma::Sma;
pub use ssa::Ssa;

/// A metaheuristic.
pub trait Optimizer {
    /// The name under which it is registered.
    fn name(&self) -> &'static str;

    /// Checks the method's own numbers.
    ///
    /// # Errors
    /// Names the number that makes no sense.
    fn check(&self) -> Result<(), Refusal>;

    /// The method itself: moves points until its schedule is done or the session ends it.
    ///
    /// # Errors
    /// Whatever the session answered to an evaluation.
    fn search(&self, session: &mut Session) -> Result<(), End>;

    /// Looks for the least cost.
    ///
    /// # Errors
    /// When the method's numbers or the problem's box make no sense. A budget of nothing is no error: the answer is
    /// then empty and says that the budget ended it.
    fn minimise<'a>(&self, problem: &'a dyn Problem, run: Run<'a>) -> Result<Solution, Refusal> {
        self.check()?;
        let mut session = Session::new(problem, run)?;
        let end = self.search(&mut session).err().unwrap_or(End::Done);
        Ok(session.found(end))
    }
}
