//! The log of a service: lines go into a bounded queue, and one thread writes them.
//!
//! Whoever logs never waits for whoever reads: a pipe that nobody empties, a terminal that was halted, or a journal that
//! hangs costs lines, which are counted, and nothing else. The count is written as soon as lines can be written again.
use crate::journal::{self, Journal};
use std::io::{self, IsTerminal, Write, stderr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};
use std::{env, panic, thread};
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, fmt};

/// Lines that may wait to be written.
const LINES: usize = 1024;
/// Longest line that is kept whole, bytes.
const LINE_BYTES_MAX: usize = 16 << 10;
/// How long a process that ends waits for its last lines to be written.
const LAST_LINES_WITHIN: Duration = Duration::from_secs(1);

/// Where the thread of the log writes.
pub trait Sink: Send + 'static {
    /// Writes one line, or one entry of the journal. May take any time.
    ///
    /// # Errors
    /// Whatever the operating system says; the line is lost.
    fn write(&mut self, line: &[u8]) -> io::Result<()>;

    /// A line that says how many were lost.
    fn lost(&self, lines: u64) -> Vec<u8>;
}

/// The writing end of a log: a bounded queue that drops and counts.
#[derive(Clone, Debug)]
pub struct LineQueue {
    lines: SyncSender<Vec<u8>>,
    counts: Arc<Counts>,
}

#[derive(Debug, Default)]
struct Counts {
    lost: AtomicU64,
    taken: AtomicU64,
    written: AtomicU64,
}

impl LineQueue {
    /// Starts the thread that writes into `sink`.
    ///
    /// # Errors
    /// When no thread is to be had.
    pub fn start(sink: impl Sink) -> io::Result<Self> {
        let (lines, queued) = sync_channel(LINES);
        let counts = Arc::new(Counts::default());
        let seen = Arc::clone(&counts);
        let work = move || write_all(sink, &queued, &seen);
        thread::Builder::new().name("log".into()).stack_size(256 << 10).spawn(work)?;
        Ok(Self { lines, counts })
    }

    /// Queues a line, or counts it as lost. Never waits.
    pub fn push(&self, mut line: Vec<u8>) {
        if line.len() > LINE_BYTES_MAX {
            line.truncate(LINE_BYTES_MAX);
            line.push(b'\n');
        }
        self.counts.taken.fetch_add(1, Ordering::Relaxed);
        match self.lines.try_send(line) {
            Ok(()) => {}
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                self.counts.lost.fetch_add(1, Ordering::Relaxed);
                self.counts.written.fetch_add(1, Ordering::Release);
            }
        }
    }

    /// Waits until everything queued was written, `within` at most; false when it was not.
    #[must_use]
    pub fn flush(&self, within: Duration) -> bool {
        let taken = self.counts.taken.load(Ordering::Relaxed);
        let since = Instant::now();
        while self.counts.written.load(Ordering::Acquire) < taken {
            if since.elapsed() >= within {
                return false;
            }
            thread::sleep(Duration::from_millis(1));
        }
        true
    }
}

fn write_all(mut sink: impl Sink, queued: &Receiver<Vec<u8>>, counts: &Counts) {
    for line in queued {
        let lost = counts.lost.swap(0, Ordering::Relaxed);
        let reported = if lost > 0 { sink.write(&sink.lost(lost)) } else { Ok(()) };
        if reported.and_then(|()| sink.write(&line)).is_err() {
            // A sink that refuses gets no line about it: the next one that is taken carries the count.
            counts.lost.fetch_add(lost + 1, Ordering::Relaxed);
        }
        counts.written.fetch_add(1, Ordering::Release);
    }
}

/// Standard error.
struct Stderr;

impl Sink for Stderr {
    fn write(&mut self, line: &[u8]) -> io::Result<()> {
        stderr().write_all(line)
    }

    fn lost(&self, lines: u64) -> Vec<u8> {
        format!("WARN the log was not read: {lines} lines were dropped\n").into_bytes()
    }
}

/// One line on its way into the queue.
#[derive(Debug)]
pub struct LineWriter<'q> {
    queue: &'q LineQueue,
    line: Vec<u8>,
}

impl Write for LineWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.line.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for LineWriter<'_> {
    fn drop(&mut self) {
        if !self.line.is_empty() {
            self.queue.push(std::mem::take(&mut self.line));
        }
    }
}

impl<'q> MakeWriter<'q> for LineQueue {
    type Writer = LineWriter<'q>;

    fn make_writer(&'q self) -> LineWriter<'q> {
        LineWriter { queue: self, line: Vec::with_capacity(160) }
    }
}

/// The log of this process; its last lines are written when this is dropped.
#[derive(Debug)]
pub struct Log(Option<LineQueue>);

impl Drop for Log {
    fn drop(&mut self) {
        if let Some(queue) = &self.0 {
            let _nobody_reads = queue.flush(LAST_LINES_WITHIN);
        }
    }
}

/// Starts the log: to the journal where stderr leads there anyway, with a field for every value, else to stderr.
/// `RUST_LOG` chooses what is logged (default: info and above). Panics of any thread go the same way: the standard
/// library's own message would wait for the reader of stderr.
#[must_use]
pub fn start_log() -> Log {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    let registry = tracing_subscriber::registry().with(filter);
    let named = env::var("JOURNAL_STREAM").ok().and_then(|stream| Journal::behind_stderr(&stream));
    // A second call changes nothing: the first log continues.
    let queue = match named {
        Some(journal) => LineQueue::start(journal).inspect(|queue| {
            let _first_goes_on = registry.with(journal::JournalLayer::new(queue.clone())).try_init();
        }),
        None => LineQueue::start(Stderr).inspect(|queue| {
            // Colours are for people: a file gets plain lines.
            let lines = fmt::layer().with_ansi(stderr().is_terminal()).with_target(false);
            let _first_goes_on = registry.with(lines.with_writer(queue.clone())).try_init();
        }),
    };
    panic::set_hook(Box::new(|panic| {
        let thread = thread::current();
        tracing::error!("thread {} has panicked: {panic}", thread.name().unwrap_or("without name"));
    }));
    Log(queue.ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::sync::mpsc::{Sender, channel};

    /// Takes a line for every permission that it is given.
    struct Halted {
        permissions: Receiver<()>,
        lines: Arc<Mutex<Vec<String>>>,
    }

    impl Sink for Halted {
        fn write(&mut self, line: &[u8]) -> io::Result<()> {
            self.permissions.recv().map_err(io::Error::other)?;
            self.lines.lock().unwrap().push(String::from_utf8_lossy(line).into_owned());
            Ok(())
        }

        fn lost(&self, lines: u64) -> Vec<u8> {
            format!("lost {lines}").into_bytes()
        }
    }

    fn halted() -> (LineQueue, Sender<()>, Arc<Mutex<Vec<String>>>) {
        let (permit, permissions) = channel();
        let lines = Arc::new(Mutex::new(Vec::new()));
        let queue = LineQueue::start(Halted { permissions, lines: Arc::clone(&lines) }).unwrap();
        (queue, permit, lines)
    }

    /// Goal: a writer never waits for a reader. Method: ten times the queue while nothing is taken; a queue that waited
    /// would never return here.
    #[test]
    fn log_that_nobody_reads_drops_and_counts_and_says_so_when_it_is_read_again() {
        let (queue, permit, lines) = halted();
        let pushed = 10 * LINES;
        for line in 0..pushed {
            queue.push(format!("{line}").into_bytes());
        }
        assert!(!queue.flush(Duration::from_millis(20)), "nothing was read");
        for _ in 0..pushed {
            permit.send(()).unwrap();
        }
        assert!(queue.flush(Duration::from_secs(60)));
        let lines = lines.lock().unwrap();
        let lost: usize =
            lines.iter().filter_map(|line| line.strip_prefix("lost ")?.parse::<usize>().ok()).sum();
        let kept = lines.iter().filter(|line| !line.starts_with("lost")).count();
        assert_eq!(lost + kept, pushed, "every line is written or counted");
        assert!(kept >= LINES && lost > 0, "{kept} {lost}");
    }

    #[test]
    fn log_keeps_the_order_of_lines_and_cuts_endless_ones() {
        let (queue, permit, lines) = halted();
        for line in [vec![b'a'; 3 * LINE_BYTES_MAX], b"second".to_vec()] {
            queue.push(line);
            permit.send(()).unwrap();
        }
        assert!(queue.flush(Duration::from_secs(60)));
        let lines = lines.lock().unwrap();
        assert_eq!((lines[0].len(), lines[1].as_str()), (LINE_BYTES_MAX + 1, "second"));
    }
}
