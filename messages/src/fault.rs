//! Why the arm is, or is going, in [`crate::Phase::Fault`]: the reason, who is to blame, and what proves it.
//!
//! Everything here is a number, made on the real-time thread; words are put together by whoever shows them.

/// Why the arm is, or is going, in fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum FaultReason {
    /// A drive reported a fault; code = its error code, value = its statusword when it tripped.
    DriveFault = 1,
    /// No feedback of a joint for too long; value = age in s.
    FeedbackLate = 2,
    /// A joint does not follow; value = tracking error in rad.
    TrackingError = 3,
    /// A measured position jumped; value = jump in rad.
    PositionJump = 4,
    /// A setpoint failed the guard; value = the offending number.
    Guard = 5,
    /// A bus does not carry setpoints any more; code = [`BusFault::code`], bus = which.
    BusFault = 6,
    /// The loop stalled for longer than the drives' watchdog; value = gap in s.
    Stall = 7,
    /// A drive did not get ready in time; value = timeout in s.
    BringUp = 8,
    /// A drive left its operating state without a command; code = statusword.
    DriveDropped = 9,
    /// A drive was found energised, and not as this arm's settings would have left it; code = its error code,
    /// object = what differs.
    EnergisedUnowned = 10,
    /// The operator asked for torque off.
    TorqueOff = 11,
    /// The operator asked for a fast stop.
    Operator = 12,
    /// A drive refused a configuration step, or states about itself what the settings deny; code = its error code,
    /// object = what it refused or states, value = what it states, limit = what the settings say.
    ConfigurationRefused = 13,
    /// A drive has no fault, but warns; code = statusword.
    DriveWarning = 14,
    /// The homing of a joint has failed; code = its error code, object = what is to blame.
    HomingFailed = 15,
}

impl FaultReason {
    /// Every reason.
    pub const ALL: [Self; 15] = [
        Self::DriveFault,
        Self::FeedbackLate,
        Self::TrackingError,
        Self::PositionJump,
        Self::Guard,
        Self::BusFault,
        Self::Stall,
        Self::BringUp,
        Self::DriveDropped,
        Self::EnergisedUnowned,
        Self::TorqueOff,
        Self::Operator,
        Self::ConfigurationRefused,
        Self::DriveWarning,
        Self::HomingFailed,
    ];
    /// The code in messages; 0 means none.
    #[must_use]
    pub fn code(self) -> u32 {
        self as u32
    }
    /// The reason of a code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|r| r.code() == code)
    }
    /// What happened and in which unit the value is: "feedback late (s)".
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::DriveFault => "drive fault",
            Self::DriveWarning => "drive warns (statusword)",
            Self::FeedbackLate => "feedback late (s)",
            Self::TrackingError => "tracking error (rad)",
            Self::PositionJump => "position jumped (rad)",
            Self::Guard => "setpoint failed the guard",
            Self::BusFault => "bus fault",
            Self::Stall => "loop stalled (s)",
            Self::BringUp => "drive not ready in time (s)",
            Self::DriveDropped => "drive left operation by itself (statusword)",
            Self::EnergisedUnowned => "energised, unowned",
            Self::TorqueOff => "torque switched off by the operator",
            Self::Operator => "fast stop by the operator",
            Self::ConfigurationRefused => "drive refused its configuration",
            Self::HomingFailed => "homing failed",
        }
    }
}

/// What is wrong with a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum BusFault {
    /// Its queue took no frames for too many cycles (ENOBUFS, EAGAIN).
    QueueFull = 1,
    /// Frames were taken, but not seen on the wire for too many cycles.
    Unconfirmed = 2,
    /// The interface is down (ENETDOWN).
    Down = 3,
    /// The interface, or the other end of a local link, does not exist any more (ENXIO, ENODEV).
    Gone = 4,
    /// The controller has left the bus after too many errors.
    BusOff = 5,
    /// The controller came back by itself after bus-off: frames that it still held may be old.
    Restarted = 6,
    /// The controller may only listen and send passive error flags.
    ErrorPassive = 7,
    /// Another error of the operating system for too many cycles.
    System = 8,
    /// Frames of the bus are received, but this computer reads them too late or loses them.
    ReceiveBehind = 9,
    /// The queue took some frames of the cycles, and left out setpoints of a joint too often.
    SetpointsLost = 10,
    /// Frames that only a master sends came from elsewhere: SYNC, NMT commands, or setpoints of this arm's drives.
    OtherMaster = 11,
}

impl BusFault {
    /// Every fault.
    pub const ALL: [Self; 11] = [
        Self::QueueFull,
        Self::Unconfirmed,
        Self::Down,
        Self::Gone,
        Self::BusOff,
        Self::Restarted,
        Self::ErrorPassive,
        Self::System,
        Self::ReceiveBehind,
        Self::SetpointsLost,
        Self::OtherMaster,
    ];
    /// The code in messages; 0 means none.
    #[must_use]
    pub fn code(self) -> u32 {
        self as u32
    }
    /// The fault of a code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.code() == code)
    }
    /// What it is, as text.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::QueueFull => "transmit queue full (ENOBUFS)",
            Self::Unconfirmed => "frames are not acknowledged",
            Self::Down => "interface is down (ENETDOWN)",
            Self::Gone => "interface has gone (ENODEV)",
            Self::BusOff => "controller is bus-off",
            Self::Restarted => "controller restarted after bus-off",
            Self::ErrorPassive => "controller is error-passive",
            Self::System => "operating system refuses its frames",
            Self::ReceiveBehind => "this computer reads its frames too late",
            Self::SetpointsLost => "setpoints of a joint are lost (queue full)",
            Self::OtherMaster => "another master commands the drives",
        }
    }
    /// What to do about it, before `clear-fault`; `has_cable`: there is a cable to look at.
    #[must_use]
    pub fn remedy(self, interface: &str, has_cable: bool) -> String {
        match self {
            Self::QueueFull | Self::Unconfirmed | Self::SetpointsLost if !has_cable => {
                "check that the simulated servos run and keep up".to_owned()
            }
            Self::QueueFull | Self::Unconfirmed | Self::SetpointsLost => {
                "see that the drives are powered, the cable is whole, both ends are terminated and the bit rate is theirs"
                    .to_owned()
            }
            Self::OtherMaster => {
                format!("find and end the other program or device: candump {interface} shows its frames")
            }
            Self::Down => format!("bring it up: ip link set {interface} up"),
            Self::Gone => "bring the interface (or the simulated servos of a local link) back".to_owned(),
            Self::BusOff => format!(
                "fix cable, termination or bit rate, then: ip link set {interface} type can restart"
            ),
            Self::Restarted => "fix cable, termination or bit rate: otherwise it goes bus-off again".to_owned(),
            Self::ErrorPassive => {
                "see cable, termination, bit rate and the power of the drives: bus-off is next".to_owned()
            }
            Self::ReceiveBehind => {
                "the bus carries frames, so leave its cables alone: run `taustream doctor`, and see what else loads this computer"
                    .to_owned()
            }
            Self::System => format!("see `ip -details link show {interface}` and the log"),
        }
    }
}

/// Why the arm stopped, with its evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cause {
    /// The kind.
    pub reason: FaultReason,
    /// Zero-based joint, where one is to blame.
    pub joint: Option<usize>,
    /// Index of the bus in the settings, where one is to blame.
    pub bus: Option<usize>,
    /// Error code, statusword or [`BusFault::code`], by the reason; 0 for none.
    pub code: u32,
    /// Object that a drive refused, `index << 8 | sub`; 0 for none.
    pub object: u32,
    /// The number that belongs to the reason; 0 where there is none.
    pub value: f64,
    /// The limit that it broke; 0 where there is none.
    pub limit: f64,
}

/// What of a [`Cause`] is to be shown beside its reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Evidence {
    /// The reason says it all.
    None,
    /// A drive's fault.
    DriveError {
        /// Its error code; 0 while none is known.
        code: u32,
        /// Its statusword when it tripped.
        status_word: u32,
    },
    /// Error code and object of a refused configuration step.
    Refusal {
        /// The code.
        code: u32,
        /// The object; 0 when none is to blame.
        object: u32,
        /// What the drive states of the object, and what the settings say; 0 where there are no such numbers.
        numbers: [f64; 2],
    },
    /// A statusword.
    Statusword(u32),
    /// What is wrong with the bus; `None` for a code of another release.
    Bus(Option<BusFault>),
    /// A number without a limit.
    Value(f64),
    /// A number and the limit that it broke.
    Amount {
        /// The number.
        value: f64,
        /// The limit.
        limit: f64,
    },
}

impl Cause {
    /// A cause without evidence.
    #[must_use]
    pub const fn new(reason: FaultReason) -> Self {
        Self { reason, joint: None, bus: None, code: 0, object: 0, value: 0.0, limit: 0.0 }
    }
    /// The same, with a joint to blame.
    #[must_use]
    pub const fn at_joint(self, joint: usize) -> Self {
        Self { joint: Some(joint), ..self }
    }
    /// The same, with a number and the limit that it broke.
    #[must_use]
    pub const fn amount(self, value: f64, limit: f64) -> Self {
        Self { value, limit, ..self }
    }
    /// The same, with a code.
    #[must_use]
    pub const fn code(self, code: u32) -> Self {
        Self { code, ..self }
    }
    /// A bus that failed; `value` against `limit` is what was counted, 0 where nothing was.
    #[must_use]
    pub fn bus(bus: usize, bus_fault: BusFault, value: f64, limit: f64) -> Self {
        let cause = Self::new(FaultReason::BusFault).code(bus_fault.code()).amount(value, limit);
        Self { bus: Some(bus), ..cause }
    }

    /// The statusword of a drive's fault.
    fn status_word(&self) -> u32 {
        let whole = (0.0..=f64::from(u32::MAX)).contains(&self.value);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 32 bits")]
        let word = if whole { self.value as u32 } else { 0 };
        word
    }

    /// What is to be shown beside the reason: the one rule for logs, status and answers.
    #[must_use]
    pub fn evidence(&self) -> Evidence {
        match self.reason {
            FaultReason::TorqueOff | FaultReason::Operator => Evidence::None,
            FaultReason::DriveFault => {
                Evidence::DriveError { code: self.code, status_word: self.status_word() }
            }
            FaultReason::ConfigurationRefused | FaultReason::EnergisedUnowned | FaultReason::HomingFailed => {
                Evidence::Refusal { code: self.code, object: self.object, numbers: [self.value, self.limit] }
            }
            FaultReason::DriveDropped | FaultReason::DriveWarning => Evidence::Statusword(self.code),
            FaultReason::BusFault => Evidence::Bus(BusFault::from_code(self.code)),
            FaultReason::FeedbackLate
            | FaultReason::TrackingError
            | FaultReason::PositionJump
            | FaultReason::Guard
            | FaultReason::Stall
            | FaultReason::BringUp => {
                if self.limit > 0.0 {
                    Evidence::Amount { value: self.value, limit: self.limit }
                } else {
                    Evidence::Value(self.value)
                }
            }
        }
    }
}
