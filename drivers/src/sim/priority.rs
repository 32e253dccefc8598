//! Real-time priority for the simulator's thread: drives answer on time, whatever else the computer does.
#![expect(unsafe_code, reason = "the scheduler is asked by a raw system call")]

/// Priority below that of a streamer (80), so that the drives never delay their master.
const PRIORITY: i32 = 60;

/// Asks for SCHED_FIFO for the calling thread.
///
/// # Errors
/// The operating system's reason, usually a missing `RLIMIT_RTPRIO` or `CAP_SYS_NICE`.
pub fn raise() -> std::io::Result<()> {
    let parameters = libc::sched_param { sched_priority: PRIORITY };
    // SAFETY: 0 names the calling thread, and the pointer is to a live `sched_param` that the call only reads.
    let done = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) };
    if done == 0 { Ok(()) } else { Err(std::io::Error::last_os_error()) }
}
