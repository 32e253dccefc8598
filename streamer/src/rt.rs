//! What makes a thread hard real-time: priority, CPU, locked memory, absolute sleep. All unsafe calls of the streamer.
//!
//! The streamer refuses to move an arm without these rights, unless `--allow-non-realtime` is given: a loop that can be preempted by a
//! browser is no servo loop.
#![expect(unsafe_code, reason = "scheduling and memory locking are system calls without a safe wrapper")]
use crate::cycle::{Core, Next, NoProbe, run_cycle};
use crate::tick::Schedule;
use std::hint::black_box;
use std::io;
use taustream_drivers::Nanos;

/// Stack that the cycle may use without a page fault, bytes.
const STACK_PREFAULT: usize = 128 * 1024;

/// Which right is missing, and how to grant it.
#[derive(Debug, thiserror::Error)]
pub enum RightError {
    /// `SCHED_FIFO` was refused.
    #[error(
        "no right to SCHED_FIFO priority {priority}: RLIMIT_RTPRIO is {limit} and CAP_SYS_NICE is missing ({error}); \
         grant it with `setcap cap_sys_nice,cap_ipc_lock+ep taustream-streamer`, with `LimitRTPRIO={priority}` in its \
         systemd unit or `rtprio {priority}` in /etc/security/limits.conf, or start with --allow-non-realtime"
    )]
    Priority {
        /// The priority that was requested.
        priority: u8,
        /// `RLIMIT_RTPRIO`.
        limit: u64,
        /// The kernel's answer.
        error: io::Error,
    },
    /// Memory cannot be locked.
    #[error(
        "no right to lock memory: RLIMIT_MEMLOCK is {limit} bytes and CAP_IPC_LOCK is missing ({error}); grant it with \
         `setcap cap_sys_nice,cap_ipc_lock+ep taustream-streamer`, with `LimitMEMLOCK=infinity` in its systemd unit or \
         `memlock unlimited` in /etc/security/limits.conf, or start with --allow-non-realtime"
    )]
    LastPoses {
        /// `RLIMIT_MEMLOCK`.
        limit: u64,
        /// The kernel's answer.
        error: io::Error,
    },
    /// The thread cannot be bound to the CPU.
    #[error("cannot bind the cycle to CPU {cpu} ({error}); set cycle.cpu to a CPU that this process may use")]
    Cpu {
        /// The CPU that was requested.
        cpu: usize,
        /// The kernel's answer.
        error: io::Error,
    },
}

/// `CLOCK_MONOTONIC`.
///
/// Real time: one call, by the vDSO where there is one.
#[must_use]
pub fn now() -> Nanos {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is a valid timespec for the kernel to fill; CLOCK_MONOTONIC always exists.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut time) };
    let part = |value: i64| u64::try_from(value).unwrap_or(0);
    Nanos(part(time.tv_sec) * 1_000_000_000 + part(time.tv_nsec))
}

/// Sleeps until an instant of `CLOCK_MONOTONIC`; returns at once when it has passed.
///
/// Real time: one call; a signal only makes it begin again.
pub fn sleep_until(deadline: Nanos) {
    let part = |value: u64| i64::try_from(value).unwrap_or(i64::MAX);
    let time = libc::timespec {
        tv_sec: part(deadline.0 / 1_000_000_000),
        tv_nsec: part(deadline.0 % 1_000_000_000),
    };
    // Signals are blocked on this thread, so the bound is never met; it is there because every loop has one.
    for _ in 0..16 {
        // SAFETY: `time` is a valid timespec; no remainder is requested.
        let answer = unsafe {
            libc::clock_nanosleep(
                libc::CLOCK_MONOTONIC,
                libc::TIMER_ABSTIME,
                &raw const time,
                std::ptr::null_mut(),
            )
        };
        if answer != libc::EINTR {
            return;
        }
    }
}

/// Keeps all memory of the process, present and future, from being paged out.
///
/// # Errors
/// When the right is missing.
pub fn lock_memory() -> Result<(), RightError> {
    // SAFETY: takes flags only.
    if unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    Err(RightError::LastPoses { limit: soft_limit(libc::RLIMIT_MEMLOCK), error })
}

/// Gives the calling thread its priority, CPU, exact timers and a stack that is there. Signals go to other threads.
///
/// # Errors
/// Every right that is missing; the rest is done all the same.
pub fn enter(priority: u8, cpu: Option<usize>) -> Result<(), Vec<RightError>> {
    let mut missing = Vec::new();
    block_signals();
    prefault_stack();
    // SAFETY: sets a number of the calling thread; one nanosecond is the smallest slack.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64, 0_u64, 0_u64, 0_u64) };
    if let Some(Err(error)) = cpu.map(bind) {
        missing.push(error);
    }
    let parameters = libc::sched_param { sched_priority: i32::from(priority) };
    // SAFETY: `parameters` is a valid sched_param; 0 is the calling thread.
    if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } != 0 {
        let error = io::Error::last_os_error();
        missing.push(RightError::Priority { priority, limit: soft_limit(libc::RLIMIT_RTPRIO), error });
    }
    if missing.is_empty() { Ok(()) } else { Err(missing) }
}

/// A warning when the kernel may take the CPU away from real-time threads.
#[must_use]
pub fn throttling_warning() -> Option<String> {
    let path = "/proc/sys/kernel/sched_rt_runtime_us";
    let text = std::fs::read_to_string(path).ok()?;
    let runtime = text.trim();
    (runtime != "-1").then(|| {
        format!(
            "{path} is {runtime}: the kernel stops real-time threads that use more than that of a second; \
             `sysctl kernel.sched_rt_runtime_us=-1` ends it"
        )
    })
}

/// Runs cycles on their deadlines until one of them is the last.
///
/// Real time: sleep, clock and the cycle.
pub fn run(core: &mut Core, period_us: u32) -> Next {
    let mut schedule = Schedule::starting_after(now(), period_us);
    let mut last_cycle_ns = 0;
    loop {
        sleep_until(schedule.deadline());
        let wake_time = now();
        let mut tick = schedule.wake(wake_time);
        tick.last_cycle_ns = last_cycle_ns;
        let next = run_cycle(core, tick, &mut NoProbe);
        last_cycle_ns = now().0.saturating_sub(wake_time.0);
        if next != Next::Go {
            return next;
        }
    }
}

fn bind(cpu: usize) -> Result<(), RightError> {
    let out_of_set = || RightError::Cpu { cpu, error: io::Error::from_raw_os_error(libc::EINVAL) };
    if cpu >= usize::try_from(libc::CPU_SETSIZE).unwrap_or(0) {
        return Err(out_of_set());
    }
    // SAFETY: an all-zero cpu_set_t is the empty set, `cpu` is below its size, and 0 is the calling thread.
    let answer = unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(cpu, &mut set);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &raw const set)
    };
    if answer == 0 { Ok(()) } else { Err(RightError::Cpu { cpu, error: io::Error::last_os_error() }) }
}

fn block_signals() {
    // SAFETY: `set` is filled by sigfillset before it is read; the old mask is not asked for.
    unsafe {
        let mut set: libc::sigset_t = std::mem::zeroed();
        libc::sigfillset(&raw mut set);
        libc::pthread_sigmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut());
    }
}

#[inline(never)]
fn prefault_stack() {
    let pages = [0_u8; STACK_PREFAULT];
    black_box(&pages);
}

fn soft_limit(which: libc::__rlimit_resource_t) -> u64 {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: `limit` is a valid rlimit for the kernel to fill.
    unsafe { libc::getrlimit(which, &raw mut limit) };
    limit.rlim_cur
}
