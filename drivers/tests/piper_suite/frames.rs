//! Frames against bytes written out by hand from the maker's tables, and frames of which nothing may be read.
use taustream_drivers::protocols::piper::frames::{
    ALL, Command, FOLLOW_FAST, Limits, Message, from_millidegrees, millidegrees,
};
use taustream_drivers::{CanFrame, CanId};

fn hex(frame: &CanFrame) -> String {
    let bytes: Vec<String> = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:03X}#{}", frame.id().raw(), bytes.join(" "))
}

#[test]
fn commands_are_the_bytes_of_the_makers_tables() {
    let mode = Command::Mode { control: 1, movement: 1, speed_percent: 100, follow: FOLLOW_FAST };
    for (command, golden) in [
        (Command::Enable(ALL), "471#07 02 00 00 00 00 00 00"),
        (Command::Disable(ALL), "471#07 01 00 00 00 00 00 00"),
        (mode, "151#01 01 64 AD 00 00 00 00"),
        (Command::Targets(1, [90_000, -1]), "156#00 01 5F 90 FF FF FF FF"),
        (Command::AskLimits(3), "472#03 01 00 00 00 00 00 00"),
        (Command::ClearErrors(ALL), "475#07 00 00 7F FF AE 00 00"),
        (Command::SetZero(2), "475#02 AE 00 7F FF 00 00 00"),
        (Command::Stop, "150#01 00 00 00 00 00 00 00"),
        (Command::Resume, "150#02 00 00 00 00 00 00 00"),
        (Command::AskFirmware, "4AF#01 00 00 00 00 00 00 00"),
    ] {
        assert_eq!(hex(&command.encode()), golden);
        assert_eq!(Command::decode(&command.encode()), Some(command));
        assert_eq!(Message::decode(&command.encode()), None, "{command:?}");
    }
}

#[test]
fn angles_are_thousandths_of_degrees() {
    assert_eq!(millidegrees(std::f64::consts::FRAC_PI_2), Some(90_000));
    assert_eq!(millidegrees(-1e-5), Some(-1));
    assert!((from_millidegrees(-45_000) + std::f64::consts::FRAC_PI_4).abs() < 1e-15);
    for angle_rad in [f64::NAN, f64::INFINITY, 1e9] {
        assert_eq!(millidegrees(angle_rad), None);
    }
    let limits = Limits { joint: 1, most_decidegrees: 1500, least_decidegrees: -1500, speed_mrad_s: 3000 };
    let [least, most] = limits.range_rad();
    assert!((most.to_degrees() - 150.0).abs() < 1e-12 && (least.to_degrees() + 150.0).abs() < 1e-12);
    assert!((limits.speed_rad_s() - 3.0).abs() < 1e-12);
}

#[test]
fn nothing_is_read_in_frames_of_other_lengths_kinds_and_identifiers() {
    let angles = Message::Angles(0, [1, 2]).encode();
    assert_eq!(Message::decode(&angles), Some(Message::Angles(0, [1, 2])));
    for length in 0..8 {
        assert_eq!(Message::decode(&CanFrame::classic(angles.id(), &angles.data()[..length])), None);
    }
    assert_eq!(Message::decode(&CanFrame::fd(angles.id(), &[0; 12])), None);
    for id in [0x8000_02A5, 0x2000_02A5, 0x4000_02A5, 0x0000_0AA5] {
        assert_eq!(Message::decode(&CanFrame::classic(CanId::from_raw(id), &[0; 8])), None, "{id:X}");
    }
    for id in 0..=0x7FF_u16 {
        for fill in [0x00, 0x01, 0x02, 0x7F, 0xAE, 0xFF] {
            let frame = CanFrame::classic(CanId::standard(id), &[fill; 8]);
            let (message, command) = (Message::decode(&frame), Command::decode(&frame));
            assert!(message.is_none() || command.is_none(), "{id:X} is both {message:?} and {command:?}");
        }
    }
}
