//! Numbers that the paper does not print, each over a decade round ours: those of the methods that IEPSO is compared
//! with, how many particles it replaces, and the largest error.
use super::methods::{BUDGET, COST_MARGIN_S, PRECISION_MM, QUICK, contender, counted};
use super::watched::{Contender, Objective, Reaching, reach};
use crate::claim::{Claim, Verdict};
use crate::effect::Effect;
use crate::looks::{self, settle};
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::Level;
use crate::swept::{At, FACTORS, Values, at_some, label, places, words_for_some};
use crate::table::{Cell, Table};
use crate::trial::Sample;
use taustream_optimizers::papers::reach::{FiveJointArm, Reach, Reward};
use taustream_optimizers::{Constants, De, Ga, Iepso, Pso, Reading, Setup};

/// Runs of each setting.
const RUNS: usize = 12;
const QUICK_RUNS: usize = 2;
/// The paper's other four.
const OTHERS: [&str; 4] = ["pso", "spso", "ga", "de"];

/// A number of one method, its value, and the method with it.
struct Swept {
    method: &'static str,
    number: &'static str,
    ours: f64,
    /// A probability ends at 1.
    most: f64,
    make: fn(f64, Setup) -> Contender,
}

fn all(optimizer: impl taustream_optimizers::Optimizer + 'static) -> Contender {
    Contender { optimizer: Box::new(optimizer), per_generation: Pso::PAPER_003.population }
}

fn pso(constants: Constants, setup: Setup) -> Contender {
    all(Pso { constants, ..Pso::standard(setup) })
}

const ORIGINAL: Constants = Constants::ORIGINAL;
const STANDARD: Constants = Constants::STANDARD;
const NONE: f64 = f64::INFINITY;

const SWEPT: [Swept; 9] = [
    Swept {
        method: "pso",
        number: "inertia",
        ours: 1.0,
        most: NONE,
        make: |w, s| pso(Constants { inertia: [w; 2], ..ORIGINAL }, s),
    },
    Swept {
        method: "pso",
        number: "pulls",
        ours: 2.0,
        most: NONE,
        make: |c, s| pso(Constants { pulls: [c; 2], ..ORIGINAL }, s),
    },
    Swept {
        method: "spso",
        number: "inertia",
        ours: 0.729,
        most: NONE,
        make: |w, s| pso(Constants { inertia: [w; 2], ..STANDARD }, s),
    },
    Swept {
        method: "spso",
        number: "pulls",
        ours: 1.494,
        most: NONE,
        make: |c, s| pso(Constants { pulls: [c; 2], ..STANDARD }, s),
    },
    Swept {
        method: "ga",
        number: "blend",
        ours: Ga::BLEND,
        most: NONE,
        make: |blend, s| all(Ga { blend, ..Ga::set_up(s) }),
    },
    Swept {
        method: "ga",
        number: "probability of mutation",
        ours: Ga::MUTATION[0],
        most: 1.0,
        make: |chance, s| all(Ga { mutation: [chance, Ga::MUTATION[1]], ..Ga::set_up(s) }),
    },
    Swept {
        method: "ga",
        number: "deviation of mutation",
        ours: Ga::MUTATION[1],
        most: NONE,
        make: |deviation, s| all(Ga { mutation: [Ga::MUTATION[0], deviation], ..Ga::set_up(s) }),
    },
    Swept {
        method: "de",
        number: "F",
        ours: De::NUMBERS[0],
        most: NONE,
        make: |factor, s| all(De { factor, ..De::set_up(s) }),
    },
    Swept {
        method: "de",
        number: "CR",
        ours: De::NUMBERS[1],
        most: 1.0,
        make: |crossover, s| all(De { crossover, ..De::set_up(s) }),
    },
];
/// Particles replaced in a generation, a decade round our four.
const REPLACED: [usize; 2] = [1, 13];

/// IEPSO with another number of replaced particles.
fn replacing(replaced: usize, budget: usize) -> Contender {
    let setup = Setup { reading: Reading::Corrected, evaluations: Some(budget) };
    let per_generation = Pso::PAPER_003.population + replaced;
    let schedule = Pso::PAPER_003.fitted(Some(budget), per_generation);
    Contender { optimizer: Box::new(Iepso { replaced, schedule, ..Iepso::set_up(setup) }), per_generation }
}

/// Most values at which another method is compared: ours, both of each of its three numbers, and both of the largest error
/// and of the replaced particles.
const VALUES: usize = 11;

/// IEPSO against one other method at one value.
struct Compared {
    label: String,
    other: &'static str,
    /// Error, generation, F.
    effects: [Effect; 3],
    /// Their words.
    words: [Verdict; 3],
}

impl Compared {
    fn of(label: String, ours: &[Reaching], (other, theirs): (&'static str, &[Reaching])) -> Self {
        let of = |runs: &[Reaching], figure: fn(&Reaching) -> f64| -> Vec<f64> {
            counted(&runs.iter().map(figure).collect::<Vec<_>>())
        };
        let effects = |level: Level| {
            let ratio = |figure: fn(&Reaching) -> f64, floor: f64| {
                Effect::ratio(("iepso", &of(ours, figure)), (other, &of(theirs, figure)), (floor, level))
            };
            let cost = |runs: &[Reaching]| Sample::of(runs.iter().map(|r| r.trial.found.cost).collect());
            let margin = (COST_MARGIN_S, "s", level);
            let cost = Effect::difference(("iepso", &cost(ours)), (other, &cost(theirs)), margin);
            [ratio(|r| r.error_mm, PRECISION_MM), ratio(|r| r.generation, 1.0), cost]
        };
        let [alone, of_many] = [Level::FIVE_PERCENT, Level::FIVE_PERCENT.over(VALUES)]
            .map(|level| effects(level).map(|e| e.verdict()));
        let words = [0, 1, 2].map(|which: usize| words_for_some([alone[which], of_many[which]]));
        Self { label, other, effects: effects(Level::FIVE_PERCENT), words }
    }
}

/// The bench in which everything runs.
struct Bench<'a> {
    run_context: &'a RunContext<'a>,
    runs: usize,
    budget: usize,
}

impl Bench<'_> {
    fn reach(
        &self,
        make: &(dyn Fn() -> Result<Contender, Stop> + Sync),
        (task, objective): (Reach<'static>, Objective),
    ) -> Result<Vec<Reaching>, Stop> {
        let one = |run| reach(self.run_context, &make()?, (task, objective), run, self.budget);
        self.run_context.each(self.runs, one)
    }

    fn named(&self, name: &str, task: Reach<'static>) -> Result<Vec<Reaching>, Stop> {
        self.run_context.say(&format!("  {name} .."));
        let make = || contender(name, Reading::Corrected, self.budget);
        self.reach(&make, (task, Objective::Reward))
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let bench = Bench {
        run_context,
        runs: run_context.runs(RUNS, QUICK_RUNS).min(RUNS),
        budget: run_context.choose(BUDGET, QUICK),
    };
    let task = FiveJointArm::task(Reading::Corrected);
    let iepso = bench.named("iepso", task)?;
    let others = OTHERS.iter().map(|name| bench.named(name, task)).collect::<Result<Vec<_>, _>>()?;
    let against = |label: &str, ours: &[Reaching]| -> Vec<Compared> {
        let pairs = OTHERS.into_iter().zip(&others);
        pairs.map(|(name, theirs)| Compared::of(label.to_owned(), ours, (name, theirs))).collect()
    };
    let mut compared = against("ours", &iepso);
    let setup = Setup { reading: Reading::Corrected, evaluations: Some(bench.budget) };
    for swept in &SWEPT {
        for value in FACTORS.map(|factor| (factor * swept.ours).min(swept.most)) {
            let label = label(&format!("{}: {}", swept.method, swept.number), value);
            run_context.say(&format!("  {label} .."));
            let theirs = bench.reach(&|| Ok((swept.make)(value, setup)), (task, Objective::Reward))?;
            compared.push(Compared::of(label, &iepso, (swept.method, &theirs)));
        }
    }
    for replaced in REPLACED {
        let make = || Ok(replacing(replaced, bench.budget));
        let ours = bench.reach(&make, (task, Objective::Reward))?;
        compared.extend(against(&label("iepso: replaced", replaced as f64), &ours));
    }
    let plain = || contender("iepso", Reading::Corrected, bench.budget);
    let without = bench.reach(&plain, (task, Objective::TimeAndError))?;
    let mut rewards = vec![Rewarded::new("ours".to_owned(), task, &iepso)];
    for factor in FACTORS {
        let error_max_m = factor * task.reward.error_max_m;
        let task = Reach { reward: Reward { error_max_m, ..task.reward }, ..task };
        let label = label("e_max (mm)", 1e3 * error_max_m);
        let ours = bench.named("iepso", task)?;
        for name in OTHERS {
            compared.push(Compared::of(label.clone(), &ours, (name, &bench.named(name, task)?)));
        }
        rewards.push(Rewarded::new(label, task, &ours));
    }
    let mut outcome = Outcome { tables: vec![table(&compared, &bench)], ..Outcome::default() };
    outcome.claims = claims(&compared);
    outcome.claims.extend(rewarded(&bench, rewards, &without)?);
    Ok(outcome)
}

fn table(compared: &[Compared], bench: &Bench) -> Table {
    let columns = ["", "against", "error less by (%)", "generation less by (%)", "F less by (s)"];
    let note = format!(
        "IEPSO corrected against each of the other four; {} runs of {} evaluations; effect [95 % interval]; each row changes one number",
        bench.runs, bench.budget
    );
    let mut table = Table::new("Numbers that the paper does not print", "", &note, &columns);
    for Compared { label, other, effects, .. } in compared {
        let cells = effects.iter().map(|e| Cell::estimate(e.estimate));
        table.row(label.clone(), std::iter::once(Cell::words(*other)).chain(cells).collect());
    }
    table
}

/// Each of the paper's three claims: against every other method at some value.
fn claims(compared: &[Compared]) -> Vec<Claim> {
    let says = [
        "IEPSO's error is the least of the five",
        "IEPSO converges fastest: first within 0.005 mm",
        "IEPSO plans the most efficient motion (least F)",
    ];
    let claim = |(which, says): (usize, &str)| {
        let against = |name: &str| -> Vec<At> {
            let rows = compared.iter().filter(|c| c.other == name);
            rows.map(|c| At { label: c.label.clone(), verdict: c.words[which] }).collect()
        };
        let each = OTHERS.map(|name| (name, against(name)));
        let verdict = Verdict::all(each.iter().map(|(_, at)| Verdict::any(at.iter().map(|s| s.verdict))));
        let text: Vec<String> = each.iter().map(|(name, at)| format!("{name}: {}", places(at))).collect();
        Claim::weighed(
            &format!("{says}, at some value of what is not printed"),
            "against each of the other four there is a value over a decade of a number that is not printed at which IEPSO is better, by \
             the margins of the rows above",
            verdict,
            Vec::new(),
        )
        .beside(text.join(". "))
    };
    says.into_iter().enumerate().map(claim).collect()
}

/// What the runs of IEPSO brought on one objective: generation and error.
struct Figures {
    task: Reach<'static>,
    objective: Objective,
    runs: Vec<[f64; 2]>,
}

impl Figures {
    fn new((task, objective): (Reach<'static>, Objective), runs: &[Reaching]) -> Self {
        Self { task, objective, runs: runs.iter().map(Self::of).collect() }
    }

    fn of(run: &Reaching) -> [f64; 2] {
        [run.generation, run.error_mm]
    }

    fn up_to(&mut self, bench: &Bench, runs: usize) -> Result<(), Stop> {
        let (task, objective) = (self.task, self.objective);
        bench.run_context.up_to(runs, &mut self.runs, |run| {
            let contender = contender("iepso", Reading::Corrected, bench.budget)?;
            reach(bench.run_context, &contender, (task, objective), run, bench.budget).map(|r| Self::of(&r))
        })
    }

    fn which(&self, which: usize) -> Vec<f64> {
        counted(&self.runs.iter().map(|figures| figures[which]).collect::<Vec<_>>())
    }
}

/// IEPSO with the reward at one largest error.
struct Rewarded {
    label: String,
    with: Figures,
}

impl Rewarded {
    fn new(label: String, task: Reach<'static>, runs: &[Reaching]) -> Self {
        Self { label, with: Figures::new((task, Objective::Reward), runs) }
    }

    fn effect(&self, without: &Figures, which: usize, level: Level) -> Effect {
        let floor = [1.0, PRECISION_MM][which];
        let (with, without) = (self.with.which(which), without.which(which));
        Effect::ratio(("with reward", &with), ("without", &without), (floor, level))
    }
}

/// IEPSO with the reward against IEPSO without: generation and error.
fn rewarded(bench: &Bench, mut rewards: Vec<Rewarded>, without: &[Reaching]) -> Result<Vec<Claim>, Stop> {
    let rule = "IEPSO, corrected: less with the reward, at some e_max over a decade: above 0 (holds), below 1 % (does not hold), or neither";
    let task = FiveJointArm::task(Reading::Corrected);
    let mut without = Figures::new((task, Objective::TimeAndError), without);
    let looks = bench.run_context.looks_at_most(looks::UNPRINTED_003, QUICK_RUNS);
    settle(looks, |look| {
        without.up_to(bench, look.runs)?;
        rewards.iter_mut().try_for_each(|rewarded| rewarded.with.up_to(bench, look.runs))?;
        let values = Values { count: rewards.len(), level: look.level };
        let at = |which: usize| -> Vec<At> {
            let at =
                |r: &Rewarded| At::some(&*r.label, values, |level| vec![r.effect(&without, which, level)]);
            rewards.iter().map(at).collect()
        };
        Ok(vec![
            at_some("The reward makes IEPSO converge faster", rule, &at(0)),
            at_some("The reward makes IEPSO more accurate", rule, &at(1)),
        ])
    })
}
