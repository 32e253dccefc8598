//! Numbers that the paper does not print, each over a decade round ours: those of ISMA's crossover, and those of the
//! methods that it is compared with.
use super::benchmarks::{DIMENSIONS, METHODS, Ranking, problem};
use crate::claim::{Claim, Verdict};
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::quantile;
use crate::swept::{At, FACTORS, label, places};
use crate::table::{Cell, Table};
use crate::trial::{Sample, minimise};
use taustream_optimizers::papers::Function;
use taustream_optimizers::{Boa, Gwo, Isma, Optimizer, Reading, Schedule, Setup, Sma, Ssa, by_name};

/// Runs of each setting: six is the least of which a signed-rank test can say anything.
const RUNS: usize = 8;
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

/// What a method left above the least value: function by function.
type Left = Vec<Sample>;

struct Bench<'a> {
    run_context: &'a RunContext<'a>,
    runs: usize,
    budget: usize,
}

impl Bench<'_> {
    fn setup(&self) -> Setup {
        Setup { reading: Reading::Corrected, evaluations: Some(self.budget) }
    }

    fn left(&self, make: &(dyn Fn() -> Result<Box<dyn Optimizer>, Stop> + Sync)) -> Result<Left, Stop> {
        let on = |function: Function| {
            let problem = problem(self.run_context, function, true);
            let trials = self.run_context.each(self.runs, |run| {
                let seed = self.run_context.seed(run);
                minimise(self.run_context, make()?.as_ref(), &problem, seed, self.budget)
            })?;
            Ok(Sample::best(&trials))
        };
        Function::ALL.into_iter().map(on).collect()
    }

    fn named(&self, method: &str) -> Result<Left, Stop> {
        self.run_context.say(&format!("  {method} .."));
        self.left(&|| by_name(method, self.setup()).map_err(|e| Stop::Refused(e.to_string())))
    }
}

/// The five at one value, ISMA last.
struct Setting {
    label: String,
    verdict: Verdict,
    /// Function by function: the word there.
    words: Vec<Verdict>,
    /// Medians above the least value of the method whose number it is.
    left: Vec<f64>,
}

impl Setting {
    /// All five, of which number `changed` is another sample.
    fn of(label: String, five: &[Left], changed: Option<(usize, &Left)>) -> Self {
        let mut ranking = Ranking::default();
        let mut left = Vec::new();
        for (f, function) in Function::ALL.into_iter().enumerate() {
            let of = |(m, ours): (usize, &Left)| match changed {
                Some((index, other)) if index == m => other.get(f).cloned(),
                Some(_) | None => ours.get(f).cloned(),
            };
            let samples: Vec<Sample> = five.iter().enumerate().filter_map(of).collect();
            let shown = changed.map_or(METHODS.len() - 1, |(index, _)| index);
            let values: Vec<f64> = samples.get(shown).map_or(Vec::new(), |s| s.values.clone());
            left.push(quantile(&values, 0.5) - function.least(DIMENSIONS));
            ranking.add(function, &samples);
        }
        Self { label, verdict: ranking.verdict(), words: ranking.words(), left }
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let bench = Bench {
        run_context,
        runs: run_context.runs(RUNS, QUICK_RUNS).min(RUNS),
        budget: run_context.choose(BUDGET, QUICK),
    };
    let five = METHODS.iter().map(|method| bench.named(method)).collect::<Result<Vec<_>, _>>()?;
    let mut settings = vec![Setting::of("ours".to_owned(), &five, None)];
    for Swept { method, number, values, make } in &SWEPT {
        let Some(index) = METHODS.iter().position(|m| m == method) else { continue };
        for value in *values {
            let label = label(&format!("{method}: {number}"), value);
            run_context.say(&format!("  {label} .."));
            let left = bench.left(&|| Ok(make(value, bench.setup())))?;
            settings.push(Setting::of(label, &five, Some((index, &left))));
        }
    }
    let at: Vec<At> = settings.iter().map(|s| At { label: s.label.clone(), verdict: s.verdict }).collect();
    let claim = Claim::weighed(
        "ISMA is the most accurate of the five at equal evaluations, optimum moved, at some value of what is not printed",
        "at some value over a decade of a number that is not printed ISMA leaves less above the least value than each other method on each \
         of the six functions, by the margin of the rows above",
        Verdict::any(at.iter().map(|s| s.verdict)),
        Vec::new(),
    )
    .beside(places(&at));
    Ok(Outcome { tables: vec![table(&settings, &bench)], claims: vec![claim], ..Outcome::default() })
}

fn table(settings: &[Setting], bench: &Bench) -> Table {
    let heading: Vec<String> = Function::ALL
        .iter()
        .flat_map(|f| [format!("{}: ISMA the best", f.name()), format!("{}: left", f.name())])
        .collect();
    let columns: Vec<&str> = std::iter::once("").chain(heading.iter().map(String::as_str)).collect();
    let note = format!(
        "D = {DIMENSIONS}, corrected, optimum moved, {} runs of {} evaluations; left: median above the least value of the method whose number \
         it is, or of ISMA; each row changes one number",
        bench.runs, bench.budget
    );
    let mut table = Table::new("Numbers that the paper does not print", "", &note, &columns);
    for Setting { label, words, left, .. } in settings {
        let cells = words
            .iter()
            .zip(left)
            .flat_map(|(word, left)| [Cell::words(word.to_string()), Cell::number(*left)]);
        table.row(label.clone(), cells.collect());
    }
    table
}
