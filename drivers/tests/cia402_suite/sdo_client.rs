//! The SDO client alone: what it does with late, foreign, broken and endless answers.
use super::hex;
use taustream_drivers::Nanos;
use taustream_drivers::codec::object::{self, Address};
use taustream_drivers::codec::sdo::{SdoBytes, SdoResponse, SegmentBytes};
use taustream_drivers::codec::sdo_client::{SdoClient, SdoJob, SdoOutcome};

const NAME: Address = object::DEVICE_NAME;

/// A client that reads the device name, with its first request on the way.
fn reading() -> SdoClient {
    let mut client = SdoClient::default();
    client.begin(SdoJob::Read(NAME));
    assert_eq!(sent(&mut client, 0), "601 40 08 10 00 00 00 00 00");
    client
}

fn sent(client: &mut SdoClient, ms: u64) -> String {
    client.poll(Nanos(ms * 1_000_000)).map_or_else(String::new, |request| hex(&request.encode(1)))
}

fn segment(toggle: bool, bytes: &[u8], last: bool) -> SdoResponse {
    SdoResponse::Segment { toggle, bytes: SegmentBytes::from_slice(bytes), last }
}

#[test]
fn segmented_read_collects_the_segments_with_alternating_toggle() {
    let mut client = reading();
    client.accept(SdoResponse::ValueSegmented(NAME, Some(16)));
    for (toggle, bytes, last) in
        [(false, &b"taustre"[..], false), (true, b"am driv", false), (false, b"es", true)]
    {
        let request = if toggle { "601 70" } else { "601 60" };
        assert!(sent(&mut client, 1).starts_with(request));
        assert_eq!(sent(&mut client, 2), "", "one request in flight");
        client.accept(segment(toggle, bytes, last));
    }
    let Some((SdoJob::Read(NAME), SdoOutcome::Value(value))) = client.take() else { panic!("no value") };
    assert_eq!(value.as_slice(), b"taustream drives");
    assert!(client.is_idle() && client.take().is_none());
}

#[test]
fn wrong_toggle_aborts_with_the_toggle_code() {
    let mut client = reading();
    client.accept(SdoResponse::ValueSegmented(NAME, None));
    sent(&mut client, 1);
    client.accept(segment(true, b"x", true));
    assert_eq!(client.take(), None, "the drive is informed first");
    assert_eq!(sent(&mut client, 2), "601 80 08 10 00 00 00 03 05");
    assert_eq!(client.take(), Some((SdoJob::Read(NAME), SdoOutcome::Aborted(0x0503_0000))));
}

#[test]
fn endless_and_oversized_answers_are_aborted() {
    let mut announced = reading();
    announced.accept(SdoResponse::ValueSegmented(NAME, Some(65)));
    assert_eq!(sent(&mut announced, 1), "601 80 08 10 00 12 00 07 06");

    let mut longer = reading();
    longer.accept(SdoResponse::ValueSegmented(NAME, Some(4)));
    let mut toggle = false;
    for ms in 1..20 {
        if sent(&mut longer, ms).starts_with("601 80") {
            break;
        }
        longer.accept(segment(toggle, b"0123456", false));
        toggle = !toggle;
    }
    assert!(matches!(longer.take(), Some((_, SdoOutcome::Aborted(_)))), "it was fed for ever");

    let mut empty = reading();
    empty.accept(SdoResponse::ValueSegmented(NAME, None));
    sent(&mut empty, 1);
    empty.accept(segment(false, b"", false));
    assert!(sent(&mut empty, 2).starts_with("601 80"));
}

#[test]
fn answers_for_another_object_or_job_change_nothing() {
    let mut client = reading();
    let other = Address::new(0x1008, 1);
    for response in [
        SdoResponse::Value(other, SdoBytes::from_u8(1)),
        SdoResponse::Written(NAME),
        SdoResponse::Abort(other, 0x0602_0000),
        SdoResponse::SegmentWritten { toggle: false },
        segment(false, b"x", true),
    ] {
        client.accept(response);
        assert_eq!((client.take(), sent(&mut client, 1)), (None, String::new()), "{response:?}");
    }
    client.accept(SdoResponse::Value(NAME, SdoBytes::from_u8(1)));
    assert!(matches!(client.take(), Some((_, SdoOutcome::Value(_)))));
}

#[test]
fn no_answer_is_asked_three_times_half_a_second_apart_then_aborted() {
    let mut client = reading();
    assert_eq!(sent(&mut client, 499), "");
    assert_eq!(sent(&mut client, 500), "601 40 08 10 00 00 00 00 00");
    assert_eq!(sent(&mut client, 1_000), "601 40 08 10 00 00 00 00 00");
    assert_eq!(sent(&mut client, 1_499), "");
    assert_eq!(sent(&mut client, 1_500), "601 80 08 10 00 00 00 04 05");
    assert_eq!(client.take(), Some((SdoJob::Read(NAME), SdoOutcome::TimedOut)));
}

#[test]
fn lost_segment_starts_the_read_again() {
    let mut client = reading();
    client.accept(SdoResponse::ValueSegmented(NAME, None));
    assert!(sent(&mut client, 1).starts_with("601 60"));
    assert_eq!(sent(&mut client, 501), "601 40 08 10 00 00 00 00 00");
    client.accept(SdoResponse::ValueSegmented(NAME, None));
    assert!(sent(&mut client, 502).starts_with("601 60"));
    client.accept(segment(false, b"ok", true));
    let Some((_, SdoOutcome::Value(value))) = client.take() else { panic!("no value") };
    assert_eq!(value.as_slice(), b"ok");
}

#[test]
fn emergency_write_replaces_the_open_read() {
    let mut client = reading();
    let job = SdoJob::Write(object::CONTROLWORD, SdoBytes::from_u16(0));
    client.begin(job);
    assert_eq!(sent(&mut client, 0), "601 2B 40 60 00 00 00 00 00");
    client.accept(SdoResponse::Value(NAME, SdoBytes::from_u8(1)));
    assert_eq!(client.take(), None);
    client.accept(SdoResponse::Written(object::CONTROLWORD));
    assert_eq!(client.take(), Some((job, SdoOutcome::Written)));
}
