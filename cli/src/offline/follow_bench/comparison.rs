//! What the follower is compared with: Ruckig, and interpolation.
use super::TICK_S;
use rsruckig::prelude::{
    DataArrayOrVec, InputParameter, Ruckig, Synchronization, ThrowErrorHandler,
    Trajectory as RuckigTrajectory,
};
use taustream_motion::LimitSet;

/// Ruckig, called anew for every target from its own state, with the same limits.
pub(super) struct Chase {
    solver: Ruckig<1, ThrowErrorHandler>,
    input: InputParameter<1>,
    solution: RuckigTrajectory<1>,
    since_s: f64,
    position_rad: f64,
    has_moved: bool,
}

impl Chase {
    pub(super) fn new(position_rad: f64, limits: &LimitSet) -> Self {
        let mut input = InputParameter::new(None);
        input.synchronization = Synchronization::None;
        input.current_position[0] = position_rad;
        input.target_position[0] = position_rad;
        input.max_velocity[0] = limits.velocity_rad_s;
        input.max_acceleration[0] = limits.acceleration_rad_s2;
        input.max_jerk[0] = limits.jerk_rad_s3;
        let (solver, solution) = (Ruckig::new(None, TICK_S), RuckigTrajectory::new(None));
        let mut chase = Self { solver, input, solution, since_s: 0.0, position_rad, has_moved: false };
        chase.take(0.0, position_rad);
        chase
    }

    fn state(&self, t_s: f64) -> [f64; 3] {
        if !self.has_moved {
            return [self.position_rad, 0.0, 0.0];
        }
        let zero = || DataArrayOrVec::new(None, 0.0);
        let (mut q, mut v, mut a) = (zero(), zero(), zero());
        let (q_out, v_out, a_out) = (&mut Some(&mut q), &mut Some(&mut v), &mut Some(&mut a));
        self.solution.at_time(t_s - self.since_s, q_out, v_out, a_out, &mut None, &mut None);
        [q[0], v[0], a[0]]
    }

    pub(super) fn take(&mut self, now_s: f64, target_rad: f64) {
        let [q, v, a] = self.state(now_s);
        self.input.current_position[0] = q;
        self.input.current_velocity[0] = v;
        self.input.current_acceleration[0] = a;
        self.input.target_position[0] = target_rad;
        if self.solver.calculate(&self.input, &mut self.solution).is_ok() {
            (self.since_s, self.has_moved) = (now_s, true);
        }
    }

    pub(super) fn at(&self, t_s: f64) -> f64 {
        self.state(t_s)[0]
    }
}

/// Cubic (Hermite) or straight from the setpoint at a target's arrival to the target, within one period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interpolation {
    cubic: bool,
    period_s: f64,
    since_s: f64,
    from: [f64; 2],
    to: [f64; 2],
}

impl Interpolation {
    pub(super) fn new(cubic: bool, period_s: f64, position_rad: f64) -> Self {
        Self { cubic, period_s, since_s: 0.0, from: [position_rad, 0.0], to: [position_rad, 0.0] }
    }

    pub(super) fn take(&mut self, now_s: f64, target_rad: f64) {
        let here = self.at(now_s);
        let to = [target_rad, (target_rad - self.to[0]) / self.period_s];
        (self.from, self.to, self.since_s) = ([here, self.to[1]], to, now_s);
    }

    pub(super) fn at(&self, t_s: f64) -> f64 {
        let u = ((t_s - self.since_s) / self.period_s).clamp(0.0, 1.0);
        let ([a, va], [b, vb]) = (self.from, self.to);
        if !self.cubic {
            return a + u * (b - a);
        }
        let (rising, falling) = (u * (1.0 - u) * (1.0 - u), u * u * (1.0 - u));
        a + u * u * (3.0 - 2.0 * u) * (b - a) + self.period_s * (rising * va - falling * vb)
    }
}
