//! What a service owes the host that runs it: readiness, and a watchdog that only progress feeds.
//!
//! systemd's side of it is `sd_notify(3)`, a datagram protocol. Where there is no systemd, nothing is done here. Messages
//! are sent by a thread of their own, because a service manager that hangs makes their sender wait.
use sd_notify::NotifyState;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};
use std::{env, io, thread};

/// The watchdog is fed this many times in its period, so that one late feeding is no death.
const FEEDINGS: u32 = 4;
/// Notices that may wait to be sent.
const NOTICES: usize = 8;

/// The service manager, as far as it supervises this process.
#[derive(Debug)]
pub struct Manager {
    feed_every: Option<Duration>,
    fed: Option<Instant>,
    is_ready: bool,
    /// To the thread that sends; none without a manager.
    notices: Option<SyncSender<Notice>>,
}

/// Something that the manager should know.
#[derive(Debug)]
enum Notice {
    Ready,
    Progress,
    Status(String),
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
        let has_manager = env::var_os("NOTIFY_SOCKET").is_some_and(|path| !path.is_empty());
        let notices = has_manager.then(start_sender).flatten();
        Self { feed_every, fed: None, is_ready: false, notices }
    }

    /// Says what the process is about, in one line for `systemctl status`.
    pub fn status(&self, line: &str) {
        self.send(Notice::Status(line.to_owned()));
    }

    /// The work has got on: says the first time that the process is ready, and feeds the watchdog when it is due.
    pub fn progress(&mut self) {
        if !self.is_ready {
            self.is_ready = true;
            self.send(Notice::Ready);
        }
        let Some(every) = self.feed_every else { return };
        if self.fed.is_none_or(|fed| fed.elapsed() >= every) {
            self.fed = Some(Instant::now());
            self.send(Notice::Progress);
        }
    }

    /// Never waits: a notice that finds the queue full is dropped, and the next feeding takes its place.
    fn send(&self, notice: Notice) {
        if let Some(notices) = &self.notices {
            let _dropped_when_full = notices.try_send(notice);
        }
    }

    /// Says that the process is about to end because it was asked to. Waits for the manager: not for a thread that others
    /// wait for.
    pub fn stopping() {
        notify(&[NotifyState::Stopping]);
    }
}

fn start_sender() -> Option<SyncSender<Notice>> {
    let (notices, queued) = sync_channel(NOTICES);
    let work = move || send_all(&queued);
    thread::Builder::new().name("manager".into()).stack_size(256 << 10).spawn(work).ok()?;
    Some(notices)
}

fn send_all(queued: &Receiver<Notice>) {
    for notice in queued {
        match &notice {
            Notice::Ready => notify(&[NotifyState::Ready]),
            Notice::Progress => notify(&[NotifyState::Watchdog]),
            Notice::Status(line) => notify(&[NotifyState::Status(line)]),
        }
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
    fn promise_is_broken_by_time_alone_and_kept_again_after_a_restart() {
        let silent = Manager { feed_every: None, fed: None, is_ready: false, notices: None };
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
        let mut manager = Manager {
            feed_every: Some(Duration::from_secs(3_600)),
            fed: None,
            is_ready: false,
            notices: None,
        };
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
