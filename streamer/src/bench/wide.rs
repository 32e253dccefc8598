//! The arm with as many servos as one streamer drives, on four buses: what more joints and buses cost.
use taustream_arm::Settings;
use taustream_motion::MAX_JOINTS;

/// Buses over which they are spread.
const BUSES: usize = 4;

/// The same settings with the joints, servos and buses of the arm repeated in turn. Only for a link that drops everything: names
/// and node ids repeat too. Axes and torques are left out.
pub(super) fn widened(settings: &Settings) -> Settings {
    let mut wide = settings.clone();
    "sixteen".clone_into(&mut wide.name);
    (wide.axes, wide.feed_forward) = (Vec::new(), None);
    wide.robot.joints = settings.robot.joints.iter().cycle().take(MAX_JOINTS).cloned().collect();
    wide.buses = settings.buses.iter().cycle().take(BUSES).cloned().collect();
    let servos = settings.servos.iter().filter(|servo| servo.joint < settings.robot.joints.len());
    wide.servos = servos.cycle().take(MAX_JOINTS).cloned().collect();
    for (joint, servo) in wide.servos.iter_mut().enumerate() {
        (servo.joint, servo.bus) = (joint, joint * BUSES / MAX_JOINTS);
    }
    wide
}
