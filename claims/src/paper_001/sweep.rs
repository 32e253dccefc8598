//! Numbers that the paper does not print, each over a decade round ours: those of ISMA's crossover, and those of the
//! methods that it is compared with.
use super::benchmarks::{DIMENSIONS, METHODS, Ranking, problem};
use crate::claim::{Claim, Verdict};
use crate::looks::{self, settle};
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, quantile};
use crate::swept::{At, FACTORS, label, places, words_for_some};
use crate::table::{Cell, Table};
use crate::trial::{Sample, Trial, minimise};
use taustream_optimizers::papers::Function;
use taustream_optimizers::{Boa, Gwo, Isma, Optimizer, Reading, Schedule, Setup, Sma, Ssa, by_name};

const QUICK_RUNS: usize = 2;
/// Evaluations of each.
const BUDGET: usize = 10_050;
const QUICK: usize = 500;

/// A number of one method, the values that it gets, and the method with it.
struct Swept {
    method: &'static str,
    number: &'static str,
    values: [f64; 2],
    make: fn(f64, Setup) -> Box<dyn Optimizer>,
}

const PROBABILITY: [f64; 2] = [0.1, 1.0];

/// A decade round a number.
const fn decade(ours: f64) -> [f64; 2] {
    [ours * FACTORS[0], ours * FACTORS[1]]
}

const SWEPT: [Swept; 9] = [
    Swept { method: "isma", number: "P_t", values: PROBABILITY, make: crossing },
    // Ours is 0, which has no decade: as wide as λ to both sides.
    Swept {
        method: "isma",
        number: "μ",
        values: [-Isma::UNPRINTED[2], Isma::UNPRINTED[2]],
        make: |mu, s| Box::new(Isma { laplace: [mu, Isma::UNPRINTED[2]], ..Isma::set_up(s) }),
    },
    Swept {
        method: "isma",
        number: "λ",
        values: decade(Isma::UNPRINTED[2]),
        make: |lambda, s| Box::new(Isma { laplace: [Isma::UNPRINTED[1], lambda], ..Isma::set_up(s) }),
    },
    Swept {
        method: "boa",
        number: "p",
        values: PROBABILITY,
        make: |to_best, s| Box::new(Boa { to_best, ..Boa::set_up(s) }),
    },
    Swept {
        method: "boa",
        number: "c",
        values: decade(Boa::AUTHORS[1]),
        make: |modality, s| Box::new(Boa { modality, ..Boa::set_up(s) }),
    },
    Swept {
        method: "boa",
        number: "a",
        values: decade(Boa::AUTHORS[2]),
        make: |exponent, s| Box::new(Boa { exponent, ..Boa::set_up(s) }),
    },
    Swept {
        method: "ssa",
        number: "producers",
        values: decade(Ssa::AUTHORS[0]),
        make: |producers, s| Box::new(Ssa { producers, ..Ssa::set_up(s) }),
    },
    Swept { method: "ssa", number: "watch", values: decade(Ssa::AUTHORS[1]), make: watching },
    Swept {
        method: "ssa",
        number: "safety",
        values: PROBABILITY,
        make: |safety, s| Box::new(Ssa { safety, ..Ssa::set_up(s) }),
    },
];

/// Schedules that fit the evaluations: how many of them a mould takes in an iteration depends on the number.
fn schedule(per_member: f64, setup: Setup) -> Schedule {
    let paper = Gwo::PAPER_001;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred at most")]
    let per_iteration = (per_member * paper.population as f64).round() as usize;
    paper.fitted(setup.evaluations, per_iteration)
}

/// SSA with another share on watch.
fn watching(watch: f64, setup: Setup) -> Box<dyn Optimizer> {
    Box::new(Ssa { watch, schedule: schedule(1.0 + watch, setup), ..Ssa::set_up(setup) })
}

/// ISMA with another probability of its crossover, which makes two children.
fn crossing(crossover: f64, setup: Setup) -> Box<dyn Optimizer> {
    let ours = Isma::set_up(setup);
    let sma = Sma { schedule: schedule(3.0 + 2.0 * crossover, setup), ..ours.sma };
    Box::new(Isma { crossover, sma, ..ours })
}

/// What makes a method.
type Make = Box<dyn Fn() -> Result<Box<dyn Optimizer>, Stop> + Sync>;

/// One method at one value: its trials, function by function.
struct Entry {
    label: String,
    /// Its place among [`METHODS`].
    method: usize,
    make: Make,
    trials: Vec<Vec<Trial>>,
}

impl Entry {
    fn new(label: String, method: usize, make: Make) -> Self {
        Self { label, method, make, trials: Function::ALL.iter().map(|_| Vec::new()).collect() }
    }

    /// Until there are so many runs on each function.
    fn run(&mut self, run_context: &RunContext, (runs, budget): (usize, usize)) -> Result<(), Stop> {
        run_context.say(&format!("  {}, {runs} runs ..", self.label));
        for (function, trials) in Function::ALL.into_iter().zip(&mut self.trials) {
            run_context.up_to(runs, trials, |run| {
                let problem = problem(run_context, function, true, run);
                minimise(run_context, (self.make)()?.as_ref(), &problem, run_context.seed(run), budget)
            })?;
        }
        Ok(())
    }

    /// The five on each function, this one instead of the one whose number it changes.
    fn ranking(&self, five: &[Self], level: Level) -> Ranking {
        let mut ranking = Ranking::at(level);
        for (f, function) in Function::ALL.into_iter().enumerate() {
            let of = |(m, ours): (usize, &Self)| {
                let entry = if m == self.method { self } else { ours };
                entry.trials.get(f).map(|trials| Sample::best(trials))
            };
            ranking.add(function, &five.iter().enumerate().filter_map(of).collect::<Vec<_>>());
        }
        ranking
    }
}

fn entries(budget: usize) -> (Vec<Entry>, Vec<Entry>) {
    let setup = Setup { reading: Reading::Corrected, evaluations: Some(budget) };
    let named = |(m, method): (usize, &&'static str)| {
        let method = *method;
        let make = move || by_name(method, setup).map_err(|e| Stop::Refused(e.to_string()));
        Entry::new(method.to_owned(), m, Box::new(make))
    };
    let five = METHODS.iter().enumerate().map(named).collect();
    let mut swept = Vec::new();
    for Swept { method, number, values, make } in &SWEPT {
        let Some(index) = METHODS.iter().position(|m| m == method) else { continue };
        let make = *make;
        for value in *values {
            let label = label(&format!("{method}: {number}"), value);
            swept.push(Entry::new(label, index, Box::new(move || Ok(make(value, setup)))));
        }
    }
    (five, swept)
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let budget = run_context.choose(BUDGET, QUICK);
    let looks = run_context.looks_at_most(looks::UNPRINTED_001, QUICK_RUNS);
    let (mut five, mut swept) = entries(budget);
    let claims = settle(looks, |look| {
        for entry in five.iter_mut().chain(&mut swept) {
            entry.run(run_context, (look.runs, budget))?;
        }
        Ok::<_, Stop>(vec![claim(&five, &swept, look.level)])
    })?;
    Ok(Outcome { tables: vec![table(&five, &swept, budget)], claims, ..Outcome::default() })
}

/// The values that are looked at: ours, and each swept one.
fn settings<'a>(five: &'a [Entry], swept: &'a [Entry]) -> impl Iterator<Item = (&'a str, &'a Entry)> {
    let ours = five.last().map(|isma| ("ours", isma));
    ours.into_iter().chain(swept.iter().map(|entry| (entry.label.as_str(), entry)))
}

fn claim(five: &[Entry], swept: &[Entry], level: Level) -> Claim {
    let of_many = level.over(settings(five, swept).count());
    let at = settings(five, swept).map(|(label, entry)| {
        let words = [level, of_many].map(|level| entry.ranking(five, level).verdict());
        At { label: label.to_owned(), verdict: words_for_some(words) }
    });
    let at: Vec<At> = at.collect();
    Claim::weighed(
        "ISMA is the most accurate of the five at equal evaluations, optimum moved, at some value of what is not printed",
        "at some value over a decade of a number that is not printed ISMA leaves less above the least value than each other method on each \
         of the six functions, by the margin of the rows above",
        Verdict::any(at.iter().map(|s| s.verdict)),
        Vec::new(),
    )
    .beside(places(&at))
}

fn table(five: &[Entry], swept: &[Entry], budget: usize) -> Table {
    let heading: Vec<String> = Function::ALL
        .iter()
        .flat_map(|f| [format!("{}: ISMA the best", f.name()), format!("{}: left", f.name())])
        .collect();
    let columns: Vec<&str> = std::iter::once("").chain(heading.iter().map(String::as_str)).collect();
    let runs = five.first().and_then(|entry| entry.trials.first()).map_or(0, Vec::len);
    let note = format!(
        "D = {DIMENSIONS}, corrected, optimum moved, {runs} runs of {budget} evaluations; left: median above the least value of the method whose \
         number it is, or of ISMA; each row changes one number"
    );
    let mut table = Table::new("Numbers that the paper does not print", "", &note, &columns);
    for (label, entry) in settings(five, swept) {
        let words = entry.ranking(five, Level::FIVE_PERCENT).words();
        let left = Function::ALL.into_iter().zip(&entry.trials).map(|(function, trials)| {
            quantile(&Sample::best(trials).values, 0.5) - function.least(DIMENSIONS)
        });
        let cells = words
            .iter()
            .zip(left)
            .flat_map(|(word, left)| [Cell::words(word.to_string()), Cell::number(left)]);
        table.row(label, cells.collect());
    }
    table
}
