//! The cycle log: one JSON object a line, written by its own thread.
//!
//! Numbers are written so that reading gives the same bits, so a checker can sample the logged trajectory at the
//! logged time and compare with what was encoded. Writing never holds the cycle up: what does not fit into the queue
//! is counted, and the count is a line of the log.
#![expect(clippy::disallowed_methods, reason = "this thread is not the real-time one and may sleep")]
use crate::cycle_state::Transition;
use crate::ending::{DISK_WITHIN, NotEnded, join_within};
use crate::report::{CutRecord, CycleRecord, Record};
use rtrb::Consumer;
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
use taustream_messages::AxisReport;
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
        mut records: Consumer<Record>,
        candidates: Receiver<Candidate>,
    ) -> io::Result<Self> {
        let mut log = Log {
            out: BufWriter::new(File::create(path)?),
            joints: settings.robot.joints.len(),
            axes: settings.axes.iter().map(|axis| axis.name().to_owned()).collect(),
            buses: settings.buses.len(),
            candidates: Vec::with_capacity(CANDIDATES_MAX),
        };
        log.line(&json!({
            "event": "start", "format": 1, "robot": settings.robot.name, "digest": settings.robot.digest_hex(),
            "joints": log.joints, "period_us": settings.cycle.period_us,
        }))?;
        log.out.flush()?;
        let stop = Arc::new(AtomicBool::new(false));
        let pending = Arc::clone(&stop);
        let work = move || {
            loop {
                // Read before the queue is emptied: what was pushed before the request is still written.
                let last = pending.load(Ordering::Acquire);
                log.take(&mut records, &candidates)?;
                if last {
                    return log.out.flush();
                }
                thread::sleep(INTERVAL);
            }
        };
        let thread = thread::Builder::new().name("recorder".into()).stack_size(1 << 20).spawn(work)?;
        Ok(Self { thread, stop })
    }

    /// Writes what is queued and ends, within [`DISK_WITHIN`].
    ///
    /// # Errors
    /// When the log could not be written, or its disk does not answer.
    pub fn finish(self) -> io::Result<()> {
        self.stop.store(true, Ordering::Release);
        join_within(self.thread, DISK_WITHIN).unwrap_or_else(|why| match why {
            NotEnded::Panicked => Err(io::Error::other("the recorder thread has panicked")),
            NotEnded::Running => Err(io::Error::other(format!(
                "a write has not returned within {} s: its disk, or the reader of its pipe, hangs; its end is missing",
                DISK_WITHIN.as_secs()
            ))),
        })
    }
}

struct Log {
    out: BufWriter<File>,
    joints: usize,
    axes: Vec<String>,
    buses: usize,
    candidates: Vec<Candidate>,
}

impl Log {
    fn take(&mut self, records: &mut Consumer<Record>, candidates: &Receiver<Candidate>) -> io::Result<()> {
        // Bounded by the queue's length at the start, so that a fast producer cannot keep this from its flush.
        for _ in 0..records.slots() {
            let Ok(record) = records.pop() else { break };
            // A candidate is sent before its trajectory reaches the cycle, so it is here before its record.
            for candidate in candidates.try_iter().take(CANDIDATES_MAX) {
                if self.candidates.len() == CANDIDATES_MAX {
                    self.candidates.remove(0);
                }
                self.candidates.push(candidate);
            }
            match record {
                Record::Accepted { tick, trajectory_id, start_offset_rad, cut } => {
                    self.accepted((tick, trajectory_id), &start_offset_rad, cut)?;
                }
                Record::Transition(transition) => self.line(&phase_line(&transition))?,
                Record::CycleSettings(cycle) => self.line(&self.cycle_line(&cycle))?,
                Record::Lost(count) => self.line(&json!({ "event": "lost", "records": count }))?,
            }
        }
        Ok(())
    }

    fn accepted(
        &mut self,
        (tick, trajectory_id): (u64, u64),
        offset_rad: &JointArray,
        cut: Option<CutRecord>,
    ) -> io::Result<()> {
        let found = self.candidates.iter().position(|c| c.trajectory_id == trajectory_id);
        let candidate = found.map(|at| self.candidates.swap_remove(at));
        let file: Option<Value> =
            candidate.as_ref().map(|c| serde_json::from_str(&c.file.to_json())).transpose()?;
        let cut = cut
            .map(|cut| json!({ "trajectory_id": cut.trajectory_id, "at_s": cut.at_s, "from_s": cut.from_s }));
        self.line(&json!({
            "event": "trajectory", "tick": tick, "trajectory_id": trajectory_id,
            "generation": candidate.map(|c| c.generation), "file": file,
            "start_offset_rad": offset_rad.get(..self.joints), "cut": cut,
        }))
    }

    fn cycle_line(&self, cycle: &CycleRecord) -> Value {
        json!({
            "event": "cycle", "tick": cycle.tick, "time_ns": cycle.time_ns,
            "sync": cycle.syncs.get(..self.buses), "frames": cycle.frames.get(..self.buses), "phase": cycle.phase.word(),
            "trajectory_id": cycle.trajectory_id, "s": cycle.s, "sigma": cycle.sigma,
            "position_rad": cycle.position_rad.get(..self.joints),
            "off_path_rad": cycle.off_path_rad.get(..self.joints),
            "joint_sent": cycle.joint_sent.get(..self.joints),
            "sent": cycle.sent.get(..self.buses), "lost": cycle.lost.get(..self.buses),
            "axes": self.axes(cycle),
        })
    }

    /// What the axes beside the path do, in their own units.
    fn axes(&self, cycle: &CycleRecord) -> Vec<Value> {
        let slots = cycle.position_rad.iter().zip(&cycle.joint_sent).skip(self.joints);
        let line = |((name, axis), (output_rad, sent)): ((&String, &AxisReport), (&f64, &bool))| {
            json!({
                "name": name, "state": axis.state().word(), "unit": axis.unit(), "output_rad": output_rad,
                "command": axis.command, "target": axis.target, "measured": axis.measured, "force": axis.force,
                "sent": sent,
            })
        };
        self.axes.iter().zip(&cycle.axes).zip(slots).map(line).collect()
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
        "joint": t.cause.and_then(|c| c.joint), "bus": t.cause.and_then(|c| c.bus),
        "code": t.cause.map(|c| c.code), "value": t.cause.map(|c| c.value),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cycle_state::{BUSES_MAX, Cause};
    use crate::phases::Event;
    use std::sync::mpsc::channel;
    use taustream_messages::{FaultReason, Phase};
    use taustream_motion::axis::AXES_MAX;
    use taustream_motion::{MAX_JOINTS, Stroke, Trajectory, joint_array};

    fn settings() -> Settings {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
        Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"))
    }

    fn cycle(tick: u64, position_rad: JointArray) -> CycleRecord {
        CycleRecord {
            tick,
            time_ns: 5_270_041_203_103,
            syncs: [tick; BUSES_MAX],
            frames: [7 * tick; BUSES_MAX],
            phase: Phase::Moving,
            trajectory_id: 7,
            s: 0.1 + 0.2,
            sigma: 1.0 / 3.0,
            position_rad,
            off_path_rad: [0.0; MAX_JOINTS],
            joint_sent: [true; MAX_JOINTS],
            sent: [7; BUSES_MAX],
            lost: [0; BUSES_MAX],
            axes: [AxisReport::default(); AXES_MAX],
        }
    }

    /// Goal: what is read is what was written, to the last bit, in order, acceptance in front of its cycles.
    #[test]
    fn log_read_back_gives_the_same_bits_in_the_same_order() {
        let path = std::env::temp_dir().join(format!("taustream-log-{}", std::process::id()));
        let settings = settings();
        let (mut queue, records) = rtrb::RingBuffer::new(64);
        let (sender, candidates) = channel();
        let recorder = Recorder::start(&path, &settings, records, candidates).unwrap();
        let base_rad = joint_array([0.1 + 0.2, -1.57, 1.57, -1.57, 1e-17, 1.0 / 3.0]);
        let stroke = Stroke { start_s: 0.0, duration_s: 2.0, n: 6, delta_rad: [0.7; MAX_JOINTS] };
        let stroke = Stroke { delta_rad: joint_array([0.7, 0.1, 0.2, 0.3, 0.4, 0.5]), ..stroke };
        let trajectory = Trajectory::new(6, base_rad, &[stroke]).unwrap();
        let digest = Some(settings.robot.digest_hex());
        let file = TrajectoryFile {
            robot: "ur5".into(),
            digest,
            kinds: Default::default(),
            trajectory: trajectory.clone(),
        };
        sender.send(Candidate { trajectory_id: 7, generation: 3, file }).unwrap();
        let start_offset_rad = [0.0; MAX_JOINTS];
        let cut = Some(CutRecord { trajectory_id: 6, at_s: 0.1 + 0.2, from_s: 0.25 });
        queue.push(Record::Accepted { tick: 41, trajectory_id: 7, start_offset_rad, cut }).unwrap();
        let position_rad = trajectory.sample(0.777).position_rad;
        queue.push(Record::CycleSettings(cycle(41, position_rad))).unwrap();
        let cause = Some(Cause::new(FaultReason::FeedbackLate).at_joint(2).amount(0.021, 0.02));
        let (from, to, event) = (Phase::Moving, Phase::FastStopping, Event::StopFault);
        queue.push(Record::Transition(Transition { tick: 42, from, to, event, cause })).unwrap();
        queue.push(Record::Lost(5)).unwrap();
        recorder.finish().unwrap();

        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let lines: Vec<Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        let events: Vec<&str> = lines.iter().map(|l| l["event"].as_str().unwrap()).collect();
        assert_eq!(events, ["start", "trajectory", "cycle", "phase", "lost"]);
        let bits = |v: &Value| v.as_f64().unwrap().to_bits();
        for joint in 0..6 {
            assert_eq!(bits(&lines[2]["position_rad"][joint]), position_rad[joint].to_bits());
            assert_eq!(bits(&lines[1]["file"]["base_rad"][joint]), base_rad[joint].to_bits());
        }
        assert_eq!(bits(&lines[2]["s"]), (0.1_f64 + 0.2).to_bits());
        assert_eq!(bits(&lines[1]["cut"]["at_s"]), (0.1_f64 + 0.2).to_bits());
        assert_eq!(lines[1]["cut"]["trajectory_id"], json!(6));
        assert_eq!((&lines[2]["sync"], &lines[2]["frames"]), (&json!([41]), &json!([287])));
        assert_eq!((&lines[3]["joint"], &lines[3]["reason"]), (&json!(2), &json!("feedback late (s)")));
        assert_eq!((&lines[1]["generation"], &lines[4]["records"]), (&json!(3), &json!(5)));
    }
}
