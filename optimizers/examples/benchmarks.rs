//! Runs an optimiser on one of the benchmark functions and prints what each run found.
//!
//! Usage: benchmarks METHOD F1..F6 DIMENSIONS EVALUATIONS RUNS [printed] [unshifted]
//!        benchmarks bands
//!
//! `bands` prints the least and the highest result of twenty short runs for every method and function, which
//! tests/benchmarks.rs holds against other seeds. Otherwise the first line is the optimum's place, then a line a run: its best so far, the best of its last population, and its
//! evaluations. Seeds are 1 to RUNS; the optimum is moved by the same vector in every run.
use anyhow::{Context, bail};
use taustream_optimizers::papers::{Benchmark, Function};
use taustream_optimizers::{METHODS, Optimizer, Problem, Reading, Run, Setup, Solution, by_name};

const USAGE: &str = "benchmarks METHOD F1..F6 DIMENSIONS EVALUATIONS RUNS [printed] [unshifted]";
/// Seed of the vector by which the optimum is moved.
const SHIFT_SEED: u64 = 1;

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if words == ["bands"] {
        return bands();
    }
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
        let found = run(optimizer.as_ref(), &problem, seed, evaluations)?;
        println!("{:e} {:e} {}", found.cost, found.progress.current, found.progress.evaluations);
    }
    Ok(())
}

fn run(
    optimizer: &dyn Optimizer,
    problem: &dyn Problem,
    seed: u64,
    evaluations_max: usize,
) -> anyhow::Result<Solution> {
    let (is_over, mut watch) = (|| false, |_: &_| ());
    let run = Run { seed, evaluations_max, guesses: &[], is_over: &is_over, watch: &mut watch };
    Ok(optimizer.minimise(problem, run)?)
}

/// Twenty runs of 5000 evaluations in five dimensions, for every method and function.
fn bands() -> anyhow::Result<()> {
    for method in METHODS {
        let optimizer = (method.make)(Setup { evaluations: Some(5_000), ..Setup::default() });
        for function in Function::ALL {
            let problem = Benchmark::shifted(function, 5, SHIFT_SEED);
            let (mut least, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
            for seed in 1..=20 {
                let cost = run(optimizer.as_ref(), &problem, seed, 5_000)?.cost;
                (least, highest) = (least.min(cost), highest.max(cost));
            }
            println!("{} {} {least:.3e} {highest:.3e}", method.name, function.name());
        }
    }
    Ok(())
}
