//! The parts of ISMA one by one: its chaotic map (figures 1 and 2), its feedback factor (figure 3), and what it is without
//! each of its five additions.
use super::benchmarks::{DIMENSIONS, problem};
use crate::claim::{Claim, Verdict};
use crate::effect::Effect;
use crate::looks::{self, settle};
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::Level;
use crate::swept::{At, label, places};
use crate::table::{Cell, Table};
use crate::trial::{Sample, Trial, minimise};
use std::cmp::Ordering;
use taustream_optimizers::papers::Function;
use taustream_optimizers::{Addition, Isma, Reading, Setup};

/// Points of figures 1 and 2, and bins of their histograms.
const POINTS: usize = 5_000;
const BINS: usize = 10;
/// Where both chains of the table begin; the paper prints no start.
const START: f64 = 0.37;
/// Other starts, in hundredths: with halves and quarters the logistic map falls to 0.
const STARTS: [i32; 9] = [7, 13, 19, 29, 41, 53, 61, 83, 97];
/// The paper's parameters of both maps.
const LOGISTIC: f64 = 4.0;
const BERNOULLI: f64 = 0.4;
/// Exponents of figure 3, the chosen one among them.
const EXPONENTS: [i32; 6] = [1, 2, 3, 4, 5, 6];
const BUDGET: usize = 15_050;
const QUICK: usize = 1_500;
/// What is above the least value by less is rounding.
const ROUNDING: f64 = 1e-13;

/// Looks at all of them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome::default();
    outcome.ours.push(format!("both chains begin at {START}"));
    maps(&mut outcome);
    feedback(&mut outcome);
    ablation(run_context, &mut outcome)?;
    Ok(outcome)
}

/// The largest distance of a bin's share from that of an even distribution.
fn unevenness(map: impl Fn(f64) -> f64, start: f64) -> ([f64; BINS], f64) {
    let mut counts = [0.0; BINS];
    let mut link = start;
    for _ in 0..POINTS {
        link = map(link);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to the number of bins"
        )]
        let bin = (link * BINS as f64) as usize;
        if let Some(count) = counts.get_mut(bin.min(BINS - 1)) {
            *count += 1.0 / POINTS as f64;
        }
    }
    let off = counts.iter().map(|share| (share - 1.0 / BINS as f64).abs()).fold(0.0, f64::max);
    (counts, off)
}

fn maps(outcome: &mut Outcome) {
    let from = |start: f64| {
        let logistic = unevenness(|x| LOGISTIC * x * (1.0 - x), start);
        let bernoulli = unevenness(
            |x| if x <= 1.0 - BERNOULLI { x / (1.0 - BERNOULLI) } else { (x - 1.0 + BERNOULLI) / BERNOULLI },
            start,
        );
        [logistic, bernoulli]
    };
    let [logistic, bernoulli] = from(START);
    let others = STARTS.map(|start| {
        let start = f64::from(start) / 100.0;
        let [logistic, bernoulli] = from(start);
        At::exact(label("start", start), bernoulli.1 < logistic.1)
    });
    let is_so = bernoulli.1 < logistic.1 && others.iter().all(|at| at.verdict == Verdict::Holds);
    let heading: Vec<String> = (0..BINS).map(|bin| format!("{:.1}..", bin as f64 / BINS as f64)).collect();
    let columns: Vec<&str> = std::iter::once("").chain(heading.iter().map(String::as_str)).collect();
    let note = format!("shares of {POINTS} points in ten bins; even would be 0.1 each");
    let mut table = Table::new("Figures 1 and 2: chaotic maps", "", &note, &columns);
    for (name, (shares, _)) in [("logistic", &logistic), ("Bernoulli", &bernoulli)] {
        table.row(name, shares.map(Cell::number).to_vec());
    }
    outcome.tables.push(table);
    outcome.claims.push(Claim::exact(
        "Bernoulli's map fills the box more evenly than the logistic map (figures 1 and 2)",
        "no bin's share is farther from a tenth than the logistic map's farthest, whatever the start, which is not printed",
        is_so,
        format!("farthest by {} against {}; {}", figures(bernoulli.1), figures(logistic.1), places(&others)),
    ));
}

/// The factor when a share of the iterations is done; SMA's bound falls on a straight line.
fn factor(done: f64, exponent: i32) -> f64 {
    ((1.0 - done).exp_m1() / 1.0_f64.exp_m1()).powi(exponent)
}

fn feedback(outcome: &mut Outcome) {
    let shares = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0];
    let heading = shares.map(|share| format!("{:.0} %", 100.0 * share));
    let columns: Vec<&str> = std::iter::once("").chain(heading.iter().map(String::as_str)).collect();
    let note = "the feedback factor when so much of the iterations is done; SMA's bound is 1 less that share";
    let mut table = Table::new("Figure 3: feedback factor", "", note, &columns);
    table.row("SMA", shares.map(|share| Cell::number(1.0 - share)).to_vec());
    for exponent in EXPONENTS {
        table.row(
            format!("κ = {exponent}"),
            shares.map(|share| Cell::number(factor(share, exponent))).to_vec(),
        );
    }
    outcome.tables.push(table);
    let steps: Vec<f64> = (1..100).map(|i| f64::from(i) / 100.0).collect();
    let falls = EXPONENTS.windows(2).all(|pair| {
        let [a, b] = pair else { return true };
        steps.iter().all(|share| factor(*share, *b) < factor(*share, *a))
    });
    outcome.claims.push(Claim::exact(
        "The feedback factor falls faster the larger κ is (figure 3)",
        "at every hundredth of the iterations a larger κ gives a smaller factor",
        falls,
        format!("half way κ = 4 leaves {}, SMA's bound 0.5", figures(factor(0.5, 4))),
    ));
}

/// What is left above the least value, function by function.
struct Left {
    addition: Option<Addition>,
    trials: Vec<Vec<Trial>>,
}

impl Left {
    fn without(addition: Option<Addition>) -> Self {
        Self { addition, trials: Function::ALL.iter().map(|_| Vec::new()).collect() }
    }

    fn name(&self) -> String {
        self.addition.map_or("ISMA".to_owned(), |addition| format!("without {}", addition.name()))
    }

    /// Until there are so many runs on each function.
    fn run(&mut self, run_context: &RunContext, runs: usize) -> Result<(), Stop> {
        let budget = run_context.choose(BUDGET, QUICK);
        let setup = Setup { reading: Reading::Corrected, evaluations: Some(budget) };
        run_context
            .say(&format!("  isma {}, {runs} runs ..", self.addition.map_or("itself", Addition::name)));
        for (function, trials) in Function::ALL.into_iter().zip(&mut self.trials) {
            run_context.up_to(runs, trials, |run| {
                let optimizer = Isma::without(setup, self.addition);
                let problem = problem(run_context, function, true, run);
                minimise(run_context, &optimizer, &problem, run_context.seed(run), budget)
            })?;
        }
        Ok(())
    }

    fn samples(&self) -> impl Iterator<Item = (Function, Sample)> + '_ {
        Function::ALL.into_iter().zip(&self.trials).map(|(function, trials)| {
            let least = function.least(DIMENSIONS);
            (function, Sample::from_trials(trials, |t| t.found.cost - least))
        })
    }
}

/// ISMA without each addition, on the functions whose optimum was moved.
fn ablation(run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
    let looks = run_context.looks(looks::PARTS, 3);
    let mut whole = Left::without(None);
    let mut parts = Addition::ALL.map(|addition| Left::without(Some(addition)));
    let claims = settle(looks, |look| {
        whole.run(run_context, look.runs)?;
        for (_, part) in parts.iter_mut().enumerate().filter(|(i, _)| look.is_open(*i)) {
            part.run(run_context, look.runs)?;
        }
        Ok::<_, Stop>(
            Addition::ALL
                .into_iter()
                .zip(&parts)
                .map(|(a, part)| helps(a, &whole, part, look.level))
                .collect(),
        )
    })?;
    let columns: Vec<&str> = ["", "runs"].into_iter().chain(Function::ALL.iter().map(|f| f.name())).collect();
    let note = format!(
        "D = {DIMENSIONS}, {} evaluations each, corrected, optimum moved; median [quartiles] above the least value",
        run_context.choose(BUDGET, QUICK)
    );
    let mut table = Table::new("ISMA without each of its additions", "", &note, &columns);
    for left in std::iter::once(&whole).chain(&parts) {
        let runs = Cell::number(left.trials.first().map_or(0, Vec::len) as f64);
        let medians = left.samples().map(|(_, sample)| Cell::Median(sample.summary()));
        table.row(left.name(), std::iter::once(runs).chain(medians).collect());
    }
    outcome.tables.push(table);
    outcome.claims.extend(claims);
    Ok(())
}

/// An addition helps when ISMA is worse without it on more functions than better.
fn helps(addition: Addition, whole: &Left, part: &Left, level: Level) -> Claim {
    // Six functions have six chances.
    let level = level.over(Function::ALL.len());
    let effects: Vec<Effect> = whole
        .samples()
        .zip(part.samples())
        .map(|((function, whole), (_, without))| {
            let isma = format!("{}: ISMA", function.name());
            Effect::ratio((&isma, &whole.values), (&part.name(), &without.values), (ROUNDING, level))
        })
        .collect();
    let is_better = |e: &&Effect| e.verdict() == Verdict::Holds;
    let is_worse = |e: &&Effect| e.estimate.interval[1] < 0.0;
    let (better, worse) = (effects.iter().filter(is_better).count(), effects.iter().filter(is_worse).count());
    let open = effects.iter().filter(|e| e.verdict() == Verdict::Open).count();
    let verdict = match better.cmp(&worse) {
        Ordering::Greater => Verdict::Holds,
        Ordering::Equal if open > 0 => Verdict::Open,
        Ordering::Equal | Ordering::Less => Verdict::DoesNotHold,
    };
    Claim::weighed(
        &format!("{} improves SMA's search", addition.title()),
        "at equal evaluations ISMA leaves less above the least value than without it on more of the six functions than more (holds), on \
         fewer or on none (does not hold), or some are open (not told apart); each function at a sixth of the level",
        verdict,
        effects,
    )
    .beside(format!("less on {better}, more on {worse} of 6"))
}
