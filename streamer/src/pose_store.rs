//! Keeps the last pose on disk, on a thread of its own: a slow disk delays neither the cycle nor a `stop`.
//!
//! A record resolves the multi-turn offset of a joint after everything was off only if nothing but hands could have moved the joint since:
//! it rested, and was off or may lose its torque without moving. Everything else is written too, and says so.
use crate::referencing::{LastPoses, Recorded};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use taustream_arm::Settings;
use taustream_arm::last_pose::{LastJoint, LastPose, binding_digest};
use taustream_drivers::Nanos;
use taustream_messages::{Phase, ReferenceState, Report};
use taustream_motion::{JointArray, MAX_JOINTS};
use tracing::{error, info, warn};

/// A joint that stays within this is called still.
const STILL_RAD: f64 = 0.002;
/// After this long.
const STILL_S: f64 = 0.2;
/// Between two writings of an arm that only creeps or moves on.
const SPACING_S: f64 = 1.0;
/// A pose that differs by less needs no writing.
const SAME_RAD: f64 = 1e-4;

/// What is known of the joints of an arm, from its file. Faults of the file are logged, and none of it is used.
#[must_use]
pub fn restore_poses(settings: &Settings, directory: &Path) -> LastPoses {
    let mut memory: LastPoses = [None; MAX_JOINTS];
    let pose = match LastPose::load(directory, &settings.name) {
        Ok(pose) => pose,
        Err(e) if e.missing => {
            info!("{e}");
            return memory;
        }
        Err(e) => {
            warn!("{e}; joints that need it are not referenced");
            return memory;
        }
    };
    for servo in &settings.servos {
        let Some(joint) = settings.robot.joints.get(servo.joint) else { continue };
        let Some(last) = pose.joint(&joint.name, &binding_digest(settings, servo)) else {
            warn!("the last pose of joint {} is of another servo or binding; it is not used", joint.name);
            continue;
        };
        if let Some(slot) = memory.get_mut(servo.joint).filter(|_| last.referenced) {
            let LastJoint { position_rad, offset_rad, at_rest, .. } = *last;
            *slot = Some(Recorded { position_rad, offset_rad, at_rest });
        }
    }
    memory
}

/// One joint in a record.
#[derive(Debug)]
struct Named {
    joint: usize,
    name: String,
    binding: String,
    limp_is_safe: bool,
}

/// Writes records when there is something new.
#[derive(Debug)]
pub struct PoseStore {
    arm: String,
    joints: Vec<Named>,
    sender: Option<SyncSender<LastPose>>,
    writer: Option<JoinHandle<()>>,
    anchor_rad: JointArray,
    still_since: Nanos,
    written: Option<(LastPose, Nanos)>,
}

impl PoseStore {
    /// A store of the arm's record below `directory`.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub fn start(settings: &Settings, directory: PathBuf) -> std::io::Result<Self> {
        let (sender, poses) = sync_channel::<LastPose>(1);
        let work = move || {
            let mut failing = false;
            for pose in poses {
                let stored = pose.store(&directory);
                if let (Err(e), false) = (&stored, failing) {
                    error!(
                        "last pose: {} does not take it: {e}; name another with --state-dir",
                        directory.display()
                    );
                }
                failing = stored.is_err();
            }
        };
        let writer = thread::Builder::new().name("memory".into()).stack_size(256 << 10).spawn(work)?;
        let joints = settings.servos.iter().filter_map(|servo| {
            let name = settings.robot.joints.get(servo.joint)?.name.clone();
            let binding = binding_digest(settings, servo);
            Some(Named { joint: servo.joint, name, binding, limp_is_safe: servo.limp_is_safe })
        });
        Ok(Self {
            arm: settings.name.clone(),
            joints: joints.collect(),
            sender: Some(sender),
            writer: Some(writer),
            anchor_rad: [f64::NAN; MAX_JOINTS],
            still_since: Nanos(0),
            written: None,
        })
    }

    /// Takes a report; hands a record to the writer when it says something new.
    pub fn note(&mut self, report: &Report) {
        let Some(pose) = self.record(report) else { return };
        let now = Nanos(report.time_ns);
        let due = match &self.written {
            None => true,
            Some((before, at)) => {
                says_else(before, &pose) || (now.since_s(*at) >= SPACING_S && moved(before, &pose))
            }
        };
        // A writer that is still busy takes the next one.
        if due && self.sender.as_ref().is_some_and(|sender| sender.try_send(pose.clone()).is_ok()) {
            self.written = Some((pose, now));
        }
    }

    /// The record that a report makes; none before every joint was measured.
    fn record(&mut self, report: &Report) -> Option<LastPose> {
        let now = Nanos(report.time_ns);
        let phase = Phase::from_code(report.phase)?;
        if self
            .joints
            .iter()
            .any(|joint| !report.measured_rad.get(joint.joint).is_some_and(|q| q.is_finite()))
        {
            return None;
        }
        let away = |(a, b): (&f64, &f64)| (a - b).abs() > STILL_RAD || b.is_nan();
        if report.measured_rad.iter().zip(&self.anchor_rad).take(report.joints()).any(away) {
            (self.anchor_rad, self.still_since) = (report.measured_rad, now);
        }
        let still = now.since_s(self.still_since) >= STILL_S && !is_under_way(phase);
        let before = self.written.as_ref().map(|(pose, _)| pose);
        let joint = |named: &Named| {
            let at = |values: &[f64; MAX_JOINTS]| values.get(named.joint).copied().unwrap_or(f64::NAN);
            let reference_state = report
                .reference_state
                .get(named.joint)
                .map_or(ReferenceState::NoFeedback, |c| ReferenceState::from_code(*c));
            // A drive that was switched off leaves what was known of it standing.
            if let (ReferenceState::NoFeedback, Some(known)) =
                (reference_state, before.and_then(|b| b.joint(&named.name, &named.binding)))
            {
                return known.clone();
            }
            LastJoint {
                name: named.name.clone(),
                binding: named.binding.clone(),
                referenced: reference_state.is_referenced(),
                at_rest: still && (report.energised == 0 || named.limp_is_safe),
                position_rad: at(&report.measured_rad),
                offset_rad: at(&report.multi_turn_offset_rad),
            }
        };
        Some(LastPose::new(&self.arm, self.joints.iter().map(joint).collect()))
    }
}

impl Drop for PoseStore {
    fn drop(&mut self) {
        self.sender = None;
        if self.writer.take().is_some_and(|writer| writer.join().is_err()) {
            error!("the thread that stores the last pose has panicked");
        }
    }
}

/// The arm moves, or is about to.
fn is_under_way(phase: Phase) -> bool {
    match phase {
        Phase::Enabling
        | Phase::Moving
        | Phase::Pausing
        | Phase::Stopping
        | Phase::FastStopping
        | Phase::Braking
        | Phase::Disabling => true,
        Phase::Configuring
        | Phase::Disabled
        | Phase::Holding
        | Phase::Paused
        | Phase::Fault
        | Phase::Locked => false,
    }
}

/// Whether two records differ in more than the poses.
fn says_else(before: &LastPose, now: &LastPose) -> bool {
    before.joints.len() != now.joints.len()
        || before.joints.iter().zip(&now.joints).any(|(a, b)| {
            let bits = |joint: &LastJoint| joint.offset_rad.to_bits();
            (a.referenced, a.at_rest, bits(a)) != (b.referenced, b.at_rest, bits(b))
        })
}

fn moved(before: &LastPose, now: &LastPose) -> bool {
    before.joints.iter().zip(&now.joints).any(|(a, b)| (a.position_rad - b.position_rad).abs() > SAME_RAD)
}
