//! A short time slice for this process and what it starts: who wakes with a shorter slice gets its CPU at once.
#![expect(unsafe_code, reason = "sched_setattr has no safe wrapper")]

/// The shortest slice that the kernel gives.
const SLICE_NS: u64 = 100_000;

/// What `sched_setattr` reads, in its first version (linux/sched/types.h).
#[repr(C)]
struct Attributes {
    size: u32,
    policy: u32,
    flags: u64,
    nice: i32,
    priority: u32,
    runtime: u64,
    deadline: u64,
    period: u64,
}

/// Asks for the shortest time slice at ordinary scheduling. Kernels before 6.12 ignore it, and nothing depends on it.
///
/// The machine's kernel and its processes hand over to each other thousands of times a second. Beside other work each
/// hand-over waited for a whole slice of that work, 3 ms and more.
pub fn shorten() {
    let nice = rustix::process::getpriority_process(None).unwrap_or(0);
    let attributes = Attributes {
        size: 48,
        policy: 0,
        flags: 0,
        nice,
        priority: 0,
        runtime: SLICE_NS,
        deadline: 0,
        period: 0,
    };
    // SAFETY: the kernel reads `size` bytes of `attributes`, which lives and has that size; 0 is this thread.
    let _ignored_where_unknown =
        unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_have_the_size_that_they_state() {
        assert_eq!(size_of::<Attributes>(), 48);
    }
}
