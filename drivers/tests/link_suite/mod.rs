//! What every CAN link promises, written once and run on each implementation.
//!
//! The binary that includes it says how its kind of link is opened, lost and brought back ([`Bench`]) and sets
//! [`CountingAllocator`] as its global allocator.
use std::time::Duration;
use taustream_drivers::link::{LinkFault, OpenError};
use taustream_drivers::{CanFrame, CanId, CanLink, FrameBatch};

#[path = "../counting/mod.rs"]
mod counting;
pub(crate) use counting::{CountingAllocator, allocations};

/// One bus of the kind under test, to itself.
pub(crate) trait Bench {
    /// Opens the servos' end.
    fn servos(&self) -> Box<dyn CanLink>;
    /// Opens the master's end.
    fn master(&self) -> Result<Box<dyn CanLink>, OpenError>;
    /// Makes the bus, or its other end, vanish.
    fn lose(&self, servos: Box<dyn CanLink>);
    /// Brings it back.
    fn bring_back(&self) -> Box<dyn CanLink>;
    /// From now on the bus takes no frames.
    fn block(&self);
    /// It takes them again; called after the servos have read what is there.
    fn unblock(&self);
}

/// A distinct frame for each number, of every kind and length.
pub(crate) fn numbered(number: u32) -> CanFrame {
    let mut data = [0xA5; 64];
    data[..4].copy_from_slice(&number.to_le_bytes());
    let id = match number % 5 {
        0 => CanId::from_raw(0x8000_0000 | (0x1000 + number)),
        _ => CanId::standard((number % 0x700) as u16),
    };
    match number % 7 {
        0 => CanFrame::fd(id, &data[..[4, 8, 12, 16, 20, 24, 32, 48, 64][number as usize % 9]]),
        kind => CanFrame::classic(id, &data[..(kind as usize + 2).min(8)]),
    }
}

/// Receives until `count` frames are there, or nothing has come for a second.
pub(crate) fn receive_all(link: &mut dyn CanLink, count: usize) -> Vec<CanFrame> {
    let mut batch = FrameBatch::new();
    let mut all = Vec::new();
    let mut idle = 0;
    while all.len() < count && idle < 1000 {
        assert_eq!(link.receive(&mut batch), None, "{} after {} frames", link.describe(), all.len());
        all.extend_from_slice(batch.frames());
        if batch.frames().is_empty() {
            idle += 1;
            std::thread::sleep(Duration::from_millis(1));
        } else {
            idle = 0;
        }
    }
    all
}

/// Lets a fresh servos' end notice its master: a local link does so when it first receives.
fn pair(bench: &dyn Bench) -> (Box<dyn CanLink>, Box<dyn CanLink>) {
    let mut servos = bench.servos();
    let master = bench.master().unwrap_or_else(|error| panic!("master refused: {error}"));
    let mut batch = FrameBatch::new();
    assert_eq!(servos.receive(&mut batch), None);
    assert!(batch.frames().is_empty(), "a fresh link already holds {:?}", batch.frames());
    (master, servos)
}

/// Goal: frames arrive once each, in order, bit for bit, in both directions, whatever the batch sizes.
pub(crate) fn order_and_content_are_kept(bench: &dyn Bench) {
    let (mut master, mut servos) = pair(bench);
    let frames: Vec<CanFrame> = (0..500).map(numbered).collect();
    exchange(master.as_mut(), servos.as_mut(), &frames);
    exchange(servos.as_mut(), master.as_mut(), &frames);
}

fn exchange(from: &mut dyn CanLink, to: &mut dyn CanLink, frames: &[CanFrame]) {
    let mut sent = 0;
    let mut received = Vec::new();
    for size in [1, 7, 64, 13, 2, 64, 31].into_iter().cycle() {
        let batch = &frames[sent..(sent + size).min(frames.len())];
        if batch.is_empty() {
            break;
        }
        let result = from.send(batch);
        assert_eq!((result.count, result.fault), (batch.len(), None));
        sent += batch.len();
        received.extend(receive_all(to, batch.len()));
    }
    assert_eq!(received.len(), frames.len());
    for (number, (got, sent)) in received.iter().zip(frames).enumerate() {
        assert_eq!(got, sent, "frame {number}");
    }
}

/// Goal: the largest batch goes through in one call each way, and an empty one does nothing.
pub(crate) fn largest_batch_takes_one_call_each_way(bench: &dyn Bench) {
    let (mut master, mut servos) = pair(bench);
    let frames: Vec<CanFrame> = (0..64).map(numbered).collect();
    let sent = master.send(&frames);
    assert_eq!((sent.count, sent.fault), (64, None));
    std::thread::sleep(Duration::from_millis(20));
    let mut batch = FrameBatch::new();
    assert_eq!(servos.receive(&mut batch), None);
    assert_eq!(batch.frames(), &frames[..]);
    let sent = master.send(&[]);
    assert_eq!((sent.count, sent.fault), (0, None));
    assert_eq!(servos.receive(&mut batch), None);
    assert!(batch.frames().is_empty());
    // More than a cycle may send is not taken whole, for the number of system calls is bounded; and that is said.
    let flood: Vec<CanFrame> = (0..300).map(numbered).collect();
    let sent = master.send(&flood);
    assert!((64..300).contains(&sent.count) && sent.fault.is_some(), "{sent:?}");
    assert_eq!(receive_all(servos.as_mut(), sent.count), &flood[..sent.count]);
}

/// Goal: an end receives nothing when nothing was sent, and never its own frames.
pub(crate) fn silence_and_own_frames_are_not_received(bench: &dyn Bench) {
    let (mut master, mut servos) = pair(bench);
    let mut batch = FrameBatch::new();
    assert_eq!(master.receive(&mut batch), None);
    assert!(batch.frames().is_empty(), "nothing was sent, but {:?} came", batch.frames());
    assert_eq!(master.send(&[numbered(1), numbered(2)]).count, 2);
    assert_eq!(receive_all(servos.as_mut(), 2).len(), 2, "the frames did go out");
    assert_eq!(master.receive(&mut batch), None);
    assert!(batch.frames().is_empty(), "the master heard itself: {:?}", batch.frames());
    assert_eq!(servos.send(&[numbered(3)]).count, 1);
    assert_eq!(receive_all(master.as_mut(), 1), [numbered(3)]);
    assert_eq!(servos.receive(&mut batch), None);
    assert!(batch.frames().is_empty(), "the servos heard themselves: {:?}", batch.frames());
}

/// Goal: when the queue is full, sending reports it, at once and with a true count; afterwards it works again.
pub(crate) fn full_queue_is_reported_and_passes(bench: &dyn Bench) {
    let (mut master, mut servos) = pair(bench);
    bench.block();
    let mut taken = 0_usize;
    let mut fault = None;
    for _ in 0..200 {
        let first = u32::try_from(taken).unwrap();
        let batch: Vec<CanFrame> = (first..first + 64).map(numbered).collect();
        let sent = master.send(&batch);
        taken += sent.count;
        assert_eq!(sent.fault.is_some(), sent.count < batch.len(), "{sent:?}");
        fault = sent.fault;
        if fault.is_some() {
            break;
        }
    }
    assert_eq!(fault, Some(LinkFault::QueueFull), "{taken} frames were taken");
    // What was counted as taken arrives, and nothing else.
    let received = receive_all(servos.as_mut(), taken);
    for (number, got) in received.iter().enumerate() {
        assert_eq!(*got, numbered(u32::try_from(number).unwrap()), "frame {number} of {taken}");
    }
    assert_eq!(received.len(), taken);
    bench.unblock();
    assert_eq!(master.send(&[numbered(9)]).fault, None);
    assert_eq!(receive_all(servos.as_mut(), 1), [numbered(9)]);
}

/// Goal: a bus that has vanished is reported by both calls, stays reported, and comes back by `reopen` alone.
pub(crate) fn lost_bus_is_gone_until_reopened(bench: &dyn Bench) {
    let (mut master, servos) = pair(bench);
    bench.lose(servos);
    let mut batch = FrameBatch::new();
    for round in 0..3 {
        let sent = master.send(&[numbered(1)]);
        assert_eq!((sent.count, sent.fault), (0, Some(LinkFault::Gone)), "send, round {round}");
        assert_eq!(master.receive(&mut batch), Some(LinkFault::Gone), "receive, round {round}");
        assert!(batch.frames().is_empty());
    }
    assert!(master.reopen().is_err(), "reopened what is not there");
    let mut servos = bench.bring_back();
    let sent = master.send(&[numbered(2)]);
    assert_eq!(sent.fault, Some(LinkFault::Gone), "came back without being asked");
    master.reopen().unwrap_or_else(|error| panic!("could not reopen: {error}"));
    assert_eq!(servos.receive(&mut batch), None);
    assert_eq!(master.send(&[numbered(3)]).fault, None);
    assert_eq!(receive_all(servos.as_mut(), 1), [numbered(3)]);
}

/// Goal: one master at a time; the refusal names the holder, and ends with it.
pub(crate) fn second_master_is_refused(bench: &dyn Bench) {
    let (mut master, mut servos) = pair(bench);
    let own_pid = std::process::id();
    match bench.master() {
        Ok(_) => panic!("two masters on one bus"),
        Err(OpenError::MasterPresent { holder, .. }) => assert_eq!(holder.pid, Some(own_pid)),
        Err(other) => panic!("refused for the wrong reason: {other}"),
    }
    assert_eq!(master.send(&[numbered(1)]).fault, None, "the refusal harmed the master");
    assert_eq!(receive_all(servos.as_mut(), 1), [numbered(1)]);
    drop(master);
    let mut batch = FrameBatch::new();
    assert_eq!(servos.receive(&mut batch), None);
    let mut next = bench.master().unwrap_or_else(|error| panic!("the lock outlived its holder: {error}"));
    assert_eq!(servos.receive(&mut batch), None);
    assert_eq!(next.send(&[numbered(2)]).fault, None);
    assert_eq!(receive_all(servos.as_mut(), 1), [numbered(2)]);
}

/// Goal: the hot path never allocates, in good and in bad times.
pub(crate) fn hot_path_does_not_allocate(bench: &dyn Bench) {
    let (mut master, mut servos) = pair(bench);
    let frames: Vec<CanFrame> = (0..7).map(numbered).collect();
    let mut batch = FrameBatch::new();
    let mut received = 0;
    let calls = allocations(|| {
        for _ in 0..200 {
            received += usize::from(master.send(&frames).count == 7);
            let _ = servos.receive(&mut batch);
            let _ = servos.send(&frames);
            let _ = master.receive(&mut batch);
            received += batch.frames().len();
        }
    });
    assert_eq!(calls, 0, "allocations and frees in 200 rounds");
    assert!(received > 200, "only {received} frames moved");
    bench.lose(servos);
    let calls = allocations(|| {
        for _ in 0..200 {
            let _ = master.send(&frames);
            let _ = master.receive(&mut batch);
        }
    });
    assert_eq!(calls, 0, "allocations and frees in 200 rounds on a lost bus");
    drop(bench.bring_back());
}
