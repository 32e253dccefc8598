//! Bad settings of an arm of `RobStride` motors.
use super::Case;
use crate::common::Reader::RobStride;

pub(crate) const CASES: &[Case] = &[
    (RobStride, "node_id = 3", "node_id = 128", "servo[2].node_id", "from 1 to 127"),
    (RobStride, "node_id = 3", "node_id = 0", "servo[2].node_id", "from 1 to 127"),
    (RobStride, "node_id = 3", "node_id = 2", "servo[2].node_id", "each node id once on a bus"),
    (
        RobStride,
        "position_range_rad",
        "host_id = 5\nposition_range_rad",
        "servo[0].host_id",
        "from 128 to 253",
    ),
    (
        RobStride,
        "position_range_rad = 12.566370614359172",
        "position_range_rad = 3.1",
        "servo[0].position_range_rad",
        "another motor: its firmware fixes the range",
    ),
    (RobStride, "velocity_range_rad_s = 15.0", "", "servo[0].velocity_range_rad_s", "missing"),
    (
        RobStride,
        "velocity_range_rad_s = 15.0",
        "velocity_range_rad_s = 1.0",
        "servo[0].velocity_range_rad_s",
        "the limit of joint shoulder_pan",
    ),
    (
        RobStride,
        "stiffness_range_nm_rad = 5000.0",
        "stiffness_range_nm_rad = 0",
        "servo[0].stiffness_range_nm_rad",
        "above 0",
    ),
    (RobStride, "damping_range_nm_s_rad = 100.0", "", "servo[0].damping_range_nm_s_rad", "missing"),
    // Beyond what the wire spans, a gain would be cut off silently.
    (
        RobStride,
        "stiffness_nm_rad = 400.0",
        "stiffness_nm_rad = 5001.0",
        "servo[0].stiffness_nm_rad",
        "up to 5000",
    ),
    (RobStride, "damping_nm_s_rad = 20.0", "damping_nm_s_rad = 0.0", "servo[0].damping_nm_s_rad", "above 0"),
    (
        RobStride,
        "torque_limit_nm = 120.0",
        "torque_limit_nm = 121.0",
        "servo[0].torque_limit_nm",
        "up to 120",
    ),
    (RobStride, "torque_limit_nm = 120.0", "torque_limit_nm = nan", "servo[0].torque_limit_nm", "finite"),
    (
        RobStride,
        "\nwatchdog_ms = 100",
        "\nwatchdog_ms = 99",
        "servo[0].watchdog_ms",
        "at least cycle.drive_watchdog_ms",
    ),
    (RobStride, "\nwatchdog_ms = 100", "\nwatchdog_ms = 0", "servo[0].watchdog_ms", "from 1 to 10000"),
    (RobStride, "gain_ramp_ms = 200", "gain_ramp_ms = 3000", "servo[0].gain_ramp_ms", "a part of enabling"),
    (
        RobStride,
        "gain_ramp_ms = 200",
        "feedback_id = 3\ngain_ramp_ms = 200",
        "servo[0].feedback_id",
        "no such key",
    ),
    (
        RobStride,
        "reaction = \"limp\"",
        "reaction = \"hold\"",
        "servo[0].reaction",
        "\"limp\": a robstride servo knows no other",
    ),
];
