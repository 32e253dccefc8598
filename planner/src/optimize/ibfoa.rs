//! IBFOA: bacterial foraging with a decay and an elite.
//!
//! Bacteria tumble (a step of fixed length in a random direction, kept even when it is worse), swim on while it
//! gets better, split by accumulated health, and are dispersed at random. The improvement over BFOA: survivors
//! and the probability of dispersal shrink with the running iteration n by exp((1 - n)/N), and the first of the
//! sorted list is exempt from dispersal.
//!
//! Source: seed paper 000, section 4, read as: swarming per bacterium over all bacteria (its eq. 3.3),
//! round(survivors * decay) of at least one, refilled in their order; points are clamped to the bounds; no
//! dispersal after the last reproduction, since nothing would follow. The exempt one need not be the best and
//! tumbling may worsen it, so what counts is the best ever seen, which the run returns.
use super::{End, Found, Meter, Optimizer, Problem, Progress, Run};
use crate::draw::Draw;

/// The numbers of the method (the paper's table 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Bacteria, S.
    pub population: usize,
    /// Chemotactic steps a life, `N_c`.
    pub tumbles: usize,
    /// Longest swim in steps, `N_s`.
    pub swims: usize,
    /// Reproductions between dispersals, `N_re`.
    pub reproductions: usize,
    /// Dispersals, `N_ed`.
    pub dispersals: usize,
    /// Survivors of the first reproduction, `S_r`.
    pub survivors: usize,
    /// Length of a step, `C_i`, in the unit of the coordinates.
    pub step: f64,
    /// Probability of the first dispersal, `P_ed`.
    pub dispersal_probability: f64,
    /// Depth d and width `w_a` of the attraction between bacteria.
    pub attraction: [f64; 2],
    /// Height h and width `w_r` of the repulsion between bacteria.
    pub repulsion: [f64; 2],
}

impl Parameters {
    /// Case 1 of the paper.
    pub const CASE_1: Self = Self {
        population: 12,
        tumbles: 10,
        swims: 4,
        reproductions: 8,
        dispersals: 6,
        survivors: 6,
        step: 0.2,
        dispersal_probability: 0.2,
        attraction: [0.1, 20.0],
        repulsion: [0.1, 100.0],
    };
}

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ibfoa {
    /// Its numbers.
    pub parameters: Parameters,
}

impl Optimizer for Ibfoa {
    fn name(&self) -> &'static str {
        "IBFOA"
    }

    fn minimise(&self, problem: &dyn Problem, run: Run) -> Found {
        let mut colony = Colony {
            p: &self.parameters,
            meter: Meter::new(problem, run.is_over, run.evaluations_max),
            draw: Draw::new(run.seed, 0),
            bacteria: Vec::new(),
            iteration: 0,
        };
        let end = colony.live(run.guesses, run.watch).err().unwrap_or(End::Done);
        let current = colony.current();
        colony.meter.found(colony.iteration, current, end)
    }
}

/// One bacterium.
#[derive(Clone, Debug)]
struct Bacterium {
    x: Vec<f64>,
    /// Cost of `x` without swarming.
    cost: f64,
    /// Sum of costs over its life; low is healthy.
    health: f64,
}

struct Colony<'a> {
    p: &'a Parameters,
    meter: Meter<'a>,
    draw: Draw,
    bacteria: Vec<Bacterium>,
    iteration: usize,
}

impl Colony<'_> {
    fn live(&mut self, guesses: &[Vec<f64>], watch: &mut dyn FnMut(&Progress)) -> Result<(), End> {
        self.found_colony(guesses)?;
        for dispersal in 0..self.p.dispersals {
            for _ in 0..self.p.reproductions {
                self.one_life(watch)?;
                self.reproduce();
            }
            if dispersal + 1 < self.p.dispersals {
                self.disperse()?;
            }
        }
        Ok(())
    }

    fn found_colony(&mut self, guesses: &[Vec<f64>]) -> Result<(), End> {
        let dimensions = self.meter.problem.bounds().len();
        for i in 0..self.p.population.max(1) {
            let guess = guesses.get(i).filter(|g| g.len() == dimensions).cloned();
            let mut x = guess.unwrap_or_else(|| self.random_point());
            let cost = self.meter.cost(&mut x)?;
            self.bacteria.push(Bacterium { x, cost, health: 0.0 });
        }
        Ok(())
    }

    fn random_point(&mut self) -> Vec<f64> {
        let bounds = self.meter.problem.bounds();
        bounds.iter().map(|[low, high]| self.draw.within(*low, *high)).collect()
    }

    fn one_life(&mut self, watch: &mut dyn FnMut(&Progress)) -> Result<(), End> {
        for bacterium in &mut self.bacteria {
            bacterium.health = 0.0;
        }
        for _ in 0..self.p.tumbles {
            for i in 0..self.bacteria.len() {
                self.tumble_and_swim(i)?;
            }
            self.iteration += 1;
            let (iteration, evaluations) = (self.iteration, self.meter.done);
            let (current, best) = (self.current(), self.meter.best.1);
            watch(&Progress { iteration, evaluations, current, best });
        }
        for i in 0..self.bacteria.len() {
            self.bacteria[i].health += self.bacteria[i].cost + self.swarming(i);
        }
        Ok(())
    }

    fn tumble_and_swim(&mut self, i: usize) -> Result<(), End> {
        let mut last = self.bacteria[i].cost + self.swarming(i);
        self.bacteria[i].health += last;
        let direction = self.direction();
        let mut now = self.step(i, &direction)?;
        for _ in 0..self.p.swims {
            if now >= last {
                break;
            }
            last = now;
            now = self.step(i, &direction)?;
        }
        Ok(())
    }

    /// A unit vector: uniform in the cube, as the paper has it, then normalised.
    fn direction(&mut self) -> Vec<f64> {
        let dimensions = self.meter.problem.bounds().len();
        let mut direction: Vec<f64> = (0..dimensions).map(|_| self.draw.within(-1.0, 1.0)).collect();
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length > 0.0 {
            direction.iter_mut().for_each(|x| *x /= length);
        }
        direction
    }

    /// Moves a bacterium by one step; its cost there, with swarming.
    fn step(&mut self, i: usize, direction: &[f64]) -> Result<f64, End> {
        let mut x = self.bacteria[i].x.clone();
        for (x, d) in x.iter_mut().zip(direction) {
            *x += self.p.step * d;
        }
        let cost = self.meter.cost(&mut x)?;
        (self.bacteria[i].x, self.bacteria[i].cost) = (x, cost);
        Ok(cost + self.swarming(i))
    }

    /// Attraction and repulsion by all bacteria; its own term is h - d.
    fn swarming(&self, i: usize) -> f64 {
        let ([d, w_a], [h, w_r]) = (self.p.attraction, self.p.repulsion);
        let here = &self.bacteria[i].x;
        let terms = self.bacteria.iter().map(|b| {
            let r2: f64 = b.x.iter().zip(here).map(|(x, y)| (x - y) * (x - y)).sum();
            h * (-w_r * r2).exp() - d * (-w_a * r2).exp()
        });
        terms.sum()
    }

    /// exp((1 - n)/N): from 1 down to about 0.37 over the whole run.
    fn decay(&self) -> f64 {
        let all = self.p.tumbles * self.p.reproductions * self.p.dispersals;
        ((1.0 - self.iteration as f64) / all.max(1) as f64).exp()
    }

    fn reproduce(&mut self) {
        // A stable sort: equals keep their order, and so the seed its answer.
        self.bacteria.sort_by(|a, b| a.health.total_cmp(&b.health));
        let survivors = survivors(self.p.survivors, self.decay(), self.bacteria.len());
        for i in survivors..self.bacteria.len() {
            self.bacteria[i] = self.bacteria[i % survivors].clone();
        }
    }

    fn disperse(&mut self) -> Result<(), End> {
        let probability = self.p.dispersal_probability * self.decay();
        for i in 1..self.bacteria.len() {
            if self.draw.unit() < probability {
                let mut x = self.random_point();
                let cost = self.meter.cost(&mut x)?;
                (self.bacteria[i].x, self.bacteria[i].cost) = (x, cost);
            }
        }
        Ok(())
    }

    fn current(&self) -> f64 {
        self.bacteria.iter().map(|b| b.cost).fold(f64::INFINITY, f64::min)
    }
}

/// round(`S_r` * decay), at least one and at most all.
fn survivors(first: usize, decay: f64, all: usize) -> usize {
    (1..=all).rev().find(|n| *n as f64 <= first as f64 * decay + 0.5).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// Sum of (x - 0.3)^2; notes every point that it was asked.
    struct Bowl {
        bounds: Vec<[f64; 2]>,
        asked: RefCell<Vec<Vec<f64>>>,
    }

    impl Bowl {
        fn new(dimensions: usize) -> Self {
            Self { bounds: vec![[-1.0, 1.0]; dimensions], asked: RefCell::default() }
        }
    }

    impl Problem for Bowl {
        fn bounds(&self) -> &[[f64; 2]] {
            &self.bounds
        }
        fn cost(&self, x: &[f64]) -> f64 {
            self.asked.borrow_mut().push(x.to_vec());
            x.iter().map(|x| (x - 0.3) * (x - 0.3)).sum()
        }
    }

    fn run(
        bowl: &Bowl,
        p: Parameters,
        evaluations_max: usize,
        guesses: &[Vec<f64>],
    ) -> (Found, Vec<Progress>) {
        let mut seen = Vec::new();
        let (is_over, mut watch) = (|| false, |p: &Progress| seen.push(*p));
        let run = Run { seed: 5, evaluations_max, guesses, is_over: &is_over, watch: &mut watch };
        let found = Ibfoa { parameters: p }.minimise(bowl, run);
        (found, seen)
    }

    /// Goal: the order of tumbling, swimming and health is the paper's.
    /// Method: two bacteria on a line, two tumbles, written out without loops over the colony; only the random
    /// directions come from the same stream.
    #[test]
    fn ibfoa_two_bacteria_on_a_line_walk_as_by_hand() {
        let tiny = Parameters {
            population: 2,
            tumbles: 2,
            reproductions: 1,
            dispersals: 1,
            survivors: 1,
            ..Parameters::CASE_1
        };
        let bowl = Bowl::new(1);
        let (found, seen) = run(&bowl, tiny, 1_000, &[vec![0.0], vec![0.9]]);

        let cost = |x: f64| (x - 0.3) * (x - 0.3);
        let swarm = |x: f64, other: f64| {
            let r2 = (x - other) * (x - other);
            (0.1 - 0.1) + 0.1 * (-100.0 * r2).exp() - 0.1 * (-20.0 * r2).exp()
        };
        let mut draw = Draw::new(5, 0);
        let mut asked = vec![0.0, 0.9];
        let (mut x, mut y) = (0.0_f64, 0.9_f64);
        let mut walk = |x: f64, other: f64, asked: &mut Vec<f64>| {
            let sign = draw.within(-1.0, 1.0).signum();
            let mut last = cost(x) + swarm(x, other);
            let mut at = (x + 0.2 * sign).clamp(-1.0, 1.0);
            asked.push(at);
            let mut swims = 0;
            while swims < 4 && cost(at) + swarm(at, other) < last {
                last = cost(at) + swarm(at, other);
                at = (at + 0.2 * sign).clamp(-1.0, 1.0);
                asked.push(at);
                swims += 1;
            }
            at
        };
        for _ in 0..2 {
            x = walk(x, y, &mut asked);
            y = walk(y, x, &mut asked);
        }
        let theirs: Vec<f64> = bowl.asked.borrow().iter().map(|p| p[0]).collect();
        assert_eq!(theirs.len(), asked.len(), "{theirs:?} against {asked:?}");
        for (a, b) in theirs.iter().zip(&asked) {
            assert!((a - b).abs() < 1e-12, "{theirs:?} against {asked:?}");
        }
        let best = asked.iter().map(|x| cost(*x)).fold(f64::INFINITY, f64::min);
        assert!((found.cost - best).abs() < 1e-12, "{} against {best}", found.cost);
        assert_eq!((seen.len(), found.end, found.progress.evaluations), (2, End::Done, asked.len()));
    }

    #[test]
    fn ibfoa_case_1_never_loses_its_best_although_the_colony_does() {
        let (found, seen) = run(&Bowl::new(18), Parameters::CASE_1, usize::MAX, &[]);
        assert_eq!(seen.len(), 480);
        assert!(seen.windows(2).all(|p| p[1].best <= p[0].best), "the best so far rose");
        let rises = seen.windows(2).filter(|p| p[1].current > p[0].current).count();
        assert!(rises > 0, "tumbling keeps worse points, so the colony's best must rise now and then");
        // A random point costs 18 (1/3 + 0.09) = 7.6 on average; steps of fixed length cannot get arbitrarily near.
        assert!(found.cost < 0.76, "cost {}", found.cost);
        assert!(found.cost <= seen.last().expect("480").current);
    }

    #[test]
    fn ibfoa_guess_at_the_optimum_is_returned() {
        let (found, _) = run(&Bowl::new(4), Parameters::CASE_1, 100, &[vec![0.3; 4]]);
        assert_eq!((found.cost.to_bits(), found.end), (0.0_f64.to_bits(), End::Budget));
        assert_eq!(found.progress.evaluations, 100);
    }

    #[test]
    fn ibfoa_cut_before_the_first_evaluation_finds_nothing_and_says_so() {
        let (is_over, mut watch) = (|| true, |_: &Progress| ());
        let run = Run { seed: 1, evaluations_max: 9, guesses: &[], is_over: &is_over, watch: &mut watch };
        let found = Ibfoa { parameters: Parameters::CASE_1 }.minimise(&Bowl::new(2), run);
        assert_eq!((found.x.len(), found.end), (0, End::Cut));
    }

    #[test]
    fn survivors_shrink_from_half_to_a_fifth_as_the_paper_has_it() {
        // Six of twelve: round(6 * 1) = 6, round(6 * 0.3687) = round(2.2) = 2; never none, never more than all.
        assert_eq!([survivors(6, 1.0, 12), survivors(6, (-479.0_f64 / 480.0).exp(), 12)], [6, 2]);
        assert_eq!([survivors(6, 0.0, 12), survivors(60, 1.0, 12)], [1, 12]);
    }
}
