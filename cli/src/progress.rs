//! A line on the terminal for work that takes longer than half a second.
use crate::output::{Form, note};
use std::io::{IsTerminal, stderr};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Work that is over before this is not worth a word.
const AFTER: Duration = Duration::from_millis(500);
/// How often the time is said then.
const EVERY: Duration = Duration::from_secs(1);

/// Does work, and says on a terminal how long it has taken.
pub(crate) fn while_it_takes<T>(form: Form, what: &str, work: impl FnOnce() -> T) -> T {
    if form == Form::Json || !stderr().is_terminal() {
        return work();
    }
    let begun = Instant::now();
    thread::scope(|scope| {
        // Dropped at the end of the work, however it ends.
        let (working, ended) = channel::<()>();
        scope.spawn(move || {
            let mut wait = AFTER;
            while ended.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                note(format_args!("{what} .. {:.1} s", begun.elapsed().as_secs_f64()));
                wait = EVERY;
            }
        });
        let done = work();
        drop(working);
        done
    })
}

/// The same for a wait that looks around again and again.
pub(crate) struct Waiting {
    begun: Instant,
    said: Option<Instant>,
}

impl Waiting {
    /// Begins to wait.
    pub(crate) fn begin() -> Self {
        Self { begun: Instant::now(), said: None }
    }

    /// Says how long it has taken, when that is due.
    pub(crate) fn say(&mut self, form: Form, what: &str) {
        let due = match self.said {
            None => self.begun.elapsed() >= AFTER,
            Some(said) => said.elapsed() >= EVERY,
        };
        if due {
            self.said = Some(Instant::now());
            form.progress(format_args!("{what} .. {:.1} s", self.begun.elapsed().as_secs_f64()));
        }
    }
}
