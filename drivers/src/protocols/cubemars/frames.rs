//! Frames of `CubeMars` (T-Motor) AK motors in MIT mode, firmware of the second generation: 11-bit identifiers.
//!
//! The protocol has four requests: enter motor mode, leave it, "here is zero", and the packed command. Each is answered
//! with a feedback; nothing else is. There is no request that only asks for the state ("enter" is what the manual names
//! for it), no register, and nothing in a feedback says whether the motor carries torque. Firmware before the second
//! generation answers with six bytes, without temperature and error.
//!
//! Source: `CubeMars`, "AK Series Module Product Manual" (44 pages, with AK80-8), section 5.3.
use crate::codec::mit::{self, MitRanges, MitState};
use crate::frame::{CanFrame, CanId};

/// Requests of one byte, recognised by seven 0xFF before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Special {
    /// Enter motor mode: energised.
    Enter = 0xFC,
    /// Leave motor mode.
    Exit = 0xFD,
    /// Here is zero. The motor does not answer for about a second.
    SetZero = 0xFE,
}

impl Special {
    fn from_byte(byte: u8) -> Option<Self> {
        [Self::Enter, Self::Exit, Self::SetZero].into_iter().find(|special| *special as u8 == byte)
    }
}

/// What a motor is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// A special request.
    Special(Special),
    /// A command, still packed: its meaning hangs on the motor's ranges.
    Mit([u8; 8]),
}

/// The bytes of a standard classic data frame with its identifier: the motors have no FD.
fn classic(frame: &CanFrame) -> Option<(u16, &[u8])> {
    Some((frame.id().as_standard_data().filter(|_| !frame.is_fd())?, frame.data()))
}

impl Request {
    /// It holds a setpoint.
    #[must_use]
    pub const fn is_setpoint(self) -> bool {
        matches!(self, Self::Mit(_))
    }

    /// The frame to motor `node_id`.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn encode(self, node_id: u8) -> CanFrame {
        let bytes = match self {
            Self::Special(special) => [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, special as u8],
            Self::Mit(bytes) => mit::unlike_special(bytes),
        };
        CanFrame::classic(CanId::standard(u16::from(node_id)), &bytes)
    }

    /// What a frame asks of motor `node_id`; `None` when it is not for it. Where the motor answers under the identifier at
    /// which it is asked, its feedback looks like a request: see [`Self::is_to`].
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8) -> Option<Self> {
        let (_, data) = classic(frame).filter(|(id, _)| *id == u16::from(node_id))?;
        let bytes = <[u8; 8]>::try_from(data).ok()?;
        Some(match bytes {
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] => {
                Special::from_byte(last).map_or(Self::Mit(bytes), Self::Special)
            }
            _ => Self::Mit(bytes),
        })
    }

    /// True when a frame speaks to motor `node_id` as a master does, and is not its own feedback. A command with a position
    /// within 1/256 of the range can be taken for a feedback where both have one identifier, and is then not seen.
    #[must_use]
    pub fn is_to(frame: &CanFrame, node_id: u8, feedback_id: u16) -> bool {
        Self::decode(frame, node_id).is_some() && Feedback::decode(frame, node_id, feedback_id).is_none()
    }
}

/// What a motor says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feedback {
    /// Angle, velocity and torque, packed.
    pub state: [u8; 5],
    /// Temperature plus 40 degrees Celsius, and error; none from old firmware.
    pub health: Option<[u8; 2]>,
}

impl Feedback {
    /// As values.
    #[must_use]
    pub fn values(&self, ranges: &MitRanges) -> MitState {
        MitState::decode(self.state, ranges)
    }
    /// Its error; 0 for none.
    #[must_use]
    pub const fn error(&self) -> u8 {
        match self.health {
            Some([_, error]) => error,
            None => 0,
        }
    }

    /// The frame of motor `node_id`.
    #[must_use]
    pub fn encode(&self, node_id: u8, feedback_id: u16) -> CanFrame {
        let [a, b, c, d, e] = self.state;
        let id = CanId::standard(feedback_id);
        match self.health {
            Some([temperature, error]) => {
                CanFrame::classic(id, &[node_id, a, b, c, d, e, temperature, error])
            }
            None => CanFrame::classic(id, &[node_id, a, b, c, d, e]),
        }
    }

    /// What a frame says, when it is motor `node_id`'s under its feedback identifier.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8, feedback_id: u16) -> Option<Self> {
        let (_, data) = classic(frame).filter(|(id, _)| *id == feedback_id)?;
        match *data {
            [node, a, b, c, d, e] if node == node_id => Some(Self { state: [a, b, c, d, e], health: None }),
            [node, a, b, c, d, e, temperature, error] if node == node_id => {
                Some(Self { state: [a, b, c, d, e], health: Some([temperature, error]) })
            }
            _ => None,
        }
    }
}

/// What the error says.
#[must_use]
pub const fn error_words(error: u8) -> &'static str {
    match error {
        0 => "no error",
        1 => "its winding is too hot; let it cool down",
        2 => "over-current; check for a blocked joint and a short circuit",
        3 => "over-voltage; check the supply and what brakes into it",
        4 => "under-voltage; check the supply",
        5 => "its encoder failed; check its calibration in the maker's tool",
        // The manuals differ: V1 names unbalanced phase currents, later ones the power stage.
        6 => {
            "its power stage is too hot, or its phase currents are unbalanced; let it cool down, then check the phases"
        }
        7 => "stall; check for a blocked joint",
        _ => "an error that its manual does not list",
    }
}
