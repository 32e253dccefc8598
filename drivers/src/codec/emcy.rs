//! Emergency codes as text (CANopen EMCY, object 0x603F).
//!
//! A code is a tree of hexadecimal digits: `0x2331` is phase U of `0x2330` earth leakage of `0x2300` current at the output
//! of `0x2000` current. A code that is not listed gets the words of the nearest one above it.
//!
//! Sources: CiA 301 table "Emergency error code classes" and its CAN codes; CiA 402-2 (IEC 61800-7-201) "Error codes".

/// Error reset or no error.
pub const RESET: u16 = 0x0000;
/// Heartbeat or life guarding lost.
pub const HEARTBEAT: u16 = 0x8130;
/// PDO not processed because of its length.
pub const PDO_LENGTH: u16 = 0x8210;
/// RPDO time-out.
pub const RPDO_TIMEOUT: u16 = 0x8250;
/// Following error too large.
pub const FOLLOWING_ERROR: u16 = 0x8611;
/// Reference limit.
pub const REFERENCE_LIMIT: u16 = 0x8612;

/// Codes and words, by code.
const CODES: [(u16, &str); 126] = [
    (RESET, "error reset"),
    (0x1000, "generic error"),
    (0x2000, "current fault"),
    (0x2100, "current fault at the input"),
    (0x2110, "short circuit or earth leakage at the input"),
    (0x2120, "earth leakage at the input"),
    (0x2130, "short circuit at the input"),
    (0x2200, "current fault inside the drive"),
    (0x2213, "over-current while ramping up"),
    (0x2220, "continuous over-current inside the drive"),
    (0x2230, "short circuit or earth leakage inside the drive"),
    (0x2240, "earth leakage inside the drive"),
    (0x2250, "short circuit inside the drive"),
    (0x2300, "current fault at the output"),
    (0x2310, "over-current at the output"),
    (0x2320, "short circuit at the output"),
    (0x2330, "earth leakage at the output"),
    (0x2340, "short circuit between motor phases"),
    (0x3000, "voltage fault"),
    (0x3100, "mains voltage fault"),
    (0x3110, "over-voltage of the mains"),
    (0x3120, "under-voltage of the mains"),
    (0x3130, "mains phase missing"),
    (0x3134, "mains phases in the wrong order"),
    (0x3140, "mains frequency out of range"),
    (0x3200, "voltage fault inside the drive"),
    (0x3210, "over-voltage of the DC link"),
    (0x3220, "under-voltage of the DC link"),
    (0x3230, "load fault of the DC link"),
    (0x3300, "voltage fault at the output"),
    (0x3310, "over-voltage at the output"),
    (0x3320, "armature circuit fault"),
    (0x3330, "field circuit fault"),
    (0x4000, "temperature fault"),
    (0x4100, "ambient temperature fault"),
    (0x4110, "surroundings too hot"),
    (0x4120, "surroundings too cold"),
    (0x4130, "supply air too hot"),
    (0x4140, "air outlet too hot"),
    (0x4200, "device temperature fault"),
    (0x4210, "device too hot"),
    (0x4220, "device too cold"),
    (0x4300, "drive temperature fault"),
    (0x4310, "drive too hot"),
    (0x4320, "drive too cold"),
    (0x4400, "supply temperature fault"),
    (0x4410, "supply too hot"),
    (0x4420, "supply too cold"),
    (0x5000, "fault of the device hardware"),
    (0x5100, "supply of the device hardware"),
    (0x5110, "low voltage supply of the device hardware"),
    (0x5120, "intermediate circuit supply"),
    (0x5200, "fault of the control hardware"),
    (0x5210, "measurement circuit of the control"),
    (0x5220, "computing circuit of the control"),
    (0x5300, "fault of the operating unit"),
    (0x5400, "fault of the power section"),
    (0x5410, "output stages"),
    (0x5420, "brake chopper of the power section"),
    (0x5430, "input stages"),
    (0x5440, "contacts of the power section"),
    (0x5450, "fuses of the power section"),
    (0x5500, "fault of the data storage hardware"),
    (0x5510, "working memory (RAM)"),
    (0x5520, "program memory (EPROM)"),
    (0x5530, "parameter memory (EEPROM)"),
    (0x6000, "fault of the device software"),
    (0x6010, "software reset by the watchdog"),
    (0x6100, "fault of the internal software"),
    (0x6200, "fault of the user software"),
    (0x6300, "fault of the parameter set"),
    (0x6310, "loss of parameters"),
    (0x6320, "parameter error"),
    (0x7000, "fault of an additional module"),
    (0x7100, "fault of the power module"),
    (0x7110, "brake chopper fault"),
    (0x7111, "brake chopper failed"),
    (0x7112, "brake chopper over-current"),
    (0x7113, "brake chopper protective circuit"),
    (0x7120, "motor fault"),
    (0x7121, "motor blocked"),
    (0x7122, "motor or commutation fault"),
    (0x7123, "motor tilted"),
    (0x7200, "measurement circuit fault"),
    (0x7300, "sensor fault"),
    (0x7301, "tachometer fault"),
    (0x7302, "tachometer with wrong polarity"),
    (0x7303, "resolver 1 faulty"),
    (0x7304, "resolver 2 faulty"),
    (0x7305, "incremental encoder 1 faulty"),
    (0x7306, "incremental encoder 2 faulty"),
    (0x7307, "incremental encoder 3 faulty"),
    (0x7310, "speed sensor fault"),
    (0x7320, "position sensor fault"),
    (0x7400, "computation circuit fault"),
    (0x7500, "communication faulty"),
    (0x7510, "serial interface 1 faulty"),
    (0x7520, "serial interface 2 faulty"),
    (0x7600, "data storage fault"),
    (0x8000, "monitoring fault"),
    (0x8100, "communication fault"),
    (0x8110, "CAN overrun, messages lost"),
    (0x8120, "CAN error passive"),
    (HEARTBEAT, "master heartbeat lost"),
    (0x8140, "recovered from bus-off"),
    (0x8150, "two nodes send the same identifier"),
    (0x8200, "protocol error"),
    (PDO_LENGTH, "PDO ignored, too short"),
    (0x8220, "PDO too long"),
    (0x8230, "multiplexed PDO without a destination object"),
    (0x8240, "SYNC of unexpected length"),
    (RPDO_TIMEOUT, "setpoints (RPDO) stopped coming"),
    (0x8300, "torque control fault"),
    (0x8311, "torque too high"),
    (0x8312, "start-up too heavy"),
    (0x8313, "standstill torque"),
    (0x8321, "torque too low"),
    (0x8331, "torque fault"),
    (0x8400, "velocity controller fault"),
    (0x8500, "position controller fault"),
    (0x8600, "positioning controller fault"),
    (FOLLOWING_ERROR, "following error too large"),
    (REFERENCE_LIMIT, "reference limit reached"),
    (0x8700, "SYNC faulty"),
    (0x8800, "winding controller fault"),
    (0x9000, "external fault"),
];

/// What an emergency code says; a code that is not listed gets the words of the nearest one above it.
#[must_use]
pub fn words(code: u16) -> &'static str {
    let listed = |code: u16| CODES.iter().find(|(listed, _)| *listed == code).map(|(_, words)| *words);
    let found = [0xFFFF, 0xFFF0, 0xFF00, 0xF000].into_iter().find_map(|mask| match code & mask {
        // Only the code 0 itself means that there is no error.
        RESET if code >> 8 != 0 => None,
        above => listed(above),
    });
    found.unwrap_or(match code >> 8 {
        0xF0..=0xFE => "fault of an additional function",
        0xFF => "vendor-specific fault",
        _ => "fault of a class that CiA 301 does not list",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_stand_once_each_in_order() {
        for pair in CODES.windows(2) {
            assert!(pair[0].0 < pair[1].0, "{:04X} and {:04X}", pair[0].0, pair[1].0);
        }
    }

    /// Goal: an unlisted code is explained by its class, never by a neighbour.
    #[test]
    fn codes_are_named_as_in_the_standards() {
        for (code, expected) in [
            (0x7320, "position sensor fault"),
            (0x7305, "incremental encoder 1 faulty"),
            (0x7310, "speed sensor fault"),
            (0x7380, "sensor fault"),
            (0x2331, "earth leakage at the output"),
            (0x2342, "short circuit between motor phases"),
            (0x3211, "over-voltage of the DC link"),
            (0x5441, "contacts of the power section"),
            (0x8240, "SYNC of unexpected length"),
            (0x8380, "torque control fault"),
            (0x8A00, "monitoring fault"),
            (0x8611, "following error too large"),
            (0x1001, "generic error"),
            (0x0000, "error reset"),
            (0x0100, "fault of a class that CiA 301 does not list"),
            (0xA000, "fault of a class that CiA 301 does not list"),
            (0xF001, "fault of an additional function"),
            (0xFF0A, "vendor-specific fault"),
        ] {
            assert_eq!(words(code), expected, "0x{code:04X}");
        }
    }
}
