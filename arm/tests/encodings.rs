//! Text files as other programs write them: with a byte order mark, with the line ends of Windows, in UTF-16.
#![expect(clippy::unwrap_used, reason = "helpers of tests; a failure in them fails the test")]
use std::fs;
use std::path::{Path, PathBuf};
use taustream_arm::{Faults, MotionTable, PathFile, Robot, Scene, Settings, TrajectoryFile, shipped};

const TRAJECTORY: &str = r#"{"version":1,"robot":"ur5","joints":6,"base_rad":[0,-1.57,1.57,-1.57,-1.57,0],"strokes":[
{"start_s":0,"duration_s":2.5,"n":10,"delta_rad":[0.5,0,0,0,0,0]}]}"#;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A folder that is removed when it goes.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("taustream-encodings-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _left_behind = fs::remove_dir_all(&self.0);
    }
}

type Load = fn(&Path) -> Result<(), Faults>;

fn load_table(file: &Path) -> Result<(), Faults> {
    MotionTable::load(file, &[]).map(drop)
}

/// Every kind of text file: where a good one is copied to, and its reader.
const KINDS: [(&str, Load); 11] = [
    ("robots/ur5.toml", |file| Robot::load(file).map(drop)),
    ("robots/nasty.toml", |file| Robot::load(file).map(drop)),
    ("robots/ur5_balls.toml", |file| Robot::load(file).map(drop)),
    ("scenes/pillars.toml", |file| Scene::load(file).map(drop)),
    ("scenes/bracket.toml", |file| Scene::load(file).map(drop)),
    ("settings/vcan6.toml", |file| Settings::load(file).map(drop)),
    ("settings/damiao6.toml", |file| Settings::load(file).map(drop)),
    ("paths/eight_points.toml", |file| PathFile::load(file).map(drop)),
    ("move.json", |file| TrajectoryFile::load(file).map(drop)),
    ("move.csv", load_table),
    ("demo.toml", |file| shipped::read_text(file).map(drop)),
];

/// Copies a tree; each text file is written by `write`.
fn copy(from: &Path, to: &Path, write: fn(&str) -> Vec<u8>) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let from = entry.unwrap().path();
        let to = to.join(from.file_name().unwrap());
        if from.is_dir() {
            copy(&from, &to, write);
        } else if let Ok(text) = String::from_utf8(fs::read(&from).unwrap()) {
            fs::write(to, write(&text)).unwrap();
        } else {
            fs::copy(from, to).unwrap();
        }
    }
}

fn folder_of_all(name: &str, write: fn(&str) -> Vec<u8>) -> Folder {
    let folder = Folder::new(name);
    copy(&workspace().join("config"), &folder.0, write);
    copy(&workspace().join("tests/robots"), &folder.0.join("robots"), write);
    fs::write(folder.0.join("move.json"), write(TRAJECTORY)).unwrap();
    fs::write(folder.0.join("move.csv"), write("t_s,q1_rad\n0,0\n1,0.5\n")).unwrap();
    folder
}

/// Goal: what an editor adds at the front changes nothing. Method: a copy of every shipped text file, and of URDF, SRDF and
/// mesh files, with a mark and with line ends of two characters.
#[test]
fn byte_order_mark_is_taken_in_every_kind_of_text_file() {
    let folder = folder_of_all("mark", |text| format!("\u{feff}{}", text.replace('\n', "\r\n")).into_bytes());
    for (name, load) in KINDS {
        load(&folder.0.join(name)).unwrap_or_else(|faults| panic!("{name}: {faults}"));
    }
    let demo = shipped::read_text(&folder.0.join("demo.toml")).unwrap();
    assert!(!demo.starts_with('\u{feff}'), "{demo}");
}

/// Goal: UTF-16 is named, in every kind of file.
#[test]
fn utf_16_is_refused_by_name_in_every_kind_of_text_file() {
    let folder = folder_of_all("utf-16", |text| {
        std::iter::once(0xFEFF_u16).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
    });
    for (name, load) in KINDS {
        let said = load(&folder.0.join(name)).unwrap_err().to_string();
        assert!(said.contains("UTF-16") && said.contains("UTF-8"), "{name}: {said}");
    }
}

/// Goal: a file that cannot be a configuration is not read into memory whole.
#[test]
fn enormous_text_is_refused_unread() {
    let folder = Folder::new("large");
    let file = folder.0.join("large.toml");
    fs::File::create(&file).unwrap().set_len(1 << 40).unwrap();
    let said = shipped::read_text(&file).unwrap_err().to_string();
    assert!(said.contains("too long"), "{said}");
}
