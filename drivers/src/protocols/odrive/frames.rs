//! `CANSimple` frames of `ODrive` firmware 0.6, both directions.
//!
//! An identifier is `node << 5 | command`; numbers are little-endian, floats IEEE 754. Angles are turns of the encoder.
//! Decoders take any frame: what is not of this node, too short or of another kind is `None`. Floats are passed on as they
//! came, also those that are no numbers: the table decides what they mean.
//!
//! Source: the maker's protocol page for 0.6 and its DBC (0.6.10), held against an independent encoder by
//! `tests/odrive_suite/golden.rs`.
use crate::frame::{CanFrame, CanId};

/// Bits of a command.
const COMMAND_BITS: u16 = 5;

const VERSION: u16 = 0x00;
const HEARTBEAT: u16 = 0x01;
const ESTOP: u16 = 0x02;
const ERROR: u16 = 0x03;
const RX_SDO: u16 = 0x04;
const TX_SDO: u16 = 0x05;
const AXIS_STATE: u16 = 0x07;
const ESTIMATES: u16 = 0x09;
const CONTROLLER_MODE: u16 = 0x0B;
const INPUT_POSITION: u16 = 0x0C;
const INPUT_VELOCITY: u16 = 0x0D;
const INPUT_TORQUE: u16 = 0x0E;
const REBOOT: u16 = 0x16;
const CLEAR_ERRORS: u16 = 0x18;
const ABSOLUTE_POSITION: u16 = 0x19;

/// Axis state: not energised.
pub const STATE_IDLE: u8 = 1;
/// Axis state: follows its input.
pub const STATE_CLOSED_LOOP: u8 = 8;
/// Control mode: position.
pub const CONTROL_POSITION: u32 = 3;
/// Input mode: the input is the setpoint.
pub const INPUT_PASSTHROUGH: u32 = 1;
/// Active error: its watchdog was not fed.
pub const ERROR_WATCHDOG: u32 = 0x0100_0000;

/// Resolution of the two feed-forward words of a position: 0.001 turns/s and 0.001 Nm, the defaults of the drive.
const FEED_FORWARD: f64 = 1000.0;

/// A message that the drive gives on request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// Hardware and firmware.
    Version,
    /// State and errors.
    Heartbeat,
    /// Errors, and why it disarmed.
    Error,
    /// Position and velocity.
    Estimates,
}

impl Query {
    const ALL: [Self; 4] = [Self::Version, Self::Heartbeat, Self::Error, Self::Estimates];

    const fn command(self) -> u16 {
        match self {
            Self::Version => VERSION,
            Self::Heartbeat => HEARTBEAT,
            Self::Error => ERROR,
            Self::Estimates => ESTIMATES,
        }
    }
}

/// The value of an endpoint: most take four bytes, switches one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndpointValue {
    /// A float or a 32-bit integer.
    Word([u8; 4]),
    /// A switch, or an 8-bit integer.
    Byte(u8),
}

impl EndpointValue {
    /// Its bytes, the unused ones zero.
    #[must_use]
    pub const fn bytes(self) -> [u8; 4] {
        match self {
            Self::Word(bytes) => bytes,
            Self::Byte(byte) => [byte, 0, 0, 0],
        }
    }
}

/// The position setpoint and what is added to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputPosition {
    /// Turns of the encoder.
    pub position_turns: f32,
    /// Feed-forward, 0.001 turns/s.
    pub velocity_mturns_s: i16,
    /// Feed-forward at the motor, 0.001 Nm.
    pub torque_mnm: i16,
}

impl InputPosition {
    /// From SI units at the motor; feed-forward beyond its 16 bits is cut off. `None` for a position that is no number.
    #[must_use]
    pub fn new(position_turns: f64, velocity_turns_s: f64, torque_nm: f64) -> Option<Self> {
        #[expect(clippy::cast_possible_truncation, reason = "the frame has this width")]
        let position_turns = position_turns as f32;
        position_turns.is_finite().then(|| Self {
            position_turns,
            velocity_mturns_s: milli(velocity_turns_s),
            torque_mnm: milli(torque_nm),
        })
    }
}

fn milli(value: f64) -> i16 {
    let scaled = (value * FEED_FORWARD).round().clamp(f64::from(i16::MIN), f64::from(i16::MAX));
    #[expect(clippy::cast_possible_truncation, reason = "clamped; what is no number becomes 0")]
    let scaled = scaled as i16;
    scaled
}

/// A frame to the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// A remote request for a message.
    Request(Query),
    /// Disarm with an error.
    Estop,
    /// Read an endpoint.
    Read(u16),
    /// Write an endpoint.
    Write(u16, EndpointValue),
    /// Request a state of the axis.
    AxisState(u32),
    /// Control mode and input mode.
    ControllerMode(u32, u32),
    /// A setpoint.
    Position(InputPosition),
    /// A velocity, or a torque: never sent here, and known to be somebody's command when seen.
    OtherInput,
    /// Restart; 1 to 3 store, erase and update.
    Reboot(u8),
    /// Clear its errors.
    ClearErrors,
    /// The encoder stands here, in turns, until it restarts.
    AbsolutePosition(f32),
}

impl Command {
    /// The frame for a node.
    #[must_use]
    pub fn encode(self, node_id: u8) -> CanFrame {
        let id = |command: u16| CanId::standard(u16::from(node_id) << COMMAND_BITS | command);
        match self {
            Self::Request(query) => {
                let id = u16::from(node_id) << COMMAND_BITS | query.command();
                CanFrame::classic(CanId::standard_remote(id), &[])
            }
            Self::Estop => CanFrame::classic(id(ESTOP), &[]),
            Self::Read(endpoint) => {
                let [low, high] = endpoint.to_le_bytes();
                CanFrame::classic(id(RX_SDO), &[0, low, high, 0])
            }
            Self::Write(endpoint, value) => {
                let [low, high] = endpoint.to_le_bytes();
                let [a, b, c, d] = value.bytes();
                let bytes = [1, low, high, 0, a, b, c, d];
                let most = match value {
                    EndpointValue::Word(_) => 8,
                    EndpointValue::Byte(_) => 5,
                };
                CanFrame::classic(id(RX_SDO), bytes.get(..most).unwrap_or(&bytes))
            }
            Self::AxisState(state) => CanFrame::classic(id(AXIS_STATE), &state.to_le_bytes()),
            Self::ControllerMode(control, input) => {
                CanFrame::classic(id(CONTROLLER_MODE), &pair(control.to_le_bytes(), input.to_le_bytes()))
            }
            Self::Position(input) => {
                let [a, b] = input.velocity_mturns_s.to_le_bytes();
                let [c, d] = input.torque_mnm.to_le_bytes();
                let position = input.position_turns.to_le_bytes();
                CanFrame::classic(id(INPUT_POSITION), &pair(position, [a, b, c, d]))
            }
            Self::OtherInput => CanFrame::classic(id(INPUT_VELOCITY), &[0; 8]),
            Self::Reboot(action) => CanFrame::classic(id(REBOOT), &[action]),
            Self::ClearErrors => CanFrame::classic(id(CLEAR_ERRORS), &[0]),
            Self::AbsolutePosition(turns) => CanFrame::classic(id(ABSOLUTE_POSITION), &turns.to_le_bytes()),
        }
    }

    /// What a frame commands a node; `None` when it is not for it, is not known or has not the bytes.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8) -> Option<Self> {
        if let Some(id) = frame.id().as_standard_remote() {
            let command = command_of(CanId::standard(id), node_id)?;
            return Query::ALL.into_iter().find(|query| query.command() == command).map(Self::Request);
        }
        let command = command_of(frame.id(), node_id)?;
        let data = frame.data();
        match command {
            // A request without the remote bit is one without data.
            VERSION | HEARTBEAT | ERROR | ESTIMATES if data.is_empty() => {
                Query::ALL.into_iter().find(|query| query.command() == command).map(Self::Request)
            }
            ESTOP => Some(Self::Estop),
            RX_SDO => Self::decode_sdo(data),
            AXIS_STATE => Some(Self::AxisState(u32::from_le_bytes(four(data, 0)?))),
            CONTROLLER_MODE => Some(Self::ControllerMode(
                u32::from_le_bytes(four(data, 0)?),
                u32::from_le_bytes(four(data, 4)?),
            )),
            INPUT_POSITION => {
                let [a, b, c, d] = four(data, 4)?;
                Some(Self::Position(InputPosition {
                    position_turns: f32::from_le_bytes(four(data, 0)?),
                    velocity_mturns_s: i16::from_le_bytes([a, b]),
                    torque_mnm: i16::from_le_bytes([c, d]),
                }))
            }
            INPUT_VELOCITY | INPUT_TORQUE => Some(Self::OtherInput),
            REBOOT => data.first().map(|action| Self::Reboot(*action)),
            CLEAR_ERRORS => Some(Self::ClearErrors),
            ABSOLUTE_POSITION => Some(Self::AbsolutePosition(f32::from_le_bytes(four(data, 0)?))),
            _ => None,
        }
    }

    fn decode_sdo(data: &[u8]) -> Option<Self> {
        let [operation, low, high, _] = four(data, 0)?;
        let endpoint = u16::from_le_bytes([low, high]);
        match (operation, four(data, 4), data.get(4)) {
            (0, _, _) => Some(Self::Read(endpoint)),
            (1, Some(word), _) => Some(Self::Write(endpoint, EndpointValue::Word(word))),
            (1, None, Some(byte)) => Some(Self::Write(endpoint, EndpointValue::Byte(*byte))),
            _ => None,
        }
    }

    /// Whether a frame is one by which a master commands a node: requests and reads are not.
    #[must_use]
    pub fn is_to(frame: &CanFrame, node_id: u8) -> bool {
        match Self::decode(frame, node_id) {
            None | Some(Self::Request(_) | Self::Read(_)) => false,
            Some(
                Self::Estop
                | Self::Write(..)
                | Self::AxisState(_)
                | Self::ControllerMode(..)
                | Self::Position(_)
                | Self::OtherInput
                | Self::Reboot(_)
                | Self::ClearErrors
                | Self::AbsolutePosition(_),
            ) => true,
        }
    }
}

/// What a drive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    /// Version of the protocol.
    pub protocol: u8,
    /// Product line, version and variant of the hardware.
    pub hardware: [u8; 3],
    /// Major, minor and revision of the firmware.
    pub firmware: [u8; 3],
    /// The firmware is not a release.
    pub unreleased: u8,
}

/// A frame of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// What it is.
    Version(Version),
    /// Its state, every so often.
    Heartbeat {
        /// Error bits.
        errors: u32,
        /// State of the axis.
        state: u8,
        /// Result of the newest procedure.
        result: u8,
        /// It has reached the end of its own trajectory.
        done: bool,
    },
    /// Its errors.
    Error {
        /// Active now.
        active: u32,
        /// Those that disarmed it last.
        disarmed: u32,
    },
    /// Where its encoder stands.
    Estimates {
        /// Turns.
        position_turns: f32,
        /// Turns per second.
        velocity_turns_s: f32,
    },
    /// The value of an endpoint; `None` when it confirms a write without one.
    Endpoint(u16, Option<EndpointValue>),
}

impl Message {
    /// The frame of a node.
    #[must_use]
    pub fn encode(self, node_id: u8) -> CanFrame {
        let id = |command: u16| CanId::standard(u16::from(node_id) << COMMAND_BITS | command);
        match self {
            Self::Version(version) => {
                let ([a, b, c], [d, e, f]) = (version.hardware, version.firmware);
                CanFrame::classic(id(VERSION), &[version.protocol, a, b, c, d, e, f, version.unreleased])
            }
            Self::Heartbeat { errors, state, result, done } => CanFrame::classic(
                id(HEARTBEAT),
                &pair(errors.to_le_bytes(), [state, result, u8::from(done), 0]),
            ),
            Self::Error { active, disarmed } => {
                CanFrame::classic(id(ERROR), &pair(active.to_le_bytes(), disarmed.to_le_bytes()))
            }
            Self::Estimates { position_turns, velocity_turns_s } => CanFrame::classic(
                id(ESTIMATES),
                &pair(position_turns.to_le_bytes(), velocity_turns_s.to_le_bytes()),
            ),
            Self::Endpoint(endpoint, value) => {
                let [low, high] = endpoint.to_le_bytes();
                let [a, b, c, d] = value.map_or([0; 4], EndpointValue::bytes);
                let bytes = [0, low, high, 0, a, b, c, d];
                let most = match value {
                    Some(EndpointValue::Word(_)) => 8,
                    Some(EndpointValue::Byte(_)) => 5,
                    None => 4,
                };
                CanFrame::classic(id(TX_SDO), bytes.get(..most).unwrap_or(&bytes))
            }
        }
    }

    /// What a node says in a frame; `None` when it is not of it, is not known or has not the bytes.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8) -> Option<Self> {
        let data = frame.data();
        match command_of(frame.id(), node_id)? {
            VERSION => {
                let [protocol, a, b, c] = four(data, 0)?;
                let [d, e, f, unreleased] = four(data, 4)?;
                let (hardware, firmware) = ([a, b, c], [d, e, f]);
                Some(Self::Version(Version { protocol, hardware, firmware, unreleased }))
            }
            HEARTBEAT => {
                // The maker's own readers take the first seven bytes.
                let [state, result, done] = data.get(4..7)?.try_into().ok()?;
                let errors = u32::from_le_bytes(four(data, 0)?);
                Some(Self::Heartbeat { errors, state, result, done: done & 1 != 0 })
            }
            ERROR => Some(Self::Error {
                active: u32::from_le_bytes(four(data, 0)?),
                disarmed: u32::from_le_bytes(four(data, 4)?),
            }),
            ESTIMATES => Some(Self::Estimates {
                position_turns: f32::from_le_bytes(four(data, 0)?),
                velocity_turns_s: f32::from_le_bytes(four(data, 4)?),
            }),
            TX_SDO => {
                let [_, low, high, _] = four(data, 0)?;
                let byte = data.get(4).copied().map(EndpointValue::Byte);
                let value = four(data, 4).map(EndpointValue::Word).or(byte);
                Some(Self::Endpoint(u16::from_le_bytes([low, high]), value))
            }
            _ => None,
        }
    }
}

/// The command of an 11-bit data identifier that is of a node.
fn command_of(id: CanId, node_id: u8) -> Option<u16> {
    let id = id.as_standard_data()?;
    (id >> COMMAND_BITS == u16::from(node_id)).then_some(id & ((1 << COMMAND_BITS) - 1))
}

fn four(data: &[u8], from: usize) -> Option<[u8; 4]> {
    data.get(from..from + 4)?.try_into().ok()
}

fn pair([a, b, c, d]: [u8; 4], [e, f, g, h]: [u8; 4]) -> [u8; 8] {
    [a, b, c, d, e, f, g, h]
}
