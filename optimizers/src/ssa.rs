//! SSA: sparrows that produce, scrounge and keep watch.
//!
//! The best fifth produces: without alarm a sparrow shrinks to x exp(-i/(α T)), with it it takes a normal step along
//! the diagonal. The hungry half flies to Q exp((worst - x)/i²), the others settle round the best producer. A fifth
//! keeps watch: at the edge they move to best + β |x - best|, the best itself to x + K |x - worst|/(f - worst's f).
//! A sparrow stays unless the new place is better.
//!
//! Source: Xue and Shen, "A Novel Swarm Intelligence Optimization Approach: Sparrow Search Algorithm", Systems
//! Science and Control Engineering 8(1), 2020; Li, Xing and Qin (2025) compares with it. Read as: i is the rank by cost from
//! 1; one α, Q, β, K a sparrow; A⁺ L with A of random signs is the mean of the signed distances for every coordinate
//! (so that scroungers move along the diagonal); the best new place of a producer is the one to settle round; whether
//! a place is taken is decided when all have moved, and then the watch moves. Shrinking draws to the origin, and both diagonals favour problems whose optimum lies on one.
//!
//! Random numbers: the alarm; for each sparrow in rank: α or Q, Q, or a sign for each coordinate; then for each on
//! watch: who it is, and β or K.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, costs, keep_better, sort};
use super::{Gwo, Optimizer, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ssa {
    /// Sparrows and iterations.
    pub schedule: Schedule,
    /// Share that produces.
    pub producers: f64,
    /// Share that keeps watch.
    pub watch: f64,
    /// Safety threshold ST: an alarm above it makes the producers fly.
    pub safety: f64,
}

/// Keeps a division by the difference of two costs possible.
const EPSILON: f64 = 1e-50;

impl Ssa {
    /// Share of producers, share on watch, safety threshold.
    pub const AUTHORS: [f64; 3] = [0.2, 0.2, 0.8];

    /// The authors' numbers, population and iterations of Li, Xing and Qin (2025).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let [producers, watch, safety] = Self::AUTHORS;
        let population = Gwo::PAPER_001.population;
        let per_iteration = population + count(population, watch);
        Self { schedule: Gwo::PAPER_001.fitted(setup.evaluations, per_iteration), producers, watch, safety }
    }
}

/// round(share * all), at least one and at most all.
fn count(all: usize, share: f64) -> usize {
    (1..=all).rev().find(|n| *n as f64 <= all as f64 * share + 0.5).unwrap_or(1)
}

impl Optimizer for Ssa {
    fn name(&self) -> &'static str {
        "ssa"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.schedule.check(self.name(), 2)?;
        for (what, value) in [
            ("the share of producers", self.producers),
            ("the share on watch", self.watch),
            ("the safety threshold", self.safety),
        ] {
            Refusal::check_number(self.name(), what, value, [0.0, 1.0], "from 0 to 1 is possible")?;
        }
        Ok(())
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Schedule { population, iterations } = self.schedule;
        let mut flock = session.scatter(population)?;
        for _ in 0..iterations {
            sort(&mut flock);
            let moved = self.forage(session, &flock)?;
            keep_better(&mut flock, moved);
            self.keep_watch(session, &mut flock)?;
            session.iterated(costs(&flock));
        }
        Ok(())
    }
}

impl Ssa {
    /// New places of producers and scroungers of a sorted flock.
    fn forage(&self, session: &mut Session, flock: &[Agent]) -> Result<Vec<Agent>, End> {
        let (producers, others) = flock.split_at(count(flock.len(), self.producers));
        let alarm = session.rng.unit();
        let ranked = producers.iter().enumerate();
        let places = ranked.map(|(i, p)| self.produce(session, &p.x, alarm, (i + 1) as f64)).collect();
        let mut moved = session.weigh(places)?;
        let lead = moved.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).cloned().unwrap_or_default();
        let worst = flock.last().cloned().unwrap_or_default();

        let mut places = Vec::with_capacity(others.len());
        for (i, sparrow) in others.iter().enumerate() {
            let rank = producers.len() + i + 1;
            places.push(if 2 * rank > flock.len() {
                let (q, rank2) = (session.rng.normal(), (rank * rank) as f64);
                sparrow.x.iter().zip(&worst.x).map(|(x, w)| q * ((w - x) / rank2).exp()).collect()
            } else {
                settle(session, &sparrow.x, &lead.x)
            });
        }
        moved.extend(session.weigh(places)?);
        Ok(moved)
    }

    fn produce(&self, session: &mut Session, x: &[f64], alarm: f64, rank: f64) -> Vec<f64> {
        if alarm < self.safety {
            // In (0, 1]: no division by zero.
            let alpha = 1.0 - session.rng.unit();
            let shrink = (-rank / (alpha * self.schedule.iterations as f64)).exp();
            x.iter().map(|x| x * shrink).collect()
        } else {
            let q = session.rng.normal();
            x.iter().map(|x| x + q).collect()
        }
    }

    fn keep_watch(&self, session: &mut Session, flock: &mut [Agent]) -> Result<(), End> {
        let by_cost = |a: &&Agent, b: &&Agent| a.cost.total_cmp(&b.cost);
        let best = flock.iter().min_by(by_cost).cloned().unwrap_or_default();
        let worst = flock.iter().max_by(by_cost).cloned().unwrap_or_default();
        let mut on_watch: Vec<usize> = Vec::new();
        let mut moved = Vec::new();
        for _ in 0..count(flock.len(), self.watch) {
            let i = session.rng.index_except(flock.len(), &on_watch);
            let at = on_watch.partition_point(|w| *w < i);
            on_watch.insert(at, i);
            moved.push((i, flee(session, &flock[i], &best, &worst)));
        }
        let (who, points): (Vec<usize>, Vec<Vec<f64>>) = moved.into_iter().unzip();
        for (i, new) in who.into_iter().zip(session.weigh(points)?) {
            if new.cost < flock[i].cost {
                flock[i] = new;
            }
        }
        Ok(())
    }
}

/// Round a producer: its place and, for every coordinate alike, the mean of the distances with random signs.
fn settle(session: &mut Session, x: &[f64], producer: &[f64]) -> Vec<f64> {
    let signed = |session: &mut Session, (x, p): (&f64, &f64)| {
        let sign = if session.rng.unit() < 0.5 { -1.0 } else { 1.0 };
        sign * (x - p).abs()
    };
    let sum: f64 = x.iter().zip(producer).map(|pair| signed(session, pair)).sum();
    producer.iter().map(|p| p + sum / x.len() as f64).collect()
}

fn flee(session: &mut Session, sparrow: &Agent, best: &Agent, worst: &Agent) -> Vec<f64> {
    let x = &sparrow.x;
    if sparrow.cost > best.cost {
        let beta = session.rng.normal();
        x.iter().zip(&best.x).map(|(x, b)| b + beta * (x - b).abs()).collect()
    } else {
        let k = session.rng.within(-1.0, 1.0);
        let gap = sparrow.cost - worst.cost + EPSILON;
        x.iter().zip(&worst.x).map(|(x, w)| x + k * (x - w).abs() / gap).collect()
    }
}
