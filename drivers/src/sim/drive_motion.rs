//! What a simulated drive does with its motor: commands carried out, faults found, time passed on to the mechanics.
use super::drive::Drive;
use super::plant::PlantParameters;
use super::power::{Action, Options, PowerState, Slowing};
use crate::codec::{NmtState, emcy};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use taustream_arm::Reaction;

/// A ramp has ended when the joint was slower than this for a while: one that only turns round is not at rest.
const STANDSTILL_RAD_S: f64 = 0.01;
/// That while.
const SLOW_S: f64 = 0.01;
/// How long a joint may creep after its reference rests: a jammed or overloaded one must not keep a fault waiting.
const STANDSTILL_S: f64 = 0.5;
/// Controlword bit 8.
const HALT: i64 = 0x100;

impl Drive {
    /// Moves the mechanics up to the last whole step before `now`.
    pub(super) fn move_on(&mut self, now: Nanos) {
        let dt_s = self.mechanics.step_s();
        let limited = PlantParameters { torque_nm_max: self.torque_limit_nm(), ..self.parameters.plant };
        for at in self.mechanics.due(now) {
            let measured = (self.measured_rad(0.0), self.mechanics.plant.velocity_rad_s);
            let torque_nm = self.controller.step(at, dt_s, measured, &limited);
            self.mechanics.plant.step(torque_nm, dt_s);
        }
    }

    /// The encoder, which sees whole counts, `ahead_s` after the last whole step.
    pub(super) fn counts(&self, ahead_s: f64) -> i32 {
        counts(self, self.mechanics.read_rad(ahead_s))
    }

    /// Link angle as the encoder says.
    pub(super) fn measured_rad(&self, ahead_s: f64) -> f64 {
        self.rad(f64::from(self.counts(ahead_s)))
    }

    /// Link angle of a count.
    pub(super) fn rad(&self, counts: f64) -> f64 {
        counts / self.parameters.counts_per_rad() + self.parameters.zero_offset_rad
    }

    /// Carries out the controlword and the setpoint as they stand in the dictionary.
    pub(super) fn commanded(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        let word = self.dictionary.get(0x6040, 0);
        let before = self.power.state();
        let acting = self.acting_controlword(now, u16::try_from(word).unwrap_or(0));
        let action = self.power.command(acting, &self.options());
        self.perform(action);
        if before == PowerState::Fault && self.power.state() != PowerState::Fault {
            (self.held, self.astray) = (false, None);
            if let Some(message) = self.errors.reset() {
                self.send_emergency(message, out);
            }
        }
        if self.held {
            // Setpoints are back after the watchdog had let the drive hold.
            self.held = false;
            if let Some(message) = self.errors.reset() {
                self.send_emergency(message, out);
            }
        }
        self.halt(word & HALT != 0);
        self.run_mode(word);
        if let Some(wanted) = self.cyclic_target() {
            self.target_source(now, wanted);
        }
    }

    /// Gives the newest setpoint to the controller, when the drive follows setpoints now.
    fn target_source(&mut self, now: Nanos, wanted: i64) {
        let (low, high) = (self.dictionary.get(0x607D, 1), self.dictionary.get(0x607D, 2));
        let mut target = wanted.max(low).min(high);
        self.limited = target != wanted;
        if !self.follows_target() {
            return;
        }
        let exponent = i32::try_from(self.dictionary.get(0x60C2, 2)).unwrap_or(-3);
        let periods = f64::from(u8::try_from(self.dictionary.get(0x60C2, 1)).unwrap_or(1));
        let period_s = periods * 10_f64.powi(exponent);
        target = self.within_speed(target, period_s);
        self.limited |= target != wanted;
        let offsets = &mut self.controller.offsets;
        offsets.velocity_rad_s = whole(self.dictionary.get(0x60B1, 0)) / self.parameters.counts_per_rad();
        offsets.torque_nm =
            whole(self.dictionary.get(0x60B2, 0)) * 1e-3 * self.parameters.unit_nm() * self.parameters.sign;
        let target_rad = self.rad(whole(target));
        self.controller.set_target(now, target_rad, period_s);
    }

    /// Statusword bit 12: the motor follows the setpoints. Not before the brake has opened.
    pub(super) fn follows_target(&self) -> bool {
        self.power.state() == PowerState::OperationEnabled
            && self.controller.is_following()
            && (self.parameters.brake.is_some() || self.mechanics.plant.is_free())
            && !self.held
            && self.cyclic_target().is_some()
    }

    /// The halt bit stops the motor, and releases it to follow again.
    fn halt(&mut self, halt: bool) {
        if self.power.state() != PowerState::OperationEnabled || self.power.is_slowing() {
            self.halted = false;
        } else if halt && !self.halted {
            let slowing = match self.dictionary.get(0x605D, 0) {
                1 => Slowing::Slow,
                2 => Slowing::Quick,
                _ => Slowing::Strongest,
            };
            self.perform(Action::SlowDown(slowing));
            self.halted = true;
        } else if !halt && self.halted {
            self.perform(Action::Follow);
            self.halted = false;
        }
    }

    /// Does what the state machine decided.
    pub(super) fn perform(&mut self, action: Action) {
        match action {
            Action::Continue => {}
            Action::Energise => {
                self.mechanics.plant.energise(true);
                self.controller.energise(self.measured_rad(0.0));
                self.astray = None;
                self.halted = false;
            }
            Action::Follow => {
                self.mechanics.plant.energise(true); // A brake that was closing opens again.
                self.controller.follow();
            }
            Action::SlowDown(slowing) => {
                let measured = (self.measured_rad(0.0), self.mechanics.plant.velocity_rad_s);
                self.controller.slow_down(self.deceleration_rad_s2(slowing), measured);
                self.resting = None;
            }
            Action::Release => {
                self.controller.release();
                self.mechanics.plant.energise(false);
                self.halted = false;
                self.resting = None;
            }
        }
        self.work_brake();
    }

    /// Moves the brake that the master works to where the outputs have it: released only by an output that is its own.
    pub(super) fn work_brake(&mut self) {
        if let Some(brake) = &self.parameters.brake {
            let bit = i64::from(brake.mask());
            let released = self.dictionary.get(0x60FE, 2) & bit != 0
                && self.dictionary.get(0x60FE, 1) & bit == i64::from(brake.output(true));
            self.mechanics.plant.shut_brake(!released);
        }
    }

    /// Looks for faults, and for the end of a ramp.
    pub(super) fn supervise(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        if self.controller.has_stopped() && self.power.is_slowing() {
            self.settle(now);
        }
        if self.consumers.lost(now).is_some() {
            self.report(emcy::HEARTBEAT, out);
            self.lose_connection(emcy::HEARTBEAT, out);
            // 0x1029: what a lost heartbeat does to the communication state.
            match (self.nmt.state(), self.dictionary.get(0x1029, 1)) {
                (NmtState::Operational, 0) => self.nmt.set(NmtState::PreOperational),
                (_, 2) => self.nmt.set(NmtState::Stopped),
                _ => {}
            }
        }
        if self.nmt.state() == NmtState::Operational {
            self.watch_setpoints(now, out);
        }
        self.watch_following(now, out);
    }

    /// Ends a ramp once the joint rests. A drive that is about to lose its torque closes the brake first.
    fn settle(&mut self, now: Nanos) {
        let resting = *self.resting.get_or_insert(now);
        if self.mechanics.plant.velocity_rad_s.abs() > STANDSTILL_RAD_S {
            self.moving = now;
        }
        let rests = now.since_s(self.moving.max(resting)) > SLOW_S || now.since_s(resting) > STANDSTILL_S;
        if !rests {
            return;
        }
        let own_brake = self.parameters.plant.brake && self.parameters.brake.is_none();
        if self.power.ends_released() && own_brake && self.mechanics.plant.is_free() {
            self.mechanics.plant.shut_brake(true);
            return;
        }
        let action = self.power.standstill();
        self.perform(action);
    }

    /// A fault: emergency message and transition 13.
    pub(super) fn fail(&mut self, code: u16, out: &mut Vec<CanFrame>) {
        if !matches!(self.power.state(), PowerState::Fault | PowerState::FaultReactionActive) {
            self.report(code, out);
            let action = self.power.fault(&self.options());
            self.perform(action);
        }
    }

    /// The master is gone, or has sent the drive away: reaction 0x6007 while energised.
    pub(super) fn lose_connection(&mut self, code: u16, out: &mut Vec<CanFrame>) {
        if !self.power.is_energised() {
            return;
        }
        match self.dictionary.get(0x6007, 0) {
            1 if self.errors.code() == code => {
                let action = self.power.fault(&self.options());
                self.perform(action);
            }
            1 => self.fail(code, out),
            option => {
                let action = self.power.abort_connection(option, &self.options());
                self.perform(action);
            }
        }
    }

    /// The drive's own watchdog over the setpoints, and the deadlines that the master set (0x14xx:05).
    fn watch_setpoints(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        let overdue = self.pdos.deadline_missed(now, &self.dictionary);
        let limit_s = whole(self.dictionary.get(0x2000, 1)) * 1e-3;
        let starved = limit_s > 0.0 && self.fed.is_some_and(|fed| now.since_s(fed) > limit_s);
        if !(overdue || starved) || !self.power.is_energised() {
            return;
        }
        self.fed = None;
        match self.dictionary.get(0x2000, 2) {
            0 => {
                self.held = true;
                self.report(emcy::RPDO_TIMEOUT, out);
            }
            1 => self.fail(emcy::RPDO_TIMEOUT, out),
            _ => {
                self.report(emcy::RPDO_TIMEOUT, out);
                let coast = Options { fault_reaction: 0, ..self.options() };
                let action = self.power.fault(&coast);
                self.perform(action);
            }
        }
    }

    /// Following error outside its window (0x6065) for longer than its time-out (0x6066).
    fn watch_following(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        /// "No supervision", CiA 402-2.
        const OFF: i64 = 0xFFFF_FFFF;
        let window = self.dictionary.get(0x6065, 0);
        let outside = self.power.is_energised() && self.following_error().abs() > window && window != OFF;
        if !outside {
            self.astray = None;
            return;
        }
        let since = *self.astray.get_or_insert(now);
        if now.since_s(since) > whole(self.dictionary.get(0x6066, 0)) * 1e-3 {
            self.fail(emcy::FOLLOWING_ERROR, out);
        }
    }

    /// Reference minus encoder, in counts; 0 while released.
    pub(super) fn following_error(&self) -> i64 {
        if !self.power.is_energised() {
            return 0;
        }
        i64::from(counts(self, self.controller.reference_rad())) - i64::from(self.counts(0.0))
    }

    /// The options that steer the state machine now.
    pub(super) fn options(&self) -> Options {
        Options {
            quick_stop: self.dictionary.get(0x605A, 0),
            shutdown: self.dictionary.get(0x605B, 0),
            disable_operation: self.dictionary.get(0x605C, 0),
            fault_reaction: self.dictionary.get(0x605E, 0),
            has_mode: self.dictionary.get(0x6060, 0) != 0,
        }
    }

    fn deceleration_rad_s2(&self, slowing: Slowing) -> f64 {
        let p = &self.parameters;
        let strongest_rad_s2 = p.plant.torque_nm_max / p.plant.inertia_kg_m2;
        let ramp = |index| (whole(self.dictionary.get(index, 0)) / p.counts_per_rad()).abs();
        match slowing {
            Slowing::Slow => ramp(0x6084).min(strongest_rad_s2),
            Slowing::Quick => ramp(0x6085).min(strongest_rad_s2),
            Slowing::Strongest => strongest_rad_s2,
        }
    }
}

/// The value that object 0x2000:02 holds for a reaction.
pub(super) const fn reaction_code(reaction: Reaction) -> i64 {
    match reaction {
        Reaction::Hold => 0,
        Reaction::Ramp => 1,
        Reaction::Limp => 2,
    }
}

/// Count of a link angle, at the ends of the encoder's range when beyond.
pub(super) fn counts(drive: &Drive, angle_rad: f64) -> i32 {
    let exact = (angle_rad - drive.parameters.zero_offset_rad) * drive.parameters.counts_per_rad();
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates, as the register does")]
    let counts = exact.round() as i32;
    counts
}

/// A 32-bit object's value as a number.
pub(super) fn whole(value: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "objects have at most 32 bits")]
    let value = value as f64;
    value
}
