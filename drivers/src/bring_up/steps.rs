//! The steps of a configuration: what is read, what it must say, and what is written because it says something else.
//!
//! Nothing is written that is there already: identifiers and mappings that are right may be fixed in the drive. A group of
//! steps first reads and notes which of its [`Parts`] differ; its writes belong to parts, and those of parts that do not
//! differ are passed over.
use crate::bring_up::fault::BringUpFault;
use crate::codec::canopen::{COB_PDO_STEP, PDO_DISABLED, PDO_NO_RTR, PdoEntry};
use crate::codec::object::{self, Address};
use crate::codec::sdo::SdoBytes;
use crate::codec::sdo_client::{SdoJob, SdoValue};

/// What a value that was read must satisfy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// Nothing: the answer proves that the object is there.
    Present,
    /// The low half is 402.
    Profile402,
    /// The bit of this mode is set.
    Offers(u8),
    /// The drive is not energised.
    NotEnergised,
    /// The value is this mode; asked again until it is.
    Becomes(u8),
    /// The value is looked at, and looked at again when the drive is energised.
    MayBe(u8),
    /// It is the position.
    Position,
    /// It agrees with the settings' scale, direction or range.
    Scale,
    /// The value, of any width, is not below this one.
    AtLeast(u32),
    /// The rated torque is within these, mNm.
    RatedTorque(u32, u32),
    /// The PDO is off, or has this identifier, which is its drive's own.
    OffOrOwn(u32),
    /// The bits of the mask are those of the value.
    Equals {
        /// What this master writes, or would have written.
        value: u32,
        /// The bits that count.
        mask: u32,
    },
    /// The same, but another value is no fault: its part is noted as one that differs.
    Compare {
        /// What this master would write.
        value: u32,
        /// The bits that count.
        mask: u32,
        /// What differs if they are others.
        part: Parts,
        /// The first of its group: nothing is noted yet.
        first: bool,
    },
}

/// Which parts of a group differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Parts(u8);

impl Parts {
    /// None; as a condition: always.
    pub const NONE: Self = Self(0);
    /// The one value of the group.
    pub const VALUE: Self = Self(1);
    /// Identifier of a PDO, and whether it is on.
    pub const COB_ID: Self = Self(2);
    /// Transmission type of a PDO.
    pub const TYPE: Self = Self(4);
    /// Mapping of a PDO.
    pub const MAPPING: Self = Self(8);
    /// Any part of a PDO.
    pub const PDO: Self = Self(2 | 4 | 8);

    /// These and others.
    #[must_use]
    pub const fn with(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }
    /// Whether a step that belongs to `condition` is due while these differ.
    #[must_use]
    pub const fn meets(self, condition: Self) -> bool {
        condition.0 == 0 || self.0 & condition.0 != 0
    }
}

/// Whether a drive is taken that refuses a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// It is not.
    Demanded,
    /// It is when it does not have the object: when it refused to read it too.
    IfThere,
    /// Likewise, and when the object is a PDO's identifier that the drive has fixed to its own: nobody else uses it.
    IfForeign,
    /// It is.
    Free,
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
    /// What a refusal means.
    pub need: Need,
    /// Due only while one of these parts differs.
    pub when: Parts,
    /// For a write: parts that differ once it is done.
    pub marks: Parts,
}

impl Step {
    /// The number in an answer to this read; `None` when it is of another width than the object may have.
    #[must_use]
    pub fn number(&self, value: SdoValue) -> Option<u32> {
        let any_width = matches!(self.check, Check::Scale | Check::AtLeast(_) | Check::RatedTorque(..));
        if any_width { value.as_unsigned_of_any_width() } else { value.as_unsigned(self.width) }
    }

    /// A read, always due, of an object that every drive has.
    #[must_use]
    pub const fn read(address: Address, width: usize, check: Check) -> Self {
        let job = SdoJob::Read(address);
        Self { job, check, width, need: Need::Demanded, when: Parts::NONE, marks: Parts::NONE }
    }
    const fn write(address: Address, bytes: SdoBytes, when: Parts) -> Self {
        let job = SdoJob::Write(address, bytes);
        Self { job, check: Check::Present, width: 0, need: Need::Demanded, when, marks: Parts::NONE }
    }
    const fn needed(self, need: Need) -> Self {
        Self { need, ..self }
    }
    const fn when(self, when: Parts) -> Self {
        Self { when, ..self }
    }

    /// Whether a drive is taken that has refused this step; `there`: it let the object be read.
    #[must_use]
    pub fn may_be_refused(&self, there: Option<u32>) -> bool {
        match self.need {
            Need::Demanded => false,
            Need::IfThere => there.is_none(),
            Need::IfForeign => there.is_none_or(|cob_id| self.is_own(cob_id)),
            Need::Free => true,
        }
    }

    /// Whether the COB-ID that a drive states is the one that this step would switch off.
    #[must_use]
    pub fn is_own(&self, cob_id: u32) -> bool {
        matches!(self.job, SdoJob::Write(_, off) if is_same_identifier(cob_id, off.as_u32()))
    }
}

/// A PDO by its number, from 0, and its COB-ID.
#[derive(Clone, Copy)]
pub(super) struct Pdo {
    pub(super) number: u16,
    pub(super) cob_id: u32,
}

/// Steps in the making.
pub(super) struct Steps(pub(super) Vec<Step>);

impl Steps {
    pub(super) fn read(&mut self, address: Address, width: usize, check: Check) {
        self.0.push(Step::read(address, width, check));
    }
    pub(super) fn read_if_there(&mut self, address: Address, width: usize, check: Check) {
        self.0.push(Step::read(address, width, check).needed(Need::Free));
    }

    /// Makes an object hold a value: read, written when it is another, and read back.
    pub(super) fn set(&mut self, address: Address, bytes: SdoBytes, need: Need) {
        self.compare(address, bytes, Parts::VALUE, true);
        self.0.push(Step::write(address, bytes, Parts::VALUE).needed(need));
        let (value, width) = (bytes.as_u32(), bytes.as_slice().len());
        let back = Step::read(address, width, Check::Equals { value, mask: u32::MAX });
        // An object that cannot be read at all has confirmed the write, and that is all it can.
        self.0.push(back.when(Parts::VALUE).needed(Need::Free));
    }

    /// Makes these bits of an object those of a value, like [`Self::set`].
    pub(super) fn set_bits(&mut self, address: Address, value: u32, mask: u32, need: Need) {
        let part = Parts::VALUE;
        self.0.push(Step::read(address, 4, Check::Compare { value, mask, part, first: true }));
        self.0.push(Step::write(address, SdoBytes::from_u32(value), part).needed(need));
        self.0.push(Step::read(address, 4, Check::Equals { value, mask }).when(part).needed(Need::Free));
    }

    /// The same without reading it back.
    pub(super) fn set_unproven(&mut self, address: Address, bytes: SdoBytes) {
        self.compare(address, bytes, Parts::VALUE, true);
        self.0.push(Step::write(address, bytes, Parts::VALUE));
    }

    fn compare(&mut self, address: Address, bytes: SdoBytes, part: Parts, first: bool) {
        let value = bytes.as_u32();
        let check = Check::Compare { value, mask: significant(address, value), part, first };
        self.0.push(Step::read(address, bytes.as_slice().len(), check));
    }

    /// In the prescribed order, as far as anything differs: switch the PDO off, type, empty the mapping, entries, count,
    /// switch it on.
    pub(super) fn pdo(&mut self, first: u16, pdo: Pdo, kind: u8, entries: &[PdoEntry]) {
        let communication = first + pdo.number;
        let mapping = communication + (object::RPDO_MAPPING - object::RPDO_COMMUNICATION);
        let record = Address::new(communication, object::PDO_COB_ID);
        let kind_at = Address::new(communication, object::PDO_TYPE);
        let (cob_id, kind) = (SdoBytes::from_u32(pdo.cob_id), SdoBytes::from_u8(kind));
        let numbered = || (1_u8..).zip(entries);
        let count = SdoBytes::from_u8(numbered().last().map_or(0, |(number, _)| number));

        self.compare(record, cob_id, Parts::COB_ID, true);
        self.compare(kind_at, kind, Parts::TYPE, false);
        self.compare(Address::new(mapping, 0), count, Parts::MAPPING, false);
        for (number, entry) in numbered() {
            let bytes = SdoBytes::from_u32(entry.encode());
            self.compare(Address::new(mapping, number), bytes, Parts::MAPPING, false);
        }

        let off = Step::write(record, SdoBytes::from_u32(pdo.cob_id | PDO_DISABLED), Parts::PDO);
        // One with a fixed identifier stays on; what of it cannot be changed then refuses by itself.
        self.0.push(Step { need: Need::Free, marks: Parts::COB_ID, ..off });
        self.0.push(Step::write(kind_at, kind, Parts::TYPE));
        self.0.push(Step::write(Address::new(mapping, 0), SdoBytes::from_u8(0), Parts::MAPPING));
        for (number, entry) in numbered() {
            let bytes = SdoBytes::from_u32(entry.encode());
            self.0.push(Step::write(Address::new(mapping, number), bytes, Parts::MAPPING));
        }
        self.0.push(Step::write(Address::new(mapping, 0), count, Parts::MAPPING));
        self.0.push(Step::write(record, cob_id, Parts::COB_ID));
    }

    /// Drives need not have this PDO at all, and one that cannot be switched off does no harm under its drive's own identifier.
    pub(super) fn no_pdo(&mut self, communication: u16, base: u16, node: u8, number: u16) {
        let cob_id = cob_id(communication, base + number * COB_PDO_STEP, node);
        let record = Address::new(communication + number, object::PDO_COB_ID);
        let off = SdoBytes::from_u32(cob_id | PDO_DISABLED);
        self.compare(record, off, Parts::VALUE, true);
        self.0.push(Step::write(record, off, Parts::VALUE).needed(Need::IfForeign));
    }
}

/// The reads that tell whether an energised drive has the configuration of these steps: every object that they write must
/// hold what is written last.
pub(super) fn verification(steps: &[Step]) -> Vec<Step> {
    let mut reads: Vec<Step> = Vec::with_capacity(steps.len());
    for step in steps {
        let read = match (step.job, step.check) {
            (SdoJob::Write(address, bytes), _) => {
                let value = bytes.as_u32();
                let check = if step.need == Need::IfForeign {
                    Check::OffOrOwn(value)
                } else {
                    Check::Equals { value, mask: significant(address, value) }
                };
                let need = if step.need == Need::Demanded { Need::Demanded } else { Need::Free };
                Step::read(address, bytes.as_slice().len(), check).needed(need)
            }
            (SdoJob::Read(_), Check::Becomes(mode) | Check::MayBe(mode)) => {
                let value = u32::from(mode);
                Step { check: Check::Equals { value, mask: u32::MAX }, ..*step }
            }
            (
                SdoJob::Read(_),
                Check::Profile402 | Check::Scale | Check::AtLeast(_) | Check::RatedTorque(..),
            ) => *step,
            (SdoJob::Read(_), _) => continue,
        };
        match reads.iter_mut().find(|other| other.job == read.job) {
            Some(earlier) => *earlier = read,
            None => reads.push(read),
        }
    }
    reads
}

/// Whether a value passes a check by itself; those that need to know more pass here.
pub(super) fn passes(check: Check, number: u32) -> Result<(), BringUpFault> {
    let fault = match check {
        Check::Profile402 if number & 0xFFFF != u32::from(object::PROFILE_402) => BringUpFault::NotCia402,
        Check::Offers(mode) if number >> mode.saturating_sub(1) & 1 == 0 => {
            if mode == object::MODE_CSP.cast_unsigned() { BringUpFault::NoCsp } else { BringUpFault::NoMode }
        }
        Check::Equals { value, mask } if number & mask != value & mask => BringUpFault::NotTaken,
        Check::AtLeast(least) if number < least => BringUpFault::LimitTooLow,
        Check::RatedTorque(low, high) if !(low..=high).contains(&number) => BringUpFault::RatedTorqueDiffers,
        Check::OffOrOwn(off) if number & PDO_DISABLED == 0 && !is_same_identifier(number, off) => {
            BringUpFault::NotTaken
        }
        Check::Profile402
        | Check::Offers(_)
        | Check::Equals { .. }
        | Check::OffOrOwn(_)
        | Check::AtLeast(_)
        | Check::RatedTorque(..)
        | Check::Present
        | Check::NotEnergised
        | Check::Becomes(_)
        | Check::MayBe(_)
        | Check::Position
        | Check::Scale
        | Check::Compare { .. } => return Ok(()),
    };
    Err(fault)
}

/// Identifier and format of two COB-IDs agree, whether their PDOs are on or off, and whatever they say of remote requests.
fn is_same_identifier(a: u32, b: u32) -> bool {
    (a ^ b) & !(PDO_DISABLED | PDO_NO_RTR) == 0
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
pub(super) fn cob_id(communication: u16, base: u16, node: u8) -> u32 {
    let cob_id = u32::from(base) + u32::from(node);
    if communication >= object::TPDO_COMMUNICATION { cob_id | PDO_NO_RTR } else { cob_id }
}
