//! Every finding on a corrupted computer: a tree of files as the kernel would show them, healthy but for one of them.
use super::finding::{Finding, Grade};
use super::latency::Latency;
use super::subject::{AskController, Subject};
use super::tree::Tree;
use super::{Diagnosis, examine};
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU32, Ordering};
use taustream_arm::{BusKind, Settings};
use taustream_drivers::link::{Controller, ControllerState};
use taustream_streamer::bench::{Quantiles, WakeUps};

/// A computer without a fault: real-time kernel, four CPUs, the last one isolated for the cycle, can0 on a PCI card.
const HEALTHY: &[(&str, &str)] = &[
    ("proc/version", "Linux version 6.12.0-rt (x) #1 SMP PREEMPT_RT\n"),
    ("proc/sys/kernel/osrelease", "6.12.0-rt\n"),
    ("proc/net/protocols", "protocol size\nCAN_RAW 1024\n"),
    ("proc/sys/kernel/sched_rt_runtime_us", "-1\n"),
    ("boot/config-6.12.0-rt", "CONFIG_A=y\n# CONFIG_RT_GROUP_SCHED is not set\n"),
    ("proc/self/cgroup", "0::/user.slice\n"),
    ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
    ("proc/self/limits", LIMITS),
    ("proc/self/status", "Name:\tx\nCapEff:\t0000000000000000\n"),
    ("sys/devices/system/cpu/online", "0-3\n"),
    ("sys/devices/system/cpu/isolated", "3\n"),
    ("sys/devices/system/cpu/nohz_full", "3\n"),
    ("sys/devices/system/cpu/smt/active", "0\n"),
    ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
    ("sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "performance\n"),
    ("sys/devices/system/cpu/cpu3/cpuidle/state0/latency", "1\n"),
    ("sys/devices/system/cpu/cpu3/cpuidle/state0/name", "C1\n"),
    ("sys/devices/system/cpu/cpu3/cpuidle/state1/latency", "200\n"),
    ("sys/devices/system/cpu/cpu3/cpuidle/state1/disable", "1\n"),
    ("proc/irq/30/smp_affinity_list", "0-3\n"),
    ("proc/irq/30/can0/x", ""),
    ("proc/irq/40/smp_affinity_list", "0-2\n"),
    ("proc/irq/40/nvme/x", ""),
    ("sys/devices/pci/net/can0/type", "280\n"),
    ("sys/devices/pci/net/can0/flags", "0x40081\n"),
    ("sys/devices/pci/net/can0/tx_queue_len", "16\n"),
    ("proc/77/comm", "irq/30-can0\n"),
    (
        "proc/77/stat",
        "77 (irq/30-can0) S 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 90 1 0",
    ),
    ("proc/16/comm", "ksoftirqd/0\n"),
    (
        "proc/16/stat",
        "16 (ksoftirqd/0) S 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1 0",
    ),
    ("proc/31/comm", "ksoftirqd/3\n"),
    (
        "proc/31/stat",
        "31 (ksoftirqd/3) S 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 90 1 0",
    ),
    ("proc/swaps", "Filename Type Size Used Priority\n"),
    ("proc/cpuinfo", "flags : fpu tsc\n"),
    ("sys/class/thermal/thermal_zone0/temp", "41000\n"),
    ("sys/class/thermal/thermal_zone0/type", "x86_pkg_temp\n"),
];
const LIMITS: &str = "Limit Soft Hard Units\nMax locked memory         unlimited  unlimited bytes\nMax realtime priority     99     99\n";
const POOR: &str = "Limit Soft Hard Units\nMax locked memory         65536  65536 bytes\nMax realtime priority     0     0\n";

/// Read once: the contact rule tries 10,000 poses.
static SETTINGS: LazyLock<Settings> = LazyLock::new(|| {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
    Settings::load(&file).unwrap()
});

/// A corrupted computer; gone after the test.
struct Computer {
    root: PathBuf,
    subject: Subject,
}

impl Computer {
    fn healthy() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let root = std::env::temp_dir().join(format!("taustream-doctor-{}-{number}", std::process::id()));
        let mut settings = SETTINGS.clone();
        settings.cycle.cpu = Some(3);
        settings.buses[0].interface = "can0".to_owned();
        settings.buses[0].kind = BusKind::Classic { bitrate_bit_s: 1_000_000 };
        let subject = Subject {
            tree: Tree::new(&root),
            settings: Some(settings),
            priority: 80,
            uid: rustix::process::geteuid().as_raw(),
            runtime: "/run/taustream".to_owned(),
            shm_free: Some(1 << 30),
            controller: active,
        };
        let computer = Self { root, subject };
        for (path, text) in HEALTHY {
            computer.write(path, text);
        }
        fs::create_dir_all(computer.path("sys/class/net")).unwrap();
        fs::create_dir_all(computer.path("run/taustream")).unwrap();
        fs::set_permissions(computer.path("run/taustream"), fs::Permissions::from_mode(0o700)).unwrap();
        symlink("../../devices/pci/net/can0", computer.path("sys/class/net/can0")).unwrap();
        fs::create_dir_all(computer.path("sys/devices/pci/net/can0/device")).unwrap();
        symlink("../../../../bus/pci", computer.path("sys/devices/pci/net/can0/device/subsystem")).unwrap();
        computer
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.join(path)
    }

    fn write(&self, path: &str, text: &str) {
        let path = self.path(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn remove(&self, path: &str) {
        fs::remove_file(self.path(path)).unwrap();
    }

    fn findings(&self) -> Vec<Finding> {
        examine(&self.subject)
    }

    /// Asserts the grade of one finding, words in it, a remedy unless all is well, and that nothing else has changed.
    #[track_caller]
    fn finds(&self, name: &str, grade: Grade, words: &[&str]) {
        let findings = self.findings();
        let found: Vec<&Finding> = findings.iter().filter(|f| f.name == name).collect();
        let [found] = found[..] else { panic!("{} findings {name}: {findings:?}", found.len()) };
        assert_eq!(found.grade, grade, "{found}");
        for word in words {
            assert!(found.to_string().contains(word), "no `{word}`: {found}");
        }
        let needs_remedy = matches!(grade, Grade::Warning | Grade::Problem);
        assert_eq!(found.remedy.is_some(), needs_remedy, "{found}");
        for other in findings.iter().filter(|f| f.name != name) {
            assert_eq!(other.grade, Grade::Ok, "only {name} was corrupted: {other}");
        }
    }
}

impl Drop for Computer {
    fn drop(&mut self) {
        let _left = fs::remove_dir_all(&self.root);
    }
}

fn active(_interface: &str) -> Controller {
    let state = Some(ControllerState::Active);
    Controller { bitrate_bit_s: Some(1_000_000), state, restart_ms: Some(0) }
}

#[test]
fn healthy_computer_is_all_ok() {
    let findings = Computer::healthy().findings();
    assert!(findings.len() >= 20, "{}", findings.len());
    for finding in &findings {
        assert_eq!(finding.grade, Grade::Ok, "{finding}");
    }
    let diagnosis = Diagnosis::of(None, findings, None);
    assert!(diagnosis.total().starts_with("fit"), "{}", diagnosis.total());
    assert!(diagnosis.to_string().contains("not a safety function"));
}

/// One file corrupted, one finding changed: path, text, and what must be found.
type Row = (&'static str, &'static str, &'static str, Grade, &'static [&'static str]);

const ROWS: &[Row] = &[
    (
        "proc/version",
        "Linux version 6.1 SMP PREEMPT_DYNAMIC",
        "kernel",
        Grade::Problem,
        &["without PREEMPT_RT", "linux-image-rt"],
    ),
    ("proc/net/protocols", "TCP 1\n", "CAN sockets", Grade::Problem, &["no module", "CONFIG_CAN_RAW"]),
    (
        "proc/sys/kernel/sched_rt_runtime_us",
        "950000\n",
        "real-time throttling",
        Grade::Warning,
        &["950000", "sched_rt_runtime_us=-1"],
    ),
    (
        "proc/sys/kernel/sched_rt_runtime_us",
        "0\n",
        "real-time throttling",
        Grade::Problem,
        &["no time at all"],
    ),
    (
        "boot/config-6.12.0-rt",
        "CONFIG_RT_GROUP_SCHED=y\n",
        "RT_GROUP_SCHED",
        Grade::Warning,
        &["rt_group_sched=0"],
    ),
    (
        "sys/devices/system/clocksource/clocksource0/current_clocksource",
        "hpet\n",
        "clock source",
        Grade::Warning,
        &["hpet"],
    ),
    (
        "sys/devices/system/cpu/isolated",
        "\n",
        "isolated CPU",
        Grade::Warning,
        &["CPU 3 is shared", "isolcpus"],
    ),
    ("sys/devices/system/cpu/nohz_full", "(null)\n", "isolated CPU", Grade::Warning, &["nohz_full=3"]),
    ("sys/devices/system/cpu/online", "0-1\n", "isolated CPU", Grade::Problem, &["cycle.cpu is 3", "0, 1"]),
    ("sys/devices/system/cpu/online", "0\n", "isolated CPU", Grade::Warning, &["one CPU only"]),
    ("proc/irq/40/smp_affinity_list", "0-3\n", "interrupt affinity", Grade::Warning, &["40 (nvme)", "CPU 3"]),
    (
        "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor",
        "powersave\n",
        "CPU governor",
        Grade::Warning,
        &["cpu0 has powersave", "cpupower"],
    ),
    (
        "sys/devices/system/cpu/cpu3/cpuidle/state1/disable",
        "0\n",
        "idle states",
        Grade::Warning,
        &["200 us", "idle-set"],
    ),
    ("sys/devices/system/cpu/smt/active", "1\n", "SMT", Grade::Warning, &["nosmt"]),
    ("sys/devices/pci/net/can0/type", "1\n", "CAN interface", Grade::Problem, &["no CAN interface"]),
    (
        "sys/devices/pci/net/can0/flags",
        "0x40080\n",
        "CAN interface",
        Grade::Problem,
        &["is down", "bitrate 1000000"],
    ),
    (
        "sys/devices/pci/net/can0/tx_queue_len",
        "5\n",
        "txqueuelen",
        Grade::Problem,
        &["queues 5 frames", "sends 7", "txqueuelen 16"],
    ),
    (
        "sys/devices/pci/net/can0/tx_queue_len",
        "1000\n",
        "txqueuelen",
        Grade::Warning,
        &["1000", "old setpoints"],
    ),
    (
        "proc/77/stat",
        "77 (irq/30-can0) S 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 50 1",
        "CAN interrupt",
        Grade::Warning,
        &["priority 50", "chrt --fifo --pid 90 77"],
    ),
    (
        "proc/31/stat",
        "31 (ksoftirqd/3) S 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1 0",
        "software interrupts",
        Grade::Warning,
        &["ksoftirqd/3", "ordinary", "chrt --fifo --pid 90 31"],
    ),
    (
        "proc/swaps",
        "Filename Type\n/dev/sda2 partition 1 0 -2\n",
        "swap",
        Grade::Warning,
        &["/dev/sda2", "swapoff"],
    ),
    (
        "dev/shm/taustream.1000.ur5.x",
        "",
        "stale segments",
        Grade::Warning,
        &["taustream.1000.ur5.", "rm /dev/shm"],
    ),
    ("proc/cpuinfo", "flags : fpu hypervisor tsc\n", "virtual machine", Grade::Warning, &["a hypervisor"]),
    (
        "proc/cpuinfo",
        "vendor_id : User Mode Linux\n",
        "virtual machine",
        Grade::Warning,
        &["user-mode Linux"],
    ),
    ("sys/class/dmi/id/product_name", "VirtualBox\n", "virtual machine", Grade::Warning, &["VirtualBox"]),
    (".dockerenv", "", "container", Grade::Warning, &["docker"]),
    ("run/systemd/container", "lxc\n", "container", Grade::Warning, &["lxc"]),
    ("sys/class/thermal/thermal_zone1/temp", "91000\n", "temperature", Grade::Warning, &["91 degrees"]),
    (
        "sys/devices/system/cpu/cpu0/thermal_throttle/core_throttle_count",
        "12\n",
        "temperature",
        Grade::Warning,
        &["12 times"],
    ),
    (
        "proc/sys/kernel/sched_rt_runtime_us",
        "many",
        "real-time throttling",
        Grade::Unknown,
        &["cannot be read"],
    ),
];

#[test]
fn one_corrupted_file_makes_one_finding_with_its_remedy() {
    for (path, text, name, grade, words) in ROWS {
        let computer = Computer::healthy();
        computer.write(path, text);
        if *path == "proc/net/protocols" {
            computer.write("lib/modules/6.12.0-rt/modules.dep", "kernel/net/x.ko:\n");
        }
        computer.finds(name, *grade, words);
    }
}

#[test]
fn module_that_is_not_loaded_is_a_warning() {
    let computer = Computer::healthy();
    computer.write("proc/net/protocols", "TCP\n");
    computer.write(
        "lib/modules/6.12.0-rt/modules.dep",
        "kernel/net/can/can-raw.ko.xz: kernel/net/can/can.ko.xz\n",
    );
    computer.finds("CAN sockets", Grade::Warning, &["modprobe can_raw"]);
}

#[test]
fn rights_are_those_of_a_running_streamer_else_of_the_user() {
    let computer = Computer::healthy();
    computer.write("proc/self/limits", POOR);
    let findings = computer.findings();
    let grade = |name: &str| findings.iter().find(|f| f.name == name).map(|f| f.grade);
    assert_eq!(grade("real-time priority"), Some(Grade::Problem));
    assert_eq!(grade("memory lock"), Some(Grade::Problem));
    // Capabilities make up for both.
    computer.write("proc/self/status", "CapEff:\t0000000000804000\n");
    assert!(computer.findings().iter().all(|f| f.grade == Grade::Ok), "{:?}", computer.findings());
    // A streamer that runs has its own, but only this user's says anything of what this user may.
    computer.write("proc/500/comm", "taustream-strea\n");
    computer.write("proc/500/limits", LIMITS);
    computer.write("proc/self/status", "CapEff:\t0\n");
    let uid = computer.subject.uid;
    computer.write("proc/500/status", &format!("Uid:\t{uid}\t{}\t{uid}\t{uid}\n", uid + 1));
    let others = computer.findings();
    let priority = others.iter().find(|f| f.name == "real-time priority").unwrap();
    assert!(
        priority.grade == Grade::Problem && priority.what.contains("process 500, is another user's"),
        "{priority}"
    );
    computer.write("proc/500/status", &format!("Uid:\t{uid}\t{uid}\t{uid}\t{uid}\n"));
    computer.finds("real-time priority", Grade::Ok, &["process 500", "99"]);
}

#[test]
fn control_group_without_a_budget_is_a_problem() {
    let computer = Computer::healthy();
    computer.write("proc/self/cgroup", "4:cpu,cpuacct:/system.slice\n");
    computer.write("sys/fs/cgroup/cpu/system.slice/cpu.rt_runtime_us", "0\n");
    computer.finds("RT_GROUP_SCHED", Grade::Problem, &["/system.slice", "cpu.rt_runtime_us"]);
    // A path that leads out of the hierarchy is not followed.
    computer.write("proc/self/cgroup", "4:cpu:/../../x\n");
    computer.finds("RT_GROUP_SCHED", Grade::Ok, &["not in use"]);
}

#[test]
fn faulty_controller_is_reported_by_its_driver() {
    let cases: [(AskController, Grade, &[&str]); 4] = [
        (
            |_| Controller { bitrate_bit_s: Some(500_000), ..active("") },
            Grade::Problem,
            &["500000", "bitrate 1000000"],
        ),
        (
            |_| Controller { state: Some(ControllerState::Off), ..active("") },
            Grade::Problem,
            &["BUS-OFF", "60 ohm"],
        ),
        (
            |_| Controller { state: Some(ControllerState::Warning), ..active("") },
            Grade::Warning,
            &["ERROR-WARNING"],
        ),
        (|_| Controller { restart_ms: Some(100), ..active("") }, Grade::Warning, &["100 ms", "restart-ms 0"]),
    ];
    for (controller, grade, words) in cases {
        let mut computer = Computer::healthy();
        computer.subject.controller = controller;
        computer.finds("CAN interface", grade, words);
    }
}

#[test]
fn interface_that_is_missing_or_on_usb_is_reported() {
    let computer = Computer::healthy();
    computer.remove("sys/devices/pci/net/can0/device/subsystem");
    symlink("../../../../bus/usb", computer.path("sys/devices/pci/net/can0/device/subsystem")).unwrap();
    computer.finds("USB adapter", Grade::Warning, &["can0", "PCIe"]);

    let mut computer = Computer::healthy();
    computer.remove("sys/class/net/can0");
    computer.finds("CAN interface", Grade::Problem, &["can0 of bus", "does not exist"]);
    if let Some(settings) = &mut computer.subject.settings {
        settings.buses[0].kind = BusKind::Virtual;
    }
    computer.finds("CAN interface", Grade::Warning, &["local link", "type vcan"]);
}

#[test]
fn runtime_directory_and_shared_memory_are_graded() {
    let mut computer = Computer::healthy();
    fs::set_permissions(computer.path("run/taustream"), fs::Permissions::from_mode(0o755)).unwrap();
    computer.finds("runtime directory", Grade::Problem, &["0755", "chmod 0700"]);
    computer.subject.uid += 1;
    computer.finds(
        "runtime directory",
        Grade::Problem,
        &["belongs to uid", "act as that user", "TAUSTREAM_RUNTIME_DIR"],
    );

    let mut computer = Computer::healthy();
    computer.subject.shm_free = Some(1 << 20);
    computer.finds("/dev/shm", Grade::Problem, &["1 MiB free", "remount"]);
    // While a process runs, segments are in use.
    let computer = Computer::healthy();
    computer.write("dev/shm/taustream.1000.ur5.x", "");
    computer.write("proc/600/comm", "taustream-plann\n");
    computer.finds("stale segments", Grade::Ok, &["not checked"]);
}

#[test]
fn what_deletes_files_of_running_services_is_named() {
    let mut computer = Computer::healthy();
    // The directory must be the user's own for the other findings; only the number of a login user counts here.
    computer.subject.runtime = "nowhere".to_owned();
    computer.subject.uid = 1000;
    computer.write("run/systemd/system/x", "");
    computer.finds("files of services", Grade::Warning, &["RemoveIPC=yes", "uid 1000", "enable-linger"]);
    computer.write("etc/systemd/logind.conf", "[Login]\n#RemoveIPC=no\nRemoveIPC=yes\n");
    computer.finds("files of services", Grade::Warning, &["RemoveIPC"]);
    computer.write("etc/systemd/logind.conf.d/arm.conf", "[Login]\nRemoveIPC = no\n");
    computer.finds("files of services", Grade::Ok, &[]);
    computer.subject.runtime = "tmp/taustream-1000".to_owned();
    computer.finds("files of services", Grade::Warning, &["/tmp", "TAUSTREAM_RUNTIME_DIR"]);
    computer.subject.uid = 990;
    computer.subject.runtime = "nowhere".to_owned();
    computer.remove("etc/systemd/logind.conf.d/arm.conf");
    computer.finds("files of services", Grade::Ok, &[]);
}

#[test]
fn computer_without_any_information_is_unknown_and_no_panic() {
    let mut computer = Computer::healthy();
    computer.subject.tree = Tree::new(computer.root.join("nothing"));
    computer.subject.settings = None;
    computer.subject.shm_free = None;
    let findings = computer.findings();
    assert!(findings.iter().filter(|f| f.grade == Grade::Unknown).count() >= 8, "{findings:?}");
    assert!(
        findings.iter().any(|f| f.name == "CAN interfaces" && f.what.contains("--settings")),
        "{findings:?}"
    );
}

/// Goal: no text in /proc or /sys makes the doctor panic, or gets to the terminal with its escapes. Method: every file
/// in turn gets seeded rubbish and the worst numbers.
#[test]
fn hostile_text_anywhere_is_no_panic_and_is_shown_without_escapes() {
    let worst = [
        "",
        "-9223372036854775808",
        "99999999999999999999999",
        "0-99999999999999",
        "\u{1b}[2J\u{7}",
        ":::::",
        "((((",
        "\0",
    ];
    for seed in 0..60_u64 {
        let computer = Computer::healthy();
        for (i, (path, _)) in (0_u32..).zip(HEALTHY) {
            let roll = (seed + 1).wrapping_mul(6_364_136_223_846_793_005).rotate_left(i % 64);
            let text = match roll % 3 {
                0 => continue,
                1 => worst[(roll >> 61) as usize].to_owned(),
                _ => (0..roll % 97)
                    .map(|k| char::from(roll.to_le_bytes()[(k % 8) as usize] ^ k.to_le_bytes()[0]))
                    .collect(),
            };
            computer.write(path, &text);
        }
        for finding in computer.findings() {
            let text = finding.to_string();
            let shown = text.chars().filter(|c| c.is_control() && *c != '\n').count();
            assert_eq!(shown, 0, "seed {seed}: {text:?}");
        }
    }
}

#[test]
fn latency_is_graded_against_the_period_and_the_rights() {
    let latency = |max_us: u64, realtime: bool, skipped: u64| {
        let max_ns = max_us * 1_000;
        let lateness = Quantiles { count: 9, p50_ns: max_ns / 4, p99_ns: max_ns, p999_ns: max_ns, max_ns };
        let wake_ups = WakeUps {
            period_us: 1_000,
            realtime,
            missing: Vec::new(),
            lateness,
            skipped,
            histogram: Vec::new(),
        };
        Latency { wake_ups, seconds: 5.0, bounded: false }
    };
    assert_eq!(latency(60, true, 0).evaluate().grade, Grade::Ok);
    assert_eq!(latency(60, false, 0).evaluate().grade, Grade::Warning);
    assert_eq!(latency(160, true, 0).evaluate().grade, Grade::Warning);
    assert_eq!(latency(600, true, 0).evaluate().grade, Grade::Problem);
    assert_eq!(latency(60, true, 1).evaluate().grade, Grade::Problem);
    assert!(latency(60, true, 0).to_string().contains("promises no bound"));
}
