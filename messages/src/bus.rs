//! What the streamer tells of each bus.
use crate::fault::BusFault;
use iceoryx2::prelude::ZeroCopySend;

/// Most buses of one arm.
pub const BUSES_MAX: usize = 8;

/// One bus in a report. Counts are since the start of the streamer.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct BusReport {
    /// Frames passed to the link.
    pub frames_sent: u64,
    /// Frames refused.
    pub frames_lost: u64,
    /// Frames received, own ones not counted.
    pub frames_received: u64,
    /// Cycles whose frames were not all taken.
    pub cycles_lost: u64,
    /// Error frames of the controller.
    pub error_frames: u64,
    /// What is wrong with it ([`BusFault::code`]); 0 when it is well.
    pub bus_fault: u32,
    /// 1 while nothing is sent on it, from its failure to `clear-fault`.
    pub silent: u32,
    /// Frames passed to the link and not yet seen on the wire.
    pub in_flight: u32,
    /// Class bits of the newest error frame (linux/can/error.h); 0 for none.
    pub error_class: u32,
    /// Its data bytes.
    pub error_data: [u8; 8],
    /// Frames that arrived and were lost because this computer did not read them in time, since the link was opened.
    pub receive_lost: u64,
    /// Frames passed to the link whose echo was lost in this computer, since the link was opened.
    pub echoes_missing: u64,
    /// 1 for a local link: there is no bus, and no cable to look at.
    pub local: u32,
    /// Zero.
    pub reserved: u32,
}

impl BusReport {
    /// What is wrong with it. A code of another release reads as [`BusFault::System`]: never as well.
    #[must_use]
    pub fn bus_fault(&self) -> Option<BusFault> {
        (self.bus_fault != 0).then(|| BusFault::from_code(self.bus_fault).unwrap_or(BusFault::System))
    }
}
