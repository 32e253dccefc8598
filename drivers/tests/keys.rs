//! docs/keys.md: every key of every file that a user writes, asked of the readers themselves.
//!
//! A reader names the keys that it knows when it meets one that it does not know, and says what a value must be when it
//! meets a wrong one. So the page is made by giving unknown keys and wrong values to the readers; only the sentence on a
//! key's meaning is written here. `TAUSTREAM_UPDATE_DOCS=1 cargo test -p taustream-drivers --test keys` writes the page.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    clippy::wildcard_enum_match_arm,
    reason = "helpers of a test fail by panicking"
)]
#[path = "keys/meanings.rs"]
mod meanings;
#[path = "keys/meanings_cia402.rs"]
mod meanings_cia402;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use taustream_arm::{Faults, PathFile, Robot, Scene, Settings};
use taustream_drivers::sim::settings::drives;
use toml::{Table, Value};

const UNKNOWN: &str = "zzz_unknown";

/// A kind of file, and samples that between them have every table that it may have.
struct Kind {
    title: &'static str,
    about: &'static str,
    samples: Vec<(PathBuf, String)>,
    load: fn(&Path, &str) -> Result<(), Faults>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn shipped(path: &str, edits: &[(&str, &str)]) -> (PathBuf, String) {
    let file = root().join(path);
    let mut text = fs::read_to_string(&file).unwrap();
    for (from, to) in edits {
        assert!(text.contains(from), "{path} has no {from}");
        text = text.replacen(from, to, 1);
    }
    (file, text)
}

fn settings(file: &Path, text: &str) -> Result<(), Faults> {
    let settings = Settings::from_toml(file, text)?;
    drives(&settings, None).map(drop)
}

fn kinds() -> Vec<Kind> {
    let pose = "[[pose]]\nname = \"home\"\nposition_rad = [0, 0, 0, 0, 0, 0]\n";
    let payload = "payload = { mass_kg = 1.0, center_m = [0.0, 0.0, 0.0] }\n";
    vec![
        Kind {
            title: "Robot files",
            about: "`config/robots`; [robots.md](robots.md) explains how to describe an arm.",
            samples: vec![
                shipped(
                    "config/robots/ur5.toml",
                    &[("name = ", &format!("{payload}name = ")), ("[[joint]]", &format!("{pose}[[joint]]"))],
                ),
                shipped("config/robots/piper.toml", &[]),
                shipped("config/robots/ur5-lift.toml", &[]),
                shipped("tests/robots/nasty.toml", &[]),
                shipped("tests/robots/two_arms.toml", &[]),
            ],
            load: |file, text| Robot::from_toml(file, text).map(drop),
        },
        Kind {
            title: "Scene files",
            about: "`config/scenes`: obstacles in the base's frame. Every table may stand any number of times.",
            samples: vec![scene()],
            load: |file, text| Scene::from_toml(file, text).map(drop),
        },
        Kind {
            title: "Settings files",
            about: "`config/settings`: one arm's robot, scene, buses and servos. Keys that affect motion have no default.",
            samples: vec![
                shipped("config/settings/vcan6.toml", &[]),
                shipped(
                    "config/settings/vcan6.toml",
                    &[
                        ("limp_is_safe = true\n\n[[servo]]", HOMING),
                        ("reaction = \"ramp\"", "reaction = \"hold\""),
                    ],
                ),
                shipped("config/settings/damiao6.toml", &[]),
                shipped("config/settings/robstride6.toml", &[]),
                shipped("config/settings/ak6.toml", &[]),
                shipped("config/settings/rmd6.toml", &[]),
                shipped("config/settings/one-bus.toml", &[]),
                shipped("config/settings/odrive6.toml", &[]),
                shipped("config/settings/piper.toml", &[]),
                shipped("config/settings/damiao6.toml", &[("[cycle]", FEED_FORWARD)]),
                shipped("config/settings/damiao6-gripper.toml", &[]),
                shipped("config/settings/damiao6-gripper.toml", AXIS_IN_RAD),
                shipped("config/settings/pair-left.toml", &[]),
            ],
            load: settings,
        },
        Kind {
            title: "Path files",
            about: "`config/paths`: points for `taustream import --path`.",
            samples: vec![shipped("config/paths/eight_points.toml", &[])],
            load: |file, text| PathFile::from_toml(file, text).map(drop),
        },
    ]
}

/// A section of torques, before `[cycle]`.
const FEED_FORWARD: &str = "[feed_forward]\ngravity = true\ninertia = true\nshare = 1.0\n[[feed_forward.joint]]\njoint = \"elbow\"\n\
    torque_nm_max = 20.0\nrate_nm_s_max = 50.0\n[cycle]";

/// Every key, and what it means.
fn meanings() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    meanings::MEANINGS.iter().chain(meanings_cia402::MEANINGS)
}

/// The homing of the first servo, its brake and its own limits, behind its other keys.
const HOMING: &str = "limp_is_safe = true\n[servo.homing]\nmethod = 18\nvelocity_unit = \"rpm\"\nswitch_speed_rad_s = 0.1\n\
    zero_speed_rad_s = 0.1\nacceleration_rad_s2 = 1.0\ntimeout_s = 5.0\ncollision_risk_acknowledged = true\n[servo.torque]\nrated_torque_nm = 1.3\noffset = true\n[servo.brake]\nreleased_by = 1\nrelease_ms = 50\nclose_ms = 50\n[servo.profile_limits]\napply = \"compare\"\nvelocity_unit = \"rpm\"\n\n[[servo]]";

/// The shipped axis in rad.
const AXIS_IN_RAD: &[(&str, &str)] = &[
    ("unit = \"m\"\nm_per_rad = 0.02", "unit = \"rad\""),
    ("position_m = [0.0, 0.08]", "position_rad = [0.0, 4.0]"),
    ("open_m = 0.08", "open_rad = 4.0"),
    ("closed_m = 0.0", "closed_rad = 0.0"),
    (
        "{ velocity_m_s = 0.05, acceleration_m_s2 = 0.5, jerk_m_s3 = 10.0 }",
        "{ velocity_rad_s = 2.5, acceleration_rad_s2 = 25.0, jerk_rad_s3 = 500.0 }",
    ),
    (
        "{ lag_m = 0.004, force_n_max = 40.0, time_ms = 20, squeeze_m = 0.003 }",
        "{ lag_rad = 0.2, torque_nm_max = 0.8, time_ms = 20, squeeze_rad = 0.15 }",
    ),
    ("tracking_error_m_max = 0.012", "tracking_error_rad_max = 0.6"),
];

/// A scene with every kind of obstacle, beside the mesh and the points that it names.
fn scene() -> (PathBuf, String) {
    let folder = std::env::temp_dir().join(format!("taustream-keys-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("tile.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(folder.join("scan.xyz"), "0 0 0\n").unwrap();
    (folder.join("scene.toml"), SCENE.to_owned())
}

const SCENE: &str = r#"
margin_m = 0.02
[[sphere]]
center_m = [1, 0, 0]
radius_m = 0.1
[[box]]
center_m = [1, 0, 0]
size_m = [0.1, 0.1, 0.1]
[[cylinder]]
center_m = [1, 0, 0]
radius_m = 0.1
length_m = 0.1
[[capsule]]
center_m = [1, 0, 0]
radius_m = 0.1
length_m = 0.1
[[mesh]]
center_m = [1, 0, 0]
file = "tile.obj"
[[cloud]]
center_m = [1, 0, 0]
file = "scan.xyz"
point_radius_m = 0.01
[[zone]]
center_m = [1, 0, 0]
size_m = [0.1, 0.1, 0.1]
speed_m_s = 0.1
"#;

/// A table of a file: its path with `[0]` for the first of a list, as faults name it.
fn tables(table: &Table, path: &str, found: &mut Vec<String>) {
    found.push(path.to_owned());
    for (key, value) in table {
        let below = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        match value {
            Value::Table(inner) => tables(inner, &below, found),
            Value::Array(items) => {
                if let Some(Value::Table(inner)) = items.first() {
                    tables(inner, &format!("{below}[0]"), found);
                }
            }
            _ => {}
        }
    }
}

fn at<'t>(table: &'t mut Table, path: &str) -> &'t mut Table {
    let mut here = table;
    for step in path.split('.').filter(|step| !step.is_empty()) {
        let (name, listed) = step.strip_suffix("[0]").map_or((step, false), |name| (name, true));
        let value = here.get_mut(name).unwrap();
        let value = if listed { value.as_array_mut().unwrap().first_mut().unwrap() } else { value };
        here = value.as_table_mut().unwrap();
    }
    here
}

/// `joint[0].motion` as people write it: `[[joint]]`, `motion`.
fn heading(path: &str) -> String {
    if path.is_empty() { "Top of the file".to_owned() } else { format!("`{}`", path.replace("[0]", "[]")) }
}

fn joined(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// What is known of one key.
#[derive(Default)]
struct Known {
    required: bool,
    expected: String,
}

fn faults(kind: &Kind, file: &Path, table: &Table) -> Vec<(String, String, String)> {
    let result = (kind.load)(file, &toml::to_string(table).unwrap());
    result
        .err()
        .map_or_else(Vec::new, |faults| faults.0.into_iter().map(|f| (f.key, f.value, f.expected)).collect())
}

/// Every key of every table of a kind of file.
fn keys_of(kind: &Kind) -> BTreeMap<(String, String), Known> {
    let mut keys: BTreeMap<(String, String), Known> = BTreeMap::new();
    for (file, text) in &kind.samples {
        let sample: Table = text.parse().unwrap();
        assert_eq!(faults(kind, file, &sample), [], "{} is a good sample", file.display());
        let mut paths = Vec::new();
        tables(&sample, "", &mut paths);
        for path in paths {
            let mut requested = sample.clone();
            at(&mut requested, &path).insert(UNKNOWN.to_owned(), Value::Integer(1));
            let said = faults(kind, file, &requested);
            let unknown = joined(&path, UNKNOWN);
            let list = said.iter().find(|(key, ..)| *key == unknown).map(|(.., expected)| expected.clone());
            let list =
                list.unwrap_or_else(|| panic!("{}: nothing said of {unknown}: {said:?}", file.display()));
            let names = list.rsplit_once("known here are ").or_else(|| list.rsplit_once("one of the keys "));
            for name in names.map_or(list.as_str(), |(_, names)| names).split(", ") {
                let known = keys.entry((path.clone(), name.to_owned())).or_default();
                examine(kind, (file, &sample), (&path, name), known);
            }
        }
    }
    keys
}

/// Asks the reader for a key: without it, and with a value that nothing takes.
fn examine(kind: &Kind, (file, sample): (&Path, &Table), (path, name): (&str, &str), known: &mut Known) {
    let full = joined(path, name);
    let mut without = sample.clone();
    let stood = at(&mut without, path).remove(name).is_some();
    let missing = |said: &[(String, String, String)]| said.iter().any(|(key, ..)| *key == full);
    known.required |= stood && missing(&faults(kind, file, &without));
    let mut wrong = sample.clone();
    at(&mut wrong, path).insert(name.to_owned(), Value::String("\u{1}".to_owned()));
    let said = faults(kind, file, &wrong);
    if let Some((.., expected)) = said.into_iter().find(|(key, ..)| key.starts_with(&full)) {
        // The plainest sentence of several samples: the others name joints and files of their sample, or tell that the
        // key has no place in it.
        let misplaced = |sentence: &str| sentence.is_empty() || sentence.starts_with("this key only");
        if misplaced(&known.expected) || (!misplaced(&expected) && expected.len() < known.expected.len()) {
            known.expected = expected;
        }
    }
}

fn page() -> String {
    let mut page = String::from(
        "# Every key of every file\n\n\
         With this page you can write robot, scene, settings and path files without reading an example. It is made from the readers\n\
         themselves (`drivers/tests/keys.rs`), so it is complete. An unknown key is an error, and so is a value out of range. Lengths are\n\
         m, angles rad, times s, ms or us as the key's name says.\n",
    );
    let mut used = BTreeSet::new();
    for kind in kinds() {
        write!(page, "\n## {}\n\n{}\n", kind.title, kind.about).unwrap();
        let mut current = None;
        for ((path, name), known) in keys_of(&kind) {
            if current.as_ref() != Some(&path) {
                write!(
                    page,
                    "\n### {}\n\n| key | needed | value | meaning |\n|---|---|---|---|\n",
                    heading(&path)
                )
                .unwrap();
                current = Some(path.clone());
            }
            let id = format!("{}: {}", kind.title, joined(&path, &name).replace("[0]", "[]"));
            let meaning = meanings().find(|(key, _)| *key == id).map_or("?", |(_, text)| *text);
            used.insert(id.clone());
            let needed = if known.required { "yes" } else { "" };
            let expected = known.expected.replace('|', "\\|");
            writeln!(page, "| `{name}` | {needed} | {expected} | {meaning} |").unwrap();
        }
    }
    let gone: Vec<&str> = meanings().map(|(key, _)| *key).filter(|key| !used.contains(*key)).collect();
    assert!(gone.is_empty(), "no reader knows these keys any more: {gone:#?}\n{page}");
    page
}

/// Goal: a new key cannot be added without its sentence, and the page cannot lag behind the readers.
#[test]
fn page_of_keys_is_what_the_readers_know() {
    let made = page();
    let file = root().join("docs/keys.md");
    if std::env::var_os("TAUSTREAM_UPDATE_DOCS").is_some() {
        fs::write(&file, &made).unwrap();
    }
    let lacking: Vec<&str> = made.lines().filter(|line| line.ends_with("| ? |")).collect();
    assert!(lacking.is_empty(), "keys without a sentence in keys/meanings.rs:\n{}", lacking.join("\n"));
    let written = fs::read_to_string(&file).unwrap_or_default();
    assert!(
        made == written,
        "docs/keys.md is behind; TAUSTREAM_UPDATE_DOCS=1 cargo test -p taustream-drivers --test keys writes it"
    );
}
