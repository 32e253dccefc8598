//! Interpolation by a non-uniform B-spline of degree seven (Li, Xing and Qin 2025).
//!
//! Joint positions at given times, and velocity, acceleration and jerk at both ends, give one curve per joint whose
//! derivatives up to the sixth are continuous. The parameter runs from 0 to 1 over the whole time.
//!
//! Source: eq. 5 to 16. Corrected against printed: the recursion's first denominator is u(i+p) - u(i); the derivative's
//! factor is k + 1 - l; and since velocity and acceleration at the ends are two equations too few, jerk is given too
//! (what is printed has no unique solution, so there is no printed reading here).
use super::linear::solve;

/// The degree k.
pub const DEGREE: usize = 7;
/// Derivatives that are given at each end.
const ENDS: usize = 3;
/// Most points; the equations are solved as a full matrix.
const POINTS_MAX: usize = 500;

/// Why there is no spline.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SplineError {
    /// Too few or too many points.
    #[error("{got} points are given; a spline needs from 2 to {POINTS_MAX}")]
    Points {
        /// How many.
        got: usize,
    },
    /// The number of intervals.
    #[error("{got} intervals are given for {points} points; one less than points is needed")]
    Intervals {
        /// How many.
        got: usize,
        /// For how many points.
        points: usize,
    },
    /// An interval's length.
    #[error("interval {interval} (from 0) lasts {value_s} s; a finite time above 0 is needed")]
    Interval {
        /// Which one.
        interval: usize,
        /// How long.
        value_s: f64,
    },
    /// A point's coordinates.
    #[error(
        "point {point} (from 0) has {got} joints or one that is no number; {expected} numbers are needed"
    )]
    Point {
        /// Which one.
        point: usize,
        /// How many joints it has.
        got: usize,
        /// How many the first one has.
        expected: usize,
    },
    /// A joint's limits.
    #[error(
        "joint {joint} (from 0 of {joints}) has the limit {value}; every joint needs three numbers above 0"
    )]
    Limit {
        /// Which joint.
        joint: usize,
        /// Of how many.
        joints: usize,
        /// The number; NaN for one that is missing or too many.
        value: f64,
    },
    /// The intervals differ so much that the equations have no solution in numbers of this precision.
    #[error(
        "the intervals differ too much: the shortest of {shortest_s} s is nothing beside the whole {total_s} s"
    )]
    Singular {
        /// The shortest interval.
        shortest_s: f64,
        /// All of them together.
        total_s: f64,
    },
}

/// A curve for several joints, from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    knots: Vec<f64>,
    /// Control points of every derivative from 0 to 6, for every joint.
    control: Vec<Vec<Vec<f64>>>,
    total_s: f64,
}

impl Spline {
    /// The curve through points (of joint positions in radians), which starts and ends with velocity, acceleration and
    /// jerk of nothing.
    ///
    /// # Errors
    /// When points and intervals do not fit each other, or are no numbers.
    pub fn through(points_rad: &[Vec<f64>], intervals_s: &[f64]) -> Result<Self, SplineError> {
        check(points_rad, intervals_s)?;
        let total_s: f64 = intervals_s.iter().sum();
        let knots = knots(intervals_s, total_s);
        let joints = points_rad.first().map_or(0, Vec::len);
        let rest = vec![vec![0.0; joints]; 2 * ENDS];
        let given: Vec<Vec<f64>> = points_rad.iter().cloned().chain(rest).collect();
        let solved = solve(equations(&knots, points_rad.len(), ENDS), given).ok_or_else(|| {
            let shortest_s = intervals_s.iter().copied().fold(f64::INFINITY, f64::min);
            SplineError::Singular { shortest_s, total_s }
        })?;
        let one = |joint: usize| derivatives(&knots, solved.iter().map(|row| row[joint]).collect());
        let control = (0..joints).map(one).collect();
        Ok(Self { knots, control, total_s })
    }

    /// How long it lasts.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.total_s
    }

    /// How many joints it moves.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.control.len()
    }

    /// Times at which its pieces join, from 0 to the end.
    #[must_use]
    pub fn joins_s(&self) -> Vec<f64> {
        self.knots[DEGREE..self.knots.len() - DEGREE].iter().map(|u| u * self.total_s).collect()
    }

    /// A bound of a derivative's magnitude over the whole curve: its control points enclose it. Nothing for a joint that is
    /// not there and for orders above the sixth.
    #[must_use]
    pub fn bound(&self, joint: usize, order: usize) -> f64 {
        let control = self.control.get(joint).and_then(|orders| orders.get(order));
        let most = control.map_or(0.0, |points| points.iter().fold(0.0, |most: f64, p| most.max(p.abs())));
        most / self.total_s.powi(i32::try_from(order).unwrap_or(0))
    }

    /// Position (order 0), velocity, acceleration, jerk (order 3) or a higher derivative of a joint at a time, which
    /// is held to the curve's. Nothing for a joint that is not there; derivatives above the degree are 0.
    #[must_use]
    pub fn at(&self, joint: usize, time_s: f64, order: usize) -> Option<f64> {
        let control = self.control.get(joint)?;
        let Some(control) = control.get(order) else { return Some(0.0) };
        let u = (time_s / self.total_s).clamp(0.0, 1.0);
        let u = if u.is_nan() { 0.0 } else { u };
        let knots = &self.knots[order..self.knots.len() - order];
        let scale = self.total_s.powi(i32::try_from(order).unwrap_or(0));
        Some(de_boor(knots, control, DEGREE - order, u) / scale)
    }
}

fn check(points_rad: &[Vec<f64>], intervals_s: &[f64]) -> Result<(), SplineError> {
    let points = points_rad.len();
    if !(2..=POINTS_MAX).contains(&points) {
        return Err(SplineError::Points { got: points });
    }
    if intervals_s.len() + 1 != points {
        return Err(SplineError::Intervals { got: intervals_s.len(), points });
    }
    let total_s: f64 = intervals_s.iter().sum();
    let is_time = |t: f64| t > 0.0 && t.is_finite() && total_s.is_finite();
    if let Some((interval, &value_s)) = intervals_s.iter().enumerate().find(|(_, t)| !is_time(**t)) {
        return Err(SplineError::Interval { interval, value_s });
    }
    let expected = points_rad.first().map_or(0, Vec::len);
    let is_point = |p: &Vec<f64>| p.len() == expected && p.iter().all(|q| q.is_finite());
    match points_rad.iter().enumerate().find(|(_, p)| !is_point(p)) {
        Some((point, p)) => Err(SplineError::Point { point, got: p.len(), expected }),
        None => Ok(()),
    }
}

/// k + 1 zeros, the inner times as shares of the whole, k + 1 ones.
fn knots(intervals_s: &[f64], total_s: f64) -> Vec<f64> {
    let mut knots = vec![0.0; DEGREE + 1];
    let mut passed_s = 0.0;
    for interval_s in &intervals_s[..intervals_s.len() - 1] {
        passed_s += interval_s;
        knots.push(passed_s / total_s);
    }
    knots.extend([1.0; DEGREE + 1]);
    knots
}

/// The equations of a curve when only the first `ends` derivatives (up to six) are given at each end: a row a
/// condition, a column a control point. [`Spline::through`] gives three; the paper lists two, which are too few.
///
/// # Errors
/// When the intervals make no sense.
pub fn conditions(intervals_s: &[f64], ends: usize) -> Result<Vec<Vec<f64>>, SplineError> {
    let points = intervals_s.len() + 1;
    check(&vec![Vec::new(); points], intervals_s)?;
    let knots = knots(intervals_s, intervals_s.iter().sum());
    Ok(equations(&knots, points, ends.min(DEGREE - 1)))
}

/// A row a condition, a column a control point: positions, then the derivatives at the start and at the end.
fn equations(knots: &[f64], points: usize, ends: usize) -> Vec<Vec<f64>> {
    let size = points + DEGREE - 1;
    let mut matrix = vec![vec![0.0; size]; points + 2 * ends];
    for column in 0..size {
        let mut unit = vec![0.0; size];
        unit[column] = 1.0;
        let curves = derivatives(knots, unit);
        for point in 0..points {
            matrix[point][column] = de_boor(knots, &curves[0], DEGREE, knots[DEGREE + point]);
        }
        for order in 1..=ends {
            let inner = &knots[order..knots.len() - order];
            for (end, u) in [0.0, 1.0].into_iter().enumerate() {
                let row = points + ends * end + order - 1;
                matrix[row][column] = de_boor(inner, &curves[order], DEGREE - order, u);
            }
        }
    }
    matrix
}

/// Control points of a curve and of its derivatives with respect to the parameter, up to the sixth.
fn derivatives(knots: &[f64], control: Vec<f64>) -> Vec<Vec<f64>> {
    let mut all = vec![control];
    for order in 1..DEGREE {
        let (degree, inner) = (DEGREE + 1 - order, &knots[order - 1..=knots.len() - order]);
        let last = &all[order - 1];
        let next = last.windows(2).enumerate().map(|(r, pair)| {
            let width = inner[r + degree + 1] - inner[r + 1];
            let rise = if let [a, b] = pair { b - a } else { 0.0 };
            if width > 0.0 { degree as f64 * rise / width } else { 0.0 }
        });
        let next = next.collect();
        all.push(next);
    }
    all
}

/// The curve's value, by de Boor's scheme: only averages of control points.
fn de_boor(knots: &[f64], control: &[f64], degree: usize, u: f64) -> f64 {
    let last = control.len() - 1;
    // The span whose knots enclose u; the end belongs to the last one.
    let span = knots[..=last].partition_point(|k| *k <= u).clamp(degree + 1, last + 1) - 1;
    let mut points: [f64; DEGREE + 1] = [0.0; DEGREE + 1];
    points[..=degree].copy_from_slice(&control[span - degree..=span]);
    for level in 1..=degree {
        for i in (level..=degree).rev() {
            let (left, right) = (knots[span - degree + i], knots[span + 1 + i - level]);
            let share = if right > left { (u - left) / (right - left) } else { 0.0 };
            points[i] = (1.0 - share) * points[i - 1] + share * points[i];
        }
    }
    points[degree]
}
