//! What a CiA 402 drive lacks or does in its own time, as the settings of its servo state it.
//!
//! The profile demands little beside the state machine, and drives differ in the rest. What a drive lacks is never skipped
//! in silence: bring-up refuses it by object, and its owner states here that the drive has it solved by other means.
use crate::document::Value;
use crate::profile_limits::{self, ProfileLimits};
use crate::reader::{Bounds, Table};

/// Object of a CiA 402 drive that is configured or read during bring-up, and that drives may lack or not let write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum OptionalObject {
    /// Communication cycle period.
    SyncPeriod = 0x1006,
    /// Producer heartbeat time.
    ProducerHeartbeat = 0x1017,
    /// Abort connection option: the reaction to a lost master.
    AbortConnection = 0x6007,
    /// Quick stop option: how a quick stop ends.
    QuickStopOption = 0x605A,
    /// Rated torque of the motor.
    RatedTorque = 0x6076,
    /// Home offset.
    HomeOffset = 0x607C,
    /// Max profile velocity: beyond it the drive cuts speeds off.
    MaxProfileVelocity = 0x607F,
    /// Max motor speed, in revolutions of the motor a minute.
    MaxMotorSpeed = 0x6080,
    /// Profile acceleration.
    ProfileAcceleration = 0x6083,
    /// Profile deceleration.
    ProfileDeceleration = 0x6084,
    /// Quick stop deceleration.
    QuickStopDeceleration = 0x6085,
    /// Homing method.
    HomingMethod = 0x6098,
    /// Homing speeds.
    HomingSpeeds = 0x6099,
    /// Homing acceleration.
    HomingAcceleration = 0x609A,
    /// Interpolation time period.
    InterpolationPeriod = 0x60C2,
    /// Max acceleration.
    MaxAcceleration = 0x60C5,
    /// Max deceleration.
    MaxDeceleration = 0x60C6,
    /// Supported drive modes.
    SupportedModes = 0x6502,
}

impl OptionalObject {
    /// Every object.
    pub const ALL: [Self; 18] = [
        Self::SyncPeriod,
        Self::ProducerHeartbeat,
        Self::AbortConnection,
        Self::QuickStopOption,
        Self::RatedTorque,
        Self::HomeOffset,
        Self::MaxProfileVelocity,
        Self::MaxMotorSpeed,
        Self::ProfileAcceleration,
        Self::ProfileDeceleration,
        Self::QuickStopDeceleration,
        Self::HomingMethod,
        Self::HomingSpeeds,
        Self::HomingAcceleration,
        Self::InterpolationPeriod,
        Self::MaxAcceleration,
        Self::MaxDeceleration,
        Self::SupportedModes,
    ];

    /// Its index in the object dictionary.
    #[must_use]
    pub const fn index(self) -> u16 {
        self as u16
    }
    /// The object at an index.
    #[must_use]
    pub fn from_index(index: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|object| object.index() == index)
    }
    /// Its name in CiA 301 or CiA 402.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SyncPeriod => "communication cycle period",
            Self::ProducerHeartbeat => "producer heartbeat time",
            Self::AbortConnection => "abort connection option",
            Self::QuickStopOption => "quick stop option",
            Self::RatedTorque => "rated torque",
            Self::HomeOffset => "home offset",
            Self::MaxProfileVelocity => "max profile velocity",
            Self::MaxMotorSpeed => "max motor speed",
            Self::ProfileAcceleration => "profile acceleration",
            Self::ProfileDeceleration => "profile deceleration",
            Self::QuickStopDeceleration => "quick stop deceleration",
            Self::MaxAcceleration => "max acceleration",
            Self::MaxDeceleration => "max deceleration",
            Self::HomingMethod => "homing method",
            Self::HomingSpeeds => "homing speeds",
            Self::HomingAcceleration => "homing acceleration",
            Self::InterpolationPeriod => "interpolation time period",
            Self::SupportedModes => "supported drive modes",
        }
    }
    /// It limits speeds or accelerations, or is the unit of torques: looked at where `[servo.profile_limits]` or `[servo.torque]` is
    /// stated, and not otherwise.
    #[must_use]
    pub const fn is_of_a_table(self) -> bool {
        matches!(
            self,
            Self::RatedTorque
                | Self::MaxProfileVelocity
                | Self::MaxMotorSpeed
                | Self::ProfileAcceleration
                | Self::ProfileDeceleration
                | Self::QuickStopDeceleration
                | Self::MaxAcceleration
                | Self::MaxDeceleration
        )
    }
    /// It is needed for homing alone, and not at bring-up.
    #[must_use]
    pub const fn is_of_homing(self) -> bool {
        matches!(self, Self::HomeOffset | Self::HomingMethod | Self::HomingSpeeds | Self::HomingAcceleration)
    }
    /// What is left to the drive without it.
    #[must_use]
    pub const fn without(self) -> &'static str {
        match self {
            Self::SyncPeriod => "the drive does not know the period of SYNC",
            Self::ProducerHeartbeat => "only missing feedback shows that the drive is gone",
            Self::AbortConnection => "what the drive does when its master is lost is the drive's own setting",
            Self::QuickStopOption => "whether the drive holds after a quick stop is the drive's own setting",
            Self::RatedTorque => "that torques are in thousandths of rated_torque_nm is its owner's word",
            Self::HomeOffset => "the position that homing gives the home position is the drive's own setting",
            Self::MaxProfileVelocity | Self::MaxMotorSpeed => {
                "whether the drive cuts speeds off is the drive's own setting"
            }
            Self::ProfileAcceleration
            | Self::ProfileDeceleration
            | Self::MaxAcceleration
            | Self::MaxDeceleration => "whether the drive cuts accelerations off is the drive's own setting",
            Self::QuickStopDeceleration => {
                "how far the joint goes on in a quick stop is the drive's own setting"
            }
            Self::HomingMethod => "how the drive homes is the drive's own setting",
            Self::HomingSpeeds => "how fast the drive homes is the drive's own setting",
            Self::HomingAcceleration => "how the drive accelerates in homing is the drive's own setting",
            Self::InterpolationPeriod => "the drive does not know the time between two setpoints",
            Self::SupportedModes => "only its modes display (0x6061) confirms the mode",
        }
    }
    const fn bit(self) -> u32 {
        match self {
            Self::SyncPeriod => 1,
            Self::ProducerHeartbeat => 2,
            Self::AbortConnection => 4,
            Self::QuickStopOption => 8,
            Self::InterpolationPeriod => 16,
            Self::SupportedModes => 32,
            Self::HomeOffset => 64,
            Self::HomingMethod => 128,
            Self::HomingSpeeds => 256,
            Self::HomingAcceleration => 512,
            Self::MaxProfileVelocity => 1 << 10,
            Self::MaxMotorSpeed => 1 << 11,
            Self::ProfileAcceleration => 1 << 12,
            Self::ProfileDeceleration => 1 << 13,
            Self::QuickStopDeceleration => 1 << 14,
            Self::MaxAcceleration => 1 << 15,
            Self::MaxDeceleration => 1 << 16,
            Self::RatedTorque => 1 << 17,
        }
    }
}

/// Objects that are neither read nor written, because the drive does not have them or they are fixed in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AbsentObjects(u32);

impl AbsentObjects {
    /// Every object is there.
    pub const NONE: Self = Self(0);

    /// The same, with one more object.
    #[must_use]
    pub const fn with(self, object: OptionalObject) -> Self {
        Self(self.0 | object.bit())
    }
    /// Whether an object is listed.
    #[must_use]
    pub const fn holds(self, object: OptionalObject) -> bool {
        self.0 & object.bit() != 0
    }
    /// The objects, lowest index first.
    pub fn objects(self) -> impl Iterator<Item = OptionalObject> {
        OptionalObject::ALL.into_iter().filter(move |object| self.holds(*object))
    }
}

/// How a drive finds out that its master is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MasterSupervision {
    /// It watches the master's heartbeat (0x1016).
    #[default]
    Heartbeat,
    /// It watches the setpoints by the event timer of their RPDO (0x1400:05).
    SetpointTimer,
    /// By means of its own that are set in the drive; neither written nor read.
    Drive,
}

impl MasterSupervision {
    /// Every choice.
    pub const ALL: [Self; 3] = [Self::Heartbeat, Self::SetpointTimer, Self::Drive];

    /// Its word in settings files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Heartbeat => "heartbeat",
            Self::SetpointTimer => "setpoint-timer",
            Self::Drive => "drive",
        }
    }
}

/// In which of its modes a drive follows setpoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PositionMode {
    /// Cyclic synchronous position, mode 8.
    #[default]
    Cyclic,
    /// Interpolated position with linear interpolation, mode 7, for drives that do not have the former.
    Interpolated,
}

impl PositionMode {
    /// Every choice.
    pub const ALL: [Self; 2] = [Self::Cyclic, Self::Interpolated];

    /// Its word in settings files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Cyclic => "cyclic",
            Self::Interpolated => "interpolated",
        }
    }
    /// Its number in 0x6060 and 0x6061.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Self::Cyclic => 8,
            Self::Interpolated => 7,
        }
    }
}

/// Limits that are written into a drive and read back; none of them without their key.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WrittenLimits {
    /// Following error window (0x6065), rad of the joint.
    pub following_window_rad: Option<f64>,
    /// How long the window may be left (0x6066), ms.
    pub following_timeout_ms: Option<u16>,
    /// The joint's range becomes the software position limit (0x607D), which is compared with it otherwise.
    pub soft_limits: bool,
}

/// What a drive lacks or does in its own time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveFeatures {
    /// Objects that it does not have, or that cannot be written.
    pub absent: AbsentObjects,
    /// How it finds out that its master is gone.
    pub master_supervision: MasterSupervision,
    /// Longest time from a reset of its communication to its boot-up message.
    pub boot_timeout_s: f64,
    /// Its modes display (0x6061) follows only in operation enabled.
    pub late_mode_display: bool,
    /// The mode in which it follows setpoints.
    pub position_mode: PositionMode,
    /// Limits that are written into it.
    pub limits: WrittenLimits,
    /// Its digital inputs (0x60FD) are read: limit switches, home switch, interlock.
    pub digital_inputs: bool,
    /// Its own limits of speed and acceleration; `None`: they are not looked at.
    pub profile_limits: Option<ProfileLimits>,
}

impl Default for DriveFeatures {
    fn default() -> Self {
        Self {
            absent: AbsentObjects::NONE,
            master_supervision: MasterSupervision::Heartbeat,
            boot_timeout_s: BOOT_TIMEOUT_S,
            late_mode_display: false,
            position_mode: PositionMode::Cyclic,
            limits: WrittenLimits::default(),
            digital_inputs: false,
            profile_limits: None,
        }
    }
}

impl DriveFeatures {
    /// What `check` says of them: nothing of a drive as the profiles describe it.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let mut all: Vec<String> = self
            .absent
            .objects()
            .map(|object| {
                format!("0x{:04X} ({}) NOT SET: {}", object.index(), object.name(), object.without())
            })
            .collect();
        match self.master_supervision {
            MasterSupervision::Heartbeat => {}
            MasterSupervision::SetpointTimer => {
                all.push("0x1016 (consumer heartbeat) NOT SET: the drive watches its setpoints by 0x1400:05".into());
            }
            MasterSupervision::Drive => all.push(
                "0x1016 (consumer heartbeat) NOT SET: that the drive stops without its master is the drive's own setting"
                    .into(),
            ),
        }
        if self.late_mode_display {
            all.push("0x6061 (modes display) is looked at only in operation enabled".into());
        }
        if self.position_mode == PositionMode::Interpolated {
            all.push("interpolated position (mode 7)".into());
        }
        if let Some(window_rad) = self.limits.following_window_rad {
            all.push(format!("following error window {window_rad} rad written"));
        }
        if let Some(timeout_ms) = self.limits.following_timeout_ms {
            all.push(format!("following error time-out {timeout_ms} ms written"));
        }
        if self.limits.soft_limits {
            all.push("software position limit written".into());
        }
        if self.digital_inputs {
            all.push("digital inputs (0x60FD) read: a limit switch stops the arm".into());
        }
        all.extend(self.profile_limits.map(ProfileLimits::sentence));
        if self.boot_timeout_s > BOOT_TIMEOUT_S {
            all.push(format!("boot-up within {} s", self.boot_timeout_s));
        }
        all
    }
}

const BOOT_TIMEOUT_S: f64 = 5.0;
const BOOT_TIMEOUTS_S: Bounds = Bounds::within(0.1, 300.0, "s");
const WINDOW_RAD: Bounds = Bounds::above(0.0, 10.0, "rad");

/// Reads the keys of [`DriveFeatures`]; `None` only after a fault.
pub(crate) fn read(table: &mut Table<'_>) -> Option<DriveFeatures> {
    let absent = read_absent(table);
    let master_supervision = read_supervision(table);
    let boot_timeout_s = table.number_or("boot_timeout_s", BOOT_TIMEOUT_S, &BOOT_TIMEOUTS_S);
    let late_mode_display = table.flag_or("late_mode_display", false);
    let position_mode = read_position_mode(table);
    let limits = read_limits(table);
    let digital_inputs = table.flag_or("digital_inputs", false);
    let profile_limits = profile_limits::read(table);
    Some(DriveFeatures {
        absent: absent?,
        master_supervision: master_supervision?,
        boot_timeout_s: boot_timeout_s?,
        late_mode_display: late_mode_display?,
        position_mode: position_mode?,
        limits: limits?,
        digital_inputs: digital_inputs?,
        profile_limits: profile_limits?,
    })
}

fn read_limits(table: &mut Table<'_>) -> Option<WrittenLimits> {
    // Not a number stands for none here: no window can be that.
    let window_rad = table.number_or("following_window_rad", f64::NAN, &WINDOW_RAD);
    let timeout_ms = table.integer_if_there("following_timeout_ms", 0, 65_535);
    let soft_limits = table.flag_or("write_soft_limits", false);
    Some(WrittenLimits {
        following_window_rad: window_rad.map(|window_rad| Some(window_rad).filter(|rad| !rad.is_nan()))?,
        following_timeout_ms: timeout_ms?.and_then(|timeout_ms| u16::try_from(timeout_ms).ok()),
        soft_limits: soft_limits?,
    })
}

fn read_position_mode(table: &mut Table<'_>) -> Option<PositionMode> {
    const KEY: &str = "position_mode";
    const EXPECTED: &str = "\"cyclic\" (cyclic synchronous position, mode 8) or \"interpolated\" (interpolated position, mode 7)";
    table.choice_or(KEY, EXPECTED, PositionMode::Cyclic, (&PositionMode::ALL, PositionMode::word))
}

fn read_absent(table: &mut Table<'_>) -> Option<AbsentObjects> {
    const KEY: &str = "absent_objects";
    let Some(node) = table.take(KEY) else { return Some(AbsentObjects::NONE) };
    let indices: Vec<String> =
        OptionalObject::ALL.map(|o| format!("0x{:04X} ({})", o.index(), o.name())).into();
    let expected = format!(
        "a list, without repetition, of objects among {}; a drive without 0x1016 (consumer heartbeat) needs \
         master_supervision instead",
        indices.join(", ")
    );
    let Value::List(items) = &node.value else {
        table.fault(KEY, &node.to_string(), &expected);
        return None;
    };
    let mut absent = AbsentObjects::NONE;
    for item in items {
        let index = if let Value::Integer(index) = item.value { u16::try_from(index).ok() } else { None };
        let object = index.and_then(OptionalObject::from_index).filter(|object| !absent.holds(*object));
        let Some(object) = object else {
            table.fault(KEY, &item.to_string(), &expected);
            return None;
        };
        absent = absent.with(object);
    }
    Some(absent)
}

fn read_supervision(table: &mut Table<'_>) -> Option<MasterSupervision> {
    const KEY: &str = "master_supervision";
    const EXPECTED: &str = "\"heartbeat\" (0x1016), \"setpoint-timer\" (the event timer of its RPDO, 0x1400:05) or \"drive\" \
                            (set in the drive)";
    table.choice_or(
        KEY,
        EXPECTED,
        MasterSupervision::Heartbeat,
        (&MasterSupervision::ALL, MasterSupervision::word),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absent_objects_are_distinguished() {
        for object in OptionalObject::ALL {
            let only = AbsentObjects::NONE.with(object);
            let listed: Vec<OptionalObject> = only.objects().collect();
            assert_eq!(listed, [object]);
            assert_eq!(OptionalObject::from_index(object.index()), Some(object));
        }
        assert_eq!(OptionalObject::from_index(0x1016), None);
    }

    #[test]
    fn only_what_departs_from_the_profiles_is_said() {
        assert_eq!(DriveFeatures::default().sentences(), Vec::<String>::new());
        let odd = DriveFeatures {
            absent: AbsentObjects::NONE.with(OptionalObject::AbortConnection),
            master_supervision: MasterSupervision::Drive,
            boot_timeout_s: 20.0,
            late_mode_display: true,
            ..DriveFeatures::default()
        };
        let said = odd.sentences().join("; ");
        for part in ["0x6007 (abort connection option) NOT SET", "0x1016", "0x6061", "20 s"] {
            assert!(said.contains(part), "no {part} in: {said}");
        }
    }
}
