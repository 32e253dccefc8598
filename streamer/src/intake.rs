//! The queues between the other threads and the cycle: trajectories in, commands in, answers out.
//!
//! Trajectories travel in boxes that are made at start and go round: empty from the cycle to the service thread,
//! filled back. So nothing is allocated or freed on the real-time thread, and a sender that floods finds no box.
//!
//! Every queue has one writer and one reader, and both ends of it are wait-free: a thread that is preempted in the
//! middle of an operation never makes the cycle spin.
use crate::answer::CommandAnswer;
use crate::buses::Links;
use crate::cycle_state::{COMMANDS_MAX, CycleState, PendingCommand, Restored, TrajectoryResult};
use crate::prepared::PreparedTrajectory;
use rtrb::{Consumer, Producer, PushError, RingBuffer};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use taustream_drivers::Nanos;
use taustream_messages::{CheckedTrajectory, Command, Replaces};
use taustream_motion::{JointLimits, MAX_JOINTS, Trajectory};

/// Boxes in circulation: one runs, one waits for its cut, one is on its way to the cycle, two are being checked or answered.
const BOXES: usize = 5;
/// Decisions that wait to be read: of every box, and of its next filling before the reader has come round.
const VERDICTS: usize = 2 * BOXES;
/// Commands that may be on their way at one time.
pub const COMMANDS_PENDING_MAX: usize = 16;

/// Sources of commands: shared memory, and the operator's socket. Each has queues of its own.
const COMMAND_PORTS: usize = 2;

/// The answers of one cycle: to its commands, and to those of before that waited for a bus or for a record on the disk.
pub type Answers = [Option<CommandAnswer>; COMMANDS_MAX + 2];

/// A trajectory in its box.
pub type Boxed = Box<PreparedTrajectory>;

/// How the streamer is asked to end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shutdown {
    /// Not at all.
    #[default]
    No,
    /// Stop on the path, hold, de-energise, end.
    Orderly,
    /// Torque off and end: the arm may fall.
    AtOnce,
}

/// Links of failed buses, on their way to be restarted or back. One at a time is on its way.
pub struct Handover {
    /// The `clear-fault` that asked for it.
    pub sequence: u64,
    /// The links; none of the buses that are well.
    pub links: Links,
    /// On the way back: every one of them was restarted.
    pub recovered: bool,
}

impl std::fmt::Debug for Handover {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Handover")
            .field("sequence", &self.sequence)
            .field("well", &self.recovered)
            .finish_non_exhaustive()
    }
}

/// The cycle's end of the queues.
#[derive(Debug)]
pub struct Intake {
    shutdown: Arc<AtomicU8>,
    failed_links: Producer<Handover>,
    restored_links: Consumer<Handover>,
    empty: Producer<Boxed>,
    filled: Consumer<Boxed>,
    trajectory_results: Producer<TrajectoryResult>,
    sources: [Source; COMMAND_PORTS],
}

/// One source of commands, at the cycle.
#[derive(Debug)]
struct Source {
    pending: Consumer<PendingCommand>,
    answers: Producer<CommandAnswer>,
}

/// One source of commands, at the thread that takes them.
#[derive(Debug)]
pub struct CommandPort {
    pending: Producer<PendingCommand>,
    answers: Consumer<CommandAnswer>,
    /// Numbers of different ports differ, so an answer finds its port.
    next_sequence: u64,
}

/// Trajectories and links of buses, at the thread that takes them.
#[derive(Debug)]
pub struct TrajectoryPort {
    failed_links: Consumer<Handover>,
    restored_links: Producer<Handover>,
    empty: Consumer<Boxed>,
    /// Empty boxes that are on this side.
    spare: Vec<Boxed>,
    filled: Producer<Boxed>,
    trajectory_results: Consumer<TrajectoryResult>,
}

/// The other threads' ends of the queues.
#[derive(Debug)]
pub struct CommandQueue {
    /// Commands out of shared memory.
    pub commands: CommandPort,
    /// Commands out of the operator's socket.
    pub socket: CommandPort,
    /// Trajectories.
    pub trajectories: TrajectoryPort,
    shutdown: Arc<AtomicU8>,
}

/// Makes both ends, with all boxes at the threads'.
#[must_use]
pub fn pair() -> (Intake, CommandQueue) {
    let shutdown = Arc::new(AtomicU8::new(0));
    let (failed_out, failed_in) = RingBuffer::new(1);
    let (restored_out, restored_in) = RingBuffer::new(1);
    let (empty_out, empty_in) = RingBuffer::new(BOXES);
    let (filled_out, filled_in) = RingBuffer::new(BOXES);
    let (verdicts_out, verdicts_in) = RingBuffer::new(VERDICTS);
    let (commands_in, commands) = command_port(0);
    let (socket_in, socket) = command_port(1);
    let intake = Intake {
        shutdown: Arc::clone(&shutdown),
        failed_links: failed_out,
        restored_links: restored_in,
        empty: empty_out,
        filled: filled_in,
        trajectory_results: verdicts_out,
        sources: [commands_in, socket_in],
    };
    let trajectories = TrajectoryPort {
        failed_links: failed_in,
        restored_links: restored_out,
        empty: empty_in,
        spare: blank_boxes(),
        filled: filled_out,
        trajectory_results: verdicts_in,
    };
    (intake, CommandQueue { commands, socket, trajectories, shutdown })
}

fn command_port(first_sequence: u64) -> (Source, CommandPort) {
    let (asked_out, pending) = RingBuffer::new(COMMANDS_PENDING_MAX);
    let (answers, answers_in) = RingBuffer::new(2 * COMMANDS_PENDING_MAX);
    let port = CommandPort { pending: asked_out, answers: answers_in, next_sequence: first_sequence };
    (Source { pending, answers }, port)
}

fn blank_boxes() -> Vec<Boxed> {
    let mut boxes = Vec::with_capacity(BOXES);
    // One joint and no stroke: a trajectory that the checks of `Trajectory` always let pass.
    while let (true, Ok(trajectory)) = (boxes.len() < BOXES, Trajectory::new(1, [0.0; MAX_JOINTS], &[])) {
        let blank = CheckedTrajectory {
            trajectory_id: 0,
            generation: 0,
            robot_digest: [0; 32],
            replaces: Replaces::Rest,
            trajectory,
        };
        boxes.push(Box::new(PreparedTrajectory::new(blank, &[JointLimits::default(); MAX_JOINTS])));
    }
    boxes
}

impl Intake {
    /// Takes this cycle's commands, and one trajectory if one waits.
    ///
    /// Real time: at most [`COMMANDS_MAX`] commands and one trajectory; no allocation.
    pub fn subscribe(&mut self, cycle_state: &mut CycleState) -> Option<Boxed> {
        for slot in cycle_state.commands.iter_mut().take(COMMANDS_MAX) {
            // The socket first: only stops come that way.
            *slot = self.sources.iter_mut().rev().find_map(|source| source.pending.pop().ok());
        }
        self.filled.pop().ok()
    }

    /// Hands a box back that the track does not need any more.
    ///
    /// Real time: no allocation; never frees (there is room for every box that exists).
    pub fn recycle(&mut self, spare: Option<Boxed>) {
        if let Some(Err(PushError::Full(stranger))) = spare.map(|b| self.empty.push(b)) {
            Box::leak(stranger);
        }
    }

    /// Hands links out to be restarted; gives them back when others are still on their way.
    ///
    /// Real time: moves pointers.
    pub fn hand_out(&mut self, links: Handover) -> Option<Handover> {
        self.failed_links.push(links).err().map(|PushError::Full(links)| links)
    }

    /// Takes links that come back.
    ///
    /// Real time: moves pointers.
    pub fn reclaim(&mut self, cycle_state: &mut CycleState) -> Option<Handover> {
        let back = self.restored_links.pop().ok()?;
        cycle_state.restored = Some(Restored { sequence: back.sequence, recovered: back.recovered });
        Some(back)
    }

    /// How the streamer is asked to end.
    ///
    /// Real time: one atomic load.
    #[must_use]
    pub fn shutdown(&self) -> Shutdown {
        match self.shutdown.load(Ordering::Relaxed) {
            0 => Shutdown::No,
            1 => Shutdown::Orderly,
            _ => Shutdown::AtOnce,
        }
    }

    /// Answers the trajectory and the commands of a cycle. Every box and every command has room for its answer.
    ///
    /// Real time: no allocation.
    pub fn answer(&mut self, trajectory_result: Option<TrajectoryResult>, answers: &Answers) {
        if let Some(trajectory_result) = trajectory_result {
            let _room_for_every_box = self.trajectory_results.push(trajectory_result);
        }
        for answer in answers.iter().flatten() {
            let port = answer.sequence % self.sources.len() as u64;
            let source = usize::try_from(port).ok().and_then(|port| self.sources.get_mut(port));
            let _room_for_every_command = source.map(|source| source.answers.push(*answer));
        }
    }
}

impl CommandPort {
    /// Asks the cycle for a command that is not carried out after `valid_until`; returns the number under which it is
    /// answered. `None`: too many commands are on their way.
    #[must_use]
    pub fn ask(&mut self, command: Command, valid_until: Nanos) -> Option<u64> {
        let sequence = self.next_sequence;
        self.pending.push(PendingCommand { sequence, command, valid_until }).ok()?;
        self.next_sequence += COMMAND_PORTS as u64;
        Some(sequence)
    }

    /// The next answer to a command.
    #[must_use]
    pub fn answer(&mut self) -> Option<CommandAnswer> {
        self.answers.pop().ok()
    }
}

impl TrajectoryPort {
    /// An empty box to fill, if one is free.
    #[must_use]
    pub fn empty_box(&mut self) -> Option<Boxed> {
        self.spare.pop().or_else(|| self.empty.pop().ok())
    }

    /// Hands a filled box to the cycle, or puts one back that was not used.
    pub fn offer(&mut self, filled: Boxed) {
        // A box came out of `empty`, so there is room in `filled` for it.
        if let Err(PushError::Full(refused)) = self.filled.push(filled) {
            self.return_unused(refused);
        }
    }

    /// Puts an unused box back.
    pub fn return_unused(&mut self, unused: Boxed) {
        self.spare.push(unused);
    }

    /// Links that are to be restarted.
    #[must_use]
    pub fn failed_links(&mut self) -> Option<Handover> {
        self.failed_links.pop().ok()
    }

    /// Gives links back to the cycle.
    pub fn return_links(&mut self, links: Handover) {
        // One handover is on its way at a time, so there is room.
        drop(self.restored_links.push(links));
    }

    /// The next answer to a trajectory.
    #[must_use]
    pub fn trajectory_result(&mut self) -> Option<TrajectoryResult> {
        self.trajectory_results.pop().ok()
    }
}

impl CommandQueue {
    /// A handle by which another thread asks the cycle to end.
    #[must_use]
    pub fn shutdown_handle(&self) -> ShutdownHandle {
        ShutdownHandle(Arc::clone(&self.shutdown))
    }
}

/// Asks the cycle to end.
#[derive(Clone, Debug)]
pub struct ShutdownHandle(Arc<AtomicU8>);

impl ShutdownHandle {
    /// Requests; a stronger request replaces a weaker one.
    pub fn request(&self, shutdown: Shutdown) {
        let level = match shutdown {
            Shutdown::No => 0,
            Shutdown::Orderly => 1,
            Shutdown::AtOnce => 2,
        };
        self.0.fetch_max(level, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::AnswerReason;
    use crate::cycle_state::Decision;
    use crate::tick::Tick;
    use taustream_messages::Phase;

    fn cycle_state(number: u64) -> CycleState {
        let now = Nanos(number * 1_000_000);
        CycleState::begin(Tick { number, deadline: now, wake_time: now, skipped: 0, last_cycle_ns: 0 })
    }

    /// Goal: however late the service thread reads, every box comes back, and every trajectory and command that was
    /// taken has room for its answer. Method: a service thread that fills all it can before it reads anything.
    #[test]
    fn queues_never_lose_a_box_a_decision_or_an_answer() {
        let (mut intake, mut command_queue) = pair();
        let (mut offered, mut decided, mut pending, mut answered) = (0, 0, 0, 0);
        for round in 1..200_u64 {
            while let Some(filled) = command_queue.trajectories.empty_box() {
                command_queue.trajectories.offer(filled);
                offered += 1;
            }
            // Commands are held back while too many are unanswered, as the service thread does it.
            let forever = Nanos(u64::MAX);
            while pending - answered < COMMANDS_PENDING_MAX
                && command_queue.commands.ask(Command::Stop, forever).is_some()
                && command_queue.socket.ask(Command::Stop, forever).is_some()
            {
                pending += 2;
            }
            for cycle in 0..=round % 9 {
                let mut cycle_state = cycle_state(round * 10 + cycle);
                let taken = intake.subscribe(&mut cycle_state);
                let decision = Decision::Stale { newest: round };
                let trajectory_result =
                    taken.as_ref().map(|_| TrajectoryResult { trajectory_id: 1, generation: 1, decision });
                intake.recycle(taken);
                let mut answers: Answers = [None; _];
                for (answer, pending) in answers.iter_mut().zip(cycle_state.commands.iter().flatten()) {
                    let (accepted, phase, why) = (true, Phase::Holding, AnswerReason::NothingMoves);
                    *answer = Some(CommandAnswer { sequence: pending.sequence, accepted, phase, why });
                }
                intake.answer(trajectory_result, &answers);
            }
            decided += std::iter::from_fn(|| command_queue.trajectories.trajectory_result()).count();
            for (parity, port) in [(0, &mut command_queue.commands), (1, &mut command_queue.socket)] {
                for answer in std::iter::from_fn(|| port.answer()) {
                    assert_eq!(answer.sequence % 2, parity, "an answer went to the wrong port");
                    answered += 1;
                }
            }
        }
        let mut cycle_state = cycle_state(1_000_000);
        let waiting = std::iter::from_fn(|| intake.subscribe(&mut cycle_state)).count();
        assert_eq!(offered, decided + waiting);
        assert!(
            waiting <= BOXES && pending - answered <= COMMANDS_PENDING_MAX,
            "{waiting} {pending} {answered}"
        );
        assert!(offered > 100 && pending > 100);
    }
}
