//! The objects of the CiA 301 and CiA 402 dictionaries that a CSP drive needs, by name.
//!
//! Widths and access rights are the simulator's and the bring-up's business; here stand only addresses.
//! Source: CiA 301 section 7.5 and CiA 402-2.

/// Where an object stands: 16-bit index and 8-bit subindex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub: u8,
}

impl Address {
    /// An address.
    #[must_use]
    pub const fn new(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }
    /// `index << 8 | sub`, as [`crate::ServoStatus::refused_object`] holds it.
    #[must_use]
    pub const fn packed(self) -> u32 {
        (self.index as u32) << 8 | self.sub as u32
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "0x{:04X}:{:02X}", self.index, self.sub)
    }
}

macro_rules! objects {
    ($($(#[$doc:meta])* $name:ident = $index:literal : $sub:literal;)*) => {
        $($(#[$doc])* pub const $name: Address = Address::new($index, $sub);)*
    };
}

objects! {
    /// Data type UNSIGNED32: in the mapping of an RPDO, four bytes that are skipped.
    DUMMY_U32 = 0x0007:0;
    /// Device type, u32: profile number in the low half.
    DEVICE_TYPE = 0x1000:0;
    /// Error register, u8.
    ERROR_REGISTER = 0x1001:0;
    /// Number of entries of the error history, u8; writing 0 clears it.
    ERROR_HISTORY = 0x1003:0;
    /// COB-ID of SYNC, u32.
    SYNC_COB_ID = 0x1005:0;
    /// SYNC period, u32, microseconds.
    SYNC_PERIOD_US = 0x1006:0;
    /// Synchronous window, u32, microseconds.
    SYNC_WINDOW_US = 0x1007:0;
    /// Device name, string: longer than four bytes, so read by segments.
    DEVICE_NAME = 0x1008:0;
    /// Store all parameters, u32.
    STORE_PARAMETERS = 0x1010:1;
    /// COB-ID of EMCY, u32.
    EMCY_COB_ID = 0x1014:0;
    /// First consumer heartbeat, u32: `node << 16 | milliseconds`.
    CONSUMER_HEARTBEAT = 0x1016:1;
    /// Producer heartbeat, u16, milliseconds.
    PRODUCER_HEARTBEAT_MS = 0x1017:0;
    /// Number of entries of the identity, u8.
    IDENTITY = 0x1018:0;
    /// Vendor id, u32.
    VENDOR_ID = 0x1018:1;
    /// Product code, u32.
    PRODUCT_CODE = 0x1018:2;
    /// Revision, u32.
    REVISION = 0x1018:3;
    /// Serial number, u32.
    SERIAL_NUMBER = 0x1018:4;
    /// SYNC counter overflow, u8; 0 is SYNC without data.
    SYNC_COUNTER = 0x1019:0;
    /// Reaction to a lost connection, i16.
    ABORT_CONNECTION_OPTION = 0x6007:0;
    /// Newest error code, u16.
    ERROR_CODE = 0x603F:0;
    /// Controlword, u16.
    CONTROLWORD = 0x6040:0;
    /// Statusword, u16.
    STATUSWORD = 0x6041:0;
    /// Quick stop option, i16.
    QUICK_STOP_OPTION = 0x605A:0;
    /// Shutdown option, i16.
    SHUTDOWN_OPTION = 0x605B:0;
    /// Disable operation option, i16.
    DISABLE_OPERATION_OPTION = 0x605C:0;
    /// Halt option, i16.
    HALT_OPTION = 0x605D:0;
    /// Fault reaction option, i16.
    FAULT_REACTION_OPTION = 0x605E:0;
    /// Mode of operation, i8.
    MODE = 0x6060:0;
    /// Mode of operation display, i8.
    MODE_DISPLAY = 0x6061:0;
    /// Position demand value, i32, counts: the reference that the drive steers to.
    POSITION_DEMAND = 0x6062:0;
    /// Position actual value, i32, counts.
    POSITION_ACTUAL = 0x6064:0;
    /// Following error window, u32, counts.
    FOLLOWING_ERROR_WINDOW = 0x6065:0;
    /// Following error time-out, u16, milliseconds.
    FOLLOWING_ERROR_TIMEOUT_MS = 0x6066:0;
    /// Velocity actual value, i32.
    VELOCITY_ACTUAL = 0x606C:0;
    /// Rated torque of the motor, u32, mNm.
    RATED_TORQUE = 0x6076:0;
    /// Torque actual value, i16, 0.1 % of the rated torque.
    TORQUE_ACTUAL = 0x6077:0;
    /// Target position, i32, counts.
    TARGET_POSITION = 0x607A:0;
    /// Home offset, i32, counts.
    HOME_OFFSET = 0x607C:0;
    /// Software position limit, least, i32, counts.
    SOFT_LIMIT_MIN = 0x607D:1;
    /// Software position limit, greatest, i32, counts.
    SOFT_LIMIT_MAX = 0x607D:2;
    /// Position range limit, least, i32, counts: the position wraps there.
    POSITION_RANGE_MIN = 0x607B:1;
    /// Position range limit, greatest, i32, counts.
    POSITION_RANGE_MAX = 0x607B:2;
    /// Polarity, u8: bit 7 turns the direction of positions round, bit 6 that of velocities.
    POLARITY = 0x607E:0;
    /// Max profile velocity, u32.
    MAX_PROFILE_VELOCITY = 0x607F:0;
    /// Max motor speed, u32, revolutions of the motor a minute.
    MAX_MOTOR_SPEED = 0x6080:0;
    /// Profile acceleration, u32.
    PROFILE_ACCELERATION = 0x6083:0;
    /// Profile deceleration, u32.
    PROFILE_DECELERATION = 0x6084:0;
    /// Quick stop deceleration, u32.
    QUICK_STOP_DECELERATION = 0x6085:0;
    /// Position encoder resolution, increments, u32.
    ENCODER_INCREMENTS = 0x608F:1;
    /// Position encoder resolution, in so many motor revolutions, u32.
    ENCODER_REVOLUTIONS = 0x608F:2;
    /// Gear ratio, motor revolutions, u32.
    GEAR_MOTOR_REVOLUTIONS = 0x6091:1;
    /// Gear ratio, in so many shaft revolutions, u32.
    GEAR_SHAFT_REVOLUTIONS = 0x6091:2;
    /// Feed constant, position units, u32.
    FEED = 0x6092:1;
    /// Feed constant, in so many shaft revolutions, u32.
    FEED_SHAFT_REVOLUTIONS = 0x6092:2;
    /// Position factor, increments, u32.
    FACTOR_INCREMENTS = 0x6093:1;
    /// Position factor, in so many position units, u32.
    FACTOR_UNITS = 0x6093:2;
    /// Position offset, i32, counts.
    POSITION_OFFSET = 0x60B0:0;
    /// Velocity offset, i32.
    VELOCITY_OFFSET = 0x60B1:0;
    /// Torque offset, i16, 0.1 % of the rated torque.
    TORQUE_OFFSET = 0x60B2:0;
    /// Homing method, i8.
    HOMING_METHOD = 0x6098:0;
    /// Homing speed towards the switch, u32.
    HOMING_SWITCH_SPEED = 0x6099:1;
    /// Homing speed towards the zero, u32.
    HOMING_ZERO_SPEED = 0x6099:2;
    /// Homing acceleration, u32.
    HOMING_ACCELERATION = 0x609A:0;
    /// Interpolation data, i32, counts: the target position of interpolated position mode.
    INTERPOLATION_DATA = 0x60C1:1;
    /// Interpolation period, value, u8.
    INTERPOLATION_VALUE = 0x60C2:1;
    /// Interpolation period, power of ten of a second, i8.
    INTERPOLATION_EXPONENT = 0x60C2:2;
    /// Max acceleration, u32.
    MAX_ACCELERATION = 0x60C5:0;
    /// Max deceleration, u32.
    MAX_DECELERATION = 0x60C6:0;
    /// Following error, i32, counts.
    FOLLOWING_ERROR = 0x60F4:0;
    /// Digital inputs, u32: see [`super::digital_inputs`].
    DIGITAL_INPUTS = 0x60FD:0;
    /// Digital outputs, u32.
    OUTPUTS = 0x60FE:1;
    /// Which of them a master works, u32.
    OUTPUT_MASK = 0x60FE:2;
    /// Supported modes, u32; bit `mode - 1`.
    SUPPORTED_MODES = 0x6502:0;
}

/// Index of the first RPDO communication record; the next PDOs follow.
pub const RPDO_COMMUNICATION: u16 = 0x1400;
/// Index of the first RPDO mapping record.
pub const RPDO_MAPPING: u16 = 0x1600;
/// Index of the first TPDO communication record.
pub const TPDO_COMMUNICATION: u16 = 0x1800;
/// Index of the first TPDO mapping record.
pub const TPDO_MAPPING: u16 = 0x1A00;
/// Subindex of a PDO's COB-ID, u32.
pub const PDO_COB_ID: u8 = 1;
/// Subindex of a PDO's transmission type, u8.
pub const PDO_TYPE: u8 = 2;
/// Subindex of a TPDO's inhibit time, u16, 100 us.
pub const PDO_INHIBIT: u8 = 3;
/// Subindex of a PDO's event timer, u16, ms.
pub const PDO_EVENT_TIMER: u8 = 5;
/// Subindex of a TPDO's SYNC start value, u8.
pub const PDO_SYNC_START: u8 = 6;

/// Mode of operation of cyclic synchronous position.
pub const MODE_CSP: i8 = 8;
/// Profile number of CiA 402, in the low half of [`DEVICE_TYPE`].
pub const PROFILE_402: u16 = 402;
