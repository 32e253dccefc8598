//! GWO: the three best wolves draw the pack, less and less wildly.
//!
//! Each coordinate becomes the mean of three moves l - A |C l - x|, one towards each leader l, with A uniform in
//! -a..a, C uniform in 0..2, and a falling from 2 to 0. There is no greedy step.
//!
//! Source: Mirjalili, Mirjalili and Lewis, "Grey Wolf Optimizer", Advances in Engineering Software 69, 2014;
//! Li, Xing and Qin (2025) compares with it. Read as: the leaders are the three best points that any iteration has seen; in
//! iteration t = 1..T, a = 2 (1 - (t - 1)/T); everybody moves, and then all are evaluated.
//!
//! Random numbers: for each wolf, coordinate and leader in turn: one for A, one for C.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, costs, sort};
use super::{Optimizer, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gwo {
    /// Wolves and iterations.
    pub schedule: Schedule,
}

impl Gwo {
    /// What Li, Xing and Qin (2025) runs every method with.
    pub const PAPER_001: Schedule = Schedule { population: 50, iterations: 5000 };
    /// Where a starts; it ends at 0.
    const A_START: f64 = 2.0;
    const LEADERS: usize = 3;

    /// The numbers of Li, Xing and Qin (2025).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let per_iteration = Self::PAPER_001.population;
        Self { schedule: Self::PAPER_001.fitted(setup.evaluations, per_iteration) }
    }
}

impl Optimizer for Gwo {
    fn name(&self) -> &'static str {
        "gwo"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), Self::LEADERS)
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Schedule { population, iterations } = self.schedule;
        let mut pack = session.scatter(population)?;
        let mut leaders = Vec::new();
        for t in 0..iterations {
            leaders.extend_from_slice(&pack);
            sort(&mut leaders);
            leaders.truncate(Self::LEADERS);
            let a = Self::A_START * (1.0 - t as f64 / iterations as f64);
            let moved = pack.iter().map(|wolf| hunt(session, wolf, &leaders, a)).collect();
            pack = session.weigh(moved)?;
            session.iterated(costs(&pack));
        }
        Ok(())
    }
}

fn hunt(session: &mut Session, wolf: &Agent, leaders: &[Agent], a: f64) -> Vec<f64> {
    let mut moved = wolf.x.clone();
    for (j, x) in moved.iter_mut().enumerate() {
        let mut sum = 0.0;
        for leader in leaders {
            let (big_a, big_c) = (a * (2.0 * session.rng.unit() - 1.0), 2.0 * session.rng.unit());
            sum += leader.x[j] - big_a * (big_c * leader.x[j] - *x).abs();
        }
        *x = sum / leaders.len() as f64;
    }
    moved
}
