//! What each key of a CiA 402 drive, real or simulated, means: one sentence.

/// Key, and what it means.
pub(crate) const MEANINGS: &[(&str, &str)] = &[
    ("Settings files: servo[].counts_per_rev", "CiA 402: position counts for one motor revolution."),
    (
        "Settings files: servo[].home_offset_counts",
        "CiA 402: what the drive stated as its home offset (0x607C) when `zero_offset_rad` was determined; 0.",
    ),
    (
        "Settings files: servo[].overruled_objects",
        "CiA 402: objects of the drive that are not compared with these settings, for example `[0x6091]`; none.",
    ),
    (
        "Settings files: servo[].absent_objects",
        "CiA 402: objects that the drive lacks or has fixed, neither read nor written, for example `[0x6007]`; none.",
    ),
    (
        "Settings files: servo[].master_supervision",
        "CiA 402: how the drive finds out that its master is gone; without it `heartbeat`.",
    ),
    (
        "Settings files: servo[].boot_timeout_s",
        "CiA 402: longest time from the reset of communication to the boot-up message, s; 5.",
    ),
    (
        "Settings files: servo[].late_mode_display",
        "CiA 402: true: the modes display (0x6061) follows only in operation enabled, and is looked at there; false.",
    ),
    ("Settings files: servo[].position_mode", "CiA 402: the mode in which it follows setpoints; `cyclic`."),
    (
        "Settings files: servo[].following_window_rad",
        "CiA 402: following error window (0x6065) that is written into the drive; without it the drive's own.",
    ),
    (
        "Settings files: servo[].following_timeout_ms",
        "CiA 402: following error time-out (0x6066) that is written into the drive; without it the drive's own.",
    ),
    (
        "Settings files: servo[].write_soft_limits",
        "CiA 402: true: the joint's `position_rad` is written as software position limit (0x607D); false: compared.",
    ),
    (
        "Settings files: servo[].homing",
        "CiA 402: how the drive finds its zero by itself: see [homing.md](homing.md); without it `taustream home` is refused.",
    ),
    (
        "Settings files: servo[].homing.method",
        "Homing method (0x6098), by the drive's manual; negative ones are the maker's own.",
    ),
    (
        "Settings files: servo[].homing.velocity_unit",
        "Unit in which the drive takes speeds and, a second, accelerations, of its motor.",
    ),
    (
        "Settings files: servo[].homing.switch_speed_rad_s",
        "Speed of the joint towards the switch (0x6099:01); at most its motion limit.",
    ),
    (
        "Settings files: servo[].homing.zero_speed_rad_s",
        "Speed of the joint towards the zero (0x6099:02); at most its motion limit.",
    ),
    ("Settings files: servo[].homing.acceleration_rad_s2", "Acceleration of the joint (0x609A)."),
    ("Settings files: servo[].homing.timeout_s", "Longest time from start to end; then the drive is halted."),
    (
        "Settings files: servo[].homing.collision_risk_acknowledged",
        "true: its owner knows that nothing checks this motion for collisions; needed for methods that move (all but 35 and 37).",
    ),
    (
        "Settings files: simulator.fixed_pdos",
        "CiA 402: true: PDO 1 is mapped and on as this master needs it, and no PDO can be changed; false.",
    ),
    (
        "Settings files: simulator.late_mode_display",
        "CiA 402: true: the modes display (0x6061) follows only in operation enabled; false.",
    ),
    ("Settings files: simulator.sdo_answer_ms", "CiA 402: time that an SDO answer takes; 0."),
    (
        "Settings files: simulator.switch_on_ms",
        "CiA 402: time from the command to switch on to the state switched on; 0.",
    ),
    ("Settings files: simulator.reset_edges", "CiA 402: rising edges that a fault reset takes; 1."),
    (
        "Settings files: simulator.falls_back",
        "CiA 402: how often the drive falls from ready-to-switch-on to switch-on-disabled on its way up; 0.",
    ),
    (
        "Settings files: simulator.dummy_mapping",
        "CiA 402: objects 0x0005 and 0x0007 may be mapped as placeholders; true.",
    ),
    ("Settings files: simulator.following_window_rad", "CiA 402: following error window; 0.3."),
    ("Settings files: simulator.following_timeout_ms", "CiA 402: following error time out; 50."),
    (
        "Settings files: simulator.soft_limit_margin_rad",
        "CiA 402: software position limits this far beyond the joint's; 0.02.",
    ),
    ("Settings files: simulator.slow_rad_s2", "CiA 402: slow-down ramp; the motion limit."),
    ("Settings files: simulator.quick_stop_rad_s2", "CiA 402: quick stop ramp; the stop limit."),
    (
        "Settings files: servo[].digital_inputs",
        "CiA 402: true: limit switches, home switch and interlock (0x60FD) are read, shown with the status, and a limit switch in motion stops the arm: see [faults.md](faults.md#digital-inputs-of-a-cia-402-drive); false.",
    ),
    (
        "Settings files: servo[].brake",
        "CiA 402: a brake that the streamer releases, for drives that do not work theirs by themselves: see [faults.md](faults.md#a-brake-that-the-streamer-releases).",
    ),
    ("Settings files: servo[].brake.output_bit", "Bit of 0x60FE:01 that works it; 0."),
    (
        "Settings files: servo[].brake.released_by",
        "Value of the bit that releases it, by the drive's manual.",
    ),
    (
        "Settings files: servo[].brake.release_ms",
        "Time from the drive's confirmation until it is released; the joint is not moved before.",
    ),
    (
        "Settings files: servo[].brake.close_ms",
        "Time from the drive's confirmation until it holds; the drive keeps its torque as long.",
    ),
    (
        "Settings files: servo[].torque",
        "CiA 402: torques that are sent to the drive, or read from it: see [feed-forward.md](feed-forward.md#cia-402-drives).",
    ),
    (
        "Settings files: servo[].torque.rated_torque_nm",
        "Rated torque of the motor, of which the drive's torques are thousandths; 0x6076 must say the same within 1 %.",
    ),
    (
        "Settings files: servo[].torque.offset",
        "true: setpoints carry the torque of `[feed_forward]` (0x60B2); false.",
    ),
    (
        "Settings files: servo[].torque.actual",
        "true: answers carry the torque that the drive measures (0x6077); false.",
    ),
    (
        "Settings files: servo[].profile_limits",
        "CiA 402: the drive's own limits of speed and acceleration (0x607F, 0x6080, 0x6083 to 0x6085, 0x60C5, 0x60C6); without it they are not looked at: see [faults.md](faults.md#limits-of-speed-and-acceleration).",
    ),
    (
        "Settings files: servo[].profile_limits.apply",
        "What is done about them before the drive is energised.",
    ),
    (
        "Settings files: servo[].profile_limits.velocity_unit",
        "Unit in which the drive takes speeds and, a second, accelerations, of its motor; that of `homing`. 0x6080 is always in rpm.",
    ),
    (
        "Settings files: simulator.limits_setpoints",
        "CiA 402: true: setpoints are cut off at the speed of 0x607F and 0x6080; false.",
    ),
];
