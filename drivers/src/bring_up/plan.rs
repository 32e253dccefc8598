//! The configuration of a CSP drive as a list of SDO steps.
use crate::bring_up::power::Power;
use crate::bring_up::profile_limits::ProfilePlan;
use crate::bring_up::scale::ExpectedScale;
use crate::bring_up::steps::{self, Check, Need, Pdo, Step, Steps, cob_id};
use crate::codec::canopen::{COB_RPDO1, COB_TPDO1, MASTER_NODE, PdoEntry};
use crate::codec::cia402_words::CONTROL_INTERPOLATE;
use crate::codec::object::{self, Address};
use crate::codec::sdo::SdoBytes;
use crate::codec::setpoint_frames::shared_cob_id;
use crate::servo::Nanos;
use taustream_arm::{
    BrakeSettings, DriveFeatures, HomingSettings, MasterSupervision, OptionalObject, PositionMode, Reaction,
    TorqueSettings,
};
use taustream_motion::range::POSITION_TOLERANCE_RAD;

/// Period of the heartbeats that drives send, and that this master sends.
pub use taustream_arm::bus_load::HEARTBEAT_MS;
/// Time without frames after which a node, or the master, counts as lost: three missed heartbeats and some jitter.
pub const HEARTBEAT_LOST_MS: u16 = 350;

/// Reaction to a lost master: torque off at once (object 0x6007).
const ON_LOST_MASTER_TORQUE_OFF: i16 = 2;
/// Reaction to a lost master: quick stop (object 0x6007).
const ON_LOST_MASTER_QUICK_STOP: i16 = 3;
/// Quick stop that ends de-energised (object 0x605A).
const QUICK_STOP_THEN_OFF: i16 = 2;
/// Quick stop that ends holding, energised: for joints that would fall.
const QUICK_STOP_THEN_HOLD: i16 = 6;
/// Share by which rated torques may differ: a data sheet has them rounded.
const RATED_SAME: f64 = 0.01;
/// Transmission type: every SYNC.
const EVERY_SYNC: u8 = 1;

/// Where a node finds its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetPdo {
    /// Behind the controlword in its first RPDO.
    Own,
    /// In the first or second half of a frame that two drives share; the first RPDO holds the controlword alone.
    Shared {
        /// Node whose second RPDO's identifier the frame has.
        first_node: u8,
        /// The second half is this node's.
        second: bool,
    },
}

/// What one node is configured with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodePlan {
    /// Node id.
    pub node: u8,
    /// Period of SYNC.
    pub period_us: u32,
    /// Time between two setpoints of this node, as value and power of ten (object 0x60C2).
    pub interpolation: (u8, i8),
    /// What it is to do when its master is lost.
    pub reaction: Reaction,
    /// Its targets.
    pub target: TargetPdo,
    /// Time without the master's heartbeat after which it counts the master as lost (object 0x1016).
    pub heartbeat_lost_ms: u16,
    /// It answers every so many SYNCs, 1 to 240 (transmission type of its TPDO).
    pub feedback_every: u8,
    /// Time without setpoints after which it counts the master as lost, where it watches them (0x1400:05).
    pub setpoints_lost_ms: u16,
    /// How the settings say that it counts.
    pub scale: ExpectedScale,
    /// What it lacks or does in its own time.
    pub features: DriveFeatures,
    /// Its own limits of speed and acceleration.
    pub profile: Option<ProfilePlan>,
    /// How it finds its zero by itself.
    pub homing: Option<HomingSettings>,
    /// The brake that it does not work by itself.
    pub brake: Option<BrakeSettings>,
    /// Its torques.
    pub torque: Option<TorqueSettings>,
    /// Distance between a command and the measured position up to which they belong together, in counts.
    pub near_counts: u32,
}

impl NodePlan {
    /// All steps between boot-up and NMT start.
    #[must_use]
    pub fn steps(&self) -> Vec<Step> {
        let mut steps = Steps(Vec::with_capacity(128));
        self.identify(&mut steps);
        self.supervise(&mut steps);
        let rpdos = self.receive_pdos(&mut steps);
        let tpdo1 = Pdo { number: 0, cob_id: cob_id(object::TPDO_COMMUNICATION, COB_TPDO1, self.node) };
        let measures = self.torque.is_some_and(|torque| torque.actual);
        let entries = if measures { &TPDO1_ENTRIES[..] } else { &TPDO1_ENTRIES[..2] };
        steps.pdo(object::TPDO_COMMUNICATION, tpdo1, self.feedback_every, entries);
        for number in 1..4 {
            if number >= rpdos {
                steps.no_pdo(object::RPDO_COMMUNICATION, COB_RPDO1, self.node, number);
            }
            steps.no_pdo(object::TPDO_COMMUNICATION, COB_TPDO1, self.node, number);
        }
        // Drives need not let the request be read; what counts is the display.
        let mode = self.features.position_mode.number();
        steps.set_unproven(object::MODE, SdoBytes::from_u8(mode));
        let display = if self.features.late_mode_display { Check::MayBe(mode) } else { Check::Becomes(mode) };
        steps.read(object::MODE_DISPLAY, 1, display);
        // Before the first RPDO the target must already be where the drive stands.
        steps.read(object::POSITION_ACTUAL, 4, Check::Position);
        steps.0
    }

    /// Configures the RPDOs; how many there are.
    fn receive_pdos(&self, steps: &mut Steps) -> u16 {
        let communication = object::RPDO_COMMUNICATION;
        let rpdo1 = Pdo { number: 0, cob_id: cob_id(communication, COB_RPDO1, self.node) };
        let target = PdoEntry::new(self.target_object(), 32);
        match self.target {
            TargetPdo::Own => {
                let carries = self.torque.is_some_and(|torque| torque.offset);
                let entries = [CONTROLWORD, target, TORQUE_OFFSET];
                steps.pdo(communication, rpdo1, EVERY_SYNC, if carries { &entries } else { &entries[..2] });
                self.watch_setpoints(steps, rpdo1);
                1
            }
            TargetPdo::Shared { first_node, second } => {
                let shared = Pdo { number: 1, cob_id: shared_cob_id(first_node).raw() };
                let entries = if second { [SKIPPED, target] } else { [target, SKIPPED] };
                steps.pdo(communication, rpdo1, EVERY_SYNC, &[CONTROLWORD]);
                steps.pdo(communication, shared, EVERY_SYNC, &entries);
                self.watch_setpoints(steps, shared);
                2
            }
        }
    }

    /// The event timer of the RPDO that carries the target.
    fn watch_setpoints(&self, steps: &mut Steps, pdo: Pdo) {
        if self.features.master_supervision == MasterSupervision::SetpointTimer {
            let timer = Address::new(object::RPDO_COMMUNICATION + pdo.number, object::PDO_EVENT_TIMER);
            steps.set(timer, SdoBytes::from_u16(self.setpoints_lost_ms), Need::Demanded);
        }
    }

    /// All reads that tell whether an energised drive has the configuration of this plan: every object that
    /// [`Self::steps`] writes must hold what is written last, and the drive must be in its mode.
    #[must_use]
    pub fn verification(&self) -> Vec<Step> {
        let mut reads = steps::verification(&self.steps());
        // The brake of a drive that holds is released.
        reads.retain(|read| read.job.address() != object::OUTPUTS);
        reads
    }

    /// The object that takes the target.
    #[must_use]
    pub const fn target_object(&self) -> Address {
        match self.features.position_mode {
            PositionMode::Cyclic => object::TARGET_POSITION,
            PositionMode::Interpolated => object::INTERPOLATION_DATA,
        }
    }

    /// The power state machine of such a node, de-energised.
    pub(super) const fn power(&self, step_timeout: Nanos) -> Power {
        let mode_bits = match self.features.position_mode {
            PositionMode::Cyclic => 0,
            PositionMode::Interpolated => CONTROL_INTERPOLATE,
        };
        Power::new(step_timeout, self.feedback_every, mode_bits)
    }

    const fn has(&self, object: OptionalObject) -> bool {
        !self.features.absent.holds(object)
    }

    fn identify(&self, steps: &mut Steps) {
        steps.read(object::DEVICE_TYPE, 4, Check::Profile402);
        steps.read(object::VENDOR_ID, 4, Check::Present);
        if self.has(OptionalObject::SupportedModes) {
            let offers = Check::Offers(self.features.position_mode.number());
            steps.read(object::SUPPORTED_MODES, 4, offers);
        }
        if let Some(torque) = self.torque.filter(|_| self.has(OptionalObject::RatedTorque)) {
            let [low, high] = [1.0 - RATED_SAME, 1.0 + RATED_SAME].map(|share| {
                let exact = (torque.rated_nm * 1000.0 * share).round();
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "bounded where settings are read"
                )]
                let milli_nm = exact as u32;
                milli_nm
            });
            steps.read(object::RATED_TORQUE, 4, Check::RatedTorque(low, high));
        }
        if self.features.digital_inputs {
            steps.read(object::DIGITAL_INPUTS, 4, Check::Present);
        }
        steps.read(object::STATUSWORD, 2, Check::NotEnergised);
        for address in self.scale.addresses() {
            steps.read_if_there(address, 4, Check::Scale);
        }
    }

    fn supervise(&self, steps: &mut Steps) {
        let lost_master = match self.reaction {
            Reaction::Hold | Reaction::Ramp => ON_LOST_MASTER_QUICK_STOP,
            Reaction::Limp => ON_LOST_MASTER_TORQUE_OFF,
        };
        // A drive that cannot be configured to hold would drop a joint that may not fall: it is refused.
        let (quick_stop, quick_stop_need) = match self.reaction {
            Reaction::Hold => (QUICK_STOP_THEN_HOLD, Need::Demanded),
            Reaction::Ramp | Reaction::Limp => (QUICK_STOP_THEN_OFF, Need::IfThere),
        };
        if self.has(OptionalObject::ProducerHeartbeat) {
            steps.set(object::PRODUCER_HEARTBEAT_MS, SdoBytes::from_u16(HEARTBEAT_MS), Need::Demanded);
        }
        if self.features.master_supervision == MasterSupervision::Heartbeat {
            let consumer = u32::from(MASTER_NODE) << 16 | u32::from(self.heartbeat_lost_ms);
            steps.set(object::CONSUMER_HEARTBEAT, SdoBytes::from_u32(consumer), Need::Demanded);
        }
        if self.has(OptionalObject::AbortConnection) {
            let option = SdoBytes::from_i16(lost_master);
            steps.set(object::ABORT_CONNECTION_OPTION, option, Need::Demanded);
        }
        if self.has(OptionalObject::InterpolationPeriod) {
            let (value, exponent) = self.interpolation;
            steps.set(object::INTERPOLATION_VALUE, SdoBytes::from_u8(value), Need::Demanded);
            steps.set(object::INTERPOLATION_EXPONENT, SdoBytes::from_i8(exponent), Need::Demanded);
        }
        if self.has(OptionalObject::SyncPeriod) {
            steps.set(object::SYNC_PERIOD_US, SdoBytes::from_u32(self.period_us), Need::IfThere);
        }
        if self.has(OptionalObject::QuickStopOption) {
            steps.set(object::QUICK_STOP_OPTION, SdoBytes::from_i16(quick_stop), quick_stop_need);
        }
        if let Some(brake) = &self.brake {
            steps.set_bits(object::OUTPUTS, brake.output(false), brake.mask(), Need::Demanded);
            steps.set(object::OUTPUT_MASK, SdoBytes::from_u32(brake.mask()), Need::IfThere);
        }
        self.limit(steps);
    }

    /// Limits that the settings want in the drive.
    fn limit(&self, steps: &mut Steps) {
        let limits = self.features.limits;
        if let Some(window_rad) = limits.following_window_rad {
            let window = SdoBytes::from_u32(self.scale.counts_of(window_rad));
            steps.set(object::FOLLOWING_ERROR_WINDOW, window, Need::Demanded);
        }
        if let Some(timeout_ms) = limits.following_timeout_ms {
            let timeout = SdoBytes::from_u16(timeout_ms);
            steps.set(object::FOLLOWING_ERROR_TIMEOUT_MS, timeout, Need::Demanded);
        }
        if limits.soft_limits {
            // What counts as at the limit everywhere may be held, so the drive must not cut it off.
            let beyond = self.scale.counts_of(POSITION_TOLERANCE_RAD).cast_signed();
            let [low, high] = self.scale.range_counts;
            let low = SdoBytes::from_i32(low.saturating_sub(beyond));
            steps.set(object::SOFT_LIMIT_MIN, low, Need::Demanded);
            let high = SdoBytes::from_i32(high.saturating_add(beyond));
            steps.set(object::SOFT_LIMIT_MAX, high, Need::Demanded);
        }
        if let Some(profile) = &self.profile {
            profile.steps(self.features.absent, steps);
        }
    }
}

const CONTROLWORD: PdoEntry = PdoEntry::new(object::CONTROLWORD, 16);
/// The part of another drive: a dummy entry of type UNSIGNED32.
const SKIPPED: PdoEntry = PdoEntry::new(object::DUMMY_U32, 32);
const TORQUE_OFFSET: PdoEntry = PdoEntry::new(object::TORQUE_OFFSET, 16);
/// The torque in those of drives that measure it.
const TPDO1_ENTRIES: [PdoEntry; 3] = [
    PdoEntry::new(object::STATUSWORD, 16),
    PdoEntry::new(object::POSITION_ACTUAL, 32),
    PdoEntry::new(object::TORQUE_ACTUAL, 16),
];
