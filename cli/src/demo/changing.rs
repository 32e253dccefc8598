//! The end of the demo: the tip goes to a pose, along a straight line, and to a goal while an obstacle appears in its way.
use super::file::ChangingScene;
use super::session::Session;
use super::summary::Move;
use crate::failure::Failure;
use crate::live::follow::follow;
use crate::live::replan::ask_while;
use crate::live::scene::ScenePort;
use crate::output::note;
use nalgebra::UnitQuaternion;
use std::cell::Cell;
use taustream_messages::Phase;
use taustream_messages::plan::CheckedPlanRequest;
use taustream_messages::scene::{FixedTo, ObjectPose, ObjectShape, SceneChange};
use taustream_messages::tip_goal::{TipGoal, TipLine, TipOrientation};
use taustream_motion::MAX_JOINTS;
use taustream_planner::goals::TipSpeed;

/// The name of the obstacle.
const APPEARS: &str = "appears";
/// How far the tip may be from its pose, rad about each axis.
const TURNED_RAD: f64 = 1e-3;

impl Session<'_> {
    /// Makes the three moves.
    pub(super) fn go_through_changes(
        &mut self,
        change: &ChangingScene,
        joints: usize,
    ) -> Result<(), Failure> {
        let [roll, pitch, yaw] = change.tip_rpy_rad;
        let quaternion_xyzw = UnitQuaternion::from_euler_angles(roll, pitch, yaw).coords.into();
        let orientation = Some(TipOrientation { quaternion_xyzw, tolerance_rad: [TURNED_RAD; 3] });
        let TipSpeed { linear_m_s, angular_rad_s, off_m_max } = TipSpeed::default();
        let straight = TipLine { linear_m_s, angular_rad_s, off_m_max };
        for (position_m, line) in [(change.tip_m, None), (change.line_to_m, Some(straight))] {
            let tip = TipGoal { tip: 0, position_m, tolerance_m: 1e-3, orientation, line };
            let request = CheckedPlanRequest {
                tip: Some(tip),
                ..CheckedPlanRequest::to_pose(joints, [0.0; MAX_JOINTS])
            };
            self.repeat(|session, number| session.go(&request, number))?;
        }
        let request = CheckedPlanRequest::to_pose(joints, change.goal_rad);
        self.repeat(|session, number| session.go_while_it_appears(change, &request, number))
    }

    /// Adds the obstacle while the arm moves; a motion that is stopped for it is planned again.
    fn go_while_it_appears(
        &self,
        change: &ChangingScene,
        request: &CheckedPlanRequest,
        number: usize,
    ) -> Result<Move, Failure> {
        let mut scene = ScenePort::open(&self.client)?;
        let planned = ask_while(&self.client, self.arm, request, &mut || self.look(), &mut |_| ())?;
        let effect = Cell::new(None);
        let followed = follow(&self.client, self.arm, planned.trajectory_id, |report, phase| {
            self.see(report, phase)?;
            let under_way = phase == Phase::Moving && report.trajectory_s >= change.after_s;
            if under_way && report.trajectory_id == planned.trajectory_id && effect.get().is_none() {
                let added = scene.change(&self.arm.name, &[addition(change)])?;
                note(format_args!("SCENE: {added}"));
                let replaced = added.trajectory_id;
                effect.set(Some(added.effect));
                // The motion that it was has gone on, and is not followed to its end.
                return if replaced.is_some() || added.effect.starts_with("stopped") {
                    Err(Failure::Failed(format!("the motion was {}", added.effect)))
                } else {
                    Ok(())
                };
            }
            Ok(())
        });
        match (followed, effect.take()) {
            (Ok(executed), _) => Ok(Move::new(number, planned, executed)),
            (Err(_), Some("rerouted")) => {
                let (report, _) = self.client.report()?;
                let id = if report.successor_id == 0 { report.trajectory_id } else { report.successor_id };
                let executed = self.follow_to_its_end(id)?;
                Ok(Move::new(number, planned.rerouted(id), executed))
            }
            (Err(_), Some("stopped")) => {
                self.wait_for(Phase::Holding, "come to rest")?;
                self.go(request, number)
            }
            (Err(why), _) => Err(why),
        }
    }
}

fn addition(change: &ChangingScene) -> SceneChange {
    SceneChange::Add {
        name: APPEARS.to_owned(),
        shape: ObjectShape::Sphere { radius_m: change.radius_m },
        pose: ObjectPose { position_m: change.center_m, quaternion_xyzw: [0.0, 0.0, 0.0, 1.0] },
        fixed_to: FixedTo::Base,
        mass_kg: 0.0,
        // A move that is made again after a fault finds it there.
        replaces: true,
    }
}
