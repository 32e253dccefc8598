//! The colony that BFOA, IBFOA and BSO share: chemotaxis, swarming, reproduction, dispersal.
//!
//! Bacteria turn, take a step of fixed length (kept even when it is worse) and swim on while it gets better; they
//! split by accumulated health, and are dispersed at random. What the three methods differ in is what a colony is
//! given: how a bacterium turns and whether it drifts ([`Heading`]), whether survivors and dispersal decay, who is exempt
//! from dispersal, whether a step that worsens is taken back.
//!
//! Source: Passino, "Biomimicry of Bacterial Foraging", IEEE Control Systems Magazine 22(3), 2002, and
//! Wang et al. (2022), algorithm 1, eq. 3.1 to 3.4. Read as: swarming per bacterium over all bacteria (eq. 3.3 sums over the index
//! that it also evaluates); round(survivors * decay) of at least one, refilled in their order; points are clamped to
//! the bounds; the cost is calculated again after every step of a swim (the algorithm's line 14 does not say so).
//! Bacteria move one after another, each in the field of the others where they are by then, so that this is the one
//! family that cannot be evaluated as a batch.
//!
//! Random numbers: first population; per step of chemotaxis the headings' of all bacteria, then their drifts'; per
//! bacterium that may be dispersed one, and a point when it is.
use super::problem::Refusal;
use super::session::{Agent, End, Session, check_population};

/// The numbers of the colony (the paper's table 1).
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
    /// Survivors of a reproduction (of the first one, where they decay), `S_r`.
    pub survivors: usize,
    /// Length of a step, `C_i`, in the unit of the coordinates; the paper's table calls it `N_t`.
    pub step: f64,
    /// Probability of dispersal (of the first one, where it decays), `P_ed`.
    pub dispersal_probability: f64,
    /// How bacteria attract and repel each other; `None` switches that off.
    pub swarming: Option<Swarming>,
    /// True when bacteria are dispersed after the last reproduction as well, as the paper's algorithm 1 prints it:
    /// the scattered points are evaluated, but nothing follows that could use them.
    pub disperses_last: bool,
}

/// Attraction and repulsion between bacteria.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swarming {
    /// Depth d and width `w_a` of the attraction.
    pub attraction: [f64; 2],
    /// Height h and width `w_r` of the repulsion.
    pub repulsion: [f64; 2],
}

impl Swarming {
    /// The paper's numbers.
    pub const PAPER: Self = Self { attraction: [0.1, 20.0], repulsion: [0.1, 100.0] };
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
        swarming: Some(Swarming::PAPER),
        disperses_last: false,
    };
    /// Case 2 of the paper.
    pub const CASE_2: Self = Self {
        population: 30,
        tumbles: 30,
        reproductions: 20,
        dispersals: 15,
        survivors: 15,
        ..Self::CASE_1
    };

    /// Refuses numbers that make no sense.
    pub(super) fn check(&self, method: &'static str) -> Result<(), Refusal> {
        check_population(method, self.population)?;
        let within = Refusal::check_number;
        // A life without a tumble would evaluate nothing, and nothing would end it.
        let least = self.tumbles.min(self.reproductions) as f64;
        within(method, "tumbles or reproductions", least, [1.0, f64::MAX], "at least 1 of each is needed")?;
        let chance = self.dispersal_probability;
        within(method, "the dispersal probability", chance, [0.0, 1.0], "from 0 to 1 is possible")?;
        within(method, "the step", self.step, [0.0, f64::MAX], "a length of 0 or more is possible")?;
        let swarming = self.swarming.map_or([0.0; 4], |s| {
            let ([d, w_a], [h, w_r]) = (s.attraction, s.repulsion);
            [d, w_a, h, w_r]
        });
        let least = swarming.into_iter().fold(0.0, |a: f64, b| if b >= a { a } else { b });
        within(method, "a number of the swarming", least, [0.0, f64::MAX], "0 or more is possible")
    }

    /// exp((1 - n)/N) at iteration n, which counts from 1: from 1 down to about 0.37 over the whole run (eq. 3.1).
    fn decay(&self, iteration: usize) -> f64 {
        let all = self.tumbles.saturating_mul(self.reproductions).saturating_mul(self.dispersals);
        ((1.0 - iteration as f64) / all.max(1) as f64).exp()
    }
}

/// Who cannot be dispersed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exempt {
    /// None (BFOA).
    Nobody,
    /// The first of the list sorted by health (IBFOA as printed), which need not be the best one now.
    Healthiest,
    /// The one with the least cost now (what the paper's text says that its elite is).
    Best,
}

/// How a bacterium turns.
pub(super) trait Heading {
    /// What a bacterium carries for it.
    type Memory: Clone;
    /// The memory of a bacterium that has just come into being.
    fn born(&self, at: &Agent) -> Self::Memory;
    /// A unit vector, or nothing but zeros.
    fn turn(&self, bacterium: &mut Bacterium<Self::Memory>, session: &mut Session) -> Vec<f64>;
    /// Called after every step.
    fn moved(&self, _bacterium: &mut Bacterium<Self::Memory>) {}
    /// Where it drifts after a step of chemotaxis of all; `None` when it stays.
    fn drift(&self, _bacterium: &mut Bacterium<Self::Memory>, _session: &mut Session) -> Option<Vec<f64>> {
        None
    }
}

/// A unit vector: uniform in the cube, as the paper has it, then normalised.
pub(super) fn tumble(session: &mut Session) -> Vec<f64> {
    let direction = (0..session.dimensions()).map(|_| session.rng.within(-1.0, 1.0)).collect();
    normalised(direction)
}

/// The vector with length 1; one of no length, or of none that is a number, stays as it is.
pub(super) fn normalised(mut vector: Vec<f64>) -> Vec<f64> {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 {
        vector.iter_mut().for_each(|x| *x /= length);
    }
    vector
}

/// One bacterium.
#[derive(Clone, Debug)]
pub(super) struct Bacterium<M> {
    /// Where it is; the cost is without swarming.
    pub(super) at: Agent,
    /// Sum of costs over its life; low is healthy.
    health: f64,
    pub(super) memory: M,
}

/// What a method gives its colony.
pub(super) struct Colony<'p, H: Heading> {
    pub(super) parameters: &'p Parameters,
    pub(super) heading: H,
    /// True when survivors and dispersal decay.
    pub(super) decays: bool,
    pub(super) exempt: Exempt,
    /// True when a step that worsens is taken back.
    pub(super) greedy: bool,
}

impl<H: Heading> Colony<'_, H> {
    /// The whole run of a method.
    pub(super) fn live(&self, session: &mut Session) -> Result<(), End> {
        let mut bacteria = Vec::new();
        let end = self.lives(session, &mut bacteria);
        session.note(bacteria.iter().map(|b| b.at.cost));
        end
    }

    fn lives(&self, session: &mut Session, bacteria: &mut Vec<Bacterium<H::Memory>>) -> Result<(), End> {
        let p = self.parameters;
        for at in session.scatter(p.population)? {
            let memory = self.heading.born(&at);
            bacteria.push(Bacterium { at, health: 0.0, memory });
        }
        for dispersal in 0..p.dispersals {
            for _ in 0..p.reproductions {
                self.one_life(session, bacteria)?;
                self.reproduce(session, bacteria);
            }
            if p.disperses_last || dispersal + 1 < p.dispersals {
                self.disperse(session, bacteria)?;
            }
        }
        Ok(())
    }

    fn one_life(&self, session: &mut Session, bacteria: &mut [Bacterium<H::Memory>]) -> Result<(), End> {
        for bacterium in &mut *bacteria {
            bacterium.health = 0.0;
        }
        for _ in 0..self.parameters.tumbles {
            for i in 0..bacteria.len() {
                self.tumble_and_swim(session, bacteria, i)?;
            }
            for bacterium in &mut *bacteria {
                if let Some(x) = self.heading.drift(bacterium, session) {
                    bacterium.at = session.weigh_one(x)?;
                    self.heading.moved(bacterium);
                }
            }
            session.iterated(bacteria.iter().map(|b| b.at.cost));
        }
        for i in 0..bacteria.len() {
            bacteria[i].health += bacteria[i].at.cost + self.swarming(bacteria, i);
        }
        Ok(())
    }

    fn tumble_and_swim(
        &self,
        session: &mut Session,
        bacteria: &mut [Bacterium<H::Memory>],
        i: usize,
    ) -> Result<(), End> {
        let mut last = bacteria[i].at.cost + self.swarming(bacteria, i);
        bacteria[i].health += last;
        let direction = self.heading.turn(&mut bacteria[i], session);
        // The step of the tumble, then those of the swim.
        for _ in 0..=self.parameters.swims {
            let before = self.greedy.then(|| bacteria[i].at.clone());
            let now = self.step(session, bacteria, i, &direction)?;
            if now >= last {
                if let Some(before) = before {
                    bacteria[i].at = before;
                }
                break;
            }
            last = now;
        }
        Ok(())
    }

    /// Moves a bacterium by one step; its cost there, with swarming.
    fn step(
        &self,
        session: &mut Session,
        bacteria: &mut [Bacterium<H::Memory>],
        i: usize,
        direction: &[f64],
    ) -> Result<f64, End> {
        let step = self.parameters.step;
        let x = bacteria[i].at.x.iter().zip(direction).map(|(x, d)| x + step * d).collect();
        bacteria[i].at = session.weigh_one(x)?;
        self.heading.moved(&mut bacteria[i]);
        Ok(bacteria[i].at.cost + self.swarming(bacteria, i))
    }

    /// Attraction and repulsion by all bacteria; its own term is h - d.
    fn swarming(&self, bacteria: &[Bacterium<H::Memory>], i: usize) -> f64 {
        let Some(Swarming { attraction: [d, w_a], repulsion: [h, w_r] }) = self.parameters.swarming else {
            return 0.0;
        };
        // Further away than this both terms are exactly 0: exp(-746) is, in f64.
        let far2 = 746.0 / w_a.min(w_r);
        let here = &bacteria[i].at.x;
        let mut sum = 0.0;
        'others: for other in bacteria {
            let mut r2 = 0.0;
            for (x, y) in other.at.x.iter().zip(here) {
                r2 += (x - y) * (x - y);
                if r2 > far2 {
                    continue 'others;
                }
            }
            sum += h * (-w_r * r2).exp() - d * (-w_a * r2).exp();
        }
        sum
    }

    fn decay(&self, session: &Session) -> f64 {
        if self.decays { self.parameters.decay(session.iteration()) } else { 1.0 }
    }

    fn reproduce(&self, session: &Session, bacteria: &mut [Bacterium<H::Memory>]) {
        // A stable sort: equals keep their order, and so the seed its answer.
        bacteria.sort_by(|a, b| a.health.total_cmp(&b.health));
        let survivors = survivors(self.parameters.survivors, self.decay(session), bacteria.len());
        for i in survivors..bacteria.len() {
            bacteria[i] = bacteria[i % survivors].clone();
        }
    }

    fn disperse(&self, session: &mut Session, bacteria: &mut [Bacterium<H::Memory>]) -> Result<(), End> {
        let probability = self.parameters.dispersal_probability * self.decay(session);
        let best = (0..bacteria.len()).min_by(|a, b| bacteria[*a].at.cost.total_cmp(&bacteria[*b].at.cost));
        let exempt = match self.exempt {
            Exempt::Nobody => None,
            Exempt::Healthiest => Some(0),
            Exempt::Best => best,
        };
        for (i, bacterium) in bacteria.iter_mut().enumerate() {
            if Some(i) != exempt && session.rng.unit() < probability {
                let x = session.random_point();
                bacterium.at = session.weigh_one(x)?;
                bacterium.memory = self.heading.born(&bacterium.at);
            }
        }
        Ok(())
    }
}

/// round(`S_r` * decay), at least one and at most all.
fn survivors(first: usize, decay: f64, all: usize) -> usize {
    (1..=all).rev().find(|n| *n as f64 <= first as f64 * decay + 0.5).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn survivors_shrink_from_half_to_a_fifth_as_the_paper_has_it() {
        // Six of twelve: round(6 * 1) = 6, round(6 * 0.3687) = round(2.2) = 2; never none, never more than all.
        let p = Parameters::CASE_1;
        assert_eq!([survivors(6, p.decay(1), 12), survivors(6, p.decay(480), 12)], [6, 2]);
        assert_eq!([survivors(6, 0.0, 12), survivors(60, 1.0, 12)], [1, 12]);
    }
}
