//! What the printed new start on the box's diagonal does: all six optima lie there.
use super::benchmarks::{DIMENSIONS, problem};
use crate::claim::Claim;
use crate::effect::Effect;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::Level;
use crate::table::{Cell, Table};
use crate::trial::{Sample, Trial, minimise};
use taustream_optimizers::papers::Function;
use taustream_optimizers::{Isma, Optimizer, Reading, Setup, Sma};

/// Runs and evaluations: 500 iterations of SMA.
const RUNS: usize = 10;
const BUDGET: usize = 50 + 50 * 500;
const QUICK: usize = 3_000;

/// What is compared: reading, and the probability of a new start (`None`: the paper's).
const VARIANTS: [(&str, Reading, Option<f64>); 3] = [
    ("corrected", Reading::Corrected, None),
    ("printed", Reading::Printed, None),
    ("printed, no new starts", Reading::Printed, Some(0.0)),
];

fn optimizer(method: &str, reading: Reading, restart: Option<f64>, budget: usize) -> Box<dyn Optimizer> {
    let setup = Setup { reading, evaluations: Some(budget) };
    let mut isma = Isma::set_up(setup);
    let mut sma = Sma::set_up(setup);
    isma.sma.restart = restart.unwrap_or(isma.sma.restart);
    sma.restart = restart.unwrap_or(sma.restart);
    if method == "isma" { Box::new(isma) } else { Box::new(sma) }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let (runs, budget) = (run_context.runs(RUNS, 3), run_context.choose(BUDGET, QUICK));
    let columns = ["", "paper, mean (isma)", "optimum as printed", "optimum moved", "evaluations"];
    let note = format!(
        "{runs} runs of {budget} evaluations, D = {DIMENSIONS}; median [quartiles] above the least value; the paper's \
         mean is that of table 2 less the least value"
    );
    let mut table = Table::new("New starts on the diagonal", "above the least value", &note, &columns);
    let mut claims = Vec::new();
    for (function, paper) in [(Function::Rosenbrock, 0.0584), (Function::Schwefel, -7496.7903)] {
        let least = function.least(DIMENSIONS);
        for method in ["sma", "isma"] {
            run_context.say(&format!("  diagonal: {method} on {} ..", function.name()));
            for (label, reading, restart) in VARIANTS {
                let ran = |is_moved| -> Result<Sample, Stop> {
                    let method = |_| optimizer(method, reading, restart, budget);
                    let trials: Vec<Trial> = run_context.each(runs, |run| {
                        let problem = problem(run_context, function, is_moved, run);
                        minimise(run_context, method(run).as_ref(), &problem, run_context.seed(run), budget)
                    })?;
                    Ok(Sample::from_trials(&trials, |t| t.found.cost - least))
                };
                let [here, moved] = [ran(false)?, ran(true)?];
                let is_paper = method == "isma" && reading == Reading::Printed && restart.is_none();
                table.row(
                    format!("{} {method}, {label}", function.name()),
                    vec![
                        if is_paper { Cell::Paper(paper - least) } else { Cell::None },
                        Cell::Median(here.summary()),
                        Cell::Median(moved.summary()),
                        Cell::maybe(here.evaluations),
                    ],
                );
                if is_paper {
                    claims.push(carries_over(function, &here, &moved));
                }
            }
        }
    }
    Ok(Outcome { tables: vec![table], claims, ..Outcome::default() })
}

fn carries_over(function: Function, here: &Sample, moved: &Sample) -> Claim {
    let [a, b] = [here, moved].map(|s| s.summary().median);
    let logs: Vec<f64> = here.values.iter().zip(&moved.values).map(|(a, b)| (b / a).ln()).collect();
    let what = "above the least value with the optimum moved, more than as printed by";
    Claim::tested(
        &format!("{} shows ISMA's ability, not where the optimum lies", function.name()),
        "what is left above the least value is at most twice as large (100 % more) once the optimum is moved",
        vec![Effect::no_rise(what, &logs, (100.0, Level::FIVE_PERCENT))],
    )
    .beside(format!("medians {} as printed, {} moved", figures(a), figures(b)))
}
