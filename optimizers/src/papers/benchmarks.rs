//! The benchmark functions F1 to F6 of Li, Xing and Qin (2025), also with their optimum moved.
//!
//! Source: its table 1, whose text has lost roots, squares and signs; written here as their authors have them. F2 is
//! the paper's, a sphere round -0.5: the floor of the classic Step function is lost, and with it the steps. F4's
//! least cost is that of its best single coordinate, 418.982887272433799807913601398, times the dimension.
use crate::Problem;
use std::f64::consts::{E, PI, TAU};
use taustream_arm::rng::SeededRng;

/// Which function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// F1, Rosenbrock's valley.
    Rosenbrock,
    /// F2 as printed.
    Step,
    /// F3, Ackley's.
    Ackley,
    /// F4, Schwefel's 2.26.
    Schwefel,
    /// F5, generalised penalised function 2.
    Penalised,
    /// F6, Griewank's.
    Griewank,
}

/// The coordinate of F4's least cost, and that cost.
const SCHWEFEL: [f64; 2] = [420.968_746_359_982, -418.982_887_272_433_8];

impl Function {
    /// All six, in the paper's order.
    pub const ALL: [Self; 6] =
        [Self::Rosenbrock, Self::Step, Self::Ackley, Self::Schwefel, Self::Penalised, Self::Griewank];

    /// The paper's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rosenbrock => "F1",
            Self::Step => "F2",
            Self::Ackley => "F3",
            Self::Schwefel => "F4",
            Self::Penalised => "F5",
            Self::Griewank => "F6",
        }
    }

    /// Half the side of its box, whose centre is the origin.
    #[must_use]
    pub fn half_side(self) -> f64 {
        match self {
            Self::Rosenbrock => 30.0,
            Self::Step => 100.0,
            Self::Ackley => 32.0,
            Self::Schwefel => 500.0,
            Self::Penalised => 50.0,
            Self::Griewank => 600.0,
        }
    }

    /// The value of every coordinate at the least cost.
    #[must_use]
    pub fn optimum(self) -> f64 {
        match self {
            Self::Rosenbrock | Self::Penalised => 1.0,
            Self::Step => -0.5,
            Self::Ackley | Self::Griewank => 0.0,
            Self::Schwefel => SCHWEFEL[0],
        }
    }

    /// The least cost in so many dimensions.
    #[must_use]
    pub fn least(self, dimensions: usize) -> f64 {
        if self == Self::Schwefel { SCHWEFEL[1] * dimensions as f64 } else { 0.0 }
    }

    /// Its value at a point.
    #[must_use]
    pub fn at(self, x: &[f64]) -> f64 {
        match self {
            Self::Rosenbrock => rosenbrock(x),
            Self::Step => x.iter().map(|x| (x + 0.5) * (x + 0.5)).sum(),
            Self::Ackley => ackley(x),
            Self::Schwefel => x.iter().map(|x| schwefel(*x)).sum(),
            Self::Penalised => penalised(x),
            Self::Griewank => griewank(x),
        }
    }
}

/// Beyond 500 the waves would continue and deepen; a moved function stays at its edge there and rises.
fn schwefel(x: f64) -> f64 {
    let inside = x.clamp(-500.0, 500.0);
    (x - inside).abs() - inside * inside.abs().sqrt().sin()
}

fn rosenbrock(x: &[f64]) -> f64 {
    let pair = |p: &[f64]| if let [a, b] = p { 100.0 * (b - a * a).powi(2) + (a - 1.0).powi(2) } else { 0.0 };
    x.windows(2).map(pair).sum()
}

fn ackley(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    let squares: f64 = x.iter().map(|x| x * x).sum();
    let waves: f64 = x.iter().map(|x| (TAU * x).cos()).sum();
    -20.0 * (-0.2 * (squares / n).sqrt()).exp() - (waves / n).exp() + 20.0 + E
}

fn penalised(x: &[f64]) -> f64 {
    let waved = |x: f64, next: f64| (x - 1.0).powi(2) * (1.0 + next.sin().powi(2));
    let [Some(first), Some(last)] = [x.first(), x.last()] else { return 0.0 };
    let between = |p: &[f64]| if let [a, b] = p { waved(*a, 3.0 * PI * b) } else { 0.0 };
    let middle: f64 = x.windows(2).map(between).sum();
    let outside: f64 = x.iter().map(|x| 100.0 * (x.abs() - 5.0).max(0.0).powi(4)).sum();
    0.1 * ((3.0 * PI * first).sin().powi(2) + middle + waved(*last, TAU * last)) + outside
}

fn griewank(x: &[f64]) -> f64 {
    let squares: f64 = x.iter().map(|x| x * x).sum();
    let waves: f64 = x.iter().enumerate().map(|(i, x)| (x / ((i + 1) as f64).sqrt()).cos()).product();
    squares / 4000.0 - waves + 1.0
}

/// A function over its box, perhaps moved.
///
/// Moving matters: some methods are drawn to the origin or move along the diagonal, where all six optima lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Benchmark {
    function: Function,
    bounds: Vec<[f64; 2]>,
    shift: Vec<f64>,
}

/// How far an optimum is moved at most, in sides of the box.
const SHIFT_MAX: f64 = 0.4;

impl Benchmark {
    /// As the paper has it.
    #[must_use]
    pub fn new(function: Function, dimensions: usize) -> Self {
        let half = function.half_side();
        Self { function, bounds: vec![[-half, half]; dimensions], shift: vec![0.0; dimensions] }
    }

    /// With the optimum moved by a seeded random vector of up to 0.4 half sides a coordinate. F4's optimum is near
    /// the box's edge, so it is moved towards the centre only.
    #[must_use]
    pub fn shifted(function: Function, dimensions: usize, seed: u64) -> Self {
        let mut rng = SeededRng::new(seed, 4);
        let reach = SHIFT_MAX * function.half_side();
        let high = if function == Function::Schwefel { 0.0 } else { reach };
        let shift = (0..dimensions).map(|_| rng.within(-reach, high)).collect();
        Self { shift, ..Self::new(function, dimensions) }
    }

    /// Where its least cost is.
    #[must_use]
    pub fn optimum(&self) -> Vec<f64> {
        self.shift.iter().map(|s| s + self.function.optimum()).collect()
    }
}

impl Problem for Benchmark {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let moved: Vec<f64> = x.iter().zip(&self.shift).map(|(x, s)| x - s).collect();
        self.function.at(&moved)
    }
}
