//! The stops themselves: each from one instant of a planned move at one speed, sampled as the streamer samples it.
use crate::failure::Failure;
use rsruckig::prelude::{
    ControlInterface, DataArrayOrVec, IgnoreErrorHandler, InputParameter, Ruckig, Synchronization,
    Trajectory as RuckigTrajectory,
};
use std::path::Path;
use std::time::Instant;
use taustream_arm::{Robot, Scene};
use taustream_motion::peaks_ahead::{AT_REST, PeaksAhead, Stretch, cell_count, fill, span_s};
use taustream_motion::stopping::{Situation, SpeedRequest, StopRules};
use taustream_motion::time_scale::TimeScale;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Trajectory};
use taustream_planner::{PlanOptions, PlannerKind, plan};

/// Speed overrides.
pub(super) const SPEEDS: [f64; 5] = [0.05, 0.1, 0.2, 0.5, 1.0];
/// Lengths of the moves, rad.
pub(super) const MOVES_RAD: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 6.0];
/// Parts of a move in the table.
pub(super) const PHASES: u32 = 5;
const PERIOD_S: f64 = 1e-3;

/// How long a stop takes and how far the joint goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stopped {
    pub(super) duration_s: f64,
    pub(super) distance_rad: f64,
}

/// One stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) travel_rad: f64,
    pub(super) speed: f64,
    pub(super) phase: u32,
    pub(super) fast: Stopped,
    pub(super) pause: Stopped,
    pub(super) optimum: Stopped,
    /// How long it took to choose the fast stop, us.
    pub(super) choice_us: f64,
}

/// Stops at so many instants of each move, at each speed.
pub(super) fn cases(robot: &Robot, instants: u32) -> Result<Vec<Case>, Failure> {
    let limits = robot.limits();
    let rules = StopRules::new(&limits, robot.joints.len());
    let mut cases = Vec::new();
    for travel_rad in MOVES_RAD {
        let trajectory = straight(robot, travel_rad)?;
        let mut cells = vec![AT_REST; cell_count(&trajectory)];
        fill(&mut cells, &trajectory, &limits);
        let motion = Motion { trajectory, cells, rules };
        for speed in SPEEDS {
            for instant in 0..instants {
                let part = (f64::from(instant) + 0.5) / f64::from(instants);
                let s = part * motion.trajectory.duration_s();
                let (fast, choice_us) = motion.stop(SpeedRequest::FastStop, (s, speed));
                let (pause, _) = motion.stop(SpeedRequest::Stop, (s, speed));
                let optimum = optimum(&motion.trajectory, (s, speed), &limits)?;
                cases.push(Case {
                    travel_rad,
                    speed,
                    phase: instant * PHASES / instants,
                    fast,
                    pause,
                    optimum,
                    choice_us,
                });
            }
        }
    }
    Ok(cases)
}

/// A move of the first joint about the middle of its range, the others in the middle of theirs, timed by the planner.
fn straight(robot: &Robot, travel_rad: f64) -> Result<Trajectory, Failure> {
    let mut middle_rad: JointArray = [0.0; MAX_JOINTS];
    for (middle, limits) in middle_rad.iter_mut().zip(&robot.limits()).take(robot.joints.len()) {
        let [low_rad, high_rad] = limits.position_rad;
        *middle = 0.5 * (low_rad + high_rad);
    }
    let (mut start_rad, mut goal_rad) = (middle_rad, middle_rad);
    start_rad[0] -= 0.5 * travel_rad;
    goal_rad[0] += 0.5 * travel_rad;
    let scene = Scene::from_toml(Path::new("(empty scene)"), "margin_m = 0.0")?;
    let options = PlanOptions { planner: PlannerKind::Straight, ..PlanOptions::default() };
    plan(robot, &scene, &start_rad, &goal_rad, &options)
        .map(|plan| plan.trajectory)
        .map_err(|error| Failure::Failed(format!("no move of {travel_rad} rad: {error}")))
}

struct Motion {
    trajectory: Trajectory,
    cells: Vec<Stretch>,
    rules: StopRules,
}

impl Motion {
    /// Stops, and says how long choosing took, us.
    fn stop(&self, request: SpeedRequest, (from_s, speed): (f64, f64)) -> (Stopped, f64) {
        let end_s = self.trajectory.duration_s();
        let mut scale = TimeScale::settled(speed);
        let ahead = PeaksAhead::new(&self.cells, span_s(&self.trajectory));
        let situation = Situation { now_s: 0.0, s: from_s, ahead, approaching: false, waits_s: 0.0 };
        let begun = Instant::now();
        self.rules.apply(request, &mut scale, &situation);
        let choice_us = begun.elapsed().as_secs_f64() * 1e6;
        let (mut now_s, mut s) = (0.0, from_s);
        // A motion that ends by itself before is at rest, too.
        while now_s < scale.settles_s() && s < end_s {
            let next_s = now_s + PERIOD_S;
            s += scale.advance_s(now_s, next_s);
            now_s = next_s;
        }
        let position = |s: f64| self.trajectory.sample(s).position_rad[0];
        let distance_rad = (position(s) - position(from_s)).abs();
        (Stopped { duration_s: now_s.min(scale.settles_s()), distance_rad }, choice_us)
    }
}

/// The joint to rest as fast as its stop limits allow: rsruckig's velocity control from the same state.
fn optimum(
    trajectory: &Trajectory,
    (s, speed): (f64, f64),
    limits: &[JointLimits; MAX_JOINTS],
) -> Result<Stopped, Failure> {
    let at = trajectory.sample(s);
    let [limits, ..] = limits;
    let mut solver = Ruckig::<1, IgnoreErrorHandler>::new(None, PERIOD_S);
    let mut input = InputParameter::<1>::new(None);
    input.control_interface = ControlInterface::Velocity;
    input.synchronization = Synchronization::None;
    input.current_velocity[0] = at.velocity_rad_s[0] * speed;
    input.current_acceleration[0] = at.acceleration_rad_s2[0] * speed * speed;
    input.max_acceleration[0] = limits.stop.acceleration_rad_s2;
    input.max_jerk[0] = limits.stop.jerk_rad_s3;
    let mut best = RuckigTrajectory::<1>::new(None);
    solver
        .calculate(&input, &mut best)
        .map_err(|error| Failure::Failed(format!("rsruckig has no stop from {s:.3} s: {error:?}")))?;
    let duration_s = best.get_duration();
    let mut position = DataArrayOrVec::new(None, 0.0);
    best.at_time(duration_s, &mut Some(&mut position), &mut None, &mut None, &mut None, &mut None);
    Ok(Stopped { duration_s, distance_rad: position[0].abs() })
}
