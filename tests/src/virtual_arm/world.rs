//! Time, the buses, the drives, and the cycle that commands them.
use super::bus::{Interface, VirtualBus};
use super::checker::Checker;
use super::link::{SharedBus, VirtualLink};
use super::phase_rules::ArmView;
use super::plan::{BusEvent, Event, Plan};
use super::random::SeededRng;
use super::setpoint_reader::is_enabled;
use anyhow::{Context, Result};
use std::collections::VecDeque;
use taustream_arm::{Cia402, Settings};
use taustream_drivers::protocols::{self, BusDriver};
use taustream_drivers::sim::faults::{After, FaultKind, FaultRequest};
use taustream_drivers::sim::settings::{drives, queue_frames};
use taustream_drivers::sim::wire::Sender;
use taustream_drivers::sim::{ServoModel, ServoSimulator};
use taustream_drivers::{CanFrame, CanId, Nanos, ServoDriver};
use taustream_messages::{CheckedTrajectory, Command, Phase, Replaces, Report};
use taustream_motion::{JointArray, Trajectory};
use taustream_streamer::answer::CommandAnswer;
use taustream_streamer::buses::{Bus, Buses};
use taustream_streamer::cycle::{Core, NoProbe, run_cycle};
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::intake::{self, CommandQueue, Handover};
use taustream_streamer::prepared::PreparedTrajectory;
use taustream_streamer::report::{self, Readers, Record};
use taustream_streamer::tick::Schedule;

/// When time begins, ns: nothing is due at zero.
const BEGIN_NS: u64 = 1_000_000_000;
/// Longest step in which the drives are advanced, ns.
const STEP_NS: u64 = 1_000_000;
/// Most that a wake-up is late without a stall, ns.
const LATE_NS_MAX: u64 = 300_000;
/// Identifiers of another node, which no protocol uses here.
const FOREIGN_ID: u16 = 0x781;
/// How long a drive counts as disturbed after its fault, ms.
const DISTURBED_MS: u64 = 1_000;

/// Trajectories that are remembered: more than may run, wait or be on their way.
const SENT_MAX: usize = 32;

/// Changes a driver before it is used: to plant faults that the checker must find.
pub type Wrap<'a> = &'a dyn Fn(BusDriver) -> Box<dyn ServoDriver>;

/// What is due at an instant of virtual time.
#[derive(Clone, Copy, Debug)]
struct Due {
    at: Nanos,
    event: Event,
    begins: bool,
}

/// An answer to a command.
#[derive(Clone, Copy, Debug)]
pub struct Answered {
    /// The command.
    pub command: Command,
    /// The answer.
    pub answer: CommandAnswer,
}

/// Everything.
pub struct World {
    /// The arm's settings.
    pub settings: Settings,
    /// What it may not do.
    pub checker: Checker,
    /// What happened, in words.
    pub story: Vec<String>,
    core: Core,
    queue: CommandQueue,
    readers: Readers,
    schedule: Schedule,
    now: Nanos,
    tick: u64,
    rng: SeededRng,
    buses: Vec<SharedBus>,
    simulator: ServoSimulator,
    said: Vec<Vec<CanFrame>>,
    dues: VecDeque<Due>,
    stalls: VecDeque<(u64, u64)>,
    asked: Vec<(u64, Command)>,
    handover: Option<(u64, Handover)>,
    newest: Option<Report>,
    generation: u64,
    /// Trajectories that were offered, newest last.
    sent: VecDeque<(u64, Trajectory)>,
    replacements: (u64, u64),
    disturbed_until_ms: u64,
    digest: u64,
    frames: u64,
}

impl World {
    /// An arm whose drives are being powered; `wrap` changes its drivers.
    ///
    /// # Errors
    /// When the settings fit no driver or no simulated drive.
    pub fn new(settings: Settings, seed: u64, plan: &Plan, wrap: Wrap<'_>) -> Result<Self> {
        let setups = drives(&settings, None).map_err(|faults| anyhow::anyhow!("{faults}"))?;
        let queue_max = queue_frames(&settings).map_err(|faults| anyhow::anyhow!("{faults}"))?;
        let shared = settings.buses.iter().map(|bus| SharedBus::new(VirtualBus::new(bus.kind, queue_max)));
        let buses: Vec<SharedBus> = shared.collect();
        let mut cycle_buses = Vec::new();
        for (index, (bus, shared)) in settings.buses.iter().zip(&buses).enumerate() {
            let driver = wrap(protocols::of_bus(&settings, index).context("a driver")?);
            let link = VirtualLink::new(bus.interface.clone(), shared.clone());
            cycle_buses.push(Bus::new(Box::new(link), driver, &settings));
        }
        let (intake, queue) = intake::pair();
        let (writers, readers) = report::queues(true);
        let core = Core::new(&settings, Buses::new(cycle_buses)?, intake, writers);
        let now = Nanos(BEGIN_NS);
        let mut world = Self {
            checker: Checker::new(&settings),
            story: Vec::new(),
            core,
            queue,
            readers,
            schedule: Schedule::starting_after(now, settings.cycle.period_us),
            now,
            tick: 0,
            rng: SeededRng::new(seed, 3),
            simulator: ServoSimulator::new(setups, settings.buses.len(), seed),
            said: vec![Vec::new(); settings.buses.len()],
            buses,
            dues: VecDeque::new(),
            stalls: VecDeque::new(),
            asked: Vec::new(),
            handover: None,
            newest: None,
            generation: 0,
            sent: VecDeque::new(),
            replacements: (0, 0),
            disturbed_until_ms: 0,
            digest: 0xCBF2_9CE4_8422_2325,
            frames: 0,
            settings,
        };
        world.schedule_plan(plan);
        Ok(world)
    }

    fn schedule_plan(&mut self, plan: &Plan) {
        let at = |ms: u64| Nanos(BEGIN_NS + ms * 1_000_000);
        let mut dues = Vec::new();
        for (ms, event) in &plan.events {
            match *event {
                Event::Stall { ms: late_ms } => self.stalls.push_back((*ms, late_ms)),
                Event::Bus { for_ms, .. } => {
                    dues.push(Due { at: at(*ms), event: *event, begins: true });
                    dues.push(Due { at: at(ms + for_ms), event: *event, begins: false });
                }
                Event::Drive { .. } => dues.push(Due { at: at(*ms), event: *event, begins: true }),
            }
        }
        dues.sort_by_key(|due| due.at);
        self.dues = dues.into();
    }

    /// Milliseconds since the start.
    #[must_use]
    pub fn now_ms(&self) -> u64 {
        (self.now.0 - BEGIN_NS) / 1_000_000
    }

    /// The phase of the arm.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.core.supervisor().phase()
    }

    /// Everything that was on the wires, as one number: equal for equal traffic.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.digest
    }

    /// Frames that were on the wires.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The pose that was commanded last, as the report says.
    #[must_use]
    pub fn commanded_rad(&self) -> Option<JointArray> {
        self.newest.map(|report| report.command_rad)
    }

    /// True angles of the links.
    #[must_use]
    pub fn position_rad(&self) -> JointArray {
        self.measure(ServoModel::position_rad)
    }

    /// What the drives are and report.
    #[must_use]
    pub fn drives_in_words(&self) -> String {
        let joints = self.settings.robot.joints.len();
        let word = |joint: usize| {
            let is = self.simulator.drive(joint).map_or(String::new(), ServoModel::describe);
            let said =
                self.newest.map_or((0, 0), |report| (report.drive_status[joint], report.drive_error[joint]));
            format!("joint {}: {is}, reported {:#06x}, error {:#x}", joint + 1, said.0, said.1)
        };
        (0..joints).map(word).collect::<Vec<_>>().join("; ")
    }

    fn measure(&self, value: fn(&dyn ServoModel) -> f64) -> JointArray {
        std::array::from_fn(|joint| self.simulator.drive(joint).map_or(0.0, value))
    }

    /// Adds a line to the story.
    pub fn tell(&mut self, text: &str) {
        self.story.push(format!("{:6} ms, tick {}: {text}", self.now_ms(), self.tick));
    }

    /// Nothing goes wrong any more; what is wrong ends.
    pub fn make_whole(&mut self) {
        self.stalls.clear();
        self.dues.clear();
        self.simulator.clear(None);
        let now = self.now;
        for bus in &self.buses {
            bus.get().disturb(now, |disturbance| *disturbance = super::bus::BusDisturbance::default());
        }
        self.disturbed_until_ms = self.now_ms() + DISTURBED_MS;
        self.tell("everything is whole again");
    }

    /// Asks for a command; false when too many are on their way.
    pub fn ask(&mut self, command: Command) -> bool {
        let Some(sequence) = self.queue.commands.ask(command, Nanos(u64::MAX)) else { return false };
        self.asked.push((sequence, command));
        true
    }

    /// Offers a trajectory from rest as the service thread does after its check; its id, unless too many are on their way.
    pub fn offer(&mut self, trajectory: &Trajectory) -> Option<u64> {
        self.offer_message(trajectory, Replaces::Rest, None)
    }

    /// Offers a replacement, cut at its trajectory time, of what runs, or of what may still wait for `waits_until_s`.
    pub fn offer_cut(
        &mut self,
        trajectory: &Trajectory,
        (trajectory_id, at_s): (u64, f64),
        waits_until_s: Option<f64>,
    ) -> Option<u64> {
        let replaces = Replaces::Cut { trajectory_id, at_s };
        self.offer_message(trajectory, replaces, Some([at_s, waits_until_s.unwrap_or(at_s)]))
    }

    /// The newest report.
    #[must_use]
    pub fn report(&self) -> Option<Report> {
        self.newest
    }

    /// The clock of reports, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now.0
    }

    /// The trajectory that runs, with its strokes, and its trajectory time, as the newest report says.
    #[must_use]
    pub fn running(&self) -> Option<(u64, &Trajectory, f64)> {
        let report = self.newest?;
        let (id, trajectory) = self.sent.iter().find(|(id, _)| *id == report.trajectory_id)?;
        Some((*id, trajectory, report.trajectory_s))
    }

    /// Replacements that were accepted, and refused.
    #[must_use]
    pub fn replacements(&self) -> (u64, u64) {
        self.replacements
    }

    fn offer_message(
        &mut self,
        trajectory: &Trajectory,
        replaces: Replaces,
        from_s: Option<[f64; 2]>,
    ) -> Option<u64> {
        let mut filled = self.queue.trajectories.empty_box()?;
        self.generation += 1;
        let trajectory_id = 1_000 + self.generation;
        let checked = CheckedTrajectory {
            trajectory_id,
            generation: self.generation,
            robot_digest: self.settings.robot.message_digest,
            replaces,
            trajectory: trajectory.clone(),
        };
        *filled = PreparedTrajectory::new(checked, &self.settings.robot.limits());
        self.queue.trajectories.offer(filled);
        self.checker.offered(trajectory_id, trajectory, from_s);
        if self.sent.len() == SENT_MAX {
            self.sent.pop_front();
        }
        self.sent.push_back((trajectory_id, trajectory.clone()));
        Some(trajectory_id)
    }

    /// One cycle, when its time has come; the answers that it gave.
    pub fn step(&mut self) -> Vec<Answered> {
        let mut wake = Nanos(self.schedule.deadline().0 + self.rng.whole(0, LATE_NS_MAX));
        if let Some((_, late_ms)) =
            self.stalls.pop_front_if(|(at_ms, _)| BEGIN_NS + *at_ms * 1_000_000 <= wake.0)
        {
            wake.0 += late_ms * 1_000_000;
            self.tell(&format!("the loop stalls for {late_ms} ms"));
        }
        self.pass_time(wake);
        let tick = self.schedule.wake(wake);
        self.tick = tick.number;
        if tick.skipped > 0 {
            self.checker.stalled();
        }
        for bus in &self.buses {
            bus.get().begin_cycle(wake, tick.number);
        }
        self.return_links();
        let before = self.phase();
        run_cycle(&mut self.core, tick, &mut NoProbe);
        self.read_records();
        if self.phase() != before {
            let cause = self.core.supervisor().cause();
            let why = cause.map_or(String::new(), |cause| {
                format!(" ({:?}, joint {:?}, bus {:?})", cause.reason, cause.joint, cause.bus)
            });
            self.tell(&format!("{before:?} -> {:?}{why}", self.phase()));
        }
        let view = self.view(tick.skipped);
        self.checker.observe(&view);
        self.take_links();
        self.take_answers()
    }

    fn view(&self, skipped: u64) -> ArmView {
        let lost = |bus: &SharedBus| bus.get().disturbance().interface != Interface::Up;
        ArmView {
            tick: self.tick,
            skipped,
            phase: self.phase(),
            bus_lost: self.buses.iter().any(lost),
            enabled: std::array::from_fn(|joint| is_enabled(&self.simulator, joint)),
            speed_rad_s: self.measure(ServoModel::velocity_rad_s),
            disturbed: self.now_ms() < self.disturbed_until_ms,
        }
    }

    /// Lets time pass until a wake-up: events, frames on the wires, drives.
    fn pass_time(&mut self, until: Nanos) {
        while self.now < until {
            let next_due = self.dues.front().map_or(u64::MAX, |due| due.at.0.max(self.now.0));
            let next = Nanos(until.0.min(self.now.0 + STEP_NS).min(next_due));
            for bus in 0..self.buses.len() {
                self.deliver_by(next, bus);
            }
            let mut said = std::mem::take(&mut self.said);
            self.simulator.advance(next, &mut said);
            self.say(next, &mut said);
            self.said = said;
            self.now = next;
            while let Some(due) = self.dues.pop_front_if(|due| due.at <= next) {
                self.happen(due);
            }
        }
    }

    /// Frames of a bus that have left the wire.
    fn deliver_by(&mut self, until: Nanos, bus: usize) {
        loop {
            let next = self.buses[bus].get().next_by(until);
            let Some(on_wire) = next else { return };
            let delivered = on_wire.delivered;
            self.note(bus, delivered.at, &delivered.frame);
            if delivered.sender == Sender::Drive {
                continue;
            }
            let read = self.checker.reader().read(bus, &delivered.frame);
            let mut said = std::mem::take(&mut self.said);
            self.simulator.receive(delivered.at, bus, &[delivered.frame], &mut said);
            self.say(delivered.at, &mut said);
            self.said = said;
            for setpoint in read {
                let enabled = is_enabled(&self.simulator, setpoint.joint);
                let at_rad = self.simulator.drive(setpoint.joint).map_or(0.0, ServoModel::position_rad);
                self.checker.reached(setpoint, on_wire.tick, (enabled, at_rad));
            }
        }
    }

    fn say(&mut self, now: Nanos, said: &mut [Vec<CanFrame>]) {
        for (index, frames) in said.iter_mut().enumerate() {
            for frame in frames.drain(..) {
                let mut bus = self.buses[index].get();
                if !bus.has_wire() {
                    drop(bus);
                    self.note(index, now, &frame);
                    bus = self.buses[index].get();
                }
                bus.offer(now, frame);
            }
        }
    }

    /// Takes a frame into the digest (FNV-1a).
    fn note(&mut self, bus: usize, at: Nanos, frame: &CanFrame) {
        let id = frame.id().raw().to_le_bytes();
        let head = [bus as u64, at.0].map(u64::to_le_bytes);
        for byte in head.iter().flatten().chain(&id).chain(frame.data()) {
            self.digest = (self.digest ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
        self.frames += 1;
    }

    fn happen(&mut self, due: Due) {
        match due.event {
            Event::Stall { .. } => {}
            Event::Bus { bus, event, .. } => {
                if due.begins {
                    self.tell(&due.event.to_string());
                }
                self.disturb_bus(due.at, bus, event, due.begins);
            }
            Event::Drive { joint, kind, for_ms } => {
                self.tell(&due.event.to_string());
                self.disturbed_until_ms = self.now_ms() + for_ms + DISTURBED_MS;
                #[expect(clippy::cast_precision_loss, reason = "milliseconds")]
                let for_s = Some(for_ms as f64 * 1e-3).filter(|_| !matches!(kind, FaultKind::Fault { .. }));
                let request = FaultRequest { joint, kind, after: After::Start, at_s: 0.0, for_s };
                self.simulator.request(due.at, request);
            }
        }
    }

    fn disturb_bus(&mut self, now: Nanos, index: usize, event: BusEvent, begins: bool) {
        self.disturbed_until_ms = self.now_ms() + DISTURBED_MS;
        let mut bus = self.buses[index].get();
        match event {
            BusEvent::Partial(most) => bus.disturb(now, |d| d.takes_max = begins.then_some(most)),
            BusEvent::NoAcknowledge => bus.disturb(now, |d| d.unacknowledged = begins),
            BusEvent::BusOff => bus.disturb(now, |d| d.interface = either(begins, Interface::BusOff)),
            BusEvent::Down => bus.disturb(now, |d| d.interface = either(begins, Interface::Down)),
            BusEvent::Gone => bus.disturb(now, |d| d.interface = either(begins, Interface::Gone)),
            BusEvent::EchoesLate(ns) => bus.disturb(now, |d| d.echo_delay_ns = if begins { ns } else { 0 }),
            BusEvent::EchoesLost(count) if begins => bus.disturb(now, |d| d.echoes_lost = count),
            BusEvent::Overflow(count) if begins => bus.disturb(now, |d| d.arrivals_lost = count),
            BusEvent::Foreign(count) if begins => {
                for number in 0..count {
                    let id = FOREIGN_ID + u16::try_from(number % 64).unwrap_or(0);
                    bus.offer(now, CanFrame::classic(CanId::standard(id), &[0; 8]));
                }
            }
            BusEvent::OtherMaster if begins => {
                // A setpoint frame of the first servo of the bus, without data: no drive applies it.
                let servo = self.settings.servos.iter().find(|servo| servo.bus == index);
                let node = u16::from(servo.map_or(1, |servo| servo.node_id));
                let is_cia402 = servo.is_some_and(|servo| servo.protocol.get::<Cia402>().is_some());
                let id = if is_cia402 { 0x200 + node } else { node };
                bus.offer(now, CanFrame::classic(CanId::standard(id), &[]));
            }
            BusEvent::EchoesLost(_)
            | BusEvent::Overflow(_)
            | BusEvent::Foreign(_)
            | BusEvent::OtherMaster => {}
        }
    }

    fn read_records(&mut self) {
        while let Some(record) = self.readers.records.as_mut().and_then(|records| records.pop().ok()) {
            if let Record::CycleSettings(cycle) = record {
                self.checker.cycle(&cycle);
            }
        }
        while self.readers.timings.pop().is_ok() {}
        while self.readers.notes.pop().is_ok() {}
        while let Ok(report) = self.readers.reports.pop() {
            self.newest = Some(report);
        }
        while let Some(result) = self.queue.trajectories.trajectory_result() {
            match result.decision {
                Decision::Waits { .. } => self.replacements.0 += 1,
                Decision::Cut(_) => self.replacements.1 += 1,
                Decision::Accepted { .. }
                | Decision::Stale { .. }
                | Decision::NotAtBase { .. }
                | Decision::NotReady { .. } => {}
            }
        }
    }

    fn take_answers(&mut self) -> Vec<Answered> {
        let mut answered = Vec::new();
        while let Some(answer) = self.queue.commands.answer() {
            let at = self.asked.iter().position(|(sequence, _)| *sequence == answer.sequence);
            let Some((_, command)) = at.map(|at| self.asked.swap_remove(at)) else { continue };
            if answer.accepted {
                self.checker.accepted(command);
                self.tell(&format!("{command:?}: {:?}", answer.why));
            }
            answered.push(Answered { command, answer });
        }
        answered
    }

    /// The service thread's part: links of failed buses are restarted, which takes some milliseconds.
    fn take_links(&mut self) {
        if let Some(handover) = self.queue.trajectories.failed_links() {
            let takes_ms = self.rng.whole(1, 20);
            self.handover = Some((self.tick + takes_ms, handover));
        }
    }

    fn return_links(&mut self) {
        let Some((_, mut handover)) = self.handover.take_if(|(due, _)| *due <= self.tick) else { return };
        let mut recovered = true;
        for link in handover.links.iter_mut().flatten() {
            recovered &= link.reopen().is_ok();
        }
        handover.recovered = recovered;
        let sequence = handover.sequence;
        self.queue.trajectories.return_links(handover);
        if !recovered {
            // Answered by the service thread in the words of the link.
            self.asked.retain(|(asked, _)| *asked != sequence);
        }
    }
}

fn either(begins: bool, interface: Interface) -> Interface {
    if begins { interface } else { Interface::Up }
}

/// Drivers as they are shipped.
#[must_use]
pub fn shipped(driver: BusDriver) -> Box<dyn ServoDriver> {
    Box::new(driver)
}
