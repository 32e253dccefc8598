//! The CiA 402 state machine: who may energise the motor, and how it is brought to rest.
//!
//! It decides and moves nothing: each call returns what the motor control has to do.
//! Source: CiA 402-2, power drive system state machine, transitions 0 to 16; option codes 0x605A to 0x605E.
use crate::codec::emcy;

/// State of the power drive system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerState {
    /// Initialising after power-up.
    NotReadyToSwitchOn,
    /// Initialised, high power may not be applied.
    SwitchOnDisabled,
    /// High power may be applied.
    ReadyToSwitchOn,
    /// High power applied, motor not energised.
    SwitchedOn,
    /// Motor energised.
    OperationEnabled,
    /// Stopped by quick stop, still energised.
    QuickStopActive,
    /// Coming to rest because of a fault.
    FaultReactionActive,
    /// At rest, de-energised, until a fault reset.
    Fault,
}

impl PowerState {
    /// The state's bits in the statusword; quick stop (bit 5) reads 1 except where it is active.
    #[must_use]
    pub const fn status_bits(self) -> u16 {
        match self {
            Self::NotReadyToSwitchOn => 0x00,
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::QuickStopActive => 0x07,
            Self::FaultReactionActive => 0x0F,
            Self::Fault => 0x08,
        }
    }
}

/// How the motor is brought to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slowing {
    /// With the profile deceleration 0x6084.
    Slow,
    /// With the quick stop deceleration 0x6085.
    Quick,
    /// With all the torque there is.
    Strongest,
}

/// What the motor control has to do after a transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// Continue.
    Continue,
    /// Energise and follow the setpoints from the present position.
    Energise,
    /// Follow setpoints again after a stop.
    Follow,
    /// Bring the motor to rest and hold it; report standstill.
    SlowDown(Slowing),
    /// De-energise at once.
    Release,
}

/// Option codes that steer the transitions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Options {
    /// 0x605A.
    pub(crate) quick_stop: i64,
    /// 0x605B.
    pub(crate) shutdown: i64,
    /// 0x605C.
    pub(crate) disable_operation: i64,
    /// 0x605E.
    pub(crate) fault_reaction: i64,
    /// 0x6060 names a mode in which the drive can be enabled.
    pub(crate) has_mode: bool,
}

/// What a controlword commands (bits 7, 3, 2, 1, 0).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Command {
    Shutdown,
    SwitchOn,
    EnableOperation,
    DisableVoltage,
    QuickStop,
    /// Bit 7 is set: only its rising edge counts.
    None,
}

/// Bit 7: fault reset.
const FAULT_RESET: u16 = 0x80;

impl Command {
    fn of(controlword: u16) -> Self {
        match controlword {
            word if word & FAULT_RESET != 0 => Self::None,
            word if word & 0b0010 == 0 => Self::DisableVoltage,
            word if word & 0b0100 == 0 => Self::QuickStop,
            word if word & 0b0001 == 0 => Self::Shutdown,
            word if word & 0b1000 == 0 => Self::SwitchOn,
            _ => Self::EnableOperation,
        }
    }
}

/// The state machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Power {
    state: PowerState,
    /// Where a ramp that is under way leads, once the motor rests.
    after_standstill: Option<PowerState>,
    controlword: u16,
}

impl Power {
    /// As after power-up.
    pub(crate) const fn new() -> Self {
        Self { state: PowerState::NotReadyToSwitchOn, after_standstill: None, controlword: 0 }
    }

    /// The state.
    pub(crate) const fn state(&self) -> PowerState {
        self.state
    }

    /// True while the motor is being brought to rest.
    pub(crate) const fn is_slowing(&self) -> bool {
        self.after_standstill.is_some()
    }

    /// True when the ramp that is under way ends without torque.
    pub(crate) fn ends_released(&self) -> bool {
        self.after_standstill.is_some_and(|next| next != PowerState::QuickStopActive)
    }

    /// Self-test done: transitions 0 and 1.
    pub(crate) fn boot(&mut self) {
        if self.state == PowerState::NotReadyToSwitchOn {
            self.state = PowerState::SwitchOnDisabled;
        }
    }

    /// Takes the controlword, each time it is written.
    pub(crate) fn command(&mut self, controlword: u16, options: &Options) -> Action {
        let rising = controlword & !self.controlword;
        self.controlword = controlword;
        if self.state == PowerState::Fault {
            if rising & FAULT_RESET != 0 {
                self.state = PowerState::SwitchOnDisabled; // 15
            }
            return Action::Continue;
        }
        let command = Command::of(controlword);
        match self.state {
            PowerState::SwitchOnDisabled if command == Command::Shutdown => {
                self.go(PowerState::ReadyToSwitchOn) // 2
            }
            PowerState::ReadyToSwitchOn => self.ready(command, options),
            PowerState::SwitchedOn => self.switched_on(command, options),
            PowerState::OperationEnabled => self.enabled(command, options),
            PowerState::QuickStopActive => self.quick_stopped(command, options),
            PowerState::SwitchOnDisabled
            | PowerState::NotReadyToSwitchOn
            | PowerState::FaultReactionActive
            | PowerState::Fault => Action::Continue,
        }
    }

    /// The motor rests: ends a ramp.
    pub(crate) fn standstill(&mut self) -> Action {
        match self.after_standstill.take() {
            Some(PowerState::QuickStopActive) | None => Action::Continue,
            Some(next) => {
                self.state = next;
                Action::Release
            }
        }
    }

    /// A fault was found: transitions 13 and 14, with reaction 0x605E.
    pub(crate) fn fault(&mut self, options: &Options) -> Action {
        if matches!(self.state, PowerState::Fault | PowerState::FaultReactionActive) {
            return Action::Continue;
        }
        if self.is_energised() && options.fault_reaction != 0 {
            return self.slow(PowerState::FaultReactionActive, PowerState::Fault, options.fault_reaction);
        }
        self.after_standstill = None;
        self.state = PowerState::Fault;
        Action::Release
    }

    /// The connection to the master was lost: reaction 0x6007. Faults (1) are the caller's, who knows the code.
    pub(crate) fn abort_connection(&mut self, option: i64, options: &Options) -> Action {
        match option {
            2 if self.state != PowerState::Fault => self.disable_voltage(),
            3 if self.state == PowerState::OperationEnabled => self.quick_stop(options),
            _ => Action::Continue,
        }
    }

    /// True while the motor is energised.
    pub(crate) const fn is_energised(&self) -> bool {
        matches!(
            self.state,
            PowerState::OperationEnabled | PowerState::QuickStopActive | PowerState::FaultReactionActive
        )
    }

    /// A reset of the node: de-energised, as after power-up.
    pub(crate) fn reset(&mut self) -> Action {
        *self = Self::new();
        Action::Release
    }

    fn ready(&mut self, command: Command, options: &Options) -> Action {
        match command {
            Command::SwitchOn => self.go(PowerState::SwitchedOn), // 3
            Command::EnableOperation => {
                // 3, and then 4 by itself: a master may write "switch on and enable" once, and only once.
                self.state = PowerState::SwitchedOn;
                self.switched_on(command, options)
            }
            Command::DisableVoltage | Command::QuickStop => self.go(PowerState::SwitchOnDisabled), // 7
            Command::Shutdown | Command::None => Action::Continue,
        }
    }

    fn switched_on(&mut self, command: Command, options: &Options) -> Action {
        match command {
            Command::EnableOperation if options.has_mode => {
                self.state = PowerState::OperationEnabled; // 4
                Action::Energise
            }
            Command::Shutdown => self.go(PowerState::ReadyToSwitchOn), // 6
            Command::DisableVoltage | Command::QuickStop => self.go(PowerState::SwitchOnDisabled), // 10
            Command::EnableOperation | Command::SwitchOn | Command::None => Action::Continue,
        }
    }

    fn enabled(&mut self, command: Command, options: &Options) -> Action {
        match command {
            Command::DisableVoltage => self.disable_voltage(), // 9
            Command::QuickStop => self.quick_stop(options),    // 11
            Command::EnableOperation if self.is_slowing() => {
                // The master changed its mind before the ramp of 5 or 8 had ended.
                self.after_standstill = None;
                Action::Follow
            }
            Command::SwitchOn => self.leave(PowerState::SwitchedOn, options.disable_operation), // 5
            Command::Shutdown => self.leave(PowerState::ReadyToSwitchOn, options.shutdown),     // 8
            Command::EnableOperation | Command::None => Action::Continue,
        }
    }

    fn quick_stopped(&mut self, command: Command, options: &Options) -> Action {
        match command {
            Command::DisableVoltage => self.disable_voltage(), // 12
            Command::EnableOperation if !self.is_slowing() && options.quick_stop >= 5 => {
                self.state = PowerState::OperationEnabled; // 16
                Action::Follow
            }
            Command::EnableOperation
            | Command::Shutdown
            | Command::SwitchOn
            | Command::QuickStop
            | Command::None => Action::Continue,
        }
    }

    fn quick_stop(&mut self, options: &Options) -> Action {
        match options.quick_stop {
            0 => self.disable_voltage(),
            code @ 1..=3 => self.slow(PowerState::QuickStopActive, PowerState::SwitchOnDisabled, code),
            code => self.slow(PowerState::QuickStopActive, PowerState::QuickStopActive, code - 4),
        }
    }

    /// Leaves operation enabled, at once (option 0) or after a ramp during which the state stays.
    fn leave(&mut self, next: PowerState, option: i64) -> Action {
        if option == 0 {
            self.after_standstill = None;
            self.state = next;
            return Action::Release;
        }
        if self.after_standstill == Some(next) {
            return Action::Continue;
        }
        self.slow(PowerState::OperationEnabled, next, 1)
    }

    fn disable_voltage(&mut self) -> Action {
        self.after_standstill = None;
        self.state = PowerState::SwitchOnDisabled;
        Action::Release
    }

    /// Ramps: 1 slow, 2 quick, 3 with all torque.
    fn slow(&mut self, state: PowerState, then: PowerState, code: i64) -> Action {
        self.state = state;
        self.after_standstill = Some(then);
        Action::SlowDown(match code {
            1 => Slowing::Slow,
            2 => Slowing::Quick,
            _ => Slowing::Strongest,
        })
    }

    fn go(&mut self, next: PowerState) -> Action {
        self.state = next;
        Action::Continue
    }
}

/// The error register bit (0x1001) of an error code, the generic bit included.
pub(crate) fn register_bits(code: u16) -> u8 {
    let class = match code >> 8 {
        0x20..=0x2F => 0b0000_0010,
        0x30..=0x3F => 0b0000_0100,
        0x40..=0x4F => 0b0000_1000,
        0x81..=0x82 => 0b0001_0000,
        0x83..=0x8F => 0b0010_0000,
        0xFF => 0b1000_0000,
        _ => 0,
    };
    if code == emcy::RESET { 0 } else { class | 1 }
}
