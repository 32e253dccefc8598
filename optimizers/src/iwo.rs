//! IWO: weeds that seed the more the fitter they are, ever closer to themselves.
//!
//! A weed has floor(`S_min` + (`S_max` - `S_min`) (worst - cost)/(worst - best)) seeds, each the weed plus a normal
//! step in every coordinate of deviation σ = ((T - t)/T)^n (`σ_max` - `σ_min`) + `σ_min`; weeds and seeds compete for
//! `P_max` places.
//!
//! Source: Mehrabian and Lucas, "A novel numerical optimization algorithm inspired from weed colonization", Ecological
//! Informatics 1, 2006; Sengupta et al. (2011), section III and eq. 14. Read as: t = 1..T; σ in sides of the box; where all
//! weeds cost the same, each has `S_max` seeds; equals keep their order, weeds before seeds.
//!
//! Random numbers of a seed: a normal one for each coordinate.
use super::problem::Refusal;
use super::session::{Agent, End, Schedule, Session, WORTHLESS, check_population, costs, sort};
use super::{Optimizer, Setup};

/// The optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iwo {
    /// First weeds and iterations.
    pub schedule: Schedule,
    /// Most weeds, `P_max`.
    pub population_max: usize,
    /// Seeds of the worst and of the best weed, `S_min` and `S_max`.
    pub seeds: [u32; 2],
    /// Deviation of a step at the start and at the end, in sides of the box.
    pub deviation: [f64; 2],
    /// Exponent n of its decay.
    pub modulation: i32,
}

impl Iwo {
    /// The numbers of Sengupta et al. (2011).
    pub const PAPER_004: Self = Self {
        schedule: Schedule { population: 5, iterations: 100 },
        population_max: 10,
        seeds: [0, 3],
        deviation: [0.1, 0.000_04],
        modulation: 3,
    };
    /// Seeds of all weeds in an iteration, about (ours: 1500 evaluations in 100 iterations).
    const PER_ITERATION: usize = 15;

    /// The numbers of Sengupta et al. (2011).
    #[must_use]
    pub fn set_up(setup: Setup) -> Self {
        let paper = Self::PAPER_004;
        Self { schedule: paper.schedule.fitted(setup.evaluations, Self::PER_ITERATION), ..paper }
    }
}

/// Most seeds a weed; a bound against absurd arguments.
const SEEDS_MAX: u32 = 1000;

impl Optimizer for Iwo {
    fn name(&self) -> &'static str {
        "iwo"
    }

    fn check(&self) -> Result<(), Refusal> {
        let name = self.name();
        self.schedule.check(name, 1)?;
        check_population(name, self.population_max)?;
        let [fewest, most] = self.seeds.map(f64::from);
        let expected = "from the fewest to 1000 is possible";
        // One at least: weeds without seeds evaluate nothing, and nothing would end them.
        Refusal::check_number(name, "most seeds", most, [fewest.max(1.0), f64::from(SEEDS_MAX)], expected)?;
        Refusal::check_number(
            name,
            "the exponent",
            f64::from(self.modulation),
            [0.0, 100.0],
            "0 to 100 is possible",
        )?;
        Refusal::check_finite(name, "a deviation", &self.deviation)
    }

    fn search(&self, session: &mut Session) -> Result<(), End> {
        let Schedule { population, iterations } = self.schedule;
        let mut weeds = session.scatter(population)?;
        for t in 1..=iterations {
            let ([start, end], all) = (self.deviation, iterations as f64);
            let deviation = ((all - t as f64) / all).powi(self.modulation) * (start - end) + end;
            let seeds = self.seeds(session, &weeds, deviation);
            weeds.extend(session.weigh(seeds)?);
            sort(&mut weeds);
            weeds.truncate(self.population_max);
            session.iterated(costs(&weeds));
        }
        Ok(())
    }
}

impl Iwo {
    fn seeds(&self, session: &mut Session, weeds: &[Agent], deviation: f64) -> Vec<Vec<f64>> {
        let best = costs(weeds).fold(WORTHLESS, f64::min);
        let worst = costs(weeds).fold(best, f64::max);
        let mut seeds = Vec::new();
        for weed in weeds {
            let share = if worst > best { (worst - weed.cost) / (worst - best) } else { 1.0 };
            for _ in 0..self.seeds_of(share) {
                let sides = session.bounds().iter().map(|[low, high]| high - low);
                let step = |(x, side): (&f64, f64)| x + deviation * side * session.rng.normal();
                seeds.push(weed.x.iter().zip(sides).map(step).collect());
            }
        }
        seeds
    }

    /// floor(`S_min` + (`S_max` - `S_min`) share), and all of them when the share is no number.
    fn seeds_of(&self, share: f64) -> u32 {
        let [fewest, most] = self.seeds;
        let exact = f64::from(fewest) + f64::from(most - fewest) * share;
        (fewest..most).rev().find(|n| f64::from(n + 1) <= exact).map_or(fewest, |n| n + 1)
    }
}
