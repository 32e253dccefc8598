//! Random trajectories inside the motion limits of an arm.
use super::random::SeededRng;
use taustream_arm::Robot;
use taustream_motion::cut::kept;
use taustream_motion::limits::{check_motion, check_motion_from};
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
        let delta_rad = random_delta(rng, robot, home_rad, &mut at_rad);
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

/// The way to a random pose around home, which `at_rad` then is.
fn random_delta(
    rng: &mut SeededRng,
    robot: &Robot,
    home_rad: &JointArray,
    at_rad: &mut JointArray,
) -> JointArray {
    let mut delta_rad = [0.0; MAX_JOINTS];
    for (joint, described) in robot.joints.iter().enumerate() {
        let [low, high] = described.limits.position_rad;
        let goal_rad = home_rad[joint] + rng.within(-REACH_RAD, REACH_RAD);
        delta_rad[joint] = goal_rad.clamp(low + 0.1, high - 0.1) - at_rad[joint];
        at_rad[joint] += delta_rad[joint];
    }
    delta_rad
}

/// A straight move that cruises, as fast as the limits allow: strokes of one form at even spacing, of which pending ones cancel
/// running ones.
#[must_use]
pub fn cruising_train(
    rng: &mut SeededRng,
    robot: &Robot,
    home_rad: &JointArray,
    from_rad: &JointArray,
) -> Option<Trajectory> {
    const COUNT: u32 = 32;
    const STRETCH: f64 = 1.02;
    let (limits, joints) = (robot.limits(), robot.joints.len());
    let mut delta_rad = [0.0; MAX_JOINTS];
    for joint in 0..joints {
        let [low, high] = limits[joint].position_rad;
        let goal_rad = home_rad[joint] + rng.within(-REACH_RAD, REACH_RAD);
        delta_rad[joint] = (goal_rad.clamp(low + 0.1, high - 0.1) - from_rad[joint]) / f64::from(COUNT);
    }
    let mut duration_s = 0.1;
    for _ in 0..150 {
        let stroke = |number: u32| Stroke {
            start_s: f64::from(number) * duration_s / 8.0,
            duration_s,
            n: 6,
            delta_rad,
        };
        let strokes: Vec<Stroke> = (0..COUNT).map(stroke).collect();
        let trajectory = Trajectory::new(joints, *from_rad, &strokes).ok()?;
        if check_motion(&trajectory, &limits).is_ok() {
            return Some(trajectory);
        }
        duration_s *= STRETCH;
    }
    None
}

/// A replacement of a motion from a cut on: what has begun is kept; the rest is dropped, or kept, too; one or two random strokes
/// are added. `None` when nothing keeps the limits from the cut on.
#[must_use]
pub fn random_replacement(
    rng: &mut SeededRng,
    robot: &Robot,
    home_rad: &JointArray,
    (running, cut_s): (&Trajectory, f64),
) -> Option<Trajectory> {
    let (limits, joints) = (robot.limits(), robot.joints.len());
    let kept = kept(running, cut_s, cut_s);
    let later = running.strokes().iter().filter(|stroke| stroke.start_s >= cut_s).copied();
    let mut old = kept.strokes.to_vec();
    if rng.chance(0.5) {
        old.extend(later);
    }
    let mut at_rad = kept.base_rad;
    for stroke in &old {
        for (at_rad, delta_rad) in at_rad.iter_mut().zip(&stroke.delta_rad) {
            *at_rad += delta_rad;
        }
    }
    let mut new = Vec::new();
    let mut after_s = rng.within(0.0, 0.3);
    for _ in 0..rng.whole(1, 2) {
        let delta_rad = random_delta(rng, robot, home_rad, &mut at_rad);
        let duration_s = rng.within(0.3, 0.6);
        new.push(Stroke { start_s: after_s, duration_s, n: u32::try_from(rng.whole(5, 8)).ok()?, delta_rad });
        after_s += duration_s * rng.within(0.6, 1.1);
    }
    for _ in 0..STRETCHES {
        let added = new.iter().map(|stroke| Stroke { start_s: cut_s + stroke.start_s, ..*stroke });
        let mut strokes: Vec<Stroke> = old.iter().copied().chain(added).collect();
        strokes.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        let trajectory = Trajectory::new(joints, kept.base_rad, &strokes).ok()?;
        if check_motion_from(&trajectory, &limits, cut_s).is_ok() {
            return Some(trajectory);
        }
        for stroke in &mut new {
            stroke.start_s *= STRETCH;
            stroke.duration_s *= STRETCH;
        }
    }
    None
}
