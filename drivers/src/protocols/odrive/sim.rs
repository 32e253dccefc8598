//! One simulated `ODrive`: frames and time in, frames out.
//!
//! No I/O and no clock: the same frames at the same times give the same answers, bit by bit. What is simple: of the control
//! modes there is position with direct input, and of the endpoints those that the settings name.
//!
//! Where the maker's text leaves it open, the drive does the worst: it remembers a setpoint that came while it was not
//! energised, and its watchdog runs then too.
use super::frames::{
    CONTROL_POSITION, Command, ERROR_WATCHDOG, EndpointValue, INPUT_PASSTHROUGH, InputPosition, Message,
    Query, STATE_CLOSED_LOOP, STATE_IDLE, Version,
};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::controller::{Controller, LoopParameters};
use crate::sim::disturbance::Disturbance;
use crate::sim::mechanics::Mechanics;
use crate::sim::plant::PlantParameters;
use std::f64::consts::TAU;

/// Error of a fault that names none: the gate driver.
const ERROR_DRIVER: u32 = 0x20;
/// Error of an emergency stop.
const ERROR_ESTOP: u32 = 0x0200_0000;
/// Longest time over which a setpoint is extrapolated by its feed-forward.
const EXTRAPOLATE_S: f64 = 0.02;
/// Shortest time in which a setpoint is reached.
const REACHED_S: f64 = 1e-3;

/// Endpoints that the drive has: watchdog timeout, watchdog switch, velocity limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Endpoints {
    /// Float, seconds.
    pub watchdog_timeout: u16,
    /// Switch.
    pub enable_watchdog: u16,
    /// Float, turns per second.
    pub velocity_limit: u16,
}

/// What a simulated drive is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdriveParameters {
    /// Node id, 0 to 62.
    pub node_id: u8,
    /// Motor direction against link direction, +1.0 or -1.0.
    pub sign: f64,
    /// Link angle where the drive says 0.
    pub zero_offset_rad: f64,
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
    /// Link angle at power-up.
    pub start_rad: f64,
    /// Mechanics.
    pub plant: PlantParameters,
    /// Control.
    pub loops: LoopParameters,
    /// What it says of itself.
    pub version: Version,
    /// Its endpoints.
    pub endpoints: Endpoints,
    /// Its velocity limit.
    pub velocity_limit_turns_s: f32,
    /// Watchdog in its memory: timeout, and whether it is on.
    pub watchdog: (f32, bool),
    /// Period of its estimates, 0 is never.
    pub encoder_period_ms: u32,
    /// Period of its heartbeat, 0 is never.
    pub heartbeat_period_ms: u32,
    /// It confirms writes, as from firmware 0.6.11.
    pub confirms_writes: bool,
    /// Time from power-up to the first frame.
    pub boot_s: f64,
    /// Step of the simulated mechanics, 10,000 to 1,000,000 ns.
    pub step_ns: u64,
}

/// A simulated drive.
#[derive(Clone, Debug)]
pub struct Odrive {
    parameters: OdriveParameters,
    mechanics: Mechanics,
    controller: Controller,
    state: u8,
    errors: u32,
    disarmed: u32,
    modes: (u32, u32),
    input: Option<InputPosition>,
    input_at: Nanos,
    watchdog: (f32, bool),
    velocity_limit_turns_s: f32,
    /// Turns of the encoder that count as zero, after "set absolute position".
    shift_turns: f64,
    now: Nanos,
    powered: Option<Nanos>,
    fed: Nanos,
    estimates_at: Nanos,
    heartbeat_at: Nanos,
    locked: bool,
}

impl Odrive {
    /// A drive that powers up at the first call of [`Self::advance`].
    #[must_use]
    pub fn new(parameters: OdriveParameters) -> Self {
        Self {
            mechanics: Mechanics::new(parameters.plant, parameters.start_rad, parameters.step_ns),
            controller: Controller::new(parameters.loops),
            state: STATE_IDLE,
            errors: 0,
            disarmed: 0,
            modes: (0, 0),
            input: None,
            input_at: Nanos(0),
            watchdog: parameters.watchdog,
            velocity_limit_turns_s: parameters.velocity_limit_turns_s,
            shift_turns: 0.0,
            now: Nanos(0),
            powered: None,
            fed: Nanos(0),
            estimates_at: Nanos(0),
            heartbeat_at: Nanos(0),
            locked: false,
            parameters,
        }
    }

    /// Lets time pass up to `now`, and pushes what the drive sends by itself.
    pub fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        self.now = now;
        if self.powered.is_none() {
            (self.powered, self.fed) = (Some(now), now);
        }
        self.move_on(now);
        if !self.is_up() {
            self.fed = now;
            return;
        }
        let (timeout_s, enabled) = self.watchdog;
        if enabled && timeout_s > 0.0 && now.since_s(self.fed) > f64::from(timeout_s) {
            self.fail(ERROR_WATCHDOG);
        }
        let due = |period_ms: u32, at: Nanos| period_ms > 0 && now.since_s(at) >= f64::from(period_ms) * 1e-3;
        if due(self.parameters.heartbeat_period_ms, self.heartbeat_at) {
            self.heartbeat_at = now;
            out.push(self.message(self.heartbeat()));
        }
        if due(self.parameters.encoder_period_ms, self.estimates_at) {
            self.estimates_at = now;
            out.push(self.message(self.estimates()));
        }
    }

    /// Takes a frame from the bus and pushes the answer. Frames for others, and malformed ones, change nothing.
    pub fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if now > self.now || self.powered.is_none() {
            self.advance(now, out);
        }
        // A classic controller would not even acknowledge an FD frame.
        if !self.is_up() || frame.is_fd() {
            return;
        }
        let Some(command) = Command::decode(frame, self.parameters.node_id) else { return };
        match command {
            Command::Request(query) => out.push(self.message(self.answer(query))),
            Command::Read(endpoint) => {
                let value = self.endpoint(endpoint);
                out.extend(value.map(|value| self.message(Message::Endpoint(endpoint, Some(value)))));
            }
            Command::Write(endpoint, value) => {
                let known = self.endpoint(endpoint).is_some();
                if known && !self.locked {
                    self.write(endpoint, value);
                }
                if known && self.parameters.confirms_writes {
                    out.push(self.message(Message::Endpoint(endpoint, None)));
                }
            }
            Command::AxisState(state) => self.request_state(state),
            Command::ControllerMode(control, input) => self.modes = (control, input),
            Command::Position(input) => self.take_input(input),
            Command::OtherInput => self.fed = now,
            Command::Estop => self.fail(ERROR_ESTOP),
            Command::Reboot(_) => self.restart(),
            Command::ClearErrors => self.errors = 0,
            Command::AbsolutePosition(turns) => self.shift_turns += self.turns(0.0) - f64::from(turns),
        }
    }

    /// Puts a fault into the drive.
    pub fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Fault(code) => {
                let named = u32::from(code) & !1;
                self.fail(if named == 0 { ERROR_DRIVER } else { named });
            }
            Disturbance::Jammed(jammed) => self.mechanics.plant.jammed = jammed,
            Disturbance::Object(at_rad) => self.mechanics.plant.place_object(at_rad),
            Disturbance::EncoderShift(shift_rad) => self.mechanics.encoder_shift_rad = shift_rad,
            // It has no warnings.
            Disturbance::Warning(_) | Disturbance::Inputs(_) => {}
            Disturbance::RefuseWrites(code) => self.locked = code != 0,
            Disturbance::Restart => self.restart(),
        }
    }

    /// Node id.
    #[must_use]
    pub const fn node_id(&self) -> u8 {
        self.parameters.node_id
    }
    /// State of the axis.
    #[must_use]
    pub const fn state(&self) -> u8 {
        self.state
    }
    /// Active errors.
    #[must_use]
    pub const fn errors(&self) -> u32 {
        self.errors
    }
    /// It carries torque.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        self.state == STATE_CLOSED_LOOP
    }
    /// True angle of the link, which no encoder fault can bend.
    #[must_use]
    pub const fn position_rad(&self) -> f64 {
        self.mechanics.plant.position_rad
    }
    /// True angular velocity of the link.
    #[must_use]
    pub const fn velocity_rad_s(&self) -> f64 {
        self.mechanics.plant.velocity_rad_s
    }
    /// The watchdog as it is now: timeout in seconds, and whether it is on.
    #[must_use]
    pub const fn watchdog(&self) -> (f32, bool) {
        self.watchdog
    }

    fn is_up(&self) -> bool {
        self.powered.is_some_and(|powered| self.now.since_s(powered) >= self.parameters.boot_s)
    }

    /// "This feeds the watchdog once": a state request and an input.
    fn request_state(&mut self, state: u32) {
        self.fed = self.now;
        if state == u32::from(STATE_CLOSED_LOOP) {
            if self.errors == 0 && !self.is_enabled() {
                self.energise();
            }
        } else if self.is_enabled() {
            self.disarm();
        }
    }

    fn energise(&mut self) {
        self.state = STATE_CLOSED_LOOP;
        self.mechanics.plant.energise(true);
        let at_rad = self.mechanics.read_rad(0.0);
        self.controller.energise(at_rad);
        if let Some(input) = self.input {
            self.follow(input);
        }
    }

    fn disarm(&mut self) {
        self.state = STATE_IDLE;
        self.controller.release();
        self.mechanics.plant.energise(false);
    }

    fn fail(&mut self, error: u32) {
        self.errors |= error;
        if self.is_enabled() {
            self.disarmed = self.errors;
            self.disarm();
        }
    }

    fn restart(&mut self) {
        self.disarm();
        let parameters = self.parameters;
        (self.errors, self.disarmed, self.modes, self.input) = (0, 0, (0, 0), None);
        (self.watchdog, self.shift_turns) = (parameters.watchdog, 0.0);
        self.velocity_limit_turns_s = parameters.velocity_limit_turns_s;
        (self.powered, self.fed) = (Some(self.now), self.now);
    }

    fn take_input(&mut self, input: InputPosition) {
        self.fed = self.now;
        if !input.position_turns.is_finite() {
            return;
        }
        self.input = Some(input);
        if self.is_enabled() {
            self.follow(input);
        }
        self.input_at = self.now;
    }

    /// Until the next setpoint, which may come as late as this one came after the last, its feed-forward continues it.
    fn follow(&mut self, input: InputPosition) {
        if self.modes != (CONTROL_POSITION, INPUT_PASSTHROUGH) {
            return;
        }
        let period_s = self.now.since_s(self.input_at).clamp(REACHED_S, EXTRAPOLATE_S);
        let ahead_turns = f64::from(input.velocity_mturns_s) * 1e-3 * period_s;
        let to_rad = self.link_rad(f64::from(input.position_turns) + ahead_turns);
        self.controller.set_target(self.now, to_rad, period_s);
        let OdriveParameters { gear_ratio, sign, .. } = self.parameters;
        self.controller.offsets.torque_nm = f64::from(input.torque_mnm) * 1e-3 * gear_ratio * sign;
    }

    /// Moves the mechanics up to the last whole step before `now`.
    fn move_on(&mut self, now: Nanos) {
        let dt_s = self.mechanics.step_s();
        let plant = self.parameters.plant;
        let limit_rad_s = f64::from(self.velocity_limit_turns_s) * TAU / self.parameters.gear_ratio;
        let slowed =
            PlantParameters { speed_rad_s_max: plant.speed_rad_s_max.min(limit_rad_s.abs()), ..plant };
        for at in self.mechanics.due(now) {
            let read = (self.mechanics.read_rad(0.0), self.mechanics.plant.velocity_rad_s);
            let torque_nm =
                if self.is_enabled() { self.controller.step(at, dt_s, read, &slowed) } else { 0.0 };
            self.mechanics.plant.step(torque_nm, dt_s);
        }
    }

    fn turns_a_rad(&self) -> f64 {
        self.parameters.sign * self.parameters.gear_ratio / TAU
    }

    fn turns(&self, ahead_s: f64) -> f64 {
        let link_rad = self.mechanics.read_rad(ahead_s);
        (link_rad - self.parameters.zero_offset_rad) * self.turns_a_rad() - self.shift_turns
    }

    fn link_rad(&self, turns: f64) -> f64 {
        (turns + self.shift_turns) / self.turns_a_rad() + self.parameters.zero_offset_rad
    }

    fn endpoint(&self, endpoint: u16) -> Option<EndpointValue> {
        let Endpoints { watchdog_timeout, enable_watchdog, velocity_limit } = self.parameters.endpoints;
        let (timeout_s, enabled) = self.watchdog;
        match endpoint {
            _ if endpoint == watchdog_timeout => Some(EndpointValue::Word(timeout_s.to_le_bytes())),
            _ if endpoint == enable_watchdog => Some(EndpointValue::Byte(u8::from(enabled))),
            _ if endpoint == velocity_limit => {
                Some(EndpointValue::Word(self.velocity_limit_turns_s.to_le_bytes()))
            }
            _ => None,
        }
    }

    fn write(&mut self, endpoint: u16, value: EndpointValue) {
        let Endpoints { watchdog_timeout, enable_watchdog, velocity_limit } = self.parameters.endpoints;
        match value {
            EndpointValue::Word(word) if endpoint == watchdog_timeout => {
                self.watchdog.0 = f32::from_le_bytes(word);
            }
            EndpointValue::Byte(byte) if endpoint == enable_watchdog => self.watchdog.1 = byte != 0,
            EndpointValue::Word(word) if endpoint == velocity_limit => {
                self.velocity_limit_turns_s = f32::from_le_bytes(word);
            }
            EndpointValue::Word(_) | EndpointValue::Byte(_) => {}
        }
    }

    fn answer(&self, query: Query) -> Message {
        match query {
            Query::Version => Message::Version(self.parameters.version),
            Query::Heartbeat => self.heartbeat(),
            Query::Error => Message::Error { active: self.errors, disarmed: self.disarmed },
            Query::Estimates => self.estimates(),
        }
    }

    const fn heartbeat(&self) -> Message {
        Message::Heartbeat { errors: self.errors, state: self.state, result: 0, done: true }
    }

    fn estimates(&self) -> Message {
        let turns = self.turns(self.mechanics.ahead_s(self.now));
        let turns_s = self.mechanics.plant.velocity_rad_s * self.turns_a_rad();
        #[expect(clippy::cast_possible_truncation, reason = "the frame has this width")]
        let (position_turns, velocity_turns_s) = (turns as f32, turns_s as f32);
        Message::Estimates { position_turns, velocity_turns_s }
    }

    fn message(&self, message: Message) -> CanFrame {
        message.encode(self.parameters.node_id)
    }
}
