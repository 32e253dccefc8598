//! Keeps the last pose on disk, on a thread of its own: a slow disk delays neither the cycle nor a `stop`.
//!
//! Two kinds of record. *Under way*: written and synced when the cycle requests it, before drives are energised or a
//! reference is changed (`write_ahead.rs`). It carries a fresh epoch, which is noted for every drive first. *Rest*: written
//! when every drive is off, nothing is requested, and the arm was measured still. Only rest tells the revolution of a joint
//! after everything was off; whatever fails or is cut off in between leaves a record that is not believed.
use crate::ending::{DISK_WITHIN, NotEnded, join_within};
use crate::referencing::{LastPoses, Recorded, STILL_RAD, STILL_S};
use crate::write_ahead::{JointNow, Place, Recorder, Request, StoreFault};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use taustream_arm::Settings;
use taustream_arm::drive_epochs::{self, DriveEpochs, Epoch, Use};
use taustream_arm::last_pose::{LastJoint, LastPose, LastPoseError, StateError, binding_digest};
use taustream_arm::state_dir::{Disk, replace};
use taustream_drivers::Nanos;
use taustream_messages::{ReferenceState, Report};
use taustream_motion::MAX_JOINTS;
use tracing::{error, info, warn};

/// Between two writings of an arm that is moved by hand.
const SPACING_S: f64 = 1.0;
/// A pose that differs by less needs no writing.
const SAME_RAD: f64 = 1e-4;
/// How often the thread looks for a request.
const POLL: Duration = Duration::from_millis(2);
/// Reports that may wait for a slow disk; more are dropped, the next ones tell the same.
const REPORTS: usize = 4;

/// The two directories that records need.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Directories {
    /// Where the record lies: the state directory.
    pub state: PathBuf,
    /// Where the drives' epochs lie.
    pub epochs: PathBuf,
}

impl Directories {
    /// The sentence about a fault.
    #[must_use]
    pub fn sentence(&self, fault: StoreFault) -> String {
        let (path, name) = match fault.place {
            Place::State => (&self.state, "the state directory"),
            Place::Epochs => (&self.epochs, "the directory of the drives' epochs"),
        };
        if path.as_os_str().is_empty() {
            fault.fault.sentence(name)
        } else {
            fault.fault.sentence(&format!("{name} {}", path.display()))
        }
    }
}

/// One joint as it stands in every record.
#[derive(Debug)]
struct Named {
    joint: usize,
    name: String,
    binding: String,
}

/// Whether a joint rests, as far as reports tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Unknown,
    Still,
    Moving,
}

/// Tells rest from motion by what one joint was measured at.
#[derive(Clone, Copy, Debug, Default)]
struct Stillness {
    first: Option<Nanos>,
    anchor: Option<(f64, Nanos)>,
}

impl Stillness {
    fn observe(&mut self, position_rad: f64, now: Nanos) -> Motion {
        let first = *self.first.get_or_insert(now);
        let near = |(at_rad, _): &(f64, Nanos)| (position_rad - at_rad).abs() <= STILL_RAD;
        let anchor = self.anchor.filter(near).unwrap_or((position_rad, now));
        self.anchor = Some(anchor);
        let (_, since) = anchor;
        if now.since_s(since) >= STILL_S {
            Motion::Still
        } else if since > first {
            Motion::Moving
        } else {
            Motion::Unknown
        }
    }
}

/// Reads and writes the records of one arm.
pub struct PoseRecords {
    disk: Box<dyn Disk>,
    directories: Directories,
    arm: String,
    joints: Vec<Named>,
    drives: Vec<String>,
    feedback_age_s_max: f64,
    recorder: Recorder,
    /// The newest request that was answered.
    done: u32,
    /// The epoch that the drives' newest use and the record agree on, as far as is known.
    epoch: Option<Epoch>,
    written: Option<LastPose>,
    attempted: Nanos,
    stillness: [Stillness; MAX_JOINTS],
    failing: bool,
    /// The epochs are what is being written, not the record: for the message about a disk that hangs.
    at_epochs: Arc<AtomicBool>,
}

impl std::fmt::Debug for PoseRecords {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PoseRecords")
            .field("arm", &self.arm)
            .field("directories", &self.directories)
            .finish_non_exhaustive()
    }
}

impl PoseRecords {
    /// The records of an arm on `disk`.
    #[must_use]
    pub fn new(
        settings: &Settings,
        directories: Directories,
        disk: Box<dyn Disk>,
        recorder: Recorder,
    ) -> Self {
        let joints = settings.servos.iter().filter_map(|servo| {
            let name = settings.slot(servo.joint)?.name.clone();
            Some(Named { joint: servo.joint, name, binding: binding_digest(settings, servo) })
        });
        Self {
            disk,
            directories,
            arm: settings.name.clone(),
            joints: joints.collect(),
            drives: drive_epochs::drives(settings),
            feedback_age_s_max: settings.supervision.feedback_age_s_max,
            recorder,
            done: 0,
            epoch: None,
            written: None,
            attempted: Nanos(0),
            stillness: [Stillness::default(); MAX_JOINTS],
            failing: false,
            at_epochs: Arc::default(),
        }
    }

    /// What the record tells of the joints. What is wrong with it is logged, and nothing of it believed.
    pub fn restore_poses(&mut self) -> LastPoses {
        let mut records: LastPoses = [None; MAX_JOINTS];
        let pose = match self.load() {
            Ok(pose) => pose,
            Err(LastPoseError { why: StateError::Missing, path }) => {
                info!("last pose {}: there is none yet", path.display());
                return records;
            }
            Err(e) => {
                warn!("{e}; joints that need it are not referenced");
                return records;
            }
        };
        for named in &self.joints {
            let Some(last) = pose.joint(&named.name, &named.binding) else {
                warn!("the last pose of joint {} is of another servo or binding; it is not used", named.name);
                continue;
            };
            if let Some(slot) = records.get_mut(named.joint).filter(|_| last.referenced) {
                let LastJoint { position_rad, offset_rad, at_rest, .. } = *last;
                *slot = Some(Recorded { position_rad, offset_rad, at_rest });
            }
        }
        self.epoch = Some(pose.epoch.clone());
        self.written = Some(pose);
        records
    }

    /// The record, if it is the newest of its drives.
    fn load(&self) -> Result<LastPose, LastPoseError> {
        let Directories { state, epochs } = &self.directories;
        let file = LastPose::file_name(&self.arm);
        let missing_is = |fault: taustream_arm::state_dir::DiskFault| match fault.errno {
            2 => StateError::Missing,
            _ => StateError::Disk(fault),
        };
        let at = |path: PathBuf| move |why| LastPoseError { path, why };
        let directory = self.disk.open(state, false).map_err(missing_is);
        let pose = directory.and_then(|mut directory| LastPose::load(&mut *directory, &self.arm));
        let pose = pose.map_err(at(state.join(file)))?;
        let path = epochs.join(drive_epochs::FILE);
        let directory = self.disk.open(epochs, false).map_err(missing_is);
        let bytes = directory.and_then(|mut d| d.read(drive_epochs::FILE).map_err(StateError::Disk));
        let known = match bytes {
            Ok(None) | Err(StateError::Missing) => Ok(DriveEpochs::default()),
            Ok(Some(bytes)) => DriveEpochs::parse(&bytes).map_err(StateError::Contents),
            Err(e) => Err(e),
        };
        let known = known.map_err(at(path))?;
        known.confirm(&self.drives, &pose.epoch).map_err(at(state.join(LastPose::file_name(&self.arm))))?;
        Ok(pose)
    }

    /// Carries a request out, if there is a new one.
    pub fn serve(&mut self) {
        let Some(request) = self.recorder.request(self.done) else { return };
        let stored = self.store_under_way(&request);
        if let Err(fault) = stored {
            error!("last pose: {}", self.directories.sentence(fault));
        }
        self.done = request.number;
        self.stillness = Default::default();
        self.recorder.answer(request.number, stored);
    }

    fn store_under_way(&mut self, request: &Request) -> Result<(), StoreFault> {
        let joint = |named: &Named| {
            let now = request.joints.get(named.joint).copied().unwrap_or(JointNow::UNKNOWN);
            // Under way nobody reads where it is, but the file holds numbers only.
            let position_rad = if now.position_rad.is_finite() { now.position_rad } else { 0.0 };
            named.record(JointNow { position_rad, ..now }, false)
        };
        let joints = self.joints.iter().map(joint).collect();
        self.store(joints, None)
    }

    /// Writes a record under an epoch, or under a fresh one, which then becomes the newest of every drive. If the record is
    /// refused, nothing has changed; if the epoch is, the record is not believed.
    fn store(&mut self, joints: Vec<LastJoint>, epoch: Option<Epoch>) -> Result<(), StoreFault> {
        let fresh = epoch.is_none();
        let epoch = match epoch {
            Some(epoch) => epoch,
            None => Epoch::random().map_err(|fault| StoreFault { place: Place::Epochs, fault })?,
        };
        let pose = LastPose::new(&self.arm, epoch.clone(), joints);
        let directory = self.disk.open(&self.directories.state, true);
        let stored = directory.and_then(|mut directory| pose.store(&mut *directory));
        stored.map_err(|fault| StoreFault { place: Place::State, fault })?;
        self.written = Some(pose);
        if fresh { self.note_epoch(epoch) } else { Ok(()) }
    }

    /// From now on no record of these drives is believed but one that carries this epoch.
    fn note_epoch(&mut self, epoch: Epoch) -> Result<(), StoreFault> {
        self.at_epochs.store(true, Ordering::Relaxed);
        let noted = self.write_epoch(epoch);
        self.at_epochs.store(false, Ordering::Relaxed);
        noted
    }

    fn write_epoch(&mut self, epoch: Epoch) -> Result<(), StoreFault> {
        self.epoch = None;
        let at = |fault| StoreFault { place: Place::Epochs, fault };
        let mut directory = self.disk.open(&self.directories.epochs, true).map_err(at)?;
        directory.lock(drive_epochs::LOCK).map_err(at)?;
        let known = directory.read(drive_epochs::FILE).map_err(at)?;
        let mut known = known.map_or_else(DriveEpochs::default, |bytes| {
            DriveEpochs::parse(&bytes).unwrap_or_else(|why| {
                warn!("the drives' epochs: {why}; no other arm's last pose is believed any more");
                DriveEpochs::default()
            })
        });
        let (arm, state_directory) = (self.arm.clone(), self.directories.state.clone());
        known.note(&self.drives, &Use { epoch: epoch.clone(), arm, state_directory });
        replace(&mut *directory, drive_epochs::FILE, &known.text()).map_err(at)?;
        self.epoch = Some(epoch);
        Ok(())
    }

    /// Takes a report; writes a record of rest when it says something new, or that there is none any more.
    pub fn note(&mut self, report: &Report) {
        let idle = self.recorder.released_since(self.done);
        // A report from before the release says nothing.
        if report.energised != 0 || !idle.is_some_and(|tick| self.done == 0 || report.tick > tick) {
            self.stillness = Default::default();
            return;
        }
        let Some(Rest { joints, resting, moving }) = self.observe(report) else { return };
        let worth = self.epoch.is_some() || needs_record(report);
        if worth && self.is_due(&joints, Nanos(report.time_ns)) {
            self.attempted = Nanos(report.time_ns);
            let stored = self.store(joints, self.epoch.clone());
            if let (Err(fault), false) = (stored, self.failing) {
                error!("last pose: {}", self.directories.sentence(fault));
            }
            self.failing = stored.is_err();
            if self.failing && moving {
                // The arm is moved by hand, and its record of rest is still on the disk: a newer epoch makes it out of date.
                let _as_good_as_can_be = Epoch::random().ok().map(|epoch| self.note_epoch(epoch));
            }
        }
        if resting && !(worth && self.failing) {
            self.recorder.rested(self.done);
        }
    }

    fn is_due(&self, joints: &[LastJoint], now: Nanos) -> bool {
        let waited = now.since_s(self.attempted) >= SPACING_S;
        match &self.written {
            _ if self.failing => waited,
            None => true,
            Some(before) => {
                says_else(&before.joints, joints)
                    || (self.epoch.as_ref() != Some(&before.epoch))
                    || (waited && moved(&before.joints, joints))
            }
        }
    }

    /// What a report tells of the joints; nothing while one of them was never heard.
    fn observe(&mut self, report: &Report) -> Option<Rest> {
        let now = Nanos(report.time_ns);
        let mut rest = Rest { joints: Vec::with_capacity(self.joints.len()), resting: true, moving: false };
        for named in &self.joints {
            let known = self.written.as_ref().and_then(|pose| pose.joint(&named.name, &named.binding));
            let stillness = self.stillness.get_mut(named.joint)?;
            let Some(received) = received(report, named.joint, self.feedback_age_s_max) else {
                // A drive that was switched off leaves what was known of it.
                *stillness = Stillness::default();
                rest.joints.push(known?.clone());
                continue;
            };
            let motion = stillness.observe(received.position_rad, now);
            rest.resting &= motion == Motion::Still;
            rest.moving |= motion == Motion::Moving;
            rest.joints.push(match (motion, known) {
                (Motion::Unknown, Some(known)) => known.clone(),
                (Motion::Unknown | Motion::Still | Motion::Moving, _) => {
                    named.record(received, motion == Motion::Still)
                }
            });
        }
        Some(rest)
    }
}

/// What the reports since the release tell.
struct Rest {
    joints: Vec<LastJoint>,
    resting: bool,
    moving: bool,
}

/// What a report says of a joint whose drive answers.
fn received(report: &Report, joint: usize, age_s_max: f64) -> Option<JointNow> {
    let at = |values: &[f64; MAX_JOINTS]| values.get(joint).copied().unwrap_or(f64::NAN);
    let reference_state = report
        .reference_state
        .get(joint)
        .map_or(ReferenceState::NoFeedback, |code| ReferenceState::from_code(*code));
    let now = JointNow {
        position_rad: at(&report.measured_rad),
        offset_rad: at(&report.multi_turn_offset_rad),
        reference_state,
    };
    let fresh = at(&report.feedback_age_s) <= age_s_max;
    let known =
        reference_state != ReferenceState::NoFeedback && (now.position_rad + now.offset_rad).is_finite();
    (fresh && known).then_some(now)
}

/// A joint's offset is known from a record or the operator, and would be lost without one.
fn needs_record(report: &Report) -> bool {
    let needs = |code: &u32| match ReferenceState::from_code(*code) {
        ReferenceState::Record
        | ReferenceState::Adoption
        | ReferenceState::Operator
        | ReferenceState::Homed => true,
        ReferenceState::NoFeedback
        | ReferenceState::Encoder
        | ReferenceState::NoRecord
        | ReferenceState::RecordMoving
        | ReferenceState::RecordFar
        | ReferenceState::OutOfRange
        | ReferenceState::Homing
        | ReferenceState::Incremental => false,
    };
    report.reference_state.iter().take(report.slots()).any(needs)
}

impl Named {
    fn record(&self, now: JointNow, at_rest: bool) -> LastJoint {
        LastJoint {
            name: self.name.clone(),
            binding: self.binding.clone(),
            referenced: now.reference_state.is_referenced(),
            at_rest,
            position_rad: now.position_rad,
            offset_rad: now.offset_rad,
        }
    }
}

/// Whether two records differ in more than where the joints are.
fn says_else(before: &[LastJoint], now: &[LastJoint]) -> bool {
    before.len() != now.len()
        || before.iter().zip(now).any(|(a, b)| {
            let bits = |joint: &LastJoint| joint.offset_rad.to_bits();
            (&a.name, &a.binding, a.referenced, a.at_rest, bits(a))
                != (&b.name, &b.binding, b.referenced, b.at_rest, bits(b))
        })
}

fn moved(before: &[LastJoint], now: &[LastJoint]) -> bool {
    before.iter().zip(now).any(|(a, b)| (a.position_rad - b.position_rad).abs() > SAME_RAD)
}

/// Why the thread of the store did not end.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotFinished {
    /// An operation on this file does not return.
    #[error(
        "last pose: {} is not written: its disk has not answered for {} s. The streamer ends without it; joints that need the record \
         may not be referenced at the next start",
        .0.display(), DISK_WITHIN.as_secs()
    )]
    DiskHangs(PathBuf),
    /// The thread has panicked.
    #[error("the thread that keeps the last pose has panicked")]
    Panicked,
}

/// The store on its thread. Dropping it finishes it.
#[derive(Debug)]
pub struct PoseStore {
    directories: Directories,
    /// The record and the epochs.
    files: [PathBuf; 2],
    at_epochs: Arc<AtomicBool>,
    sender: Option<SyncSender<Report>>,
    writer: Option<JoinHandle<()>>,
}

impl PoseStore {
    /// Starts the thread of a store.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub fn start(store: PoseRecords) -> std::io::Result<Self> {
        let (sender, reports) = sync_channel::<Report>(REPORTS);
        let directories = store.directories.clone();
        let record = directories.state.join(LastPose::file_name(&store.arm));
        let files = [record, directories.epochs.join(drive_epochs::FILE)];
        let at_epochs = Arc::clone(&store.at_epochs);
        let work = move || run(store, &reports);
        let writer = thread::Builder::new().name("pose-store".into()).stack_size(256 << 10).spawn(work)?;
        Ok(Self { directories, files, at_epochs, sender: Some(sender), writer: Some(writer) })
    }

    /// Ends the thread when what is being written is written, or leaves it to the end of the process after [`DISK_WITHIN`].
    ///
    /// # Errors
    /// Which file could not be finished, and why.
    pub fn finish(&mut self) -> Result<(), NotFinished> {
        self.sender = None;
        let Some(writer) = self.writer.take() else { return Ok(()) };
        join_within(writer, DISK_WITHIN).map_err(|why| match why {
            NotEnded::Panicked => NotFinished::Panicked,
            NotEnded::Running => {
                let [record, epochs] = &self.files;
                let file = if self.at_epochs.load(Ordering::Relaxed) { epochs } else { record };
                NotFinished::DiskHangs(file.clone())
            }
        })
    }

    /// Where it writes.
    #[must_use]
    pub fn directories(&self) -> &Directories {
        &self.directories
    }

    /// Hands a report over; drops it while the disk is slow.
    pub fn note(&self, report: &Report) {
        if let Some(sender) = &self.sender {
            let _dropped = sender.try_send(*report);
        }
    }
}

fn run(mut store: PoseRecords, reports: &Receiver<Report>) {
    loop {
        store.serve();
        match reports.recv_timeout(POLL) {
            Ok(report) => store.note(&report),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return store.serve(),
        }
    }
}

impl Drop for PoseStore {
    fn drop(&mut self) {
        if let Err(e) = self.finish() {
            error!("{e}");
        }
    }
}

/// The directories of an arm: the state directory that was asked for, and the one of the epochs that follows the drives.
/// Drives on a local link exist only below the runtime directory, and so does what is known of their use.
///
/// # Errors
/// When there is no place for them.
pub fn directories(state: PathBuf, local: Option<&Path>) -> Result<Directories, LastPoseError> {
    let state = std::path::absolute(&state).unwrap_or(state);
    let epochs = local.map_or_else(drive_epochs::directory, |runtime| Ok(runtime.join("epochs")))?;
    Ok(Directories { state, epochs })
}
