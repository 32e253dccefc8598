//! The modes of operation of a simulated drive beside cyclic synchronous position: profile position, profile velocity and
//! homing, as far as common masters use them.
//!
//! Source: CiA 402-2, "Profile position mode", "Profile velocity mode", "Homing mode".
use super::controller::{Goal, ProfileLimits};
use super::drive::Drive;
use super::drive_motion::{counts, whole};
use super::power::PowerState;
use crate::codec::object::MODE_CSP;

/// Profile position.
pub(super) const PROFILE_POSITION: i64 = 1;
/// Profile velocity.
pub(super) const PROFILE_VELOCITY: i64 = 3;
/// Homing.
pub(super) const HOMING: i64 = 6;
/// Interpolated position.
const INTERPOLATED: i64 = 7;
/// Every mode that there is, and none.
pub(super) const MODES: &[i64] = &[0, PROFILE_POSITION, PROFILE_VELOCITY, HOMING, INTERPOLATED, 8];
/// What 0x6502 says: bit `mode - 1`.
pub(super) const SUPPORTED: i64 = 1 | 1 << 2 | 1 << 5 | 1 << 6 | 1 << 7;
/// The homing methods that there are: none; on limit switches with (1, 2) and without (17, 18) the index pulse; on the index
/// pulse (33, 34); at the present position (35, 37).
pub(super) const HOMING_METHODS: &[i64] = &[0, 1, 2, 17, 18, 33, 34, 35, 37];

/// Controlword bits of the modes.
const BIT_4: i64 = 0x10;
const CHANGE_AT_ONCE: i64 = 0x20;
const RELATIVE: i64 = 0x40;
/// Speed below which the motor stands, counts/s over counts/rad.
const STANDSTILL_RAD_S: f64 = 0.005;

/// Where a homing is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Homing {
    /// Not begun, or interrupted.
    #[default]
    Idle,
    /// Towards the limit switch.
    ToSwitch,
    /// Off the limit switch again.
    OffSwitch,
    /// To the index pulse from this motor revolution on.
    ToIndex(i64),
    /// Done.
    Attained,
    /// Not possible.
    Failed,
}

/// What the modes remember.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ModeState {
    mode: i64,
    bit_4: bool,
    /// The new setpoint was taken (bit 12 of profile position).
    acknowledged: bool,
    target: Option<i64>,
    /// The setpoint after that.
    next: Option<i64>,
    homing: Homing,
}

impl Drive {
    /// Carries out the mode's part of the controlword, for every mode but cyclic synchronous position.
    pub(super) fn run_mode(&mut self, word: i64) {
        let mode = self.dictionary.get(0x6060, 0);
        let rises = word & BIT_4 != 0 && !self.modes.bit_4;
        if mode != self.modes.mode {
            self.controller.hold();
            self.modes = ModeState { mode, ..ModeState::default() };
        }
        self.modes.bit_4 = word & BIT_4 != 0;
        let enabled =
            self.power.state() == PowerState::OperationEnabled && !self.power.is_slowing() && !self.halted;
        if !enabled {
            if !self.halted {
                let homing =
                    if self.modes.homing == Homing::Attained { Homing::Attained } else { Homing::Idle };
                let bit_4 = self.modes.bit_4;
                self.modes = ModeState { mode, bit_4, homing, ..ModeState::default() };
            }
            return;
        }
        match mode {
            PROFILE_POSITION => self.profile_position(word, rises),
            PROFILE_VELOCITY => {
                let limit = self.dictionary.get(0x607F, 0);
                let wanted = self.dictionary.get(0x60FF, 0).clamp(-limit, limit);
                let speed_rad_s = whole(wanted) / self.parameters.counts_per_rad();
                self.controller.go(Goal::Velocity(speed_rad_s), self.profile_limits());
            }
            HOMING if rises => self.begin_homing(),
            HOMING if word & BIT_4 == 0 && self.is_homing() => {
                self.controller.hold();
                self.modes.homing = Homing::Idle;
            }
            _ => {}
        }
    }

    /// Continues what goes on by itself: the next setpoint, and homing.
    pub(super) fn continue_mode(&mut self) {
        if self.power.state() != PowerState::OperationEnabled {
            return;
        }
        if let Some(next) = self.modes.next.filter(|_| self.arrived()) {
            self.modes.next = None;
            self.begin_setpoint(next);
        }
        self.continue_homing();
    }

    fn profile_position(&mut self, word: i64, rises: bool) {
        if rises {
            let given = self.dictionary.get(0x607A, 0);
            let from = if word & RELATIVE == 0 {
                0
            } else {
                self.modes.target.unwrap_or(i64::from(self.counts(0.0)))
            };
            let wanted = from.saturating_add(given);
            let (low, high) = (self.dictionary.get(0x607D, 1), self.dictionary.get(0x607D, 2));
            let target = wanted.max(low).min(high);
            self.limited = target != wanted;
            self.modes.acknowledged = true;
            if word & CHANGE_AT_ONCE != 0 || self.modes.target.is_none() || self.arrived() {
                self.modes.next = None;
                self.begin_setpoint(target);
            } else {
                self.modes.next = Some(target);
            }
        } else if word & BIT_4 == 0 && self.modes.next.is_none() {
            self.modes.acknowledged = false;
        }
        // After a halt the motor goes on to where it was going.
        if self.controller.is_following()
            && let Some(target) = self.modes.target
            && !self.arrived()
        {
            self.begin_setpoint(target);
        }
    }

    fn begin_setpoint(&mut self, target: i64) {
        self.modes.target = Some(target);
        let target_rad = self.rad(whole(target));
        self.controller.go(Goal::Position(target_rad), self.profile_limits());
    }

    /// The profile has ended, and the motor is where it was sent.
    fn arrived(&self) -> bool {
        let window = self.dictionary.get(0x6067, 0).max(1);
        let target = self.modes.target.unwrap_or(0);
        let reference = i64::from(counts(self, self.controller.reference_rad()));
        (reference - target).abs() <= 1 && (i64::from(self.counts(0.0)) - target).abs() <= window
    }

    fn profile_limits(&self) -> ProfileLimits {
        let of = |index| whole(self.dictionary.get(index, 0)) / self.parameters.counts_per_rad().abs();
        ProfileLimits {
            speed_rad_s: of(0x6081).min(of(0x607F)),
            acceleration_rad_s2: of(0x6083),
            deceleration_rad_s2: of(0x6084),
        }
    }

    /// With speed 1 (to the switch) or 2 (to the zero) of 0x6099.
    fn home_at(&mut self, sub: u8, positive: bool) {
        let per_rad = self.parameters.counts_per_rad();
        let speed = whole(self.dictionary.get(0x6099, sub)) * if positive { 1.0 } else { -1.0 };
        let acceleration_rad_s2 = (whole(self.dictionary.get(0x609A, 0)) / per_rad).abs();
        let limits = ProfileLimits {
            speed_rad_s: (speed / per_rad).abs(),
            acceleration_rad_s2,
            deceleration_rad_s2: acceleration_rad_s2,
        };
        self.controller.go(Goal::Velocity(speed / per_rad), limits);
    }

    fn is_homing(&self) -> bool {
        matches!(self.modes.homing, Homing::ToSwitch | Homing::OffSwitch | Homing::ToIndex(_))
    }

    /// The method's direction towards its switch or index pulse, and whether it uses each.
    fn method(&self) -> (bool, bool, bool) {
        let method = self.dictionary.get(0x6098, 0);
        (matches!(method, 2 | 18 | 34), matches!(method, 1 | 2 | 17 | 18), matches!(method, 1 | 2 | 33 | 34))
    }

    fn begin_homing(&mut self) {
        let (positive, by_switch, by_index) = self.method();
        self.modes.homing = match self.dictionary.get(0x6098, 0) {
            35 | 37 => return self.attain(),
            _ if by_switch => {
                self.home_at(1, positive);
                Homing::ToSwitch
            }
            _ if by_index => {
                self.home_at(2, positive);
                Homing::ToIndex(self.revolution())
            }
            _ => Homing::Failed,
        };
    }

    fn continue_homing(&mut self) {
        let (positive, _, by_index) = self.method();
        match self.modes.homing {
            Homing::ToSwitch if self.on_switch(positive) => {
                self.home_at(2, !positive);
                self.modes.homing = Homing::OffSwitch;
            }
            Homing::OffSwitch if !self.on_switch(positive) => {
                if by_index {
                    self.modes.homing = Homing::ToIndex(self.revolution());
                } else {
                    self.attain();
                }
            }
            Homing::ToIndex(from) if self.revolution() != from => self.attain(),
            Homing::ToSwitch
            | Homing::OffSwitch
            | Homing::ToIndex(_)
            | Homing::Idle
            | Homing::Attained
            | Homing::Failed => {}
        }
    }

    /// The position is that of the home position now: by CiA 402 the home offset.
    fn attain(&mut self) {
        let here_rad = self.mechanics.read_rad(0.0);
        let offset_rad = whole(self.dictionary.get(0x607C, 0)) / self.parameters.counts_per_rad();
        self.parameters.zero_offset_rad = here_rad - offset_rad;
        self.controller.hold();
        self.modes.homing = Homing::Attained;
    }

    /// Whole motor revolutions, by the encoder's own zero.
    fn revolution(&self) -> i64 {
        let shipped = &self.shipped_parameters;
        let turned = (self.mechanics.read_rad(0.0) - shipped.zero_offset_rad) * shipped.counts_per_rad();
        #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
        let revolution = (turned / shipped.counts_per_rev).floor() as i64;
        revolution
    }

    /// On the limit switch at this end of the joint, in the drive's direction.
    fn on_switch(&self, positive: bool) -> bool {
        let [low_rad, high_rad] = self.parameters.soft_limit_rad;
        let position_rad = self.mechanics.plant.position_rad;
        if positive == (self.parameters.sign > 0.0) {
            position_rad >= high_rad
        } else {
            position_rad <= low_rad
        }
    }

    /// Digital inputs (0x60FD): bit 0 negative and bit 1 positive limit switch.
    pub(super) fn digital_inputs(&self) -> i64 {
        i64::from(self.on_switch(false))
            | i64::from(self.on_switch(true)) << 1
            | i64::from(self.forced_inputs)
    }

    /// The bits of the statusword that belong to the mode: 10, 12 and 13.
    pub(super) fn mode_bits(&self) -> u16 {
        let stands = self.mechanics.plant.velocity_rad_s.abs() < STANDSTILL_RAD_S;
        let enabled = self.power.state() == PowerState::OperationEnabled;
        let astray = self.astray.is_some();
        let (bit_10, bit_12, bit_13) = match self.dictionary.get(0x6060, 0) {
            PROFILE_POSITION => {
                let arrived = self.modes.target.is_some() && self.modes.next.is_none() && self.arrived();
                (enabled && if self.halted { stands } else { arrived }, self.modes.acknowledged, astray)
            }
            PROFILE_VELOCITY => {
                let wanted_rad_s = whole(self.dictionary.get(0x60FF, 0)) / self.parameters.counts_per_rad();
                let reached =
                    (self.mechanics.plant.velocity_rad_s - wanted_rad_s).abs() < 2.0 * STANDSTILL_RAD_S;
                (enabled && if self.halted { stands } else { reached }, stands, astray)
            }
            HOMING => (
                enabled && stands && !self.is_homing(),
                self.modes.homing == Homing::Attained,
                self.modes.homing == Homing::Failed || astray,
            ),
            _ => (false, self.follows_target(), astray),
        };
        u16::from(bit_10) << 10 | u16::from(bit_12) << 12 | u16::from(bit_13) << 13
    }

    /// A mode may be left at standstill, or while the motor has no torque.
    pub(super) fn may_leave_mode(&self, next: i64) -> bool {
        let stands = self.mechanics.plant.velocity_rad_s.abs() < STANDSTILL_RAD_S;
        !self.power.is_energised() || (next != 0 && stands)
    }

    /// Target of the mode that follows cyclic setpoints now: in interpolated position only while bit 4 of the controlword is set.
    pub(super) fn cyclic_target(&self) -> Option<i64> {
        let mode = self.dictionary.get(0x6060, 0);
        if mode == i64::from(MODE_CSP) {
            Some(self.dictionary.get(0x607A, 0).saturating_add(self.dictionary.get(0x60B0, 0)))
        } else {
            (mode == INTERPOLATED && self.modes.bit_4).then(|| self.dictionary.get(0x60C1, 1))
        }
    }

    /// The modes begin anew, as after a fault or without torque.
    pub(super) fn forget_modes(&mut self) {
        self.modes = ModeState::default();
    }

    /// Torque limit of 0x6072, of which 1000 is what the motor gives.
    pub(super) fn torque_limit_nm(&self) -> f64 {
        let share = whole(self.dictionary.get(0x6072, 0)) * 1e-3;
        self.parameters.plant.torque_nm_max * share.min(1.0)
    }
}
