//! Cubics of least energy through via points of the two-link arm (Sengupta et al. 2011, stage 2).
//!
//! Between two via points each angle is a cubic in time; position and speed carry over from piece to piece and the last
//! coefficient, `a_3` of θ and `b_3` of φ, is chosen to make the integral of the mechanical energy least. The arm starts
//! at rest.
//!
//! Source: eq. 8 to 13. Corrected against printed: the last piece ends at rest (printed: its end speed is left free, so
//! that the arm does not stop at the goal). That integral has the unit of an action and contains the constant energy
//! of the base's height; the energy that joints spend is [`Cubics::work`].
use super::quadrature::gauss;
use super::two_link::{Moving, TwoLink};
use crate::{Optimizer, Problem, Progress, Reading, Refusal, Run, Solution};

/// Pieces of the rule of integration an interval.
const PANELS: u32 = 6;

/// One piece: the coefficients of θ and of φ, by rising power of time.
pub type Piece = [[f64; 4]; 2];

/// The whole motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Cubics {
    /// The pieces in order.
    pub pieces: Vec<Piece>,
    /// How long each lasts.
    pub piece_s: f64,
}

/// The problem of one piece: `a_3` and `b_3`.
#[derive(Clone, Debug, PartialEq)]
pub struct PieceEnergy {
    /// The arm.
    pub arm: TwoLink,
    /// From and to, in radians.
    pub angles_rad: [[f64; 2]; 2],
    /// Speeds at the start.
    pub speed_rad_s: [f64; 2],
    /// How long it lasts.
    pub piece_s: f64,
    /// Bounds of `a_3` and `b_3`, in rad/s³.
    pub bounds: [[f64; 2]; 2],
}

impl PieceEnergy {
    /// The piece of a choice; `a_2` follows from the end position (eq. 11).
    #[must_use]
    pub fn piece(&self, cubic: [f64; 2]) -> Piece {
        let t = self.piece_s;
        std::array::from_fn(|j| {
            let (from, to, v, c) =
                (self.angles_rad[0][j], self.angles_rad[1][j], self.speed_rad_s[j], cubic[j]);
            [from, v, (to - from - v * t - c * t * t * t) / (t * t), c]
        })
    }

    /// The choice that ends at rest.
    #[must_use]
    pub fn to_rest(&self) -> [f64; 2] {
        let t = self.piece_s;
        std::array::from_fn(|j| {
            let (distance, v) = (self.angles_rad[1][j] - self.angles_rad[0][j], self.speed_rad_s[j]);
            (v * t - 2.0 * distance) / (t * t * t)
        })
    }
}

impl Problem for PieceEnergy {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let [a3, b3] = x else { return f64::INFINITY };
        let piece = self.piece([*a3, *b3]);
        integral(self.piece_s, |t| self.arm.energy(&moving(&piece, t)).iter().sum())
    }
}

/// Where a piece is at a time.
#[must_use]
pub fn moving(piece: &Piece, t: f64) -> Moving {
    Moving {
        angle_rad: piece.map(|[a, b, c, d]| a + t * (b + t * (c + t * d))),
        speed_rad_s: piece.map(|[_, b, c, d]| b + t * (2.0 * c + t * 3.0 * d)),
        acceleration_rad_s2: piece.map(|[_, _, c, d]| 2.0 * c + 6.0 * d * t),
    }
}

fn integral(until_s: f64, f: impl Fn(f64) -> f64) -> f64 {
    let panel = until_s / f64::from(PANELS);
    (0..PANELS).map(|i| gauss(panel * f64::from(i), panel * f64::from(i + 1), &f)).sum()
}

/// How cubics are looked for.
pub struct CubicSearch<'a> {
    /// The arm.
    pub arm: TwoLink,
    /// How long a piece lasts.
    pub piece_s: f64,
    /// The method; the paper's is IWO.
    pub optimizer: &'a dyn Optimizer,
    /// Most evaluations a piece.
    pub evaluations_max: usize,
    /// Seed of the first piece; every later one has the next.
    pub seed: u64,
    /// Printed: the last piece's end speed is free.
    pub reading: Reading,
}

/// Largest speed that the bounds of the search allow at a piece's end, in ways of that piece a second; the least way
/// that counts is a tenth of a radian.
const SPEED_BOUND: f64 = 6.0;
const DISTANCE_MIN_RAD: f64 = 0.1;

impl CubicSearch<'_> {
    /// Cubics of least energy through via points in radians.
    ///
    /// # Errors
    /// When the optimiser's numbers make no sense or the points are no numbers.
    pub fn through(&self, via_rad: &[[f64; 2]]) -> Result<Cubics, Refusal> {
        let (who, above) = ("cubics", "a time above 0 is needed");
        Refusal::check_number(who, "the time of a piece", self.piece_s, [1e-6, 1e6], above)?;
        Refusal::check_finite(who, "a via point", via_rad.as_flattened())?;
        let mut pieces = Vec::new();
        let mut speed_rad_s = [0.0; 2];
        let last = via_rad.len().saturating_sub(2);
        for (i, pair) in via_rad.windows(2).enumerate() {
            let [from, to] = pair else { continue };
            let problem = self.problem([*from, *to], speed_rad_s);
            let rests = i == last && self.reading == Reading::Corrected;
            let cubic = if rests { problem.to_rest() } else { self.least(&problem, i as u64)? };
            let piece = problem.piece(cubic);
            speed_rad_s = moving(&piece, self.piece_s).speed_rad_s;
            pieces.push(piece);
        }
        Ok(Cubics { pieces, piece_s: self.piece_s })
    }

    /// Bounds round the choice that ends at rest, wide enough for any speed that makes sense.
    fn problem(&self, angles_rad: [[f64; 2]; 2], speed_rad_s: [f64; 2]) -> PieceEnergy {
        let (arm, piece_s) = (self.arm, self.piece_s);
        let mut problem = PieceEnergy { arm, angles_rad, speed_rad_s, piece_s, bounds: [[0.0; 2]; 2] };
        let centre = problem.to_rest();
        problem.bounds = std::array::from_fn(|j| {
            let distance = (angles_rad[1][j] - angles_rad[0][j]).abs().max(speed_rad_s[j].abs() * piece_s);
            let half = SPEED_BOUND * distance.max(DISTANCE_MIN_RAD) / piece_s.powi(3);
            [centre[j] - half, centre[j] + half]
        });
        problem
    }

    fn least(&self, problem: &PieceEnergy, piece: u64) -> Result<[f64; 2], Refusal> {
        let (is_over, mut watch) = (|| false, |_: &Progress| ());
        let run = Run {
            seed: self.seed.wrapping_add(piece),
            evaluations_max: self.evaluations_max.max(1),
            guesses: &[],
            is_over: &is_over,
            watch: &mut watch,
        };
        let Solution { x, .. } = self.optimizer.minimise(problem, run)?;
        Ok(if let [a3, b3] = x.as_slice() { [*a3, *b3] } else { problem.to_rest() })
    }
}

impl Cubics {
    /// The integral of the mechanical energy, which the paper minimises (its unit is energy times time).
    #[must_use]
    pub fn action(&self, arm: &TwoLink) -> f64 {
        let piece = |p: &Piece| integral(self.piece_s, |t| arm.energy(&moving(p, t)).iter().sum());
        self.pieces.iter().map(piece).sum()
    }

    /// The work that the joints do or take, the integral of the magnitude of torque times speed: what a drive without
    /// recovery spends.
    #[must_use]
    pub fn work(&self, arm: &TwoLink) -> f64 {
        let power = |p: &Piece, t: f64| {
            let moving = moving(p, t);
            let pairs = arm.torques(&moving).into_iter().zip(moving.speed_rad_s);
            pairs.map(|(torque, speed)| (torque * speed).abs()).sum::<f64>()
        };
        self.pieces.iter().map(|p| integral(self.piece_s, |t| power(p, t))).sum()
    }

    /// Angles and derivatives at a time, which is held to the motion's; `None` when there is no piece.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Moving> {
        let mut left_s = time_s.max(0.0);
        let last = self.pieces.last()?;
        for piece in &self.pieces[..self.pieces.len() - 1] {
            if left_s < self.piece_s {
                return Some(moving(piece, left_s));
            }
            left_s -= self.piece_s;
        }
        Some(moving(last, left_s.min(self.piece_s)))
    }
}
