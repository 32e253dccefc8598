//! The pose nearby that keeps the constraints of poses: damped least squares on the chain's Jacobian, inside the joint ranges.
//!
//! Source: Berenson et al., "Manipulation planning on constraint manifolds", ICRA 2009 (projection of samples); the damping as in
//! [`crate::goals::Inverse`].
use super::{TipRules, tilt_rad};
use crate::goals::TipTarget;
use nalgebra::{SMatrix, SVector, Vector3};
use taustream_motion::JointArray;
use taustream_motion::chain::{Column, Pose};

/// Most steps.
const STEPS_MAX: u32 = 24;
/// Share of the allowed angle that is aimed at, so that edges beside the pose keep it too.
const AIM: f64 = 0.7;
/// How far inside the box is aimed at: so far, or this share of the box.
const AIM_M: f64 = 0.01;
const AIM_SHARE: f64 = 0.1;
/// Share of the largest lever, squared, by which steps are damped.
const DAMPING: f64 = 1e-5;
/// What a turn counts beside a way, m/rad.
const LEVER_M: f64 = 0.25;
/// Longest step of one joint, rad.
const STEP_RAD: f64 = 0.5;
/// One row for the angle, three for the place, six for a target.
const ROWS: usize = 10;

/// Rows of the linear problem: how each joint changes an error, and the error.
struct Rows {
    levers: [[f64; taustream_motion::MAX_JOINTS]; ROWS],
    errors: SVector<f64, ROWS>,
    count: usize,
}

impl Rows {
    fn push(&mut self, error: f64, columns: &[Column], lever: impl Fn(&Column) -> f64) {
        let Some(row) = self.levers.get_mut(self.count) else { return };
        row.iter_mut().zip(columns).for_each(|(slot, column)| *slot = lever(column));
        self.errors[self.count] = error;
        self.count += 1;
    }
}

impl TipRules<'_> {
    /// The pose, or one nearby, that keeps the constraints of poses and a target; `None` where none is found.
    #[must_use]
    pub(crate) fn project(&self, pose_rad: &JointArray, target: Option<&TipTarget>) -> Option<JointArray> {
        let mut pose = *pose_rad;
        for _ in 0..STEPS_MAX {
            let (tip, columns) = self.chain().jacobian(self.frame, &pose);
            let rows = self.rows((&tip, &columns), target);
            let is_there = self.check_pose(&pose).is_ok()
                && target.is_none_or(|target| target.is_reached(&target.error(self.robot, &pose)));
            if is_there {
                return Some(pose);
            }
            if rows.count == 0 {
                return None;
            }
            self.step(&mut pose, &rows)?;
        }
        None
    }

    fn rows(&self, (tip, columns): (&Pose, &[Column]), target: Option<&TipTarget>) -> Rows {
        let mut rows =
            Rows { levers: [[0.0; taustream_motion::MAX_JOINTS]; ROWS], errors: SVector::zeros(), count: 0 };
        if let Some(upright) = &self.asked.upright {
            let excess_rad = tilt_rad(upright, tip) - AIM * upright.tolerance_rad;
            if excess_rad > 0.0 {
                let axis = tip.rotation * Vector3::from(upright.tip_axis);
                let about = axis.cross(&Vector3::from(upright.direction));
                // Upside down, every axis across serves.
                let about = about.try_normalize(1e-9).unwrap_or_else(|| across(&axis));
                rows.push(LEVER_M * excess_rad, columns, |c| LEVER_M * c.angular.dot(&about));
            }
        }
        if let Some(inside) = &self.asked.inside {
            for i in 0..3 {
                let (low, high) = (inside.low_m[i], inside.high_m[i]);
                let aim_m = AIM_M.min(AIM_SHARE * (high - low));
                let at_m = tip.translation.vector[i];
                let error_m = at_m.clamp(low + aim_m, high - aim_m) - at_m;
                if error_m != 0.0 {
                    rows.push(error_m, columns, |c| c.linear_m[i]);
                }
            }
        }
        if let Some(target) = target {
            let (left, into_tip) = (target.left(tip), tip.rotation.inverse());
            for i in 0..3 {
                rows.push(left[i], columns, |c| c.linear_m[i]);
            }
            for i in (0..3).filter(|i| target.orientation.is_some() && left[3 + i] != 0.0) {
                rows.push(LEVER_M * left[3 + i], columns, |c| LEVER_M * (into_tip * c.angular)[i]);
            }
        }
        rows
    }

    fn step(&self, pose: &mut JointArray, rows: &Rows) -> Option<()> {
        let mut normal = SMatrix::<f64, ROWS, ROWS>::identity();
        let product = |a: usize, b: usize| -> f64 {
            rows.levers[a].iter().zip(&rows.levers[b]).map(|(x, y)| x * y).sum()
        };
        let largest = (0..rows.count).map(|row| product(row, row)).fold(0.0, f64::max);
        for a in 0..rows.count {
            for b in 0..rows.count {
                normal[(a, b)] = product(a, b);
            }
            normal[(a, a)] += DAMPING * largest.max(f64::MIN_POSITIVE);
        }
        let weights = normal.cholesky()?.solve(&rows.errors);
        for (joint, (q, described)) in pose.iter_mut().zip(&self.robot.joints).enumerate() {
            let by: f64 = (0..rows.count).map(|row| rows.levers[row][joint] * weights[row]).sum();
            *q = described.limits.nearest_inside(*q + by.clamp(-STEP_RAD, STEP_RAD));
        }
        Some(())
    }
}

/// A unit vector across another one.
fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    let other = if axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    axis.cross(&other).normalize()
}
