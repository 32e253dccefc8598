//! What a robot feels: the bacteria's cost, and the potential field.
use super::robot::VirtualObstacle;
use super::{Place, distance_cm};
use crate::{Reading, Refusal};

/// The numbers of the method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers {
    /// Bacteria a step, `N_s`.
    pub bacteria: usize,
    /// Length of a step, R.
    pub step_cm: f64,
    /// Speed of the robot: steps are this long in time.
    pub speed_cm_s: f64,
    /// Range of the sensor, β.
    pub range_cm: f64,
    /// Nearest that the robot's centre comes to an obstacle.
    pub clearance_cm: f64,
    /// Height and width of an obstacle's cost, `H_o` and `W_o` (1/cm²).
    pub obstacle: [f64; 2],
    /// Depth and width of the goal's cost, `H_g` and `W_g`.
    pub goal: [f64; 2],
    /// Height and width of a virtual obstacle's cost, `H_add` and `W_add`.
    pub virtual_obstacle: [f64; 2],
    /// How near the goal is there, `d_min`.
    pub arrived_cm: f64,
    /// How far a robot goes back from a trap, dis.
    pub retreat_cm: f64,
    /// Steps within which a robot that has not moved by a step is trapped, k.
    pub observed: usize,
    /// Gain of the potential field's attraction, and of its repulsion.
    pub gains: [f64; 2],
    /// Most steps of a journey.
    pub steps_max: usize,
    /// Most virtual obstacles of all robots together; in a closed room they would never end.
    pub virtual_max: usize,
    /// Printed: the virtual obstacle is put where the robot returns to (eq. 15); corrected: where it was trapped.
    pub reading: Reading,
}

impl Numbers {
    /// The paper prints the sensor's range only; the rest is ours. The goal's width has to be about 1/D² of the way D,
    /// or its cost is flat at the start.
    pub const OURS: Self = Self {
        bacteria: 30,
        step_cm: 2.0,
        speed_cm_s: 10.0,
        range_cm: 13.0,
        clearance_cm: 3.0,
        obstacle: [1.0, 0.02],
        goal: [20.0, 1e-4],
        virtual_obstacle: [1.0, 0.01],
        arrived_cm: 3.0,
        retreat_cm: 15.0,
        observed: 10,
        gains: [1.0, 20_000.0],
        steps_max: 4_000,
        virtual_max: 200,
        reading: Reading::Corrected,
    };

    /// Refuses numbers that make no sense.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let (within, method) = (Refusal::check_number, "planar");
        let most = "from 1 to 100000 is possible";
        within(method, "the bacteria", self.bacteria as f64, [1.0, 1e5], most)?;
        within(method, "the observed steps", self.observed as f64, [1.0, 1e5], most)?;
        let above = "a number above 0 is needed";
        for (what, value) in [
            ("the step", self.step_cm),
            ("the speed", self.speed_cm_s),
            ("the range", self.range_cm),
            ("the distance of arrival", self.arrived_cm),
        ] {
            within(method, what, value, [1e-9, 1e9], above)?;
        }
        let ([a, b], [c, d], [e, f]) = (self.obstacle, self.goal, self.virtual_obstacle);
        let rest = [self.clearance_cm, self.retreat_cm, self.gains[0], self.gains[1], a, b, c, d, e, f];
        Refusal::check_finite(method, "a length, height, width or gain", &rest)
    }

    /// Cost of a place (eq. 10 to 12 and 15) for a robot that senses these points.
    pub(super) fn cost(
        &self,
        place: Place,
        goal: Place,
        sensed: &[Place],
        virtuals: &[VirtualObstacle],
    ) -> f64 {
        let gaussian = |[height, width]: [f64; 2], centre: Place| {
            let away = distance_cm(place, centre);
            height * (-width * away * away).exp()
        };
        let obstacles: f64 = sensed.iter().map(|q| gaussian(self.obstacle, *q)).sum();
        let added: f64 = virtuals.iter().map(|v| gaussian(self.virtual_obstacle, v.centre_cm)).sum();
        obstacles + added - gaussian(self.goal, goal)
    }
}

/// The potential at a place (eq. 1, 3, 7), for the nearest points of the obstacles in range.
#[must_use]
pub fn potential(numbers: &Numbers, place: Place, goal: Place, sensed: &[Place]) -> f64 {
    let [attraction, repulsion] = numbers.gains;
    let pushed = sensed.iter().map(|q| {
        let nearer = 1.0 / distance_cm(place, *q) - 1.0 / numbers.range_cm;
        0.5 * repulsion * nearer.max(0.0).powi(2)
    });
    0.5 * attraction * distance_cm(place, goal).powi(2) + pushed.sum::<f64>()
}

/// The force there, its negative gradient (eq. 2, 5, 8).
#[must_use]
pub fn force(numbers: &Numbers, place: Place, goal: Place, sensed: &[Place]) -> Place {
    let [attraction, repulsion] = numbers.gains;
    let mut force: Place = std::array::from_fn(|i| -attraction * (place[i] - goal[i]));
    for q in sensed {
        let away = distance_cm(place, *q);
        let nearer = (1.0 / away - 1.0 / numbers.range_cm).max(0.0);
        for (i, f) in force.iter_mut().enumerate() {
            *f += repulsion * nearer / (away * away) * (place[i] - q[i]) / away;
        }
    }
    force
}
