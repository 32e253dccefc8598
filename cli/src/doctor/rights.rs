//! May the streamer have its priority, and its memory for itself?
use super::finding::Finding;
use super::subject::Subject;

/// `CAP_IPC_LOCK` and `CAP_SYS_NICE` in a set of capabilities.
const IPC_LOCK: u64 = 1 << 14;
const SYS_NICE: u64 = 1 << 23;

const REMEDY: &str = "run it by the packaged systemd unit; by hand: setcap cap_sys_nice,cap_ipc_lock+ep taustream-streamer, \
                    or `rtprio 99` and `memlock unlimited` for the user in /etc/security/limits.conf and a new login";

pub(crate) fn examine(s: &Subject) -> Vec<Finding> {
    let (process, who) = s.process();
    let limits = s.tree.text(&format!("{process}/limits")).unwrap_or_default();
    let status = s.tree.text(&format!("{process}/status")).unwrap_or_default();
    let capabilities = status
        .lines()
        .find_map(|line| u64::from_str_radix(line.strip_prefix("CapEff:")?.trim(), 16).ok())
        .unwrap_or(0);
    if limits.is_empty() {
        return vec![Finding::unknown("rights", format!("/{process}/limits cannot be read"))];
    }
    vec![
        priority(s.priority, soft_limit(&limits, "Max realtime priority"), capabilities, &who),
        memory(soft_limit(&limits, "Max locked memory"), capabilities, &who),
    ]
}

fn priority(wanted: u8, limit: Option<u64>, capabilities: u64, who: &str) -> Finding {
    const NAME: &str = "real-time priority";
    if capabilities & SYS_NICE != 0 {
        return Finding::ok(NAME, format!("{who} has CAP_SYS_NICE"));
    }
    match limit {
        Some(limit) if limit >= u64::from(wanted) => {
            Finding::ok(NAME, format!("{who} may use {limit}; the cycle wants {wanted}"))
        }
        Some(limit) => {
            let what =
                format!("{who} may use {limit}; the cycle wants {wanted}, and the streamer will not start");
            Finding::problem(NAME, what, REMEDY)
        }
        None => Finding::unknown(NAME, "RLIMIT_RTPRIO is not readable"),
    }
}

fn memory(limit: Option<u64>, capabilities: u64, who: &str) -> Finding {
    const NAME: &str = "memory lock";
    if capabilities & IPC_LOCK != 0 {
        return Finding::ok(NAME, format!("{who} has CAP_IPC_LOCK"));
    }
    match limit {
        Some(u64::MAX) => Finding::ok(NAME, format!("{who} may lock all its memory")),
        Some(bytes) => {
            let what = format!("{who} may lock {bytes} bytes only, and the streamer will not start");
            Finding::problem(NAME, what, REMEDY)
        }
        None => Finding::unknown(NAME, "RLIMIT_MEMLOCK is not readable"),
    }
}

/// "Max locked memory   8388608   8388608   bytes": the first number; unlimited is the largest.
fn soft_limit(limits: &str, name: &str) -> Option<u64> {
    let rest = limits.lines().find_map(|line| line.strip_prefix(name))?;
    match rest.split_whitespace().next()? {
        "unlimited" => Some(u64::MAX),
        number => number.parse().ok(),
    }
}
