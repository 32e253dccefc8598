//! The extreme points of a set in fixed directions, and the volume of their hull.
use crate::hull;
use parry3d_f64::math::Vector;

/// Points nearer to each other than this are one; all are within the unit cube.
const MERGED: f64 = 1e-4;
/// Of points that reach equally far but for rounding, the first is kept.
const TIE: f64 = 1e-9;
/// How far points may be outside of their hull.
const OUTSIDE: f64 = 1e-3;

/// Directions with small whole numbers, one of each opposite two: the same on every machine.
#[derive(Debug)]
pub(super) struct Directions(Vec<Vector>);

impl Directions {
    pub(super) fn new() -> Self {
        let step = |i: u32| f64::from(i % 5) - 2.0;
        let all = (0..125).map(|i| Vector::new(step(i), step(i / 5), step(i / 25)));
        let is_first = |d: &Vector| {
            let first = d.to_array().into_iter().find(|c| *c != 0.0);
            // Twice another one is the same direction.
            first.is_some_and(|c| c > 0.0) && d.abs().to_array().contains(&1.0)
        };
        Self(all.filter(is_first).collect())
    }

    /// Of no points.
    pub(super) fn extremes(&self) -> Extremes {
        Extremes(vec![(f64::NEG_INFINITY, Vector::ZERO); 2 * self.0.len()])
    }
}

/// The furthest points so far, and how far they are, in each direction and against it.
#[derive(Clone, Debug)]
pub(super) struct Extremes(Vec<(f64, Vector)>);

impl Extremes {
    /// Of several sets together.
    pub(super) fn of_all(sets: &[Self]) -> Self {
        let Some((first, others)) = sets.split_first() else { return Self(Vec::new()) };
        let mut all = first.clone();
        for other in others {
            for (slot, other) in all.0.iter_mut().zip(&other.0).filter(|(slot, other)| other.0 > slot.0 + TIE)
            {
                *slot = *other;
            }
        }
        all
    }

    pub(super) fn add(&mut self, directions: &Directions, point: Vector) {
        for (both, direction) in self.0.chunks_exact_mut(2).zip(&directions.0) {
            let reach = point.dot(*direction);
            for (slot, reach) in both.iter_mut().zip([reach, -reach]) {
                if reach > slot.0 + TIE {
                    *slot = (reach, point);
                }
            }
        }
    }

    /// Volume of the hull; none when there is none.
    pub(super) fn volume(&self) -> Option<f64> {
        let mut points: Vec<Vector> = Vec::new();
        for (reach, point) in &self.0 {
            if reach.is_finite() && points.iter().all(|other| (*other - *point).length() > MERGED) {
                points.push(*point);
            }
        }
        let build = |by: f64| hull::convex_mesh(&hull::scattered(&points, by), OUTSIDE);
        let (corners, faces) = build(hull::SCATTER).or_else(|| build(10.0 * hull::SCATTER))?;
        Some(hull::volume(&corners, &faces))
    }
}
