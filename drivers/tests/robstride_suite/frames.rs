//! Frames against bytes written out by hand from the manual's tables, and what is nobody's.
use proptest::prelude::{ProptestConfig, any, prop_oneof, proptest};
use proptest::strategy::{Just, Strategy};
use taustream_drivers::codec::mit::{MitCommand, MitRanges, MitState};
use taustream_drivers::protocols::robstride::frames::{
    Feedback, Mode, Operation, POSITION_REACH_RAD, Parameter, Reply, Request, ranges,
};
use taustream_drivers::{CanFrame, CanId};

const HOST: u8 = 0xFD;
const RS00: MitRanges = ranges([POSITION_REACH_RAD, 33.0, 14.0], 500.0, 5.0);

fn hex(frame: &CanFrame) -> String {
    let bytes: Vec<String> = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:08X}#{}", frame.id().as_extended_data().unwrap(), bytes.join(" "))
}

#[test]
fn requests_are_the_bytes_of_the_manual() {
    for (request, golden) in [
        (Request::GetId, "0000FD7F#00 00 00 00 00 00 00 00"),
        (Request::Enable, "0300FD7F#00 00 00 00 00 00 00 00"),
        (Request::Stop, "0400FD7F#00 00 00 00 00 00 00 00"),
        (Request::ClearFault, "0400FD7F#01 00 00 00 00 00 00 00"),
        (Request::Version, "0400FD7F#00 C4 00 00 00 00 00 00"),
        (Request::SetZero, "0600FD7F#01 00 00 00 00 00 00 00"),
        // The manual's example of 4.1.14: loc_kp.
        (Request::Read(0x701E), "1100FD7F#1E 70 00 00 00 00 00 00"),
        // 100 ms are 2000 units of 50 us.
        (
            Request::Write(Parameter::Timeout.index(), 2000_u32.to_le_bytes()),
            "1200FD7F#28 70 00 00 D0 07 00 00",
        ),
        (Request::Other(22), "1600FD7F#00 00 00 00 00 00 00 00"),
    ] {
        let frame = request.encode(HOST, 0x7F);
        assert_eq!(hex(&frame), golden);
        assert_eq!(Request::decode(&frame, 0x7F), Some((HOST, request)), "{golden}");
        assert_eq!(Request::decode(&frame, 0x7E), None, "{golden} is for motor 127");
        assert!(Request::is_to(&frame, 0x7F) && Reply::decode(&frame, 0x7F, HOST).is_none(), "{golden}");
    }
    let operation = Operation { torque: 0x1234, bytes: [1, 2, 3, 4, 5, 6, 7, 8] };
    let frame = Request::Operation(operation).encode(HOST, 5);
    assert_eq!(hex(&frame), "01123405#01 02 03 04 05 06 07 08");
    assert_eq!(Request::decode(&frame, 5), Some((0, Request::Operation(operation))));
}

#[test]
fn replies_are_the_bytes_of_the_manual() {
    let feedback = Feedback {
        mode: Mode::Run,
        faults: 0x21,
        state: [0x80, 0x12, 0x34, 0x56, 0x78, 0x9A],
        decicelsius: 0x0145,
    };
    for (reply, golden) in [
        (Reply::Identity([1, 2, 3, 4, 5, 6, 7, 8]), "00007FFE#01 02 03 04 05 06 07 08"),
        (Reply::Feedback(feedback), "02A17FFD#80 12 34 56 78 9A 01 45"),
        // The manual's example of 4.1.14: loc_kp is 30.
        (
            Reply::Value { index: 0x701E, read: true, value: 30.0_f32.to_le_bytes() },
            "11007FFD#1E 70 00 00 00 00 F0 41",
        ),
        (Reply::Value { index: 0x7028, read: false, value: [0; 4] }, "11017FFD#28 70 00 00 00 00 00 00"),
        (Reply::Fault { faults: 1 << 14, warnings: 1 }, "15007FFD#00 40 00 00 01 00 00 00"),
        (Reply::Version([0, 3, 0, 13]), "02007FFD#00 C4 56 00 03 00 0D 00"),
    ] {
        let frame = reply.encode(0x7F, HOST);
        assert_eq!(hex(&frame), golden);
        assert_eq!(Reply::decode(&frame, 0x7F, HOST), Some(reply), "{golden}");
        assert_eq!(Reply::decode(&frame, 0x7E, HOST), None, "{golden}: another motor's");
        assert!(!Request::is_to(&frame, 0x7F), "{golden} is no request");
    }
    // Of active reports the type is 24 in one place of the manual, and 2 in another.
    let report =
        CanFrame::classic(CanId::extended(0x18A1_7FFD), &[0x80, 0x12, 0x34, 0x56, 0x78, 0x9A, 1, 0x45]);
    assert_eq!(Reply::decode(&report, 0x7F, HOST), Some(Reply::Feedback(feedback)));
    // A value that another master has read says nothing of what this one asked.
    let other = Reply::Value { index: 0x701E, read: true, value: [0; 4] }.encode(0x7F, 0xFC);
    assert_eq!(Reply::decode(&other, 0x7F, HOST), None);
}

#[test]
fn commands_pack_known_numbers_and_what_is_no_number_is_none() {
    let command = MitCommand {
        position_rad: 99.0,
        velocity_rad_s: -99.0,
        stiffness_nm_rad: 500.0,
        damping_nm_s_rad: 0.0,
        torque_nm: 14.0,
    };
    let packed = Operation::encode(&command, &RS00).unwrap();
    assert_eq!(packed, Operation { torque: 0xFFFF, bytes: [0xFF, 0xFF, 0, 0, 0xFF, 0xFF, 0, 0] });
    let middle = Operation::encode(&MitCommand::default(), &RS00).unwrap();
    // Zero lies between two codes of a symmetric range; the higher one is sent. Gains of 0 are exact.
    assert_eq!(middle, Operation { torque: 0x8000, bytes: [0x80, 0, 0x80, 0, 0, 0, 0, 0] });
    for field in 0..5 {
        let mut numbers = [0.0; 5];
        numbers[field] = f64::NAN;
        let [position_rad, velocity_rad_s, stiffness_nm_rad, damping_nm_s_rad, torque_nm] = numbers;
        let command =
            MitCommand { position_rad, velocity_rad_s, stiffness_nm_rad, damping_nm_s_rad, torque_nm };
        assert_eq!(Operation::encode(&command, &RS00), None, "field {field} is no number");
    }
    let nothing = MitState { position_rad: f64::NAN, velocity_rad_s: f64::NAN, torque_nm: f64::NAN };
    assert_eq!(Feedback::pack(&nothing, &RS00), [0x7F, 0xFF, 0x7F, 0xFF, 0x7F, 0xFF]);
}

#[test]
fn frames_of_other_lengths_kinds_and_flags_are_nobodys() {
    let good = Reply::Feedback(Feedback { mode: Mode::Run, faults: 0, state: [0x80; 6], decicelsius: 300 });
    let frame = good.encode(5, HOST);
    let (id, bytes) = (frame.id().raw(), frame.data().to_vec());
    let enable = Request::Enable.encode(HOST, 5).id().raw();
    for length in 0..8 {
        assert_eq!(Reply::decode(&CanFrame::classic(CanId::from_raw(id), &bytes[..length]), 5, HOST), None);
        assert_eq!(Request::decode(&CanFrame::classic(CanId::from_raw(enable), &[0; 8][..length]), 5), None);
    }
    // The motors have no FD, and 11 bits are another frame.
    assert_eq!(Reply::decode(&CanFrame::fd(CanId::from_raw(id), &bytes), 5, HOST), None);
    assert_eq!(Request::decode(&CanFrame::fd(CanId::from_raw(enable), &[0; 8]), 5), None);
    for raw in [id & 0x1FFF_FFFF, id & 0x7FF, id | 0x4000_0000, id | 0x2000_0000] {
        assert_eq!(
            Reply::decode(&CanFrame::classic(CanId::from_raw(raw), &bytes), 5, HOST),
            None,
            "{raw:#x}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn decoders_take_any_frame(
        id in prop_oneof![any::<u32>(), (0_u32..0x2000_0000).prop_map(|id| id | 0x8000_0000)],
        bytes in proptest::collection::vec(any::<u8>(), 0..12),
        fd in any::<bool>(),
        node in prop_oneof![any::<u8>(), Just(0x7F)],
    ) {
        let id = CanId::from_raw(id);
        let frame = if fd { CanFrame::fd(id, &bytes) } else { CanFrame::classic(id, &bytes) };
        let _ = Reply::decode(&frame, node, HOST);
        if let Some((host, request)) = Request::decode(&frame, node) {
            // Masters name themselves in all but operation commands.
            let again = Request::decode(&request.encode(host, node), node);
            assert_eq!(again, Some((host, request)));
        }
    }
}
