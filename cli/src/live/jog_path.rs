//! Where a jog leads: poses of a joint, or of the tip along a line, at a constant speed.
use nalgebra::{Matrix6, SVector, Unit, Vector3, Vector6};
use taustream_arm::Robot;
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Steps of the tip are no longer, m.
const STEP_M: f64 = 0.002;
/// Joint motion per step of the tip above this is a singular pose, rad.
const STEP_RAD_MAX: f64 = 0.05;
/// Damping of the inverse Jacobian.
const DAMPING: f64 = 1e-3;
/// An arm with fewer joints cannot hold its rotation.
const JOINTS_FOR_ROTATION: usize = 6;

/// What is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Jogged {
    /// One joint, by its index.
    Joint(usize),
    /// The tip, along an axis of the base or of the tip.
    Tip {
        /// The axis.
        axis: Unit<Vector3<f64>>,
        /// The axis is the tip's.
        is_tools: bool,
        /// The tip's frame.
        frame: usize,
    },
}

/// A line from where the arm stood.
#[derive(Clone, Copy, Debug)]
pub(super) struct JogPath<'a> {
    robot: &'a Robot,
    jogged: Jogged,
    tip_frame: usize,
    /// Pose of the joints as far as it was led.
    at_rad: JointArray,
    tip: Pose,
    direction: Vector3<f64>,
}

impl<'a> JogPath<'a> {
    pub(super) fn new(robot: &'a Robot, jogged: Jogged, from_rad: &JointArray) -> Self {
        let tip_frame = match jogged {
            Jogged::Tip { frame, .. } => frame,
            Jogged::Joint(_) => robot.chain.tip_frame(),
        };
        let tip = robot.chain.frame(tip_frame, from_rad);
        let direction = match jogged {
            Jogged::Joint(_) => Vector3::zeros(),
            Jogged::Tip { axis, is_tools: false, .. } => axis.into_inner(),
            Jogged::Tip { axis, is_tools: true, .. } => tip.rotation * axis.into_inner(),
        };
        Self { robot, jogged, tip_frame, at_rad: *from_rad, tip, direction }
    }

    /// The pose as far as it was led.
    pub(super) fn at_rad(&self) -> &JointArray {
        &self.at_rad
    }

    /// Leads on by a signed length (rad or m). False when the joints cannot follow: the tip is at the end of its reach, or near a
    /// singular pose.
    pub(super) fn lead(&mut self, length: f64) -> bool {
        match self.jogged {
            Jogged::Joint(joint) => {
                let (Some(q), Some(limits)) = (self.at_rad.get_mut(joint), self.robot.joints.get(joint))
                else {
                    return false;
                };
                let wanted = *q + length;
                *q = limits.limits.nearest_inside(wanted);
                (*q - wanted).abs() < 1e-12
            }
            Jogged::Tip { .. } => {
                let steps = (length.abs() / STEP_M).ceil().clamp(1.0, 1e4);
                let mut done = 0.0;
                while done < steps {
                    if !self.step(length / steps) {
                        return false;
                    }
                    done += 1.0;
                }
                true
            }
        }
    }

    /// One Newton step to the next point of the line, so that errors do not add up.
    fn step(&mut self, length_m: f64) -> bool {
        let next_m = self.tip.translation.vector + self.direction * length_m;
        let (tip, columns) = self.robot.chain.jacobian(self.tip_frame, &self.at_rad);
        let joints = self.robot.joints.len().min(MAX_JOINTS);
        let off_m = next_m - tip.translation.vector;
        let turn: Vector3<f64> = (self.tip.rotation * tip.rotation.inverse()).scaled_axis();
        let rotates = if joints >= JOINTS_FOR_ROTATION { 1.0 } else { 0.0 };
        let error =
            Vector6::new(off_m.x, off_m.y, off_m.z, turn.x * rotates, turn.y * rotates, turn.z * rotates);
        let mut normal = Matrix6::identity() * (DAMPING * DAMPING);
        let mut each = [Vector6::zeros(); MAX_JOINTS];
        for (slot, column) in each.iter_mut().zip(&columns).take(joints) {
            let (l, a) = (column.linear_m, column.angular * rotates);
            *slot = Vector6::new(l.x, l.y, l.z, a.x, a.y, a.z);
            normal += *slot * slot.transpose();
        }
        let Some(solved) = normal.cholesky().map(|factor| factor.solve(&error)) else { return false };
        let steps_rad: SVector<f64, MAX_JOINTS> = SVector::from_fn(|joint, _| each[joint].dot(&solved));
        let mut next_rad = self.at_rad;
        for ((q, step), joint) in next_rad.iter_mut().zip(steps_rad.iter()).zip(&self.robot.joints) {
            *q += step;
            if step.is_nan() || step.abs() > STEP_RAD_MAX || joint.limits.outside_rad(*q) > 0.0 {
                return false;
            }
        }
        let reached = self.robot.chain.frame(self.tip_frame, &next_rad);
        if (reached.translation.vector - next_m).norm() > 0.5 * STEP_M {
            return false;
        }
        self.at_rad = next_rad;
        self.tip.translation.vector = next_m;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use taustream_motion::joint_array;

    const HOME: JointArray = joint_array([0.3, -1.3, 1.4, -1.6, -1.57, 0.2]);

    fn ur5() -> Robot {
        crate::arm::robot(Path::new("ur5")).expect("shipped")
    }

    #[test]
    fn tip_goes_along_its_line_and_holds_its_rotation() {
        let robot = ur5();
        for (axis, is_tools) in
            [(Vector3::z_axis(), false), (Vector3::x_axis(), false), (Vector3::y_axis(), true)]
        {
            let mut path = JogPath::new(&robot, Jogged::Tip { axis, is_tools, frame: 6 }, &HOME);
            let from = robot.chain.frame(6, &HOME);
            assert!((0..50).all(|_| path.lead(0.002)), "{axis:?}");
            let to = robot.chain.frame(6, path.at_rad());
            let along = if is_tools { from.rotation * axis.into_inner() } else { axis.into_inner() };
            let off_m = to.translation.vector - from.translation.vector - along * 0.1;
            assert!(off_m.norm() < 1e-4, "{axis:?}: {off_m}");
            assert!(from.rotation.angle_to(&to.rotation) < 1e-3, "{axis:?}");
            assert!(path.lead(-0.1));
            let back = path.at_rad().iter().zip(&HOME).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(back < 1e-3, "{axis:?}: {back}");
        }
    }

    #[test]
    fn reach_ends_without_a_jump_of_the_joints() {
        let robot = ur5();
        let jogged = Jogged::Tip { axis: Vector3::x_axis(), is_tools: false, frame: 6 };
        let mut path = JogPath::new(&robot, jogged, &HOME);
        let mut before = *path.at_rad();
        let mut steps = 0;
        while path.lead(-0.002) {
            let jump = path.at_rad().iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(jump <= STEP_RAD_MAX, "{jump}");
            before = *path.at_rad();
            steps += 1;
            assert!(steps < 2_000, "an arm of 0.95 m does not reach 4 m");
        }
    }

    #[test]
    fn joint_ends_at_its_limit() {
        let robot = ur5();
        let mut path = JogPath::new(&robot, Jogged::Joint(2), &HOME);
        assert!(path.lead(0.1));
        assert!((path.at_rad()[2] - 1.5).abs() < 1e-12);
        assert!(!path.lead(100.0));
        assert!(robot.joints[2].limits.outside_rad(path.at_rad()[2]) <= 0.0);
    }
}
