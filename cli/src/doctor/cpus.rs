//! The CPUs: is one of them the cycle's own, awake and at full speed?
use super::finding::Finding;
use super::subject::Subject;
use super::tree::{cpu_list, shown};

const CPU: &str = "sys/devices/system/cpu";
/// An idle state that takes longer to leave than this shows in a cycle of 1 ms.
const IDLE_EXIT_US_MAX: i64 = 50;
/// More are counted, not listed.
const LISTED_MAX: usize = 5;

pub(crate) fn examine(s: &Subject) -> Vec<Finding> {
    vec![isolation(s), interrupts(s), governor(s), idle_states(s), threads_of_a_core(s)]
}

fn listed(s: &Subject, file: &str) -> Vec<usize> {
    cpu_list(&s.tree.text(&format!("{CPU}/{file}")).unwrap_or_default())
}

fn isolation(s: &Subject) -> Finding {
    const NAME: &str = "isolated CPU";
    let online = listed(s, "online");
    let (isolated, tickless) = (listed(s, "isolated"), listed(s, "nohz_full"));
    let own = s.cpu().or(isolated.last().copied()).or(online.last().copied()).unwrap_or(0);
    let remedy = format!(
        "boot with isolcpus=managed_irq,domain,{own} nohz_full={own} rcu_nocbs={own}, and set cycle.cpu = {own} in the settings"
    );
    match s.cpu() {
        _ if online.is_empty() => Finding::unknown(NAME, "the kernel does not list its CPUs"),
        _ if online.len() == 1 => Finding::warning(
            NAME,
            "there is one CPU only: the cycle shares it with everything else",
            "use a computer with at least two CPUs",
        ),
        Some(cpu) if !online.contains(&cpu) => Finding::problem(
            NAME,
            format!("cycle.cpu is {cpu}, and this computer has {} only", shown(&describe(&online))),
            "set cycle.cpu to one of them, the last one preferably",
        ),
        Some(cpu) if !isolated.contains(&cpu) => Finding::warning(
            NAME,
            format!("the cycle's CPU {cpu} is shared with all other processes"),
            remedy,
        ),
        Some(cpu) if !tickless.contains(&cpu) => {
            let what = format!("the cycle's CPU {cpu} is isolated, but the scheduler's clock interrupts it");
            Finding::warning(NAME, what, remedy)
        }
        Some(cpu) => Finding::ok(NAME, format!("CPU {cpu} belongs to the cycle, without a scheduler tick")),
        None if isolated.is_empty() => {
            Finding::warning(NAME, "none: any process can delay the cycle", remedy)
        }
        None => Finding::warning(
            NAME,
            format!("CPU {} is isolated, but the cycle is not bound to it", describe(&isolated)),
            format!("set cycle.cpu = {own} in the settings"),
        ),
    }
}

/// "0, 1, 2"
fn describe(cpus: &[usize]) -> String {
    cpus.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// Interrupts that may come to the cycle's CPU, the CAN interfaces' own left out: they belong there.
fn interrupts(s: &Subject) -> Finding {
    const NAME: &str = "interrupt affinity";
    let Some(cpu) = s.cpu() else {
        return Finding::unknown(
            NAME,
            "the cycle has no CPU of its own (cycle.cpu), so none can be kept off it",
        );
    };
    let mut there = Vec::new();
    for number in s.tree.names("proc/irq").into_iter().filter(|n| n.parse::<u32>().is_ok()) {
        let at = format!("proc/irq/{number}");
        let affinity = s.tree.text(&format!("{at}/effective_affinity_list"));
        let affinity =
            affinity.or_else(|| s.tree.text(&format!("{at}/smp_affinity_list"))).unwrap_or_default();
        // An interrupt in use has a directory with its user's name.
        let user = s.tree.names(&at).into_iter().find(|name| s.tree.path(&format!("{at}/{name}")).is_dir());
        if let Some(user) = user.filter(|user| !user.contains("can"))
            && cpu_list(&affinity).contains(&cpu)
        {
            there.push(format!("{number} ({})", shown(&user)));
        }
    }
    if there.is_empty() {
        return Finding::ok(NAME, format!("no foreign interrupt comes to CPU {cpu}"));
    }
    let list = there.iter().take(LISTED_MAX).cloned().collect::<Vec<_>>().join(", ");
    Finding::warning(
        NAME,
        format!(
            "{} interrupts may come to CPU {cpu}: {list}{}",
            there.len(),
            if there.len() > LISTED_MAX { ", .." } else { "" }
        ),
        format!(
            "keep them off it: for i in /proc/irq/[0-9]*; do echo 0-{} > $i/smp_affinity_list; done (as root; stop irqbalance, or ban CPU {cpu} there)",
            cpu.saturating_sub(1)
        ),
    )
}

/// Names of the CPUs' own directories.
fn cpu_directories(s: &Subject) -> Vec<String> {
    let is_cpu = |name: &String| name.strip_prefix("cpu").is_some_and(|n| n.parse::<u32>().is_ok());
    s.tree.names(CPU).into_iter().filter(is_cpu).collect()
}

fn governor(s: &Subject) -> Finding {
    const NAME: &str = "CPU governor";
    let governor = |cpu: &String| {
        let text = s.tree.text(&format!("{CPU}/{cpu}/cpufreq/scaling_governor"))?;
        Some((cpu.clone(), text))
    };
    let governors: Vec<(String, String)> = cpu_directories(s).iter().filter_map(governor).collect();
    if governors.is_empty() {
        return Finding::unknown(NAME, "the kernel does not set this computer's CPU frequencies");
    }
    match governors.iter().find(|(_, governor)| governor != "performance") {
        None => Finding::ok(NAME, "performance"),
        Some((cpu, governor)) => Finding::warning(
            NAME,
            format!("{cpu} has {}: its speed changes with its load", shown(governor)),
            "cpupower frequency-set --governor performance (Debian: apt install linux-cpupower)",
        ),
    }
}

fn idle_states(s: &Subject) -> Finding {
    const NAME: &str = "idle states";
    let cpu = s.cpu().unwrap_or(0);
    let at = format!("{CPU}/cpu{cpu}/cpuidle");
    let mut deepest: Option<(i64, String)> = None;
    for state in s.tree.names(&at).iter().filter(|name| name.starts_with("state")) {
        let disabled = s.tree.number(&format!("{at}/{state}/disable")).unwrap_or(0) != 0;
        let exit_us = s.tree.number(&format!("{at}/{state}/latency")).unwrap_or(0);
        if !disabled && deepest.as_ref().is_none_or(|(us, _)| exit_us > *us) {
            deepest = Some((exit_us, s.tree.text(&format!("{at}/{state}/name")).unwrap_or_default()));
        }
    }
    match deepest {
        None => Finding::unknown(NAME, format!("the kernel does not report those of CPU {cpu}")),
        Some((us, name)) if us > IDLE_EXIT_US_MAX => Finding::warning(
            NAME,
            format!("CPU {cpu} may sleep as deep as {}, which takes {us} us to leave", shown(&name)),
            format!("cpupower --cpu {cpu} idle-set --disable-by-latency {IDLE_EXIT_US_MAX}"),
        ),
        Some((us, name)) => Finding::ok(NAME, format!("none deeper than {} ({us} us)", shown(&name))),
    }
}

fn threads_of_a_core(s: &Subject) -> Finding {
    const NAME: &str = "SMT";
    match s.tree.text(&format!("{CPU}/smt/active")).as_deref() {
        Some("1") => Finding::warning(
            NAME,
            "two CPUs share one core: load on the other one slows the cycle down",
            "boot with nosmt, or keep the core's other CPU idle (isolcpus both)",
        ),
        Some("0") => Finding::ok(NAME, "off"),
        Some(_) | None => Finding::unknown(NAME, "the kernel does not report it"),
    }
}
