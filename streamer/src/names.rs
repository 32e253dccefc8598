//! The names that an arm's settings give to joints and buses, and the sentences about them that every reader gets alike:
//! the log, the answers to commands, `status`.
use taustream_arm::Settings;
use taustream_arm::text::counted;
use taustream_drivers::ErrorFrame;
use taustream_drivers::bring_up::{explain, explain_refusal};
use taustream_messages::{BusFault, BusReport, Cause, Evidence};

/// A bus as its settings name it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BusName {
    /// Its name.
    pub name: String,
    /// Its network interface.
    pub interface: String,
}

/// Names of joints and buses, in the order of the settings; empty where the settings could not be read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// The joints, base to tip.
    pub joints: Vec<String>,
    /// The buses.
    pub buses: Vec<BusName>,
}

impl Names {
    /// The names of an arm.
    #[must_use]
    pub fn of(settings: &Settings) -> Self {
        let bus = |b: &taustream_arm::Bus| BusName { name: b.name.clone(), interface: b.interface.clone() };
        Self {
            joints: settings.robot.joints.iter().map(|j| j.name.clone()).collect(),
            buses: settings.buses.iter().map(bus).collect(),
        }
    }

    /// A joint as text, by its zero-based index: "joint 3 `elbow`".
    #[must_use]
    pub fn joint(&self, joint: usize) -> String {
        match self.joints.get(joint) {
            Some(name) => format!("joint {} `{name}`", joint + 1),
            None => format!("joint {}", joint + 1),
        }
    }

    /// A bus as text, by its zero-based index: "bus `arm` (vcan0)".
    #[must_use]
    pub fn bus(&self, bus: usize) -> String {
        match self.buses.get(bus) {
            Some(BusName { name, interface }) => format!("bus `{name}` ({interface})"),
            None => format!("bus {}", bus + 1),
        }
    }

    /// The interface of a bus, to be put into a command line.
    #[must_use]
    pub fn interface(&self, bus: usize) -> &str {
        self.buses.get(bus).map_or("IFACE", |b| &b.interface)
    }

    /// What went wrong, where, by how much: "tracking error (rad) at joint 3 `elbow`: 0.12 against 0.05".
    #[must_use]
    pub fn fault(&self, cause: &Cause) -> String {
        let place = match (cause.joint, cause.bus) {
            (Some(joint), _) => format!(" at {}", self.joint(joint)),
            (None, Some(bus)) => format!(" on {}", self.bus(bus)),
            (None, None) => String::new(),
        };
        let evidence = match cause.evidence() {
            Evidence::None => String::new(),
            Evidence::DriveError(code) => format!(": {}", explain(code)),
            Evidence::Refusal { code, object } => format!(": {}", explain_refusal(code, object)),
            Evidence::Statusword(word) => format!(": {word:#06x}"),
            Evidence::Bus(bus_fault) => format!(": {}", self.bus_fault(cause, bus_fault)),
            Evidence::Value(value) => format!(": {value:.6}"),
            Evidence::Amount { value, limit } => format!(": {value:.6} against {limit:.6}"),
        };
        format!("{}{place}{evidence}", cause.reason.word())
    }

    fn bus_fault(&self, cause: &Cause, bus_fault: Option<BusFault>) -> String {
        let Some(bus_fault) = bus_fault else {
            return format!("fault {} of another release", cause.code);
        };
        let count = match bus_fault {
            BusFault::QueueFull | BusFault::System => format!(" for {} consecutive cycles", cause.value),
            BusFault::Unconfirmed => format!(", {} in flight", cause.value),
            BusFault::ReceiveBehind if cause.limit > 0.0 => {
                format!(": no feedback was read for {:.6} s, {:.6} s are tolerated", cause.value, cause.limit)
            }
            BusFault::OtherMaster => {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an identifier")]
                let id = cause.value as u32;
                format!(" (identifier {id:#05X}), which is this arm's own")
            }
            BusFault::SetpointsLost if cause.limit > 0.0 => {
                format!(": {} of its last 32, {} are tolerated", cause.value, cause.limit)
            }
            BusFault::SetpointsLost => format!(": {} in a row, more than its drive bridges", cause.value),
            BusFault::ReceiveBehind => format!(", {} of its own are unread", cause.value),
            BusFault::Down
            | BusFault::Gone
            | BusFault::BusOff
            | BusFault::Restarted
            | BusFault::ErrorPassive => String::new(),
        };
        let remedy = bus_fault.remedy(cause.bus.map_or("IFACE", |bus| self.interface(bus)));
        format!("{}{count}; {remedy}", bus_fault.word())
    }

    /// The state of a bus: "well", or what is wrong with it and what its controller said last.
    #[must_use]
    pub fn bus_state(&self, bus: usize, report: &BusReport) -> String {
        let state = match report.bus_fault() {
            None => "well".to_owned(),
            Some(bus_fault) => {
                let silent = if report.silent == 0 { "" } else { ", nothing is sent until `clear-fault`" };
                format!("{}{silent}; {}", bus_fault.word(), bus_fault.remedy(self.interface(bus)))
            }
        };
        let error = ErrorFrame { class: report.error_class, data: report.error_data };
        if report.error_frames == 0 {
            return state;
        }
        format!("{state}; {}, the newest: {}", counted(report.error_frames, "error frame"), error.sentence())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_messages::FaultReason;

    fn names() -> Names {
        let bus = BusName { name: "arm".into(), interface: "can3".into() };
        Names { joints: vec!["pan".into(), "lift".into()], buses: vec![bus] }
    }

    #[test]
    fn fault_sentence_names_reason_place_and_evidence() {
        let cause = |reason| Cause::new(reason);
        let refused = |code, object| Cause { object, ..cause(FaultReason::ConfigurationRefused).code(code) };
        let cases = [
            (
                cause(FaultReason::TrackingError).at_joint(1).amount(0.12, 0.05),
                "tracking error (rad) at joint 2 `lift`: 0.120000 against 0.050000",
            ),
            (
                cause(FaultReason::DriveFault).at_joint(0).code(0x8611),
                "drive fault at joint 1 `pan`: 0x8611 following error too large",
            ),
            (
                refused(0x0604_0041, 0x16_0002).at_joint(1),
                "drive refused its configuration at joint 2 `lift`: object 0x1600:02: SDO abort 0x06040041 object \
                 cannot be mapped into a PDO",
            ),
            (
                refused(0x1_0008, 0x65_0200).at_joint(0),
                "drive refused its configuration at joint 1 `pan`: object 0x6502:00: the drive does not offer cyclic \
                 synchronous position (object 0x6502, bit 7)",
            ),
            (
                cause(FaultReason::DriveDropped).at_joint(0).code(0x0250),
                "drive left operation by itself (statusword) at joint 1 `pan`: 0x0250",
            ),
            (
                cause(FaultReason::DriveWarning).at_joint(0).code(0x12B7),
                "drive warns (statusword) at joint 1 `pan`: 0x12b7",
            ),
            (cause(FaultReason::Operator), "fast stop by the operator"),
            (
                cause(FaultReason::Guard).at_joint(7).amount(f64::NAN, 1.0),
                "setpoint failed the guard at joint 8: NaN against 1.000000",
            ),
            (
                Cause::bus(0, BusFault::Down, 0.0, 0.0),
                "bus fault on bus `arm` (can3): interface is down (ENETDOWN); bring it up: ip link set can3 up",
            ),
            (
                Cause::bus(0, BusFault::QueueFull, 3.0, 3.0),
                "bus fault on bus `arm` (can3): transmit queue full (ENOBUFS) for 3 cycles in a row; see that the drives \
                 are powered, the cable is whole, both ends are terminated and the bit rate is theirs",
            ),
            (
                Cause { code: 99, ..Cause::bus(4, BusFault::Gone, 0.0, 0.0) },
                "bus fault on bus 5: fault 99 of another release",
            ),
        ];
        for (cause, expected) in cases {
            assert_eq!(names().fault(&cause), expected);
        }
    }

    #[test]
    fn bus_state_names_fault_remedy_and_newest_error() {
        let recovered = BusReport::default();
        assert_eq!(names().bus_state(0, &recovered), "well");
        let off = BusReport {
            bus_fault: BusFault::BusOff.code(),
            silent: 1,
            error_frames: 2,
            error_class: 0x240,
            error_data: [0, 0, 0, 0, 0, 0, 248, 3],
            ..recovered
        };
        let text = names().bus_state(0, &off);
        for part in
            ["bus-off", "nothing is sent until `clear-fault`", "ip link set can3 type can restart", "tx=248"]
        {
            assert!(text.contains(part), "no `{part}` in: {text}");
        }
        let foreign = BusReport { bus_fault: 77, ..recovered };
        assert!(!names().bus_state(0, &foreign).starts_with("well"));
    }
}
