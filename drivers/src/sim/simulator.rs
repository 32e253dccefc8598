//! The simulated drives of an arm on their buses, with the faults that were requested.
//!
//! Pure like the drives: frames, commands and time in, frames out. Randomness comes from a seed.
use super::disturbance::Disturbance;
use super::faults::{After, FaultKind, FaultRequest};
use super::model::ServoModel;
use super::settings::DriveSetup;
use crate::frame::CanFrame;
use crate::servo::Nanos;
use std::collections::VecDeque;
use taustream_motion::MAX_JOINTS;
use taustream_motion::dynamics::Dynamics;

/// A joint moves when its drive steers it faster than this while enabled.
const MOVING_RAD_S: f64 = 0.02;
/// Most frames that a delay holds back on one bus; more are lost, as in a full mailbox.
const HELD_MAX: usize = 4096;

/// One drive, its joint and its wire.
#[derive(Clone, Debug)]
struct Unit {
    joint: String,
    bus: usize,
    drive: Box<dyn ServoModel>,
    enabled: Option<Nanos>,
    moving: Option<Nanos>,
    silent: bool,
    delay_s: f64,
    loss: f64,
}

/// A fault that was ordered.
#[derive(Clone, Copy, Debug)]
struct Pending {
    request: FaultRequest,
    requested_at: Nanos,
    began: Option<Nanos>,
}

/// What happened to a fault, for the operator.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The joint.
    pub joint: String,
    /// The fault.
    pub kind: FaultKind,
    /// True when it began, false when it ended.
    pub began: bool,
}

/// A servo whose simulation knows only the pendulum of its own joint.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the simulated servo of joint {joint} feels no masses; leave simulator.gravity_of_masses out")]
pub struct FeelsNoMasses {
    /// The joint.
    pub joint: String,
}

/// All drives of an arm.
#[derive(Clone, Debug)]
pub struct ServoSimulator {
    units: Vec<Unit>,
    /// The masses whose weight acts on the joints; none: each joint is a pendulum.
    masses: Option<Dynamics>,
    faults: Vec<Pending>,
    /// Frames that a delay holds back, by due time, for each bus.
    held: Vec<VecDeque<(Nanos, CanFrame)>>,
    chance: u64,
    scratch: Vec<CanFrame>,
    events: Vec<Event>,
}

impl ServoSimulator {
    /// Drives of all joints, base to tip, on `buses` buses. `seed` decides which frames a lossy wire loses.
    #[must_use]
    pub fn new(setups: Vec<DriveSetup>, buses: usize, seed: u64) -> Self {
        let units = setups.into_iter().map(|setup| Unit {
            joint: setup.joint,
            bus: setup.bus,
            drive: setup.parameters.build(&setup.objects),
            enabled: None,
            moving: None,
            silent: false,
            delay_s: 0.0,
            loss: 0.0,
        });
        Self {
            units: units.collect(),
            masses: None,
            faults: Vec::new(),
            held: vec![VecDeque::new(); buses],
            chance: seed,
            scratch: Vec::with_capacity(64),
            events: Vec::new(),
        }
    }

    /// The same arm, on whose joints the weight of these masses acts, in the pose that the arm is in.
    ///
    /// # Errors
    /// When the simulation of a servo has no room for it.
    pub fn with_masses(mut self, masses: Dynamics) -> Result<Self, FeelsNoMasses> {
        self.masses = Some(masses);
        match self.weigh() {
            None => Ok(self),
            Some(joint) => Err(FeelsNoMasses { joint }),
        }
    }

    /// Puts the weight of the masses in the present pose on the joints. Returns a joint that does not feel it.
    fn weigh(&mut self) -> Option<String> {
        let masses = self.masses.as_ref()?;
        let mut pose_rad = [0.0; MAX_JOINTS];
        for (angle_rad, unit) in pose_rad.iter_mut().zip(&self.units) {
            *angle_rad = unit.drive.position_rad();
        }
        let holding_nm = masses.holding_nm(&pose_rad);
        let mut numb = None;
        for (unit, holding_nm) in self.units.iter_mut().zip(holding_nm) {
            if !unit.drive.weigh(-holding_nm) {
                numb.get_or_insert_with(|| unit.joint.clone());
            }
        }
        numb
    }

    /// Names of the joints, base to tip.
    #[must_use]
    pub fn joints(&self) -> Vec<String> {
        self.units.iter().map(|unit| unit.joint.clone()).collect()
    }

    /// The drive of a joint.
    #[must_use]
    pub fn drive(&self, joint: usize) -> Option<&dyn ServoModel> {
        self.units.get(joint).map(|unit| &*unit.drive)
    }

    /// Requests a fault.
    pub fn request(&mut self, now: Nanos, request: FaultRequest) {
        self.faults.push(Pending { request, requested_at: now, began: None });
    }

    /// Ends the faults of a joint, or of all, begun or not. A drive that went into fault stays there.
    pub fn clear(&mut self, joint: Option<usize>) {
        let ended = |pending: &Pending| joint.is_none_or(|joint| pending.request.joint == joint);
        let (end, keep): (Vec<_>, Vec<_>) = self.faults.iter().copied().partition(ended);
        self.faults = keep;
        for pending in end.into_iter().filter(|pending| pending.began.is_some()) {
            self.end(pending.request);
        }
    }

    /// Faults that began or ended since the last call.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Lets time pass; `out` takes each bus's frames.
    pub fn advance(&mut self, now: Nanos, out: &mut [Vec<CanFrame>]) {
        self.weigh();
        for at in 0..self.units.len() {
            self.with_drive(now, at, out, |drive, frames| drive.advance(now, frames));
        }
        self.note_motion(now);
        self.begin_and_end(now, out);
        for (held, out) in self.held.iter_mut().zip(out) {
            while let Some((_, frame)) = held.pop_front_if(|(due, _)| *due <= now) {
                out.push(frame);
            }
        }
    }

    /// Hands frames of a bus to its drives.
    pub fn receive(&mut self, now: Nanos, bus: usize, frames: &[CanFrame], out: &mut [Vec<CanFrame>]) {
        for frame in frames {
            for at in 0..self.units.len() {
                let Some(unit) = self.units.get(at) else { continue };
                let (on_bus, silent, loss) = (unit.bus == bus, unit.silent, unit.loss);
                if on_bus && !silent && !self.is_lost(loss) {
                    self.with_drive(now, at, out, |drive, answers| drive.receive(now, frame, answers));
                }
            }
        }
    }

    /// When something is due by itself, besides what a poll every few milliseconds finds.
    #[must_use]
    pub fn next_due(&self) -> Option<Nanos> {
        self.held.iter().filter_map(|held| held.front()).map(|(due, _)| *due).min()
    }

    /// Calls a drive and puts what it sends on its wire.
    fn with_drive(
        &mut self,
        now: Nanos,
        at: usize,
        out: &mut [Vec<CanFrame>],
        call: impl FnOnce(&mut dyn ServoModel, &mut Vec<CanFrame>),
    ) {
        let mut frames = std::mem::take(&mut self.scratch);
        frames.clear();
        if let Some(unit) = self.units.get_mut(at) {
            call(&mut *unit.drive, &mut frames);
            let (bus, silent, delay_s, loss) = (unit.bus, unit.silent, unit.delay_s, unit.loss);
            for frame in frames.iter().filter(|_| !silent) {
                if self.is_lost(loss) {
                    continue;
                }
                if delay_s > 0.0 {
                    self.hold_back(now, bus, delay_s, *frame);
                } else if let Some(out) = out.get_mut(bus) {
                    out.push(*frame);
                }
            }
        }
        self.scratch = frames;
    }

    /// Keeps a frame until its wire's delay is over.
    fn hold_back(&mut self, now: Nanos, bus: usize, delay_s: f64, frame: CanFrame) {
        let Some(held) = self.held.get_mut(bus) else { return };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 10 s")]
        let due = Nanos(now.0.saturating_add((delay_s * 1e9) as u64));
        let place = held.partition_point(|(other, _)| *other <= due);
        if held.len() < HELD_MAX {
            held.insert(place, (due, frame));
        }
    }

    /// Draws whether a frame is lost.
    fn is_lost(&mut self, probability: f64) -> bool {
        if probability <= 0.0 {
            return false;
        }
        // SplitMix64 (Steele, Lea, Flood 2014): enough for chance in tests, and the same on every machine.
        self.chance = self.chance.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.chance;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        #[expect(clippy::cast_precision_loss, reason = "53 bits")]
        let rng = ((z ^ z >> 31) >> 11) as f64 / (1_u64 << 53) as f64;
        rng < probability
    }

    /// Notes when joints were enabled, and when they began to move.
    fn note_motion(&mut self, now: Nanos) {
        for unit in &mut self.units {
            let enabled = unit.drive.is_enabled();
            unit.enabled = if enabled { unit.enabled.or(Some(now)) } else { None };
            let moves = enabled && unit.drive.velocity_rad_s().abs() > MOVING_RAD_S;
            // Once it has begun to move it counts as moving until disabled: faults in the middle of a motion
            // must not be shy of a turning point.
            unit.moving = match (enabled, unit.moving) {
                (true, Some(since)) => Some(since),
                (true, None) if moves => Some(now),
                _ => None,
            };
        }
    }

    fn begin_and_end(&mut self, now: Nanos, out: &mut [Vec<CanFrame>]) {
        let mut faults = std::mem::take(&mut self.faults);
        faults.retain_mut(|pending| {
            let request = pending.request;
            let Some(unit) = self.units.get(request.joint) else { return false };
            if let Some(began) = pending.began {
                let over = request.for_s.is_some_and(|for_s| now.since_s(began) >= for_s);
                if over {
                    self.end(request);
                }
                return !over;
            }
            let counts_from = match request.after {
                After::Start => Some(pending.requested_at),
                After::Enable => unit.enabled,
                After::Moving => unit.moving,
            };
            if counts_from.is_some_and(|from| now.since_s(from) >= request.at_s) {
                pending.began = Some(now);
                self.begin(now, request, out);
            }
            true
        });
        self.faults = faults;
    }

    fn begin(&mut self, now: Nanos, request: FaultRequest, out: &mut [Vec<CanFrame>]) {
        let Some(unit) = self.units.get_mut(request.joint) else { return };
        match request.kind {
            FaultKind::Silence => unit.silent = true,
            FaultKind::Delay { by_s } => unit.delay_s = by_s,
            FaultKind::Drop { probability } => unit.loss = probability,
            FaultKind::Fault { .. }
            | FaultKind::Stuck
            | FaultKind::Object { .. }
            | FaultKind::Jump { .. }
            | FaultKind::Warning
            | FaultKind::Refuse { .. }
            | FaultKind::Inputs { .. }
            | FaultKind::Restart => {}
        }
        if let Some(disturbance) = disturbance(request.kind, true) {
            self.with_drive(now, request.joint, out, |drive, frames| drive.disturb(disturbance, frames));
        }
        self.report_event(request, true);
    }

    fn end(&mut self, request: FaultRequest) {
        let Some(unit) = self.units.get_mut(request.joint) else { return };
        match request.kind {
            FaultKind::Silence => unit.silent = false,
            FaultKind::Delay { .. } => unit.delay_s = 0.0,
            FaultKind::Drop { .. } => unit.loss = 0.0,
            FaultKind::Fault { .. }
            | FaultKind::Stuck
            | FaultKind::Object { .. }
            | FaultKind::Jump { .. }
            | FaultKind::Warning
            | FaultKind::Refuse { .. }
            | FaultKind::Inputs { .. }
            | FaultKind::Restart => {}
        }
        if let Some(disturbance) = disturbance(request.kind, false) {
            // Ending a disturbance makes no drive send anything.
            unit.drive.disturb(disturbance, &mut Vec::new());
        }
        self.report_event(request, false);
    }

    fn report_event(&mut self, request: FaultRequest, began: bool) {
        if let Some(unit) = self.units.get(request.joint) {
            self.events.push(Event { joint: unit.joint.clone(), kind: request.kind, began });
        }
    }
}

/// What a fault does inside the drive when it begins, or ends.
fn disturbance(kind: FaultKind, begins: bool) -> Option<Disturbance> {
    match kind {
        FaultKind::Silence | FaultKind::Delay { .. } | FaultKind::Drop { .. } => None,
        FaultKind::Fault { code } => begins.then_some(Disturbance::Fault(code)),
        FaultKind::Stuck => Some(Disturbance::Jammed(begins)),
        FaultKind::Object { at_rad } => Some(Disturbance::Object(begins.then_some(at_rad))),
        FaultKind::Jump { by_rad } => Some(Disturbance::EncoderShift(if begins { by_rad } else { 0.0 })),
        FaultKind::Warning => Some(Disturbance::Warning(begins)),
        FaultKind::Refuse { code } => Some(Disturbance::RefuseWrites(if begins { code } else { 0 })),
        FaultKind::Inputs { bits } => Some(Disturbance::Inputs(if begins { bits } else { 0 })),
        FaultKind::Restart => begins.then_some(Disturbance::Restart),
    }
}
