//! Which record of the last pose is the newest one of each drive, wherever that record lies.
//!
//! A record of the last pose lies in a state directory, and whoever starts a streamer chooses that. So before drives are
//! energised, a fresh random number, the *epoch*, is noted for each of them in one file at a place that nobody chooses, and
//! the record carries the same number. A record whose epoch is not the newest of each of its drives is out of date:
//! the drives were used since by a streamer that wrote elsewhere.
use crate::last_pose::{LastPoseError, StateError};
use crate::sealed::{seal, unseal};
use crate::settings::Settings;
use crate::state_dir::{DiskFault, Step};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The file's name in its directory.
pub const FILE: &str = "drives.epochs";
/// The name of the lock that orders its writers.
pub const LOCK: &str = "drives.lock";
/// Below here the installed services keep state.
const SYSTEM: &str = "/var/lib/taustream";
const VERSION: u32 = 1;

/// A random number that no other record carries.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Epoch(String);

impl Epoch {
    /// A fresh one.
    ///
    /// # Errors
    /// When the kernel has no random numbers.
    pub fn random() -> Result<Self, DiskFault> {
        let mut bytes = [0_u8; 16];
        let filled = fs::File::open("/dev/urandom").and_then(|mut source| source.read_exact(&mut bytes));
        filled.map_err(|e| DiskFault::new(Step::Random, &e))?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }
}

/// The newest use of one drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Use {
    /// The epoch that its record carries.
    pub epoch: Epoch,
    /// The arm that it was used as.
    pub arm: String,
    /// Where that arm's record lies.
    pub state_directory: PathBuf,
}

/// The newest use of every drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveEpochs {
    version: u32,
    drives: BTreeMap<String, Use>,
}

impl Default for DriveEpochs {
    fn default() -> Self {
        Self { version: VERSION, drives: BTreeMap::new() }
    }
}

impl DriveEpochs {
    /// Reads the bytes of the file.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let epochs: Self = serde_json::from_str(unseal(bytes)?).map_err(|e| e.to_string())?;
        if epochs.version != VERSION {
            return Err(format!("version {}, expected {VERSION}", epochs.version));
        }
        Ok(epochs)
    }

    /// The text of the file.
    #[must_use]
    pub fn text(&self) -> String {
        // A map of names and plain values always has a JSON form.
        seal(&serde_json::to_string(self).unwrap_or_default())
    }

    /// Notes the newest use of drives.
    pub fn note(&mut self, drives: &[String], newest: &Use) {
        self.drives.extend(drives.iter().map(|drive| (drive.clone(), newest.clone())));
    }

    /// Whether `epoch` is the newest of each of these drives.
    ///
    /// # Errors
    /// Who used one of them since.
    pub fn confirm(&self, drives: &[String], epoch: &Epoch) -> Result<(), StateError> {
        for drive in drives {
            match self.drives.get(drive) {
                Some(newest) if newest.epoch == *epoch => {}
                newest => {
                    let newest = newest.cloned();
                    return Err(StateError::OutOfDate { drive: drive.clone(), newest });
                }
            }
        }
        Ok(())
    }
}

/// The drives of an arm as the file names them: by the interface and node id under which frames reach them.
#[must_use]
pub fn drives(settings: &Settings) -> Vec<String> {
    let name = |servo: &crate::Servo| {
        let interface = settings.buses.get(servo.bus).map_or("", |bus| bus.interface.as_str());
        format!("{interface} node {}", servo.node_id)
    };
    settings.servos.iter().map(name).collect()
}

/// Where the file lies for drives on the host's CAN interfaces: `/var/lib/taustream/epochs` for root and the services' user,
/// else `.local/state/taustream/epochs` in the user's home of /etc/passwd. No variable and no option changes it.
///
/// # Errors
/// When the user has no home there.
pub fn directory() -> Result<PathBuf, LastPoseError> {
    let uid = rustix::process::geteuid().as_raw();
    let passwd = fs::read_to_string("/etc/passwd").unwrap_or_default();
    choose(uid, &passwd).ok_or_else(|| LastPoseError {
        path: PathBuf::from("/etc/passwd"),
        why: StateError::Disk(DiskFault { step: Step::Home, errno: 0 }),
    })
}

/// The owner of the services' state, whom root trusts as far as the arm goes.
#[must_use]
pub fn services_user() -> Option<u32> {
    let me = rustix::process::geteuid();
    let info = fs::symlink_metadata(SYSTEM).ok()?;
    (me.is_root() && info.is_dir()).then(|| info.uid())
}

fn choose(uid: u32, passwd: &str) -> Option<PathBuf> {
    if uid == 0 {
        return Some(Path::new(SYSTEM).join("epochs"));
    }
    let home = passwd.lines().find_map(|line| {
        let fields: Vec<&str> = line.split(':').collect();
        let own = fields.get(2).and_then(|field| field.parse::<u32>().ok()) == Some(uid);
        fields.get(5).filter(|_| own).map(|home| PathBuf::from(*home))
    })?;
    if home == Path::new(SYSTEM) {
        return Some(home.join("epochs"));
    }
    (home.is_absolute() && home != Path::new("/")).then(|| home.join(".local/state/taustream/epochs"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn newest(epoch: &Epoch) -> Use {
        Use { epoch: epoch.clone(), arm: "arm".into(), state_directory: "/a".into() }
    }

    #[test]
    fn epoch_is_confirmed_only_while_it_is_the_newest_of_every_drive() {
        let (first, second) = (Epoch::random().unwrap(), Epoch::random().unwrap());
        assert_ne!(first, second);
        let drives = ["can0 node 1".to_owned(), "can0 node 2".to_owned()];
        let mut epochs = DriveEpochs::default();
        assert!(epochs.confirm(&drives, &first).is_err(), "an unknown drive confirms nothing");
        epochs.note(&drives, &newest(&first));
        let mut epochs = DriveEpochs::parse(epochs.text().as_bytes()).unwrap();
        assert_eq!(epochs.confirm(&drives, &first), Ok(()));
        epochs.note(&drives[1..], &newest(&second));
        let why = epochs.confirm(&drives, &first).unwrap_err().to_string();
        assert!(why.contains("can0 node 2") && why.contains("/a"), "{why}");
        assert!(DriveEpochs::parse(&epochs.text().as_bytes()[1..]).is_err());
    }

    #[test]
    fn directory_of_epochs_follows_the_user_alone() {
        let passwd = "root:x:0:0:root:/root:/bin/sh\nts:x:990:990::/var/lib/taustream:/bin/false\nann:x:1000:1000::/home/ann:/bin/sh\nno:x:7:7::/:/bin/sh\n";
        assert_eq!(choose(0, passwd), Some("/var/lib/taustream/epochs".into()));
        assert_eq!(choose(990, passwd), Some("/var/lib/taustream/epochs".into()));
        assert_eq!(choose(1000, passwd), Some("/home/ann/.local/state/taustream/epochs".into()));
        assert_eq!(choose(7, passwd), None);
        assert_eq!(choose(8, passwd), None);
    }
}
