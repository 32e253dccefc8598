//! The names that an arm's settings give to joints and buses, and the sentences about them that every reader gets alike:
//! the log, the answers to commands, `status`.
use crate::pose_store::Directories;
use taustream_arm::text::counted;
use taustream_arm::{AxisUnit, Settings};
use taustream_drivers::ErrorFrame;
use taustream_drivers::bring_up::Refusal;
use taustream_drivers::words::{explain_on, explain_refusal_on, explain_status};
use taustream_messages::{BusFault, BusReport, Cause, Evidence};
use taustream_motion::JointKind;
use taustream_motion::digits::Decimals;

/// A bus as its settings name it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BusName {
    /// Its name.
    pub name: String,
    /// Its network interface.
    pub interface: String,
    /// It has a cable; a vcan or local link has none.
    pub has_cable: bool,
}

/// The servo of a joint as its settings name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoName {
    /// Index of its bus.
    pub bus: usize,
    /// Its protocol, as settings name it.
    pub protocol: &'static str,
    /// The joint falls when commands stop, and its owner has acknowledged that.
    pub falls: bool,
}

/// An axis beside the path as its settings name it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisName {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: AxisUnit,
}

/// Names of joints and buses, in the order of the settings; empty where the settings could not be read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// The joints, base to tip.
    pub joints: Vec<String>,
    /// Which of them slide; those beyond the list turn.
    pub kinds: Vec<JointKind>,
    /// The axes beside the path.
    pub axes: Vec<AxisName>,
    /// The buses.
    pub buses: Vec<BusName>,
    /// The servos, in the order of the joints, then of the axes.
    pub servos: Vec<ServoName>,
    /// Where the last pose is kept; empty where nobody keeps it.
    pub directories: Directories,
}

impl Names {
    /// The names of an arm.
    #[must_use]
    pub fn of(settings: &Settings) -> Self {
        let bus = |b: &taustream_arm::Bus| BusName {
            name: b.name.clone(),
            interface: b.interface.clone(),
            has_cable: b.kind != taustream_arm::BusKind::Virtual,
        };
        let servo = |s: &taustream_arm::Servo| ServoName {
            bus: s.bus,
            protocol: s.protocol.name(),
            falls: s.limp_risk_acknowledged,
        };
        Self {
            joints: settings.robot.joints.iter().map(|j| j.name.clone()).collect(),
            kinds: settings.robot.joints.iter().map(|j| j.kind).collect(),
            axes: settings
                .axes
                .iter()
                .map(|axis| AxisName { name: axis.name().to_owned(), unit: axis.unit })
                .collect(),
            buses: settings.buses.iter().map(bus).collect(),
            servos: settings.servos.iter().map(servo).collect(),
            directories: Directories::default(),
        }
    }

    /// How a joint moves, and with that the unit of its numbers.
    #[must_use]
    pub fn kind(&self, joint: usize) -> JointKind {
        self.kinds.get(joint).copied().unwrap_or_default()
    }

    /// The same names where these buses are local links: nobody is sent to look at a cable.
    #[must_use]
    pub fn with_local(mut self, local: impl IntoIterator<Item = bool>) -> Self {
        for (bus, local) in self.buses.iter_mut().zip(local) {
            bus.has_cable &= !local;
        }
        self
    }

    /// Whether a bus has a cable; one of which nothing is known may.
    fn has_cable(&self, bus: usize) -> bool {
        self.buses.get(bus).is_none_or(|b| b.has_cable)
    }

    /// Whether a joint's servo hangs on a cable.
    pub(crate) fn joint_has_cable(&self, joint: usize) -> bool {
        self.servos.get(joint).is_none_or(|servo| self.has_cable(servo.bus))
    }

    /// What everybody near the arm must know while it is energised; none where every joint stays when commands stop.
    #[must_use]
    pub fn fall_warning(&self) -> Option<String> {
        let falling = self.servos.iter().enumerate().filter(|(_, servo)| servo.falls);
        let names: Vec<&str> = falling.map(|(slot, _)| self.slot_name(slot).unwrap_or("?")).collect();
        (!names.is_empty()).then(|| {
            format!(
                "KEEP CLEAR, and support the arm before `disable`: falling when commands stop (limp_risk_acknowledged): {}",
                names.join(", ")
            )
        })
    }

    /// What a drive's error code says, and what to do: "0x8611 following error too large".
    #[must_use]
    pub fn error_code(&self, joint: usize, code: u32) -> String {
        explain_on(code, self.joint_has_cable(joint))
    }

    /// The same, with the joint: "drive of joint 3 `elbow`: 0x8611 following error too large".
    #[must_use]
    pub fn drive_error(&self, joint: usize, code: u32) -> String {
        format!("drive of {}: {}", self.joint(joint), self.error_code(joint, code))
    }

    /// A drive's refusal, as its fault says it.
    #[must_use]
    pub fn refusal(&self, joint: usize, refusal: &Refusal) -> String {
        explain_refusal_on(refusal, self.joint_has_cable(joint))
    }

    /// A drive's status word as text: "0x0218 fault".
    #[must_use]
    pub fn status_word(&self, joint: usize, word: u32) -> String {
        explain_status(self.servos.get(joint).map(|servo| servo.protocol), word)
    }

    /// Why a joint cannot home itself, and what references it instead.
    #[must_use]
    pub fn no_homing(&self, joint: usize) -> String {
        let name = self.joint(joint);
        match self.servos.get(joint).map(|servo| servo.protocol) {
            Some("cia402") => format!(
                "{name} has no [servo.homing] in its settings; state how its drive homes, or use `taustream reference`"
            ),
            Some(protocol) => {
                format!(
                    "{name}: motors of this protocol ({protocol}) have no homing; use `taustream reference`"
                )
            }
            None => format!("there is no {name}"),
        }
    }

    /// The name behind a slot: of a joint, or of an axis behind the joints.
    fn slot_name(&self, slot: usize) -> Option<&str> {
        let axis = || self.axes.get(slot.checked_sub(self.joints.len())?).map(|axis| axis.name.as_str());
        self.joints.get(slot).map(String::as_str).or_else(axis)
    }

    /// A joint or an axis as text, by its zero-based slot: "joint 3 `elbow`", "axis `gripper`".
    #[must_use]
    pub fn joint(&self, joint: usize) -> String {
        let is_axis = !self.joints.is_empty() && joint >= self.joints.len();
        match self.slot_name(joint) {
            Some(name) if is_axis => format!("axis `{name}`"),
            Some(name) => format!("joint {} `{name}`", joint + 1),
            None => format!("joint {}", joint + 1),
        }
    }

    /// An axis as text, by its zero-based index: "axis `gripper`".
    #[must_use]
    pub fn axis(&self, axis: usize) -> String {
        match self.axes.get(axis) {
            Some(AxisName { name, .. }) => format!("axis `{name}`"),
            None => format!("axis {}", axis + 1),
        }
    }

    /// The unit of an axis.
    #[must_use]
    pub fn axis_unit(&self, axis: usize) -> AxisUnit {
        self.axes.get(axis).map_or(AxisUnit::Rad, |axis| axis.unit)
    }

    /// A bus as text, by its zero-based index: "bus `arm` (vcan0)".
    #[must_use]
    pub fn bus(&self, bus: usize) -> String {
        match self.buses.get(bus) {
            Some(BusName { name, interface, .. }) => format!("bus `{name}` ({interface})"),
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
        let joint = cause.joint.unwrap_or(usize::MAX);
        let evidence = match cause.evidence() {
            Evidence::None => String::new(),
            Evidence::DriveError { code: 0, status_word } => {
                format!(": no error code yet; status {}", self.status_word(joint, status_word))
            }
            Evidence::DriveError { code, status_word } => {
                let status = self.status_word(joint, status_word);
                format!(": {} (status {status})", self.error_code(joint, code))
            }
            Evidence::Refusal { code, object, numbers } => {
                format!(": {}", self.refusal(joint, &Refusal { code, object, numbers }))
            }
            Evidence::Statusword(word) => format!(": {}", self.status_word(joint, word)),
            Evidence::Bus(bus_fault) => format!(": {}", self.bus_fault(cause, bus_fault)),
            Evidence::Value(value) => format!(": {value:.6}"),
            Evidence::Amount { value, limit } => {
                let decimals = Decimals::apart(&[value, limit], 6);
                format!(": {} against {}", decimals.show(value), decimals.show(limit))
            }
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
        let remedy = match cause.bus {
            Some(bus) => self.bus_remedy(bus, bus_fault),
            None => bus_fault.remedy("IFACE", true),
        };
        format!("{}{count}; {remedy}", bus_fault.word())
    }

    /// What to do about a bus.
    #[must_use]
    pub fn bus_remedy(&self, bus: usize, bus_fault: BusFault) -> String {
        bus_fault.remedy(self.interface(bus), self.has_cable(bus))
    }

    /// The state of a bus: "well", or what is wrong with it and what its controller said last.
    #[must_use]
    pub fn bus_state(&self, bus: usize, report: &BusReport) -> String {
        let state = match report.bus_fault() {
            None => "well".to_owned(),
            Some(bus_fault) => {
                let silent = if report.silent == 0 { "" } else { ", nothing is sent until `clear-fault`" };
                format!("{}{silent}; {}", bus_fault.word(), self.bus_remedy(bus, bus_fault))
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
        let bus = BusName { name: "arm".into(), interface: "can3".into(), has_cable: true };
        let servo = |protocol| ServoName { bus: 0, protocol, falls: false };
        Names {
            joints: vec!["pan".into(), "lift".into()],
            buses: vec![bus],
            servos: vec![servo("cia402"), servo("damiao")],
            ..Names::default()
        }
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
                cause(FaultReason::DriveFault).at_joint(0).code(0x8611).amount(f64::from(0x0218), 0.0),
                "drive fault at joint 1 `pan`: 0x8611 following error too large (status 0x0218 fault)",
            ),
            (
                cause(FaultReason::DriveFault).at_joint(0).amount(f64::from(0x0218), 0.0),
                "drive fault at joint 1 `pan`: no error code yet; status 0x0218 fault",
            ),
            (
                refused(0x0604_0041, 0x16_0002).at_joint(1),
                "drive refused its configuration at joint 2 `lift`: object 0x1600:02: SDO abort 0x06040041 object \
                 cannot be mapped into a PDO",
            ),
            (
                refused(0x1_0008, 0x65_0200).at_joint(0),
                "drive refused its configuration at joint 1 `pan`: object 0x6502:00: the drive does not offer cyclic \
                 synchronous position (object 0x6502, bit 7); one with interpolated position takes position_mode = \
                 \"interpolated\" in its [[servo]]",
            ),
            (
                cause(FaultReason::DriveDropped).at_joint(0).code(0x0250),
                "drive left operation by itself (statusword) at joint 1 `pan`: 0x0250 switch on disabled",
            ),
            (
                cause(FaultReason::DriveWarning).at_joint(0).code(0x12B7),
                "drive warns (statusword) at joint 1 `pan`: 0x12B7 operation enabled, warning",
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
                "bus fault on bus `arm` (can3): transmit queue full (ENOBUFS) for 3 consecutive cycles; see that the drives \
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
    fn slot_behind_the_joints_is_an_axis_by_its_name() {
        let mut names = names();
        names.axes = vec![AxisName { name: "gripper".into(), unit: AxisUnit::Metre }];
        let cause = Cause::new(FaultReason::FeedbackLate).at_joint(2).amount(0.051, 0.05);
        assert_eq!(names.fault(&cause), "feedback late (s) at axis `gripper`: 0.051000 against 0.050000");
        assert_eq!((names.joint(1).as_str(), names.joint(3).as_str()), ("joint 2 `lift`", "joint 4"));
        assert_eq!((names.axis(0).as_str(), names.axis(1).as_str()), ("axis `gripper`", "axis 2"));
    }

    /// Goal: where there is no cable nobody is sent to look at one.
    #[test]
    fn links_without_a_cable_get_no_advice_about_cables() {
        let mut names = names();
        names.buses[0].has_cable = false;
        let no_answer = Refusal { code: 0x1_0001, object: 0, numbers: [0.0; 2] };
        let motor_gone = 0x2_0107;
        for text in [
            names.fault(&Cause::bus(0, BusFault::QueueFull, 3.0, 3.0)),
            names.fault(&Cause::bus(0, BusFault::Unconfirmed, 3.0, 0.0)),
            names.refusal(0, &no_answer),
            names.drive_error(0, 0x1_0003),
            names.drive_error(1, motor_gone),
        ] {
            for word in ["cable", "terminat", "wiring", "bit rate"] {
                assert!(!text.contains(word), "{text}");
            }
            assert!(text.contains("simulated servo"), "{text}");
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
