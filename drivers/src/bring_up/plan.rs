//! The configuration of a CSP drive as a list of SDO steps.
use crate::bring_up::scale::ExpectedScale;
use crate::codec::canopen::{
    COB_PDO_STEP, COB_RPDO1, COB_TPDO1, MASTER_NODE, PDO_DISABLED, PDO_NO_RTR, PdoEntry,
};
use crate::codec::object::{self, Address};
use crate::codec::sdo::SdoBytes;
use crate::codec::sdo_client::SdoJob;
use crate::codec::setpoint_frames::shared_cob_id;
use taustream_arm::Reaction;

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
/// Transmission type: every SYNC.
const EVERY_SYNC: u8 = 1;

/// What a value that was read must satisfy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// Nothing: the answer proves that the object is there.
    Present,
    /// The low half is 402.
    Profile402,
    /// Bit 7 is set.
    OffersCsp,
    /// The drive is not energised.
    NotEnergised,
    /// The value is 8; asked again until it is.
    BecomesCsp,
    /// It is the position.
    Position,
    /// It agrees with the settings' scale, direction or range.
    Scale,
    /// The bits of the mask are those of the value.
    Equals {
        /// What this master would have written.
        value: u32,
        /// The bits that count.
        mask: u32,
    },
}

/// One step: a transfer and what its answer means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The transfer.
    pub job: SdoJob,
    /// For a read: what the value must satisfy.
    pub check: Check,
    /// Width of the object that is read, in bytes.
    pub width: usize,
    /// A drive without the object is taken too.
    pub optional: bool,
}

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
    /// How the settings say that it counts.
    pub scale: ExpectedScale,
}

impl NodePlan {
    /// All steps between boot-up and NMT start.
    #[must_use]
    pub fn steps(&self) -> Vec<Step> {
        let mut steps = Steps(Vec::with_capacity(64));
        self.identify(&mut steps);
        self.supervise(&mut steps);
        let rpdos = self.receive_pdos(&mut steps);
        let tpdo1 = Pdo { number: 0, cob_id: cob_id(object::TPDO_COMMUNICATION, COB_TPDO1, self.node) };
        steps.pdo(object::TPDO_COMMUNICATION, tpdo1, self.feedback_every, &TPDO1_ENTRIES);
        for number in 1..4 {
            if number >= rpdos {
                steps.no_pdo(object::RPDO_COMMUNICATION, COB_RPDO1, self.node, number);
            }
            steps.no_pdo(object::TPDO_COMMUNICATION, COB_TPDO1, self.node, number);
        }
        steps.write(object::MODE, SdoBytes::from_i8(object::MODE_CSP));
        steps.read(object::MODE_DISPLAY, 1, Check::BecomesCsp);
        // Before the first RPDO the target must already be where the drive stands.
        steps.read(object::POSITION_ACTUAL, 4, Check::Position);
        steps.0
    }

    /// Configures the RPDOs; how many there are.
    fn receive_pdos(&self, steps: &mut Steps) -> u16 {
        let communication = object::RPDO_COMMUNICATION;
        let rpdo1 = Pdo { number: 0, cob_id: cob_id(communication, COB_RPDO1, self.node) };
        match self.target {
            TargetPdo::Own => {
                steps.pdo(communication, rpdo1, EVERY_SYNC, &[CONTROLWORD, TARGET]);
                1
            }
            TargetPdo::Shared { first_node, second } => {
                let shared = Pdo { number: 1, cob_id: shared_cob_id(first_node).raw() };
                let entries = if second { [SKIPPED, TARGET] } else { [TARGET, SKIPPED] };
                steps.pdo(communication, rpdo1, EVERY_SYNC, &[CONTROLWORD]);
                steps.pdo(communication, shared, EVERY_SYNC, &entries);
                2
            }
        }
    }

    /// All reads that tell whether an energised drive has the configuration of this plan: every object that
    /// [`Self::steps`] writes must hold what is written last, and the drive must be in its mode.
    #[must_use]
    pub fn verification(&self) -> Vec<Step> {
        let mut reads: Vec<Step> = Vec::with_capacity(64);
        for step in self.steps() {
            let read = match (step.job, step.check) {
                (SdoJob::Write(address, bytes), _) => Step {
                    job: SdoJob::Read(address),
                    check: Check::Equals {
                        value: bytes.as_u32(),
                        mask: significant(address, bytes.as_u32()),
                    },
                    width: bytes.as_slice().len(),
                    optional: step.optional,
                },
                (SdoJob::Read(_), Check::BecomesCsp) => {
                    let value = u32::from(object::MODE_CSP.cast_unsigned());
                    Step { check: Check::Equals { value, mask: u32::MAX }, ..step }
                }
                (SdoJob::Read(_), Check::Profile402 | Check::Scale) => step,
                (SdoJob::Read(_), _) => continue,
            };
            match reads.iter_mut().find(|other| other.job == read.job) {
                Some(earlier) => *earlier = read,
                None => reads.push(read),
            }
        }
        reads
    }

    fn identify(&self, steps: &mut Steps) {
        steps.read(object::DEVICE_TYPE, 4, Check::Profile402);
        steps.read(object::VENDOR_ID, 4, Check::Present);
        steps.read(object::SUPPORTED_MODES, 4, Check::OffersCsp);
        steps.read(object::STATUSWORD, 2, Check::NotEnergised);
        for address in self.scale.addresses() {
            steps.read_optional(address, 4, Check::Scale);
        }
    }

    fn supervise(&self, steps: &mut Steps) {
        let lost_master = match self.reaction {
            Reaction::Hold | Reaction::Ramp => ON_LOST_MASTER_QUICK_STOP,
            Reaction::Limp => ON_LOST_MASTER_TORQUE_OFF,
        };
        let consumer = u32::from(MASTER_NODE) << 16 | u32::from(self.heartbeat_lost_ms);
        steps.write(object::PRODUCER_HEARTBEAT_MS, SdoBytes::from_u16(HEARTBEAT_MS));
        steps.write(object::CONSUMER_HEARTBEAT, SdoBytes::from_u32(consumer));
        steps.write(object::ABORT_CONNECTION_OPTION, SdoBytes::from_i16(lost_master));
        steps.write(object::INTERPOLATION_VALUE, SdoBytes::from_u8(self.interpolation.0));
        steps.write(object::INTERPOLATION_EXPONENT, SdoBytes::from_i8(self.interpolation.1));
        steps.write_optional(object::SYNC_PERIOD_US, SdoBytes::from_u32(self.period_us));
        match self.reaction {
            // A drive that cannot be configured to hold would drop a joint that may not fall: it is refused.
            Reaction::Hold => {
                steps.write(object::QUICK_STOP_OPTION, SdoBytes::from_i16(QUICK_STOP_THEN_HOLD));
            }
            Reaction::Ramp | Reaction::Limp => {
                steps.write_optional(object::QUICK_STOP_OPTION, SdoBytes::from_i16(QUICK_STOP_THEN_OFF));
            }
        }
    }
}

const CONTROLWORD: PdoEntry = PdoEntry::new(object::CONTROLWORD, 16);
const TARGET: PdoEntry = PdoEntry::new(object::TARGET_POSITION, 32);
/// The part of another drive: a dummy entry of type UNSIGNED32.
const SKIPPED: PdoEntry = PdoEntry::new(object::DUMMY_U32, 32);
const TPDO1_ENTRIES: [PdoEntry; 2] =
    [PdoEntry::new(object::STATUSWORD, 16), PdoEntry::new(object::POSITION_ACTUAL, 32)];

/// A PDO by its number, from 0, and its COB-ID.
#[derive(Clone, Copy)]
struct Pdo {
    number: u16,
    cob_id: u32,
}

struct Steps(Vec<Step>);

impl Steps {
    fn read(&mut self, address: Address, width: usize, check: Check) {
        self.0.push(Step { job: SdoJob::Read(address), check, width, optional: false });
    }
    fn read_optional(&mut self, address: Address, width: usize, check: Check) {
        self.0.push(Step { job: SdoJob::Read(address), check, width, optional: true });
    }
    fn write(&mut self, address: Address, bytes: SdoBytes) {
        self.0.push(Step {
            job: SdoJob::Write(address, bytes),
            check: Check::Present,
            width: 0,
            optional: false,
        });
    }
    fn write_optional(&mut self, address: Address, bytes: SdoBytes) {
        self.0.push(Step {
            job: SdoJob::Write(address, bytes),
            check: Check::Present,
            width: 0,
            optional: true,
        });
    }

    /// The prescribed order: switch the PDO off, type, empty the mapping, entries, count, switch it on.
    fn pdo(&mut self, first: u16, pdo: Pdo, kind: u8, entries: &[PdoEntry]) {
        let communication = first + pdo.number;
        let mapping = communication + (object::RPDO_MAPPING - object::RPDO_COMMUNICATION);
        let record = Address::new(communication, object::PDO_COB_ID);
        self.write(record, SdoBytes::from_u32(pdo.cob_id | PDO_DISABLED));
        self.write(Address::new(communication, object::PDO_TYPE), SdoBytes::from_u8(kind));
        self.write(Address::new(mapping, 0), SdoBytes::from_u8(0));
        let mut count = 0;
        for entry in entries {
            count += 1;
            self.write(Address::new(mapping, count), SdoBytes::from_u32(entry.encode()));
        }
        self.write(Address::new(mapping, 0), SdoBytes::from_u8(count));
        self.write(record, SdoBytes::from_u32(pdo.cob_id));
    }

    /// Drives need not have this PDO at all.
    fn no_pdo(&mut self, communication: u16, base: u16, node: u8, number: u16) {
        let cob_id = cob_id(communication, base + number * COB_PDO_STEP, node);
        let record = Address::new(communication + number, object::PDO_COB_ID);
        self.write_optional(record, SdoBytes::from_u32(cob_id | PDO_DISABLED));
    }
}

/// Bits of an object that a drive gives back as they were written: of an identifier's parameter not the remote request
/// bit, which some drop, and nothing but "off" of a PDO that is off.
fn significant(address: Address, value: u32) -> u32 {
    let communication = (object::RPDO_COMMUNICATION..object::RPDO_MAPPING).contains(&address.index)
        || (object::TPDO_COMMUNICATION..object::TPDO_MAPPING).contains(&address.index);
    if !communication || address.sub != object::PDO_COB_ID {
        u32::MAX
    } else if value & PDO_DISABLED != 0 {
        PDO_DISABLED
    } else {
        !PDO_NO_RTR
    }
}

/// Remote requests are switched off for TPDOs; the bit is reserved in RPDOs.
fn cob_id(communication: u16, base: u16, node: u8) -> u32 {
    let cob_id = u32::from(base) + u32::from(node);
    if communication >= object::TPDO_COMMUNICATION { cob_id | PDO_NO_RTR } else { cob_id }
}
