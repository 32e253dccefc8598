//! Every file in config/ loads, and says what its documents say.
use std::path::{Path, PathBuf};
use taustream_arm::{BusKind, Robot, Scene, Settings};

fn config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config")
}

fn files_of(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(config().join(folder)).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.sort();
    files
}

#[test]
fn shipped_file_of_every_kind_loads() {
    let (robots, scenes, settings) = (files_of("robots"), files_of("scenes"), files_of("settings"));
    for file in &robots {
        assert!(Robot::load(file).is_ok_and(|robot| robot.file == *file), "{:?}", Robot::load(file).err());
    }
    for file in scenes.iter().filter(|file| file.extension().is_some_and(|e| e == "toml")) {
        Scene::load(file).unwrap_or_else(|faults| panic!("{faults}"));
    }
    for file in &settings {
        Settings::load(file).unwrap_or_else(|faults| panic!("{faults}"));
    }
    // An empty folder would make this pass without a look at anything.
    assert!(
        !robots.is_empty() && scenes.len() >= 3 && !settings.is_empty(),
        "{robots:?} {scenes:?} {settings:?}"
    );
}

#[test]
fn ur5_contact_rule_lets_neighbours_and_short_wrist_links_touch() {
    let robot = Robot::load(&config().join("robots/ur5.toml")).unwrap();
    let mut expected: Vec<(usize, usize)> = (0..6).map(|link| (link, link + 1)).collect();
    expected.extend([(3, 5), (4, 6)]);
    expected.sort_unstable();
    assert_eq!(robot.allowed_by_rule, expected);
    assert!(
        robot.may_touch(5, 3) && robot.may_touch(3, 5) && !robot.may_touch(3, 6) && !robot.may_touch(6, 3)
    );
}

#[test]
fn vcan6_binds_six_servos_in_joint_order_to_one_virtual_bus() {
    let settings = Settings::load(&config().join("settings/vcan6.toml")).unwrap();
    assert_eq!(settings.servos.len(), 6);
    for (i, servo) in settings.servos.iter().enumerate() {
        assert_eq!((servo.joint, servo.bus, usize::from(servo.node_id)), (i, 0, i + 1));
    }
    assert_eq!(settings.buses[0].kind, BusKind::Virtual);
    assert_eq!((settings.buses[0].interface.as_str(), settings.cycle.period_us), ("vcan0", 1000));
    assert_eq!(settings.robot.name, "ur5");
}
