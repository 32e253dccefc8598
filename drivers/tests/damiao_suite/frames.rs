//! Frames and packing, against bytes written out by hand from the manual's tables.
use taustream_drivers::codec::mit::{MitCommand, MitRanges, MitState, Span};
use taustream_drivers::protocols::damiao::frames::{Feedback, Reply, Request, Special, Wire};
use taustream_drivers::{CanFrame, CanId};

const DM4310: MitRanges = MitRanges::symmetric(12.5, 30.0, 10.0);

fn hex(frame: &CanFrame) -> String {
    let bytes: Vec<String> = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:03X}#{}", frame.id().raw(), bytes.join(" "))
}

#[test]
fn requests_are_the_bytes_of_the_manual() {
    for (request, golden) in [
        (Request::Special(Special::Enable, 0), "005#FF FF FF FF FF FF FF FC"),
        (Request::Special(Special::Disable, 0), "005#FF FF FF FF FF FF FF FD"),
        (Request::Special(Special::SetZero, 1), "105#FF FF FF FF FF FF FF FE"),
        (Request::Special(Special::ClearError, 0), "005#FF FF FF FF FF FF FF FB"),
        (Request::Read(21), "7FF#05 00 33 15 00 00 00 00"),
        // 100 ms are 2000 units of 50 us.
        (Request::Write(9, 2000_u32.to_le_bytes()), "7FF#05 00 55 09 D0 07 00 00"),
        (Request::Store, "7FF#05 00 AA 01 00 00 00 00"),
        (Request::Refresh, "7FF#05 00 CC 00 00 00 00 00"),
        (Request::PosVel { position_rad: 1.0, velocity_rad_s: -2.0 }, "105#00 00 80 3F 00 00 00 C0"),
    ] {
        let frame = request.encode(5, Wire::Classic);
        assert_eq!(hex(&frame), golden);
        assert!(!frame.is_fd());
        assert_eq!(Request::decode(&frame, 5), Some(request), "{golden}");
        assert_eq!(Request::decode(&frame, 6), None, "{golden} is for motor 5");
        let fd = request.encode(5, Wire::Fd);
        assert!(fd.is_fd() && fd.data() == frame.data() && Request::decode(&fd, 5) == Some(request));
    }
}

#[test]
fn mit_commands_pack_known_numbers_and_round_to_the_nearest() {
    let middle = MitCommand::default().encode(&DM4310).unwrap();
    // Zero lies between two codes of a symmetric range; the higher one is sent. Gains of 0 are exact.
    assert_eq!(middle, [0x80, 0x00, 0x80, 0x00, 0x00, 0x00, 0x08, 0x00]);
    let ends = MitCommand {
        position_rad: 99.0,
        velocity_rad_s: -99.0,
        stiffness_nm_rad: 500.0,
        damping_nm_s_rad: 5.0,
        torque_nm: -99.0,
    };
    assert_eq!(ends.encode(&DM4310).unwrap(), [0xFF, 0xFF, 0x00, 0x0F, 0xFF, 0xFF, 0xF0, 0x00]);
    let below = Span::new(0.0, 4095.0, 12);
    for (value, code) in [(1.499_999, 1), (1.5, 2), (1.999_999, 2), (2.499_999, 2), (4094.7, 4095)] {
        assert_eq!(below.encode(value), Some(code), "{value}");
    }
    for field in 0..5 {
        let mut numbers = [0.0; 5];
        numbers[field] = f64::NAN;
        let [position_rad, velocity_rad_s, stiffness_nm_rad, damping_nm_s_rad, torque_nm] = numbers;
        let command =
            MitCommand { position_rad, velocity_rad_s, stiffness_nm_rad, damping_nm_s_rad, torque_nm };
        assert_eq!(command.encode(&DM4310), None, "field {field} is no number");
    }
    assert_eq!(below.encode(f64::INFINITY), Some(4095));
}

#[test]
fn decoded_values_lie_at_most_half_a_step_from_what_was_encoded_and_on_both_sides() {
    let mut sides = [0_u32; 2];
    for seed in 0..20_000_u32 {
        let part =
            |shift: u32| f64::from(seed.wrapping_mul(2_654_435_761).rotate_left(shift)) / f64::from(u32::MAX);
        let command = MitCommand {
            position_rad: 25.0 * part(0) - 12.5,
            velocity_rad_s: 60.0 * part(7) - 30.0,
            stiffness_nm_rad: 500.0 * part(13),
            damping_nm_s_rad: 5.0 * part(19),
            torque_nm: 20.0 * part(25) - 10.0,
        };
        let back = MitCommand::decode(command.encode(&DM4310).unwrap(), &DM4310);
        for (sent, got, span) in [
            (command.position_rad, back.position_rad, DM4310.position),
            (command.velocity_rad_s, back.velocity_rad_s, DM4310.velocity),
            (command.stiffness_nm_rad, back.stiffness_nm_rad, DM4310.stiffness),
            (command.damping_nm_s_rad, back.damping_nm_s_rad, DM4310.damping),
            (command.torque_nm, back.torque_nm, DM4310.torque),
        ] {
            let off_steps = (sent - got) / span.step();
            assert!(off_steps.abs() <= 0.5 + 1e-9, "seed {seed}: {sent} came back as {got}");
            sides[usize::from(off_steps > 0.0)] += 1;
        }
        let state = MitState {
            position_rad: command.position_rad,
            velocity_rad_s: command.velocity_rad_s,
            torque_nm: command.torque_nm,
        };
        let received = MitState::decode(state.encode(&DM4310), &DM4310);
        let differs = (received.position_rad - back.position_rad).abs()
            + (received.velocity_rad_s - back.velocity_rad_s).abs()
            + (received.torque_nm - back.torque_nm).abs();
        assert!(differs < 1e-12, "seed {seed}: commands and answers pack alike");
    }
    assert!(sides.iter().all(|count| *count > 40_000), "one side is preferred: {sides:?}");
}

#[test]
fn command_with_everything_at_its_end_is_no_special_command() {
    for last in 0..=0xFF_u8 {
        let bytes = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last];
        let frame = Request::Mit(bytes).encode(3, Wire::Classic);
        assert!(matches!(Request::decode(&frame, 3), Some(Request::Mit(_))), "{}", hex(&frame));
    }
}

#[test]
fn feedback_and_register_answers_are_distinguished() {
    let feedback = Feedback {
        status: 0xD,
        state: [0x80, 0x12, 0x34, 0x56, 0x78],
        stage_celsius: 41,
        winding_celsius: 52,
    };
    let frame = Reply::Feedback(feedback).encode(5, 0x15, Wire::Classic);
    assert_eq!(hex(&frame), "015#D5 80 12 34 56 78 29 34");
    assert_eq!(Reply::decode(&frame, 5, 0x15), Some(Reply::Feedback(feedback)));
    assert_eq!(Reply::decode(&frame, 4, 0x15), None, "another motor's");
    assert_eq!(Reply::decode(&frame, 5, 0x14), None, "under another identifier");
    let register = Reply::Register { number: 21, written: false, value: 12.5_f32.to_le_bytes() };
    let frame = register.encode(5, 0x15, Wire::Classic);
    assert_eq!(hex(&frame), "015#05 00 33 15 00 00 48 41");
    assert_eq!(Reply::decode(&frame, 5, 0x15), Some(register));
    // A feedback reads as a register's answer only within 1/256 of the lowest angle, where no joint may be.
    let mut mistaken = 0;
    for position in 0..=u16::MAX {
        let [high, low] = position.to_be_bytes();
        let feedback =
            Feedback { status: 0, state: [high, low, 21, 0, 0], stage_celsius: 0, winding_celsius: 0 };
        let frame = Reply::Feedback(feedback).encode(5, 0x15, Wire::Classic);
        if matches!(Reply::decode(&frame, 5, 0x15), Some(Reply::Register { .. })) {
            mistaken += 1;
            assert!(DM4310.position.decode(position) < -12.5 * 127.0 / 128.0);
        }
    }
    assert_eq!(mistaken, 2);
}

#[test]
fn frames_of_other_lengths_kinds_and_flags_are_nobodys() {
    let good =
        Reply::Feedback(Feedback { status: 1, state: [0x80; 5], stage_celsius: 30, winding_celsius: 30 });
    let bytes = good.encode(5, 0x15, Wire::Classic).data().to_vec();
    for length in 0..8 {
        let short = CanFrame::classic(CanId::standard(0x15), &bytes[..length]);
        assert_eq!(Reply::decode(&short, 5, 0x15), None, "{length} bytes");
        let command = CanFrame::classic(CanId::standard(5), &bytes[..length]);
        assert_eq!(Request::decode(&command, 5), None, "{length} bytes");
    }
    let long = CanFrame::fd(CanId::standard(0x15), &[bytes.as_slice(), &[0; 4]].concat());
    assert_eq!(Reply::decode(&long, 5, 0x15), None, "12 bytes");
    for flag in [0x8000_0000, 0x4000_0000, 0x2000_0000] {
        let frame = CanFrame::classic(CanId::from_raw(flag | 0x15), &bytes);
        assert_eq!(Reply::decode(&frame, 5, 0x15), None, "flag {flag:#x}");
    }
}
