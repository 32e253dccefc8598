//! CANopen frames against bytes written out from CiA 301, and decoders against anything.
use super::{SeededRng, frame, hex};
use taustream_drivers::codec::canopen::{Emcy, Nmt, NmtCommand, NmtState, PdoEntry, decode_sync, sync};
use taustream_drivers::codec::cia402::{DriveStep, decode_rpdo, decode_tpdo, encode_rpdo, encode_tpdo};
use taustream_drivers::codec::object::{self, Address};
use taustream_drivers::codec::sdo::{SdoBytes, SdoRequest, SdoResponse, SegmentBytes};
use taustream_drivers::codec::{emcy, error_text};
use taustream_drivers::{CanFrame, CanId};

#[test]
fn sdo_requests_are_the_bytes_of_the_table_both_ways() {
    let at = Address::new(0x1A00, 2);
    let seven = SegmentBytes::from_slice(b"abcdefg");
    let cases = [
        (SdoRequest::Read(at), "605 40 00 1A 02 00 00 00 00"),
        (SdoRequest::Write(at, SdoBytes::from_u8(0x12)), "605 2F 00 1A 02 12 00 00 00"),
        (SdoRequest::Write(at, SdoBytes::from_i16(-2)), "605 2B 00 1A 02 FE FF 00 00"),
        (SdoRequest::Write(at, SdoBytes::from_slice(&[1, 2, 3]).unwrap()), "605 27 00 1A 02 01 02 03 00"),
        (SdoRequest::Write(at, SdoBytes::from_i32(-2)), "605 23 00 1A 02 FE FF FF FF"),
        (SdoRequest::WriteSegmented(at, Some(9)), "605 21 00 1A 02 09 00 00 00"),
        (SdoRequest::WriteSegmented(at, None), "605 20 00 1A 02 00 00 00 00"),
        (SdoRequest::ReadSegment { toggle: false }, "605 60 00 00 00 00 00 00 00"),
        (SdoRequest::ReadSegment { toggle: true }, "605 70 00 00 00 00 00 00 00"),
        (SdoRequest::WriteSegment { toggle: true, bytes: seven, last: true }, "605 11 61 62 63 64 65 66 67"),
        (SdoRequest::Abort(at, 0x0503_0000), "605 80 00 1A 02 00 00 03 05"),
    ];
    for (request, bytes) in cases {
        assert_eq!(hex(&request.encode(5)), bytes);
        assert_eq!(SdoRequest::decode(&request.encode(5)), Some((5, request)), "{bytes}");
        assert_eq!(SdoResponse::decode(&request.encode(5)), None, "{bytes}");
    }
}

#[test]
fn sdo_responses_are_the_bytes_of_the_table_both_ways() {
    let at = Address::new(0x1008, 0);
    let two = SegmentBytes::from_slice(b"hi");
    let cases = [
        (SdoResponse::Value(at, SdoBytes::from_u8(7)), "585 4F 08 10 00 07 00 00 00"),
        (SdoResponse::Value(at, SdoBytes::from_u16(7)), "585 4B 08 10 00 07 00 00 00"),
        (SdoResponse::Value(at, SdoBytes::from_u32(7)), "585 43 08 10 00 07 00 00 00"),
        (SdoResponse::ValueSegmented(at, Some(14)), "585 41 08 10 00 0E 00 00 00"),
        (SdoResponse::Segment { toggle: false, bytes: two, last: true }, "585 0B 68 69 00 00 00 00 00"),
        (SdoResponse::Segment { toggle: true, bytes: two, last: false }, "585 1A 68 69 00 00 00 00 00"),
        (SdoResponse::Written(at), "585 60 08 10 00 00 00 00 00"),
        (SdoResponse::SegmentWritten { toggle: true }, "585 30 00 00 00 00 00 00 00"),
        (SdoResponse::Abort(at, 0x0602_0000), "585 80 08 10 00 00 00 02 06"),
    ];
    for (response, bytes) in cases {
        assert_eq!(hex(&response.encode(5)), bytes);
        assert_eq!(SdoResponse::decode(&response.encode(5)), Some((5, response)), "{bytes}");
    }
    // A size that is not given means four bytes; what stands in unused bytes of a given size does not count.
    let Some((5, SdoResponse::Value(_, value))) =
        SdoResponse::decode(&frame(0x585, &[0x42, 8, 16, 0, 1, 2, 3, 4]))
    else {
        panic!("size not given is a value")
    };
    assert_eq!((value.as_slice(), value.is_sized()), (&[1, 2, 3, 4][..], false));
    let Some((5, SdoResponse::Value(_, value))) =
        SdoResponse::decode(&frame(0x585, &[0x4B, 8, 16, 0, 1, 2, 0xEE, 0xEE]))
    else {
        panic!("two bytes are a value")
    };
    assert_eq!((value.as_u32(), value.as_slice()), (0x0201, &[1, 2][..]));
}

#[test]
fn other_frames_are_the_bytes_of_the_table_both_ways() {
    let nmt = Nmt { command: NmtCommand::ResetCommunication, node: 3 };
    assert_eq!((hex(&nmt.encode()), Nmt::decode(&nmt.encode())), ("000 82 03".into(), Some(nmt)));
    assert_eq!((hex(&sync()), decode_sync(&sync())), ("080".into(), Some(None)));
    assert_eq!(decode_sync(&frame(0x080, &[9])), Some(Some(9)));
    for (state, byte) in [
        (NmtState::BootUp, "00"),
        (NmtState::Stopped, "04"),
        (NmtState::Operational, "05"),
        (NmtState::PreOperational, "7F"),
    ] {
        assert_eq!(hex(&state.encode(0x7E)), format!("77E {byte}"));
        assert_eq!(NmtState::decode(&state.encode(0x7E)), Some((0x7E, state)));
    }
    let emcy = Emcy { code: 0x8611, error_register: 0x21, vendor: [1, 2, 3, 4, 5] };
    assert_eq!(hex(&emcy.encode(2)), "082 11 86 21 01 02 03 04 05");
    assert_eq!(Emcy::decode(&emcy.encode(2)), Some((2, emcy)));
    assert_eq!(PdoEntry::new(object::TARGET_POSITION, 32).encode(), 0x607A_0020);
    assert_eq!(PdoEntry::decode(0x6041_0010), PdoEntry::new(object::STATUSWORD, 16));
    assert_eq!(hex(&encode_rpdo(4, 0x000F, -2)), "204 0F 00 FE FF FF FF");
    assert_eq!(decode_rpdo(&encode_rpdo(4, 0x000F, -2)), Some((4, 0x000F, -2)));
    assert_eq!(hex(&encode_tpdo(4, 0x1237, 0x0102_0304)), "184 37 12 04 03 02 01");
    assert_eq!(decode_tpdo(&encode_tpdo(4, 0x1237, i32::MIN)), Some((4, 0x1237, i32::MIN)));
    assert_eq!(Address::new(0x60C2, 2).to_string(), "0x60C2:02");
}

#[test]
fn statuswords_of_the_table_state_their_state_whatever_the_other_bits() {
    let table = [
        (0x004F, 0x0000, DriveStep::NotReady),
        (0x004F, 0x0040, DriveStep::SwitchOnDisabled),
        (0x006F, 0x0021, DriveStep::ReadyToSwitchOn),
        (0x006F, 0x0023, DriveStep::SwitchedOn),
        (0x006F, 0x0027, DriveStep::OperationEnabled),
        (0x006F, 0x0007, DriveStep::QuickStopActive),
        (0x004F, 0x000F, DriveStep::FaultReaction),
        (0x004F, 0x0008, DriveStep::Fault),
    ];
    for word in 0..=u16::MAX {
        let rows: Vec<DriveStep> =
            table.iter().filter(|row| word & row.0 == row.1).map(|row| row.2).collect();
        assert!(rows.len() <= 1, "{word:#06x} stands in two rows");
        assert_eq!(DriveStep::from_status(word), rows.first().copied(), "{word:#06x}");
    }
}

#[test]
fn words_exist_for_every_code_of_the_tables() {
    let aborts = [
        0x0503_0000,
        0x0504_0000,
        0x0504_0001,
        0x0601_0000,
        0x0601_0001,
        0x0601_0002,
        0x0602_0000,
        0x0604_0041,
        0x0604_0042,
        0x0604_0043,
        0x0607_0010,
        0x0607_0012,
        0x0607_0013,
        0x0609_0011,
        0x0609_0030,
        0x0609_0031,
        0x0609_0032,
        0x060A_0023,
        0x0800_0000,
        0x0800_0020,
        0x0800_0021,
        0x0800_0022,
    ];
    let mut seen: Vec<&str> = aborts.iter().map(|code| error_text::sdo_abort(*code)).collect();
    assert!(seen.iter().all(|sentence| !sentence.contains("does not list")));
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), aborts.len(), "two codes share a sentence");
    let emergencies = [
        0x0000, 0x1000, 0x2310, 0x3210, 0x3220, 0x4210, 0x4310, 0x5441, 0x7121, 0x7305, 0x7500, 0x8110,
        0x8120, 0x8130, 0x8140, 0x8210, 0x8220, 0x8250, 0x8611, 0x8612,
    ];
    for code in emergencies {
        assert!(!emcy::words(code).contains("does not list"), "{code:#06x}");
    }
}

#[test]
fn decoders_take_any_frame_and_give_back_only_what_they_can_encode() {
    let mut decoded = 0;
    for seed in 0..200_000 {
        let mut rng = SeededRng::from_seed(seed);
        let any = rng.frame();
        if let Some((node, request)) = SdoRequest::decode(&any) {
            assert_eq!(SdoRequest::decode(&request.encode(node)), Some((node, request)), "seed {seed}");
            decoded += 1;
        }
        if let Some((node, response)) = SdoResponse::decode(&any) {
            assert_eq!(SdoResponse::decode(&response.encode(node)), Some((node, response)), "seed {seed}");
            decoded += 1;
        }
        if let Some((node, emcy)) = Emcy::decode(&any) {
            assert_eq!(emcy.encode(node), any, "seed {seed}");
        }
        if let Some((node, state)) = NmtState::decode(&any) {
            assert_eq!(state.encode(node), any, "seed {seed}");
        }
        if let Some((node, status, position)) = decode_tpdo(&any) {
            assert_eq!(encode_tpdo(node, status, position), any, "seed {seed}");
        }
    }
    assert!(decoded > 1_000, "the frames drawn hardly ever decode");
}

#[test]
fn decoders_refuse_other_kinds_of_frames_with_the_same_id() {
    let good = SdoResponse::Written(Address::new(0x6060, 0)).encode(5);
    assert!(SdoResponse::decode(&good).is_some());
    let raw = good.id().raw();
    for id in [raw | 0x8000_0000, raw | 0x4000_0000, raw | 0x2000_0000] {
        assert_eq!(SdoResponse::decode(&CanFrame::classic(CanId::from_raw(id), good.data())), None);
    }
    assert_eq!(SdoResponse::decode(&CanFrame::fd(good.id(), good.data())), None);
    assert_eq!(SdoResponse::decode(&CanFrame::classic(good.id(), &good.data()[..7])), None);
    assert_eq!(decode_tpdo(&frame(0x181, &[0; 5])), None);
    assert_eq!(decode_tpdo(&frame(0x181, &[0; 8])), None);
    assert_eq!(decode_tpdo(&frame(0x180, &[0; 6])), None, "there is no node 0");
}
