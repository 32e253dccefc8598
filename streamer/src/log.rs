//! What the cycle and the threads of commands have to say, as lines of the log.
//!
//! They push plain values into rings that drop and count; the publishing thread words them. A flood of the same line, from
//! a sender that asks again and again, becomes a few lines and a count.
use crate::answer::CommandAnswer;
use crate::cycle_state::{Transition, TripKind};
use crate::names::Names;
use crate::report::Note;
use crate::rt;
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use taustream_arm::text::counted;
use taustream_drivers::Nanos;
use taustream_messages::command::CommandError;
use taustream_messages::{Command, Phase};
use tracing::{error, info, warn};

/// Events of commands that may wait to be logged.
const EVENTS: usize = 256;
/// The same line is written once in this time, s.
const SAME_LINE_S: f64 = 1.0;
/// Lines of one kind that are distinguished; beyond them, all of the kind are counted together.
const LINES_MAX: usize = 64;

/// Something that became of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CommandEvent {
    /// A command was requested.
    PendingCommand {
        /// Which.
        command: Command,
        /// By the socket, not by shared memory.
        socket: bool,
    },
    /// The cycle has answered.
    Answered(CommandAnswer),
    /// A request was no command.
    Malformed(CommandError),
    /// Shared memory refuses to hand commands out.
    PortFailed,
    /// Another user's process was turned away from the socket.
    Stranger {
        /// Its user.
        uid: u32,
        /// Its process.
        pid: i32,
    },
    /// Another user has taken the socket's abstract name.
    NameTaken {
        /// That user.
        uid: u32,
        /// The process.
        pid: i32,
    },
}

/// The writing end of a ring of events. Never waits; counts what finds it full.
#[derive(Debug)]
pub struct EventWriter {
    ring: Producer<CommandEvent>,
    dropped: Arc<AtomicU64>,
}

impl EventWriter {
    /// Pushes an event, or counts it as dropped.
    pub fn push(&mut self, event: CommandEvent) {
        if self.ring.push(event).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The reading end.
#[derive(Debug)]
pub struct EventReader {
    ring: Consumer<CommandEvent>,
    dropped: Arc<AtomicU64>,
}

/// Makes both ends.
#[must_use]
pub fn events() -> (EventWriter, EventReader) {
    let (writer, reader) = RingBuffer::new(EVENTS);
    let dropped = Arc::new(AtomicU64::new(0));
    (EventWriter { ring: writer, dropped: Arc::clone(&dropped) }, EventReader { ring: reader, dropped })
}

/// Words events of commands.
#[derive(Debug)]
pub struct CommandLog {
    readers: Vec<EventReader>,
    names: Names,
    seen: SameLines,
}

impl CommandLog {
    /// A log of the events of some threads.
    #[must_use]
    pub fn new(readers: Vec<EventReader>, names: Names) -> Self {
        Self { readers, names, seen: SameLines::default() }
    }

    /// Writes what has come.
    pub fn write(&mut self) {
        let now = rt::now();
        for at in 0..self.readers.len() {
            let Some(reader) = self.readers.get_mut(at) else { return };
            let dropped = reader.dropped.swap(0, Ordering::Relaxed);
            if dropped > 0 {
                warn!(
                    "{dropped} events of commands were dropped: they came faster than they could be logged"
                );
            }
            for _ in 0..EVENTS {
                let Some(Ok(event)) = self.readers.get_mut(at).map(|reader| reader.ring.pop()) else { break };
                self.write_event(event, now);
            }
        }
    }

    fn write_event(&mut self, event: CommandEvent, now: Nanos) {
        let (is_warning, line) = match event {
            CommandEvent::PendingCommand { command, socket: false } => (false, format!("asked: {command:?}")),
            CommandEvent::PendingCommand { command, socket: true } => {
                (true, format!("asked by the streamer's own socket: {command:?}"))
            }
            CommandEvent::Answered(answer) => {
                let what = if answer.accepted { "accepted" } else { "refused" };
                let (phase, why) = (answer.phase.word(), answer.why.sentence(&self.names));
                (false, format!("{what} while {phase}: {why}"))
            }
            CommandEvent::Malformed(e) => (true, format!("a request that is no command was refused: {e}")),
            CommandEvent::PortFailed => (true, "cannot take commands out of shared memory".to_owned()),
            CommandEvent::Stranger { uid, pid } => (
                true,
                format!(
                    "process {pid} of uid {uid} was turned away from the streamer's own socket: it serves its own user and root"
                ),
            ),
            CommandEvent::NameTaken { uid, pid } => (
                true,
                format!(
                    "process {pid} of uid {uid} has taken the abstract name of the streamer's own socket; end it (`stop` works by the \
                     socket in the runtime directory meanwhile)"
                ),
            ),
        };
        let Some(line) = self.seen.take(line, now) else { return };
        if let CommandEvent::Answered(answer) = event {
            info!(accepted = answer.accepted, "{line}");
        } else if is_warning {
            warn!("{line}");
        } else {
            info!("{line}");
        }
    }
}

/// Lines that come again and again.
#[derive(Debug, Default)]
pub struct SameLines(BTreeMap<String, (Nanos, u64)>);

impl SameLines {
    /// The line to write now: with a count of those that were left out since the last one; `None` within a second of it.
    pub fn take(&mut self, line: String, now: Nanos) -> Option<String> {
        if self.0.len() >= LINES_MAX && !self.0.contains_key(&line) {
            self.0.retain(|_, (at, _)| now.since_s(*at) < SAME_LINE_S);
        }
        let key = if self.0.len() >= LINES_MAX && !self.0.contains_key(&line) {
            String::new()
        } else {
            line.clone()
        };
        match self.0.get_mut(&key) {
            Some((at, left_out)) if now.since_s(*at) < SAME_LINE_S => {
                *left_out += 1;
                None
            }
            Some((at, left_out)) => {
                let again = std::mem::take(left_out);
                *at = now;
                Some(if again > 0 { format!("{line} ({again} more since the last such line)") } else { line })
            }
            None => {
                self.0.insert(key, (now, 0));
                Some(line)
            }
        }
    }
}

/// Writes a note.
pub fn note(note: &Note, names: &Names) {
    match note {
        Note::Transition(transition) => write_transition(transition, names),
        Note::Trip { trip, sweep_rad } => {
            let joint = names.joint(trip.joint);
            let what = match trip.kind {
                TripKind::NotFinite => "is not a finite number".to_owned(),
                TripKind::Limit(quantity) => format!("breaks its {quantity:?} limit"),
                TripKind::Inconsistent(quantity) => {
                    format!("has a {quantity:?} that its positions do not show")
                }
                TripKind::CannotStop => "cannot stop before its position limit".to_owned(),
            };
            let (value, limit) = (trip.value, trip.limit);
            error!(
                "guard: setpoint of {joint} {what} ({value} against {limit}); all joints brake over {sweep_rad:?} rad"
            );
        }
        Note::BusError { bus, error, count } => warn!(
            "{}: {} ({} since the last such line); {}",
            names.bus(*bus),
            error.sentence(),
            counted(*count, "error frame"),
            error.remedy()
        ),
        Note::BusFailed { bus, bus_fault } => error!(
            "{}: {}; nothing is sent on it until `clear-fault`; {}",
            names.bus(*bus),
            bus_fault.word(),
            names.bus_remedy(*bus, *bus_fault)
        ),
        Note::FixedPdos { joint, pdos } if pdos.words().is_empty() => {
            info!("the drive of {} has no PDO any more that stays on unused", names.joint(*joint));
        }
        Note::FixedPdos { joint, pdos } => info!(
            "the drive of {} does not let {} be switched off, which this master does not use; under its own identifiers it does no \
             harm, but what it sends there is not in the bus load of `check`",
            names.joint(*joint),
            pdos.words()
        ),
        Note::Emergency { joint, code, count } => warn!(
            "emergency message of the {} ({count} since the last such line)",
            names.drive_error(*joint, *code)
        ),
        Note::Stall { gap_s, goes_on: false } => {
            warn!(
                "no setpoint was sent for {gap_s:.4} s: the drives stopped at the last one, which may exceed the stop \
                 limits; trajectory time does not advance until they are at rest"
            );
        }
        Note::Stall { gap_s, goes_on: true } => {
            warn!("no setpoint was sent for {gap_s:.4} s: the motion goes on in time (after_stall)");
        }
    }
}

fn write_transition(t: &Transition, names: &Names) {
    let (from, to, tick) = (t.from.word(), t.to.word(), t.tick);
    if let (Phase::Fault | Phase::FastStopping | Phase::Braking, Some(cause)) = (t.to, t.cause) {
        error!(tick, "{from} -> {to}: {}", names.fault(&cause));
    } else {
        info!(tick, "{from} -> {to}: {}", t.event.word());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: u64, ms: u64) -> Nanos {
        Nanos((seconds * 1_000 + ms) * 1_000_000)
    }

    /// Goal: 233 requests in 10 s, as a command line that waits sends them, are a dozen lines; none is lost from the count.
    #[test]
    fn lines_of_a_flood_are_written_once_a_second_with_a_count() {
        let mut seen = SameLines::default();
        let written: Vec<String> = (0..233)
            .filter_map(|n| {
                seen.take("refused while configuring".to_owned(), at(n * 43 / 1_000, n * 43 % 1_000))
            })
            .collect();
        assert!((8..=12).contains(&written.len()), "{written:?}");
        let more = |line: &String| line.split('(').nth(1)?.split(' ').next()?.parse::<usize>().ok();
        let counted: usize = written.iter().filter_map(more).sum();
        assert!(written.len() + counted > 200, "{written:?}");
        assert_eq!(seen.take("something else".to_owned(), at(10, 20)), Some("something else".to_owned()));
    }

    #[test]
    fn lines_that_all_differ_are_bounded_too() {
        let mut seen = SameLines::default();
        let written = (0..10_000).filter_map(|n| seen.take(format!("line {n}"), at(1, 0))).count();
        assert!(written <= LINES_MAX + 1, "{written}");
    }

    #[test]
    fn events_that_find_the_ring_full_are_counted_and_never_waited_for() {
        let (mut writer, reader) = events();
        for _ in 0..EVENTS + 50 {
            writer.push(CommandEvent::PendingCommand { command: Command::Stop, socket: false });
        }
        assert_eq!(reader.dropped.load(Ordering::Relaxed), 50);
    }
}
