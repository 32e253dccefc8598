//! A made-up arm of two: fourteen joints in a row and two grippers, all Damiao motors, on as many buses as requested.
use std::fmt::Write as _;
use std::path::Path;
use taustream_arm::Settings;

/// Joints of the path, and grippers beside it.
pub(crate) const JOINTS: usize = 14;
/// Grippers, in the slots behind the joints.
pub(crate) const GRIPPERS: usize = 2;

/// The robot file: no shapes, since nothing is planned for it.
fn robot() -> String {
    let links: Vec<String> = (1..=JOINTS).map(|joint| format!("\"link{joint}\"")).collect();
    let mut text = format!("name = \"bimanual\"\nunmodelled_links = [{}]\n", links.join(", "));
    for joint in 1..=JOINTS {
        let alpha_rad = if joint % 2 == 0 { 1.5 } else { -1.5 };
        write!(
            text,
            "[[joint]]\nname = \"joint{joint}\"\n\
             dh = {{ a_m = 0.05, alpha_rad = {alpha_rad}, d_m = 0.2, theta_offset_rad = 0.0 }}\n\
             link_radius_m = 0.0\nposition_rad = [-3.0, 3.0]\n\
             motion = {{ velocity_rad_s = 3.0, acceleration_rad_s2 = 15.0, jerk_rad_s3 = 150.0 }}\n\
             stop = {{ acceleration_rad_s2 = 30.0, jerk_rad_s3 = 600.0 }}\n"
        )
        .unwrap();
    }
    text
}

/// A servo of the slot `slot`, the slots being spread evenly over the buses.
fn servo(slot: usize, buses: usize) -> String {
    let per_bus = (JOINTS + GRIPPERS).div_ceil(buses);
    let (bus, node_id) = (slot / per_bus, slot % per_bus + 1);
    let output = match slot.checked_sub(JOINTS) {
        None => format!("joint = \"joint{}\"", slot + 1),
        Some(gripper) => format!("axis = \"gripper{}\"", gripper + 1),
    };
    let (stiffness, damping) = if slot < JOINTS { (60.0, 1.5) } else { (8.0, 0.3) };
    format!(
        "[[servo]]\n{output}\nbus = \"bus{bus}\"\nnode_id = {node_id}\nprotocol = \"damiao\"\nsign = 1\n\
         zero_offset_rad = 0.0\nfeedback = \"multi-turn\"\nfeedback_range_rad = [-12.5, 12.5]\nreaction = \"limp\"\n\
         limp_is_safe = true\nfeedback_id = {}\nmode = \"mit\"\nposition_range_rad = 12.5\nvelocity_range_rad_s = 30.0\n\
         torque_range_nm = 10.0\nwatchdog_ms = 100\nstiffness_nm_rad = {stiffness:?}\ndamping_nm_s_rad = {damping:?}\n\
         gain_ramp_ms = 200\n",
        0x10 + node_id
    )
}

/// The settings file but for its robot.
fn text(robot: &str, buses: usize) -> String {
    let mut text = format!("name = \"bimanual\"\nrobot = {robot:?}\nscene = \"../scenes/open.toml\"\n");
    text += "[cycle]\nperiod_us = 1000\ntolerated_gap_periods = 2\nstall_resume_ms = 20\ndrive_watchdog_ms = 100\npriority = 80\n\
             report_rate_hz = 100.0\n\
             [supervision]\nfeedback_age_s_max = 0.05\ntracking_error_rad_max = 0.2\nposition_jump_rad_max = 0.05\n\
             lost_cycles_max = 3\ndrive_timeout_s = 5.0\nbase_tolerance_rad = 5e-7\nfirst_speed_percent = 100.0\n";
    for bus in 0..buses {
        write!(text, "[[bus]]\nname = \"bus{bus}\"\ninterface = \"vcan{bus}\"\nvirtual = true\n").unwrap();
    }
    for gripper in 1..=GRIPPERS {
        write!(
            text,
            "[[axis]]\nname = \"gripper{gripper}\"\nunit = \"rad\"\nposition_rad = [0.0, 4.0]\nopen_rad = 4.0\nclosed_rad = 0.0\n\
             motion = {{ velocity_rad_s = 2.5, acceleration_rad_s2 = 25.0, jerk_rad_s3 = 500.0 }}\n\
             contact = {{ lag_rad = 0.2, torque_nm_max = 2.0, time_ms = 20, squeeze_rad = 0.15 }}\n\
             tracking_error_rad_max = 0.6\non_fault = \"hold\"\ncovered_by = \"nothing\"\n"
        )
        .unwrap();
    }
    (0..JOINTS + GRIPPERS).for_each(|slot| text += &servo(slot, buses));
    let mut start = vec!["0.0"; JOINTS];
    start.extend(["2.0"; GRIPPERS]);
    let start = start.join(", ");
    write!(
        text,
        "[simulator]\nstart_rad = [{start}]\ninertia_kg_m2 = 0.02\nviscous_nm_s_rad = 0.1\ncoulomb_nm = 0.05\ngravity_nm = 0.2\n\
         torque_nm_max = 10.0\nbrake = true\n"
    )
    .unwrap();
    text
}

/// The arm on so many buses.
pub(crate) fn settings(buses: usize) -> Settings {
    static MADE: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
    let number = MADE.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let robot_file =
        std::env::temp_dir().join(format!("taustream-bimanual-{}-{number}.toml", std::process::id()));
    std::fs::write(&robot_file, robot()).unwrap();
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/bimanual.toml");
    let read = Settings::from_toml(&place, &text(robot_file.to_str().unwrap(), buses));
    std::fs::remove_file(robot_file).unwrap();
    read.unwrap_or_else(|faults| panic!("{faults}"))
}
