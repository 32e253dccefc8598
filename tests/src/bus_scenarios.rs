//! What must hold when a bus fails under a moving arm: it stops, says why and what to do, stays silent whatever the bus
//! does, and comes back by command alone.
use crate::scenarios::{CheckMode, Goals, Scenario, enable, go, is_ready_to_enable, set_off};
use crate::test_bench::{TIMEOUT, TestBench};
use anyhow::{Result, ensure};
use std::process::Command;
use std::time::{Duration, Instant};
use taustream_messages::{BusFault, FaultReason, Phase, Report};

/// How far a commanded pose may be from the measured one right after enabling.
const AT_REST_RAD: f64 = 5e-3;

/// Every scenario, in the order in which they run.
pub const ALL: &[Scenario] = &[
    scenario("bus_queue_full_mid_motion_is_silent_until_cleared", queue_full),
    scenario("bus_interface_down_mid_motion_is_silent_until_cleared", interface_down),
    scenario("bus_interface_gone_mid_motion_is_reopened_by_clear_fault", interface_gone),
    scenario("bus_off_and_restarted_mid_motion_is_silent_until_cleared", bus_off),
    scenario("bus_error_passive_mid_motion_stops_on_path_and_holds", error_passive),
    Scenario {
        settings: Some("dual-bus.toml"),
        ..scenario("bus_second_down_mid_motion_first_stops_on_path_and_holds", second_down)
    },
    scenario("bus_unacknowledged_mid_motion_is_silent_until_cleared", unacknowledged),
];

const fn scenario(name: &'static str, run: fn(&mut TestBench, &Goals) -> Result<()>) -> Scenario {
    Scenario { name, run, check_mode: CheckMode::WithLosses, settings: None }
}

/// Under way to the first goal, slowly: joints that lose their drives coast before their brakes hold them.
fn in_progress(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.cli_done(&["speed", "20"])?;
    set_off(bench, goals, 0, 0.1)?;
    Ok(())
}

/// The fault that a bus brought, with what `status` says about it.
fn bus_fault(bench: &mut TestBench, bus_fault: BusFault, words: &[&str]) -> Result<Report> {
    bus_fault_among(bench, &[bus_fault], words)
}

/// The same where the moment decides which of several is noticed first.
fn bus_fault_among(bench: &mut TestBench, expected: &[BusFault], words: &[&str]) -> Result<Report> {
    let report = bench.await_phase(Phase::Fault)?;
    let cause = report.cause();
    let found = cause.and_then(|c| BusFault::from_code(c.code));
    ensure!(
        cause.is_some_and(|c| c.reason == FaultReason::BusFault && c.bus == Some(0))
            && found.is_some_and(|found| expected.contains(&found)),
        "a bus fault by {expected:?} was expected, the report says {cause:?}"
    );
    ensure!(report.trajectory_s < report.trajectory_duration_s, "the motion had ended before the fault");
    let status = bench.cli_done(&["status"])?.stdout;
    for word in words {
        ensure!(status.contains(word), "no `{word}` in the status: {status}");
    }
    bench.cli_refused(&["replan", "--goal", "0,0,0,0,0,0"], "fault")?;
    bench.cli_refused(&["enable"], "clear-fault")?;
    Ok(report)
}

/// Watches for a while: no frame leaves, nothing is commanded, and the phase stays.
fn stays_silent(bench: &mut TestBench) -> Result<()> {
    let (before, _) = bench.report()?;
    let since = Instant::now();
    while since.elapsed() < Duration::from_millis(600) {
        std::thread::sleep(Duration::from_millis(50));
        let (report, phase) = bench.report()?;
        ensure!(phase == Phase::Fault, "the arm goes on by itself: {}", phase.word());
        ensure!(report.buses[0].silent == 1, "the bus is not silent");
        ensure!(report.frames_sent == before.frames_sent, "frames left on a failed bus");
        let bits = |r: &Report| r.command_rad.map(f64::to_bits);
        ensure!(bits(&report) == bits(&before), "the commanded pose moved");
    }
    Ok(())
}

/// The way back: clear-fault (the drives' own watchdogs may have left faults, too), enable, a new plan.
fn return_path(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    stays_silent(bench)?;
    let since = Instant::now();
    while !is_ready_to_enable(bench)? {
        ensure!(since.elapsed() < TIMEOUT, "the fault cannot be cleared: {}", bench.streamer.said());
        let _asked_again_if_refused = bench.cli(&["clear-fault"])?;
    }
    move_on(bench, goals)
}

fn move_on(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let (report, _) = bench.report()?;
    let joints = report.command_rad.iter().zip(&report.measured_rad).take(report.joints());
    for (joint, (commanded, measured)) in joints.enumerate() {
        let by_rad = (commanded - measured).abs();
        ensure!(by_rad < AT_REST_RAD, "joint {} is enabled {by_rad} rad from where it stands", joint + 1);
    }
    go(bench, goals, 1)?;
    Ok(())
}

/// A token bucket in front of the interface takes a third of the frames: ENOBUFS and partial batches.
fn queue_full(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    // Added before the drives are enabled: the kernel drops what is on its way when a queue is added.
    bench.run("tc", "qdisc add dev vcan0 root tbf rate 1gbit burst 160 limit 320")?;
    in_progress(bench, goals)?;
    bench.run("tc", "qdisc change dev vcan0 root tbf rate 500kbit burst 160 limit 320")?;
    let words = ["transmit queue full (ENOBUFS)", "bus `arm` (vcan0)", "nothing is sent until `clear-fault`"];
    bench.await_report("the failed bus", |r, _| r.buses[0].silent == 1)?;
    // One joint may have missed more setpoints than its drive bridges before whole cycles are lost.
    let report = bus_fault_among(bench, &[BusFault::QueueFull, BusFault::SetpointsLost], &words)?;
    ensure!(report.buses[0].cycles_lost >= 3 && report.frames_lost > 0, "lost cycles are not counted");
    bench.run("tc", "qdisc del dev vcan0 root")?;
    return_path(bench, goals)
}

fn interface_down(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    in_progress(bench, goals)?;
    bench.run("ip", "link set vcan0 down")?;
    bus_fault(bench, BusFault::Down, &["interface is down (ENETDOWN)", "ip link set vcan0 up"])?;
    bench.cli_refused(&["clear-fault"], "ip link set vcan0 up")?;
    bench.cli_refused(&["disable"], "no drive can be reached")?;
    bench.run("ip", "link set vcan0 up")?;
    return_path(bench, goals)
}

fn interface_gone(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    in_progress(bench, goals)?;
    bench.run("ip", "link del vcan0")?;
    bus_fault(bench, BusFault::Gone, &["interface has gone (ENODEV)"])?;
    bench.cli_refused(&["clear-fault"], "interface vcan0 does not exist")?;
    add_interface(bench, "vcan0")?;
    return_path(bench, goals)
}

fn add_interface(bench: &TestBench, interface: &str) -> Result<()> {
    bench.run("ip", &format!("link add dev {interface} type vcan"))?;
    bench.run("ip", &format!("link set {interface} mtu 72"))?;
    bench.run("ip", &format!("link set {interface} up"))
}

/// Brings the interfaces of the machine back to what they were at its boot: a scenario that failed may have left its fault in
/// place, and the next one is not to fail for it.
pub fn restore_interfaces() {
    for interface in ["vcan0", "vcan1"] {
        for (program, words) in [
            ("tc", format!("qdisc del dev {interface} root")),
            ("ip", format!("link add dev {interface} type vcan")),
            ("ip", format!("link set {interface} mtu 72")),
            ("ip", format!("link set {interface} up")),
        ] {
            // What is as it should be already is refused.
            let _as_it_was = Command::new(program).args(words.split(' ')).output();
        }
    }
}

/// The kernel's own frames, by anybody's hand: bus-off, then the controller's return. vcan itself has no such state.
fn bus_off(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    in_progress(bench, goals)?;
    bench.run("cansend", "vcan0 20000240#000000000000F803")?;
    let words = ["controller is bus-off", "ip link set vcan0 type can restart", "tx=248"];
    bus_fault(bench, BusFault::BusOff, &words)?;
    bench.run("cansend", "vcan0 20000100#0000000000000000")?;
    let report =
        bench.await_report("the restarted controller's word", |r, _| r.buses[0].error_frames >= 2)?;
    ensure!(report.buses[0].error_class == 0x100, "class {:#x}", report.buses[0].error_class);
    return_path(bench, goals)
}

/// The bus still carries frames: the arm stops on its path, holds, and is cleared when the controller has recovered.
fn error_passive(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    in_progress(bench, goals)?;
    bench.run("cansend", "vcan0 20000004#0020000000000000")?;
    let report = bus_fault(bench, BusFault::ErrorPassive, &["controller is error-passive", "tx passive"])?;
    ensure!(report.energised == 1, "the drives do not hold");
    let before = report.frames_sent;
    bench.await_report("setpoints to hold by", |r, _| r.frames_sent > before + 100)?;
    bench.cli_refused(&["clear-fault"], "error-passive")?;
    bench.run("cansend", "vcan0 20000004#0040000000000000")?;
    bench.await_report("the recovered controller", |r, _| r.buses[0].bus_fault == 0)?;
    bench.cli_done(&["clear-fault"])?;
    bench.await_phase(Phase::Locked)?;
    move_on(bench, goals)
}

/// Of two buses one goes down: the joints of the other are stopped on the path and hold; those that hold come first on
/// the way back.
fn second_down(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    in_progress(bench, goals)?;
    bench.run("ip", "link set vcan1 down")?;
    let report = bench.await_phase(Phase::Fault)?;
    let cause = report.cause();
    ensure!(
        cause.is_some_and(|c| c.reason == FaultReason::BusFault && c.bus == Some(1)),
        "a fault of the second bus was expected, the report says {cause:?}"
    );
    ensure!(report.buses[0].bus_fault == 0 && report.buses[1].silent == 1, "{:?}", report.buses());
    let status = bench.cli_done(&["status"])?.stdout;
    ensure!(status.contains("(vcan1)") && status.contains("ip link set vcan1 up"), "no remedy in: {status}");
    let before = report.buses;
    let report = bench.await_report("setpoints to hold by on the first bus", |r, _| {
        r.buses[0].frames_sent > before[0].frames_sent + 100
    })?;
    ensure!(report.buses[1].frames_sent == before[1].frames_sent, "frames left on the failed bus");
    bench.cli_refused(&["clear-fault"], "`disable`")?;
    // The drives of the failed bus cannot be seen to be off, and the command says so.
    bench.cli_refused(&["disable"], "(vcan1)")?;
    let since = Instant::now();
    while !bench.cli(&["clear-fault"])?.stderr.contains("ip link set vcan1 up") {
        ensure!(since.elapsed() < TIMEOUT, "clear-fault never came to the bus: {}", bench.streamer.said());
    }
    bench.run("ip", "link set vcan1 up")?;
    let since = Instant::now();
    while !is_ready_to_enable(bench)? {
        ensure!(since.elapsed() < TIMEOUT, "the fault cannot be cleared: {}", bench.streamer.said());
        let _asked_again_if_refused = bench.cli(&["clear-fault"])?;
    }
    move_on(bench, goals)
}

/// An interface that hands frames back when they were on the wire, as real ones do, and a wire that takes its time.
fn unacknowledged(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    // The interface has to be made again for this, which is a fault of its own.
    bench.run("modprobe", "-r vcan")?;
    bench.await_phase(Phase::Fault)?;
    bench.run("modprobe", "vcan echo=1")?;
    add_interface(bench, "vcan0")?;
    add_interface(bench, "vcan1")?;
    // While nothing is sent, for the same reason as in `queue_full`.
    bench.run("tc", "qdisc add dev vcan0 root netem delay 0ms limit 1000")?;
    return_path(bench, goals)?;
    bench.cli_done(&["speed", "20"])?;
    set_off(bench, goals, 2, 0.1)?;
    bench.run("tc", "qdisc change dev vcan0 root netem delay 700ms limit 1000")?;
    let report = bus_fault(bench, BusFault::Unconfirmed, &["frames are not acknowledged", "in flight"])?;
    ensure!(report.fault_value >= 7.0, "only {} frames in flight", report.fault_value);
    bench.await_report("the late frames to be on the wire", |r, _| r.buses[0].in_flight == 0)?;
    bench.run("tc", "qdisc del dev vcan0 root")?;
    return_path(bench, goals)
}
