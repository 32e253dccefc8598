//! Via points of the two-link arm, found greedily one step at a time (Sengupta et al. 2011, stage 1).
//!
//! A step of up to 20 degrees an angle is chosen to come near the goal, at a price for every sphere of the arm that
//! touches an obstacle (highest at its centre) and for every angle out of its range.
//!
//! Source: eq. 4 to 7, with the numbers of the paper's tests. Corrected against printed: angles count in radians
//! (printed: degrees, in which a full step earns more than any graze costs). In both readings: five spheres a link at
//! its tenths 1, 3, 5, 7, 9, since the paper draws them and gives no number; the goal is reached within
//! [`REACHED_RAD`]. Via points lie exactly where the penalty begins, so that whatever joins them cuts into it: a margin
//! on the radius and a check of the motion are the user's.
use super::two_link::TwoLink;
use crate::{Optimizer, Problem, Progress, Reading, Refusal, Run, Solution};

/// How near the goal an angle has to come: what is left of it in a step is the optimiser's last digit.
pub const REACHED_RAD: f64 = 0.01;
/// Largest change of an angle in a step.
pub const STEP_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Most steps; a greedy walk may be caught in front of an obstacle.
const STEPS_MAX: usize = 200;
/// Spheres of a link, in the middles of as many equal parts: the paper draws them and gives no number.
const SPHERES: u32 = 5;

/// Obstacles, goal and prices.
#[derive(Clone, Debug, PartialEq)]
pub struct ViaTask {
    /// The arm.
    pub arm: TwoLink,
    /// Where it starts.
    pub start_rad: [f64; 2],
    /// Where it has to go.
    pub goal_rad: [f64; 2],
    /// Centres of the spherical obstacles.
    pub obstacles: Vec<[f64; 3]>,
    /// Spheres of a link, in the middles of as many equal parts.
    pub spheres: u32,
    /// Radii of the arm's spheres and of the obstacles.
    pub radii: [f64; 2],
    /// K1 to K4: way of θ, way of φ, penalty, an angle out of range.
    pub weights: [f64; 4],
    /// How near the goal an angle has to come.
    pub reached_rad: f64,
    /// Which reading.
    pub reading: Reading,
}

impl ViaTask {
    /// The paper's test: four spheres round the corners of a square of side 1.5.
    #[must_use]
    pub fn paper_004(reading: Reading) -> Self {
        let quarter = std::f64::consts::FRAC_PI_2;
        Self {
            arm: TwoLink::PAPER_004,
            start_rad: [0.0; 2],
            goal_rad: [quarter; 2],
            obstacles: vec![[3.0, 8.0, 3.0], [3.0, 9.5, 3.0], [3.0, 8.0, 4.5], [3.0, 9.5, 4.5]],
            spheres: SPHERES,
            // Half the diagonal of a cube of side 1.5; the paper prints 1.29.
            radii: [0.5, 0.75 * 3.0_f64.sqrt()],
            weights: [10.0, 10.0, 100.0, 10_000.0],
            reached_rad: REACHED_RAD,
            reading,
        }
    }

    /// Distances between the arm's spheres and the obstacles.
    fn distances(&self, angles_rad: [f64; 2]) -> impl Iterator<Item = f64> + '_ {
        let [elbow, tip] = self.arm.points(angles_rad);
        let count = self.spheres;
        let spheres = [([0.0; 3], elbow), (elbow, tip)].into_iter().flat_map(move |(from, to)| {
            let shares = (0..count).map(move |i| (f64::from(i) + 0.5) / f64::from(count));
            shares.map(move |share| -> [f64; 3] {
                std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
            })
        });
        spheres.flat_map(move |sphere| {
            let distance =
                move |o: &[f64; 3]| sphere.iter().zip(o).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
            self.obstacles.iter().map(distance)
        })
    }

    /// Least distance between a sphere's centre and an obstacle's; infinite without obstacles.
    #[must_use]
    pub fn distance(&self, angles_rad: [f64; 2]) -> f64 {
        self.distances(angles_rad).fold(f64::INFINITY, f64::min)
    }

    /// Eq. 7 for a via point.
    #[must_use]
    pub fn price(&self, angles_rad: [f64; 2]) -> f64 {
        let ([k1, k2, k3, k4], contact) = (self.weights, self.radii[0] + self.radii[1]);
        let unit = match self.reading {
            Reading::Corrected => 1.0,
            Reading::Printed => 1.0_f64.to_degrees(),
        };
        let travel = |j: usize| unit * (self.goal_rad[j] - angles_rad[j]).abs();
        let touching = self.distances(angles_rad).filter(|x| *x < contact);
        let penalty: f64 = touching.map(|x| (-x / contact).exp()).sum();
        let outside =
            angles_rad.iter().zip(TwoLink::RANGES_RAD).filter(|(q, [low, high])| *q < low || *q > high);
        k1 * travel(0) + k2 * travel(1) + k3 * penalty + k4 * outside.count() as f64
    }

    /// Walks from the start to the goal.
    ///
    /// # Errors
    /// When the optimiser's numbers make no sense.
    pub fn walk(
        &self,
        optimizer: &dyn Optimizer,
        evaluations_max: usize,
        seed: u64,
    ) -> Result<ViaPath, Refusal> {
        let mut via_rad = vec![self.start_rad];
        let (mut here, mut reached) = (self.start_rad, self.is_goal(self.start_rad));
        for step in 0..STEPS_MAX as u64 {
            if reached {
                break;
            }
            let (is_over, mut watch) = (|| false, |_: &Progress| ());
            let seed = seed.wrapping_mul(STEPS_MAX as u64).wrapping_add(step);
            let run = Run { seed, evaluations_max, guesses: &[], is_over: &is_over, watch: &mut watch };
            let Solution { x, .. } = optimizer.minimise(&Step { task: self, from_rad: here }, run)?;
            let [theta, phi] = x.as_slice() else { break };
            here = [here[0] + theta, here[1] + phi];
            via_rad.push(here);
            reached = self.is_goal(here);
        }
        Ok(ViaPath { via_rad, reached })
    }

    fn is_goal(&self, angles_rad: [f64; 2]) -> bool {
        angles_rad.iter().zip(self.goal_rad).all(|(q, g)| (q - g).abs() <= self.reached_rad)
    }
}

/// What a walk found.
#[derive(Clone, Debug, PartialEq)]
pub struct ViaPath {
    /// The points, the start first.
    pub via_rad: Vec<[f64; 2]>,
    /// True when the last one is the goal.
    pub reached: bool,
}

/// The problem of one step.
struct Step<'a> {
    task: &'a ViaTask,
    from_rad: [f64; 2],
}

impl Problem for Step<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        &[[-STEP_RAD, STEP_RAD]; 2]
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let [theta, phi] = x else { return f64::INFINITY };
        self.task.price([self.from_rad[0] + theta, self.from_rad[1] + phi])
    }
}
