//! Way points without a profile: trains as the planner times them, corners rounded within a blend.
use super::{Deviation, ImportError, Imported, within_limits};
use crate::budget::Budget;
use crate::pipeline::blends_rad;
use crate::plan::{PlanError, clear_poses};
use crate::timing::{Path, Timed, distance};
use crate::verify::verify_in;
use crate::world::World;
use taustream_arm::{Robot, Scene};
use taustream_messages::way_points::Blend;
use taustream_motion::{JointArray, Trajectory};

/// Points that differ by less are one.
const SAME_RAD: f64 = 1e-12;
/// Instants at which it is looked for where the motion is farthest from the lines.
const INSTANTS: u32 = 4_000;

/// Imports way points: straight from one to the next, each inner one passed within the blend, widest first; with a stop at
/// each where no rounded motion is proven.
///
/// # Errors
/// Which point is none for this arm, or why no motion along them is proven.
pub fn import_path(
    (robot, scene): (&Robot, &Scene),
    points_rad: &[JointArray],
    blend: Blend,
) -> Result<Imported, ImportError> {
    let world = World::new(robot, scene).map_err(|name| PlanError::Shape { name })?;
    let mut corners_rad = clear_poses(&world, points_rad)?;
    corners_rad.dedup_by(|b, a| distance(a, b) <= SAME_RAD);
    let limits = robot.limits();
    let path = Path { corners_rad: &corners_rad, joints: robot.joints.len(), limits: &limits };
    let Some(inner) = corners_rad.len().checked_sub(2) else { return Err(ImportError::Still) };
    let widths_rad = if inner == 0 { Vec::new() } else { blends_rad(blend, &world) };
    let rounded = widths_rad.iter().filter_map(|width| path.rounded(&vec![*width; inner], f64::INFINITY));
    let mut refusal = ImportError::Still;
    for timed in rounded.chain(path.stopping()) {
        match proven(&world, &corners_rad, &timed) {
            Ok(imported) => return Ok(imported),
            Err(why) => refusal = why,
        }
    }
    Err(refusal)
}

fn proven(world: &World, corners_rad: &[JointArray], timed: &Timed) -> Result<Imported, ImportError> {
    let (trajectory, _, _) = within_limits(&timed.trajectory, 1.0, world.robot())?;
    let deviation = Deviation { rad: timed.deviation_rad, ..farthest(corners_rad, &trajectory) };
    let proof = verify_in(world, &trajectory, &Budget::unbounded())
        .map_err(|violation| ImportError::Unproven { deviation_rad: deviation.rad, violation })?;
    let original_s = trajectory.duration_s();
    let (kernel, time_scale, end_speeds_rad_s) = (None, 1.0, [0.0; 2]);
    Ok(Imported { trajectory, proof, kernel, time_scale, original_s, deviation, end_speeds_rad_s })
}

/// Where the motion is farthest from the straight lines, and the joint that is farthest there.
fn farthest(corners_rad: &[JointArray], motion: &Trajectory) -> Deviation {
    let mut most = (0.0, Deviation::default());
    for instant in 0..=INSTANTS {
        let at_s = motion.duration_s() * f64::from(instant) / f64::from(INSTANTS);
        let pose_rad = motion.sample(at_s).position_rad;
        let points = corners_rad.windows(2).map(|line| nearest(line, &pose_rad));
        let apart = |point: &JointArray| distance(point, &pose_rad);
        let Some(point) = points.min_by(|a, b| apart(a).total_cmp(&apart(b))) else { continue };
        if apart(&point) > most.0 {
            let by_rad = |joint: &usize| (point[*joint] - pose_rad[*joint]).abs();
            let joint = (0..point.len()).max_by(|a, b| by_rad(a).total_cmp(&by_rad(b))).unwrap_or(0);
            most = (apart(&point), Deviation { rad: apart(&point), joint, at_s });
        }
    }
    most.1
}

/// The point of a straight line that is nearest to a pose.
fn nearest(line: &[JointArray], pose_rad: &JointArray) -> JointArray {
    let [from, to] = line else { return *pose_rad };
    let (mut along, mut square) = (0.0, 0.0);
    for ((from, to), pose) in from.iter().zip(to).zip(pose_rad) {
        along += (to - from) * (pose - from);
        square += (to - from) * (to - from);
    }
    let share = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
    std::array::from_fn(|joint| from[joint] + share * (to[joint] - from[joint]))
}
