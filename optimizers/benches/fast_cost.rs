//! How many times as fast the fast cost is as the plain one, by instruction set; fails where it gains too little.
//!
//! Run with `cargo bench -p taustream-optimizers --bench fast_cost`. It notices code that runs without the instructions that it was
//! made for: calls of a library in their place, or one for each operation, cost a multiple of what is gained. The best
//! of several rounds of either counts, alternating, so that a busy machine slows both.
use anyhow::{Context, Result, ensure};
use std::f64::consts::PI;
use std::path::Path;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_arm::rng::SeededRng;
use taustream_optimizers::cost::{CostModel, Level, PaperCost};
use taustream_optimizers::papers::control_points::{CONTROL_POINTS, Case};

const ROUNDS: usize = 21;
const VECTORS: usize = 40;

fn main() -> Result<()> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
    let robot = Robot::load(&file)?;
    let model = CostModel::default();
    let case = Case::random(&robot, &model, 3).context("no room in this case")?;
    let problem = case.problem(&robot, CONTROL_POINTS, model).context("the case does not fit")?;
    let mut rng = SeededRng::new(1, 0);
    let straight = problem.straight();
    let mut vector = |i: usize| -> Vec<f64> {
        let spread = [0.01, 0.3, 1.0, 3.0][i % 4];
        straight.iter().map(|x| (x + spread * rng.within(-1.0, 1.0)).clamp(-PI, PI)).collect()
    };
    let free = |x: &Vec<f64>| problem.rate_exactly(x).is_some_and(|cost| !cost.collision);
    let xs: Vec<Vec<f64>> = (0..400).map(&mut vector).filter(free).take(VECTORS).collect();
    ensure!(xs.len() == VECTORS, "only {} vectors without collision", xs.len());
    for level in Level::available() {
        let fast = problem.clone().on(level);
        let time = |rate: &dyn Fn(&[f64]) -> Option<PaperCost>| {
            let start = Instant::now();
            let sum: f64 = xs.iter().filter_map(|x| rate(x)).map(|cost| cost.cost).sum();
            std::hint::black_box(sum);
            start.elapsed()
        };
        let (mut plain_best, mut fast_best) = (Duration::MAX, Duration::MAX);
        for _ in 0..ROUNDS {
            plain_best = plain_best.min(time(&|x| problem.rate_exactly(x)));
            fast_best = fast_best.min(time(&|x| fast.rate(x)));
        }
        let ratio = plain_best.as_secs_f64() / fast_best.as_secs_f64();
        // Measured, quiet: 2.5, 26 and 41 times.
        let least = if level.lanes() == 1 { 1.0 } else { 4.0 };
        println!("{}: {ratio:.1} times as fast as {plain_best:?} for {} of them", level.name(), xs.len());
        ensure!(ratio > least, "{}: {ratio:.2} times as fast, at least {least} was expected", level.name());
    }
    Ok(())
}
