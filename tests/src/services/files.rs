//! What an administrator would write on a controller with one simulated arm, laid over the installed tree.
use super::ARM;
use anyhow::{Context, Result, ensure};
use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;

const PROBE: &str = include_str!("../../machine/probe.sh");
const CAN_SOFTIRQ: &str = include_str!("../../machine/can-softirq.sh");
/// The sandbox of a service, with another program in it. `+` would step out of it, so there is none.
const PROBE_UNIT: &str = "\
[Service]
Type=oneshot
ExecStart=
ExecStart=/bin/bash /opt/probe.sh
WatchdogSec=0
Restart=no
";
/// What `taustream doctor` asks for: frames must not wait behind ordinary programs on their way through the kernel.
const CAN_SOFTIRQ_UNIT: &str = "\
[Service]
Type=oneshot
ExecStart=/bin/bash /opt/can-softirq.sh
[Install]
WantedBy=multi-user.target
";
/// The pose at power-up of the arm's settings: arm up, elbow bent, clear of everything.
const START: &str = "start_rad = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]";

/// Units of Debian and of ours that are enabled, and what wants them.
const ENABLED: [(&str, &str, &str); 4] = [
    ("multi-user.target", "can-softirq.service", "/etc/systemd/system/can-softirq.service"),
    ("multi-user.target", "systemd-networkd.service", "systemd-networkd.service"),
    ("multi-user.target", "taustream@arm1.target", "taustream@.target"),
    ("taustream@arm1.target", "taustream-servosim@arm1.service", "taustream-servosim@.service"),
];

/// Lays the files into `root`; `bench` is what was installed.
///
/// # Errors
/// When the installed tree is not as expected, or a file cannot be written.
pub fn lay_out(root: &Path, bench: &Path) -> Result<()> {
    let shared = bench.join("usr/share/taustream");
    let write = |path: &str, text: &str| -> Result<()> {
        let path = root.join(path);
        fs::create_dir_all(path.parent().context("no parent")?)?;
        fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write(&format!("etc/taustream/settings/{ARM}.toml"), &settings(&shared)?)?;
    for name in ["vcan0", "vcan1"] {
        for kind in ["netdev", "network"] {
            let file = format!("70-taustream-{name}.{kind}");
            let text =
                fs::read_to_string(shared.join("network").join(&file)).with_context(|| file.clone())?;
            write(&format!("etc/systemd/network/{file}"), &text)?;
        }
    }
    write("etc/sysctl.d/taustream.conf", "kernel.sched_rt_runtime_us = -1\n")?;
    write("etc/systemd/system/can-softirq.service", CAN_SOFTIRQ_UNIT)?;
    for (wanted_by, unit, file) in ENABLED {
        let wants = root.join(format!("etc/systemd/system/{wanted_by}.wants"));
        fs::create_dir_all(&wants)?;
        symlink(Path::new("/usr/lib/systemd/system").join(file), wants.join(unit))?;
    }
    for service in ["streamer", "planner"] {
        write(&format!("etc/systemd/system/taustream-{service}@probe.service.d/probe.conf"), PROBE_UNIT)?;
    }
    write("opt/probe.sh", PROBE)?;
    write("opt/can-softirq.sh", CAN_SOFTIRQ)?;
    fs::copy(std::env::current_exe()?, root.join("opt/services"))?;
    fs::set_permissions(root.join("opt/services"), Permissions::from_mode(0o755))?;
    Ok(())
}

/// The shipped settings of six simulated servos, under another name and with a start pose.
fn settings(shared: &Path) -> Result<String> {
    let mut text = fs::read_to_string(shared.join("settings/vcan6.toml")).context("shipped settings")?;
    for (old, new) in [
        ("name = \"vcan6\"", format!("name = \"{ARM}\"")),
        ("\"../robots/ur5.toml\"", "\"/usr/share/taustream/robots/ur5.toml\"".to_owned()),
        ("\"../scenes/pillars.toml\"", "\"/usr/share/taustream/scenes/open.toml\"".to_owned()),
        // The host stalls the machine, and its kernel hands echoes to an ordinary thread, which waits its turn behind
        // whatever else runs. How the arm meets stalls is the scenarios' affair, not that of these trials.
        ("\nlost_cycles_max = 3\n", "\nlost_cycles_max = 60\n".to_owned()),
        ("\nstall_resume_ms = 20\n", "\nstall_resume_ms = 200\n".to_owned()),
        ("\ndrive_watchdog_ms = 100\n", "\ndrive_watchdog_ms = 500\n".to_owned()),
        ("\nfeedback_age_s_max = 0.05\n", "\nfeedback_age_s_max = 0.25\n".to_owned()),
        ("\nstart_rad = [-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]\n", format!("\n{START}\n")),
    ] {
        ensure!(text.contains(old), "the shipped settings have no {old}");
        text = text.replacen(old, &new, 1);
    }
    Ok(text)
}
