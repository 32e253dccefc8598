//! The kernel: preemption, CAN, what it takes from real-time threads, and its clock.
use super::finding::Finding;
use super::subject::Subject;
use super::tree::shown;
use taustream_arm::BusKind;

pub(crate) fn examine(s: &Subject) -> Vec<Finding> {
    vec![preemption(s), can(s), software_interrupts(s), throttling(s), group_scheduling(s), clock_source(s)]
}

fn preemption(s: &Subject) -> Finding {
    const NAME: &str = "kernel";
    let version = s.tree.text("proc/version").unwrap_or_default();
    let release = shown(&s.tree.text("proc/sys/kernel/osrelease").unwrap_or_else(|| "unknown".to_owned()));
    if s.tree.text("sys/kernel/realtime").as_deref() == Some("1") || version.contains("PREEMPT_RT") {
        return Finding::ok(NAME, format!("{release} with PREEMPT_RT"));
    }
    if version.is_empty() {
        return Finding::unknown(NAME, "/proc/version cannot be read");
    }
    Finding::problem(
        NAME,
        format!("{release} without PREEMPT_RT: it promises no bound on how late a thread wakes up"),
        "install a real-time kernel and boot it (Debian: apt install linux-image-rt-amd64 or linux-image-rt-arm64)",
    )
}

fn can(s: &Subject) -> Finding {
    const NAME: &str = "CAN sockets";
    let protocols = s.tree.text("proc/net/protocols").unwrap_or_default();
    if protocols.lines().any(|line| line.starts_with("CAN")) {
        return Finding::ok(NAME, "the kernel has them");
    }
    let release = s.tree.text("proc/sys/kernel/osrelease").unwrap_or_default();
    let list = |file: &str| s.tree.text(&format!("lib/modules/{release}/{file}")).unwrap_or_default();
    let in_modules =
        |name: &str| list("modules.builtin").contains(name) || list("modules.dep").contains(name);
    if in_modules("/can-raw.ko") {
        return Finding::warning(
            NAME,
            "there is a module, not loaded yet",
            "load it at every boot: echo can_raw > /etc/modules-load.d/can.conf; now: modprobe can_raw",
        );
    }
    let what = "this kernel has none, and no module for them";
    let remedy = "install a kernel with CONFIG_CAN and CONFIG_CAN_RAW (Debian's linux-image-amd64 and linux-image-rt-amd64 have both)";
    let only_virtual =
        s.settings.as_ref().is_some_and(|settings| settings.buses.iter().all(|b| b.kind == BusKind::Virtual));
    if only_virtual {
        let what = format!("{what}; the buses of these settings are virtual and can use the local link");
        let remedy =
            format!("start streamer and taustream-servosim with --link local; for a real arm, {remedy}");
        return Finding::warning(NAME, what, remedy);
    }
    Finding::problem(NAME, what, remedy)
}

/// CAN frames go through software interrupts, which the kernel hands to a thread of its own when there are many; as an
/// ordinary process that waits behind every other one.
fn software_interrupts(s: &Subject) -> Finding {
    const NAME: &str = "software interrupts";
    let is_meant = |name: &str| {
        let cpu = name.strip_prefix("ksoftirqd/").and_then(|cpu| cpu.parse().ok());
        cpu.is_some_and(|cpu: usize| s.cpu().is_none_or(|own| own == cpu))
    };
    let threads: Vec<(u32, String)> = s.processes().filter(|(_, name)| is_meant(name)).collect();
    let ordinary = threads.iter().find(|(pid, _)| s.realtime_priority(*pid) == Some(0));
    match (threads.first(), ordinary) {
        (None, _) => Finding::unknown(NAME, "no thread of the kernel for them can be seen"),
        (Some((_, name)), None) => {
            Finding::ok(NAME, format!("thread {} has real-time priority", shown(name)))
        }
        (_, Some((pid, name))) => Finding::warning(
            NAME,
            format!(
                "thread {} is an ordinary process: under load CAN frames wait in it behind other programs",
                shown(name)
            ),
            format!("chrt --fifo --pid {} {pid}, at every boot", (i64::from(s.priority) + 10).min(98)),
        ),
    }
}

fn throttling(s: &Subject) -> Finding {
    const NAME: &str = "real-time throttling";
    const REMEDY: &str =
        "sysctl kernel.sched_rt_runtime_us=-1, and the same line in /etc/sysctl.d/taustream.conf";
    match s.tree.number("proc/sys/kernel/sched_rt_runtime_us") {
        None => Finding::unknown(NAME, "kernel.sched_rt_runtime_us cannot be read"),
        Some(-1) => Finding::ok(NAME, "off"),
        Some(0) => Finding::problem(NAME, "the kernel gives real-time threads no time at all", REMEDY),
        Some(us) => {
            let period_us = s.tree.number("proc/sys/kernel/sched_rt_period_us").unwrap_or(1_000_000);
            let what = format!(
                "real-time threads are stopped after {us} us of every {period_us} us, whoever of them used the time"
            );
            Finding::warning(NAME, what, REMEDY)
        }
    }
}

/// With `CONFIG_RT_GROUP_SCHED` a control group without a budget refuses `SCHED_FIFO` in spite of every right.
fn group_scheduling(s: &Subject) -> Finding {
    const NAME: &str = "RT_GROUP_SCHED";
    let (process, who) = s.process();
    let groups = s.tree.text(&format!("{process}/cgroup")).unwrap_or_default();
    // "4:cpu,cpuacct:/system.slice/x"
    let group = groups.lines().take(64).find_map(|line| {
        let mut fields = line.splitn(3, ':');
        let controllers = fields.nth(1)?;
        let path = fields.next()?;
        let safe = !path.split('/').any(|piece| piece == "..");
        (safe && controllers.split(',').any(|c| c == "cpu")).then(|| path.trim_matches('/').to_owned())
    });
    let budget = group.as_ref().and_then(|group| {
        let hierarchies = ["sys/fs/cgroup/cpu", "sys/fs/cgroup/cpu,cpuacct"];
        hierarchies.iter().find_map(|at| s.tree.number(&format!("{at}/{group}/cpu.rt_runtime_us")))
    });
    if budget == Some(0) {
        let group = shown(&group.unwrap_or_default());
        return Finding::problem(
            NAME,
            format!(
                "{who} is in control group /{group}, which has no real-time budget: SCHED_FIFO is refused there"
            ),
            format!(
                "echo 900000 > /sys/fs/cgroup/cpu/{group}/cpu.rt_runtime_us, or a kernel without CONFIG_RT_GROUP_SCHED"
            ),
        );
    }
    let release = s.tree.text("proc/sys/kernel/osrelease").unwrap_or_default();
    let config = s.tree.text(&format!("boot/config-{release}"));
    let disabled =
        s.tree.text("proc/cmdline").is_some_and(|line| line.split(' ').any(|w| w == "rt_group_sched=0"));
    let compiled = config.as_ref().map(|text| text.lines().any(|line| line == "CONFIG_RT_GROUP_SCHED=y"));
    match (compiled, budget) {
        (_, Some(us)) => {
            Finding::ok(NAME, format!("the control group of {who} has {us} us of real-time budget"))
        }
        (Some(true), None) if !disabled => Finding::warning(
            NAME,
            "the kernel is built with it: in a control group without a budget SCHED_FIFO is refused in spite of all rights",
            "boot with rt_group_sched=0 (Linux 6.16 or newer), or use a kernel built without it",
        ),
        (Some(_), None) => Finding::ok(NAME, "not in use"),
        (None, None) => Finding::unknown(NAME, format!("/boot/config-{} cannot be read", shown(&release))),
    }
}

fn clock_source(s: &Subject) -> Finding {
    const NAME: &str = "clock source";
    /// Read by every thread without a system call, and fast.
    const FAST: [&str; 6] = [
        "tsc",
        "arch_sys_counter",
        "kvm-clock",
        "hyperv_clocksource_tsc_page",
        "riscv_clocksource",
        "timebase",
    ];
    match s.tree.text("sys/devices/system/clocksource/clocksource0/current_clocksource") {
        None => Finding::unknown(NAME, "the kernel does not report it"),
        Some(source) if FAST.contains(&source.as_str()) => Finding::ok(NAME, source),
        Some(source) => Finding::warning(
            NAME,
            format!("{}: every look at the clock is slow", shown(&source)),
            "look for the reason in `dmesg | grep -i -e tsc -e clocksource`; firmware updates and tsc=reliable are the usual remedies",
        ),
    }
}
