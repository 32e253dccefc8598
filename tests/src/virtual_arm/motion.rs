//! Random trajectories inside the motion limits of an arm.
use super::random::SeededRng;
use taustream_arm::Robot;
use taustream_motion::limits::check_motion;
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};

/// How far from the home pose a way point may be, rad.
const REACH_RAD: f64 = 0.9;
/// Steps in which a motion that is too fast is stretched.
const STRETCHES: u32 = 60;
const STRETCH: f64 = 1.1;

/// A train of one to three overlapping strokes from `from_rad`, about as fast as the limits allow. `None` when no stretch
/// makes it fit.
#[must_use]
pub fn random_train(
    rng: &mut SeededRng,
    robot: &Robot,
    home_rad: &JointArray,
    from_rad: &JointArray,
) -> Option<Trajectory> {
    let (limits, joints) = (robot.limits(), robot.joints.len());
    let mut at_rad = *from_rad;
    let mut strokes = Vec::new();
    let mut start_s = 0.0;
    for _ in 0..rng.whole(1, 3) {
        let mut delta_rad = [0.0; MAX_JOINTS];
        for joint in 0..joints {
            let [low, high] = limits[joint].position_rad;
            let goal_rad = home_rad[joint] + rng.within(-REACH_RAD, REACH_RAD);
            delta_rad[joint] = goal_rad.clamp(low + 0.1, high - 0.1) - at_rad[joint];
            at_rad[joint] += delta_rad[joint];
        }
        let duration_s = rng.within(0.3, 0.6);
        let n = u32::try_from(rng.whole(5, 8)).ok()?;
        strokes.push(Stroke { start_s, duration_s, n, delta_rad });
        start_s += duration_s * rng.within(0.6, 1.1);
    }
    for _ in 0..STRETCHES {
        let trajectory = Trajectory::new(joints, *from_rad, &strokes).ok()?;
        if check_motion(&trajectory, &limits).is_ok() {
            return Some(trajectory);
        }
        for stroke in &mut strokes {
            stroke.start_s *= STRETCH;
            stroke.duration_s *= STRETCH;
        }
    }
    None
}
