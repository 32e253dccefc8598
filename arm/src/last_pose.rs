//! The last pose of an arm on disk: what tells the revolution of a feedback that repeats itself, after everything was off.
//!
//! The file is hostile until checked: it is one line of JSON and one line with the SHA-256 of the first, so that a cut or
//! edited file is known as one. It speaks of each joint's servo by a digest of its binding, because an offset that was true for
//! another sign, gear, zero or drive means nothing; and it carries an [`Epoch`] that the drives' newest use must confirm.
use crate::Servo;
use crate::drive_epochs::{Epoch, Use};
use crate::sealed::{hex_digest, seal, unseal};
use crate::settings::Settings;
use crate::state_dir::{Directory, DiskFault, replace};
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

const VERSION: u32 = 2;

/// One joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LastJoint {
    /// Its name.
    pub name: String,
    /// [`binding_digest`] of its servo.
    pub binding: String,
    /// Its revolution was known.
    pub referenced: bool,
    /// Every drive was off and it was measured still, and none was energised since.
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
    /// Confirmed by the drives' newest use.
    pub epoch: Epoch,
    /// The arm's name.
    pub arm: String,
    /// Its joints, base to tip.
    pub joints: Vec<LastJoint>,
}

/// Why a record is not believed or cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StateError {
    /// There is simply none yet.
    #[error("there is none yet")]
    Missing,
    /// The disk.
    #[error("{}", .0.sentence("it"))]
    Disk(DiskFault),
    /// Its contents.
    #[error("{0}")]
    Contents(String),
    /// Its drives were used since.
    #[error("it is out of date: {}", since(.drive, .newest.as_ref()))]
    OutOfDate {
        /// The drive.
        drive: String,
        /// Its newest use; `None` when none is known.
        newest: Option<Use>,
    },
}

fn since(drive: &str, newest: Option<&Use>) -> String {
    match newest {
        Some(Use { arm, state_directory, .. }) => format!(
            "drive {drive} was used since as arm {arm:?} with the state directory {}; start with that one if it is another, or \
             reference the joints again",
            state_directory.display()
        ),
        None => format!("no use of drive {drive} is known on this computer; reference the joints again"),
    }
}

/// Why there is no last pose.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("last pose {}: {why}", path.display())]
pub struct LastPoseError {
    /// The file or directory.
    pub path: PathBuf,
    /// What is wrong with it.
    pub why: StateError,
}

/// What a turn depends on besides the reading: SHA-256 over everything that says how a servo's feedback becomes the joint's
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
    hex_digest(&text)
}

/// The state directory: what was asked for, else `$STATE_DIRECTORY` (systemd; the first of several), else
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
    pub fn new(arm: &str, epoch: Epoch, joints: Vec<LastJoint>) -> Self {
        Self { version: VERSION, epoch, arm: arm.to_owned(), joints }
    }

    /// The file's name for an arm.
    #[must_use]
    pub fn file_name(arm: &str) -> String {
        format!("{arm}.last-pose")
    }

    /// Reads the last pose of an arm from a state directory. Whether it is the newest is not checked here.
    ///
    /// # Errors
    /// When there is none, or none that can be read.
    pub fn load(directory: &mut dyn Directory, arm: &str) -> Result<Self, StateError> {
        let bytes = directory.read(&Self::file_name(arm)).map_err(StateError::Disk)?;
        let pose = Self::parse(&bytes.ok_or(StateError::Missing)?).map_err(StateError::Contents)?;
        if pose.arm != arm {
            return Err(StateError::Contents(format!("it is of arm {:?}", pose.arm)));
        }
        Ok(pose)
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let pose: Self = serde_json::from_str(unseal(bytes)?).map_err(|e| e.to_string())?;
        if pose.version != VERSION {
            return Err(format!("version {}, expected {VERSION}", pose.version));
        }
        if let Some(joint) = pose.joints.iter().find(|j| !(j.position_rad + j.offset_rad).is_finite()) {
            return Err(format!("joint {:?} has no finite position", joint.name));
        }
        Ok(pose)
    }

    /// The text of the file.
    #[must_use]
    pub fn text(&self) -> String {
        // A struct of names and numbers always has a JSON form.
        seal(&serde_json::to_string(self).unwrap_or_default())
    }

    /// Writes it whole or not at all, and returns when it is on the disk.
    ///
    /// # Errors
    /// When the directory does not take it.
    pub fn store(&self, directory: &mut dyn Directory) -> Result<(), DiskFault> {
        replace(directory, &Self::file_name(&self.arm), &self.text())
    }

    /// A joint of this name whose servo is bound as it was.
    #[must_use]
    pub fn joint(&self, name: &str, binding: &str) -> Option<&LastJoint> {
        self.joints.iter().find(|joint| joint.name == name && joint.binding == binding)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::state_dir::{Disk, Step, SystemDisk};
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};

    fn pose() -> LastPose {
        let joint = |name: &str, position_rad| LastJoint {
            name: name.into(),
            binding: "ab".into(),
            referenced: true,
            at_rest: true,
            position_rad,
            offset_rad: -6.25,
        };
        LastPose::new("arm", Epoch::random().unwrap(), vec![joint("pan", 0.1), joint("lift", -1.0 / 3.0)])
    }

    /// A directory of its own, gone after the test.
    struct Scratch(PathBuf);

    impl Scratch {
        fn new(name: &str) -> Self {
            Self(std::env::temp_dir().join(format!("taustream-last-pose-{name}-{}", std::process::id())))
        }
        fn store(&self, pose: &LastPose) -> Result<(), DiskFault> {
            pose.store(&mut *SystemDisk::default().open(&self.0, true)?)
        }
        fn load(&self, arm: &str) -> Result<LastPose, StateError> {
            let opened = SystemDisk::default().open(&self.0, false);
            LastPose::load(&mut *opened.map_err(StateError::Disk)?, arm)
        }
        fn file(&self) -> PathBuf {
            self.0.join(LastPose::file_name("arm"))
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _left_behind = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn last_pose_survives_the_disk_bit_by_bit() {
        let (scratch, pose) = (Scratch::new("disk"), pose());
        scratch.store(&pose).unwrap();
        scratch.store(&pose).unwrap();
        assert_eq!(scratch.load("arm"), Ok(pose));
        assert_eq!(fs::metadata(scratch.file()).unwrap().mode() & 0o777, 0o600);
        assert_eq!(scratch.load("leg"), Err(StateError::Missing));
        fs::rename(scratch.file(), scratch.0.join(LastPose::file_name("leg"))).unwrap();
        assert!(scratch.load("leg").unwrap_err().to_string().contains("of arm \"arm\""));
    }

    /// Every cut and every flipped bit of the file is noticed; nothing of it is believed, nothing panics.
    #[test]
    fn last_pose_cut_or_changed_anywhere_is_refused() {
        let pose = pose();
        let good = pose.text();
        for cut in 0..good.len() - 1 {
            assert!(LastPose::parse(&good.as_bytes()[..cut]).is_err(), "cut at {cut}");
        }
        for at in 0..good.len() {
            for bit in 0..8 {
                let mut bytes = good.clone().into_bytes();
                bytes[at] ^= 1 << bit;
                let read = LastPose::parse(&bytes);
                // Line ends may differ; what is read is then the same.
                assert!(read.is_err() || read == Ok(pose.clone()), "bit {bit} of byte {at}: {read:?}");
            }
        }
        assert_eq!(LastPose::parse(good.as_bytes()), Ok(pose));
    }

    #[test]
    fn last_pose_that_is_sealed_but_hostile_is_refused() {
        let good = pose().text();
        let good = good.lines().next().unwrap();
        let joints = good.find("\"joints\"").unwrap();
        let mut bodies: Vec<String> =
            ["", "null", "[]", "{}", "{\"version\":2}"].into_iter().map(str::to_owned).collect();
        bodies.push(good.replace("\"version\":2", "\"version\":1"));
        bodies.push(good.replace("\"arm\":\"arm\"", "\"arm\":\"arm\",\"x\":1"));
        bodies.push(good.replace("-6.25", "1e999"));
        bodies.push(good.replace("-6.25", "1e308").replace("0.1", "1e308"));
        bodies.push(format!("{}\"joints\":{}", &good[..joints], "[".repeat(100_000)));
        for body in bodies {
            assert!(LastPose::parse(seal(&body).as_bytes()).is_err(), "{body:.200}");
        }
        assert!(LastPose::parse(seal(good).as_bytes()).is_ok());
        assert!(LastPose::parse(b"\xFF\xFE\n\n").is_err());
    }

    #[test]
    fn last_pose_behind_a_link_a_pipe_or_open_to_others_is_refused() {
        let (scratch, pose) = (Scratch::new("odd"), pose());
        scratch.store(&pose).unwrap();
        let step = |scratch: &Scratch| match scratch.load("arm") {
            Err(StateError::Disk(fault)) => fault.step,
            other => panic!("{other:?}"),
        };
        let mode = |path: &Path, bits| fs::set_permissions(path, Permissions::from_mode(bits)).unwrap();
        for bits in [0o666, 0o620, 0o602] {
            mode(&scratch.file(), bits);
            assert_eq!(step(&scratch), Step::Mode);
        }
        mode(&scratch.file(), 0o600);
        for bits in [0o777, 0o1777, 0o770, 0o702] {
            mode(&scratch.0, bits);
            assert_eq!(step(&scratch), Step::Mode, "{bits:o}");
            assert_eq!(scratch.store(&pose).unwrap_err().step, Step::Mode, "{bits:o}");
        }
        mode(&scratch.0, 0o750);
        assert_eq!(scratch.load("arm"), Ok(pose.clone()));

        let elsewhere = scratch.0.join("elsewhere");
        fs::rename(scratch.file(), &elsewhere).unwrap();
        symlink(&elsewhere, scratch.file()).unwrap();
        assert_eq!(step(&scratch), Step::Read);
        // Where the new file is written, a link lies in wait: it is replaced, and what it points to stays.
        let target = scratch.0.join("target");
        fs::write(&target, "precious").unwrap();
        symlink(&target, scratch.0.join("arm.last-pose.new")).unwrap();
        scratch.store(&pose).unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "precious");
        assert_eq!(scratch.load("arm"), Ok(pose));
        fs::remove_file(scratch.file()).unwrap();
        fs::create_dir(scratch.file()).unwrap();
        assert_eq!(step(&scratch), Step::NotFile);
    }

    #[test]
    fn state_directory_that_is_a_link_a_file_or_somebody_elses_is_refused_with_the_remedy() {
        let scratch = Scratch::new("link");
        scratch.store(&pose()).unwrap();
        let open = |path: &Path| SystemDisk::default().open(path, true).err().map(|fault| fault.step);
        let link = scratch.0.join("link");
        symlink(&scratch.0, &link).unwrap();
        assert_eq!(open(&link), Some(Step::Link));
        // Making directories below a file fails before it is opened.
        assert_eq!(open(&scratch.file()), Some(Step::Directory));
        if rustix::process::geteuid().is_root() {
            let other = Scratch::new("other");
            fs::create_dir(&other.0).unwrap();
            std::os::unix::fs::chown(&other.0, Some(4_242), None).unwrap();
            assert_eq!(open(&other.0), Some(Step::Owner));
            let trusting = SystemDisk { services_user: Some(4_242) };
            assert!(trusting.open(&other.0, true).is_ok());
            pose().store(&mut *trusting.open(&other.0, true).unwrap()).unwrap();
            let made = fs::metadata(other.0.join(LastPose::file_name("arm"))).unwrap();
            assert_eq!(made.uid(), 4_242, "the services' user could not read it");
        }
        for step in [Step::Link, Step::Owner, Step::Mode, Step::Sync] {
            let fault = DiskFault { step, errno: 28 };
            assert_eq!(DiskFault::from_code(fault.code()), Some(fault));
            assert!(fault.sentence("/some/where").contains("/some/where"));
        }
        let full = DiskFault { step: Step::Write, errno: 28 }.sentence("/a");
        assert!(full.contains("No space left"), "{full}");
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
