//! Bad frames, bad fault requests, bad settings.
use super::bench::{Bench, NODE, enabled, parameters};
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_oneof, proptest};
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::sim::settings::{drives, masses, queue_frames};
use taustream_drivers::sim::{DriveParameters, FaultRequest, ServoSimulator, SimulatorCommand};
use taustream_drivers::{CanFrame, CanId, Nanos};
use taustream_motion::MAX_JOINTS;

fn joints() -> Vec<String> {
    ["base", "elbow", "wrist"].map(str::to_owned).to_vec()
}

/// Frames that are more likely than chance to mean something to the drive.
fn frames() -> impl Strategy<Value = (u32, Vec<u8>, bool, u64)> {
    let node = u32::from(NODE);
    let id = prop_oneof![
        Just(0x000),
        Just(0x080),
        Just(0x203),
        Just(0x303),
        Just(0x600 + node),
        Just(0x77F),
        any::<u32>(),
    ];
    let data = prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..9),
        // SDO writes to objects that exist.
        (0x14_u8..0x62, any::<[u8; 6]>()).prop_map(|(high, rest)| {
            let mut bytes = vec![0x23, rest[0] & 0x9F, high, rest[1] & 7];
            bytes.extend(&rest[2..]);
            bytes
        }),
        (0_u8..3).prop_map(|command| vec![[1, 0x80, 0x81][usize::from(command)], 0]),
        (0_u16..0x200, any::<i32>()).prop_map(|(word, target)| {
            let mut bytes = word.to_le_bytes().to_vec();
            bytes.extend(target.to_le_bytes());
            bytes
        }),
    ];
    (id, data, any::<bool>(), 0_u64..20_000)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    /// Goal: no frame can make a drive panic, or its motion anything but a motion.
    #[test]
    fn random_frames_never_upset_a_drive(
        ready in any::<bool>(),
        frames in proptest::collection::vec(frames(), 1..200),
    ) {
        let mut bench = if ready { enabled(parameters()) } else { Bench::new(parameters()) };
        for (id, data, fd, pause_us) in frames {
            bench.now_us += pause_us;
            let id = CanId::from_raw(id);
            let frame = if fd && data.len() > 6 { CanFrame::fd(id, &data) } else { CanFrame::classic(id, &data) };
            let now = bench.now();
            bench.drive.receive(now, &frame, &mut bench.sent);
            proptest::prop_assert!(bench.drive.position_rad().is_finite());
            // The motor's limit, and what gravity adds in a fall of half a turn: sqrt(2 * 2 * 20 / 1) rad/s.
            proptest::prop_assert!(bench.drive.velocity_rad_s().abs() < 10.0);
            proptest::prop_assert!(bench.sent.iter().all(|frame| frame.data().len() <= 8));
            bench.sent.clear();
        }
    }

    #[test]
    fn random_fault_requests_never_panic(text in "(fault |clear )?[a-z_=,0-9.x-]{0,60}") {
        let _understood = SimulatorCommand::parse(&text, &joints());
        let _understood = FaultRequest::parse(&text, &joints());
    }
}

#[test]
fn bad_fault_requests_get_a_message_that_names_the_offender() {
    for (text, words) in [
        ("", "no part of a fault"),
        ("joint=1", "kind is missing"),
        ("kind=stuck", "joint is missing"),
        (
            "joint=4,kind=stuck",
            "joint=4 is no joint of this arm: expected 1 to 3 or one of base, elbow, wrist",
        ),
        ("joint=0,kind=stuck", "joint=0 is no joint"),
        ("joint=knee,kind=stuck", "joint=knee is no joint"),
        ("joint=1,kind=explode", "kind=explode is unknown"),
        ("joint=1,kind=stuck,joint=2", "joint appears twice"),
        ("joint=1,kind=stuck,color=red", "\"color=red\" is no part"),
        ("joint=1,kind=stuck,at_s=-1", "at_s=-1: expected seconds"),
        ("joint=1,kind=stuck,at_s=NaN", "at_s=NaN: expected seconds"),
        ("joint=1,kind=stuck,for_s=inf", "for_s=inf: expected seconds"),
        ("joint=1,kind=stuck,after=never", "after=never is unknown"),
        ("joint=1,kind=stuck,value=1", "no value for this kind"),
        ("joint=1,kind=drop,value=1.5", "a probability"),
        ("joint=1,kind=delay,value=-3", "milliseconds"),
        ("joint=1,kind=fault,value=0x12345", "an EMCY code"),
        ("joint=1,kind=fault,value=0", "an EMCY code"),
    ] {
        let error = FaultRequest::parse(text, &joints()).expect_err(text).to_string();
        assert!(error.contains(words), "{text}: {error}");
    }
    for line in ["explode", "clear all", "clear joint=9", "status now", "fault"] {
        assert!(SimulatorCommand::parse(line, &joints()).is_err(), "{line}");
    }
    assert_eq!(
        SimulatorCommand::parse(" clear joint=elbow\n", &joints()),
        Ok(SimulatorCommand::Clear(Some(1)))
    );
}

/// The shipped settings with another [simulator] section.
fn settings_with(section: &str) -> Settings {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
    let mut settings = Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"));
    settings.simulator = Some(toml::from_str(section).unwrap());
    settings
}

#[test]
fn every_fault_of_the_simulator_section_is_reported_at_once() {
    let settings = settings_with(
        "inertia_kg_m2 = 0\ngravity_nm = [1, 2]\nbrake = \"yes\"\nwatchdog_ms = 1.5\n\
         watchdog_reaction = \"limp\"\ncolour = 3\ncoulomb_nm = [1, 1, -1, 1, nan, 1]\nstep_us = 5000",
    );
    let text = drives(&settings, None).unwrap_err().to_string();
    for words in [
        "simulator.inertia_kg_m2 = 0",
        "simulator.gravity_nm = a list of 2",
        "simulator.brake = \"yes\"",
        "simulator.watchdog_ms = 1.5",
        // The servo's `reaction` is the one truth.
        "simulator.watchdog_reaction = \"limp\"",
        "simulator.colour = 3",
        "simulator.coulomb_nm[2] = -1",
        "simulator.coulomb_nm[4] = nan",
        "simulator.step_us = 5000",
    ] {
        assert_eq!(text.matches(words).count(), 1, "{words} in:\n{text}");
    }
    assert_eq!(text.lines().count(), 9, "{text}");
}

#[test]
fn keys_of_modelled_buses_are_checked_too() {
    for (section, words) in [
        ("bus_queue_frames = 0", "simulator.bus_queue_frames = 0: expected a whole number from 1 to 4096"),
        ("bus_queue_frames = 5000", "simulator.bus_queue_frames = 5000"),
        ("bus_queue_frames = \"many\"", "simulator.bus_queue_frames = \"many\""),
    ] {
        let text = queue_frames(&settings_with(section)).unwrap_err().to_string();
        assert!(text.contains(words), "{section}: {text}");
    }
    assert_eq!(queue_frames(&settings_with("")), Ok(64));
    let text = drives(&settings_with("dummy_mapping = 3"), None).unwrap_err().to_string();
    assert!(text.contains("simulator.dummy_mapping = 3: expected true or false"), "{text}");
}

#[test]
fn weight_of_masses_stands_instead_of_pendulums_and_needs_masses() {
    let both = settings_with("gravity_of_masses = true\ngravity_nm = 3.0");
    let text = drives(&both, None).unwrap_err().to_string();
    assert!(
        text.contains("simulator.gravity_nm = 3.0: expected one of gravity_nm and gravity_of_masses"),
        "{text}"
    );
    let mut massless = settings_with("gravity_of_masses = true");
    massless.robot.masses.clear();
    let text = masses(&massless).unwrap_err().to_string();
    assert!(
        text.contains("simulator.gravity_of_masses = true: expected false: robot ur5 states no masses"),
        "{text}"
    );
    let text = drives(&settings_with("gravity_of_masses = 1"), None).unwrap_err().to_string();
    assert!(text.contains("simulator.gravity_of_masses = 1: expected true or false"), "{text}");
    assert_eq!(masses(&settings_with("")), Ok(None));
    assert_eq!(
        masses(&settings_with("gravity_of_masses = true")),
        Ok(settings_with("").robot.dynamics().ok())
    );
}

/// Goal: a limp arm falls as its masses pull, joints behind others included, and not as pendulums.
#[test]
fn limp_arm_that_feels_its_masses_falls_by_their_weight() {
    let settings =
        settings_with("gravity_of_masses = true\ncoulomb_nm = 0.0\nviscous_nm_s_rad = 0.0\nbrake = false");
    let start_rad = [0.0, -0.7, 0.9, -0.4, 0.3, 0.0];
    let setups = drives(&settings, Some(&start_rad)).unwrap_or_else(|faults| panic!("{faults}"));
    let inertia_kg_m2: Vec<f64> = setups
        .iter()
        .map(|setup| setup.parameters.get::<DriveParameters>().unwrap().plant.inertia_kg_m2)
        .collect();
    let dynamics = masses(&settings).unwrap().unwrap();
    let mut pose_rad = [0.0; MAX_JOINTS];
    pose_rad[..6].copy_from_slice(&start_rad);
    let holding_nm = dynamics.holding_nm(&pose_rad);
    let mut simulator = ServoSimulator::new(setups, 1, 1).with_masses(dynamics).unwrap();
    let mut out = vec![Vec::new()];
    for ms in 0..=10_u64 {
        simulator.advance(Nanos(1_000_000_000 + ms * 1_000_000), &mut out);
    }
    for joint in 0..6 {
        let fell_rad = simulator.drive(joint).unwrap().position_rad() - start_rad[joint];
        // a t^2 / 2 over 10 ms.
        let expected_rad = -holding_nm[joint] / inertia_kg_m2[joint] * 0.5e-4;
        assert!(
            (fell_rad - expected_rad).abs() < 0.05 * expected_rad.abs() + 1e-9,
            "{joint}: {fell_rad}, {expected_rad}"
        );
    }
}

#[test]
fn empty_section_gives_motors_that_suffice_for_the_stop_limits() {
    let settings = settings_with("");
    let setups = drives(&settings, None).unwrap_or_else(|faults| panic!("{faults}"));
    assert_eq!(setups.len(), 6);
    for (setup, joint) in setups.iter().zip(&settings.robot.joints) {
        let drive = setup.parameters.get::<DriveParameters>().unwrap();
        let plant = drive.plant;
        let needed_nm = plant.inertia_kg_m2 * joint.limits.stop.acceleration_rad_s2 + plant.gravity_nm.abs();
        assert!(plant.torque_nm_max > needed_nm, "{}", setup.joint);
        assert!(plant.speed_rad_s_max > joint.limits.motion.velocity_rad_s, "{}", setup.joint);
        assert_eq!(u32::from(drive.watchdog_ms), settings.cycle.drive_watchdog_ms);
    }
}
