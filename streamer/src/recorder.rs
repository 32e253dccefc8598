//! The cycle log: one JSON object a line, written by its own thread.
//!
//! Numbers are written so that reading gives the same bits, so a checker can sample the logged trajectory at the
//! logged time and compare with what was encoded. Writing never holds the cycle up: what does not fit into the queue
//! is counted, and the count is a line of the log.
#![expect(clippy::disallowed_methods, reason = "this thread is not the real-time one and may sleep")]
use crate::facts::Transition;
use crate::report::{CycleRecord, Record};
use crossbeam_queue::ArrayQueue;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::{self, JoinHandle};
use std::time::Duration;
use taustream_arm::{Settings, TrajectoryFile};
use taustream_motion::JointArray;

/// How often the queue is emptied.
const INTERVAL: Duration = Duration::from_millis(20);
/// Trajectories that were handed to the cycle and may still be accepted.
const CANDIDATES_MAX: usize = 16;

/// A trajectory that the cycle may accept, for the log line of its acceptance.
#[derive(Debug)]
pub struct Candidate {
    /// Its id.
    pub trajectory_id: u64,
    /// Its generation.
    pub generation: u64,
    /// The motion.
    pub file: TrajectoryFile,
}

/// A running recorder.
#[derive(Debug)]
pub struct Recorder {
    thread: JoinHandle<io::Result<()>>,
    stop: Arc<AtomicBool>,
}

impl Recorder {
    /// Opens the log, writes its first line, and starts the thread.
    ///
    /// # Errors
    /// When the file cannot be written, or the thread not started.
    pub fn start(
        path: &Path,
        settings: &Settings,
        records: Arc<ArrayQueue<Record>>,
        candidates: Receiver<Candidate>,
    ) -> io::Result<Self> {
        let mut log = Log {
            out: BufWriter::new(File::create(path)?),
            joints: settings.robot.joints.len(),
            buses: settings.buses.len(),
            candidates: Vec::with_capacity(CANDIDATES_MAX),
        };
        log.line(&json!({
            "event": "start", "format": 1, "robot": settings.robot.name, "digest": settings.robot.digest_hex(),
            "joints": log.joints, "period_us": settings.cycle.period_us,
        }))?;
        log.out.flush()?;
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        let work = move || {
            loop {
                // Read before the queue is emptied: what was pushed before the wish is still written.
                let last = asked.load(Ordering::Acquire);
                log.take(&records, &candidates)?;
                if last {
                    return log.out.flush();
                }
                thread::sleep(INTERVAL);
            }
        };
        let thread = thread::Builder::new().name("recorder".into()).stack_size(1 << 20).spawn(work)?;
        Ok(Self { thread, stop })
    }

    /// Writes what is queued and ends.
    ///
    /// # Errors
    /// When the log could not be written.
    pub fn finish(self) -> io::Result<()> {
        self.stop.store(true, Ordering::Release);
        self.thread.join().unwrap_or_else(|_| Err(io::Error::other("the recorder thread has panicked")))
    }
}

struct Log {
    out: BufWriter<File>,
    joints: usize,
    buses: usize,
    candidates: Vec<Candidate>,
}

impl Log {
    fn take(&mut self, records: &ArrayQueue<Record>, candidates: &Receiver<Candidate>) -> io::Result<()> {
        // Bounded by the queue's length at the start, so that a fast producer cannot keep this from its flush.
        for _ in 0..records.len() {
            let Some(record) = records.pop() else { break };
            // A candidate is sent before its trajectory reaches the cycle, so it is here before its record.
            for candidate in candidates.try_iter().take(CANDIDATES_MAX) {
                if self.candidates.len() == CANDIDATES_MAX {
                    self.candidates.remove(0);
                }
                self.candidates.push(candidate);
            }
            match record {
                Record::Accepted { tick, trajectory_id, start_offset_rad } => {
                    self.accepted(tick, trajectory_id, &start_offset_rad)?;
                }
                Record::Transition(transition) => self.line(&phase_line(&transition))?,
                Record::Cycle(cycle) => self.line(&self.cycle_line(&cycle))?,
                Record::Lost(count) => self.line(&json!({ "event": "lost", "records": count }))?,
            }
        }
        Ok(())
    }

    fn accepted(&mut self, tick: u64, trajectory_id: u64, offset_rad: &JointArray) -> io::Result<()> {
        let found = self.candidates.iter().position(|c| c.trajectory_id == trajectory_id);
        let Some(candidate) = found.map(|at| self.candidates.swap_remove(at)) else {
            return self.line(&json!({
                "event": "trajectory", "tick": tick, "trajectory_id": trajectory_id, "generation": null, "file": null,
                "start_offset_rad": offset_rad.get(..self.joints),
            }));
        };
        let file: Value = serde_json::from_str(&candidate.file.to_json())?;
        self.line(&json!({
            "event": "trajectory", "tick": tick, "trajectory_id": trajectory_id,
            "generation": candidate.generation, "file": file,
            "start_offset_rad": offset_rad.get(..self.joints),
        }))
    }

    fn cycle_line(&self, cycle: &CycleRecord) -> Value {
        json!({
            "event": "cycle", "tick": cycle.tick, "time_ns": cycle.time_ns,
            "sync": cycle.syncs.get(..self.buses), "phase": cycle.phase.word(),
            "trajectory_id": cycle.trajectory_id, "s": cycle.s, "sigma": cycle.sigma,
            "position_rad": cycle.position_rad.get(..self.joints),
            "sent": cycle.sent.get(..self.buses), "lost": cycle.lost.get(..self.buses),
        })
    }

    fn line(&mut self, value: &Value) -> io::Result<()> {
        serde_json::to_writer(&mut self.out, value)?;
        self.out.write_all(b"\n")
    }
}

fn phase_line(t: &Transition) -> Value {
    let reason = t.cause.map_or(t.event.word(), |cause| cause.reason.word());
    json!({
        "event": "phase", "tick": t.tick, "from": t.from.word(), "to": t.to.word(), "reason": reason,
        "joint": t.cause.and_then(|c| c.joint), "value": t.cause.map(|c| c.value),
    })
}
