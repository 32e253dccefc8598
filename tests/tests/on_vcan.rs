//! The promises of every link, kept by SocketCAN on a real vcan, and what only the kernel's CAN can do.
//!
//! Runs in the vcan machine alone: `cargo test -p taustream-tests --test on_vcan --no-run`, then
//! `vcan-machine -- BINARY`. Elsewhere every test fails and says so: a missing vcan is never skipped over.
#![expect(clippy::expect_used, clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use taustream_arm::{Bus, BusKind};
use taustream_drivers::link::{LinkChoice, LinkFault, LinkRole, OpenError, open};
use taustream_drivers::{CanFrame, CanId, CanLink, FrameBatch};
use taustream_tests::candump;

#[path = "../../drivers/tests/link_suite/mod.rs"]
mod link_suite;
use link_suite::{Bench, CountingAllocator, numbered, receive_all};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// A vcan of its own, deleted at the end.
struct Vcan {
    bus: Bus,
}

impl Vcan {
    fn new(interface: &str) -> Self {
        require_machine();
        let bus = Bus::new("arm", interface, BusKind::Virtual);
        let vcan = Self { bus };
        vcan.add();
        vcan
    }
    fn add(&self) {
        ip(&format!("link add dev {} type vcan", self.bus.interface));
        ip(&format!("link set dev {} mtu 72", self.bus.interface));
        self.set("up");
    }
    fn set(&self, state: &str) {
        ip(&format!("link set dev {} {state}", self.bus.interface));
    }
    fn open(&self, role: LinkRole) -> Result<Box<dyn CanLink>, OpenError> {
        open(&self.bus, LinkChoice::SocketCan, role, Path::new("/nowhere"))
    }
    fn pair(&self) -> (Box<dyn CanLink>, Box<dyn CanLink>) {
        (self.open(LinkRole::Master).unwrap(), self.open(LinkRole::Servos).unwrap())
    }
}

impl Drop for Vcan {
    fn drop(&mut self) {
        // After a failed test it may be gone already.
        let _ = Command::new("ip").args(["link", "del", &self.bus.interface]).stderr(Stdio::null()).status();
    }
}

impl Bench for Vcan {
    fn servos(&self) -> Box<dyn CanLink> {
        self.open(LinkRole::Servos).unwrap()
    }
    fn master(&self) -> Result<Box<dyn CanLink>, OpenError> {
        self.open(LinkRole::Master)
    }
    fn lose(&self, _servos: Box<dyn CanLink>) {
        ip(&format!("link del {}", self.bus.interface));
    }
    fn bring_back(&self) -> Box<dyn CanLink> {
        self.add();
        self.servos()
    }
    // Plain vcan takes everything at once. A token bucket in front of it fills as the queue of a bus does.
    fn block(&self) {
        let bucket = "root tbf rate 500kbit burst 160 limit 320";
        run("tc", &format!("qdisc add dev {} {bucket}", self.bus.interface));
    }
    fn unblock(&self) {
        run("tc", &format!("qdisc del dev {} root", self.bus.interface));
    }
}

fn require_machine() {
    let is_machine = std::env::var_os("TAUSTREAM_VCAN").is_some_and(|value| value == "1");
    assert!(is_machine, "this test needs the vcan machine: run its binary by `vcan-machine -- BINARY`");
}

fn run(program: &str, words: &str) {
    let output = Command::new(program).args(words.split(' ')).output().unwrap();
    assert!(output.status.success(), "{program} {words}: {}", String::from_utf8_lossy(&output.stderr));
}

fn ip(words: &str) {
    run("ip", words);
}

#[test]
fn socketcan_keeps_order_and_content() {
    link_suite::order_and_content_are_kept(&Vcan::new("order"));
}

#[test]
fn socketcan_takes_the_largest_batch_in_one_call() {
    link_suite::largest_batch_takes_one_call_each_way(&Vcan::new("batch"));
}

#[test]
fn socketcan_receives_nothing_from_silence_nor_from_itself() {
    link_suite::silence_and_own_frames_are_not_received(&Vcan::new("silence"));
}

#[test]
fn socketcan_reports_a_full_queue() {
    link_suite::full_queue_is_reported_and_passes(&Vcan::new("full"));
}

#[test]
fn socketcan_whose_interface_was_deleted_waits_for_reopen() {
    link_suite::lost_bus_is_gone_until_reopened(&Vcan::new("lost"));
}

#[test]
fn socketcan_refuses_a_second_master() {
    link_suite::second_master_is_refused(&Vcan::new("second"));
}

#[test]
fn socketcan_does_not_allocate() {
    link_suite::hot_path_does_not_allocate(&Vcan::new("alloc"));
}

/// Goal: while the interface is down both calls say so each time; up again, the same link continues by itself.
#[test]
fn socketcan_interface_down_is_reported_and_up_again_goes_on() {
    let vcan = Vcan::new("down");
    let (mut master, mut servos) = vcan.pair();
    let mut batch = FrameBatch::new();
    vcan.set("down");
    for round in 0..3 {
        let sent = master.send(&[numbered(1)]);
        assert_eq!((sent.count, sent.fault), (0, Some(LinkFault::Down)), "send, round {round}");
        assert_eq!(master.receive(&mut batch), Some(LinkFault::Down), "receive, round {round}");
    }
    vcan.set("up");
    assert_eq!(master.receive(&mut batch), None, "still down, it says");
    assert_eq!(master.send(&[numbered(2)]).fault, None);
    assert_eq!(receive_all(servos.as_mut(), 1), [numbered(2)]);
}

/// Goal: a socket that slept through a down and up holds one stale error; neither call takes it for the truth.
#[test]
fn socketcan_stale_error_after_link_up_is_no_fault() {
    let vcan = Vcan::new("stale");
    let (mut master, mut servos) = vcan.pair();
    for round in 0..3 {
        vcan.set("down");
        vcan.set("up");
        let sent = master.send(&[numbered(round), numbered(round + 1)]);
        assert_eq!((sent.count, sent.fault), (2, None), "round {round}");
        // The servos' first call meets the stale error and the frames behind it.
        let mut batch = FrameBatch::new();
        assert_eq!(servos.receive(&mut batch), None, "round {round}");
        let mut frames = batch.frames().to_vec();
        frames.extend(receive_all(servos.as_mut(), 2 - frames.len()));
        assert_eq!(frames, [numbered(round), numbered(round + 1)], "round {round}");
    }
}

/// Interfaces that hand a frame back when it was on the wire, as controllers do: vcan with `echo=1`. Every vcan of the
/// machine is made again for it, and again at the end.
struct EchoingVcan(Vcan);

impl EchoingVcan {
    fn new(interface: &str) -> Self {
        require_machine();
        Self::load("vcan echo=1");
        Self(Vcan::new(interface))
    }
    fn load(words: &str) {
        run("modprobe", "-r vcan");
        run("modprobe", words);
    }
}

impl Drop for EchoingVcan {
    fn drop(&mut self) {
        for words in ["-r vcan", "vcan"] {
            let _ = Command::new("modprobe").args(words.split(' ')).status();
        }
        for words in ["link add dev vcan0 type vcan", "link set vcan0 mtu 72", "link set vcan0 up"] {
            for interface in ["vcan0", "vcan1"] {
                let _ = Command::new("ip").args(words.replace("vcan0", interface).split(' ')).status();
            }
        }
    }
}

/// Receives until so many own frames are confirmed, or a second has passed; nothing else may come.
fn await_confirmed(link: &mut dyn CanLink, count: u64) -> u64 {
    let mut batch = FrameBatch::new();
    for _ in 0..1000 {
        assert_eq!(link.receive(&mut batch), None);
        assert!(batch.frames().is_empty(), "its own frames reach the master: {:?}", batch.frames());
        if link.confirmed() >= Some(count) {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    link.confirmed().unwrap()
}

/// Goal: a frame counts as confirmed when it was on the wire, not when it was queued; on an interface without an echo
/// of its own, at once; and a servos' end, which needs none, has none.
#[test]
fn socketcan_frames_are_confirmed_when_they_were_on_the_wire() {
    let frames: Vec<CanFrame> = (0..7).map(numbered).collect();
    {
        let vcan = Vcan::new("plain");
        let (mut master, servos) = vcan.pair();
        assert_eq!((master.confirmed(), servos.confirmed()), (Some(0), None));
        assert_eq!(master.send(&frames).count, 7);
        assert_eq!(await_confirmed(master.as_mut(), 7), 7);
    }
    let vcan = EchoingVcan::new("echo");
    let (mut master, mut servos) = vcan.0.pair();
    run("tc", "qdisc add dev echo root netem delay 300ms limit 100");
    assert_eq!(master.send(&frames).count, 7);
    let mut batch = FrameBatch::new();
    assert_eq!(master.receive(&mut batch), None);
    assert_eq!(master.confirmed(), Some(0), "confirmed before it was on the wire");
    assert_eq!(await_confirmed(master.as_mut(), 7), 7);
    assert_eq!(receive_all(servos.as_mut(), 7), frames);
}

/// Goal: what still waits in a queue after a fault never reaches a drive behind our back: a link is not restarted
/// before it has left, or was dropped by taking the interface down, which is the remedy that the refusal names.
#[test]
fn socketcan_is_not_reopened_while_old_frames_wait_and_down_drops_them() {
    let vcan = EchoingVcan::new("stale");
    let (mut master, mut servos) = vcan.0.pair();
    // One frame in a second or so, of those that a burst of two has left; netem would not do, for it disowns its frames.
    run("tc", "qdisc add dev stale root tbf rate 100bit burst 32 limit 3200");
    assert_eq!(master.send(&[1, 2, 3, 4, 5, 6].map(numbered)).count, 6);
    let Err(refusal) = master.reopen() else { panic!("reopened over frames that wait") };
    let remedy = "ip link set stale down && ip link set stale up";
    assert!(refusal.to_string().contains(remedy), "{refusal}");
    ip("link set stale down");
    assert!(master.reopen().is_err(), "reopened on an interface that is down");
    ip("link set stale up");
    run("tc", "qdisc del dev stale root");
    master.reopen().unwrap_or_else(|error| panic!("the queue was not dropped: {error}"));
    assert_eq!(master.confirmed(), Some(0));
    assert_eq!(master.send(&[numbered(9)]).fault, None);
    let mut batch = FrameBatch::new();
    let mut seen = Vec::new();
    for _ in 0..100 {
        // The first call may tell of the time when the interface was down.
        let _set = servos.receive(&mut batch);
        seen.extend_from_slice(batch.frames());
        std::thread::sleep(Duration::from_millis(1));
    }
    let first = seen.iter().position(|frame| *frame == numbered(9)).expect("the new frame");
    assert!(first <= 2 && seen.len() == first + 1, "old frames were still sent: {seen:?}");
}

/// Goal: closing the socket alone drops nothing that waits: this is why reopening has to look first.
#[test]
fn socketcan_closed_with_frames_in_the_queue_still_sends_them() {
    let vcan = EchoingVcan::new("closed");
    let (mut master, mut servos) = vcan.0.pair();
    run("tc", "qdisc add dev closed root netem delay 200ms limit 100");
    assert_eq!(master.send(&[numbered(5)]).count, 1);
    drop(master);
    assert_eq!(receive_all(servos.as_mut(), 1), [numbered(5)]);
}

/// Goal: everything that a controller tells of itself reaches the master as error frames; lost arbitration and bare bus
/// errors, which flood, do not.
#[test]
fn socketcan_error_frames_of_the_chosen_classes_are_received() {
    let vcan = Vcan::new("errors");
    let (mut master, mut servos) = vcan.pair();
    let error =
        |class: u32| CanFrame::classic(CanId::from_raw(0x2000_0000 | class), &[0, 0x10, 0, 0, 0, 0, 9, 7]);
    let unwanted = [0x002, 0x080].map(error);
    let wanted = [0x001, 0x004, 0x008, 0x010, 0x020, 0x040, 0x088, 0x100, 0x200].map(error);
    assert_eq!(servos.send(&unwanted).count, unwanted.len());
    assert_eq!(servos.send(&wanted).count, wanted.len());
    let received = receive_all(master.as_mut(), wanted.len());
    assert_eq!(received, wanted);
    assert!(received.iter().all(|frame| frame.id().is_error()));
}

/// Goal: a reader that pauses for a while loses nothing; the default buffer would hold 278 frames.
#[test]
fn socketcan_receive_buffer_holds_two_thousand_frames() {
    let vcan = Vcan::new("buffer");
    let (mut master, mut servos) = vcan.pair();
    let frames: Vec<CanFrame> = (0..2048).map(numbered).collect();
    for batch in frames.chunks(64) {
        assert_eq!(master.send(batch).count, batch.len());
        // Between sender and socket lies the kernel's own queue of 1000, which it empties when the sender sleeps.
        std::thread::sleep(Duration::from_millis(1));
    }
    let received = receive_all(servos.as_mut(), frames.len());
    assert!(received == frames, "{} of {} frames arrived", received.len(), frames.len());
}

/// Goal: an FD frame on an interface for classic frames is an error of the system, and harms no other frame.
#[test]
fn socketcan_fd_frame_on_a_classic_interface_is_refused() {
    let vcan = Vcan::new("classic");
    vcan.set("down");
    ip("link set classic mtu 16");
    vcan.set("up");
    let (mut master, mut servos) = vcan.pair();
    let classic = CanFrame::classic(CanId::standard(0x201), &[1, 2]);
    let sent = master.send(&[classic, CanFrame::fd(CanId::standard(0x202), &[0; 64]), classic]);
    assert_eq!((sent.count, sent.fault), (1, Some(LinkFault::Os(22)))); // EINVAL
    assert_eq!(master.send(&[classic]).fault, None);
    assert_eq!(receive_all(servos.as_mut(), 2), [classic, classic]);
}

/// Goal: independent tools see what we send, and we what they send, bit for bit.
#[test]
fn socketcan_and_can_utils_agree_on_every_bit() {
    let vcan = Vcan::new("tools");
    let mut master = vcan.open(LinkRole::Master).unwrap();
    let frames: Vec<CanFrame> = (0..100).map(numbered).collect();
    let count = frames.len().to_string();
    let mut recorder = Command::new("candump")
        .args(["-L", "-n", &count, "-T", "5000", "tools"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for_receivers("tools", 2); // Our own socket and the recorder's.
    assert_eq!(master.send(&frames[..64]).count, 64);
    assert_eq!(master.send(&frames[64..]).count, 36);
    let log = std::io::read_to_string(recorder.stdout.take().unwrap()).unwrap();
    assert!(recorder.wait().unwrap().success());
    let records = candump::parse(&log).unwrap();
    assert_eq!(records.len(), frames.len());
    for (number, (record, frame)) in records.iter().zip(&frames).enumerate() {
        assert_eq!((record.interface.as_str(), &record.frame), ("tools", frame), "frame {number}");
    }
    run("cansend", "tools 201#0F00E8030000");
    run("cansend", "tools 1234ABCD#R");
    run("cansend", "tools 080#");
    let expected = [
        CanFrame::classic(CanId::standard(0x201), &[0x0F, 0, 0xE8, 3, 0, 0]),
        CanFrame::classic(CanId::from_raw(0xD234_ABCD), &[]),
        CanFrame::classic(CanId::standard(0x080), &[]),
    ];
    assert_eq!(receive_all(master.as_mut(), 3), expected);
}

/// Waits until so many sockets listen to all frames of an interface.
fn wait_for_receivers(interface: &str, count: usize) {
    for _ in 0..500 {
        let list = std::fs::read_to_string("/proc/net/can/rcvlist_all").unwrap();
        if list.lines().filter(|line| line.split_whitespace().next() == Some(interface)).count() >= count {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("{count} sockets never listened to {interface}");
}

/// Goal: the lock holds between processes, names the holder, and vanishes with it even by SIGKILL.
#[test]
fn socketcan_lock_of_a_killed_master_is_free() {
    let vcan = Vcan::new("killed");
    let mut holder = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "helper_master_that_holds_on", "--nocapture"])
        .env("TAUSTREAM_HOLD", "killed")
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(holder.stdout.take().unwrap()).lines();
    assert!(
        lines.map_while(Result::ok).any(|line| line.contains("holding")),
        "the holder did not open the link"
    );
    let Err(refusal) = vcan.open(LinkRole::Master) else { panic!("two masters on one bus") };
    assert!(refusal.to_string().contains(&format!("process {}", holder.id())), "{refusal}");
    holder.kill().unwrap();
    holder.wait().unwrap();
    vcan.open(LinkRole::Master).unwrap_or_else(|error| panic!("the lock outlived its holder: {error}"));
}

/// No test of its own: the other process of the test above.
#[test]
fn helper_master_that_holds_on() {
    let Some(interface) = std::env::var_os("TAUSTREAM_HOLD") else { return };
    let interface = interface.into_string().unwrap();
    let bus = Bus::new("arm", &interface, BusKind::Virtual);
    let _link = open(&bus, LinkChoice::SocketCan, LinkRole::Master, Path::new("/nowhere")).unwrap();
    println!("holding");
    std::thread::sleep(Duration::from_secs(60));
}

/// Goal: what cannot be a bus of its declared kind is refused with one message and the remedy; a refusal locks nothing.
#[test]
fn socketcan_open_refuses_what_the_kernel_does_not_confirm() {
    let vcan = Vcan::new("kinds");
    ip("link add dev pair0 type vxcan peer name pair1");
    ip("link add dev sleeper type vcan");
    let real = BusKind::Classic { bitrate_bit_s: 1_000_000 };
    let cases = [
        ("absent", BusKind::Virtual, "ip link add dev absent type vcan && ip link set absent up"),
        ("absent", real, "does not exist; is its adapter plugged in?"),
        ("sleeper", BusKind::Virtual, "is down; bring it up: ip link set sleeper up"),
        ("lo", BusKind::Virtual, "lo is no CAN interface"),
        ("pair0", BusKind::Virtual, "kind \"vxcan\", not vcan"),
        ("pair0", real, "is down; bring it up: ip link set pair0 up type can bitrate 1000000"),
    ];
    for (interface, kind, wanted) in cases {
        let bus = Bus::new("arm", interface, kind);
        let result = open(&bus, LinkChoice::SocketCan, LinkRole::Master, Path::new("/nowhere"));
        let Err(refusal) = result else { panic!("{bus:?} opened") };
        let text = refusal.to_string();
        assert!(text.contains(wanted) && !text.contains('\n'), "{bus:?}: {text}");
    }
    // A bit rate on a vcan is taken: the simulator models it.
    let modelled = Bus { kind: real, ..vcan.bus.clone() };
    open(&modelled, LinkChoice::SocketCan, LinkRole::Master, Path::new("/nowhere")).unwrap();
    ip("link set sleeper up");
    let sleeper = Bus { interface: "sleeper".into(), ..vcan.bus.clone() };
    open(&sleeper, LinkChoice::SocketCan, LinkRole::Master, Path::new("/nowhere")).unwrap();
    ip("link del sleeper");
    ip("link del pair0");
}

/// Goal: `auto` takes the kernel's CAN where the interface exists, else the local link for a virtual bus alone.
#[test]
fn socketcan_is_what_auto_takes_where_the_interface_exists() {
    let vcan = Vcan::new("auto");
    let runtime = std::env::temp_dir().join(format!("tau-auto-{}", std::process::id()));
    let link = open(&vcan.bus, LinkChoice::Auto, LinkRole::Master, &runtime).unwrap();
    assert_eq!(link.describe(), "socketcan auto");
    assert!(!runtime.exists(), "SocketCAN needs no runtime directory");
    let absent = Bus { interface: "absent".into(), ..vcan.bus.clone() };
    let link = open(&absent, LinkChoice::Auto, LinkRole::Servos, &runtime).unwrap();
    assert_eq!(link.describe(), "local link absent");
    std::fs::remove_dir_all(&runtime).unwrap();
}
