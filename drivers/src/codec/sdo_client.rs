//! The client side of SDO for one node: one transfer at a time, with time-out, repetition and segmented reads.
//!
//! The client is advanced once a cycle and gives at most one frame a cycle. Nothing that a CSP bring-up writes is
//! longer than four bytes, so writes are expedited; reads take whatever way the drive chooses.
//! Source: CiA 301 section 7.2.4.
use crate::codec::error_text::{ABORT_COMMAND, ABORT_TIMEOUT, ABORT_TOGGLE, ABORT_TOO_LONG};
use crate::codec::object::Address;
use crate::codec::sdo::{SdoBytes, SdoRequest, SdoResponse};
use crate::servo::Nanos;

/// How long one answer may take.
pub const SDO_TIMEOUT: Nanos = Nanos(500_000_000);
/// How often a request is sent before the client gives up.
pub const SDO_TRIES: u8 = 3;
/// Longest value that a segmented read takes.
pub const SDO_VALUE_MAX: usize = 64;

/// What is to be done with an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoJob {
    /// Read it.
    Read(Address),
    /// Write it.
    Write(Address, SdoBytes),
}

impl SdoJob {
    /// The object.
    #[must_use]
    pub const fn address(self) -> Address {
        match self {
            Self::Read(address) | Self::Write(address, _) => address,
        }
    }
    fn request(self) -> SdoRequest {
        match self {
            Self::Read(address) => SdoRequest::Read(address),
            Self::Write(address, bytes) => SdoRequest::Write(address, bytes),
        }
    }
}

/// A value that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoValue {
    bytes: [u8; SDO_VALUE_MAX],
    len: usize,
}

impl SdoValue {
    const EMPTY: Self = Self { bytes: [0; SDO_VALUE_MAX], len: 0 };

    /// The bytes, least significant first.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&self.bytes)
    }
    /// The value of an unsigned object of `width` bytes; `None` when the drive sent fewer.
    ///
    /// Of a wider answer the first `width` bytes count: drives that do not state the size send four, and some keep an object
    /// in more bytes than the profile gives it.
    #[must_use]
    pub fn as_unsigned(&self, width: usize) -> Option<u32> {
        if self.len < width || width > 4 {
            return None;
        }
        let mut number = [0; 4];
        for (slot, byte) in number.iter_mut().zip(self.as_slice().iter().take(width)) {
            *slot = *byte;
        }
        Some(u32::from_le_bytes(number))
    }

    /// The value of an unsigned object of one to four bytes, whatever its width.
    #[must_use]
    pub fn as_unsigned_of_any_width(&self) -> Option<u32> {
        self.as_unsigned(self.len).filter(|_| self.len > 0)
    }

    fn append(&mut self, bytes: &[u8]) -> bool {
        let Some(room) = self.bytes.get_mut(self.len..self.len + bytes.len()) else { return false };
        room.copy_from_slice(bytes);
        self.len += bytes.len();
        true
    }
}

/// How a transfer ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoOutcome {
    /// The object was read.
    Value(SdoValue),
    /// The object was written.
    Written,
    /// The drive, or this client, aborted; [`crate::codec::error_text::sdo_abort`] has the sentence.
    Aborted(u32),
    /// No answer to any try.
    TimedOut,
}

#[derive(Clone, Copy, Debug)]
enum TransferState {
    /// A frame is to be sent.
    Ours(SdoRequest),
    /// An answer is awaited.
    Theirs {
        since: Nanos,
    },
    /// Nothing is left to do but to tell the outcome, after this frame.
    Closing(SdoRequest, SdoOutcome),
    Done(SdoOutcome),
}

#[derive(Clone, Copy, Debug)]
struct Transfer {
    job: SdoJob,
    state: TransferState,
    tries: u8,
    /// In a segmented read: the toggle of the segment that is requested.
    toggle: Option<bool>,
    value: SdoValue,
}

/// The client's state for one node.
#[derive(Clone, Debug, Default)]
pub struct SdoClient {
    transfer: Option<Transfer>,
    /// The object that was asked for last, and how many requests for it were not answered yet.
    asked: Option<(Address, u8)>,
    /// Requests of earlier transfers of the same object whose answers may still come. Only an abort could be taken for one
    /// of the transfer that is open.
    stale: u8,
}

impl SdoClient {
    /// True when no transfer is open.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        self.transfer.is_none()
    }

    /// Opens a transfer in place of any that is open: an emergency must not queue behind a read.
    ///
    /// Answers to the replaced one name another object and are ignored.
    /// Real time: no allocation.
    pub fn begin(&mut self, job: SdoJob) {
        let state = TransferState::Ours(job.request());
        let unanswered =
            self.asked.filter(|(asked, _)| *asked == job.address()).map_or(0, |(_, count)| count);
        (self.asked, self.stale) = (Some((job.address(), unanswered)), unanswered);
        self.transfer = Some(Transfer { job, state, tries: 0, toggle: None, value: SdoValue::EMPTY });
    }

    /// The open transfer's job.
    #[must_use]
    pub fn job(&self) -> Option<SdoJob> {
        self.transfer.as_ref().map(|transfer| transfer.job)
    }

    /// Clears the open transfer.
    pub fn cancel(&mut self) {
        self.transfer = None;
    }

    /// The frame to send in this cycle, if any.
    ///
    /// Real time: no allocation.
    pub fn poll(&mut self, now: Nanos) -> Option<SdoRequest> {
        let transfer = self.transfer.as_mut()?;
        if let TransferState::Theirs { since } = transfer.state
            && now.0.saturating_sub(since.0) >= SDO_TIMEOUT.0
        {
            transfer.late();
        }
        match transfer.state {
            TransferState::Ours(request) => {
                // Only initiating requests count as tries: a long value has many segments.
                let initiates = u8::from(transfer.toggle.is_none());
                transfer.tries += initiates;
                if let Some((_, unanswered)) = self.asked.as_mut() {
                    *unanswered = unanswered.saturating_add(initiates);
                }
                transfer.state = TransferState::Theirs { since: now };
                Some(request)
            }
            TransferState::Closing(request, outcome) => {
                transfer.state = TransferState::Done(outcome);
                Some(request)
            }
            TransferState::Theirs { .. } | TransferState::Done(_) => None,
        }
    }

    /// Takes an answer of the node. Answers that do not fit the open transfer change nothing.
    ///
    /// Real time: no allocation.
    pub fn accept(&mut self, response: SdoResponse) {
        if let Some((asked, unanswered)) = self.asked.as_mut()
            && response.address() == Some(*asked)
        {
            *unanswered = unanswered.saturating_sub(1);
            let is_stale = self.stale > 0;
            self.stale = self.stale.saturating_sub(1);
            if is_stale && matches!(response, SdoResponse::Abort(..)) {
                return;
            }
        }
        if let Some(transfer) = self.transfer.as_mut()
            && matches!(transfer.state, TransferState::Theirs { .. })
        {
            transfer.accept(response);
        }
    }

    /// The outcome, once, with its job; the client is idle afterwards.
    pub fn take(&mut self) -> Option<(SdoJob, SdoOutcome)> {
        let Some(Transfer { job, state: TransferState::Done(outcome), .. }) = self.transfer else {
            return None;
        };
        self.transfer = None;
        Some((job, outcome))
    }
}

impl Transfer {
    /// A repetition starts from the beginning: which segment was lost cannot be known.
    fn late(&mut self) {
        if self.tries < SDO_TRIES {
            self.toggle = None;
            self.value = SdoValue::EMPTY;
            self.state = TransferState::Ours(self.job.request());
        } else {
            let abort = SdoRequest::Abort(self.job.address(), ABORT_TIMEOUT);
            self.state = TransferState::Closing(abort, SdoOutcome::TimedOut);
        }
    }

    fn accept(&mut self, response: SdoResponse) {
        let wanted = self.job.address();
        match (response, self.job, self.toggle) {
            (SdoResponse::Abort(address, code), _, _) if address == wanted => {
                self.state = TransferState::Done(SdoOutcome::Aborted(code));
            }
            (SdoResponse::Written(address), SdoJob::Write(..), _) if address == wanted => {
                self.state = TransferState::Done(SdoOutcome::Written);
            }
            (SdoResponse::Value(address, bytes), SdoJob::Read(_), None) if address == wanted => {
                self.value = SdoValue::EMPTY;
                self.value.append(bytes.as_slice());
                self.state = TransferState::Done(SdoOutcome::Value(self.value));
            }
            (SdoResponse::ValueSegmented(address, size), SdoJob::Read(_), None) if address == wanted => {
                if size.is_some_and(|size| usize::try_from(size).is_ok_and(|size| size > SDO_VALUE_MAX)) {
                    self.abandon(ABORT_TOO_LONG);
                } else {
                    self.request_segment(false);
                }
            }
            (SdoResponse::Segment { toggle, bytes, last }, SdoJob::Read(_), Some(requested)) => {
                if toggle != requested {
                    self.abandon(ABORT_TOGGLE);
                } else if !self.value.append(bytes.as_slice()) {
                    self.abandon(ABORT_TOO_LONG);
                } else if last {
                    self.state = TransferState::Done(SdoOutcome::Value(self.value));
                } else if bytes.as_slice().is_empty() {
                    // An empty segment that is not the last would let a drive keep us for ever.
                    self.abandon(ABORT_COMMAND);
                } else {
                    self.request_segment(!requested);
                }
            }
            // Answers to a replaced or repeated request, and to nothing we asked.
            _ => {}
        }
    }

    fn request_segment(&mut self, toggle: bool) {
        self.toggle = Some(toggle);
        self.state = TransferState::Ours(SdoRequest::ReadSegment { toggle });
    }

    fn abandon(&mut self, code: u32) {
        let abort = SdoRequest::Abort(self.job.address(), code);
        self.state = TransferState::Closing(abort, SdoOutcome::Aborted(code));
    }
}
