//! The end of a thread, awaited for a bounded time: a disk or a file system that hangs must not keep the process from ending.
#![expect(clippy::disallowed_methods, reason = "the real-time thread has ended when this waits")]
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Longest wait for a thread that writes to a disk.
pub const DISK_WITHIN: Duration = Duration::from_secs(3);
/// Longest wait for any other thread; one of them waits for the thread of the last pose itself.
pub const THREADS_WITHIN: Duration = Duration::from_secs(5);

const POLL: Duration = Duration::from_millis(2);

/// Why a thread gave no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotEnded {
    /// It has panicked.
    Panicked,
    /// It still runs, and ends with the process.
    Running,
}

/// What a thread returned, if it ends within `limit`.
///
/// # Errors
/// Why there is no result.
pub fn join_within<T>(thread: JoinHandle<T>, limit: Duration) -> Result<T, NotEnded> {
    let since = Instant::now();
    while !thread.is_finished() {
        if since.elapsed() >= limit {
            return Err(NotEnded::Running);
        }
        thread::sleep(POLL);
    }
    thread.join().map_err(|_| NotEnded::Panicked)
}
