//! The scene of a planner in a file, for the next start: written as a whole or not at all, off the thread that plans.
//!
//! The file holds every object as it is: those that were added, and those of the scene file, of which meshes keep their shape there.
//! What it says is checked as a message is, so that a file that somebody has edited is refused with its reason.
use crate::live_scene::{LiveScene, SceneChangeError};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use taustream_messages::scene::{
    CHANGES_MAX, CheckedSceneRequest, FixedTo, ObjectPose, ObjectShape, SceneChange, SceneRequest,
};
use taustream_messages::scene_reply::ListedObject;
use tracing::{info, warn};

/// The format of the file.
const VERSION: u32 = 1;
/// Changes come 30 times a second and more; the file follows this far behind, and a crash loses no more.
const BEHIND: Duration = Duration::from_millis(200);
/// Largest file that is read.
const BYTES_MAX: u64 = 4 << 20;

/// Why a kept scene does not serve.
#[derive(Debug, thiserror::Error)]
pub enum KeptSceneError {
    /// The disk.
    #[error("{}: {why}; correct the path of --keep-scene, or remove the file to begin with the scene of the settings", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        why: io::Error,
    },
    /// The text.
    #[error("{}: {why}; correct the file, or remove it to begin with the scene of the settings", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    version: u32,
    #[serde(default)]
    object: Vec<KeptObject>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct KeptObject {
    name: String,
    shape: String,
    size_m: Vec<f64>,
    fixed_to: String,
    position_m: [f64; 3],
    quaternion_xyzw: [f64; 4],
    mass_kg: f64,
}

impl KeptObject {
    fn of(object: ListedObject) -> Self {
        let (shape, size_m) = match object.shape {
            ObjectShape::Sphere { radius_m } => ("sphere", vec![radius_m]),
            ObjectShape::Box { size_m } => ("box", size_m.to_vec()),
            ObjectShape::Cylinder { radius_m, length_m } => ("cylinder", vec![radius_m, length_m]),
            ObjectShape::Capsule { radius_m, length_m } => ("capsule", vec![radius_m, length_m]),
            ObjectShape::Mesh => ("mesh", Vec::new()),
            ObjectShape::Cloud => ("cloud", Vec::new()),
        };
        let fixed_to = if object.fixed_to == FixedTo::Tip { "tip" } else { "base" };
        Self {
            name: object.name,
            shape: shape.to_owned(),
            size_m,
            fixed_to: fixed_to.to_owned(),
            position_m: object.pose.position_m,
            quaternion_xyzw: object.pose.quaternion_xyzw,
            mass_kg: object.mass_kg,
        }
    }

    fn change(self) -> Result<SceneChange, String> {
        let Self { name, shape, size_m, fixed_to, position_m, quaternion_xyzw, mass_kg } = self;
        let pose = ObjectPose { position_m, quaternion_xyzw };
        let shape = match (shape.as_str(), size_m.as_slice()) {
            ("sphere", &[radius_m]) => ObjectShape::Sphere { radius_m },
            ("box", &[x, y, z]) => ObjectShape::Box { size_m: [x, y, z] },
            ("cylinder", &[radius_m, length_m]) => ObjectShape::Cylinder { radius_m, length_m },
            ("capsule", &[radius_m, length_m]) => ObjectShape::Capsule { radius_m, length_m },
            ("mesh" | "cloud", &[]) => return Ok(SceneChange::Move { name, pose }),
            (other, sizes) => {
                return Err(format!(
                    "object {name:?}: shape {other:?} with {} sizes; sphere (1), box (3), cylinder (2), capsule (2), mesh (0) or cloud (0)",
                    sizes.len()
                ));
            }
        };
        let fixed_to = match fixed_to.as_str() {
            "base" => FixedTo::Base,
            "tip" => FixedTo::Tip,
            other => return Err(format!("object {name:?}: fixed_to = {other:?}; base or tip")),
        };
        Ok(SceneChange::Add { name, shape, pose, fixed_to, mass_kg, replaces: true })
    }
}

/// Brings a scene to what a file says, if there is one.
///
/// # Errors
/// When it cannot be read, or says something that makes no sense.
pub fn restore(live: &mut LiveScene, path: &Path) -> Result<(), KeptSceneError> {
    let file = |why| KeptSceneError::File { path: path.to_owned(), why };
    let wrong = |why: String| KeptSceneError::Text { path: path.to_owned(), why };
    let found = match fs::metadata(path) {
        Ok(found) => found,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(file(e)),
    };
    if !found.is_file() || found.len() > BYTES_MAX {
        return Err(wrong(format!("it is no regular file of at most {BYTES_MAX} bytes")));
    }
    let text = fs::read_to_string(path).map_err(file)?;
    let kept: Kept = toml::from_str(&text).map_err(|e| wrong(e.message().to_owned()))?;
    if kept.version != VERSION {
        return Err(wrong(format!("version = {}, and {VERSION} is known", kept.version)));
    }
    let stays: Vec<String> = kept.object.iter().map(|object| object.name.clone()).collect();
    let gone = live.objects().into_iter().map(|object| object.name).filter(|name| !stays.contains(name));
    let mut changes: Vec<SceneChange> = gone.map(|name| SceneChange::Remove { name }).collect();
    let there: Vec<String> = live.objects().into_iter().map(|object| object.name).collect();
    for object in kept.object {
        if object.shape == "cloud" && !there.contains(&object.name) {
            warn!(
                "the points of {:?} came in a message and were not kept: the scene has no such cloud now",
                object.name
            );
            continue;
        }
        changes.push(object.change().map_err(wrong)?);
    }
    for some in changes.chunks(CHANGES_MAX) {
        let request = SceneRequest::from(&CheckedSceneRequest::Change(some.to_vec()));
        match CheckedSceneRequest::try_from(&request) {
            Ok(CheckedSceneRequest::Change(checked)) => {
                live.apply(&checked, None).map_err(|e: SceneChangeError| wrong(e.to_string()))?;
            }
            Ok(CheckedSceneRequest::List { .. }) => {}
            Err(e) => return Err(wrong(e.to_string())),
        }
    }
    Ok(())
}

/// Writes scenes to a file, the newest one.
pub struct SceneFile {
    newest: Option<Sender<String>>,
    writer: Option<JoinHandle<()>>,
}

impl SceneFile {
    /// Starts the thread that writes.
    ///
    /// # Errors
    /// When there is no thread.
    pub fn open(path: &Path) -> io::Result<Self> {
        let (newest, scenes) = channel();
        let path = path.to_owned();
        let writer = thread::Builder::new().name("scene".to_owned()).spawn(move || write(&path, &scenes))?;
        Ok(Self { newest: Some(newest), writer: Some(writer) })
    }

    /// Hands a scene to the writer. Never waits for the disk.
    pub fn keep(&self, live: &LiveScene) {
        let object = live.objects().into_iter().map(KeptObject::of).collect();
        match toml::to_string(&Kept { version: VERSION, object }) {
            Ok(text) => {
                // A writer that has ended has said so.
                let _ended = self.newest.as_ref().map(|newest| newest.send(text));
            }
            Err(e) => warn!("the scene cannot be kept: {e}"),
        }
    }
}

impl Drop for SceneFile {
    /// The last scene is on the disk before the planner ends.
    fn drop(&mut self) {
        drop(self.newest.take());
        if let Some(Err(_)) = self.writer.take().map(JoinHandle::join) {
            warn!("the thread that keeps the scene has a fault; the last changes may be lost");
        }
    }
}

fn write(path: &Path, scenes: &Receiver<String>) {
    let mut failed = false;
    while let Ok(mut text) = scenes.recv() {
        // Newer ones come soon, as a rule.
        let first = Instant::now();
        while let Some(left) = BEHIND.checked_sub(first.elapsed()) {
            match scenes.recv_timeout(left) {
                Ok(newer) => text = newer,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
        let written = write_whole(path, &text);
        match &written {
            Ok(()) if failed => info!("the scene is kept in {} again", path.display()),
            Err(e) if !failed => {
                warn!("the scene cannot be kept in {}: {e}; it lasts until the planner ends", path.display());
            }
            Ok(()) | Err(_) => {}
        }
        failed = written.is_err();
    }
}

/// A reader, or a crash, never meets half of it.
fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    let beside = path.with_extension(format!("{}.part", std::process::id()));
    let written = File::create(&beside)
        .and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&beside, path));
    if written.is_err() {
        let _left = fs::remove_file(&beside);
        return written;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}
