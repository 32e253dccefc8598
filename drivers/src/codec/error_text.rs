//! Abort codes of SDO as text.
//!
//! Source: CiA 301 table "SDO abort codes".

/// SDO abort: toggle bit not alternated.
pub const ABORT_TOGGLE: u32 = 0x0503_0000;
/// SDO abort: protocol timed out.
pub const ABORT_TIMEOUT: u32 = 0x0504_0000;
/// SDO abort: command specifier not valid or unknown.
pub const ABORT_COMMAND: u32 = 0x0504_0001;
/// SDO abort: unsupported access.
pub const ABORT_ACCESS: u32 = 0x0601_0000;
/// SDO abort: read of a write-only object.
pub const ABORT_WRITE_ONLY: u32 = 0x0601_0001;
/// SDO abort: write of a read-only object.
pub const ABORT_READ_ONLY: u32 = 0x0601_0002;
/// SDO abort: no such object.
pub const ABORT_NO_OBJECT: u32 = 0x0602_0000;
/// SDO abort: object cannot be mapped to the PDO.
pub const ABORT_NOT_MAPPABLE: u32 = 0x0604_0041;
/// SDO abort: mapped objects exceed the PDO's length.
pub const ABORT_PDO_LENGTH: u32 = 0x0604_0042;
/// SDO abort: parameters do not fit each other.
pub const ABORT_INCOMPATIBLE: u32 = 0x0604_0043;
/// SDO abort: length of the parameter does not match.
pub const ABORT_LENGTH: u32 = 0x0607_0010;
/// SDO abort: parameter too long.
pub const ABORT_TOO_LONG: u32 = 0x0607_0012;
/// SDO abort: parameter too short.
pub const ABORT_TOO_SHORT: u32 = 0x0607_0013;
/// SDO abort: no such subindex.
pub const ABORT_NO_SUBINDEX: u32 = 0x0609_0011;
/// SDO abort: value out of range.
pub const ABORT_RANGE: u32 = 0x0609_0030;
/// SDO abort: value too high.
pub const ABORT_TOO_HIGH: u32 = 0x0609_0031;
/// SDO abort: value too low.
pub const ABORT_TOO_LOW: u32 = 0x0609_0032;
/// SDO abort: resource not available.
pub const ABORT_RESOURCE: u32 = 0x060A_0023;
/// SDO abort: general error.
pub const ABORT_GENERAL: u32 = 0x0800_0000;
/// SDO abort: data cannot be stored.
pub const ABORT_STORE: u32 = 0x0800_0020;
/// SDO abort: data cannot be stored because of local control.
pub const ABORT_LOCAL_CONTROL: u32 = 0x0800_0021;
/// SDO abort: wrong device state, as for a re-map in operational.
pub const ABORT_DEVICE_STATE: u32 = 0x0800_0022;
/// SDO abort: there is no data, as in an empty error history.
pub const ABORT_NO_DATA: u32 = 0x0800_0024;

/// Whether an abort code says that the transfer failed, not what the drive makes of the object.
///
/// Of all others no code is distinguished from another where a drive is asked for what it may lack: drives say "no such object",
/// "unsupported access", "general error" or "cannot be stored" for one and the same.
#[must_use]
pub const fn is_of_the_transfer(code: u32) -> bool {
    code < ABORT_ACCESS || code == ABORT_TOO_LONG
}

/// What an SDO abort code says.
#[must_use]
pub fn sdo_abort(code: u32) -> &'static str {
    match code {
        ABORT_TOGGLE => "toggle bit not alternated",
        ABORT_TIMEOUT => "no SDO answer in time",
        ABORT_COMMAND => "SDO command not valid or not known",
        ABORT_ACCESS => "access to the object is not supported",
        ABORT_WRITE_ONLY => "read of a write-only object",
        ABORT_READ_ONLY => "write of a read-only object",
        ABORT_NO_OBJECT => "no such object",
        ABORT_NOT_MAPPABLE => "object cannot be mapped into a PDO",
        ABORT_PDO_LENGTH => "mapped objects exceed the length of the PDO",
        ABORT_INCOMPATIBLE => "parameters do not fit each other",
        ABORT_LENGTH => "length of the value does not match the object",
        ABORT_TOO_LONG => "value is longer than the object",
        ABORT_TOO_SHORT => "value is shorter than the object",
        ABORT_NO_SUBINDEX => "no such subindex",
        ABORT_RANGE => "value out of range",
        ABORT_TOO_HIGH => "value too high",
        ABORT_TOO_LOW => "value too low",
        ABORT_RESOURCE => "resource not available",
        ABORT_GENERAL => "general error",
        ABORT_STORE => "value cannot be stored",
        ABORT_LOCAL_CONTROL => "value cannot be stored because of local control",
        ABORT_DEVICE_STATE => "not in the present state of the device",
        ABORT_NO_DATA => "no data there",
        _ => "abort code that CiA 301 does not list",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_the_object_are_distinguished_from_those_of_the_transfer() {
        for code in [ABORT_TOGGLE, ABORT_TIMEOUT, ABORT_COMMAND, 0x0504_0005, ABORT_TOO_LONG, 0] {
            assert!(is_of_the_transfer(code), "0x{code:08X}");
        }
        for code in
            [ABORT_ACCESS, ABORT_READ_ONLY, ABORT_NO_OBJECT, ABORT_GENERAL, ABORT_STORE, ABORT_NO_DATA]
        {
            assert!(!is_of_the_transfer(code), "0x{code:08X}");
        }
    }
}
