//! Lists of joint angles on the command line: `"0,-1.57,1.57,0,0,0"`, in rad where no unit says otherwise (`90deg`).
use crate::failure::Failure;
use nalgebra::{Quaternion, UnitQuaternion};
use std::f64::consts::{PI, TAU};
use std::str::FromStr;
use taustream_arm::{Group, Robot};
use taustream_motion::{JointArray, MAX_JOINTS};

/// One to eight finite angles, base to tip.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Angles(Vec<f64>);

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
            let value = angle_rad(word, factor).ok_or_else(refused)?;
            if !value.is_finite() {
                return Err(AnglesError::NotFinite { position, value });
            }
            values.push(value);
        }
        match values.len() {
            1..=MAX_JOINTS => Ok(Self(values)),
            count => Err(AnglesError::Count { count }),
        }
    }
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
        Self(values)
    }
}

impl Angles {
    /// The angles as a pose of `robot`; `option` is the word that gave them.
    ///
    /// # Errors
    /// When there is not one value a joint.
    pub(crate) fn pose_of(&self, robot: &Robot, option: &str) -> Result<JointArray, Failure> {
        let (got, joints) = (self.0.len(), robot.joints.len());
        if got != joints {
            let names: Vec<&str> = robot.joints.iter().map(|j| j.name.as_str()).collect();
            return Err(Failure::Usage(format!(
                "{option} has {got} values, but robot `{}` has {joints} joints; give one angle (rad) for each of: {}",
                robot.name,
                names.join(", ")
            )));
        }
        let mut pose = [0.0; MAX_JOINTS];
        for (slot, value) in pose.iter_mut().zip(&self.0) {
            *slot = *value;
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
            let names = group.joints.iter().filter_map(|joint| robot.joints.get(*joint));
            let names: Vec<&str> = names.map(|joint| joint.name.as_str()).collect();
            return Err(Failure::Usage(format!(
                "{option} has {got} values, but group `{}` has {joints} joints; give one angle (rad) for each of: {}",
                group.name,
                names.join(", ")
            )));
        }
        let mut pose = *others_rad;
        for (joint, value) in group.joints.iter().zip(&self.0) {
            if let Some(slot) = pose.get_mut(*joint) {
                *slot = *value;
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
        let suspicious = self.0.iter().zip(joints).find(|(value, joint)| {
            let [low, high] = joint.limits.position_rad;
            let outside = **value < low || **value > high;
            let as_degrees = **value * PI / 180.0;
            outside && value.abs() > TAU && (low..=high).contains(&as_degrees)
        })?;
        let degrees = suspicious.0;
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

    #[test]
    fn angles_parse_one_value_a_joint() {
        assert_eq!("0, -1.5,2e-3".parse::<Angles>(), Ok(Angles(vec![0.0, -1.5, 0.002])));
    }

    #[test]
    fn angles_with_a_unit_are_taken_by_it_and_others_by_the_option() {
        assert_eq!(
            "90deg,1, -180 deg,0.5rad,45\u{b0}".parse::<Angles>(),
            Ok(Angles(vec![PI / 2.0, 1.0, -PI, 0.5, PI / 4.0]))
        );
        assert_eq!(Angles::of_degrees("90,1rad,-180deg"), Ok(Angles(vec![PI / 2.0, 1.0, -PI])));
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
