//! What is tried in the guest, in this order, and the proof that the trials can fail.
use super::guest::{TIMEOUT, done};
use super::{STREAMER, hardening, recovery, rights};
use anyhow::{Result, bail};
use std::fs;
use std::time::{Duration, Instant};

type Check = (&'static str, fn() -> Result<String>);

/// Every check. Later ones rely on what earlier ones have done to the arm.
const ALL: [Check; 14] = [
    ("services come up in order", recovery::order),
    ("users, directories and modes", rights::files),
    ("units verify", hardening::verified),
    ("exposure", hardening::exposures),
    ("hardening is enforced", hardening::enforced),
    ("another user is refused with the remedy", rights::stranger),
    ("an operator moves the arm", rights::operator),
    ("the sudo rule gives nothing else away", rights::sudo_rule),
    ("real-time thread and locked memory", hardening::real_time),
    ("planner killed mid-motion", recovery::planner_killed),
    ("planner hung", recovery::planner_hung),
    ("streamer killed", recovery::streamer_killed),
    ("cycle stalled", || recovery::cycle_stalled(TIMEOUT)),
    ("link lost and back", recovery::link_lost),
];
/// What only shows when everything has happened.
const LAST: Check = ("journal", recovery::journal);

/// Time that a planted fault gets to show itself: far above the 2 s of the watchdog.
const CORRUPTED: Duration = Duration::from_secs(8);

/// How often a check is tried on a host that stalls the machine.
const TRIES: usize = 2;

/// Where drop-ins of this boot go.
const DROP_INS: &str = "/run/systemd/system";

/// Runs every check; how many failed.
///
/// # Errors
/// When the guest cannot be prepared.
pub fn run(only: &str) -> Result<usize> {
    rights::make_people()?;
    let mut failed = 0;
    for (name, check) in ALL.into_iter().chain([LAST]).filter(|(name, _)| name.contains(only)) {
        failed += usize::from(!perform(name, check));
    }
    if only.is_empty() {
        for (name, check) in DOCTOR {
            failed += usize::from(!perform(name, check));
        }
    }
    Ok(failed)
}

fn perform(name: &str, check: impl Fn() -> Result<String>) -> bool {
    let since = Instant::now();
    let mut outcome = check();
    for _ in 1..TRIES {
        let stalled = outcome.as_ref().is_err_and(|error| error.to_string().contains("loop stalled"));
        if !stalled {
            break;
        }
        println!("       {name}: the host stalled the machine for longer than the drives wait; again");
        outcome = check();
    }
    let took_s = since.elapsed().as_secs_f64();
    match &outcome {
        Ok(words) => println!("ok     {name}: {words}; {took_s:.1} s"),
        Err(error) => println!("FAILED {name}: {error:#}; {took_s:.1} s"),
    }
    outcome.is_ok()
}

/// Checks that have to fail on units that were corrupted.
const DOCTOR: [Check; 3] = [
    ("without a watchdog a stalled cycle is noticed as such", || {
        corrupted("taustream-streamer@arm1.service", "[Service]\nWatchdogSec=0\n")?;
        must_fail(|| recovery::cycle_stalled(CORRUPTED))
    }),
    ("without hardening the exposure is noticed", || {
        corrupted(
            "taustream-streamer@arm1.service",
            "[Service]\nProtectSystem=no\nPrivateDevices=no\nSystemCallFilter=\n",
        )?;
        must_fail(hardening::exposures)
    }),
    ("without hardening the probes are let through, and noticed", || {
        corrupted(
            "taustream-streamer@probe.service",
            "[Service]\nProtectSystem=no\nRestrictAddressFamilies=\n",
        )?;
        must_fail(hardening::enforced)
    }),
];

/// Lays a drop-in over a unit, for the rest of this boot.
fn corrupted(unit: &str, text: &str) -> Result<()> {
    let folder = format!("{DROP_INS}/{unit}.d");
    fs::create_dir_all(&folder)?;
    fs::write(format!("{folder}/zz-corrupted.conf"), text)?;
    done(&["systemctl", "daemon-reload"])?;
    if unit == STREAMER {
        done(&["systemctl", "restart", unit])?;
    }
    Ok(())
}

fn must_fail(check: impl Fn() -> Result<String>) -> Result<String> {
    match check() {
        Ok(words) => bail!("the check passed on a corrupted unit: {words}"),
        Err(error) => Ok(format!("as it must: {error:#}")),
    }
}
