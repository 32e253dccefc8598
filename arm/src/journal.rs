//! Entries of the systemd journal in its native protocol, with a field for every value.
//!
//! The entry is made where it is logged and sent by the thread of the log: a journal that hangs holds up nobody else. That
//! is why this is not `tracing-journald`, whose layer sends on the thread that logs.
//!
//! Source: systemd, "Native Journal Protocol", <https://systemd.io/JOURNAL_NATIVE_PROTOCOL>.
use crate::log::{LineQueue, Sink};
use std::fmt::{Debug, Write};
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::{env, fs, io};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer};

/// Where the journal takes entries.
const SOCKET: &str = "/run/systemd/journal/socket";
/// Stands before the names of fields: `journalctl TAUSTREAM_GENERATION=7`.
const FIELD_PREFIX: &str = "TAUSTREAM_";
/// Journal priorities as people filter by them: `-p notice` hides the ordinary.
const WARNING: &str = "4";

/// The journal's socket.
#[derive(Debug)]
pub struct Journal {
    socket: UnixDatagram,
    path: PathBuf,
    identifier: String,
}

impl Journal {
    /// The journal that takes entries at a socket.
    ///
    /// # Errors
    /// When nobody serves there.
    pub fn at(path: &Path) -> io::Result<Self> {
        let socket = UnixDatagram::unbound()?;
        // The journal discards an empty entry.
        socket.send_to(&[], path)?;
        Ok(Self { socket, path: path.to_owned(), identifier: identifier() })
    }

    /// The journal, if it is what stderr is connected to (systemd.exec(5), `$JOURNAL_STREAM`) and takes entries.
    pub(crate) fn behind_stderr(stream: &str) -> Option<Self> {
        let own = fs::metadata("/proc/self/fd/2").ok()?;
        is_stream(stream, own.dev(), own.ino()).then(|| Self::at(Path::new(SOCKET)).ok())?
    }
}

impl Sink for Journal {
    fn write(&mut self, entry: &[u8]) -> io::Result<()> {
        self.socket.send_to(entry, &self.path).map(drop)
    }

    fn lost(&self, lines: u64) -> Vec<u8> {
        let mut entry = Vec::new();
        put(&mut entry, "PRIORITY", WARNING);
        put(&mut entry, "SYSLOG_IDENTIFIER", &self.identifier);
        put(&mut entry, "MESSAGE", &format!("the journal did not read: {lines} entries were dropped"));
        entry
    }
}

/// The program's name, as the journal shows it.
fn identifier() -> String {
    let program = env::args_os().next();
    let name = program.as_ref().and_then(|program| Path::new(program).file_name());
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Whether `$JOURNAL_STREAM` ("device:inode") names this file. A program started by a service inherits the variable,
/// but may have another stderr.
fn is_stream(named: &str, device: u64, inode: u64) -> bool {
    let Some((d, i)) = named.split_once(':') else { return false };
    d.parse() == Ok(device) && i.parse() == Ok(inode)
}

/// Makes an entry of every event.
#[derive(Debug)]
pub struct JournalLayer {
    queue: LineQueue,
    identifier: String,
}

impl JournalLayer {
    /// A layer whose entries go into a queue.
    #[must_use]
    pub fn new(queue: LineQueue) -> Self {
        Self { queue, identifier: identifier() }
    }
}

impl<S: Subscriber> Layer<S> for JournalLayer {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let mut entry = Entry(Vec::with_capacity(256));
        let joint_info = event.metadata();
        put(&mut entry.0, "PRIORITY", priority(*joint_info.level()));
        put(&mut entry.0, "SYSLOG_IDENTIFIER", &self.identifier);
        put(&mut entry.0, "TARGET", joint_info.target());
        event.record(&mut entry);
        self.queue.push(entry.0);
    }
}

fn priority(level: Level) -> &'static str {
    match level {
        Level::ERROR => "3",
        Level::WARN => WARNING,
        Level::INFO => "6",
        _ => "7",
    }
}

struct Entry(Vec<u8>);

impl Visit for Entry {
    fn record_str(&mut self, field: &Field, value: &str) {
        put(&mut self.0, &name(field), value);
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let mut text = String::new();
        // Writing into a string does not fail; a Debug that does leaves what it has written.
        let _as_far_as_it_went = write!(text, "{value:?}");
        put(&mut self.0, &name(field), &text);
    }
}

/// Only letters, digits and underscores may stand in the name of a field, capitals at that.
fn name(field: &Field) -> String {
    if field.name() == "message" {
        return "MESSAGE".to_owned();
    }
    let kept = field.name().chars().filter(|c| c.is_ascii_alphanumeric() || *c == '_');
    FIELD_PREFIX.chars().chain(kept.map(|c| c.to_ascii_uppercase())).collect()
}

/// Name, length, value: the form that takes any value.
fn put(entry: &mut Vec<u8>, name: &str, value: &str) {
    entry.extend_from_slice(name.as_bytes());
    entry.push(b'\n');
    entry.extend_from_slice(&(value.len() as u64).to_le_bytes());
    entry.extend_from_slice(value.as_bytes());
    entry.push(b'\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use tracing_subscriber::layer::SubscriberExt;

    struct Scratch(PathBuf);

    impl Scratch {
        fn new(name: &str) -> Self {
            Self(env::temp_dir().join(format!("taustream-journal-{name}-{}", std::process::id())))
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _left_behind = fs::remove_file(&self.0);
        }
    }

    #[test]
    fn journal_is_taken_only_when_stderr_is_the_named_stream() {
        assert!(is_stream("8:1234", 8, 1234));
        for other in ["8:1235", "9:1234", "8", "", ":", "8:1234:0", "x:y"] {
            assert!(!is_stream(other, 8, 1234), "{other}");
        }
    }

    #[test]
    fn journal_gets_an_entry_with_a_field_for_every_value() {
        let scratch = Scratch::new("entry");
        let reader = UnixDatagram::bind(&scratch.0).unwrap();
        let queue = LineQueue::start(Journal::at(&scratch.0).unwrap()).unwrap();
        let subscriber = tracing_subscriber::registry().with(JournalLayer::new(queue.clone()));
        tracing::subscriber::with_default(subscriber, || {
            tracing::warn!(generation = 7_u64, "two\nlines");
        });
        assert!(queue.flush(Duration::from_secs(60)));
        let mut bytes = [0; 4096];
        assert_eq!(reader.recv(&mut bytes).unwrap(), 0, "the empty entry");
        let length = reader.recv(&mut bytes).unwrap();
        let mut expected = Vec::new();
        for (name, value) in [("PRIORITY", "4"), ("SYSLOG_IDENTIFIER", &identifier())] {
            put(&mut expected, name, value);
        }
        put(&mut expected, "TARGET", "taustream_arm::journal::tests");
        let entry = &bytes[..length];
        assert!(entry.starts_with(&expected), "{}", String::from_utf8_lossy(entry));
        let has = |name: &str, value: &str| {
            let mut field = Vec::new();
            put(&mut field, name, value);
            entry.windows(field.len()).any(|piece| piece == field)
        };
        assert!(has("MESSAGE", "two\nlines") && has("TAUSTREAM_GENERATION", "7"));
    }

    /// Goal: a journal that hangs holds up nobody. Method: a socket that is never read; its queue is full after a few
    /// entries, and a sender that waited would never return here.
    #[test]
    fn journal_that_hangs_holds_up_nobody_who_logs() {
        let scratch = Scratch::new("hung");
        let _hung = UnixDatagram::bind(&scratch.0).unwrap();
        let queue = LineQueue::start(Journal::at(&scratch.0).unwrap()).unwrap();
        let subscriber = tracing_subscriber::registry().with(JournalLayer::new(queue.clone()));
        tracing::subscriber::with_default(subscriber, || {
            for line in 0..5_000 {
                tracing::info!(line, "nobody reads this");
            }
        });
        assert!(!queue.flush(Duration::from_millis(20)));
    }
}
