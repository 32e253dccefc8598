//! ISMA: slime mould with a chaotic start, another shrinking, and three greedy searches.
//!
//! To SMA come: a first population from the Bernoulli map; vc = ((exp((T - t)/(T - 1)) - 1)/(e - 1))^κ; with
//! probability `P_t` a crossover with the best, whose better child replaces a worse mould; a bee's search of one
//! coordinate; and the vertex of a parabola through two random moulds and the best, coordinate by coordinate.
//!
//! Source: Li, Xing and Qin (2025), eq. 27 to 32. Corrected against printed: the parts of [`super::sma`]; vc is the bound of a
//! random factor (printed: the factor itself, always positive, which draws everybody to the origin); L is a Laplace
//! variate μ + λ ln 2r, μ - λ ln(2 - 2r) (printed: μ - λ ln r, μ + λ ln r, which leaves a gap between its halves);
//! the vertex counts only where the parabola opens upwards (printed: it may be a maximum). In both readings: where
//! the parabola's denominator vanishes the best's coordinate stays. The paper gives no order, no rule of acceptance
//! and no `P_t`, μ, λ: the move of SMA is always made, then the three searches follow over the whole population one
//! after another, each child taken only if better; `P_t` = 0.5, μ = 0, λ = 0.5, one L a crossover; one chain of the
//! map for the whole population, restarted when it meets 0 or 1.
//!
//! Random numbers: the chain's start (and restarts); SMA's; for each mould whether it crosses and r; for each mould
//! the coordinate, the other mould, φ, Ω; for each mould the two others.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, costs, keep_better};
use super::sma::{Pulse, Shrink, Sma};
use super::{Gwo, Optimizer, Reading, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isma {
    /// What it shares with SMA.
    pub sma: Sma,
    /// Probability of a crossover, `P_t`.
    pub crossover: f64,
    /// Centre μ and width λ of the crossover's shares.
    pub laplace: [f64; 2],
    /// What is left out, to see what it is good for; none in the paper.
    pub left_out: Option<Addition>,
}

/// What ISMA adds to SMA.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Addition {
    /// The first population from a chaotic map.
    Chaos,
    /// The feedback factor; without it SMA's bound.
    Feedback,
    /// The crossover with the best.
    Crossover,
    /// The bees' search.
    Bees,
    /// The vertices of parabolas.
    Parabolas,
}

impl Addition {
    /// All five, in the order of the paper.
    pub const ALL: [Self; 5] = [Self::Chaos, Self::Feedback, Self::Crossover, Self::Bees, Self::Parabolas];

    /// In a row of a table.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Chaos => "chaotic start",
            Self::Feedback => "feedback factor",
            Self::Crossover => "crossover",
            Self::Bees => "bees' search",
            Self::Parabolas => "quadratic interpolation",
        }
    }

    /// At the start of a sentence.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Chaos => "A chaotic first population",
            Self::Feedback => "The feedback factor",
            Self::Crossover => "The crossover",
            Self::Bees => "The bees' search",
            Self::Parabolas => "Quadratic interpolation",
        }
    }

    /// Evaluations of a mould in an iteration that it takes.
    fn evaluations(self) -> usize {
        match self {
            Self::Chaos | Self::Feedback => 0,
            Self::Crossover | Self::Bees | Self::Parabolas => 1,
        }
    }
}

/// Parameter μ of the Bernoulli map.
const BERNOULLI: f64 = 0.4;
/// Exponent κ of the feedback factor.
const FEEDBACK: i32 = 4;
/// Largest pull Ω of the best in the bee's search.
const PULL_MAX: f64 = 1.5;
/// Evaluations of a mould in an iteration, on average: move, half a crossover of two, bee, parabola.
const PER_MOULD: usize = 4;

impl Isma {
    /// Our `P_t`, μ and λ; the paper gives none.
    pub const UNPRINTED: [f64; 3] = [0.5, 0.0, 0.5];

    /// The numbers of Li, Xing and Qin (2025).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        Self::without(setup, None)
    }

    /// The same without one of its additions, with more iterations for the same evaluations.
    #[must_use]
    pub fn without(setup: Setup, left_out: Option<Addition>) -> Self {
        let [crossover, mu, lambda] = Self::UNPRINTED;
        let crossover = if left_out == Some(Addition::Crossover) { 0.0 } else { crossover };
        let per_mould = PER_MOULD - left_out.map_or(0, Addition::evaluations);
        let schedule = Gwo::PAPER_001.fitted(setup.evaluations, per_mould * Gwo::PAPER_001.population);
        Self { sma: Sma { schedule, ..Sma::set_up(setup) }, crossover, laplace: [mu, lambda], left_out }
    }
}

impl Optimizer for Isma {
    fn name(&self) -> &'static str {
        "isma"
    }

    fn check(&self) -> Result<(), Refusal> {
        self.sma.schedule.check(self.name(), 2)?;
        let within = Refusal::check_number;
        within(self.name(), "z", self.sma.restart, [0.0, 1.0], "from 0 to 1 is possible")?;
        within(
            self.name(),
            "the crossover's probability",
            self.crossover,
            [0.0, 1.0],
            "from 0 to 1 is possible",
        )?;
        Refusal::check_finite(self.name(), "the crossover's centre or width", &self.laplace)
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Schedule { population, iterations } = self.sma.schedule;
        let has = |addition: Addition| self.left_out != Some(addition);
        let mut moulds = if has(Addition::Chaos) {
            let first = chaotic(session, population);
            session.weigh(first)?
        } else {
            session.scatter(population)?
        };
        for t in 1..=iterations {
            let moved = self.sma.pulse(session, &mut moulds, self.feedback(t));
            moulds = session.weigh(moved)?;
            self.cross(session, &mut moulds)?;
            if has(Addition::Bees) {
                let bees = (0..moulds.len()).map(|i| bee(session, &moulds, i)).collect();
                let bees = session.weigh(bees)?;
                keep_better(&mut moulds, bees);
            }
            if has(Addition::Parabolas) {
                let vertices = moulds.iter().map(|_| self.vertex(session, &moulds)).collect();
                let vertices = session.weigh(vertices)?;
                keep_better(&mut moulds, vertices);
            }
            session.iterated(costs(&moulds));
        }
        Ok(())
    }
}

/// The guesses, then points of one chain of the Bernoulli map.
fn chaotic(session: &mut Session, population: usize) -> Vec<Vec<f64>> {
    let mut link = 0.0;
    let bounds = session.bounds();
    let mut point = |session: &mut Session| -> Vec<f64> {
        let coordinate = |&[low, high]: &[f64; 2]| {
            link = if link <= 1.0 - BERNOULLI {
                link / (1.0 - BERNOULLI)
            } else {
                (link - 1.0 + BERNOULLI) / BERNOULLI
            };
            if !(link > 0.0 && link < 1.0) {
                link = session.rng.unit();
            }
            low + (high - low) * link
        };
        bounds.iter().map(coordinate).collect()
    };
    (0..population).map(|i| session.guess(i).unwrap_or_else(|| point(session))).collect()
}

impl Isma {
    fn feedback(&self, t: usize) -> Pulse {
        let (t, all) = (t as f64, self.sma.schedule.iterations as f64);
        // A single iteration has no slope: it is the first and the last.
        let share = if all > 1.0 { (all - t) / (all - 1.0) } else { 0.0 };
        let factor = (share.exp_m1() / 1.0_f64.exp_m1()).powi(FEEDBACK);
        let shrink = match self.sma.reading {
            _ if self.left_out == Some(Addition::Feedback) => Shrink::Within(1.0 - t / all),
            Reading::Corrected => Shrink::Within(factor),
            Reading::Printed => Shrink::By(factor),
        };
        Pulse { approach: (1.0 - t / all).atanh(), shrink }
    }

    fn cross(&self, session: &mut Session, moulds: &mut [Agent]) -> Result<(), End> {
        let mut parents = Vec::new();
        let mut children = Vec::new();
        for (i, mould) in moulds.iter().enumerate() {
            if session.rng.unit() < self.crossover {
                let l = self.share(session.rng.unit());
                let pairs = || mould.x.iter().zip(&session.best().x);
                children.push(pairs().map(|(x, b)| l * x + (1.0 - l) * b).collect());
                children.push(pairs().map(|(x, b)| l * b + (1.0 - l) * x).collect());
                parents.push(i);
            }
        }
        let children = session.weigh(children)?;
        for (i, pair) in parents.into_iter().zip(children.chunks(2)) {
            for child in pair {
                if child.cost < moulds[i].cost {
                    moulds[i] = child.clone();
                }
            }
        }
        Ok(())
    }

    /// The share L of a uniform random number, which is kept off the ends of its range.
    fn share(&self, r: f64) -> f64 {
        let ([mu, lambda], r) = (self.laplace, r.max(f64::EPSILON));
        match (self.sma.reading, r <= 0.5) {
            (Reading::Corrected, true) => mu + lambda * (2.0 * r).ln(),
            (Reading::Corrected, false) => mu - lambda * (2.0 * (1.0 - r)).ln(),
            (Reading::Printed, true) => mu - lambda * r.ln(),
            (Reading::Printed, false) => mu + lambda * r.ln(),
        }
    }

    /// The vertex of the parabolas through two random moulds and the best.
    fn vertex(&self, session: &mut Session, moulds: &[Agent]) -> Vec<f64> {
        let i = session.rng.index(moulds.len());
        let k = session.rng.index_except(moulds.len(), &[i]);
        let (x, y, z) = (&moulds[i], &moulds[k], session.best());
        let coordinates = x.x.iter().zip(&y.x).zip(&z.x);
        let vertex = |((&p, &q), &r): ((&f64, &f64), &f64)| {
            let slope = (r - q) * x.cost + (p - r) * y.cost + (q - p) * z.cost;
            let top = (r * r - q * q) * x.cost + (p * p - r * r) * y.cost + (q * q - p * p) * z.cost;
            // The parabola's leading coefficient is slope / ((r - q) (p - r) (q - p)), with its sign reversed.
            let is_minimum = slope * (r - q) * (p - r) * (q - p) < 0.0;
            let at = top / (2.0 * slope);
            let counts = is_minimum || self.sma.reading == Reading::Printed;
            if counts && at.is_finite() { at } else { r }
        };
        coordinates.map(vertex).collect()
    }
}

/// One random coordinate moved against another mould and towards the best.
fn bee(session: &mut Session, moulds: &[Agent], i: usize) -> Vec<f64> {
    let mut x = moulds[i].x.clone();
    let j = session.rng.index(x.len());
    let k = session.rng.index_except(moulds.len(), &[i]);
    let (phi, omega) = (session.rng.within(-1.0, 1.0), session.rng.within(0.0, PULL_MAX));
    x[j] += phi * (x[j] - moulds[k].x[j]) + omega * (session.best().x[j] - x[j]);
    x
}
