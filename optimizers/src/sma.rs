//! SMA: slime mould that pulses between food and itself.
//!
//! The population is sorted; W weighs every mould by how its cost lies between best and worst (more for the better
//! half, less for the other). With probability z a mould starts again. Else, coordinate by coordinate, with
//! probability p = tanh |cost - best| it goes to best + vb (W `X_A` - `X_B`), otherwise to vc x; vb is uniform in
//! -a..a with a = artanh(1 - t/T), vc in -b..b with b = 1 - t/T. The second move shrinks to the origin.
//!
//! Source: Li et al., "Slime mould algorithm", Future Generation Computer Systems 111, 2020; Li, Xing and Qin (2025), eq. 17 to
//! 26. Corrected: tanh (printed: tan); a new start draws every coordinate for itself (printed: one number for all,
//! which puts it on the box's diagonal, where many benchmarks have their optimum). In both readings: logarithm to
//! base 10 (not said; the authors' program), z = 0.04 (the seed's; the original's is 0.03), the missing minus in
//! eq. 21's 1 - t/T, b as the bound of vc (eq. 26 calls it vb), A and B drawn for each coordinate, the best ever seen
//! as best; everybody moves, and then all are evaluated.
//!
//! Random numbers of a mould: whether it starts again; its point (or one number); else for each coordinate r, and then
//! A, B, the weight's, vb's, or vc's.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, costs, sort};
use super::{Gwo, Optimizer, Reading, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sma {
    /// Moulds and iterations.
    pub schedule: Schedule,
    /// Probability of starting again, z.
    pub restart: f64,
    /// Which reading.
    pub reading: Reading,
}

impl Sma {
    /// z of Li, Xing and Qin (2025).
    pub const RESTART: f64 = 0.04;

    /// The numbers of Li, Xing and Qin (2025).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let schedule = Gwo::PAPER_001.fitted(setup.evaluations, Gwo::PAPER_001.population);
        Self { schedule, restart: Self::RESTART, reading: setup.reading }
    }
}

impl Optimizer for Sma {
    fn name(&self) -> &'static str {
        "sma"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 1)?;
        Refusal::check_number(self.name(), "z", self.restart, [0.0, 1.0], "from 0 to 1 is possible")
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let mut moulds = session.scatter(self.schedule.population)?;
        for t in 1..=self.schedule.iterations {
            let left = 1.0 - t as f64 / self.schedule.iterations as f64;
            let pulse = Pulse { approach: left.atanh(), shrink: Shrink::Within(left) };
            let moved = self.pulse(session, &mut moulds, pulse);
            moulds = session.weigh(moved)?;
            session.iterated(costs(&moulds));
        }
        Ok(())
    }
}

/// How far moulds move in one iteration.
#[derive(Clone, Copy)]
pub(super) struct Pulse {
    /// Bound a of vb.
    pub(super) approach: f64,
    pub(super) shrink: Shrink,
}

/// The factor vc.
#[derive(Clone, Copy)]
pub(super) enum Shrink {
    /// Uniform in minus to plus this.
    Within(f64),
    /// This itself.
    By(f64),
}

impl Sma {
    /// Where the moulds go; sorts them.
    pub(super) fn pulse(&self, session: &mut Session, moulds: &mut [Agent], pulse: Pulse) -> Vec<Vec<f64>> {
        sort(moulds);
        let [best, worst] = [moulds.first(), moulds.last()].map(|m| m.map_or(0.0, |m| m.cost));
        let logs = moulds.iter().enumerate().map(|(i, m)| {
            let share = if worst > best { (m.cost - best) / (worst - best) } else { 0.0 };
            let log = (share + 1.0).log10();
            if 2 * i < moulds.len() { log } else { -log }
        });
        let logs: Vec<f64> = logs.collect();
        let moulds = &*moulds;
        let moved = moulds.iter().zip(logs).map(|(mould, log)| self.go(session, moulds, (mould, log), pulse));
        moved.collect()
    }

    fn go(
        &self,
        session: &mut Session,
        moulds: &[Agent],
        (mould, log): (&Agent, f64),
        pulse: Pulse,
    ) -> Vec<f64> {
        if session.rng.unit() < self.restart {
            return self.start_anew(session);
        }
        let gap = (mould.cost - session.best().cost).abs();
        let p = match self.reading {
            Reading::Corrected => gap.tanh(),
            Reading::Printed => gap.tan(),
        };
        let mut moved = mould.x.clone();
        for (j, x) in moved.iter_mut().enumerate() {
            if session.rng.unit() < p {
                let (a, b) = (session.rng.index(moulds.len()), session.rng.index(moulds.len()));
                let weight = 1.0 + session.rng.unit() * log;
                let vb = session.rng.within(-pulse.approach, pulse.approach);
                *x = session.best().x[j] + vb * (weight * moulds[a].x[j] - moulds[b].x[j]);
            } else {
                *x *= match pulse.shrink {
                    Shrink::Within(bound) => session.rng.within(-bound, bound),
                    Shrink::By(factor) => factor,
                };
            }
        }
        moved
    }

    fn start_anew(&self, session: &mut Session) -> Vec<f64> {
        match self.reading {
            Reading::Corrected => session.random_point(),
            Reading::Printed => {
                let share = session.rng.unit();
                session.bounds().iter().map(|[low, high]| low + (high - low) * share).collect()
            }
        }
    }
}
