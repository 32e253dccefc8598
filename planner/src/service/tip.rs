//! Requests for the tip: poses of the joints that serve are tried, the nearest first; a straight line is planned at rest.
use super::{Planned, Request, Service, holding};
use crate::budget::Budget;
use crate::goals::{
    GOALS_MAX, GoalError, Orientation, Situation, TipSpeed, TipTarget, plan_line_keeping, tip_poses,
};
use crate::held::check_held;
use crate::live_scene::SceneRevision;
use crate::plan::{PlanOptions, StartMargin};
use nalgebra::{Quaternion, UnitQuaternion};
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome};
use taustream_messages::tip_goal::{TipGoal, TipLine};
use taustream_motion::JointArray;

/// How long a straight line may take whose request states no deadline.
const LINE_WITHIN: Duration = Duration::from_secs(5);

/// The target of a goal in the library's words.
fn target(tip: &TipGoal) -> TipTarget {
    let orientation = tip.orientation.map(|o| {
        let [x, y, z, w] = o.quaternion_xyzw;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Orientation { rotation, tolerance_rad: o.tolerance_rad }
    });
    // A tip that is not there is refused like one of the library's callers.
    let number = usize::try_from(tip.tip).unwrap_or(usize::MAX);
    TipTarget { tip: number, position_m: tip.position_m, tolerance_m: tip.tolerance_m, orientation }
}

fn situation<'a>((robot, revision): (&'a Robot, &'a SceneRevision), start_rad: JointArray) -> Situation<'a> {
    Situation { robot, scene: &revision.scene, start_rad, margin: StartMargin::AsItStands }
}

impl Service<'_> {
    /// Goes to the nearest pose with the tip at its goal; to the next one where no motion is found.
    pub(super) fn answer_tip(
        &mut self,
        request: &Request,
        (requested, options): (&CheckedPlanRequest, &PlanOptions),
        (tip, near_rad): (&TipGoal, JointArray),
    ) -> Result<PlanOutcome, String> {
        let revision = self.revision();
        let robot = holding(&revision.robot, requested.held_joints, &near_rad);
        let (situation, target) = (situation((&robot, &revision), near_rad), target(tip));
        let poses = self.work(request, options.deadline, |cancel| {
            tip_poses(&situation, &target, options, Some(cancel))
        })?;
        let poses = poses.map_err(|e: GoalError| e.to_string())?;
        let mut why = GoalError::NoTime.to_string();
        for goal_rad in poses.into_iter().take(GOALS_MAX) {
            let nearest = CheckedPlanRequest { goal_rad, tip: None, ..requested.clone() };
            match self.answer(request, &nearest) {
                Err(reason) => why = reason,
                done => return done,
            }
        }
        Err(why)
    }

    /// Leads the tip straight to its goal from a pose at rest.
    pub(super) fn plan_straight(
        &self,
        request: &Request,
        (start_rad, held_joints): (JointArray, u32),
        (tip, line, options): (&TipGoal, &TipLine, &PlanOptions),
    ) -> Result<Planned, String> {
        let started = Instant::now();
        let revision = self.revision();
        self.check_start(&revision, &start_rad)?;
        let robot = holding(&revision.robot, held_joints, &start_rad);
        let (situation, target) = (situation((&robot, &revision), start_rad), target(tip));
        let TipLine { linear_m_s, angular_rad_s, off_m_max } = *line;
        let speed = TipSpeed { linear_m_s, angular_rad_s, off_m_max };
        let within = if options.spends_deadline { options.deadline } else { LINE_WITHIN };
        let planned = self.work(request, within, |cancel| {
            let asked = (&speed, &options.constraints);
            plan_line_keeping(&situation, &target, asked, &Budget::until(within, Some(cancel)))
        })?;
        let line = planned.map_err(|e| e.to_string())?;
        let how = format!("straight line of the tip, at most {:.3} mm off", 1e3 * line.off_m);
        let plan = line.into_plan(how, started.elapsed().as_secs_f64());
        self.reported.stages(&plan.stages);
        check_held(&robot, &plan.trajectory, held_joints).map_err(|e| e.to_string())?;
        Ok(Planned { plan, revision })
    }
}
