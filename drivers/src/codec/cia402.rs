//! The driver of CiA 402 drives in cyclic synchronous position on one bus.
//!
//! One cycle on the bus: SYNC, which makes the drives apply the setpoints of the cycle before and sample their
//! position; the new setpoints; then, one frame a node at most, configuration. So a command acts one period after it
//! was sent, and a position is one period old when it is seen.
use crate::bring_up::cia402::{DriveSetpoint, Node, Target};
use crate::bring_up::fault;
use crate::bring_up::plan::{HEARTBEAT_MS, NodePlan, TargetPdo};
use crate::bring_up::profile_limits::ProfilePlan;
use crate::bring_up::scale::ExpectedScale;
use crate::bring_up::timing::{self, BringUpCycle, StepTimer, Timeouts};
use crate::codec::canopen::{
    COB_PDO_STEP, COB_RPDO1, Emcy, MASTER_NODE, NODE_MAX, Nmt, NmtState, decode_sync, node_of, sync,
};
use crate::codec::drive_torque::DriveTorque;
use crate::codec::sdo::SdoResponse;
use crate::codec::setpoint_frames::{Group, SendSchedule, encode_control, encode_pair, groups};
use crate::frame::{CanFrame, CanId, FrameBatch, JointSet};
use crate::servo::{DriveState, DriveTarget, JointCommand, Nanos, ServoDriver, ServoStatus};
use taustream_arm::{Cia402, Servo, Settings};
use taustream_motion::MAX_JOINTS;

pub use crate::codec::cia402_words::{
    CountScale, DriveStep, counts_from_rad, decode_rpdo, decode_tpdo, decode_tpdo_with_torque, encode_rpdo,
    encode_rpdo_with_torque, encode_tpdo, rad_from_counts,
};

/// Why a driver cannot be made from settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Cia402Error {
    /// There is no such bus.
    #[error("bus {bus} was requested, but the settings have {buses}")]
    NoSuchBus {
        /// Index asked for.
        bus: usize,
        /// How many there are.
        buses: usize,
    },
    /// More joints than an arm may have, or a joint index beyond it.
    #[error("joint {} of the servos is beyond the {MAX_JOINTS} joints that an arm may have", joint + 1)]
    JointBeyond {
        /// Index of the joint.
        joint: usize,
    },
    /// A node id that no drive may have.
    #[error(
        "joint {} has node id {node_id}; drives on a CANopen bus have 1 to 126 (127 is this master): give the \
         drive another id",
        joint + 1
    )]
    NodeId {
        /// Index of the joint.
        joint: usize,
        /// Its node id.
        node_id: u8,
    },
    /// Two joints on one node.
    #[error("joint {} has node id {node_id} like joint {}; give one of the drives another id", joint + 1, other + 1)]
    NodeTwice {
        /// Index of the joint.
        joint: usize,
        /// Index of the other joint.
        other: usize,
        /// The node id.
        node_id: u8,
    },
    /// The period cannot be stated in object 0x60C2.
    #[error(
        "a setpoint every {period_us} us (cycle.period_us x setpoint_every) cannot be configured in a CiA 402 drive (object \
         0x60C2 takes 1 to 255 times a power of ten); choose 500, 1000, 2000 or 4000"
    )]
    Period {
        /// Time between two setpoints.
        period_us: u32,
    },
    /// A time or distance of the settings is not usable.
    #[error("supervision.{key} = {value}: expected a positive number")]
    Supervision {
        /// Its key.
        key: &'static str,
        /// Its value.
        value: f64,
    },
}

/// One drive: the joint that it moves, how it counts, its node and newest feedback.
#[derive(Clone, Debug)]
struct Drive {
    joint: usize,
    node_id: u8,
    scale: CountScale,
    node: Node,
    received: Option<Nanos>,
    torque: Option<DriveTorque>,
    /// Torque that it measured last, thousandths of its rated torque.
    measured: Option<i16>,
    /// Controlword of the newest frame that held one.
    control: Option<u16>,
}

/// The master of all CiA 402 drives of one bus.
#[derive(Clone, Debug)]
pub struct Cia402Driver {
    drives: Vec<Drive>,
    joints: Vec<usize>,
    groups: Vec<Group>,
    send_schedule: SendSchedule,
    /// Node id to index of drive.
    by_node: [Option<usize>; NODE_MAX as usize + 1],
    near_rad: f64,
    clock: StepTimer,
    heartbeat_at: Option<Nanos>,
    /// The cycle before sent SYNC.
    syncs: bool,
}

impl Cia402Driver {
    /// A driver for the CiA 402 servos of `settings.buses[bus]`; it may have none.
    ///
    /// # Errors
    /// When the settings cannot be configured in CANopen drives.
    pub fn new(settings: &Settings, bus: usize) -> Result<Self, Cia402Error> {
        let buses = settings.buses.len();
        let Some(traffic) = settings.buses.get(bus).map(|bus| bus.traffic) else {
            return Err(Cia402Error::NoSuchBus { bus, buses });
        };
        let period_us = settings.cycle.period_us;
        let setpoint_us = period_us.saturating_mul(traffic.setpoint_every);
        let interpolation = crate::codec::cia402_words::interpolation_period(setpoint_us)
            .ok_or(Cia402Error::Period { period_us: setpoint_us })?;
        let on_bus = settings.servos.iter().filter(|servo| servo.bus == bus);
        let joint = |servo: &Servo| settings.slot(servo.joint);
        let mine = || {
            let expected = |servo| joint(servo).and_then(|joint| ExpectedScale::of(servo, joint));
            on_bus.clone().filter_map(move |servo| Some((servo, CountScale::of(servo)?, expected(servo)?)))
        };
        let supervision = &settings.supervision;
        let timeouts = Timeouts {
            step: nanos("drive_timeout_s", supervision.drive_timeout_s)?,
            feedback: nanos("feedback_age_s_max", supervision.feedback_age_s_max)?,
        };
        // Energising must not start with a step: the command has to equal the measured angle, by the stricter of
        // the two distances that the settings call impossible.
        let near_rad = supervision.tracking_error_rad_max.min(supervision.position_jump_rad_max);
        nanos("tracking_error_rad_max and position_jump_rad_max", near_rad)?;
        let mut driver = Self {
            drives: Vec::new(),
            joints: Vec::new(),
            groups: groups(mine().count(), traffic.packed),
            send_schedule: SendSchedule::new(traffic),
            by_node: [None; NODE_MAX as usize + 1],
            near_rad,
            clock: StepTimer::new(period_us),
            heartbeat_at: None,
            syncs: false,
        };
        // Bounded where settings are read; a drive configured with 240 would not answer for as many cycles.
        let feedback_every = u8::try_from(traffic.feedback_every).unwrap_or(u8::MAX).clamp(1, 240);
        let nodes: Vec<u8> = mine().map(|(servo, ..)| servo.node_id).collect();
        for (at, (servo, scale, expected)) in mine().enumerate() {
            let plan = NodePlan {
                node: servo.node_id,
                period_us,
                interpolation,
                reaction: servo.reaction,
                target: target_pdo(&driver.groups, &nodes, at),
                heartbeat_lost_ms: settings.cycle.heartbeat_lost_ms,
                feedback_every,
                setpoints_lost_ms: u16::try_from(settings.cycle.drive_watchdog_ms).unwrap_or(u16::MAX),
                scale: expected,
                profile: joint(servo).and_then(|joint| ProfilePlan::of(servo, joint, setpoint_us)),
                homing: servo.protocol.get::<Cia402>().and_then(|cia402| cia402.homing),
                torque: servo.protocol.get::<Cia402>().and_then(|cia402| cia402.torque),
                brake: servo.protocol.get::<Cia402>().and_then(|cia402| cia402.brake),
                near_counts: expected.counts_of(near_rad),
                features: servo.protocol.get::<Cia402>().map(|cia402| cia402.features).unwrap_or_default(),
            };
            driver.add(servo, scale, Node::new(plan, timeouts))?;
        }
        Ok(driver)
    }

    fn add(&mut self, servo: &Servo, scale: CountScale, node: Node) -> Result<(), Cia402Error> {
        let (joint, node_id) = (servo.joint, servo.node_id);
        if joint >= MAX_JOINTS || self.drives.len() >= MAX_JOINTS {
            return Err(Cia402Error::JointBeyond { joint });
        }
        let slot = match self.by_node.get_mut(usize::from(node_id)) {
            Some(slot) if node_id != 0 && node_id != MASTER_NODE => slot,
            _ => return Err(Cia402Error::NodeId { joint, node_id }),
        };
        if let Some(other) = slot.and_then(|index| self.joints.get(index).copied()) {
            return Err(Cia402Error::NodeTwice { joint, other, node_id });
        }
        *slot = Some(self.drives.len());
        let torque = DriveTorque::of(servo);
        let (received, measured, control) = (None, None, None);
        self.drives.push(Drive { joint, node_id, scale, node, received, torque, measured, control });
        self.joints.push(joint);
        Ok(())
    }

    fn drive_mut(&mut self, node: u8) -> Option<&mut Drive> {
        let index = (*self.by_node.get(usize::from(node))?)?;
        self.drives.get_mut(index)
    }

    /// The setpoints that are due, and whatever must not wait: a new controlword, and torque off.
    fn push_setpoints(
        &mut self,
        cycle: BringUpCycle,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        let (send_schedule, near_rad) = (self.send_schedule, self.near_rad);
        self.send_schedule.advance();
        for (number, group) in self.groups.iter().enumerate() {
            let is_due = send_schedule.is_due(number);
            match *group {
                Group::One(at) => {
                    let Some(drive) = self.drives.get_mut(at) else { continue };
                    drive.push_own(cycle, drive.target(commands, near_rad), is_due, out);
                }
                Group::Pair([first, second]) => {
                    let Ok([first, second]) = self.drives.get_disjoint_mut([first, second]) else { continue };
                    let repeats = send_schedule.repeats_control(number);
                    // Its target comes with the other's: a drive must not be energised before both can be commanded.
                    let together = first.node.commanded().is_some() && second.node.commanded().is_some();
                    let mut news = false;
                    for drive in [&mut *first, &mut *second] {
                        let target = drive.target(commands, near_rad);
                        let target = Target { near: target.near && together, ..target };
                        news |= drive.push_control(cycle, target, repeats, out);
                    }
                    push_shared(first, second, is_due || news, out);
                }
            }
        }
    }

    /// What each drive that is held and not in the cycle yet does already.
    fn push_kept(&self, out: &mut FrameBatch) {
        let kept =
            |at: usize| self.drives.get(at).and_then(|drive| Some((drive.node_id, drive.node.keeping()?)));
        let own =
            |at: usize| self.drives.get(at).and_then(|drive| Some(drive.rpdo(drive.node.keeping()?, 0)));
        for group in &self.groups {
            match *group {
                Group::One(at) => {
                    if let Some(frame) = own(at) {
                        out.push(frame);
                    }
                }
                // A target for both is known only where both are held.
                Group::Pair([first, second]) => {
                    let pair = (kept(first), kept(second));
                    for (node, setpoint) in [pair.0, pair.1].into_iter().flatten() {
                        out.push(encode_control(node, setpoint.control));
                    }
                    if let (Some((node, a)), Some((_, b))) = pair {
                        out.push(encode_pair(node, [a.target_counts, b.target_counts]));
                    }
                }
            }
        }
    }

    /// Whether a frame is one that only a master sends to these drives: SYNC, an NMT command, a setpoint. Own frames are
    /// never received.
    fn is_of_a_master(&self, frame: &CanFrame) -> bool {
        let is_ours = |node: u8| self.by_node.get(usize::from(node)).is_some_and(Option::is_some);
        // The second RPDO is what two drives share.
        let rpdo = |base: u16| node_of(frame, base).is_some_and(is_ours);
        let setpoint = || rpdo(COB_RPDO1) || rpdo(COB_RPDO1 + COB_PDO_STEP);
        let command = || Nmt::decode(frame).is_some_and(|nmt| nmt.node == 0 || is_ours(nmt.node));
        decode_sync(frame).is_some() || setpoint() || command()
    }

    /// Drives watch for this (object 0x1016) and stop by themselves when it ends.
    fn push_heartbeat(&mut self, now: Nanos, out: &mut FrameBatch) {
        let due = self
            .heartbeat_at
            .is_none_or(|then| now.0.saturating_sub(then.0) >= u64::from(HEARTBEAT_MS) * 1_000_000);
        if due && out.push(NmtState::Operational.encode(MASTER_NODE)) {
            self.heartbeat_at = Some(now);
        }
    }
}

/// Where the drive at place `at` finds its target.
fn target_pdo(groups: &[Group], nodes: &[u8], at: usize) -> TargetPdo {
    let pair = groups.iter().find_map(|group| match group {
        Group::Pair([first, second]) if *first == at || *second == at => {
            Some((nodes.get(*first)?, *second == at))
        }
        Group::Pair(_) | Group::One(_) => None,
    });
    pair.map_or(TargetPdo::Own, |(first_node, second)| TargetPdo::Shared { first_node: *first_node, second })
}

/// A positive time of the settings in nanoseconds.
fn nanos(key: &'static str, value: f64) -> Result<Nanos, Cia402Error> {
    timing::nanos(value).ok_or(Cia402Error::Supervision { key, value })
}

impl ServoDriver for Cia402Driver {
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        let cycle = self.clock.tick(now, drive_target);
        let syncs = self.drives.iter().any(|drive| drive.node.needs_sync());
        if syncs && !self.syncs {
            // A drive that holds may still have latched the last setpoint of the master before: it must not act now.
            self.push_kept(out);
        }
        self.syncs = syncs;
        if syncs {
            out.push(sync());
        }
        self.push_setpoints(cycle, commands, out);
        for drive in &mut self.drives {
            let service = drive.node.service(cycle);
            if let Some(nmt) = service.nmt {
                out.push(nmt.encode());
            }
            if let Some(request) = service.sdo {
                out.push(request.encode(drive.node_id));
            }
        }
        self.push_heartbeat(now, out);
    }

    fn decode(&mut self, now: Nanos, frame: &CanFrame) {
        let step_now = self.clock.now();
        if self.is_of_a_master(frame) {
            self.clock.note_other_master(frame.id());
        } else if let Some((node, status, position)) = decode_tpdo(frame) {
            if let Some(drive) = self.drive_mut(node).filter(|drive| !drive.measures())
                && drive.node.take_tpdo(step_now, status, position)
            {
                drive.received = Some(now);
            }
        } else if let Some((node, status, position, per_mille)) = decode_tpdo_with_torque(frame) {
            if let Some(drive) = self.drive_mut(node).filter(|drive| drive.measures())
                && drive.node.take_tpdo(step_now, status, position)
            {
                (drive.received, drive.measured) = (Some(now), Some(per_mille));
            }
        } else if let Some((node, response)) = SdoResponse::decode(frame) {
            if let Some(drive) = self.drive_mut(node) {
                drive.node.take_sdo(response);
            }
        } else if let Some((node, emcy)) = Emcy::decode(frame) {
            if let Some(drive) = self.drive_mut(node) {
                drive.node.take_emcy(emcy);
            }
        } else if let Some((node, state)) = NmtState::decode(frame)
            && let Some(drive) = self.drive_mut(node)
        {
            drive.node.take_heartbeat(step_now, state);
        }
    }

    fn joints(&self) -> &[usize] {
        &self.joints
    }

    fn status(&self, joint: usize) -> ServoStatus {
        let Some(drive) = self.drives.iter().find(|drive| drive.joint == joint) else {
            return ServoStatus::UNKNOWN;
        };
        let node = &drive.node;
        let (error_code, refused_object) = node.error();
        let (emergency, emergencies) = node.emergency();
        ServoStatus {
            state: node.state(),
            // The position read while configuring is no feedback yet: nothing would tell its age.
            position_rad: drive.received.map_or(f64::NAN, |_| drive.position_rad()),
            velocity_rad_s: f64::NAN,
            torque_nm: drive.torque_nm(),
            homing: node.homing(),
            fixed_pdos: node.fixed_pdos(),
            hold_position_rad: node.held().map_or(f64::NAN, |counts| rad_from_counts(&drive.scale, counts)),
            received: drive.received,
            status_word: node.status_word(),
            error_code,
            refused_object,
            refused_numbers: node.refused_numbers(),
            warning: node.warns(),
            lost_master: node.lost_master(),
            emergency: u32::from(emergency),
            emergencies,
        }
    }

    fn set_homing(&mut self, joint: Option<usize>) {
        for drive in &mut self.drives {
            drive.node.request_homing(joint == Some(drive.joint));
        }
    }

    fn clear_faults(&mut self) {
        let step_now = self.clock.now();
        for drive in &mut self.drives {
            drive.node.clear_faults(step_now);
        }
    }

    fn start_over(&mut self) {
        let step_now = self.clock.now();
        for drive in &mut self.drives {
            drive.node.start_over(step_now);
            (drive.received, drive.measured) = (None, None);
        }
        self.clock.forget_other_master();
    }

    fn other_master(&self) -> Option<CanId> {
        self.clock.other_master()
    }

    fn explain(&self, error_code: u32) -> String {
        fault::explain(error_code, true)
    }
}

/// The frame that two drives share, when it is due and one of them works. The other's part repeats what that
/// drive was last sent; while that is unknown, nothing is sent, because a receiving drive would follow it.
fn push_shared(first: &mut Drive, second: &mut Drive, due: bool, out: &mut FrameBatch) {
    let works = [&*first, &*second].map(|drive| drive.control.is_some());
    let joints = [(works[0], first.joint), (works[1], second.joint)];
    let at_work = joints.iter().filter(|(works, _)| *works);
    let joints = at_work.fold(JointSet::EMPTY, |all, (_, joint)| all.union(JointSet::of(*joint)));
    if let (Some(a), Some(b)) = (first.node.commanded(), second.node.commanded())
        && due
        && joints != JointSet::EMPTY
    {
        out.push_setpoints(encode_pair(first.node_id, [a, b]), joints);
    }
}

impl Drive {
    /// Controlword and target in one frame.
    fn push_own(&mut self, cycle: BringUpCycle, target: Target, is_due: bool, out: &mut FrameBatch) {
        let before = self.control;
        let setpoint = self.node.setpoint(cycle, target);
        self.control = setpoint.map(|setpoint| setpoint.control);
        let urgent = cycle.drive_target == DriveTarget::TorqueOff || self.control != before;
        if let Some(setpoint) = setpoint
            && (is_due || urgent)
        {
            // None before it follows, and none in the cycle in which it does not any more.
            let follows = self.node.state() == DriveState::Enabled;
            let per_mille =
                self.torque.filter(|_| follows).map_or(0, |torque| torque.per_mille(target.torque_nm));
            let frame = self.rpdo(setpoint, per_mille);
            out.push_setpoints(frame, JointSet::of(self.joint));
        }
    }

    fn rpdo(&self, setpoint: DriveSetpoint, per_mille: i16) -> CanFrame {
        let DriveSetpoint { control, target_counts } = setpoint;
        if self.torque.is_some_and(|torque| torque.settings.offset) {
            encode_rpdo_with_torque(self.node_id, control, target_counts, per_mille)
        } else {
            encode_rpdo(self.node_id, control, target_counts)
        }
    }

    fn measures(&self) -> bool {
        self.torque.is_some_and(|torque| torque.settings.actual)
    }

    /// At the joint; NaN where it is not known.
    fn torque_nm(&self) -> f64 {
        let measured = self.torque.zip(self.measured);
        measured.map_or(f64::NAN, |(torque, per_mille)| torque.nm(per_mille))
    }

    /// The controlword of a drive whose target comes in a shared frame. True when the drive gets anything new: then
    /// the target goes with it, so that a drive is never energised with an old one.
    fn push_control(
        &mut self,
        cycle: BringUpCycle,
        target: Target,
        repeats: bool,
        out: &mut FrameBatch,
    ) -> bool {
        let before = self.control;
        self.control = self.node.setpoint(cycle, target).map(|setpoint| setpoint.control);
        let urgent = cycle.drive_target == DriveTarget::TorqueOff || self.control != before;
        if let Some(control) = self.control
            && (repeats || urgent)
        {
            out.push(encode_control(self.node_id, control));
        }
        urgent
    }

    fn position_rad(&self) -> f64 {
        self.node.position().map_or(f64::NAN, |counts| rad_from_counts(&self.scale, counts))
    }

    fn target(&self, commands: &[JointCommand; MAX_JOINTS], near_rad: f64) -> Target {
        let command = commands.get(self.joint);
        let position_rad = command.map_or(f64::NAN, |command| command.position_rad);
        let torque_nm = command.map_or(0.0, |command| command.torque_nm);
        let counts = position_rad.is_finite().then(|| counts_from_rad(&self.scale, position_rad));
        // False for a position that is not known.
        let near = (position_rad - self.position_rad()).abs() <= near_rad;
        Target { counts, near, torque_nm }
    }
}
