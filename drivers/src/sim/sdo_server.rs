//! The SDO server of a simulated drive: expedited and segmented transfers both ways, one at a time.
//!
//! No writable object of the drive is longer than four bytes, but a client may write short ones by segments too.
//! Source: CiA 301 section 7.2.4.
use super::dictionary::{AbortCode, Bytes};
use crate::codec::canopen::{COB_SDO_REQUEST, node_of};
use crate::codec::{Address, SdoBytes, SdoRequest, SdoResponse, SegmentBytes, error_text};
use crate::frame::CanFrame;
use crate::servo::Nanos;

/// How long a segmented transfer may pause before the server gives it up.
pub(super) const TIMEOUT_S: f64 = 1.0;

/// What the server reads from and writes to.
pub(crate) trait Objects {
    /// The value of an object.
    fn read(&mut self, address: Address) -> Result<Bytes, AbortCode>;
    /// Writes an object; `sized` when the client stated the length.
    fn write(&mut self, address: Address, bytes: &[u8], sized: bool) -> Result<(), AbortCode>;
}

/// A read that continues over several frames.
#[derive(Clone, Debug)]
struct Upload {
    address: Address,
    value: Bytes,
    sent: usize,
    toggle: bool,
    newest: Nanos,
}

/// Longest value that can be written.
const WRITTEN_MAX: usize = 4;

/// A write that continues over several frames.
#[derive(Clone, Debug)]
struct Download {
    address: Address,
    bytes: Bytes,
    /// Length that the client announced.
    size: Option<u32>,
    toggle: bool,
    newest: Nanos,
}

/// The server and the transfer that is in flight: at most one of the two.
#[derive(Clone, Debug, Default)]
pub(crate) struct SdoServer {
    upload: Option<Upload>,
    download: Option<Download>,
}

impl SdoServer {
    /// Answers a frame when it is a request to this node.
    pub(crate) fn answer(
        &mut self,
        now: Nanos,
        node: u8,
        frame: &CanFrame,
        objects: &mut impl Objects,
    ) -> Option<SdoResponse> {
        if node_of(frame, COB_SDO_REQUEST) != Some(node) || frame.data().len() != 8 {
            return None;
        }
        let Some((_, request)) = SdoRequest::decode(frame) else {
            // Block download and reserved commands: refused, with the address that the frame names.
            self.reset();
            let address = match *frame.data() {
                [_, low, high, sub, ..] => Address::new(u16::from_le_bytes([low, high]), sub),
                _ => Address::new(0, 0),
            };
            return Some(SdoResponse::Abort(address, error_text::ABORT_COMMAND));
        };
        self.respond(now, request, objects)
    }

    /// Gives up a transfer whose client has gone quiet.
    pub(crate) fn expire(&mut self, now: Nanos) -> Option<SdoResponse> {
        let late = |newest| now.since_s(newest) > TIMEOUT_S;
        let read = self.upload.take_if(|upload| late(upload.newest)).map(|upload| upload.address);
        let written =
            self.download.take_if(|download| late(download.newest)).map(|download| download.address);
        Some(SdoResponse::Abort(read.or(written)?, error_text::ABORT_TIMEOUT))
    }

    /// Clears the transfer in flight.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }

    fn respond(
        &mut self,
        now: Nanos,
        request: SdoRequest,
        objects: &mut impl Objects,
    ) -> Option<SdoResponse> {
        // A new transfer ends the old one; only a next segment keeps it.
        if !matches!(request, SdoRequest::ReadSegment { .. }) {
            self.upload = None;
        }
        if !matches!(request, SdoRequest::WriteSegment { .. }) {
            self.download = None;
        }
        match request {
            SdoRequest::Read(address) => Some(match objects.read(address) {
                Ok(value) => self.begin(now, address, value),
                Err(code) => SdoResponse::Abort(address, code),
            }),
            SdoRequest::Write(address, bytes) => {
                Some(match objects.write(address, bytes.as_slice(), bytes.is_sized()) {
                    Ok(()) => SdoResponse::Written(address),
                    Err(code) => SdoResponse::Abort(address, code),
                })
            }
            SdoRequest::WriteSegmented(address, size) => Some(self.begin_write(now, address, size, objects)),
            SdoRequest::ReadSegment { toggle } => Some(self.next_segment(now, toggle)),
            SdoRequest::WriteSegment { toggle, bytes, last } => {
                Some(self.take_segment(now, (toggle, bytes, last), objects))
            }
            SdoRequest::Abort(..) => None,
        }
    }

    fn begin(&mut self, now: Nanos, address: Address, value: Bytes) -> SdoResponse {
        if let Some(bytes) = SdoBytes::from_slice(value.as_slice()) {
            return SdoResponse::Value(address, bytes);
        }
        let size = u32::try_from(value.as_slice().len()).ok();
        self.upload = Some(Upload { address, value, sent: 0, toggle: false, newest: now });
        SdoResponse::ValueSegmented(address, size)
    }

    fn begin_write(
        &mut self,
        now: Nanos,
        address: Address,
        size: Option<u32>,
        objects: &mut impl Objects,
    ) -> SdoResponse {
        // An object that is not there is refused at once; all else is checked by the whole value.
        if let Err(code @ (error_text::ABORT_NO_OBJECT | error_text::ABORT_NO_SUBINDEX)) =
            objects.read(address)
        {
            return SdoResponse::Abort(address, code);
        }
        if size.is_some_and(|size| usize::try_from(size).is_ok_and(|size| size > WRITTEN_MAX)) {
            return SdoResponse::Abort(address, error_text::ABORT_TOO_LONG);
        }
        self.download = Some(Download { address, bytes: Bytes::new(), size, toggle: false, newest: now });
        SdoResponse::Written(address)
    }

    fn take_segment(
        &mut self,
        now: Nanos,
        segment: (bool, SegmentBytes, bool),
        objects: &mut impl Objects,
    ) -> SdoResponse {
        let (toggle, bytes, last) = segment;
        let Some(mut download) = self.download.take() else {
            return SdoResponse::Abort(Address::new(0, 0), error_text::ABORT_COMMAND);
        };
        let address = download.address;
        if toggle != download.toggle {
            return SdoResponse::Abort(address, error_text::ABORT_TOGGLE);
        }
        if !download.bytes.extend(bytes.as_slice()) || download.bytes.as_slice().len() > WRITTEN_MAX {
            return SdoResponse::Abort(address, error_text::ABORT_TOO_LONG);
        }
        if !last {
            (download.toggle, download.newest) = (!toggle, now);
            self.download = Some(download);
            return SdoResponse::SegmentWritten { toggle };
        }
        let value = download.bytes.as_slice();
        if download.size.is_some_and(|size| usize::try_from(size) != Ok(value.len())) {
            return SdoResponse::Abort(address, error_text::ABORT_LENGTH);
        }
        match objects.write(address, value, true) {
            Ok(()) => SdoResponse::SegmentWritten { toggle },
            Err(code) => SdoResponse::Abort(address, code),
        }
    }

    fn next_segment(&mut self, now: Nanos, toggle: bool) -> SdoResponse {
        let Some(mut upload) = self.upload.take() else {
            return SdoResponse::Abort(Address::new(0, 0), error_text::ABORT_COMMAND);
        };
        if toggle != upload.toggle {
            return SdoResponse::Abort(upload.address, error_text::ABORT_TOGGLE);
        }
        let rest = upload.value.as_slice().get(upload.sent..).unwrap_or(&[]);
        let bytes = SegmentBytes::from_slice(rest);
        let last = rest.len() <= bytes.as_slice().len();
        if !last {
            upload.sent += bytes.as_slice().len();
            upload.toggle = !toggle;
            upload.newest = now;
            self.upload = Some(upload);
        }
        SdoResponse::Segment { toggle, bytes, last }
    }
}
