//! Runs an optimiser on one of the benchmark functions and prints what each run found.
//!
//! Usage: benchmarks METHOD F1..F6 DIMENSIONS EVALUATIONS RUNS [printed] [unshifted]
//!
//! The first line is the optimum's place, then a line a run: its best so far, the best of its last population, and its
//! evaluations. Seeds are 1 to RUNS; the optimum is moved by the same vector in every run.
use anyhow::{Context, bail};
use taustream_planner::optimize::{Reading, Run, Setup, by_name};
use taustream_planner::papers::{Benchmark, Function};

const USAGE: &str = "benchmarks METHOD F1..F6 DIMENSIONS EVALUATIONS RUNS [printed] [unshifted]";
/// Seed of the vector by which the optimum is moved.
const SHIFT_SEED: u64 = 1;

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [method, function, dimensions, evaluations, runs, rest @ ..] = words.as_slice() else {
        bail!("usage: {USAGE}")
    };
    if let Some(word) = rest.iter().find(|w| !["printed", "unshifted"].contains(&w.as_str())) {
        bail!("{word} is neither printed nor unshifted; usage: {USAGE}");
    }
    let has = |word: &str| rest.iter().any(|w| w == word);
    let reading = if has("printed") { Reading::Printed } else { Reading::Corrected };
    let function = Function::ALL.into_iter().find(|f| f.name() == function).context(USAGE)?;
    let (dimensions, evaluations): (usize, usize) = (dimensions.parse()?, evaluations.parse()?);
    let problem = if has("unshifted") {
        Benchmark::new(function, dimensions)
    } else {
        Benchmark::shifted(function, dimensions, SHIFT_SEED)
    };
    println!("{}", problem.optimum().iter().map(f64::to_string).collect::<Vec<_>>().join(" "));

    let optimizer = by_name(method, Setup { reading, evaluations: Some(evaluations) })?;
    for seed in 1..=runs.parse()? {
        let (is_over, mut watch) = (|| false, |_: &_| ());
        let run =
            Run { seed, evaluations_max: evaluations, guesses: &[], is_over: &is_over, watch: &mut watch };
        let found = optimizer.minimise(&problem, run)?;
        println!("{:e} {:e} {}", found.cost, found.progress.current, found.progress.evaluations);
    }
    Ok(())
}
