//! Where a motion shall end: the options that `plan` and `replan` share.
use super::tip::TipArgs;
use crate::angles::{Angles, Position, TipPose, Tolerances};
use crate::failure::Failure;
use clap::{ArgGroup, Args};
use taustream_arm::{Group, NamedPose, Robot};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_planner::TipConstraints;
use taustream_planner::goals::{Orientation, TipSpeed, TipTarget, nearest_turn};

/// A goal.
#[derive(Args, Debug)]
#[command(group(ArgGroup::new("goal_kind").required(true)))]
pub(crate) struct GoalArgs {
    /// Move the joints of one group only (`[[group]]` of the robot file): goals have its values, and the other joints hold.
    ///
    /// --to-position and --to-pose are for the group's tip: a robot with several tips needs the group to say which.
    #[arg(long, value_name = "NAME")]
    group: Option<String>,
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
    /// Turning speed of the tip along the straight line, rad/s.
    #[arg(long, value_name = "RAD_S", allow_negative_numbers = true, default_value_t = TipSpeed::default().angular_rad_s, requires = "linear")]
    tip_speed_rad_s: f64,
    /// How far the tip may be from the straight line, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, default_value_t = TipSpeed::default().off_m_max, requires = "linear")]
    line_off_m: f64,
    /// Take each joint with more than one turn to the nearest angle at which its link stands as in the goal.
    #[arg(long, conflicts_with_all = ["by", "by_deg", "to_position", "to_pose"])]
    nearest_turn: bool,
    /// What the tip must keep on the way.
    #[command(flatten)]
    tip: TipArgs,
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
    /// The group that alone moves, if one was named.
    ///
    /// # Errors
    /// A name that no group of the robot has.
    pub(crate) fn group_of<'r>(&self, robot: &'r Robot) -> Result<Option<&'r Group>, Failure> {
        group_of(robot, self.group.as_deref())
    }

    /// The goal of an arm that starts somewhere; joints of other groups stay there.
    ///
    /// # Errors
    /// Not one value a joint, a name that no pose has, or a tip that is not named.
    pub(crate) fn of(&self, robot: &Robot, start_rad: &JointArray) -> Result<Goal, Failure> {
        let group = self.group_of(robot)?;
        if let Some(target) = self.tip() {
            return Ok(Goal::Tip(TipTarget { tip: tip_of(robot, group)?, ..target }));
        }
        let mut poses_rad = Vec::new();
        for (angles, option) in self.angles() {
            poses_rad.push(angles.pose_in((robot, group), start_rad, option)?);
        }
        if let Some((angles, option)) = self.relative() {
            let by_rad = angles.pose_in((robot, group), &[0.0; MAX_JOINTS], option)?;
            poses_rad.push(std::array::from_fn(|i| start_rad[i] + by_rad[i]));
        }
        if let Some(name) = &self.to_named {
            poses_rad.push(named_pose(robot, group, start_rad, name)?);
        }
        if self.nearest_turn {
            poses_rad.iter_mut().for_each(|pose| *pose = nearest_turn(robot, start_rad, pose));
        }
        Ok(Goal::Poses(poses_rad))
    }

    /// How the tip goes along a straight line.
    pub(crate) fn tip_speed(&self) -> TipSpeed {
        let linear_m_s = self.tip.tip_speed_m_s.unwrap_or(TipSpeed::default().linear_m_s);
        let (angular_rad_s, off_m_max) = (self.tip_speed_rad_s, self.line_off_m);
        TipSpeed { linear_m_s, angular_rad_s, off_m_max }
    }

    /// What the tip must keep on the way.
    ///
    /// # Errors
    /// A tip that is not named, or numbers that make no sense.
    pub(crate) fn constraints(&self, robot: &Robot) -> Result<TipConstraints, Failure> {
        constraints_of(&self.tip, robot, self.group_of(robot)?)
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

/// What the tip of a group must keep.
///
/// # Errors
/// A tip that is not named, or numbers that make no sense.
pub(crate) fn constraints_of(
    asked: &TipArgs,
    robot: &Robot,
    group: Option<&Group>,
) -> Result<TipConstraints, Failure> {
    if !asked.is_given() {
        return Ok(TipConstraints::default());
    }
    asked.of(tip_of(robot, group)?).map_err(Failure::Usage)
}

/// The group of a name, if one was given.
///
/// # Errors
/// A name that no group of the robot has.
pub(crate) fn group_of<'r>(robot: &'r Robot, name: Option<&str>) -> Result<Option<&'r Group>, Failure> {
    let Some(name) = name else { return Ok(None) };
    let no_such_group = || {
        let names: Vec<&str> = robot.groups.iter().map(|group| group.name.as_str()).collect();
        let known = if names.is_empty() {
            "none; add [[group]] tables with name and tip_link or joints to the robot file".to_owned()
        } else {
            names.join(", ")
        };
        Failure::Usage(format!("--group: robot `{}` has no group `{name}`; it has: {known}", robot.name))
    };
    robot.group(name).map(Some).ok_or_else(no_such_group)
}

/// The tip that a group leads, or the only one.
///
/// # Errors
/// Several tips and no group, or a group that leads none of its own.
pub(crate) fn tip_of(robot: &Robot, group: Option<&Group>) -> Result<usize, Failure> {
    let (tips, name) = (&robot.tips, &robot.name);
    match group {
        Some(group) => group.tip.ok_or_else(|| {
            Failure::Usage(format!(
                "--group {}: it leads no tip of its own; give it a tip_link in the robot file, or a goal of the joints",
                group.name
            ))
        }),
        None if tips.len() == 1 => Ok(0),
        None => {
            let led = robot.groups.iter().filter_map(|g| Some(format!("{} ({})", g.name, tips.get(g.tip?)?.name)));
            let led: Vec<String> = led.collect();
            let tips: Vec<&str> = tips.iter().map(|tip| tip.name.as_str()).collect();
            let remedy = if led.is_empty() {
                "add a [[group]] with tip_link for each to the robot file".to_owned()
            } else {
                led.join(", ")
            };
            Err(Failure::Usage(format!(
                "robot `{name}` has several tips ({}); say which one by --group: {remedy}",
                tips.join(", ")
            )))
        }
    }
}

/// A pose by its name: of the group, or the group's part of one of all joints; without a group one of all joints.
fn named_pose(
    robot: &Robot,
    group: Option<&Group>,
    start_rad: &JointArray,
    name: &str,
) -> Result<JointArray, Failure> {
    let Some(group) = group else {
        return robot.pose(name).ok_or_else(|| no_such_pose(robot, name));
    };
    let is_own = |of: usize| robot.groups.get(of).is_some_and(|of| of.name == group.name);
    let own = robot.poses.iter().find(|pose| pose.name == name && pose.group.is_some_and(is_own));
    let found = own.map(|pose| pose.position_rad).or_else(|| robot.pose(name));
    let found = found.ok_or_else(|| no_such_pose(robot, name))?;
    let mut pose_rad = *start_rad;
    group.joints.iter().for_each(|joint| pose_rad[*joint] = found[*joint]);
    Ok(pose_rad)
}

fn no_such_pose(robot: &Robot, name: &str) -> Failure {
    let word = |pose: &NamedPose| match pose.group.and_then(|group| robot.groups.get(group)) {
        Some(group) => format!("{} (--group {})", pose.name, group.name),
        None => pose.name.clone(),
    };
    let names: Vec<String> = robot.poses.iter().map(word).collect();
    let known = if names.is_empty() {
        "none; add a [[pose]] table with name and position_rad to the robot file".to_owned()
    } else {
        names.join(", ")
    };
    Failure::Usage(format!("--to-named: robot `{}` has no pose `{name}`; it has: {known}", robot.name))
}
