//! Time-optimal motions of one joint under jerk limits, which the fit follows.
use rsruckig::prelude::{
    ControlInterface, DataArrayOrVec, InputParameter, Ruckig, Synchronization, ThrowErrorHandler,
    Trajectory as RuckigTrajectory,
};
use taustream_motion::LimitSet;

/// How often limits are lowered to bring a reference near its duration.
const SEARCHES: u32 = 4;
/// How near to its duration a reference has to come; the rest is stretched.
const NEAR: f64 = 0.98;

/// Where one joint is, how it moves, and where it goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Task {
    pub position_rad: f64,
    pub velocity_rad_s: f64,
    pub acceleration_rad_s2: f64,
    /// Where it has to rest; anywhere without it.
    pub goal_rad: Option<f64>,
}

/// The solver with its last solution.
pub(super) struct Optimum {
    solver: Ruckig<1, ThrowErrorHandler>,
    input: InputParameter<1>,
    solution: RuckigTrajectory<1>,
    /// Duration of the solution over the one that it has to have.
    stretch: f64,
}

impl Optimum {
    pub(super) fn new() -> Self {
        let mut input = InputParameter::new(None);
        input.synchronization = Synchronization::None;
        Self { solver: Ruckig::new(None, 0.001), input, solution: RuckigTrajectory::new(None), stretch: 1.0 }
    }

    /// Least duration of a task (s); nothing when the solver fails.
    pub(super) fn duration_s(&mut self, task: &Task, limits: &LimitSet) -> Option<f64> {
        let input = &mut self.input;
        input.control_interface =
            if task.goal_rad.is_some() { ControlInterface::Position } else { ControlInterface::Velocity };
        input.current_position[0] = task.position_rad;
        input.current_velocity[0] = task.velocity_rad_s;
        input.current_acceleration[0] = task.acceleration_rad_s2;
        input.target_position[0] = task.goal_rad.unwrap_or(0.0);
        input.max_velocity[0] = limits.velocity_rad_s;
        input.max_acceleration[0] = limits.acceleration_rad_s2;
        input.max_jerk[0] = limits.jerk_rad_s3;
        self.solver.calculate(&self.input, &mut self.solution).ok()?;
        Some(self.solution.get_duration()).filter(|duration_s| duration_s.is_finite())
    }

    /// Lowers the limits by c, c^2 and c^3 until a task takes about `duration_s`; nothing when the solver fails.
    pub(super) fn slow_down(&mut self, task: &Task, limits: &LimitSet, duration_s: f64) -> Option<()> {
        let mut taken_s = self.duration_s(task, limits)?;
        let mut c: f64 = 1.0;
        for _ in 0..SEARCHES {
            if taken_s >= NEAR * duration_s {
                break;
            }
            // Below a thousandth of the limits the fit does not care.
            c = (c * taken_s / duration_s).max(1e-3);
            let lowered = LimitSet {
                velocity_rad_s: limits.velocity_rad_s * c,
                acceleration_rad_s2: limits.acceleration_rad_s2 * c * c,
                jerk_rad_s3: limits.jerk_rad_s3 * c * c * c,
            };
            taken_s = self.duration_s(task, &lowered)?;
        }
        self.stretch = taken_s / duration_s;
        Some(())
    }

    /// Velocity, acceleration and jerk of the solution, stretched to the duration requested.
    pub(super) fn rates(&self, t_s: f64) -> [f64; 3] {
        let zero = || DataArrayOrVec::new(None, 0.0);
        let (mut v, mut a, mut j) = (zero(), zero(), zero());
        let (v_out, a_out, j_out) = (&mut Some(&mut v), &mut Some(&mut a), &mut Some(&mut j));
        self.solution.at_time(t_s * self.stretch, &mut None, v_out, a_out, j_out, &mut None);
        // A solution that is too long is a rough guide only: played faster, it would not begin as the joint moves.
        let rate = self.stretch.min(1.0);
        [v[0] * rate, a[0] * rate * rate, j[0] * rate * rate * rate]
    }
}
