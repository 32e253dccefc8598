//! The CAN interfaces: those of the settings, and what others there are.
use super::finding::Finding;
use super::subject::Subject;
use super::tree::shown;
use taustream_arm::{Bus, BusKind, Settings};
use taustream_drivers::link::ControllerState;

/// `ARPHRD_CAN`: the hardware type of CAN interfaces.
const CAN_TYPE: i64 = 280;
/// `IFF_UP`.
const UP: i64 = 1;
/// A longer queue delays setpoints that are old by then: 64 frames take 8 ms at 1 Mbit/s.
const QUEUE_MAX: i64 = 64;
/// What every interrupt thread has by default (`PREEMPT_RT`).
const IRQ_PRIORITY_DEFAULT: i64 = 50;
/// What stays of "irq/123-can0" in a process's name.
const IRQ_THREAD: &str = "irq/";

pub(crate) fn examine(s: &Subject) -> Vec<Finding> {
    let Some(settings) = &s.settings else {
        return vec![without_settings(s)];
    };
    settings.buses.iter().enumerate().flat_map(|(index, bus)| of_bus(s, settings, index, bus)).collect()
}

/// Which CAN interfaces there are at all.
fn without_settings(s: &Subject) -> Finding {
    let is_can = |name: &String| s.tree.number(&format!("sys/class/net/{name}/type")) == Some(CAN_TYPE);
    let names: Vec<String> = s.tree.names("sys/class/net").into_iter().filter(is_can).collect();
    let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    Finding::unknown(
        "CAN interfaces",
        format!("{} here; --settings FILE looks at an arm's own", shown(&found)),
    )
}

fn of_bus(s: &Subject, settings: &Settings, index: usize, bus: &Bus) -> Vec<Finding> {
    const NAME: &str = "CAN interface";
    let interface = &bus.interface;
    let at = format!("sys/class/net/{interface}");
    // A name that is no name could lead elsewhere; the settings refuse it before, and nothing is lost by asking twice.
    if interface.contains('/') || !s.tree.has(&at) {
        return vec![missing(bus)];
    }
    if s.tree.number(&format!("{at}/type")) != Some(CAN_TYPE) {
        let remedy = "name a CAN interface in the settings (list them: ip link show type can)";
        return vec![Finding::problem(NAME, format!("{interface} is no CAN interface"), remedy)];
    }
    let mut findings = vec![state(s, bus, &at)];
    findings.extend(queue(s, settings, index, bus, &at));
    let is_virtual = s.tree.target(&at).is_some_and(|t| t.to_string_lossy().contains("/virtual/"));
    if !is_virtual {
        findings.extend(adapter(s, interface, &at));
        findings.extend(interrupt_thread(s, interface));
    }
    findings
}

fn missing(bus: &Bus) -> Finding {
    const NAME: &str = "CAN interface";
    let interface = &bus.interface;
    let what = format!("{interface} of bus {} does not exist", bus.name);
    let virtual_remedy = format!(
        "make it: modprobe vcan && ip link add dev {interface} type vcan && ip link set {interface} up"
    );
    match bus.kind {
        BusKind::Virtual => Finding::warning(
            NAME,
            format!("{what}; its bus is virtual and will use the local link"),
            virtual_remedy,
        ),
        BusKind::Classic { .. } | BusKind::Fd { .. } => {
            let remedy = "plug the adapter in, load its driver, or name another interface (list them: ip link show type can)";
            Finding::problem(NAME, what, remedy)
        }
    }
}

/// Up, at the stated bit rate, on good terms with the bus, and not back from bus-off by itself.
fn state(s: &Subject, bus: &Bus, at: &str) -> Finding {
    const NAME: &str = "CAN interface";
    let interface = &bus.interface;
    let flags = s.tree.text(&format!("{at}/flags")).unwrap_or_default();
    let flags = i64::from_str_radix(flags.trim_start_matches("0x"), 16).unwrap_or(0);
    let controller = (s.controller)(interface);
    let set = |bit_s: u32| {
        format!(
            "ip link set {interface} down && ip link set {interface} type can bitrate {bit_s} restart-ms 0 && ip link set {interface} up"
        )
    };
    let declared = bus.kind.bitrate_bit_s();
    if flags & UP == 0 {
        let remedy = declared.map_or_else(|| format!("ip link set {interface} up"), set);
        return Finding::problem(NAME, format!("{interface} is down"), remedy);
    }
    match (declared, controller.bitrate_bit_s) {
        (Some(declared), Some(actual)) if declared != actual => {
            let what = format!("{interface} runs at {actual} bit/s, and the settings say {declared}");
            return Finding::problem(NAME, what, set(declared));
        }
        _ => {}
    }
    if let Some(state @ (ControllerState::Passive | ControllerState::Off | ControllerState::Warning)) =
        controller.state
    {
        let what = format!("{interface} is {}: frames get lost on the wire", state.word());
        let remedy = "look at cable, both terminations (60 ohm between CAN_H and CAN_L), drives' power and bit rates; \
                    then take the interface down and up";
        return match state {
            ControllerState::Warning => Finding::warning(NAME, what, remedy),
            ControllerState::Passive
            | ControllerState::Off
            | ControllerState::Active
            | ControllerState::Stopped => Finding::problem(NAME, what, remedy),
        };
    }
    if let Some(ms) = controller.restart_ms.filter(|ms| *ms > 0) {
        let what = format!(
            "{interface} comes back from bus-off by itself after {ms} ms, and may send old setpoints then"
        );
        return Finding::warning(NAME, what, format!("ip link set {interface} type can restart-ms 0"));
    }
    let rate = controller.bitrate_bit_s.map_or_else(String::new, |bit_s| format!(", {bit_s} bit/s"));
    let state = controller.state.map_or_else(String::new, |state| format!(", {}", state.word()));
    Finding::ok(NAME, format!("{interface} is up{rate}{state}"))
}

/// One cycle's frames must fit into the transmit queue, and not many more.
fn queue(s: &Subject, settings: &Settings, index: usize, bus: &Bus, at: &str) -> Option<Finding> {
    const NAME: &str = "txqueuelen";
    let interface = &bus.interface;
    let length = s.tree.number(&format!("{at}/tx_queue_len"))?;
    let servos = settings.servos.iter().filter(|servo| servo.bus == index).count();
    // One setpoint a servo, and a SYNC.
    let wanted = i64::try_from(servos).unwrap_or(i64::MAX).saturating_add(1);
    let remedy = format!("ip link set {interface} txqueuelen {}", wanted.saturating_mul(2).max(16));
    Some(if length < wanted {
        let what = format!(
            "{interface} queues {length} frames, and a cycle sends {wanted}: some are refused (ENOBUFS)"
        );
        Finding::problem(NAME, what, remedy)
    } else if length > QUEUE_MAX && bus.kind != BusKind::Virtual {
        let what = format!("{interface} queues {length} frames: after a bus fault old setpoints wait in it");
        Finding::warning(NAME, what, remedy)
    } else {
        Finding::ok(NAME, format!("{interface} queues {length} frames; a cycle sends {wanted}"))
    })
}

fn adapter(s: &Subject, interface: &str, at: &str) -> Option<Finding> {
    let bus = s.tree.target_name(&format!("{at}/device/subsystem"))?;
    Some(if bus == "usb" {
        Finding::warning(
            "USB adapter",
            format!(
                "{interface} hangs on USB, which delays frames by 0.1 to 1 ms, by an amount that changes"
            ),
            "use a controller on PCIe, SPI or in the processor; or a longer period, and more tolerated_gap_periods",
        )
    } else {
        Finding::ok("CAN adapter", format!("{interface} hangs on {}", shown(&bus)))
    })
}

/// Where interrupts are threads (`PREEMPT_RT`), the CAN interface's must not wait behind those of disk and network.
fn interrupt_thread(s: &Subject, interface: &str) -> Option<Finding> {
    const NAME: &str = "CAN interrupt";
    let is_its = |name: &str| name.starts_with(IRQ_THREAD) && name.ends_with(&format!("-{interface}"));
    let (pid, name) = s.processes().find(|(_, name)| is_its(name))?;
    let priority = s.realtime_priority(pid)?;
    let (name, wanted) = (shown(&name), i64::from(s.priority) + 10);
    Some(if priority > IRQ_PRIORITY_DEFAULT {
        Finding::ok(NAME, format!("thread {name} has priority {priority}"))
    } else {
        Finding::warning(
            NAME,
            format!("thread {name} has priority {priority}, no more than those of disk and network"),
            format!("chrt --fifo --pid {} {pid}, at every boot", wanted.min(98)),
        )
    })
}
