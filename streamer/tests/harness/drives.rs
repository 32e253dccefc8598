//! Scripted drives and the link to them: what they do, and what has reached them.
use super::{HOME_RAD, JOINTS};
use std::sync::{Arc, Mutex};
use taustream_drivers::link::{OpenError, Sent};
use taustream_drivers::{
    CanFrame, CanId, CanLink, DriveState, DriveTarget, FixedPdos, FrameBatch, HomingState, JointCommand,
    JointSet, LinkFault, Nanos, ServoDriver, ServoStatus,
};
use taustream_motion::{JointArray, MAX_JOINTS};

/// What the scripted drives do, and what reached them.
#[derive(Debug)]
pub struct World {
    pub states: [DriveState; MAX_JOINTS],
    /// Overrides the state machine below.
    pub forced: [Option<DriveState>; MAX_JOINTS],
    pub error_code: u32,
    pub refused_object: u32,
    pub refused_numbers: [f64; 2],
    /// Code and number of emergency messages of every drive.
    pub emergency: (u32, u32),
    pub warning: Option<usize>,
    /// The drive that says it has lost its master.
    pub lost_master: Option<usize>,
    pub silent: Option<usize>,
    /// What adopted drives hold.
    pub hold_position_rad: JointArray,
    /// Taken off what the drives read of the joints, as a feedback does that counts from elsewhere.
    pub revolution_rad: JointArray,
    /// Added to the measured position of a joint.
    pub offset_rad: JointArray,
    pub link_fault: Option<LinkFault>,
    /// Frames that the link takes before it fails.
    pub link_takes: usize,
    /// Frames that it takes of the batch of a cycle, by tick, without failing.
    pub takes: Option<fn(u64) -> usize>,
    /// The setpoints that reached each drive while energised, with their tick.
    pub drives: [Vec<(u64, f64)>; MAX_JOINTS],
    /// The frame by which another master commands the drives.
    pub other_master: Option<CanId>,
    /// Handed to the cycle beside the answers.
    pub error_frame: Option<u32>,
    /// Byte 1 of that frame: state of the controller.
    pub error_state: u8,
    /// Frames that were taken come back as seen on the wire.
    pub confirms: bool,
    /// They come back from the wire, not from the kernel in front of it.
    pub from_wire: bool,
    /// Of those that come back, so many are lost on the way.
    pub echoes_lost: u64,
    /// Frames of earlier cycles wait in the interface's queue.
    pub queued: bool,
    /// Frames that were lost in receiving.
    pub overflowed: u64,
    /// Frames keep coming faster than they are read, and none of them is new.
    pub flooded: bool,
    /// A link that is reopened comes back.
    pub reopens: bool,
    /// Frames that left.
    pub frames: u64,
    confirmed: u64,
    pub drive_target: Option<DriveTarget>,
    pub clears: u32,
    /// How often the driver was asked to observe its drives again.
    pub start_overs: u32,
    /// Commands that arrived while energised, newest last, with their tick.
    pub arrived: Vec<(u64, JointArray)>,
    pub tick: u64,
    pending: JointArray,
    pub pipeline: [JointArray; 3],
    steps: u32,
}

impl World {
    pub(super) fn new() -> Self {
        Self {
            states: [DriveState::Disabled; MAX_JOINTS],
            forced: [None; MAX_JOINTS],
            error_code: 0,
            refused_object: 0,
            refused_numbers: [0.0; 2],
            emergency: (0, 0),
            warning: None,
            lost_master: None,
            silent: None,
            hold_position_rad: [f64::NAN; MAX_JOINTS],
            revolution_rad: [0.0; MAX_JOINTS],
            offset_rad: [0.0; MAX_JOINTS],
            link_fault: None,
            link_takes: 0,
            takes: None,
            other_master: None,
            drives: Default::default(),
            error_frame: None,
            error_state: 0x20,
            confirms: true,
            from_wire: true,
            echoes_lost: 0,
            queued: false,
            overflowed: 0,
            flooded: false,
            reopens: true,
            frames: 0,
            confirmed: 0,
            drive_target: None,
            clears: 0,
            start_overs: 0,
            arrived: Vec::new(),
            tick: 0,
            pending: HOME_RAD,
            pipeline: [HOME_RAD; 3],
            steps: 0,
        }
    }

    fn advance(&mut self, drive_target: DriveTarget) {
        self.steps = if self.drive_target == Some(drive_target) { self.steps + 1 } else { 0 };
        self.drive_target = Some(drive_target);
        for (joint, state) in self.states.iter_mut().enumerate().take(JOINTS) {
            let steady = self.steps >= 5;
            *state = match (self.forced[joint], drive_target) {
                (Some(forced), _) => forced,
                (None, DriveTarget::TorqueOff) => DriveState::Disabled,
                (None, DriveTarget::Disabled) if steady => DriveState::Disabled,
                (None, DriveTarget::Disabled) if *state == DriveState::Enabled => DriveState::Disabling,
                (None, DriveTarget::Enabled) if steady => DriveState::Enabled,
                (None, DriveTarget::Enabled) if *state == DriveState::Disabled => DriveState::Enabling,
                (None, _) => *state,
            };
        }
    }
}

pub(super) type Shared = Arc<Mutex<World>>;

pub(super) struct FakeDriver {
    world: Shared,
    joints: Vec<usize>,
    received: [Option<Nanos>; MAX_JOINTS],
    position_rad: JointArray,
}

impl FakeDriver {
    pub(super) fn new(world: &Shared) -> Self {
        Self {
            world: Arc::clone(world),
            joints: (0..JOINTS).collect(),
            received: [None; MAX_JOINTS],
            position_rad: HOME_RAD,
        }
    }
}

impl ServoDriver for FakeDriver {
    fn encode(
        &mut self,
        _now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        let mut world = self.world.lock().unwrap();
        world.advance(drive_target);
        let revolution_rad = world.revolution_rad;
        world.pending = std::array::from_fn(|joint| commands[joint].position_rad + revolution_rad[joint]);
        out.push(CanFrame::classic(CanId::standard(0x080), &[]));
        for joint in 0..JOINTS {
            let frame = CanFrame::classic(CanId::standard(0x201 + u16::try_from(joint).unwrap()), &[0; 6]);
            out.push_setpoints(frame, JointSet::of(joint));
        }
    }
    fn decode(&mut self, now: Nanos, _frame: &CanFrame) {
        let world = self.world.lock().unwrap();
        for joint in 0..JOINTS {
            if world.silent != Some(joint) {
                self.received[joint] = Some(now);
                self.position_rad[joint] =
                    world.pipeline[2][joint] + world.offset_rad[joint] - world.revolution_rad[joint];
            }
        }
    }
    fn joints(&self) -> &[usize] {
        &self.joints
    }
    fn status(&self, joint: usize) -> ServoStatus {
        let world = self.world.lock().unwrap();
        ServoStatus {
            state: world.states[joint],
            position_rad: self.received[joint].map_or(f64::NAN, |_| self.position_rad[joint]),
            velocity_rad_s: f64::NAN,
            torque_nm: f64::NAN,
            homing: HomingState::None,
            fixed_pdos: FixedPdos::NONE,
            hold_position_rad: if world.states[joint] == DriveState::Adopted {
                world.hold_position_rad[joint] - world.revolution_rad[joint]
            } else {
                f64::NAN
            },
            received: self.received[joint],
            status_word: 0x1237,
            error_code: world.error_code,
            refused_object: world.refused_object,
            refused_numbers: world.refused_numbers,
            warning: world.warning == Some(joint),
            lost_master: world.lost_master == Some(joint),
            emergency: world.emergency.0,
            emergencies: world.emergency.1,
        }
    }
    fn clear_faults(&mut self) {
        self.world.lock().unwrap().clears += 1;
    }
    fn start_over(&mut self) {
        self.world.lock().unwrap().start_overs += 1;
        self.received = [None; MAX_JOINTS];
    }
    fn other_master(&self) -> Option<CanId> {
        self.world.lock().unwrap().other_master
    }
    fn explain(&self, error_code: u32) -> String {
        format!("{error_code:#x}")
    }
}

pub(super) struct FakeLink(pub(super) Shared);

impl CanLink for FakeLink {
    fn send(&mut self, frames: &[CanFrame]) -> Sent {
        let mut world = self.0.lock().unwrap();
        if let Some(fault) = world.link_fault {
            return Sent { count: world.link_takes.min(frames.len()), fault: Some(fault) };
        }
        let taken = world.takes.map_or(frames.len(), |takes| takes(world.tick).min(frames.len()));
        let mut pending = world.pending;
        // SYNC comes first; a drive whose frame was refused continues with the target that it has.
        let reached = taken.saturating_sub(1);
        pending[reached..JOINTS].copy_from_slice(&world.pipeline[0][reached..JOINTS]);
        // De-energised drives stay where they are, whatever is commanded.
        let energised = world.drive_target == Some(DriveTarget::Enabled);
        let next = if energised { pending } else { world.pipeline[0] };
        world.pipeline.rotate_right(1);
        world.pipeline[0] = next;
        if energised {
            let tick = world.tick;
            world.arrived.push((tick, pending));
            for (drive, position_rad) in world.drives.iter_mut().zip(&pending).take(reached) {
                drive.push((tick, *position_rad));
            }
        }
        world.frames += taken as u64;
        Sent { count: taken, fault: (taken < frames.len()).then_some(LinkFault::QueueFull) }
    }
    fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault> {
        into.clear();
        let mut world = self.0.lock().unwrap();
        if world.confirms {
            world.confirmed = world.frames - world.echoes_lost;
        }
        if let Some(class) = world.error_frame {
            into.push(CanFrame::classic(
                CanId::from_raw(0x2000_0000 | class),
                &[0, world.error_state, 0, 0, 0, 0, 0, 0],
            ));
        }
        into.set_more(world.flooded);
        if world.link_fault.is_none() && !world.flooded {
            into.push(CanFrame::classic(CanId::standard(0x181), &[0; 6]));
        }
        world.link_fault.filter(|_| world.link_takes == 0)
    }
    fn describe(&self) -> String {
        "scripted".to_owned()
    }
    fn confirmed(&self) -> Option<u64> {
        let world = self.0.lock().unwrap();
        Some(world.confirmed)
    }
    fn confirms_from_wire(&self) -> bool {
        self.0.lock().unwrap().from_wire
    }
    fn overflowed(&self) -> u64 {
        self.0.lock().unwrap().overflowed
    }
    fn has_queued(&self) -> bool {
        self.0.lock().unwrap().queued
    }
    fn reopen(&mut self) -> Result<(), OpenError> {
        let mut world = self.0.lock().unwrap();
        if !world.reopens {
            return Err(OpenError::NotCan { interface: "scripted".into() });
        }
        (world.frames, world.confirmed, world.echoes_lost) = (0, 0, 0);
        Ok(())
    }
}
