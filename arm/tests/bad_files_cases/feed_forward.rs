//! Bad sections `[feed_forward]`.
use super::Case;
use crate::common::Reader::{Damiao, Settings};

const CYCLE: &str = "[cycle]";

/// A good section before `[cycle]`, of these keys and this joint's keys.
macro_rules! section {
    ($keys:literal, $joint:literal) => {
        concat!("[feed_forward]\n", $keys, "\n[[feed_forward.joint]]\n", $joint, "\n[cycle]")
    };
    ($joint:literal) => {
        section!("gravity = true\ninertia = true\nshare = 1.0", $joint)
    };
}

pub(crate) const CASES: &[Case] = &[
    (
        Settings,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"),
        "feed_forward.joint[0].joint",
        "carries a torque beside the position (a Damiao motor in mode \"mit\", a CiA 402 drive with offset = true in [servo.torque]); that of joint elbow is \"cia402\"",
    ),
    (
        Damiao,
        CYCLE,
        "[feed_forward]\ngravity = true\ninertia = true\nshare = 1.0\n[cycle]",
        "feed_forward.joint",
        "one table [[feed_forward.joint]]",
    ),
    (
        Damiao,
        CYCLE,
        section!(
            "inertia = true\nshare = 1.0",
            "joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"
        ),
        "feed_forward.gravity",
        "missing",
    ),
    (
        Damiao,
        CYCLE,
        section!(
            "gravity = true\nshare = 1.0",
            "joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"
        ),
        "feed_forward.inertia",
        "missing",
    ),
    (
        Damiao,
        CYCLE,
        section!(
            "gravity = true\ninertia = true\nshare = 1.01",
            "joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"
        ),
        "feed_forward.share",
        "above 0 up to 1",
    ),
    (
        Damiao,
        CYCLE,
        section!(
            "gravity = true\ninertia = true\nshare = nan",
            "joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"
        ),
        "feed_forward.share",
        "finite",
    ),
    (
        Damiao,
        CYCLE,
        section!(
            "gravity = false\ninertia = false\nshare = 1",
            "joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"
        ),
        "feed_forward.gravity",
        "there is no torque to command",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"knee\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"),
        "feed_forward.joint[0].joint",
        "a joint of robot ur5: shoulder_pan",
    ),
    (
        Damiao,
        CYCLE,
        section!(
            "joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0\n[[feed_forward.joint]]\njoint = \"elbow\"\n\
             torque_nm_max = 20.0\nrate_nm_s_max = 50.0"
        ),
        "feed_forward.joint[1].joint",
        "each joint once",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 0.0\nrate_nm_s_max = 50.0"),
        "feed_forward.joint[0].torque_nm_max",
        "above 0",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\nrate_nm_s_max = 50.0"),
        "feed_forward.joint[0].torque_nm_max",
        "missing",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 55.0\nrate_nm_s_max = 50.0"),
        "feed_forward.joint[0].torque_nm_max",
        "= 55.0: expected at most torque_range_nm = 54.0",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 151.0\nrate_nm_s_max = 50.0"),
        "feed_forward.joint[0].torque_nm_max",
        "at most 150.0 Nm, the greatest torque of joint elbow",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 20.0"),
        "feed_forward.joint[0].rate_nm_s_max",
        "missing",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = inf"),
        "feed_forward.joint[0].rate_nm_s_max",
        "inf",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0\ncoulomb_nm = 20.5"),
        "feed_forward.joint[0].coulomb_nm",
        "at most torque_nm_max = 20.0",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0\nviscous_nm_s_rad = -1"),
        "feed_forward.joint[0].viscous_nm_s_rad",
        "from 0 to",
    ),
    (
        Damiao,
        CYCLE,
        section!("joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0\nstiction_nm = 1"),
        "feed_forward.joint[0].stiction_nm",
        "no such key",
    ),
    (
        Damiao,
        CYCLE,
        section!(
            "gravity = true\ninertia = true\nshare = 1.0\nscale = 2",
            "joint = \"elbow\"\ntorque_nm_max = 20.0\nrate_nm_s_max = 50.0"
        ),
        "feed_forward.scale",
        "no such key",
    ),
    (Damiao, "name = \"damiao6\"", "name = \"damiao6\"\nfeed_forward = true", "feed_forward", "a table"),
];
