//! The bus budget, row by row as docs/bus-planning.md prints it, to the printed digit.
use taustream_arm::Traffic;
use taustream_arm::bus_load::flow::{Cia402Bus, Exchange, Flow, percent, periodic};
use taustream_arm::bus_load::frame::{BitRates, Format, Frame};

const CYCLE_HZ: f64 = 1000.0;

fn rates(data_mbit_s: u32) -> BitRates {
    BitRates { nominal_bit_s: 1_000_000, data_bit_s: data_mbit_s * 1_000_000 }
}

/// Time on a bus of 1 Mbit/s nominal, us.
fn us(frame: Frame, data_mbit_s: u32) -> f64 {
    frame.most_bits().seconds(rates(data_mbit_s)) * 1e6
}

/// To one decimal, halves up, as tables are rounded; a hair above, so that 91.75 is not 91.7499.
fn printed(value: f64) -> f64 {
    (value * 10.0 + 0.5 + 1e-6).floor() / 10.0
}

#[test]
fn classic_frames_are_as_long_as_the_printed_ones() {
    for (bytes, bits) in [(0, 55), (2, 75), (4, 95), (6, 115), (8, 135)] {
        let found = Frame::standard(Format::Classic, bytes).most_bits();
        assert_eq!((found.nominal, found.data), (bits, 0), "{bytes} bytes, 11-bit identifier");
    }
    for (bytes, bits) in [(4, 120), (6, 140), (8, 160)] {
        let frame = Frame { format: Format::Classic, extended: true, bytes };
        assert_eq!(frame.most_bits().nominal, bits, "{bytes} bytes, 29-bit identifier");
    }
}

#[test]
fn fd_frames_take_as_long_as_the_printed_ones() {
    // Bytes, then us at 2, 5 and 8 Mbit/s with an 11-bit identifier, then with a 29-bit one.
    let table = [
        (0, [50.0, 39.8, 37.3], [73.5, 63.0, 60.4]),
        (4, [70.0, 47.8, 42.3], [93.5, 71.0, 65.4]),
        (6, [80.0, 51.8, 44.8], [103.5, 75.0, 67.9]),
        (8, [90.0, 55.8, 47.2], [113.5, 79.0, 70.4]),
        (16, [130.0, 71.8, 57.2], [153.5, 95.0, 80.4]),
        (24, [172.5, 88.8, 67.9], [196.0, 112.0, 91.0]),
        (48, [292.5, 136.8, 97.9], [316.0, 160.0, 121.0]),
        (64, [372.5, 168.8, 117.9], [396.0, 192.0, 141.0]),
    ];
    for (bytes, standard, extended) in table {
        for (extended, row) in [(false, standard), (true, extended)] {
            for (mbit_s, want) in [2, 5, 8].into_iter().zip(row) {
                let found = us(Frame { format: Format::Fd, extended, bytes }, mbit_s);
                // Eighths of a microsecond are printed to one decimal, now up, now down.
                assert!(
                    (found - want).abs() < 0.0501,
                    "{bytes} bytes @{mbit_s}M, extended {extended}: {found}"
                );
            }
        }
    }
}

/// Six CiA 402 drives with PDOs of so many bytes.
fn cia402(format: Format, setpoint_bytes: u32, answer_bytes: u32, traffic: Traffic) -> Vec<Flow> {
    let bus = Cia402Bus { drives: 6, cycle_hz: CYCLE_HZ, traffic, setpoint_bytes, answer_bytes, format };
    bus.process_data()
}

fn exchange(servos: u32, format: Format, command: (u32, bool), answer: Option<(u32, bool)>) -> Vec<Flow> {
    let frame = |(bytes, extended): (u32, bool)| Frame { format, extended, bytes };
    let bus = Exchange { servos, cycle_hz: CYCLE_HZ, command: frame(command), answer: answer.map(frame) };
    bus.flows()
}

fn odrive(encoder_hz: f64) -> Vec<Flow> {
    let eight = Frame::standard(Format::Classic, 8);
    let setpoints = exchange(6, Format::Classic, (8, false), None);
    let own = [periodic("encoder", eight, 6, encoder_hz), periodic("heartbeat", eight, 6, 10.0)];
    [setpoints, own.to_vec()].concat()
}

fn piper(frames: u32, feedback_hz: f64) -> Vec<Flow> {
    let eight = Frame::standard(Format::Classic, 8);
    vec![periodic("commands", eight, frames, CYCLE_HZ), periodic("feedback", eight, 1, feedback_hz)]
}

#[test]
fn every_row_of_the_load_table_is_reproduced_to_its_printed_digit() {
    use Format::{Classic, Fd};
    let every = Traffic::EVERY_CYCLE;
    let rarer = |feedback_every| Traffic { feedback_every, ..every };
    let packed = |feedback_every| Traffic { packed: true, ..rarer(feedback_every) };
    let table: [(&str, Vec<Flow>, u32, f64); 31] = [
        ("SYNC + 6 RPDO (6 B), no feedback", cia402(Classic, 6, 0, every), 1, 74.5),
        ("the same on FD", cia402(Fd, 6, 0, every), 5, 35.1),
        ("the same + 6 TPDO (6 B)", cia402(Classic, 6, 6, every), 1, 143.5),
        ("on FD", cia402(Fd, 6, 6, every), 5, 66.1),
        ("8 B + 8 B", cia402(Classic, 8, 8, every), 1, 167.5),
        ("8 B + 8 B on FD", cia402(Fd, 8, 8, every), 5, 70.9),
        ("4 B + 4 B", cia402(Classic, 4, 4, every), 1, 119.5),
        ("4 B + 4 B on FD", cia402(Fd, 4, 4, every), 5, 61.3),
        ("TPDO every 4th SYNC", cia402(Classic, 6, 6, rarer(4)), 1, 91.8),
        ("3 packed RPDO + 6 TPDO", cia402(Classic, 6, 6, packed(1)), 1, 115.0),
        ("3 packed RPDO + 6 TPDO on FD", cia402(Fd, 6, 6, packed(1)), 5, 51.8),
        ("3 packed RPDO + TPDO every 2nd SYNC", cia402(Classic, 6, 6, packed(2)), 1, 80.5),
        ("3 packed RPDO + TPDO every 2nd SYNC on FD", cia402(Fd, 6, 6, packed(2)), 5, 36.3),
        ("8 B each way, commands alone", exchange(6, Classic, (8, false), None), 1, 81.0),
        ("8 B each way, commands alone, on FD", exchange(6, Fd, (8, false), None), 5, 33.5),
        ("8 B each way", exchange(6, Classic, (8, false), Some((8, false))), 1, 162.0),
        ("8 B each way on FD 5M", exchange(6, Fd, (8, false), Some((8, false))), 5, 67.0),
        ("8 B each way on FD 2M", exchange(6, Fd, (8, false), Some((8, false))), 2, 108.0),
        ("AK old firmware", exchange(6, Classic, (8, false), Some((6, false))), 1, 150.0),
        ("RMD A4 + 0x92", exchange(12, Classic, (8, false), Some((8, false))), 1, 324.0),
        ("OpenArm: 8 Damiao motors", exchange(8, Classic, (8, false), Some((8, false))), 1, 216.0),
        ("OpenArm on FD", exchange(8, Fd, (8, false), Some((8, false))), 5, 89.3),
        ("RobStride, commands alone", exchange(6, Classic, (8, true), None), 1, 96.0),
        ("RobStride", exchange(6, Classic, (8, true), Some((8, true))), 1, 192.0),
        ("RobStride on FD, were it offered", exchange(6, Fd, (8, true), Some((8, true))), 5, 94.8),
        ("ODrive, encoder 10 ms", odrive(100.0), 1, 89.9),
        ("ODrive, encoder 5 ms", odrive(200.0), 1, 98.0),
        ("ODrive, encoder 1 ms", odrive(1000.0), 1, 162.8),
        ("Piper JointCtrl", piper(3, 0.0), 1, 40.5),
        ("Piper JointCtrl + feedback", piper(3, 3040.0), 1, 81.5),
        ("Piper MIT + feedback", piper(6, 3040.0), 1, 122.0),
    ];
    for (row, flows, data_mbit_s, want) in table {
        let found = percent(&flows, rates(data_mbit_s));
        assert!((printed(found) - want).abs() < 1e-9, "{row}: {found} instead of {want}");
    }
    // Rows that are printed to whole percents, or built of frames of two protocols.
    let slow_fd = percent(&exchange(6, Fd, (8, false), Some((8, false))), rates(8));
    assert!((slow_fd - 57.0).abs() < 0.5, "8 B each way on FD 8M: {slow_fd}");
    let alone = percent(&exchange(6, Fd, (8, true), None), rates(5));
    assert!((printed(alone) - 47.4).abs() < 1e-9, "RobStride commands on FD: {alone}");
    let one_for_all = [
        periodic("SYNC", Frame::standard(Fd, 0), 1, CYCLE_HZ),
        periodic("six targets", Frame::standard(Fd, 24), 1, CYCLE_HZ),
        periodic("answers", Frame::standard(Fd, 8), 6, CYCLE_HZ),
    ];
    let found = percent(&one_for_all, rates(5));
    assert!((printed(found) - 46.3).abs() < 1e-9, "one 24-byte frame with six targets: {found}");
}

/// The highest rates with full feedback on one classic bus: the cycle that fills it.
#[test]
fn highest_rates_with_full_feedback_are_the_printed_ones() {
    use Format::Classic;
    let most_hz = |flows: &[Flow], percent_max: f64| CYCLE_HZ * percent_max / percent(flows, rates(1));
    for (what, flows, full_hz, three_quarters_hz) in [
        ("11-bit 8 + 8", exchange(6, Classic, (8, false), Some((8, false))), 617.0, 460.0),
        ("29-bit 8 + 8", exchange(6, Classic, (8, true), Some((8, true))), 521.0, 390.0),
        ("CiA 402 6 + 6", cia402(Classic, 6, 6, Traffic::EVERY_CYCLE), 697.0, 520.0),
    ] {
        let (full, part) = (most_hz(&flows, 100.0), most_hz(&flows, 75.0));
        assert!((full.round() - full_hz).abs() < 1e-9, "{what}: {full}");
        assert!(((part / 10.0).floor() * 10.0 - three_quarters_hz).abs() < 1e-9, "{what}: {part}");
    }
}

/// Decimation and staggering give the same load; only staggering takes the burst away.
#[test]
fn staggering_spreads_what_decimation_leaves_in_one_cycle() {
    let traffic = |stagger| Traffic { setpoint_every: 3, stagger, ..Traffic::EVERY_CYCLE };
    let setpoints = |stagger| {
        let flows = cia402(Format::Classic, 6, 6, traffic(stagger));
        let flow = flows.into_iter().find(|flow| flow.what == "setpoints");
        flow.map(|flow| (flow.rate_hz, flow.burst))
    };
    assert_eq!(setpoints(false), Some((2000.0, 6)));
    assert_eq!(setpoints(true), Some((2000.0, 2)));
}
