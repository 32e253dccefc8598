//! One simulated CiA 402 drive: frames and time in, frames out.
//!
//! No I/O and no clock: the same frames at the same times give the same answers, bit by bit. The drive knows one bus
//! and one motor; faults of the wiring (silence, delay, loss) belong to the simulator.
//!
//! At a SYNC the drive first samples and sends its TPDOs, then applies the RPDOs that came since the last SYNC: a
//! setpoint acts from the SYNC after it, and feedback shows the state before it.
use super::controller::{Controller, LoopParameters};
use super::dictionary::Dictionary;
use super::disturbance::Disturbance;
use super::lss::Lss;
use super::mechanics::Mechanics;
use super::modes::ModeState;
use super::network::{Consumers, Errors, Nmt};
use super::pdo::{Pdos, Received};
use super::plant::PlantParameters;
use super::power::{Power, PowerState};
use super::quirks::{DriveQuirks, QuirkState};
use super::sdo_block::{self, BlockUpload};
use super::sdo_server::{SdoServer, TIMEOUT_S};
use crate::codec::canopen::{NmtCommand, decode_sync};
use crate::codec::{Emcy, Nmt as NmtFrame, NmtState, SdoResponse, emcy, error_text};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use taustream_arm::{BrakeSettings, Reaction};

/// What a simulated drive is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveParameters {
    /// Node id, 1 to 127.
    pub node_id: u8,
    /// Motor direction against link direction, +1.0 or -1.0.
    pub sign: f64,
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
    /// Encoder counts a motor revolution.
    pub counts_per_rev: f64,
    /// Link angle at encoder count 0.
    pub zero_offset_rad: f64,
    /// Its home offset (0x607C), which that angle includes, counts.
    pub home_offset_counts: i32,
    /// It skips a part of an RPDO that a dummy entry of its mapping names.
    pub dummy_mapping: bool,
    /// Link angle at power-up.
    pub start_rad: f64,
    /// Mechanics.
    pub plant: PlantParameters,
    /// Control.
    pub loops: LoopParameters,
    /// Following error window (0x6065).
    pub following_window_rad: f64,
    /// How long the window may be left (0x6066), at most 65535.
    pub following_timeout_ms: u16,
    /// Soft limits (0x607D): setpoints beyond them are cut off.
    pub soft_limit_rad: [f64; 2],
    /// Profile deceleration (0x6084).
    pub slow_rad_s2: f64,
    /// Quick stop deceleration (0x6085).
    pub quick_rad_s2: f64,
    /// Time without setpoints after which the watchdog reacts while energised; 0 is never.
    pub watchdog_ms: u16,
    /// How it reacts: `Hold` says so (EMCY 0x8250, warning bit) and holds the last setpoint, following again when
    /// setpoints return; `Ramp` is the fault reaction 0x605E, as shipped a ramp and then no torque; `Limp` removes the torque.
    pub reaction: Reaction,
    /// Time from power-up, or a reset, to the boot-up message.
    pub boot_s: f64,
    /// Step of the simulated mechanics, 10,000 to 1,000,000 ns.
    pub step_ns: u64,
    /// The brake that its master works; `None`: it follows the torque.
    pub brake: Option<BrakeSettings>,
    /// Rated torque of its motor (0x6076), at the link; `None`: what the motor gives, and 0x6076 states it at the link.
    pub rated_nm: Option<f64>,
    /// What it does otherwise than masters expect.
    pub quirks: DriveQuirks,
}

impl DriveParameters {
    /// The torque at the link of which its objects state thousandths.
    pub(super) fn unit_nm(&self) -> f64 {
        self.rated_nm.unwrap_or(self.plant.torque_nm_max)
    }
    /// What 0x6076 states, Nm.
    pub(super) fn stated_rated_nm(&self) -> f64 {
        self.rated_nm.map_or(self.plant.torque_nm_max, |rated_nm| rated_nm / self.gear_ratio)
    }
}

/// A simulated drive.
#[derive(Clone, Debug)]
pub struct Drive {
    pub(super) parameters: DriveParameters,
    /// The parameters before its objects were changed.
    pub(super) shipped_parameters: DriveParameters,
    pub(super) dictionary: Dictionary,
    pub(super) sdo: SdoServer,
    pub(super) pdos: Pdos,
    pub(super) nmt: Nmt,
    pub(super) consumers: Consumers,
    pub(super) errors: Errors,
    pub(super) power: Power,
    pub(super) controller: Controller,
    pub(super) mechanics: Mechanics,
    /// Time of the newest call.
    pub(super) now: Nanos,
    /// When setpoints were last applied at a SYNC, while the watchdog is armed.
    pub(super) fed: Option<Nanos>,
    /// The watchdog holds the last setpoint.
    pub(super) held: bool,
    /// The halt bit is stopping or holding the motor.
    pub(super) halted: bool,
    /// The newest setpoint was cut off at a soft limit.
    pub(super) limited: bool,
    /// Since when the following error is outside its window.
    pub(super) astray: Option<Nanos>,
    /// Since when the reference of a ramp rests.
    pub(super) resting: Option<Nanos>,
    /// When the joint was last seen moving after that.
    pub(super) moving: Nanos,
    pub(super) warning: bool,
    pub(super) refuse_writes: u32,
    /// Digital inputs that are active on request.
    pub(super) forced_inputs: u8,
    pub(super) quirks: QuirkState,
    pub(super) modes: ModeState,
    pub(super) block: Option<BlockUpload>,
    pub(super) lss: Lss,
}

/// Emergency code for a connection that was ended by command, not lost.
const EMCY_COMMUNICATION: u16 = 0x8100;
/// Emergency code for a SYNC whose length does not fit object 0x1019.
const EMCY_SYNC_LENGTH: u16 = 0x8240;
/// Object that says whether SYNC carries a counter.
const SYNC_COUNTER: u16 = 0x1019;

impl Drive {
    /// A drive that powers up at the first call of [`Self::advance`].
    #[must_use]
    pub fn new(parameters: DriveParameters) -> Self {
        let dictionary = Self::shipped(&parameters);
        Self {
            pdos: Pdos::compile(&dictionary),
            dictionary,
            sdo: SdoServer::default(),
            nmt: Nmt::new(),
            consumers: Consumers::default(),
            errors: Errors::default(),
            power: Power::new(),
            controller: Controller::new(parameters.loops),
            mechanics: Mechanics::new(parameters.plant, parameters.start_rad, parameters.step_ns),
            now: Nanos(0),
            fed: None,
            held: false,
            halted: false,
            limited: false,
            astray: None,
            resting: None,
            moving: Nanos(0),
            warning: false,
            refuse_writes: 0,
            forced_inputs: 0,
            quirks: QuirkState::default(),
            modes: ModeState::default(),
            block: None,
            lss: Lss::default(),
            parameters,
            shipped_parameters: parameters,
        }
    }

    /// Lets time pass up to `now`, and pushes what the drive sends by itself.
    pub fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        self.now = now;
        self.move_on(now);
        if self.nmt.boot(now, self.parameters.boot_s) {
            self.power.boot();
            out.push(NmtState::BootUp.encode(self.parameters.node_id));
        }
        if self.nmt.state() == NmtState::BootUp {
            return;
        }
        if self.has_switched_on(now) {
            self.commanded(now, out);
        }
        self.send_late_answers(now, out);
        self.supervise(now, out);
        if let Some(abort) = self.sdo.expire(now) {
            out.push(abort.encode(self.parameters.node_id));
        }
        if let Some(upload) = self.block.take_if(|upload| now.since_s(upload.newest) > TIMEOUT_S) {
            let abort = SdoResponse::Abort(upload.address(), error_text::ABORT_TIMEOUT);
            out.push(abort.encode(self.parameters.node_id));
        }
        self.continue_mode();
        if self.nmt.state() == NmtState::Operational {
            self.publish();
            self.pdos.on_event(now, &self.dictionary, out);
        }
        let period_ms = self.dictionary.get(0x1017, 0);
        out.extend(self.nmt.heartbeat(now, self.parameters.node_id, period_ms));
    }

    /// Takes a frame from the bus and pushes the answers. Frames for others, and malformed ones, change nothing.
    pub fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if now > self.now || self.mechanics.moved.is_none() {
            self.advance(now, out);
        }
        if self.nmt.state() == NmtState::BootUp || frame.is_fd() {
            return; // Still deaf, or a frame that a classic controller would not even acknowledge.
        }
        if let Some(command) = NmtFrame::decode(frame) {
            if command.node == 0 || command.node == self.parameters.node_id {
                self.apply(command.command, out);
            }
            return;
        }
        if let Some((node, _)) = NmtState::decode(frame) {
            self.consumers.received(now, node);
            return;
        }
        let identity = [1, 2, 3, 4].map(|sub| u32::try_from(self.dictionary.get(0x1018, sub)).unwrap_or(0));
        out.extend(self.lss.answer(identity, self.parameters.node_id, frame));
        self.converse(now, frame, out);
        if self.nmt.state() == NmtState::Operational {
            self.exchange(now, frame, out);
        }
    }

    /// Puts a fault into the drive.
    pub fn disturb(&mut self, disturbance: Disturbance, out: &mut Vec<CanFrame>) {
        match disturbance {
            Disturbance::Fault(code) => self.fail(code, out),
            Disturbance::Jammed(jammed) => self.mechanics.plant.jammed = jammed,
            Disturbance::Object(at_rad) => self.mechanics.plant.place_object(at_rad),
            Disturbance::EncoderShift(shift_rad) => self.mechanics.encoder_shift_rad = shift_rad,
            Disturbance::Warning(warning) => self.warning = warning,
            Disturbance::RefuseWrites(code) => self.refuse_writes = code,
            Disturbance::Inputs(inputs) => self.forced_inputs = inputs,
            Disturbance::Restart => self.restart(false),
        }
    }

    /// Node id.
    #[must_use]
    pub fn node_id(&self) -> u8 {
        self.parameters.node_id
    }

    /// State of its power drive system.
    #[must_use]
    pub fn power_state(&self) -> PowerState {
        self.power.state()
    }

    /// Its mode of operation (0x6060).
    #[must_use]
    pub fn mode(&self) -> i64 {
        self.dictionary.get(0x6060, 0)
    }

    /// Its position as it states it (0x6064), counts.
    #[must_use]
    pub fn counted(&self) -> i32 {
        self.counts(0.0)
    }

    /// Communication state.
    #[must_use]
    pub fn network_state(&self) -> NmtState {
        self.nmt.state()
    }

    /// True angle of the link, which no encoder fault can bend.
    #[must_use]
    pub fn position_rad(&self) -> f64 {
        self.mechanics.plant.position_rad
    }

    /// True angular velocity of the link.
    #[must_use]
    pub fn velocity_rad_s(&self) -> f64 {
        self.mechanics.plant.velocity_rad_s
    }

    /// Angle that the drive is steering to now, between two setpoints.
    #[must_use]
    pub fn reference_rad(&self) -> f64 {
        self.controller.reference_rad()
    }

    /// NMT commands, with the drive's reaction to losing its master (0x6007).
    fn apply(&mut self, command: NmtCommand, out: &mut Vec<CanFrame>) {
        let was_operational = self.nmt.state() == NmtState::Operational;
        match command {
            NmtCommand::Start => {
                if !was_operational {
                    self.pdos.drop_latched();
                }
                self.nmt.set(NmtState::Operational);
            }
            NmtCommand::Stop | NmtCommand::PreOperational => {
                if was_operational {
                    self.lose_connection(EMCY_COMMUNICATION, out);
                }
                let next =
                    if command == NmtCommand::Stop { NmtState::Stopped } else { NmtState::PreOperational };
                self.nmt.set(next);
            }
            NmtCommand::ResetNode => self.restart(false),
            NmtCommand::ResetCommunication => {
                if was_operational {
                    self.lose_connection(EMCY_COMMUNICATION, out);
                }
                self.restart(true);
            }
        }
        if self.nmt.state() != NmtState::Operational {
            self.pdos.drop_latched();
            self.fed = None;
        }
    }

    /// A reset of the communication part, or of the whole node; the latter drops the torque.
    fn restart(&mut self, communication_only: bool) {
        if !communication_only {
            let action = self.power.reset();
            self.perform(action);
            (self.held, self.halted, self.limited, self.astray) = (false, false, false, None);
            self.errors = Errors::default();
            self.forget_modes();
        }
        self.forget_quirks(communication_only);
        self.dictionary.reset(communication_only);
        self.work_brake();
        self.readdress();
        self.pdos = Pdos::compile(&self.dictionary);
        self.watch_heartbeats();
        self.sdo.reset();
        self.fed = None;
        self.nmt = Nmt::new();
    }

    /// Takes the node id that layer setting services have given it.
    fn readdress(&mut self) {
        self.block = None;
        if let Some(node_id) = self.lss.node_id {
            self.dictionary.readdress(self.parameters.node_id, node_id);
            (self.parameters.node_id, self.shipped_parameters.node_id) = (node_id, node_id);
        }
    }

    /// SDO requests, answered in pre-operational and operational.
    fn converse(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if self.nmt.state() == NmtState::Stopped {
            return;
        }
        // Server and block are lent out for the call, because they read and write the rest of the drive.
        let (mut server, mut block) = (std::mem::take(&mut self.sdo), self.block.take());
        let at = (now, self.parameters.node_id);
        let mut blocks = Vec::new();
        let mut session = super::drive_objects::Session { drive: self, out };
        if sdo_block::answer(&mut block, at, frame, &mut session, &mut blocks) {
            (self.sdo, self.block) = (SdoServer::default(), block);
            out.append(&mut blocks);
            return;
        }
        let mut session = super::drive_objects::Session { drive: self, out };
        let answer = server.answer(now, session.drive.parameters.node_id, frame, &mut session);
        self.sdo = server;
        // Any other request ends a block.
        self.block = block.filter(|_| answer.is_none());
        if let Some(answer) = answer {
            self.send_answer(now, answer, out);
        }
    }

    /// SYNC and RPDOs.
    fn exchange(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if let Some(counter) = decode_sync(frame) {
            let counts = self.dictionary.get(SYNC_COUNTER, 0) != 0;
            if counts == counter.is_some() {
                self.on_sync(now, counter, out);
            } else if self.errors.code() != EMCY_SYNC_LENGTH {
                self.report(EMCY_SYNC_LENGTH, out);
            }
            return;
        }
        match self.pdos.receive(now, frame) {
            Received::NotMine | Received::Latched | Received::TooShort(false) => {}
            Received::Now(n) => {
                let dictionary = &mut self.dictionary;
                self.pdos.apply_now(n, |address, value| dictionary.take(address, value));
                self.commanded(now, out);
            }
            Received::TooShort(true) => self.report(emcy::PDO_LENGTH, out),
        }
    }

    fn on_sync(&mut self, now: Nanos, counter: Option<u8>, out: &mut Vec<CanFrame>) {
        self.publish();
        self.pdos.on_sync(now, counter, &self.dictionary, out);
        let dictionary = &mut self.dictionary;
        if self.pdos.apply_latched(|address, value| dictionary.take(address, value)) {
            self.fed = Some(now);
            self.commanded(now, out);
        }
    }

    /// Enters an error and sends its emergency message (CiA 301: not while stopped).
    pub(super) fn report(&mut self, code: u16, out: &mut Vec<CanFrame>) {
        let message = self.errors.raise(code);
        self.send_emergency(message, out);
    }

    pub(super) fn send_emergency(&mut self, message: Emcy, out: &mut Vec<CanFrame>) {
        if matches!(self.nmt.state(), NmtState::PreOperational | NmtState::Operational) {
            out.push(message.encode(self.parameters.node_id));
        }
    }
}
