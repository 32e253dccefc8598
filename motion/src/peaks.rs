//! Peak constants of one stroke: how fast, how strong and how jerky it gets, in closed form.
//!
//! With x = s^m and n = 1/k, each derivative of phi = 1 - (1 - x)^n is, for b = n - j and a = m - j,
//!
//! ```text
//! phi^(j) = n m s^a (1 - x)^b P_j(x),   P_1 = 1,   P_(j+1) = (a - (a + b m) x) P_j + m x (1 - x) P_j'
//! ```
//!
//! so the peaks of velocity, acceleration and jerk sit at the roots of a linear, a quadratic and a cubic in x.
//!
//! Source: Wang et al. (2022), its profiles Tau-J (m = 3) and Tau-J* (m = 4); the constants are ours,
//! checked against 40-digit arithmetic.
use core::f64::consts::PI;

/// Peaks of a unit stroke: |velocity| <= `c_v` |delta|/T, |acceleration| <= `c_a` |delta|/T^2 and
/// |jerk| <= `c_j` |delta|/T^3.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PeakConstants {
    /// Highest first derivative of phi by s.
    pub c_v: f64,
    /// Highest magnitude of the second derivative.
    pub c_a: f64,
    /// Highest magnitude of the third derivative.
    pub c_j: f64,
    /// Highest positive second derivative (speeding up).
    pub c_a_positive: f64,
    /// Highest magnitude of the negative second derivative (slowing down).
    pub c_a_negative: f64,
    /// Where in the stroke, s in [0, 1], `c_v` is reached.
    pub s_v: f64,
    /// Where `c_a` is reached.
    pub s_a: f64,
    /// Where `c_j` is reached.
    pub s_j: f64,
}

/// Peak constants of the Tau-J* stroke on the wire, phi = 1 - (1 - s^4)^n. An `n` below 4 counts as 4.
#[must_use]
pub fn peak_constants(n: u32) -> PeakConstants {
    family(4, f64::from(n.max(crate::stroke::N_MIN)))
}

/// Peak constants of phi = 1 - (1 - s^m)^n for m = 3 (Tau-J) or 4 (Tau-J*) and any real n above 3.
pub(crate) fn family(m: u32, n: f64) -> PeakConstants {
    let shape = ProfileShape { m: f64::from(m), n };
    let p2 = shape.next([1.0, 0.0, 0.0, 0.0], 1.0);
    let p3 = shape.next(p2, 2.0);
    let p4 = shape.next(p3, 3.0);

    let x_v = root_between(&p2, 0.0, 1.0);
    let [low_a, high_a] = quadratic_roots(&p3);
    let mut peaks = PeakConstants {
        c_v: shape.derivative(1.0, &[1.0, 0.0, 0.0, 0.0], x_v),
        s_v: shape.s(x_v),
        c_a_positive: shape.derivative(2.0, &p2, low_a),
        c_a_negative: -shape.derivative(2.0, &p2, high_a),
        ..PeakConstants::default()
    };
    let speeding_up = peaks.c_a_positive >= peaks.c_a_negative;
    peaks.c_a = peaks.c_a_positive.max(peaks.c_a_negative);
    peaks.s_a = shape.s(if speeding_up { low_a } else { high_a });
    // Tau-J starts with a jerk, so x = 0 is a candidate beside the roots.
    let [r1, r2, r3] = cubic_roots(&p4);
    for x in [0.0, r1, r2, r3] {
        let jerk = shape.derivative(3.0, &p3, x).abs();
        if jerk > peaks.c_j {
            peaks.c_j = jerk;
            peaks.s_j = shape.s(x);
        }
    }
    peaks
}

/// The two exponents of the family.
struct ProfileShape {
    m: f64,
    n: f64,
}

impl ProfileShape {
    /// `P_(j+1)` of `P_j`, as coefficients from x^0 up; degree 2 at most goes in.
    fn next(&self, p: [f64; 4], j: f64) -> [f64; 4] {
        let (a, b) = (self.m - j, self.n - j);
        let fall = a + b * self.m;
        let [p0, p1, p2, _] = p;
        // a P - fall x P + m x P' - m x^2 P', coefficient by coefficient.
        [
            a * p0,
            a * p1 - fall * p0 + self.m * p1,
            a * p2 - fall * p1 + 2.0 * self.m * p2 - self.m * p1,
            -fall * p2 - 2.0 * self.m * p2,
        ]
    }

    /// The j-th derivative of phi where s^m = x.
    fn derivative(&self, j: f64, p: &[f64; 4], x: f64) -> f64 {
        let s_part = libm::pow(self.s(x), self.m - j);
        self.n * self.m * s_part * libm::pow(1.0 - x, self.n - j) * value(p, x)
    }

    fn s(&self, x: f64) -> f64 {
        if self.m < 3.5 { libm::cbrt(x) } else { libm::sqrt(libm::sqrt(x)) }
    }
}

fn value(p: &[f64; 4], x: f64) -> f64 {
    let [p0, p1, p2, p3] = *p;
    p0 + x * (p1 + x * (p2 + x * p3))
}

/// The root of a linear polynomial, kept inside an interval that must hold it.
fn root_between(p: &[f64; 4], low: f64, high: f64) -> f64 {
    let [p0, p1, ..] = *p;
    (-p0 / p1).clamp(low, high)
}

/// Both roots of a quadratic that has two real ones, lower first, without cancellation.
fn quadratic_roots(p: &[f64; 4]) -> [f64; 2] {
    let [c, b, a, _] = *p;
    let root = libm::sqrt((b * b - 4.0 * a * c).max(0.0));
    let q = -0.5 * (b + libm::copysign(root, b));
    let (r1, r2) = (q / a, c / q);
    if r1 <= r2 { [r1, r2] } else { [r2, r1] }
}

/// The three roots of a cubic that has three real ones (Viete), each polished by two Newton steps.
///
/// Rolle's theorem gives the three: phi''' is zero at 0, at the two peaks of phi'' and at 1.
fn cubic_roots(p: &[f64; 4]) -> [f64; 3] {
    let [d, c, b, a] = *p;
    let shift = b / (3.0 * a);
    let linear = c / a - 3.0 * shift * shift;
    let constant = 2.0 * shift * shift * shift - shift * c / a + d / a;
    let radius = 2.0 * libm::sqrt((-linear / 3.0).max(0.0));
    let angle = libm::acos((3.0 * constant / (linear * radius)).clamp(-1.0, 1.0)) / 3.0;
    [0.0, 1.0, 2.0].map(|third| {
        let mut x = radius * libm::cos(angle - 2.0 * PI * third / 3.0) - shift;
        for _ in 0..2 {
            let slope = c + x * (2.0 * b + x * 3.0 * a);
            let step = value(p, x) / slope;
            if step.is_finite() {
                x -= step;
            }
        }
        x.clamp(0.0, 1.0)
    })
}
