//! Where a motion shall end: the options that `plan` and `replan` share.
use crate::angles::{Angles, Position, TipPose, Tolerances};
use crate::failure::Failure;
use clap::{ArgGroup, Args};
use taustream_arm::Robot;
use taustream_motion::JointArray;
use taustream_planner::goals::{Orientation, TipSpeed, TipTarget, nearest_turn};

/// A goal.
#[derive(Args, Debug)]
#[command(group(ArgGroup::new("goal_kind").required(true)))]
pub(crate) struct GoalArgs {
    /// Goal pose, rad, one value per joint; a value may have a unit: "90deg". Several: the best of them is taken.
    #[arg(long, value_name = "RAD,..", allow_hyphen_values = true, group = "goal_kind")]
    goal: Vec<Angles>,
    /// The same in degrees.
    #[arg(long, value_name = "DEG,..", allow_hyphen_values = true, value_parser = Angles::of_degrees, group = "goal_kind")]
    goal_deg: Vec<Angles>,
    /// Named pose: of the robot file (`[[pose]]`) or of its SRDF (`group_state`).
    #[arg(long, value_name = "NAME", group = "goal_kind")]
    to_named: Option<String>,
    /// Move each joint by so much from the start, rad.
    #[arg(long, value_name = "RAD,..", allow_hyphen_values = true, group = "goal_kind")]
    by: Option<Angles>,
    /// The same in degrees.
    #[arg(long, value_name = "DEG,..", allow_hyphen_values = true, value_parser = Angles::of_degrees, group = "goal_kind")]
    by_deg: Option<Angles>,
    /// Position of the tip, m, in the base frame: "0.4,-0.2,0.3". The orientation of the tip is free.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, group = "goal_kind")]
    to_position: Option<Position>,
    /// Pose of the tip in the base frame: position, m, then roll, pitch, yaw, rad, or a quaternion x, y, z, w.
    ///
    /// Roll, pitch and yaw turn about the fixed axes x, y and z in this order (as rpy in a URDF).
    #[arg(
        long,
        value_name = "X,Y,Z,R,P,Y|X,Y,Z,QX,QY,QZ,QW",
        allow_hyphen_values = true,
        group = "goal_kind"
    )]
    to_pose: Option<TipPose>,
    /// How far the tip may be from its position, m.
    #[arg(
        long,
        value_name = "M",
        allow_negative_numbers = true,
        default_value_t = 0.0,
        hide_default_value = true
    )]
    tolerance_m: f64,
    /// How far the tip may be turned from its orientation, rad: one value, or one about each of its own axes; "free" for any.
    #[arg(
        long,
        value_name = "RAD|RX,RY,RZ",
        allow_hyphen_values = true,
        default_value = "0",
        hide_default_value = true,
        conflicts_with_all = ["goal", "goal_deg", "to_named", "by", "by_deg", "to_position"]
    )]
    tolerance_rad: Tolerances,
    /// Lead the tip straight to --to-position (its orientation stays) or --to-pose (it turns evenly).
    #[arg(long, conflicts_with_all = ["goal", "goal_deg", "to_named", "by", "by_deg"])]
    pub(crate) linear: bool,
    /// Speed of the tip along the straight line, m/s.
    #[arg(long, value_name = "M_S", allow_negative_numbers = true, default_value_t = TipSpeed::default().linear_m_s, requires = "linear")]
    tip_speed_m_s: f64,
    /// Turning speed of the tip along the straight line, rad/s.
    #[arg(long, value_name = "RAD_S", allow_negative_numbers = true, default_value_t = TipSpeed::default().angular_rad_s, requires = "linear")]
    tip_speed_rad_s: f64,
    /// How far the tip may be from the straight line, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, default_value_t = TipSpeed::default().off_m_max, requires = "linear")]
    line_off_m: f64,
    /// Take each joint with more than one turn to the nearest angle at which its link stands as in the goal.
    #[arg(long, conflicts_with_all = ["by", "by_deg", "to_position", "to_pose"])]
    nearest_turn: bool,
}

/// A goal with the numbers of a robot.
#[derive(Clone, Debug)]
pub(crate) enum Goal {
    /// The best of these poses.
    Poses(Vec<JointArray>),
    /// The tip somewhere.
    Tip(TipTarget),
}

impl GoalArgs {
    /// The goal of an arm that starts somewhere.
    ///
    /// # Errors
    /// Not one value a joint, or a name that no pose has.
    pub(crate) fn of(&self, robot: &Robot, start_rad: &JointArray) -> Result<Goal, Failure> {
        if let Some(target) = self.tip() {
            return Ok(Goal::Tip(target));
        }
        let mut poses_rad = Vec::new();
        for (angles, option) in self.angles() {
            poses_rad.push(angles.pose_of(robot, option)?);
        }
        if let Some((angles, option)) = self.relative() {
            let by_rad = angles.pose_of(robot, option)?;
            poses_rad.push(std::array::from_fn(|i| start_rad[i] + by_rad[i]));
        }
        if let Some(name) = &self.to_named {
            poses_rad.push(robot.pose(name).ok_or_else(|| no_such_pose(robot, name))?);
        }
        if self.nearest_turn {
            poses_rad.iter_mut().for_each(|pose| *pose = nearest_turn(robot, start_rad, pose));
        }
        Ok(Goal::Poses(poses_rad))
    }

    /// How the tip goes along a straight line.
    pub(crate) fn tip_speed(&self) -> TipSpeed {
        let (linear_m_s, angular_rad_s, off_m_max) =
            (self.tip_speed_m_s, self.tip_speed_rad_s, self.line_off_m);
        TipSpeed { linear_m_s, angular_rad_s, off_m_max }
    }

    /// The poses that were given as angles, and the option that gave them.
    pub(crate) fn angles(&self) -> impl Iterator<Item = (&Angles, &'static str)> {
        let in_rad = self.goal.iter().map(|angles| (angles, "--goal"));
        in_rad.chain(self.goal_deg.iter().map(|angles| (angles, "--goal-deg")))
    }

    /// True when the goal depends on where the arm starts.
    pub(crate) fn needs_start(&self) -> bool {
        self.nearest_turn || self.relative().is_some()
    }

    fn relative(&self) -> Option<(&Angles, &'static str)> {
        let in_rad = self.by.as_ref().map(|angles| (angles, "--by"));
        in_rad.or_else(|| self.by_deg.as_ref().map(|angles| (angles, "--by-deg")))
    }

    /// Where the tip shall end, if that was asked for.
    pub(crate) fn tip(&self) -> Option<TipTarget> {
        let tolerance_m = self.tolerance_m;
        let at = self
            .to_position
            .map(|Position(position_m)| TipTarget { tolerance_m, ..TipTarget::position(position_m) });
        at.or_else(|| {
            let TipPose { position_m, rotation } = self.to_pose?;
            let Tolerances(tolerance_rad) = self.tolerance_rad;
            let orientation = Some(Orientation { rotation, tolerance_rad });
            Some(TipTarget { tip: 0, position_m, tolerance_m, orientation })
        })
    }
}

fn no_such_pose(robot: &Robot, name: &str) -> Failure {
    let names: Vec<&str> = robot.poses.iter().map(|pose| pose.name.as_str()).collect();
    let known = if names.is_empty() {
        "none; add a [[pose]] table with name and position_rad to the robot file".to_owned()
    } else {
        names.join(", ")
    };
    Failure::Usage(format!("--to-named: robot `{}` has no pose `{name}`; it has: {known}", robot.name))
}
