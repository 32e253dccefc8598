//! Tables 2 and 3: five methods on six functions; also at equal evaluations, and with the optimum moved.
use crate::chart::Panel;
use crate::claim::{Claim, Verdict, agrees};
use crate::effect::Effect;
use crate::figure::Figure;
use crate::looks::{self, Looks, settle};
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, Moments, wilcoxon};
use crate::table::{Cell, Table};
use crate::trial::{Sample, Trial, convergence, minimise};
use taustream_optimizers::papers::{Benchmark, Function};
use taustream_optimizers::{Reading, Setup, by_name};

/// The five, the paper's own last.
pub(super) const METHODS: [&str; 5] = ["boa", "gwo", "ssa", "sma", "isma"];
/// Methods whose printed reading differs from the corrected one.
const READ_TWICE: [&str; 2] = ["sma", "isma"];
/// Table 2: means of F1 to F6, in the order of [`METHODS`]. The sign of GWO's exponent on F3 is lost in the text.
const MEANS: [[f64; 6]; 5] = [
    [28.9127, 5.4496, 0.0138, -3382.5132, 2.8340, 0.0033],
    [27.9115, 1.2608, 1.505e-5, -6046.7061, 1.0984, 0.0110],
    [28.5236, 2.8898, 1.007e-15, -9807.0834, 2.2639, 0.0],
    [29.5465, 4.5133, 1.007e-15, -3977.0257, 2.4101, 5.07e-15],
    [0.0584, 0.0008, 8.882e-16, -7496.7903, 0.0075, 0.0],
];
/// Table 3: deviations.
const DEVIATIONS: [[f64; 6]; 5] = [
    [0.0230, 0.5947, 0.0027, 211.0252, 0.2431, 0.0016],
    [0.8900, 0.4473, 6.225e-6, 575.4946, 0.264_68, 0.0199],
    [0.5105, 0.7589, 6.4863e-16, 1447.6617, 0.4481, 0.0],
    [2.6847, 0.3899, 6.4863e-16, 340.8653, 0.3008, 2.7749e-14],
    [0.0885, 0.0006, 0.0, 1832.0243, 0.0116, 0.0],
];
/// Runs, dimensions and evaluations of the paper: its population of 50, first evaluated, then moved 5000 times.
const PAPERS_RUNS: usize = 30;
pub(super) const DIMENSIONS: usize = 30;
/// Runs of the paper's own schedules, of which ISMA's takes a million evaluations: enough to see whether a mean is within a
/// tenth.
const OWN_RUNS: usize = 2;
/// Evaluations of each, a tenth of the paper's schedule: 500 iterations of SMA.
const EQUAL: usize = POPULATION + POPULATION * 500;
/// Evaluations of an iteration of most methods, of the sparrows with their watch, and of ISMA.
const POPULATION: usize = 50;
const BY_SPARROWS: usize = 60;
const BY_ISMA: usize = 200;
const QUICK: usize = 3_000;
/// Above any method's own schedule; ISMA's takes about a million.
const ENOUGH: usize = 2_000_000;
/// What is distinguished from the least value: below it is rounding.
const ROUNDING: f64 = 1e-13;

/// Runs of one method on one function.
#[derive(Clone, Copy)]
struct Case {
    method: &'static str,
    reading: Reading,
    function: Function,
    is_moved: bool,
    /// Evaluations that the method's schedule is fitted to; `None` is the paper's schedule.
    evaluations: Option<usize>,
}

impl Case {
    fn trials(self, run_context: &RunContext, runs: usize) -> Result<Vec<Trial>, Stop> {
        let mut trials = Vec::new();
        self.more_trials(run_context, &mut trials, runs)?;
        Ok(trials)
    }

    /// Further trials until there are so many.
    fn more_trials(self, run_context: &RunContext, trials: &mut Vec<Trial>, runs: usize) -> Result<(), Stop> {
        let setup = Setup { reading: self.reading, evaluations: self.evaluations };
        let optimizer = |_| by_name(self.method, setup).map_err(|e| Stop::Refused(e.to_string()));
        run_context.up_to(runs, trials, |run| {
            let problem = problem(run_context, self.function, self.is_moved, run);
            let budget = self.evaluations.unwrap_or(ENOUGH);
            minimise(run_context, optimizer(run)?.as_ref(), &problem, run_context.seed(run), budget)
        })
    }
}

/// The function as printed, or moved by a random vector: another one in each run, the same for all methods. One for all runs
/// would be a sample of a single place, and the words would depend on where it lies.
pub(super) fn problem(run_context: &RunContext, function: Function, is_moved: bool, run: usize) -> Benchmark {
    if is_moved {
        Benchmark::shifted(function, DIMENSIONS, run_context.seed(run))
    } else {
        Benchmark::new(function, DIMENSIONS)
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome::default();
    outcome.ours.push(
        "ISMA: crossover with probability 0.5, Laplace centre 0 and width 0.5, the three searches one after another, \
         a child taken only if better; SMA: logarithm to base 10"
            .to_owned(),
    );
    own_schedules(run_context, &mut outcome)?;
    let printed = equal_evaluations(run_context, false)?;
    outcome.claims.push(equal_iterations(run_context, &printed.samples)?);
    for placed in [printed, equal_evaluations(run_context, true)?] {
        outcome.tables.push(placed.table);
        outcome.figures.push(placed.figure);
        outcome.claims.extend(placed.claims);
    }
    Ok(outcome)
}

/// The paper's tables: every method with its own schedule of 5000 iterations.
fn own_schedules(run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
    let runs = run_context.runs(OWN_RUNS, 2).min(OWN_RUNS);
    let evaluations = run_context.choose(None, Some(QUICK));
    let columns =
        ["", "paper, mean", "paper, sd", "ours, printed", "ours, corrected", "evaluations", "reproduced"];
    let schedule = run_context.choose("5000 iterations of 50", "a quick run's few evaluations");
    let note = format!(
        "D = 30, {schedule}, {runs} runs of ours, 30 of the paper; best so far. Only SMA and ISMA have two readings."
    );
    let mut table = Table::new("Tables 2 and 3: mean ± deviation", "", &note, &columns);
    let (mut same, mut seen) = ([0; 2], 0);
    for (f, function) in Function::ALL.into_iter().enumerate() {
        for (m, method) in METHODS.into_iter().enumerate() {
            // Once neither reading reproduces every mean, the rest is for the table alone.
            if run_context.is_repeat() && !same.contains(&seen) {
                continue;
            }
            seen += 1;
            run_context.say(&format!("  {} {method}, {runs} runs ..", function.name()));
            let case = Case { method, reading: Reading::Corrected, function, is_moved: false, evaluations };
            let corrected = Sample::best(&case.trials(run_context, runs)?);
            let is_read_twice = READ_TWICE.contains(&method);
            let printed = if is_read_twice {
                Sample::best(&Case { reading: Reading::Printed, ..case }.trials(run_context, runs)?)
            } else {
                corrected.clone()
            };
            let paper = Moments { n: PAPERS_RUNS, mean: MEANS[m][f], sd: DEVIATIONS[m][f] };
            let agree = [&printed, &corrected].map(|s| agrees(paper, &s.summary()));
            same.iter_mut().zip(agree).for_each(|(n, is_same)| *n += usize::from(is_same));
            let word = ["no", "yes"];
            table.row(
                format!("{} {method}", function.name()),
                vec![
                    Cell::Paper(paper.mean),
                    Cell::Paper(paper.sd),
                    if is_read_twice { Cell::Mean(printed.summary()) } else { Cell::None },
                    Cell::Mean(corrected.summary()),
                    Cell::maybe(corrected.evaluations),
                    Cell::words(if is_read_twice {
                        format!("{}, {}", word[usize::from(agree[0])], word[usize::from(agree[1])])
                    } else {
                        word[usize::from(agree[1])].to_owned()
                    }),
                ],
            );
        }
    }
    let cells = METHODS.len() * Function::ALL.len();
    outcome.claims.push(Claim::measured(
        "Tables 2 and 3 are what the five methods reach in 5000 iterations of 50, 30 runs",
        "every mean is reproduced by one of the readings: within a tenth, within 1e-13, or not significantly different by Welch's \
         test at 5 %",
        same.contains(&cells),
        format!("{} of {cells} cells as printed, {} corrected", same[0], same[1]),
    ));
    outcome.claims.push(in_the_papers_own_table());
    outcome.tables.insert(0, table);
    Ok(())
}

/// What the paper's table says of the paper's text.
fn in_the_papers_own_table() -> Claim {
    let is_best = |f: usize| {
        let column = MEANS.map(|row| row[f]);
        column.iter().all(|mean| column[METHODS.len() - 1] <= *mean)
    };
    let worse: Vec<&str> = (0..6).filter(|f| !is_best(*f)).map(|f| Function::ALL[f].name()).collect();
    Claim::exact(
        "ISMA's accuracy is higher than that of the other four (text of section 4.2)",
        "no mean in the paper's own table 2 is below ISMA's",
        worse.is_empty(),
        format!("another method's printed mean is lower on: {}", worse.join(", ")),
    )
}

/// The paper gives all methods the same number of iterations, whatever they take: a tenth of its 5000, from the runs at equal
/// evaluations where those are the same.
fn equal_iterations(run_context: &RunContext, equal: &[Vec<Sample>]) -> Result<Claim, Stop> {
    let runs = looks_of(run_context).first();
    let iterations = (run_context.choose(EQUAL, QUICK) - POPULATION) / POPULATION;
    let mut best = Ranking::at(Level::FIVE_PERCENT);
    for (function, samples) in Function::ALL.into_iter().zip(equal) {
        let mut samples = samples.clone();
        samples.iter_mut().for_each(|sample| sample.values.truncate(runs));
        for (method, each) in [("ssa", BY_SPARROWS), ("isma", BY_ISMA)] {
            run_context.say(&format!("  {} {method}, {iterations} iterations ..", function.name()));
            let (reading, evaluations) = (Reading::Corrected, Some(POPULATION + each * iterations));
            let case = Case { method, reading, function, is_moved: false, evaluations };
            let index = METHODS.iter().position(|m| *m == method);
            if let Some(sample) = index.and_then(|index| samples.get_mut(index)) {
                *sample = Sample::best(&case.trials(run_context, runs)?);
            }
        }
        best.add(function, &samples);
    }
    Ok(best.claim(&format!(
        "ISMA has the best result of the five on F1 to F6, each with the same number of iterations (ours: {iterations} of 50, of which ISMA's \
         take four times the evaluations)"
    )))
}

/// The five at equal evaluations, the optimum at one place.
struct Placed {
    table: Table,
    figure: Figure,
    claims: Vec<Claim>,
    /// Function by function, method by method.
    samples: Vec<Vec<Sample>>,
}

/// The looks at equal evaluations.
fn looks_of(run_context: &RunContext) -> Looks {
    run_context.looks_at_most(looks::FUNCTIONS, 5)
}

/// Trials at equal evaluations: function by function, method by method.
struct Equal {
    is_moved: bool,
    budget: usize,
    trials: Vec<[Vec<Trial>; METHODS.len()]>,
}

impl Equal {
    fn place(&self) -> &'static str {
        if self.is_moved { "optimum moved" } else { "optimum as printed" }
    }

    /// Every method on every function, until each has so many trials.
    fn run(&mut self, run_context: &RunContext, runs: usize) -> Result<(), Stop> {
        for (function, trials) in Function::ALL.into_iter().zip(&mut self.trials) {
            let (name, place) = (function.name(), if self.is_moved { "moved" } else { "as printed" });
            run_context.say(&format!("  {name} at equal evaluations, optimum {place}, {runs} runs .."));
            for (method, trials) in METHODS.into_iter().zip(trials) {
                let (reading, evaluations) = (Reading::Corrected, Some(self.budget));
                let case = Case { method, reading, function, is_moved: self.is_moved, evaluations };
                case.more_trials(run_context, trials, runs)?;
            }
        }
        Ok(())
    }

    /// Who is best at the end, and who after a quarter.
    fn claims(&self, level: Level) -> Vec<Claim> {
        let (mut best, mut fast) = (Ranking::at(level), Ranking::at(level));
        for (function, trials) in Function::ALL.into_iter().zip(&self.trials) {
            best.add(function, &trials.each_ref().map(|t| Sample::best(t)));
            fast.add(
                function,
                &trials.each_ref().map(|t| Sample::from_trials(t, |t| quarter(t, self.budget))),
            );
        }
        let (evaluations, place) = (figures(self.budget as f64), self.place());
        vec![
            best.claim(&format!(
                "ISMA is the most accurate of the five: at {evaluations} evaluations each, {place}"
            )),
            fast.claim(&format!("ISMA converges fastest: after a quarter of those evaluations, {place}")),
        ]
    }

    fn table(&self, run_context: &RunContext) -> Table {
        let mut columns = vec!["".to_owned()];
        columns.extend(METHODS.iter().map(|m| (*m).to_owned()));
        columns.extend(METHODS.iter().take(4).map(|m| format!("isma less:more than {m}")));
        let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
        let (runs, first) = (self.runs(), looks_of(run_context).first());
        let note = format!(
            "D = {DIMENSIONS}, {runs} runs (of {first} at the first look), corrected readings, {} evaluations each; median [quartiles]",
            self.budget
        );
        let mut table = Table::new(&format!("Equal evaluations, {}", self.place()), "", &note, &columns);
        for (function, trials) in Function::ALL.into_iter().zip(&self.trials) {
            let samples = trials.each_ref().map(|t| Sample::best(t));
            let mut cells: Vec<Cell> = samples.iter().map(|s| Cell::Median(s.summary())).collect();
            cells.extend(against_last(&samples).map(Cell::Test));
            table.row(function.name(), cells);
        }
        table
    }

    fn figure(&self) -> Figure {
        let mut panels = Vec::new();
        for (function, trials) in Function::ALL.into_iter().zip(&self.trials) {
            let least = function.least(DIMENSIONS);
            let mut panel = Panel::new("evaluations", &format!("{}: best so far - least", function.name()));
            panel.is_log = true;
            for (method, trials) in METHODS.iter().zip(trials) {
                let above = |(x, y): (f64, [f64; 3])| (x, y.map(|y| y - least));
                panel.spread(method, &convergence(trials).into_iter().map(above).collect::<Vec<_>>());
            }
            panels.push(panel);
        }
        let file = if self.is_moved { "001-convergence-moved.svg" } else { "001-convergence.svg" };
        let title = format!("Paper 001, {}: median and quartiles of {} runs", self.place(), self.runs());
        Figure::of(file, &title, 2, &panels)
    }

    fn runs(&self) -> usize {
        self.trials.first().map_or(0, |trials| trials[0].len())
    }
}

/// All methods at the same number of evaluations, pair by pair against ISMA.
fn equal_evaluations(run_context: &RunContext, is_moved: bool) -> Result<Placed, Stop> {
    let trials = Function::ALL.iter().map(|_| std::array::from_fn(|_| Vec::new())).collect();
    let mut equal = Equal { is_moved, budget: run_context.choose(EQUAL, QUICK), trials };
    let claims = settle(looks_of(run_context), |look| {
        equal.run(run_context, look.runs)?;
        Ok::<_, Stop>(equal.claims(look.level))
    })?;
    let samples = equal.trials.iter().map(|trials| trials.iter().map(|t| Sample::best(t)).collect());
    Ok(Placed { table: equal.table(run_context), figure: equal.figure(), claims, samples: samples.collect() })
}

/// Best so far when a quarter of the budget was used.
fn quarter(trial: &Trial, budget: usize) -> f64 {
    let until = 0.25 * budget as f64;
    let before = trial.trace.iter().take_while(|(x, _)| *x <= until).last();
    before.map_or(trial.found.cost, |(_, best)| *best)
}

/// The last sample against each of the others.
fn against_last(samples: &[Sample]) -> impl Iterator<Item = crate::statistics::Paired> + '_ {
    let (last, others) = samples.split_last().map_or((&[][..], &[][..]), |(l, o)| (&l.values[..], o));
    others.iter().map(move |other| wilcoxon(last, &other.values))
}

/// ISMA against the other four, function by function.
pub(super) struct Ranking {
    level: Level,
    verdicts: Vec<(&'static str, Verdict)>,
    /// What decides each function.
    effects: Vec<Effect>,
}

impl Ranking {
    /// Of no function yet, by intervals of a level.
    pub(super) fn at(level: Level) -> Self {
        Self { level, verdicts: Vec::new(), effects: Vec::new() }
    }

    /// The last sample against the others, by what is above the least value. Where all of its runs reach that but for
    /// rounding, nothing can be better.
    pub(super) fn add(&mut self, function: Function, samples: &[Sample]) {
        let Some((last, others)) = samples.split_last() else { return };
        let least = function.least(DIMENSIONS);
        let above = |sample: &Sample| sample.values.iter().map(|v| v - least).collect::<Vec<_>>();
        let ours = above(last);
        if ours.iter().all(|v| *v <= ROUNDING) {
            self.verdicts.push((function.name(), Verdict::Holds));
            return;
        }
        let isma = format!("{} isma", function.name());
        let effects = METHODS.iter().zip(others).map(|(name, other)| {
            Effect::ratio((&isma, &ours), (name, &above(other)), (ROUNDING, self.level))
        });
        let effects: Vec<Effect> = effects.collect();
        let verdict = Verdict::all(effects.iter().map(Effect::verdict));
        self.verdicts.push((function.name(), verdict));
        // Where several say the same, the one with the smallest gain says it best.
        let deciding = effects.into_iter().filter(|e| e.verdict() == verdict);
        self.effects.extend(deciding.min_by(|a, b| a.estimate.value.total_cmp(&b.estimate.value)));
    }

    /// Function by function, in the order in which they came.
    pub(super) fn words(&self) -> Vec<Verdict> {
        self.verdicts.iter().map(|(_, verdict)| *verdict).collect()
    }

    /// Of all functions together.
    pub(super) fn verdict(&self) -> Verdict {
        Verdict::all(self.words())
    }

    fn claim(self, says: &str) -> Claim {
        let of = |wanted: Verdict| {
            let names = self.verdicts.iter().filter(|(_, verdict)| *verdict == wanted).map(|(name, _)| *name);
            let names: Vec<&str> = names.collect();
            (!names.is_empty()).then(|| format!("{wanted} on {}", names.join(", ")))
        };
        let words = [Verdict::Holds, Verdict::DoesNotHold, Verdict::Open].map(of);
        let numbers = words.into_iter().flatten().collect::<Vec<_>>().join("; ");
        let verdict = self.verdict();
        let rule = "on each of the six, what ISMA leaves above the least value is less than what each other method leaves (above 0: \
                    holds, below 1 %: does not hold, or neither), or nothing but rounding (1e-13)";
        Claim::weighed(says, rule, verdict, self.effects).beside(numbers)
    }
}
