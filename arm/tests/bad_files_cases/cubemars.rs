//! Bad settings of an arm of `CubeMars` motors.
use super::Case;
use crate::common::Reader::CubeMars;

pub(crate) const CASES: &[Case] = &[
    (CubeMars, "node_id = 3", "node_id = 128", "servo[2].node_id", "from 1 to 127"),
    (CubeMars, "node_id = 3", "node_id = 2", "servo[2].node_id", "each node id once on a bus"),
    (CubeMars, "feedback_id = 3", "", "servo[2].feedback_id", "missing"),
    (CubeMars, "feedback_id = 3", "feedback_id = 2048", "servo[2].feedback_id", "from 0 to 2047"),
    // One motor would take the other's feedback for commands.
    (
        CubeMars,
        "feedback_id = 3",
        "feedback_id = 2",
        "servo[2].feedback_id",
        "joint shoulder_lift has it for commands",
    ),
    (
        CubeMars,
        "feedback_id = 1",
        "feedback_id = 6",
        "servo[5].node_id",
        "joint shoulder_pan has it for feedback",
    ),
    (
        CubeMars,
        "position_range_rad = 12.5",
        "position_range_rad = 3.1",
        "servo[0].position_range_rad",
        "another motor: its firmware fixes the range",
    ),
    (CubeMars, "torque_range_nm = 65.0", "torque_range_nm = nan", "servo[0].torque_range_nm", "finite"),
    (
        CubeMars,
        "stiffness_nm_rad = 400.0",
        "stiffness_nm_rad = 501",
        "servo[0].stiffness_nm_rad",
        "up to 500",
    ),
    (CubeMars, "damping_nm_s_rad = 5.0", "damping_nm_s_rad = 5.1", "servo[0].damping_nm_s_rad", "up to 5"),
    (CubeMars, "\nwatchdog_ms = 100", "", "servo[0].watchdog_ms", "missing"),
    (
        CubeMars,
        "\nwatchdog_ms = 100",
        "\nwatchdog_ms = 99",
        "servo[0].watchdog_ms",
        "at least cycle.drive_watchdog_ms",
    ),
    (CubeMars, "gain_ramp_ms = 200", "mode = \"mit\"\ngain_ramp_ms = 200", "servo[0].mode", "no such key"),
    (
        CubeMars,
        "reaction = \"limp\"",
        "reaction = \"ramp\"",
        "servo[0].reaction",
        "\"limp\": a cubemars servo knows no other",
    ),
];
