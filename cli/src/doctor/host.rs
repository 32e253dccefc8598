//! What the computer is: real, virtual or a container, and whether it keeps cool.
use super::finding::Finding;
use super::subject::Subject;
use super::tree::shown;

/// Where processors begin to slow down is 80 to 100 degrees.
const MILLI_CELSIUS_MAX: i64 = 80_000;

pub(crate) fn examine(s: &Subject) -> Vec<Finding> {
    vec![virtual_machine(s), container(s), temperature(s)]
}

fn virtual_machine(s: &Subject) -> Finding {
    const NAME: &str = "virtual machine";
    const REMEDY: &str = "drive arms from a computer of their own; trials on virtual buses are fine";
    let cpus = s.tree.text("proc/cpuinfo").unwrap_or_default();
    let hypervisor = s.tree.text("sys/hypervisor/type");
    let product = s.tree.text("sys/class/dmi/id/product_name").unwrap_or_default();
    let flagged = cpus
        .lines()
        .any(|line| line.starts_with("flags") && line.split_whitespace().any(|flag| flag == "hypervisor"));
    let words = ["KVM", "Virtual Machine", "VMware", "VirtualBox", "QEMU", "Bochs"];
    let kind = if cpus.contains("User Mode Linux") {
        "user-mode Linux".to_owned()
    } else if let Some(kind) = hypervisor.filter(|kind| !kind.is_empty()) {
        shown(&kind)
    } else if flagged || words.iter().any(|word| product.contains(word)) {
        if product.is_empty() { "a hypervisor".to_owned() } else { shown(&product) }
    } else if cpus.is_empty() {
        return Finding::unknown(NAME, "/proc/cpuinfo cannot be read");
    } else {
        return Finding::ok(NAME, "no sign of one");
    };
    Finding::warning(NAME, format!("this runs under {kind}: the host takes its CPUs away at will"), REMEDY)
}

fn container(s: &Subject) -> Finding {
    const NAME: &str = "container";
    const REMEDY: &str = "run the streamer on the host by its systemd unit, or give the container CAP_SYS_NICE, CAP_IPC_LOCK \
                        (--ulimit rtprio=99 --ulimit memlock=-1) and the CAN interfaces";
    let groups = s.tree.text("proc/1/cgroup").unwrap_or_default();
    let by_group = ["docker", "lxc", "kubepods", "libpod"].into_iter().find(|word| groups.contains(word));
    let kind = if let Some(kind) = s.tree.text("run/systemd/container").filter(|kind| !kind.is_empty()) {
        shown(&kind)
    } else if s.tree.has(".dockerenv") {
        "docker".to_owned()
    } else if s.tree.has("run/.containerenv") {
        "podman".to_owned()
    } else if let Some(kind) = by_group {
        kind.to_owned()
    } else {
        return Finding::ok(NAME, "no sign of one");
    };
    Finding::warning(
        NAME,
        format!("this runs in a container ({kind}), which has its own rights and interfaces"),
        REMEDY,
    )
}

fn temperature(s: &Subject) -> Finding {
    const NAME: &str = "temperature";
    const REMEDY: &str =
        "clean fan and heat sink, or cool it better; a processor that slows down makes cycles late";
    let throttled: i64 = s
        .tree
        .names("sys/devices/system/cpu")
        .iter()
        .filter_map(|cpu| {
            s.tree.number(&format!("sys/devices/system/cpu/{cpu}/thermal_throttle/core_throttle_count"))
        })
        .fold(0, i64::saturating_add);
    let zones = s.tree.names("sys/class/thermal");
    let hottest = zones
        .iter()
        .filter(|name| name.starts_with("thermal_zone"))
        .filter_map(|zone| {
            let kind = s.tree.text(&format!("sys/class/thermal/{zone}/type")).unwrap_or_default();
            Some((s.tree.number(&format!("sys/class/thermal/{zone}/temp"))?, shown(&kind)))
        })
        .max();
    if throttled > 0 {
        let what =
            format!("the processor has slowed down {throttled} times since boot because it was too hot");
        return Finding::warning(NAME, what, REMEDY);
    }
    match hottest {
        None => Finding::unknown(NAME, "no sensor"),
        Some((milli, zone)) if milli > MILLI_CELSIUS_MAX => {
            Finding::warning(NAME, format!("{zone} is at {} degrees Celsius", milli / 1000), REMEDY)
        }
        Some((milli, zone)) => {
            Finding::ok(NAME, format!("{zone}, the hottest, is at {} degrees Celsius", milli / 1000))
        }
    }
}
