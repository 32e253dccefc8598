//! The SDO server of a simulated drive: expedited transfers both ways, segmented reads.
//!
//! No object of the drive is longer than four bytes and writable, so a segmented write is refused by its length.
//! Source: CiA 301 section 7.2.4.
use super::dictionary::{AbortCode, Bytes};
use crate::codec::canopen::{COB_SDO_REQUEST, node_of};
use crate::codec::{Address, SdoBytes, SdoRequest, SdoResponse, SegmentBytes, words};
use crate::frame::CanFrame;
use crate::servo::Nanos;

/// How long a segmented transfer may pause before the server gives it up.
const TIMEOUT_S: f64 = 1.0;

/// What the server reads from and writes to.
pub(crate) trait Objects {
    /// The value of an object.
    fn read(&mut self, address: Address) -> Result<Bytes, AbortCode>;
    /// Writes an object; `sized` when the client stated the length.
    fn write(&mut self, address: Address, bytes: &[u8], sized: bool) -> Result<(), AbortCode>;
}

/// A read that goes on over several frames.
#[derive(Clone, Debug)]
struct Upload {
    address: Address,
    value: Bytes,
    sent: usize,
    toggle: bool,
    newest: Nanos,
}

/// The server and the transfer that is in flight.
#[derive(Clone, Debug, Default)]
pub(crate) struct SdoServer {
    upload: Option<Upload>,
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
            // Block transfer and reserved commands: refused, with the address that the frame names.
            self.upload = None;
            let address = match *frame.data() {
                [_, low, high, sub, ..] => Address::new(u16::from_le_bytes([low, high]), sub),
                _ => Address::new(0, 0),
            };
            return Some(SdoResponse::Abort(address, words::ABORT_COMMAND));
        };
        self.respond(now, request, objects)
    }

    /// Gives up a transfer whose client has gone quiet.
    pub(crate) fn expire(&mut self, now: Nanos) -> Option<SdoResponse> {
        let upload = self.upload.take_if(|upload| now.since_s(upload.newest) > TIMEOUT_S)?;
        Some(SdoResponse::Abort(upload.address, words::ABORT_TIMEOUT))
    }

    /// Forgets the transfer in flight.
    pub(crate) fn reset(&mut self) {
        self.upload = None;
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
            SdoRequest::WriteSegmented(address, size) => {
                // Ask first whether the object could be written at all, then refuse the length.
                let code = match objects.read(address) {
                    Err(code) if code != words::ABORT_WRITE_ONLY => code,
                    _ if size.is_some() => words::ABORT_TOO_LONG,
                    _ => words::ABORT_LENGTH,
                };
                Some(SdoResponse::Abort(address, code))
            }
            SdoRequest::ReadSegment { toggle } => Some(self.next_segment(now, toggle)),
            SdoRequest::WriteSegment { .. } => {
                Some(SdoResponse::Abort(Address::new(0, 0), words::ABORT_COMMAND))
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

    fn next_segment(&mut self, now: Nanos, toggle: bool) -> SdoResponse {
        let Some(mut upload) = self.upload.take() else {
            return SdoResponse::Abort(Address::new(0, 0), words::ABORT_COMMAND);
        };
        if toggle != upload.toggle {
            return SdoResponse::Abort(upload.address, words::ABORT_TOGGLE);
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
