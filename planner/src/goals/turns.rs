//! Joints with more than one turn: the same pose of the links at another angle.
use std::f64::consts::TAU;
use taustream_arm::Robot;
use taustream_motion::JointArray;

/// The pose whose links stand as in `pose_rad`, every joint turned by whole turns to be as near to `from_rad` as its range
/// allows.
#[must_use]
pub fn nearest_turn(robot: &Robot, from_rad: &JointArray, pose_rad: &JointArray) -> JointArray {
    let mut nearest_rad = *pose_rad;
    for ((q, from), joint) in nearest_rad.iter_mut().zip(from_rad).zip(&robot.joints) {
        if joint.kind.is_prismatic() {
            continue;
        }
        let [low, high] = joint.limits.position_rad;
        let turned = *q + TAU * ((from - *q) / TAU).round();
        // The nearest turn, or the next one inside the range.
        let candidates = [turned, turned - TAU, turned + TAU];
        let inside = candidates.into_iter().filter(|c| (low..=high).contains(c));
        let best = inside.min_by(|a, b| (a - from).abs().total_cmp(&(b - from).abs()));
        *q = best.unwrap_or(*q);
    }
    nearest_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_arm::Robot;

    fn robot(range: &str) -> Robot {
        let text = format!(
            "name = \"one\"\n[[joint]]\nname = \"j\"\nlink_radius_m = 0.0\nposition_rad = {range}\n\
             dh = {{ a_m = 0.5, alpha_rad = 0.0, d_m = 0.1, theta_offset_rad = 0.0 }}\n\
             motion = {{ velocity_rad_s = 1.0, acceleration_rad_s2 = 10, jerk_rad_s3 = 100 }}\n"
        );
        Robot::from_toml(std::path::Path::new("one.toml"), &text).expect("a robot")
    }

    #[test]
    fn joints_go_to_the_nearest_turn_inside_their_range() {
        let one = |q: f64| -> JointArray { std::array::from_fn(|i| if i == 0 { q } else { 0.0 }) };
        for (range, from, to, expected) in [
            ("[-6.2832, 6.2832]", 3.1, -3.1, TAU - 3.1),
            ("[-6.2832, 6.2832]", -3.1, 3.1, 3.1 - TAU),
            ("[-6.2832, 6.2832]", 0.1, 6.2, 6.2 - TAU),
            ("[-3.15, 3.15]", 3.1, -3.1, -3.1),
            ("[-3.2, 20.0]", 19.0, 0.0, 3.0 * TAU),
            ("[-3.2, 18.0]", 17.9, 0.0, 2.0 * TAU),
            ("[-1.0, 1.0]", 0.5, -0.5, -0.5),
        ] {
            let got = nearest_turn(&robot(range), &one(from), &one(to))[0];
            assert!((got - expected).abs() < 1e-12, "{range}: from {from} to {to}: {got}");
        }
    }
}
