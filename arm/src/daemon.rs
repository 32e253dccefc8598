//! What a service owes the host that runs it: log lines, readiness, and a watchdog that only progress feeds.
//!
//! systemd's side of it is two datagram protocols, `sd_notify(3)` and the journal's. Where there is no systemd, log
//! lines go to stderr and everything else here does nothing.
use sd_notify::NotifyState;
use std::io::{IsTerminal, stderr};
use std::os::unix::fs::MetadataExt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};
use std::{env, fs, io, thread};
use tracing_journald::{Layer, Priority, PriorityMappings};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, fmt};

/// Stands before the names of fields in the journal: `journalctl TAUSTREAM_GENERATION=7`.
const FIELD_PREFIX: &str = "TAUSTREAM";
/// The watchdog is fed this many times in its period, so that one late feeding is no death.
const FEEDINGS: u32 = 4;

/// Starts the log: to the journal where stderr leads there anyway, with a field for every value, else to stderr.
/// `RUST_LOG` selects what is logged (default: info and above).
pub fn start_log() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    let registry = tracing_subscriber::registry().with(filter);
    // A second call changes nothing: the first log continues.
    let _first_goes_on = if let Some(journal) = journal() {
        registry.with(journal).try_init()
    } else {
        // Colours are for people: a file gets plain lines.
        let lines = fmt::layer().with_writer(stderr).with_ansi(stderr().is_terminal()).with_target(false);
        registry.with(lines).try_init()
    };
}

/// The journal, if it is what stderr is connected to (systemd.exec(5), `$JOURNAL_STREAM`) and takes entries.
fn journal() -> Option<Layer> {
    let named = env::var("JOURNAL_STREAM").ok()?;
    let own = fs::metadata("/proc/self/fd/2").ok()?;
    if !is_stream(&named, own.dev(), own.ino()) {
        return None;
    }
    // Journal priorities as people filter by them: -p notice hides the ordinary.
    let mappings = PriorityMappings {
        info: Priority::Informational,
        debug: Priority::Debug,
        trace: Priority::Debug,
        ..PriorityMappings::new()
    };
    let layer = tracing_journald::layer().ok()?;
    Some(layer.with_field_prefix(Some(FIELD_PREFIX.to_owned())).with_priority_mappings(mappings))
}

/// Whether `$JOURNAL_STREAM` ("device:inode") names this file. A program started by a service inherits the variable,
/// but may have another stderr.
fn is_stream(named: &str, device: u64, inode: u64) -> bool {
    let Some((d, i)) = named.split_once(':') else { return false };
    d.parse() == Ok(device) && i.parse() == Ok(inode)
}

/// The service manager, as far as it supervises this process.
#[derive(Debug)]
pub struct Manager {
    feed_every: Option<Duration>,
    fed: Option<Instant>,
    is_ready: bool,
}

impl Default for Manager {
    fn default() -> Self {
        Self::from_environment()
    }
}

impl Manager {
    /// The manager that has started this process; none, if no manager has.
    #[must_use]
    pub fn from_environment() -> Self {
        let feed_every = sd_notify::watchdog_enabled().map(|period| period / FEEDINGS);
        Self { feed_every, fed: None, is_ready: false }
    }

    /// Says what the process is about, in one line for `systemctl status`.
    pub fn status(&self, line: &str) {
        notify(&[NotifyState::Status(line)]);
    }

    /// The work has got on: says the first time that the process is ready, and feeds the watchdog when it is due.
    pub fn progress(&mut self) {
        if !self.is_ready {
            self.is_ready = true;
            notify(&[NotifyState::Ready]);
        }
        let Some(every) = self.feed_every else { return };
        if self.fed.is_none_or(|fed| fed.elapsed() >= every) {
            self.fed = Some(Instant::now());
            notify(&[NotifyState::Watchdog]);
        }
    }

    /// Says that the process is about to end because it was asked to.
    pub fn stopping() {
        notify(&[NotifyState::Stopping]);
    }
}

/// Without `$NOTIFY_SOCKET` there is no manager to notify. A socket that refuses is mentioned once: the manager will act.
fn notify(states: &[NotifyState<'_>]) {
    static COMPLAINT: Once = Once::new();
    if let Err(error) = sd_notify::notify(states) {
        COMPLAINT.call_once(|| tracing::warn!("cannot notify the service manager: {error}"));
    }
}

/// A promise of work to be back in time, on whose strength a thread of its own feeds the watchdog. For work that may
/// take long by design: it says how long, and when it is not back by then, it hangs.
#[derive(Clone, Debug)]
pub struct Promise {
    since: Instant,
    /// When it runs out, in ms after `since`.
    until_ms: Arc<AtomicU64>,
}

impl Promise {
    /// Says that the process is ready, and feeds its watchdog from now on while promises are kept.
    ///
    /// # Errors
    /// When no thread is to be had.
    pub fn start(mut manager: Manager, first: Duration) -> io::Result<Self> {
        let promise = Self { since: Instant::now(), until_ms: Arc::default() };
        promise.back_within(first);
        manager.progress();
        if let Some(every) = manager.feed_every {
            let seen = promise.clone();
            let work = move || {
                loop {
                    thread::sleep(every);
                    if seen.is_kept() {
                        manager.progress();
                    }
                }
            };
            thread::Builder::new().name("watchdog".into()).spawn(work)?;
        }
        Ok(promise)
    }

    /// Promises to be back, with the next call of this, within a time from now.
    pub fn back_within(&self, time: Duration) {
        let until = self.since.elapsed().saturating_add(time).as_millis();
        self.until_ms.store(u64::try_from(until).unwrap_or(u64::MAX), Ordering::Relaxed);
    }

    fn is_kept(&self) -> bool {
        self.since.elapsed().as_millis() <= u128::from(self.until_ms.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn journal_is_taken_only_when_stderr_is_the_named_stream() {
        assert!(is_stream("8:1234", 8, 1234));
        for other in ["8:1235", "9:1234", "8", "", ":", "8:1234:0", "x:y"] {
            assert!(!is_stream(other, 8, 1234), "{other}");
        }
    }

    #[test]
    fn promise_is_broken_by_time_alone_and_kept_again_after_a_restart() {
        let silent = Manager { feed_every: None, fed: None, is_ready: false };
        let promise = Promise::start(silent, Duration::from_secs(3_600)).unwrap();
        assert!(promise.is_kept());
        promise.back_within(Duration::ZERO);
        thread::sleep(Duration::from_millis(5));
        assert!(!promise.is_kept());
        promise.back_within(Duration::MAX);
        assert!(promise.is_kept());
    }

    #[test]
    fn watchdog_is_fed_by_progress_and_not_more_often_than_is_due() {
        let mut manager =
            Manager { feed_every: Some(Duration::from_secs(3_600)), fed: None, is_ready: false };
        manager.progress();
        let first = manager.fed;
        assert!(manager.is_ready && first.is_some());
        manager.progress();
        assert_eq!(manager.fed, first);
        manager.feed_every = Some(Duration::ZERO);
        manager.progress();
        assert_ne!(manager.fed, first);
    }
}
