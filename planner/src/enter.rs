//! The first stretch of an arm that stands outside its position limits: every joint that is outside goes straight to the
//! nearest angle inside, the others stand still. The streamer takes no other motion from there.
use taustream_arm::Robot;
use taustream_motion::JointArray;
use taustream_motion::digits::Amount;

/// How an arm comes inside.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The nearest pose inside.
    pub pose_rad: JointArray,
    /// What is reported.
    pub words: String,
}

impl Entry {
    /// `None` when every joint is inside, up to the tolerance.
    #[must_use]
    pub fn of(robot: &Robot, start_rad: &JointArray) -> Option<Self> {
        let mut pose_rad = *start_rad;
        let mut outside = Vec::new();
        for (position_rad, joint) in pose_rad.iter_mut().zip(&robot.joints) {
            if !joint.limits.is_inside(*position_rad) {
                let by_rad = joint.limits.outside_rad(*position_rad).abs();
                outside.push(format!("{} by {} {}", joint.name, Amount(by_rad), joint.kind.unit()));
                *position_rad = joint.limits.nearest_inside(*position_rad);
            }
        }
        let words = format!("led inwards first, from outside the limits: {}", outside.join(", "));
        (!outside.is_empty()).then_some(Self { pose_rad, words })
    }
}
