//! Paths as poses: places of the tip become joint angles, and pieces get the times that Li, Xing and Qin (2025) would give them.
use super::ImportError;
use super::profiles::ViaProfile;
use super::reference::fitted_durations_s;
use crate::goals::{ERROR_M_MAX, Inverse, TipTarget};
use taustream_arm::{PathFile, PathPoint, Robot};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::papers::spline_time::{SplineCost, SplineTime};
use taustream_optimizers::{Progress, Reading, Run, Setup, by_name};

/// The poses of a path's points. A place is reached from the pose of the point before it (the first from the file's
/// `near_rad`) by damped least squares, which go the shortest way in joint space, so that neighbours stay neighbours.
///
/// # Errors
/// A pose of another number of joints, or a place that is not reached from there.
pub fn poses_of(robot: &Robot, path: &PathFile) -> Result<Vec<JointArray>, ImportError> {
    let expected = robot.joints.len();
    let pose = |angles: &[f64]| -> Result<JointArray, ImportError> {
        if angles.len() != expected {
            return Err(ImportError::Joints { got: angles.len(), expected });
        }
        let mut pose_rad = [0.0; MAX_JOINTS];
        pose_rad.iter_mut().zip(angles).for_each(|(slot, angle)| *slot = *angle);
        Ok(pose_rad)
    };
    let mut near_rad = path.near_rad.as_deref().map(pose).transpose()?;
    let mut poses_rad = Vec::with_capacity(path.points.len());
    for (point, place) in path.points.iter().enumerate() {
        let reached_rad = match place {
            PathPoint::Joints(angles) => pose(angles)?,
            PathPoint::Place(position_m) => {
                let from_rad = near_rad.ok_or(ImportError::NoNear)?;
                let target = TipTarget::position((*position_m).into());
                let reached_rad = Inverse::new(robot, &target, 1.0).polish(&from_rad);
                let off_m = target.error(robot, &reached_rad).position_m;
                if off_m.is_nan() || off_m > ERROR_M_MAX {
                    return Err(ImportError::NotReached { point, off_m });
                }
                reached_rad
            }
        };
        near_rad = Some(reached_rad);
        poses_rad.push(reached_rad);
    }
    Ok(poses_rad)
}

/// Who chooses the durations of a degree-seven spline's pieces, and how long it may look.
#[derive(Clone, Copy, Debug)]
pub struct TimedBy<'a> {
    /// An optimiser by its registered name.
    pub method: &'a str,
    /// Seed of its random choices.
    pub seed: u64,
    /// Evaluations of the objective.
    pub evaluations: usize,
}

/// Durations by the objective of time and impact of Li, Xing and Qin (2025), inside the motion limits, each from a quarter of the shortest
/// to four times the longest of the durations that the limits alone would give; those are among the first guesses.
///
/// # Errors
/// Points without such a spline, an optimiser that does not exist or does not start.
pub fn optimised_durations_s(
    points_rad: &[JointArray],
    robot: &Robot,
    by: &TimedBy,
) -> Result<(Vec<f64>, SplineCost), ImportError> {
    let (joints, limits) = (robot.joints.len(), robot.limits());
    let fitted_s = fitted_durations_s(points_rad, joints, ViaProfile::BSpline7, &limits)?;
    let shortest_s = fitted_s.iter().copied().fold(f64::INFINITY, f64::min);
    let longest_s = fitted_s.iter().copied().fold(0.0, f64::max);
    let points: Vec<Vec<f64>> = points_rad.iter().map(|p| p.iter().take(joints).copied().collect()).collect();
    let each: Vec<[f64; 3]> = robot
        .joints
        .iter()
        .map(|j| &j.limits.motion)
        .map(|m| [m.velocity_rad_s, m.acceleration_rad_s2, m.jerk_rad_s3])
        .collect();
    let bounds_s = [0.25 * shortest_s, 4.0 * longest_s];
    let problem = SplineTime::new(&points, &each, bounds_s, Reading::Corrected)?;
    let refused = |why: String| ImportError::Optimiser { why };
    let setup = Setup { evaluations: Some(by.evaluations), ..Setup::default() };
    let optimizer = by_name(by.method, setup).map_err(|e| refused(e.to_string()))?;
    let (is_over, mut watch) = (|| false, |_: &Progress| ());
    let run = Run {
        seed: by.seed,
        evaluations_max: by.evaluations,
        guesses: &[fitted_s],
        is_over: &is_over,
        watch: &mut watch,
    };
    let found = optimizer.minimise(&problem, run).map_err(|e| refused(e.to_string()))?;
    let cost = problem.evaluate(&found.x)?;
    Ok((found.x, cost))
}
