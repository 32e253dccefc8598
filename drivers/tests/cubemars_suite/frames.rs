//! Frames against bytes written out by hand from the manual's tables, and what is nobody's.
use proptest::prelude::{ProptestConfig, any, prop_oneof, proptest};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::cubemars::frames::{Feedback, Request, Special};
use taustream_drivers::{CanFrame, CanId};

const AK70: MitRanges = MitRanges::symmetric(12.5, 50.0, 25.0);

fn hex(frame: &CanFrame) -> String {
    let bytes: Vec<String> = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:03X}#{}", frame.id().as_standard_data().unwrap(), bytes.join(" "))
}

#[test]
fn requests_are_the_bytes_of_the_manual() {
    for (request, golden) in [
        (Request::Special(Special::Enter), "068#FF FF FF FF FF FF FF FC"),
        (Request::Special(Special::Exit), "068#FF FF FF FF FF FF FF FD"),
        (Request::Special(Special::SetZero), "068#FF FF FF FF FF FF FF FE"),
        (Request::Mit(MitCommand::default().encode(&AK70).unwrap()), "068#80 00 80 00 00 00 08 00"),
    ] {
        let frame = request.encode(104);
        assert_eq!(hex(&frame), golden);
        assert_eq!(Request::decode(&frame, 104), Some(request), "{golden}");
        assert_eq!(Request::decode(&frame, 105), None, "{golden} is for motor 104");
    }
    for last in 0..=0xFF_u8 {
        let highest = Request::Mit([0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last]).encode(3);
        assert!(matches!(Request::decode(&highest, 3), Some(Request::Mit(_))), "{}", hex(&highest));
    }
}

#[test]
fn feedback_has_six_or_eight_bytes_under_its_own_identifier_or_another() {
    for feedback_id in [0, 5] {
        let long = Feedback { state: [0x80, 0x12, 0x34, 0x56, 0x78], health: Some([0x41, 3]) };
        let frame = long.encode(5, feedback_id);
        assert_eq!(hex(&frame), format!("{feedback_id:03X}#05 80 12 34 56 78 41 03"));
        assert_eq!(Feedback::decode(&frame, 5, feedback_id), Some(long));
        assert_eq!(long.error(), 3);
        assert_eq!(Feedback::decode(&frame, 4, feedback_id), None, "another motor's");
        assert_eq!(Feedback::decode(&frame, 5, 7), None, "under another identifier");
        assert!(!Request::is_to(&frame, 5, feedback_id), "it is no request");
        let short = Feedback { health: None, ..long };
        let frame = short.encode(5, feedback_id);
        assert_eq!((frame.data().len(), Feedback::decode(&frame, 5, feedback_id)), (6, Some(short)));
        assert_eq!(short.error(), 0);
    }
}

/// Commands of another master under the identifier of the feedback: seen but for those of one angle in 256.
#[test]
fn foreign_commands_under_the_identifier_of_the_feedback_are_seen() {
    let mut unseen = 0;
    for position in 0..=u16::MAX {
        let [high, low] = position.to_be_bytes();
        let frame = Request::Mit([high, low, 0x80, 0, 0x80, 0x10, 8, 0]).encode(5);
        unseen += u32::from(!Request::is_to(&frame, 5, 5));
        assert!(Request::is_to(&frame, 5, 0), "with another identifier always");
    }
    assert_eq!(unseen, 256);
    for special in [Special::Enter, Special::Exit, Special::SetZero] {
        assert!(Request::is_to(&Request::Special(special).encode(5), 5, 5));
    }
}

#[test]
fn frames_of_other_lengths_kinds_and_flags_are_nobodys() {
    let bytes = [5, 0x80, 0x12, 0x34, 0x56, 0x78, 41, 0];
    for length in [0, 1, 2, 3, 4, 5, 7] {
        let short = CanFrame::classic(CanId::standard(5), &bytes[..length]);
        assert_eq!(Feedback::decode(&short, 5, 5), None, "{length} bytes");
        assert_eq!(Request::decode(&short, 5), None, "{length} bytes");
    }
    assert_eq!(Feedback::decode(&CanFrame::fd(CanId::standard(5), &bytes), 5, 5), None);
    assert_eq!(Request::decode(&CanFrame::fd(CanId::standard(5), &[0xFF; 8]), 5), None);
    for flag in [0x8000_0000, 0x4000_0000, 0x2000_0000] {
        let frame = CanFrame::classic(CanId::from_raw(flag | 5), &bytes);
        assert_eq!(Feedback::decode(&frame, 5, 5), None, "flag {flag:#x}");
        assert_eq!(Request::decode(&frame, 5), None, "flag {flag:#x}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn decoders_take_any_frame(
        id in prop_oneof![any::<u32>(), 0_u32..0x100],
        bytes in proptest::collection::vec(any::<u8>(), 0..12),
        fd in any::<bool>(),
        node in any::<u8>(),
        feedback in any::<u16>(),
    ) {
        let id = CanId::from_raw(id);
        let frame = if fd { CanFrame::fd(id, &bytes) } else { CanFrame::classic(id, &bytes) };
        let _ = Feedback::decode(&frame, node, feedback);
        if let Some(request) = Request::decode(&frame, node) {
            assert_eq!(frame.data().len(), 8);
            let again = Request::decode(&request.encode(node), node);
            // What would read as a special request is sent one step lower.
            assert!(again == Some(request) || matches!(request, Request::Mit([0xFF, 0xFF, ..])));
        }
    }
}
