//! The last pose of an arm on disk: it resolves the multi-turn offset of a feedback that wraps, after everything was off.
//!
//! The file is hostile until checked: it is one line of JSON and one line with the SHA-256 of the first, so that a cut or
//! edited file is known as one. It speaks of each joint's servo by a digest of its binding, because an offset that was true for
//! another sign, gear, zero or drive means nothing.
use crate::Servo;
use crate::settings::Settings;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::ffi::OsString;
use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Largest file that is read: eight joints need a few hundred bytes each.
const BYTES_MAX: u64 = 64 * 1024;
const VERSION: u32 = 1;

/// One joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LastJoint {
    /// Its name.
    pub name: String,
    /// [`binding_digest`] of its servo.
    pub binding: String,
    /// It was referenced.
    pub referenced: bool,
    /// It rested, and nothing could have moved it since but hands.
    pub at_rest: bool,
    /// Where it stood.
    pub position_rad: f64,
    /// What was added to its feedback.
    pub offset_rad: f64,
}

/// The last pose of an arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LastPose {
    version: u32,
    /// The arm's name.
    pub arm: String,
    /// Its joints, base to tip.
    pub joints: Vec<LastJoint>,
}

/// Why there is no last pose.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("last pose {}: {why}", path.display())]
pub struct LastPoseError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub why: String,
    /// There is simply none yet.
    pub missing: bool,
}

/// What an offset depends on besides the reading: SHA-256 over everything that says how a servo's feedback becomes the joint's
/// angle. The robot digest leaves it out (ADR 2).
#[must_use]
pub fn binding_digest(settings: &Settings, servo: &Servo) -> String {
    let bus = settings.buses.get(servo.bus).map_or("", |bus| bus.name.as_str());
    // Rust writes an f64 with as many digits as tell it from every other.
    let text = format!(
        "{bus}\n{}\n{:?}\n{:?}\n{:?}\n{:?}\n{:?}",
        servo.node_id,
        servo.protocol,
        servo.sign,
        servo.zero_offset_rad,
        servo.feedback,
        servo.feedback_range_rad
    );
    hex(&text)
}

fn hex(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The state directory: what was requested, else `$STATE_DIRECTORY` (systemd; the first of several), else
/// `$XDG_STATE_HOME/taustream`, else `~/.local/state/taustream`, else `/var/lib/taustream`.
#[must_use]
pub fn directory(requested: Option<&Path>) -> PathBuf {
    choose(requested, |name| std::env::var_os(name).filter(|value| !value.is_empty()))
}

fn choose(requested: Option<&Path>, variable: impl Fn(&str) -> Option<OsString>) -> PathBuf {
    if let Some(path) = requested {
        return path.to_owned();
    }
    if let Some(list) = variable("STATE_DIRECTORY") {
        // systemd separates several by colons.
        let first = list.to_string_lossy().split(':').next().unwrap_or_default().to_owned();
        return PathBuf::from(first);
    }
    let base = variable("XDG_STATE_HOME").map(PathBuf::from);
    let base = base.or_else(|| variable("HOME").map(|home| Path::new(&home).join(".local/state")));
    base.map_or_else(|| PathBuf::from("/var/lib/taustream"), |base| base.join("taustream"))
}

impl LastPose {
    /// A last pose.
    #[must_use]
    pub fn new(arm: &str, joints: Vec<LastJoint>) -> Self {
        Self { version: VERSION, arm: arm.to_owned(), joints }
    }

    /// The file of an arm.
    #[must_use]
    pub fn file(directory: &Path, arm: &str) -> PathBuf {
        directory.join(format!("{arm}.last-pose"))
    }

    /// Reads the last pose of an arm.
    ///
    /// # Errors
    /// When there is none, or none that can be believed.
    pub fn load(directory: &Path, arm: &str) -> Result<Self, LastPoseError> {
        let path = Self::file(directory, arm);
        let refused = |why: String, missing| LastPoseError { path: path.clone(), why, missing };
        let text = read(&path).map_err(|e| {
            let missing = e.kind() == std::io::ErrorKind::NotFound;
            refused(if missing { "there is none yet".to_owned() } else { e.to_string() }, missing)
        })?;
        let pose = Self::parse(&text).map_err(|why| refused(why, false))?;
        if pose.arm != arm {
            return Err(refused(format!("it is of arm {:?}", pose.arm), false));
        }
        Ok(pose)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines();
        let (Some(body), Some(sum), None) = (lines.next(), lines.next(), lines.next()) else {
            return Err("it is cut off: expected two lines".to_owned());
        };
        if sum.strip_prefix("sha256 ") != Some(hex(body).as_str()) {
            return Err("its sum does not fit: it was cut off or edited".to_owned());
        }
        let pose: Self = serde_json::from_str(body).map_err(|e| e.to_string())?;
        if pose.version != VERSION {
            return Err(format!("version {}, expected {VERSION}", pose.version));
        }
        if let Some(joint) = pose.joints.iter().find(|j| !(j.position_rad + j.offset_rad).is_finite()) {
            return Err(format!("joint {:?} stands nowhere", joint.name));
        }
        Ok(pose)
    }

    /// The text of the file.
    #[must_use]
    pub fn text(&self) -> String {
        // A struct of names and numbers always has a JSON form.
        let body = serde_json::to_string(self).unwrap_or_default();
        let sum = hex(&body);
        format!("{body}\nsha256 {sum}\n")
    }

    /// Writes it whole or not at all: beside the old one, synced, and then in its place.
    ///
    /// # Errors
    /// When the directory does not take it.
    pub fn store(&self, directory: &Path) -> std::io::Result<()> {
        DirBuilder::new().recursive(true).mode(0o700).create(directory)?;
        let path = Self::file(directory, &self.arm);
        let beside = path.with_extension("last-pose.new");
        let mut options = OpenOptions::new();
        let mut file = options.write(true).create(true).truncate(true).mode(0o600).open(&beside)?;
        file.write_all(self.text().as_bytes())?;
        file.sync_all()?;
        fs::rename(&beside, &path)?;
        File::open(directory)?.sync_all()
    }

    /// A joint of this name whose servo is bound as it was.
    #[must_use]
    pub fn joint(&self, name: &str, binding: &str) -> Option<&LastJoint> {
        self.joints.iter().find(|joint| joint.name == name && joint.binding == binding)
    }
}

/// Reads a file of our own that is a file: a pipe would block, and another user's file is not trusted.
fn read(path: &Path) -> std::io::Result<String> {
    let refused = |why: &str| std::io::Error::other(why.to_owned());
    let metadata = fs::symlink_metadata(path)?;
    if !metadata.is_file() {
        return Err(refused("it is no regular file"));
    }
    if metadata.uid() != rustix::process::geteuid().as_raw() || metadata.mode() & 0o022 != 0 {
        return Err(refused("others could have written it (owner or mode)"));
    }
    let mut text = String::new();
    File::open(path)?.take(BYTES_MAX).read_to_string(&mut text)?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> LastPose {
        let joint = |name: &str, position_rad| LastJoint {
            name: name.into(),
            binding: "ab".into(),
            referenced: true,
            at_rest: true,
            position_rad,
            offset_rad: -6.25,
        };
        LastPose::new("arm", vec![joint("pan", 0.1), joint("lift", -1.0 / 3.0)])
    }

    #[test]
    fn last_pose_survives_the_disk_bit_by_bit() {
        let scratch = std::env::temp_dir().join(format!("taustream-last-pose-{}", std::process::id()));
        pose().store(&scratch).unwrap();
        assert_eq!(LastPose::load(&scratch, "arm"), Ok(pose()));
        let mode = fs::metadata(LastPose::file(&scratch, "arm")).unwrap().mode();
        assert_eq!(mode & 0o777, 0o600);
        assert!(LastPose::load(&scratch, "leg").unwrap_err().missing);
        fs::rename(LastPose::file(&scratch, "arm"), LastPose::file(&scratch, "leg")).unwrap();
        assert!(LastPose::load(&scratch, "leg").unwrap_err().why.contains("of arm \"arm\""));
        fs::remove_dir_all(&scratch).unwrap();
    }

    /// Every cut and every flipped bit of the file is noticed; nothing of it is believed, nothing panics.
    #[test]
    fn last_pose_cut_or_changed_anywhere_is_refused() {
        let good = pose().text();
        for cut in 0..good.len() - 1 {
            assert!(LastPose::parse(&good[..cut]).is_err(), "cut at {cut}");
        }
        for at in 0..good.len() {
            for bit in 0..7 {
                let mut bytes = good.clone().into_bytes();
                bytes[at] ^= 1 << bit;
                let text = String::from_utf8(bytes).unwrap();
                let read = LastPose::parse(&text);
                // Line ends may differ; what is read is then the same.
                assert!(read.is_err() || read == Ok(pose()), "bit {bit} of byte {at}: {read:?}");
            }
        }
        assert_eq!(LastPose::parse(&good), Ok(pose()));
    }

    #[test]
    fn last_pose_that_is_signed_but_hostile_is_refused() {
        let signed = |body: &str| format!("{body}\nsha256 {}\n", hex(body));
        for body in [
            "",
            "null",
            "[]",
            "{}",
            "{\"version\":1}",
            "{\"version\":2,\"arm\":\"arm\",\"joints\":[]}",
            "{\"version\":1,\"arm\":\"arm\",\"joints\":[],\"x\":1}",
            "{\"version\":1,\"arm\":\"arm\",\"joints\":[{\"name\":\"pan\",\"binding\":\"\",\"referenced\":true,\"at_rest\":true,\"position_rad\":1e999,\"offset_rad\":0}]}",
            "{\"version\":1,\"arm\":\"arm\",\"joints\":[{\"name\":\"pan\",\"binding\":\"\",\"referenced\":true,\"at_rest\":true,\"position_rad\":1e308,\"offset_rad\":1e308}]}",
        ] {
            assert!(LastPose::parse(&signed(body)).is_err(), "{body}");
        }
        let deep = "[".repeat(100_000);
        assert!(LastPose::parse(&signed(&deep)).is_err());
    }

    #[test]
    fn last_pose_behind_a_link_a_pipe_or_open_to_others_is_refused() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let scratch = std::env::temp_dir().join(format!("taustream-last-pose-odd-{}", std::process::id()));
        pose().store(&scratch).unwrap();
        let file = LastPose::file(&scratch, "arm");
        fs::set_permissions(&file, fs::Permissions::from_mode(0o666)).unwrap();
        assert!(LastPose::load(&scratch, "arm").unwrap_err().why.contains("others"));
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        let elsewhere = scratch.join("elsewhere");
        fs::rename(&file, &elsewhere).unwrap();
        symlink(&elsewhere, &file).unwrap();
        assert!(LastPose::load(&scratch, "arm").unwrap_err().why.contains("no regular file"));
        fs::remove_dir_all(&scratch).unwrap();
    }

    #[test]
    fn state_directory_is_the_asked_then_systemds_then_the_users() {
        let with = |pairs: &'static [(&str, &str)]| {
            move |name: &str| {
                pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| OsString::from(value))
            }
        };
        let all = [("STATE_DIRECTORY", "/s:/t"), ("XDG_STATE_HOME", "/x"), ("HOME", "/h")];
        let all: &'static [(&str, &str)] = Box::leak(Box::new(all));
        assert_eq!(choose(Some(Path::new("/a")), with(all)), Path::new("/a"));
        assert_eq!(choose(None, with(all)), Path::new("/s"));
        assert_eq!(choose(None, with(&all[1..])), Path::new("/x/taustream"));
        assert_eq!(choose(None, with(&all[2..])), Path::new("/h/.local/state/taustream"));
        assert_eq!(choose(None, with(&[])), Path::new("/var/lib/taustream"));
    }
}
