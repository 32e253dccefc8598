//! What is done about a CiA 402 drive's own limits of speed and acceleration, as the table `[servo.profile_limits]` states it.
//!
//! Whether a drive applies them to the setpoints of cyclic synchronous position differs between drives. One that does, and
//! whose limit is below what is commanded, lags behind or cuts the motion off. So none may be below the stop limits of its joint,
//! which no setpoint exceeds (0x6083 and 0x6084, ramps of the drive's own profiles: below its motion limits). In which unit a drive takes them must be stated, because no object states it reliably.
//!
//! Source: CiA 402-2, "Profile position mode": 0x607F, 0x6080, 0x6083 to 0x6085, 0x60C5, 0x60C6.
use crate::reader::Table;
use crate::velocity_unit::{self, VelocityUnit};

/// What is done about them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitUse {
    /// They are read, and the drive is refused where one is below the joint's limits.
    Compare,
    /// They are set to the joint's limits, with a margin where they cut off, and read back.
    Write,
}

impl LimitUse {
    /// Every choice.
    pub const ALL: [Self; 2] = [Self::Compare, Self::Write];

    /// Its word in settings files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Compare => "compare",
            Self::Write => "write",
        }
    }
}

/// The limits of one drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProfileLimits {
    /// What is done about them.
    pub apply: LimitUse,
    /// Unit of the drive's speeds and accelerations, except 0x6080.
    pub velocity_unit: VelocityUnit,
}

impl ProfileLimits {
    /// Keys and values of the table.
    #[must_use]
    pub fn entries(self) -> serde_json::Value {
        serde_json::json!({ "apply": self.apply.word(), "velocity_unit": self.velocity_unit.word() })
    }

    /// What `check` says of them.
    #[must_use]
    pub fn sentence(self) -> String {
        match self.apply {
            LimitUse::Compare => "limits of speed and acceleration compared with the joint's".into(),
            LimitUse::Write => "limits of speed and acceleration written from the joint's".into(),
        }
    }
}

/// Reads the table; the outer `None` only after a fault.
pub(crate) fn read(table: &mut Table<'_>) -> Option<Option<ProfileLimits>> {
    const KEY: &str = "profile_limits";
    let Some(mut limits) = table.table_if_there(KEY) else { return (!table.had(KEY)).then_some(None) };
    let apply = read_use(&mut limits);
    let velocity_unit = velocity_unit::read(&mut limits);
    limits.done();
    Some(Some(ProfileLimits { apply: apply?, velocity_unit: velocity_unit? }))
}

fn read_use(table: &mut Table<'_>) -> Option<LimitUse> {
    const KEY: &str = "apply";
    const EXPECTED: &str =
        "\"compare\" (the drive is refused where one is below the joint's) or \"write\" (set and read back)";
    table.choice(KEY, EXPECTED, (&LimitUse::ALL, LimitUse::word))
}
