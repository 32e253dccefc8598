//! The promises of every link, kept by the local link. The test machine runs the same suite on SocketCAN.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use taustream_arm::{Bus, BusKind};
use taustream_drivers::link::{LinkChoice, LinkRole, OpenError, open};
use taustream_drivers::{CanFrame, CanId, CanLink, FrameBatch};

mod link_suite;
use link_suite::{Bench, CountingAllocator, numbered, receive_all};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// A runtime directory of its own, removed at the end.
struct LocalBench {
    runtime: PathBuf,
    bus: Bus,
}

impl LocalBench {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let name = format!("tau-link-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        Self { runtime: std::env::temp_dir().join(name), bus: bus("vcan0", BusKind::Virtual) }
    }
    fn open(&self, role: LinkRole) -> Result<Box<dyn CanLink>, OpenError> {
        open(&self.bus, LinkChoice::Local, role, &self.runtime)
    }
    fn socket(&self) -> PathBuf {
        self.runtime.join("links/vcan0.socket")
    }
}

impl Drop for LocalBench {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.runtime);
    }
}

impl Bench for LocalBench {
    fn servos(&self) -> Box<dyn CanLink> {
        self.open(LinkRole::Servos).unwrap_or_else(|error| panic!("servos refused: {error}"))
    }
    fn master(&self) -> Result<Box<dyn CanLink>, OpenError> {
        self.open(LinkRole::Master)
    }
    fn lose(&self, servos: Box<dyn CanLink>) {
        drop(servos);
    }
    fn bring_back(&self) -> Box<dyn CanLink> {
        self.servos()
    }
    // A local link blocks by itself when the servos do not read, and unblocks when they do.
    fn block(&self) {}
    fn unblock(&self) {}
}

fn bus(interface: &str, kind: BusKind) -> Bus {
    Bus::new("arm", interface, kind)
}

#[test]
fn local_link_keeps_order_and_content() {
    link_suite::order_and_content_are_kept(&LocalBench::new());
}

#[test]
fn local_link_takes_the_largest_batch_in_one_call() {
    link_suite::largest_batch_takes_one_call_each_way(&LocalBench::new());
}

#[test]
fn local_link_receives_nothing_from_silence_nor_from_itself() {
    link_suite::silence_and_own_frames_are_not_received(&LocalBench::new());
}

#[test]
fn local_link_reports_a_full_queue() {
    link_suite::full_queue_is_reported_and_passes(&LocalBench::new());
}

#[test]
fn local_link_whose_servos_have_gone_waits_for_reopen() {
    link_suite::lost_bus_is_gone_until_reopened(&LocalBench::new());
}

#[test]
fn local_link_refuses_a_second_master() {
    link_suite::second_master_is_refused(&LocalBench::new());
}

#[test]
fn local_link_does_not_allocate() {
    link_suite::hot_path_does_not_allocate(&LocalBench::new());
}

/// Goal: the meeting point is this user's alone, is not taken twice, and a stale one is no obstacle.
#[test]
fn local_meeting_point_is_private_exclusive_and_survives_a_crash() {
    let bench = LocalBench::new();
    let servos = bench.servos();
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&bench.socket()), 0o600);
    assert_eq!(mode(bench.socket().parent().unwrap()), 0o700);
    assert!(matches!(bench.open(LinkRole::Servos), Err(OpenError::ServosPresent { .. })));
    drop(servos);
    assert!(!bench.socket().exists(), "left its socket behind");
    // As after a SIGKILL: a socket file without a listener.
    drop(std::os::unix::net::UnixListener::bind(bench.socket()).unwrap());
    assert!(matches!(bench.master(), Err(OpenError::NoServos { .. })));
    let _servos = bench.servos();
    bench.master().unwrap_or_else(|error| panic!("{error}"));
}

/// Goal: a directory in which others may write is not trusted, for whoever connects may move the arm.
#[test]
fn local_link_refuses_a_directory_open_to_others() {
    let bench = LocalBench::new();
    let directory = bench.runtime.join("links");
    std::fs::create_dir_all(&directory).unwrap();
    std::fs::set_permissions(&directory, PermissionsExt::from_mode(0o770)).unwrap();
    let Err(refusal) = bench.master() else { panic!("trusted a directory open to its group") };
    assert!(refusal.to_string().contains("chmod 0700"), "{refusal}");
}

/// Goal: packets that are no frames are left out, a lying length is cut, and neither harms the frames around them.
#[test]
fn local_link_survives_malformed_packets() {
    use rustix::net::{AddressFamily, SendFlags, SocketAddrUnix, SocketType};
    let bench = LocalBench::new();
    let mut servos = bench.servos();
    let peer = rustix::net::socket(AddressFamily::UNIX, SocketType::SEQPACKET, None).unwrap();
    rustix::net::connect(&peer, &SocketAddrUnix::new(bench.socket()).unwrap()).unwrap();
    let mut lying = [0xFF_u8; 72];
    lying[..4].copy_from_slice(&0x123_u32.to_le_bytes());
    let packets: [&[u8]; 6] = [&[7], &lying[..16], &[0; 71], &lying, &[0; 300], &lying[..16]];
    for packet in packets {
        assert_eq!(rustix::net::send(&peer, packet, SendFlags::empty()), Ok(packet.len()));
    }
    let frames = receive_all(servos.as_mut(), 3);
    let id = CanId::standard(0x123);
    let classic = CanFrame::classic(id, &[0xFF; 8]);
    assert_eq!(frames.len(), 3);
    assert_eq!((&frames[0], &frames[2]), (&classic, &classic));
    assert!(frames[1].is_fd() && frames[1].data() == [0xFF; 64]);
}

/// Goal: a server that polls the link sleeps while nothing happens, and wakes for a master, a frame and a disconnect.
#[test]
fn local_servos_are_ready_only_when_there_is_work() {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let is_ready = |link: &dyn CanLink| {
        let mut wanted = [PollFd::from_borrowed_fd(link.readiness().unwrap(), PollFlags::IN)];
        poll(&mut wanted, Some(&Timespec { tv_sec: 0, tv_nsec: 20_000_000 })).unwrap() == 1
    };
    let bench = LocalBench::new();
    let mut servos = bench.servos();
    let mut batch = FrameBatch::new();
    let mut settle = |servos: &mut Box<dyn CanLink>| {
        assert_eq!(servos.receive(&mut batch), None);
        batch.frames().len()
    };
    assert!(!is_ready(servos.as_ref()), "no master yet");
    let mut master = bench.master().unwrap();
    assert!(is_ready(servos.as_ref()), "a master waits");
    assert_eq!(settle(&mut servos), 0);
    assert!(!is_ready(servos.as_ref()), "the master is silent");
    assert_eq!(master.send(&[numbered(1)]).count, 1);
    assert!(is_ready(servos.as_ref()), "a frame is there");
    assert_eq!(settle(&mut servos), 1);
    drop(master);
    assert!(is_ready(servos.as_ref()), "the master has gone");
    assert_eq!(settle(&mut servos), 0);
    assert!(!is_ready(servos.as_ref()), "still no master");
    let _next = bench.master().unwrap();
    assert!(is_ready(servos.as_ref()), "the next master waits");
}

/// Goal: what cannot be opened is refused with one sentence that names the offender.
#[test]
fn link_open_refuses_what_it_cannot_serve() {
    let bench = LocalBench::new();
    let real = BusKind::Classic { bitrate_bit_s: 1_000_000 };
    let long = "a-name-of-16-by.";
    let cases = [
        (bus("vcan0", real), LinkChoice::Local, "taustream-servosim"),
        (bus("vcan0", BusKind::Virtual), LinkChoice::Local, "taustream-servosim"),
        (bus("", BusKind::Virtual), LinkChoice::Local, "is no interface name"),
        (bus("../../x", BusKind::Virtual), LinkChoice::Local, "is no interface name"),
        (bus("..", BusKind::Virtual), LinkChoice::Auto, "is no interface name"),
        (bus(long, BusKind::Virtual), LinkChoice::Auto, "is no interface name"),
        (bus("no-such-can", real), LinkChoice::Auto, "no-such-can"),
        (bus("no-such-can", BusKind::Virtual), LinkChoice::SocketCan, "no-such-can"),
    ];
    for (bus, choice, wanted) in cases {
        let Err(refusal) = open(&bus, choice, LinkRole::Master, &bench.runtime) else {
            panic!("{bus:?} {choice} opened");
        };
        let text = refusal.to_string();
        assert!(text.contains(wanted) && !text.contains('\n'), "{bus:?} {choice}: {text}");
    }
    let deep = bench.runtime.join("x".repeat(120));
    let refusal = open(&bench.bus, LinkChoice::Local, LinkRole::Servos, &deep).err();
    assert!(matches!(refusal, Some(OpenError::PathTooLong { .. })), "{refusal:?}");
}

#[test]
fn link_choice_words_are_read_back_and_others_refused() {
    for choice in [LinkChoice::Auto, LinkChoice::SocketCan, LinkChoice::Local] {
        assert_eq!(choice.to_string().parse(), Ok(choice));
    }
    assert!("can0".parse::<LinkChoice>().is_err());
}
