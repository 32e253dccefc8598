//! What is minimised, and what is refused before the first evaluation.

/// Most coordinates; a bound against absurd arguments (times the largest population: 800 MB).
const DIMENSIONS_MAX: usize = 10_000;

/// A cost over a box.
pub trait Problem {
    /// Lowest and highest value of each coordinate.
    fn bounds(&self) -> &[[f64; 2]];

    /// The cost of a point inside the bounds. One that is not finite counts as [`super::WORTHLESS`].
    fn cost(&self, x: &[f64]) -> f64;

    /// What is reported for the winner, where [`Self::cost`] is a fast approximation; `None` where it is not one.
    fn exact_cost(&self, _x: &[f64]) -> Option<f64> {
        None
    }

    /// How many points [`Self::costs`] likes at once. Cancellation is looked at between two batches.
    fn batch(&self) -> usize {
        1
    }

    /// The costs of many points, in their order: the same values as [`Self::cost`] gives one by one.
    fn costs(&self, points: &[Vec<f64>]) -> Vec<f64> {
        points.iter().map(|x| self.cost(x)).collect()
    }
}

/// Evaluates a problem's batches on several threads.
#[derive(Clone, Copy, Debug)]
pub struct Parallel<'a, P: ?Sized> {
    /// The problem.
    pub problem: &'a P,
    /// Threads; one or none is the calling thread.
    pub threads: usize,
}

/// Points a thread gets at once: enough to pay for starting it.
const POINTS_PER_THREAD: usize = 16;
/// Most threads; a bound against absurd arguments.
const THREADS_MAX: usize = 256;

impl<P: Problem + Sync + ?Sized> Problem for Parallel<'_, P> {
    fn bounds(&self) -> &[[f64; 2]] {
        self.problem.bounds()
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.problem.cost(x)
    }

    fn exact_cost(&self, x: &[f64]) -> Option<f64> {
        self.problem.exact_cost(x)
    }

    fn batch(&self) -> usize {
        POINTS_PER_THREAD * self.threads.clamp(1, THREADS_MAX)
    }

    fn costs(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let threads = self.threads.clamp(1, THREADS_MAX);
        let share = points.len().div_ceil(threads).max(1);
        let mut costs = vec![f64::NAN; points.len()];
        std::thread::scope(|scope| {
            let mut shares = points.chunks(share).zip(costs.chunks_mut(share));
            let own = shares.next();
            for (points, costs) in shares {
                scope.spawn(move || self.fill(points, costs));
            }
            if let Some((points, costs)) = own {
                self.fill(points, costs);
            }
        });
        costs
    }
}

impl<P: Problem + Sync + ?Sized> Parallel<'_, P> {
    fn fill(&self, points: &[Vec<f64>], costs: &mut [f64]) {
        for (cost, one) in costs.iter_mut().zip(self.problem.costs(points)) {
            *cost = one;
        }
    }
}

/// Why a run does not start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The number of coordinates.
    #[error("the problem has {got} coordinates; from 1 to {DIMENSIONS_MAX} are possible")]
    Dimensions {
        /// How many there are.
        got: usize,
    },
    /// A coordinate's bounds.
    #[error(
        "coordinate {coordinate} (of 0..{dimensions}) has the bounds {low} to {high}; give two finite numbers, the \
         lower one first, whose difference is finite"
    )]
    Bounds {
        /// Which one, from 0.
        coordinate: usize,
        /// Of how many.
        dimensions: usize,
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// A number of the method.
    #[error("{method}: {what} is {value}; {expected}")]
    Parameter {
        /// Which method.
        method: &'static str,
        /// Which of its numbers.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What is possible.
        expected: &'static str,
    },
}

impl Refusal {
    /// Refuses a box that is no box; a side of length nothing is one (that coordinate is fixed).
    pub(super) fn check_box(bounds: &[[f64; 2]]) -> Result<(), Self> {
        let dimensions = bounds.len();
        if dimensions == 0 || dimensions > DIMENSIONS_MAX {
            return Err(Self::Dimensions { got: dimensions });
        }
        for (coordinate, &[low, high]) in bounds.iter().enumerate() {
            if !(low <= high && (high - low).is_finite()) {
                return Err(Self::Bounds { coordinate, dimensions, low, high });
            }
        }
        Ok(())
    }

    /// Refuses a number outside its range, NaN included.
    ///
    /// # Errors
    /// [`Self::Parameter`] then.
    pub fn check_number(
        method: &'static str,
        what: &'static str,
        value: f64,
        [low, high]: [f64; 2],
        expected: &'static str,
    ) -> Result<(), Self> {
        if value >= low && value <= high {
            return Ok(());
        }
        Err(Self::Parameter { method, what, value, expected })
    }

    /// Refuses numbers of which one is not finite.
    ///
    /// # Errors
    /// [`Self::Parameter`] with the first such number.
    pub fn check_finite(method: &'static str, what: &'static str, values: &[f64]) -> Result<(), Self> {
        match values.iter().find(|v| !v.is_finite()) {
            Some(&value) => {
                Err(Self::Parameter { method, what, value, expected: "a finite number is needed" })
            }
            None => Ok(()),
        }
    }
}
