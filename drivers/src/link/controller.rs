//! What the driver of a CAN controller says of it: for whoever examines a computer, never for the cycle.
use socketcan::CanInterface;
use socketcan::nl::CanState;

/// How well a controller gets on with its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControllerState {
    /// Few errors.
    Active,
    /// Many errors, still taking full part.
    Warning,
    /// So many errors that it no longer tells the others of its own.
    Passive,
    /// Off the bus.
    Off,
    /// Down, or asleep.
    Stopped,
}

impl ControllerState {
    /// The word that `ip -details link show` has for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Active => "ERROR-ACTIVE",
            Self::Warning => "ERROR-WARNING",
            Self::Passive => "ERROR-PASSIVE",
            Self::Off => "BUS-OFF",
            Self::Stopped => "STOPPED",
        }
    }
}

/// A controller as its driver describes it; `None` where the driver does not say, as vcan's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controller {
    /// Nominal bit rate.
    pub bitrate_bit_s: Option<u32>,
    /// Its state.
    pub state: Option<ControllerState>,
    /// After how long it comes back from bus-off by itself, ms; 0 is never.
    pub restart_ms: Option<u32>,
}

/// Asks the kernel by netlink. An interface that does not exist, or is no CAN, says nothing.
#[must_use]
pub fn controller(interface: &str) -> Controller {
    let Ok(open) = CanInterface::open(interface) else { return Controller::default() };
    let state = open.state().ok().flatten().map(|state| match state {
        CanState::ErrorActive => ControllerState::Active,
        CanState::ErrorWarning => ControllerState::Warning,
        CanState::ErrorPassive => ControllerState::Passive,
        CanState::BusOff => ControllerState::Off,
        CanState::Stopped | CanState::Sleeping => ControllerState::Stopped,
    });
    Controller {
        bitrate_bit_s: open.bit_rate().ok().flatten(),
        state,
        restart_ms: open.restart_ms().ok().flatten(),
    }
}
