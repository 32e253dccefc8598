//! Lists of joint positions on the command line: `"0,-1.57,1.57,0,0,0"`, in rad where no unit says otherwise (`90deg`); those of
//! prismatic joints in m (`0.2`, `0.2m`, `200mm`), whatever the option says of angles.
use crate::failure::Failure;
use nalgebra::{Quaternion, UnitQuaternion};
use std::f64::consts::{PI, TAU};
use std::str::FromStr;
use taustream_arm::{Group, Robot, RobotJoint};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS};

/// Finite positions of joints, base to tip.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Angles(Vec<Given>);

/// What stands for one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Given {
    /// A number without a unit: what it is in rad by the option, and as it stands, which is m for a prismatic joint.
    Plain { angle_rad: f64, number: f64 },
    /// With a unit of angles.
    Angle(f64),
    /// With a unit of lengths.
    Length(f64),
}

impl Given {
    /// The position of a joint: rad, or m.
    fn of(self, joint: &RobotJoint, option: &str) -> Result<f64, Failure> {
        match (self, joint.kind) {
            (Self::Plain { angle_rad, .. } | Self::Angle(angle_rad), JointKind::Revolute) => Ok(angle_rad),
            (Self::Plain { number, .. }, JointKind::Prismatic) => Ok(number),
            (Self::Length(length_m), JointKind::Prismatic) => Ok(length_m),
            (Self::Angle(_), JointKind::Prismatic) => Err(Failure::Usage(format!(
                "{option} has an angle for joint {}, which is prismatic; write its position in m (0.2, 0.2m or 200mm)",
                joint.name
            ))),
            (Self::Length(_), JointKind::Revolute) => Err(Failure::Usage(format!(
                "{option} has a length for joint {}, which is revolute; write its angle (1.2, 1.2rad or 90deg)",
                joint.name
            ))),
        }
    }
}

/// Why text is no list of angles.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum AnglesError {
    /// A word that is no number.
    #[error(
        "value {position} is `{word}`, which is no number; write angles in rad, or with a unit (90deg), separated by commas: \"0,-1.57,1.57\""
    )]
    Word {
        /// One-based place in the list.
        position: usize,
        /// What stands there.
        word: String,
    },
    /// NaN or infinite.
    #[error("value {position} is {value}; an angle must be finite (rad)")]
    NotFinite {
        /// One-based place in the list.
        position: usize,
        /// The value.
        value: f64,
    },
    /// More than an arm can have.
    #[error("{count} values; an arm has 1 to {MAX_JOINTS} joints")]
    Count {
        /// How many were given.
        count: usize,
    },
}

impl FromStr for Angles {
    type Err = AnglesError;

    fn from_str(text: &str) -> Result<Self, AnglesError> {
        Self::parse(text, 1.0)
    }
}

/// What a degree is, rad.
const RAD_PER_DEG: f64 = PI / 180.0;

impl Angles {
    /// No angles.
    pub(crate) const NONE: &'static Self = &Self(Vec::new());

    /// Angles in degrees where no unit says otherwise.
    ///
    /// # Errors
    /// Why the text is no list of angles.
    pub(crate) fn of_degrees(text: &str) -> Result<Self, AnglesError> {
        Self::parse(text, RAD_PER_DEG)
    }

    /// `factor` makes rad of a value without unit.
    fn parse(text: &str, factor: f64) -> Result<Self, AnglesError> {
        let mut values = Vec::with_capacity(MAX_JOINTS);
        for (i, word) in text.split(',').enumerate() {
            let (position, word) = (i + 1, word.trim());
            let refused = || AnglesError::Word { position, word: word.to_owned() };
            let given = given(word, factor).ok_or_else(refused)?;
            let (Given::Plain { angle_rad: value, .. } | Given::Angle(value) | Given::Length(value)) = given;
            if !value.is_finite() {
                return Err(AnglesError::NotFinite { position, value });
            }
            values.push(given);
        }
        match values.len() {
            1..=MAX_JOINTS => Ok(Self(values)),
            count => Err(AnglesError::Count { count }),
        }
    }
}

/// One position, with or without a unit; `factor` turns a bare number into rad.
fn given(word: &str, factor: f64) -> Option<Given> {
    const LENGTHS: [(&str, f64); 2] = [("mm", 1e-3), ("m", 1.0)];
    if let Some((number, unit_m)) = LENGTHS.iter().find_map(|(unit, m)| Some((word.strip_suffix(unit)?, m))) {
        return number.trim_end().parse::<f64>().ok().map(|value| Given::Length(value * unit_m));
    }
    if let Ok(number) = word.parse::<f64>() {
        return Some(Given::Plain { angle_rad: number * factor, number });
    }
    angle_rad(word, factor).map(Given::Angle)
}

/// One angle in rad: a number with `deg`, `rad`, or neither, which `factor` turns into rad.
pub(crate) fn angle_rad(word: &str, factor: f64) -> Option<f64> {
    const UNITS: [(&str, f64); 3] = [("deg", RAD_PER_DEG), ("\u{b0}", RAD_PER_DEG), ("rad", 1.0)];
    let unit = UNITS.iter().find_map(|(unit, factor)| Some((word.strip_suffix(unit)?, *factor)));
    let (number, factor) = unit.unwrap_or((word, factor));
    number.trim_end().parse::<f64>().ok().map(|value| value * factor)
}

impl From<Vec<f64>> for Angles {
    fn from(values: Vec<f64>) -> Self {
        Self(values.into_iter().map(|number| Given::Plain { angle_rad: number, number }).collect())
    }
}

/// What one number a joint is wanted for: the names, and the unit of those that are not in rad.
fn wanted<'j>(joints: impl Iterator<Item = &'j RobotJoint>) -> String {
    let name = |joint: &RobotJoint| {
        if joint.kind.is_prismatic() { format!("{} (m)", joint.name) } else { joint.name.clone() }
    };
    joints.map(name).collect::<Vec<_>>().join(", ")
}

impl Angles {
    /// The angles as a pose of `robot`; `option` is the word that gave them.
    ///
    /// # Errors
    /// When there is not one value a joint.
    pub(crate) fn pose_of(&self, robot: &Robot, option: &str) -> Result<JointArray, Failure> {
        let (got, joints) = (self.0.len(), robot.joints.len());
        if got != joints {
            return Err(Failure::Usage(format!(
                "{option} has {got} values, but robot `{}` has {joints} joints; give one angle (rad) for each of: {}",
                robot.name,
                wanted(robot.joints.iter())
            )));
        }
        let mut pose = [0.0; MAX_JOINTS];
        for ((slot, given), joint) in pose.iter_mut().zip(&self.0).zip(&robot.joints) {
            *slot = given.of(joint, option)?;
        }
        Ok(pose)
    }

    /// The angles as a pose in which a group has them and the other joints those of `others_rad`.
    ///
    /// # Errors
    /// When there is not one value a joint of the group.
    pub(crate) fn pose_in(
        &self,
        (robot, group): (&Robot, Option<&Group>),
        others_rad: &JointArray,
        option: &str,
    ) -> Result<JointArray, Failure> {
        let Some(group) = group else { return self.pose_of(robot, option) };
        let (got, joints) = (self.0.len(), group.joints.len());
        if got != joints {
            let members = group.joints.iter().filter_map(|joint| robot.joints.get(*joint));
            return Err(Failure::Usage(format!(
                "{option} has {got} values, but group `{}` has {joints} joints; give one angle (rad) for each of: {}",
                group.name,
                wanted(members)
            )));
        }
        let mut pose = *others_rad;
        for (index, given) in group.joints.iter().zip(&self.0) {
            if let (Some(slot), Some(joint)) = (pose.get_mut(*index), robot.joints.get(*index)) {
                *slot = given.of(joint, option)?;
            }
        }
        Ok(pose)
    }

    /// A second sentence for values that look like degrees: beyond any turn, or beyond the joint's range while
    /// the same number in degrees lies inside it. It never changes what is done with them.
    pub(crate) fn degrees_hint(&self, robot: &Robot, group: Option<&Group>) -> Option<String> {
        let is_in = |joint: usize| group.is_none_or(|group| group.joints.contains(&joint));
        let joints =
            robot.joints.iter().enumerate().filter(|(joint, _)| is_in(*joint)).map(|(_, joint)| joint);
        let mut plain = self.0.iter().zip(joints).filter_map(|(given, joint)| match given {
            Given::Plain { angle_rad, .. } | Given::Angle(angle_rad) if !joint.kind.is_prismatic() => {
                Some((*angle_rad, joint))
            }
            Given::Plain { .. } | Given::Angle(_) | Given::Length(_) => None,
        });
        let (degrees, _) = plain.find(|(value, joint)| {
            let [low, high] = joint.limits.position_rad;
            let outside = *value < low || *value > high;
            let as_degrees = *value * PI / 180.0;
            outside && value.abs() > TAU && (low..=high).contains(&as_degrees)
        })?;
        Some(format!(
            "angles are in rad, and {degrees} looks like degrees: {degrees} deg = {:.4} rad",
            degrees * PI / 180.0
        ))
    }
}

/// A point of `plan --to-position`: three finite numbers of metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Position(pub(crate) [f64; 3]);

impl FromStr for Position {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |(axis, word): (char, &str)| match word.trim().parse::<f64>() {
            Ok(value_m) if value_m.is_finite() => Ok(value_m),
            Ok(value_m) => Err(format!("{axis} is {value_m}; it must be finite (m)")),
            Err(_) => Err(format!("{axis} is `{}`, which is no number of metres", word.trim())),
        };
        let words: Vec<&str> = text.split(',').collect();
        let [x, y, z] = words.as_slice() else {
            return Err(format!("{} values; a position is three: \"0.4,-0.2,0.3\" (m)", words.len()));
        };
        Ok(Self([parse(('x', x))?, parse(('y', y))?, parse(('z', z))?]))
    }
}

/// Numbers apart by commas, each finite.
fn finite(text: &str, what: &str) -> Result<Vec<f64>, String> {
    let parse = |(i, word): (usize, &str)| match word.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(value) => Err(format!("value {} is {value}; {what} must be finite", i + 1)),
        Err(_) => Err(format!("value {} is `{}`, which is no number", i + 1, word.trim())),
    };
    text.split(',').enumerate().map(parse).collect()
}

/// A quaternion's length may differ from 1 by so much: rounding of a few printed digits.
const UNIT_MAX: f64 = 0.01;

/// A pose of the tip: `plan --to-pose`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TipPose {
    /// In the base's frame.
    pub(crate) position_m: [f64; 3],
    /// The tip's axes in the base's frame.
    pub(crate) rotation: UnitQuaternion<f64>,
}

impl FromStr for TipPose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const FORMS: &str = "a pose of the tip is six numbers (x,y,z in m, roll,pitch,yaw in rad) or seven (x,y,z in m, then \
                             a quaternion x,y,z,w)";
        match *finite(text, "a pose")?.as_slice() {
            [x, y, z, roll, pitch, yaw] => {
                let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                Ok(Self { position_m: [x, y, z], rotation })
            }
            [x, y, z, qx, qy, qz, qw] => {
                let quaternion = Quaternion::new(qw, qx, qy, qz);
                let length = quaternion.norm();
                if (length - 1.0).abs() > UNIT_MAX {
                    return Err(format!(
                        "the quaternion's length is {length:.4}; it must be 1 (order x,y,z,w)"
                    ));
                }
                Ok(Self { position_m: [x, y, z], rotation: UnitQuaternion::from_quaternion(quaternion) })
            }
            ref other => Err(format!("{} values; {FORMS}", other.len())),
        }
    }
}

/// How far a tip may be turned about each of its axes: `plan --tolerance-rad`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tolerances(pub(crate) [f64; 3]);

impl FromStr for Tolerances {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |word: &str| match word.trim() {
            "free" => Ok(f64::INFINITY),
            word => match angle_rad(word, 1.0) {
                Some(value) if value.is_finite() && value >= 0.0 => Ok(value),
                _ => Err(format!("`{word}` is no tolerance; write rad (0 or more), 5deg, or free")),
            },
        };
        match *text.split(',').map(parse).collect::<Result<Vec<f64>, String>>()?.as_slice() {
            [all] => Ok(Self([all; 3])),
            [x, y, z] => Ok(Self([x, y, z])),
            ref other => Err(format!("{} values; give one, or one about each of x, y, z", other.len())),
        }
    }
}

/// Times of `sample --at`: any number of finite seconds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Times(pub(crate) Vec<f64>);

impl FromStr for Times {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |(i, word): (usize, &str)| match word.trim().parse::<f64>() {
            Ok(t_s) if t_s.is_finite() => Ok(t_s),
            Ok(t_s) => Err(format!("time {} is {t_s}; it must be finite (s)", i + 1)),
            Err(_) => Err(format!("time {} is `{}`, which is no number of seconds", i + 1, word.trim())),
        };
        text.split(',').enumerate().map(parse).collect::<Result<_, _>>().map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_rad(angles: Result<Angles, AnglesError>) -> Vec<f64> {
        let value = |given: &Given| match given {
            Given::Plain { angle_rad, .. } | Given::Angle(angle_rad) => *angle_rad,
            Given::Length(_) => f64::NAN,
        };
        angles.map(|angles| angles.0.iter().map(value).collect()).unwrap_or_default()
    }

    #[test]
    fn angles_parse_one_value_a_joint() {
        assert_eq!(in_rad("0, -1.5,2e-3".parse()), [0.0, -1.5, 0.002]);
    }

    #[test]
    fn positions_of_prismatic_joints_are_metres_whatever_the_option_says() {
        let text = "name = \"r\"\n[[joint]]\nname = \"lift\"\nkind = \"prismatic\"\nlink_radius_m = 0.0\nposition_m = [0, 1]\n\
            dh = { a_m = 0.0, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }\n\
            motion = { velocity_m_s = 1.0, acceleration_m_s2 = 2.0, jerk_m_s3 = 20.0 }\n\
            [[joint]]\nname = \"arm\"\nlink_radius_m = 0.0\nposition_rad = [-3, 3]\n\
            dh = { a_m = 0.5, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }\n\
            motion = { velocity_rad_s = 1.0, acceleration_rad_s2 = 2.0, jerk_rad_s3 = 20.0 }\n";
        let robot = Robot::from_toml(std::path::Path::new("r.toml"), text).unwrap();
        let pose = |angles: Angles| angles.pose_of(&robot, "--goal").map(|pose| [pose[0], pose[1]]);
        for (text, expected) in
            [("0.25,90", [0.25, PI / 2.0]), ("0.25m,1rad", [0.25, 1.0]), ("250 mm,-90deg", [0.25, -PI / 2.0])]
        {
            let got = pose(Angles::of_degrees(text).unwrap()).unwrap();
            assert!(
                (got[0] - expected[0]).abs() < 1e-12 && (got[1] - expected[1]).abs() < 1e-12,
                "{text}: {got:?}"
            );
        }
        for (text, words) in [
            ("10deg,0", "joint lift, which is prismatic"),
            ("0,0.1m", "joint arm, which is revolute"),
            ("0", "lift (m), arm"),
        ] {
            let refused = pose(text.parse().unwrap()).unwrap_err().to_string();
            assert!(refused.contains(words), "{text}: {refused}");
        }
    }

    #[test]
    fn angles_with_a_unit_are_taken_by_it_and_others_by_the_option() {
        assert_eq!(in_rad("90deg,1, -180 deg,0.5rad,45\u{b0}".parse()), [PI / 2.0, 1.0, -PI, 0.5, PI / 4.0]);
        assert_eq!(in_rad(Angles::of_degrees("90,1rad,-180deg")), [PI / 2.0, 1.0, -PI]);
        assert!(Angles::of_degrees("x").is_err());
    }

    #[test]
    fn angles_refuse_what_is_no_finite_number_and_say_which() {
        let cases = [
            ("", "value 1 is ``"),
            ("0,,0", "value 2 is ``"),
            ("0,x", "value 2 is `x`"),
            ("0;1", "value 1 is `0;1`"),
            ("1.0,NaN", "value 2 is NaN"),
            ("inf", "value 1 is inf"),
            ("0,1e999", "value 2 is inf"),
            ("90grad", "value 1 is `90grad`"),
            ("deg", "value 1 is `deg`"),
            ("1e999deg", "value 1 is inf"),
            ("0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0", "17 values"),
        ];
        for (text, expected) in cases {
            let error = text.parse::<Angles>().unwrap_err().to_string();
            assert!(error.contains(expected), "`{text}`: {error}");
        }
    }

    #[test]
    fn position_is_three_finite_numbers() {
        assert_eq!("0.4, -0.2,3e-1".parse::<Position>(), Ok(Position([0.4, -0.2, 0.3])));
        let cases = [
            ("", "1 values"),
            ("1,2", "2 values"),
            ("1,2,3,4", "4 values"),
            ("1,,3", "y is ``"),
            ("x,2,3", "x is `x`"),
            ("1,2,nan", "z is NaN"),
            ("1,-inf,3", "y is -inf"),
            ("1e999,0,0", "x is inf"),
            ("400mm,0,0", "x is `400mm`"),
        ];
        for (text, expected) in cases {
            let error = text.parse::<Position>().unwrap_err();
            assert!(error.contains(expected), "`{text}`: {error}");
        }
    }

    #[test]
    fn times_refuse_what_is_not_finite() {
        assert_eq!("0,0.5".parse::<Times>(), Ok(Times(vec![0.0, 0.5])));
        assert!("0,nan".parse::<Times>().unwrap_err().contains("time 2"));
        assert!("".parse::<Times>().unwrap_err().contains("time 1"));
    }
}
