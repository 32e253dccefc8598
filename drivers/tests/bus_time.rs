//! The simulator's bus in time: exact frame lengths, arbitration, queues that overflow, two phases of CAN FD.
#![expect(clippy::unwrap_used, reason = "a test ends by panicking")]
use taustream_arm::BusKind;
use taustream_arm::bus_load::frame::{BitRates, Format, Frame};
use taustream_drivers::sim::bit_time::{arbitration, bits, nanoseconds};
use taustream_drivers::sim::wire::{Delivered, Sender, Wire};
use taustream_drivers::{CanFrame, CanId, Nanos};

const CLASSIC: BusKind = BusKind::Classic { bitrate_bit_s: 1_000_000 };
const EXTENDED: u32 = 0x8000_0000;

fn standard(id: u16, data: &[u8]) -> CanFrame {
    CanFrame::classic(CanId::standard(id), data)
}

/// Bits of a classic frame from the definition: the whole frame as a list, the checksum by long division, then stuffing.
fn reference_bits(frame: &CanFrame) -> u32 {
    let mut list = vec![false];
    let mut push = |value: u32, width: u32| (0..width).rev().for_each(|at| list.push(value >> at & 1 == 1));
    let id = frame.id().raw();
    if id & EXTENDED == 0 {
        push(id & 0x7FF, 11);
        push(0, 3);
    } else {
        push(id >> 18 & 0x7FF, 11);
        push(0b11, 2);
        push(id & 0x3_FFFF, 18);
        push(0, 3);
    }
    push(u32::try_from(frame.data().len()).unwrap(), 4);
    frame.data().iter().for_each(|byte| push(u32::from(*byte), 8));
    // x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
    let divisor: Vec<bool> = format!("{:016b}", 0xC599).chars().map(|c| c == '1').collect();
    let mut rest = list.clone();
    rest.extend([false; 15]);
    for at in 0..list.len() {
        if rest[at] {
            rest[at..].iter_mut().zip(&divisor).for_each(|(bit, of)| *bit ^= of);
        }
    }
    list.extend_from_slice(&rest[list.len()..]);
    let mut wire: Vec<bool> = Vec::new();
    for bit in list {
        wire.push(bit);
        if wire.len() >= 5 && wire[wire.len() - 5..].iter().all(|other| *other == bit) && run(&wire) == 5 {
            wire.push(!bit);
        }
    }
    // Checksum delimiter, acknowledgement, its delimiter, end of frame, pause.
    u32::try_from(wire.len()).unwrap() + 1 + 1 + 1 + 7 + 3
}

/// Length of the last run of equal bits.
fn run(wire: &[bool]) -> usize {
    wire.iter().rev().take_while(|bit| Some(*bit) == wire.last()).count()
}

/// Frames of all sizes with contents that stuff a lot, little, and at random.
fn many_frames(make: impl Fn(u32, &[u8]) -> CanFrame, sizes: &[usize]) -> Vec<CanFrame> {
    let mut chance = 1_u32;
    let mut frames = Vec::new();
    for size in sizes {
        for kind in 0..60_u32 {
            let mut byte = || {
                chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                match kind % 4 {
                    0 => 0x00,
                    1 => 0xFF,
                    2 => 0x55,
                    _ => (chance >> 24) as u8,
                }
            };
            let data: Vec<u8> = (0..*size).map(|_| byte()).collect();
            chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            frames.push(make(chance >> 3, &data));
        }
    }
    frames
}

#[test]
fn classic_frames_have_the_bits_of_their_definition_within_the_worst_case() {
    let sizes: Vec<usize> = (0..=8).collect();
    let short = many_frames(|id, data| standard((id & 0x7FF) as u16, data), &sizes);
    let long =
        many_frames(|id, data| CanFrame::classic(CanId::from_raw(EXTENDED | id & 0x1FFF_FFFF), data), &sizes);
    let (mut stuffed, mut unstuffed) = (0, 0);
    for frame in short.iter().chain(&long) {
        let found = bits(frame);
        assert_eq!((found.nominal, found.data), (reference_bits(frame), 0), "{frame:?}");
        let extended = frame.id().raw() & EXTENDED != 0;
        let bytes = u32::try_from(frame.data().len()).unwrap();
        let most = Frame { format: Format::Classic, extended, bytes }.most_bits().nominal;
        let least = if extended { 67 } else { 47 } + 8 * bytes;
        assert!((least..=most).contains(&found.nominal), "{frame:?}: {found:?}");
        stuffed += u32::from(found.nominal > least + 10);
        unstuffed += u32::from(found.nominal <= least + 3);
    }
    assert!(stuffed > 20 && unstuffed > 20, "{stuffed} much stuffed, {unstuffed} hardly");
}

#[test]
fn fd_frames_take_two_phases_within_the_worst_case() {
    let sizes = [0, 1, 8, 9, 12, 16, 24, 48, 64];
    let rates = BitRates { nominal_bit_s: 1_000_000, data_bit_s: 5_000_000 };
    for frame in many_frames(|id, data| CanFrame::fd(CanId::standard((id & 0x7FF) as u16), data), &sizes) {
        let found = bits(&frame);
        let bytes = u32::try_from(frame.data().len()).unwrap();
        let most = Frame::standard(Format::Fd, bytes).most_bits();
        assert!(found.nominal <= most.nominal && found.data <= most.data, "{frame:?}: {found:?} of {most:?}");
        assert!(found.nominal >= 29 && found.data >= 33 + 8 * bytes, "{frame:?}: {found:?}");
        let want_ns = u64::from(found.nominal) * 1_000 + u64::from(found.data) * 200;
        assert_eq!(nanoseconds(&frame, rates), want_ns);
    }
    // Alternating content has no stuff bits but the fixed ones: 17 + 12, and 5 + 64 + 4 + 17 + 6 + 1.
    let plain = CanFrame::fd(CanId::standard(0x555), &[0x55; 8]);
    let found = bits(&plain);
    assert_eq!((found.nominal, found.data), (29, 97), "{found:?}");
}

#[test]
fn lower_identifier_wins_and_a_standard_frame_beats_an_extended_one_with_the_same_beginning() {
    let extended = |id: u32| CanFrame::classic(CanId::from_raw(EXTENDED | id), &[]);
    let order = [
        standard(0x080, &[]),
        standard(0x181, &[]),
        CanFrame::classic(CanId::from_raw(0x4000_0181), &[]),
        extended(0x181 << 18),
        extended(0x181 << 18 | 1),
        standard(0x182, &[]),
    ];
    let keys: Vec<u64> = order.iter().map(arbitration).collect();
    assert!(keys.is_sorted_by(|a, b| a < b), "{keys:X?}");
}

/// Everything that a wire delivers up to `until_us`, looked at every `step_us`.
fn deliveries(wire: &mut Wire, until_us: u64, step_us: u64) -> Vec<Delivered> {
    let mut found = Vec::new();
    let mut at_us = 0;
    while at_us < until_us {
        at_us += step_us;
        while let Some(delivered) = wire.next_by(Nanos(at_us * 1_000)) {
            found.push(delivered);
        }
    }
    found
}

fn ids(found: &[Delivered]) -> Vec<u32> {
    found.iter().map(|delivered| delivered.frame.id().raw()).collect()
}

/// A cycle of three drives: SYNC and setpoints from the master, answers while the setpoints still wait.
fn busy() -> Wire {
    let mut wire = Wire::new(CLASSIC, 8).unwrap();
    for (id, size) in [(0x080, 0), (0x201, 6), (0x202, 6), (0x203, 6)] {
        assert!(wire.offer(Nanos(0), Sender::Master, standard(id, &[0x5A; 8][..size])));
    }
    for id in [0x183, 0x182, 0x181] {
        assert!(wire.offer(Nanos(40_000), Sender::Drive, standard(id, &[0x5A; 6])));
    }
    wire
}

#[test]
fn answers_overtake_setpoints_and_each_frame_takes_its_bits() {
    let mut wire = busy();
    let found = deliveries(&mut wire, 2_000, 10);
    assert_eq!(ids(&found), [0x080, 0x181, 0x182, 0x183, 0x201, 0x202, 0x203]);
    let mut at = 0;
    for delivered in &found {
        at += u64::from(reference_bits(&delivered.frame)) * 1_000;
        assert_eq!(delivered.at, Nanos(at), "{delivered:?}");
    }
    let counters = wire.counters();
    assert_eq!((counters.delivered, counters.busy_ns, counters.longest_queue), (7, at, 4), "{counters:?}");
}

#[test]
fn deliveries_do_not_depend_on_how_often_somebody_looks() {
    let once = deliveries(&mut busy(), 3_000, 3_000);
    for step_us in [1, 7, 100, 1_000] {
        assert_eq!(deliveries(&mut busy(), 3_000, step_us), once, "every {step_us} us");
    }
}

/// The master's queue is first in, first out: an urgent frame behind an unimportant one waits for it.
#[test]
fn head_of_the_masters_queue_holds_up_what_is_behind_it() {
    let mut wire = Wire::new(CLASSIC, 8).unwrap();
    wire.offer(Nanos(0), Sender::Master, standard(0x700, &[5]));
    wire.offer(Nanos(0), Sender::Master, standard(0x080, &[]));
    wire.offer(Nanos(0), Sender::Drive, standard(0x301, &[1; 8]));
    assert_eq!(ids(&deliveries(&mut wire, 1_000, 1_000)), [0x301, 0x700, 0x080]);
}

#[test]
fn full_queues_lose_frames_and_count_them() {
    let mut wire = Wire::new(CLASSIC, 8).unwrap();
    let taken = (0..20).filter(|_| wire.offer(Nanos(0), Sender::Master, standard(0x201, &[0; 8]))).count();
    let kept = (0..5).filter(|_| wire.offer(Nanos(0), Sender::Drive, standard(0x181, &[0; 8]))).count();
    assert!(wire.offer(Nanos(0), Sender::Drive, standard(0x182, &[0; 8])), "another mailbox has room");
    let counters = wire.counters();
    assert_eq!((taken, counters.lost_from_master, kept, counters.lost_from_drives), (8, 12, 2, 3));
    assert_eq!(deliveries(&mut wire, 10_000, 1_000).len(), 11);
    assert_eq!(wire.waiting(), (0, 0));
}

#[test]
fn virtual_bus_has_no_wire_and_an_fd_bus_is_faster_in_its_data() {
    assert!(Wire::new(BusKind::Virtual, 8).is_none());
    let time_ns = |kind: BusKind, frame: CanFrame| {
        let mut wire = Wire::new(kind, 8).unwrap();
        wire.offer(Nanos(0), Sender::Master, frame);
        deliveries(&mut wire, 10_000, 10_000)[0].at.0
    };
    let fd = BusKind::Fd { bitrate_bit_s: 1_000_000, data_bitrate_bit_s: 5_000_000 };
    let data = [0x5A; 64];
    assert_eq!(time_ns(fd, standard(0x201, &data[..8])), time_ns(CLASSIC, standard(0x201, &data[..8])));
    let long_ns = time_ns(fd, CanFrame::fd(CanId::standard(0x201), &data));
    assert!(long_ns < 2 * time_ns(CLASSIC, standard(0x201, &data[..8])), "64 bytes in {long_ns} ns");
}
