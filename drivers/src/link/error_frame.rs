//! What a CAN controller tells of itself: the error frames of linux/can/error.h.
//!
//! The cycle asks only for what changes its course (bus-off, restarted, error-passive) and keeps the rest as numbers;
//! [`ErrorFrame::sentence`] and [`ErrorFrame::remedy`] make words of them elsewhere. Every bit pattern has an answer:
//! anybody with a raw socket can inject error frames.
use crate::frame::CanFrame;
use socketcan::{CanError, CanErrorFrame};

/// Class bits that can ever be set: those below the flags of an id.
const CLASSES: u32 = 0x1FFF_FFFF;
/// `CAN_ERR_TX_TIMEOUT`: the driver gave up on a frame.
const TX_TIMEOUT: u32 = 0x001;
/// `CAN_ERR_CRTL`: state of the controller, in data byte 1.
const CONTROLLER: u32 = 0x004;
/// `CAN_ERR_PROT`: protocol violation, in data bytes 2 and 3.
const PROTOCOL: u32 = 0x008;
/// `CAN_ERR_TRX`: transceiver, in data byte 4.
const TRANSCEIVER: u32 = 0x010;
/// `CAN_ERR_ACK`: no node acknowledged.
const NO_ACK: u32 = 0x020;
/// `CAN_ERR_BUSOFF`.
const BUS_OFF: u32 = 0x040;
/// `CAN_ERR_RESTARTED`.
const RESTARTED: u32 = 0x100;
/// `CAN_ERR_CNT`: error counters, in data bytes 6 and 7.
const COUNTERS: u32 = 0x200;
/// `CAN_ERR_CRTL_RX_OVERFLOW` and `CAN_ERR_CRTL_TX_OVERFLOW`.
const OVERFLOW: u8 = 0x01 | 0x02;
/// `CAN_ERR_CRTL_RX_WARNING` and `CAN_ERR_CRTL_TX_WARNING`.
const WARNING: u8 = 0x04 | 0x08;
/// `CAN_ERR_CRTL_RX_PASSIVE` and `CAN_ERR_CRTL_TX_PASSIVE`.
const PASSIVE: u8 = 0x10 | 0x20;
/// `CAN_ERR_CRTL_ACTIVE`.
const ACTIVE: u8 = 0x40;

/// Classes that a link takes. Lost arbitration is everyday life on a bus; bare bus errors (0x080, with berr-reporting on)
/// flood and say nothing: those with a reason carry one of the classes here as well.
pub const ERROR_CLASSES: u32 =
    TX_TIMEOUT | CONTROLLER | PROTOCOL | TRANSCEIVER | NO_ACK | BUS_OFF | RESTARTED | COUNTERS;

/// One error frame, as numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorFrame {
    /// Class bits.
    pub class: u32,
    /// Their details; bytes that the frame did not have are 0.
    pub data: [u8; 8],
}

impl ErrorFrame {
    /// The error that a frame tells; `None` for frames of a bus.
    ///
    /// Real time: a copy.
    #[must_use]
    pub fn of(frame: &CanFrame) -> Option<Self> {
        if !frame.id().is_error() {
            return None;
        }
        let mut data = [0; 8];
        for (slot, byte) in data.iter_mut().zip(frame.data()) {
            *slot = *byte;
        }
        Some(Self { class: frame.id().raw() & CLASSES, data })
    }

    /// The controller has left the bus.
    #[must_use]
    pub const fn is_bus_off(&self) -> bool {
        self.class & BUS_OFF != 0
    }
    /// The controller came back to the bus.
    #[must_use]
    pub const fn is_restarted(&self) -> bool {
        self.class & RESTARTED != 0
    }
    /// The controller became error-passive.
    #[must_use]
    pub const fn is_passive(&self) -> bool {
        self.class & CONTROLLER != 0 && self.controller() & PASSIVE != 0
    }
    /// The controller is better than error-passive again.
    #[must_use]
    pub const fn is_recovered(&self) -> bool {
        self.class & CONTROLLER != 0
            && self.controller() & PASSIVE == 0
            && self.controller() & (ACTIVE | WARNING) != 0
    }

    const fn controller(&self) -> u8 {
        let [_, controller, ..] = self.data;
        controller
    }

    /// Everything that the frame tells, in one line. Not for real time.
    #[must_use]
    pub fn sentence(&self) -> String {
        // Eight bytes always fit; a frame that did not would still show its bits.
        CanErrorFrame::new_error(self.class, &self.data).map_or_else(
            |_| format!("error frame of class {:#x}", self.class),
            |frame| CanError::from(frame).to_string(),
        )
    }

    /// What to look at, by the gravest thing that the frame tells. Not for real time.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        let has = |class: u32| self.class & class != 0;
        if has(BUS_OFF | RESTARTED) || self.is_passive() {
            "see cable, termination at both ends, and that every node has the same bit rate"
        } else if has(NO_ACK) {
            "no node acknowledges: are the drives powered and connected, at this bit rate?"
        } else if has(TX_TIMEOUT) {
            "the adapter does not send: unplug it and plug it in again, or reload its driver"
        } else if has(TRANSCEIVER) {
            "see the wires CAN high and CAN low, and the transceiver's supply"
        } else if has(CONTROLLER) && self.controller() & OVERFLOW != 0 {
            "the host reads or the bus sends too slowly: see the bus load (`taustream check`) and the adapter"
        } else if self.is_recovered() && self.controller() & WARNING == 0 {
            "nothing: the controller has recovered"
        } else {
            "see cable, termination and bit rate: the error counters rise"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::CanId;

    fn frame(class: u32, data: &[u8]) -> ErrorFrame {
        ErrorFrame::of(&CanFrame::classic(CanId::from_raw(0x2000_0000 | class), data)).unwrap()
    }

    /// Goal: every class that links take, and every state of a controller, has its own words.
    #[test]
    fn error_frame_of_every_enabled_class_has_text() {
        let cases: [(u32, [u8; 8], &[&str]); 15] = [
            (TX_TIMEOUT, [0; 8], &["transmission timeout"]),
            (CONTROLLER, [0, 0x01, 0, 0, 0, 0, 0, 0], &["receive buffer overflow"]),
            (CONTROLLER, [0, 0x02, 0, 0, 0, 0, 0, 0], &["transmit buffer overflow"]),
            (CONTROLLER, [0, 0x04, 0, 0, 0, 0, 0, 0], &["rx warning"]),
            (CONTROLLER, [0, 0x08, 0, 0, 0, 0, 0, 0], &["tx warning"]),
            (CONTROLLER, [0, 0x10, 0, 0, 0, 0, 0, 0], &["rx passive"]),
            (CONTROLLER, [0, 0x20, 0, 0, 0, 0, 0, 0], &["tx passive"]),
            (CONTROLLER, [0, 0x40, 0, 0, 0, 0, 0, 0], &["back to error active"]),
            (PROTOCOL, [0, 0, 0x04, 0x08, 0, 0, 0, 0], &["protocol violation"]),
            (TRANSCEIVER, [0, 0, 0, 0, 0x44, 0, 0, 0], &["CAN High", "CAN Low"]),
            (NO_ACK, [0; 8], &["no ack"]),
            (BUS_OFF, [0; 8], &["bus off"]),
            (RESTARTED, [0; 8], &["restarted"]),
            (COUNTERS, [0, 0, 0, 0, 0, 0, 136, 12], &["tx=136", "rx=12"]),
            (CONTROLLER | COUNTERS, [0, 0x30, 0, 0, 0, 0, 130, 128], &["rx passive", "tx passive", "tx=130"]),
        ];
        let mut classes = 0;
        for (class, data, words) in cases {
            let sentence = frame(class, &data).sentence();
            for word in words {
                assert!(sentence.contains(word), "class {class:#x} {data:?}: no `{word}` in `{sentence}`");
            }
            classes |= class;
        }
        assert_eq!(classes, ERROR_CLASSES, "a class is enabled that no case tells");
    }

    /// Goal: only what the kernel's header calls bus-off, restarted and passive changes the cycle's course.
    #[test]
    fn error_frame_steers_by_bus_off_restarted_and_passive_alone() {
        let steers = |e: ErrorFrame| (e.is_bus_off(), e.is_restarted(), e.is_passive(), e.is_recovered());
        assert_eq!(steers(frame(BUS_OFF, &[0xFF; 8])), (true, false, false, false));
        assert_eq!(steers(frame(RESTARTED, &[0; 8])), (false, true, false, false));
        assert_eq!(steers(frame(CONTROLLER, &[0, 0x20])), (false, false, true, false));
        assert_eq!(steers(frame(CONTROLLER, &[0, 0x08])), (false, false, false, true));
        assert_eq!(steers(frame(CONTROLLER, &[0, 0x40])), (false, false, false, true));
        // Byte 1 means nothing without the controller class, and overflow is no state.
        assert_eq!(steers(frame(NO_ACK, &[0, 0x70])), (false, false, false, false));
        assert_eq!(steers(frame(CONTROLLER, &[0, 0x03])), (false, false, false, false));
        assert_eq!(ErrorFrame::of(&CanFrame::classic(CanId::standard(0x040), &[0; 8])), None);
    }

    /// Goal: any injected frame has a message and a remedy; nothing panics and nothing is cut wrong.
    #[test]
    fn error_frame_of_any_bits_has_words() {
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        for round in 0..20_000_u32 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let id = (state >> 32) as u32 | 0x2000_0000;
            let data = state.to_le_bytes();
            let frame = CanFrame::classic(CanId::from_raw(id), &data[..(round % 9) as usize]);
            let error = ErrorFrame::of(&frame).unwrap();
            assert!(!error.sentence().is_empty() && !error.remedy().is_empty(), "round {round}: {frame:?}");
            assert!(!error.sentence().contains('\n'));
        }
    }
}
