//! The `AgileX` Piper: one arm controller that answers for six joints.
use super::identifiers::Use;
use super::motors;
use super::{Protocol, Registration, ServoProtocol};
use crate::bus_load::flow::{Flow, periodic};
use crate::bus_load::frame::{Format, Frame};
use crate::document::shown;
use crate::reader::{FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, Servo, Settings};
use crate::trust::Reaction;
use serde_json::Value;

/// How a Piper is recognised and how it follows. What is the arm's stands in the table of each of its joints, and must be the
/// same in all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piper {
    /// Name of the firmware, as the arm states it.
    pub firmware: [u8; 8],
    /// Speed of its own profile, percent.
    pub speed_percent: u8,
    /// How it follows targets.
    pub follow: PiperFollow,
}

/// How a Piper follows targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PiperFollow {
    /// At once, as the maker's SDK has it for "MIT mode".
    Fast,
    /// By its own speed profile.
    Smooth,
}

/// Joints of the arm.
pub const PIPER_JOINTS: usize = 6;

pub(super) const REGISTRATION: Registration = Registration {
    name: "piper",
    words: "AgileX Piper, an arm controller with six joints",
    keys: &["firmware", "speed_percent", "follow"],
    // The number of the joint, counted from the base.
    node_id: [1, 6],
    read: |table| read(table).map(Protocol::from),
};

const FIRMWARE: &str =
    "the name that the arm states, eight characters from \"S-V\", for example \"S-V1.6-3\"";
const FIRMWARE_BEGINS: &str = "S-V";
const SPEED_PERCENT: [i64; 2] = [1, 100];
/// Every frame.
const FRAME_BYTES: u32 = 8;
/// Frames of targets in a cycle.
const TARGET_FRAMES: u32 = 3;
/// Frames that an idle arm sends in a second (maker's SDK, questions and answers).
const FEEDBACK_HZ: f64 = 3040.0;

/// Identifiers of the arm as a whole.
///
/// Source: the maker's SDK 0.6.2.
const ARM: [(u16, u16, &str); 5] = [
    (0x150, 0x15F, "commands to the arm"),
    (0x2A1, 0x2A8, "the arm's state and angles"),
    (0x470, 0x47F, "settings of the arm"),
    (0x481, 0x486, "speeds of the end effector"),
    (0x4AF, 0x4AF, "the firmware's name"),
];
/// Identifiers of each joint, each plus its number.
const JOINT: [(u16, &str); 2] = [(0x260, "the driver's state"), (0x250, "speed and current")];

fn read(table: &mut Table<'_>) -> Option<Piper> {
    let firmware = read_firmware(table);
    let speed_percent = table.integer("speed_percent", SPEED_PERCENT[0], SPEED_PERCENT[1]);
    let follow = read_follow(table);
    Some(Piper { firmware: firmware?, speed_percent: u8::try_from(speed_percent?).ok()?, follow: follow? })
}

fn read_firmware(table: &mut Table<'_>) -> Option<[u8; 8]> {
    let text = table.text("firmware", FIRMWARE)?;
    let name = <[u8; 8]>::try_from(text.as_bytes()).ok();
    let name = name.filter(|name| name.is_ascii() && text.starts_with(FIRMWARE_BEGINS));
    if name.is_none() {
        table.fault("firmware", &shown(&text), FIRMWARE);
    }
    name
}

fn read_follow(table: &mut Table<'_>) -> Option<PiperFollow> {
    let expected = "\"fast\" (targets act at once) or \"smooth\" (the arm's own speed profile)";
    let word = table.text("follow", expected)?;
    match word.as_str() {
        "fast" => Some(PiperFollow::Fast),
        "smooth" => Some(PiperFollow::Smooth),
        other => {
            table.fault("follow", &shown(other), expected);
            None
        }
    }
}

impl Piper {
    fn firmware(&self) -> String {
        String::from_utf8_lossy(&self.firmware).into_owned()
    }
    const fn follow(&self) -> &'static str {
        match self.follow {
            PiperFollow::Fast => "fast",
            PiperFollow::Smooth => "smooth",
        }
    }
}

impl ServoProtocol for Piper {
    fn name(&self) -> &'static str {
        REGISTRATION.name
    }

    /// Its maker documents no watchdog: it holds the last target.
    fn reactions(&self) -> &'static [Reaction] {
        &[Reaction::Hold]
    }

    fn identifiers(&self, node_id: u8) -> Vec<Use> {
        let shared = ARM.into_iter().flat_map(|(first, last, what)| {
            (first..=last).map(move |id| Use::standard(id, what, "node_id").shared())
        });
        let own = JOINT.map(|(base, what)| Use::standard(base + u16::from(node_id), what, "node_id"));
        shared.chain(own).collect()
    }

    /// Thousandths of degrees in 32 bits hold every angle of a joint; the arm's own limits are compared when it is there.
    fn check_joint(&self, _: &Table<'_>, _: &RobotJoint, _: [f64; 2]) {}

    fn check_settings(&self, fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings) {
        motors::check_every_cycle(fault_list, at, servo, settings);
        if let Some(axis) = settings.axis_at(servo.joint) {
            let expected = "a servo of another protocol: the Piper's own gripper has frames that this software does not send yet";
            fault_list.add(None, &format!("servo[{at}].axis"), &format!("{:?}", axis.name()), expected);
        }
        let arm: Vec<(usize, &Servo, &Self)> = settings
            .servos
            .iter()
            .enumerate()
            .filter(|(_, other)| other.bus == servo.bus)
            .filter_map(|(at, other)| Some((at, other, other.protocol.get::<Self>()?)))
            .collect();
        let Some((first, _, piper)) =
            arm.first().filter(|(first, ..)| *first != at || arm.len() != PIPER_JOINTS)
        else {
            return;
        };
        if *first == at {
            let value = format!("{} of its joints on this bus", arm.len());
            let expected =
                "all six: the arm's frames hold targets of joints in pairs, and none may be left out";
            fault_list.add(None, &format!("servo[{at}].protocol"), &value, expected);
        } else if *piper != self {
            let expected = format!("what servo[{first}] says ({}): they are one arm", piper.sentence());
            fault_list.add(None, &format!("servo[{at}].protocol"), &self.sentence(), &expected);
        }
    }

    fn flows(&self, _: &[Protocol], _: &Bus, cycle_hz: f64, format: Format) -> Vec<Flow> {
        let frame = Frame::standard(format, FRAME_BYTES);
        vec![
            periodic("targets", frame, TARGET_FRAMES, cycle_hz),
            Flow { what: "what the arm sends", frame, rate_hz: FEEDBACK_HZ, burst: 0 },
        ]
    }

    fn entries(&self) -> Vec<(&'static str, Value)> {
        vec![
            ("firmware", self.firmware().into()),
            ("speed_percent", self.speed_percent.into()),
            ("follow", self.follow().into()),
        ]
    }

    fn sentence(&self) -> String {
        format!(
            "firmware {}, follows {} at {} %, no watchdog: it holds the last target, and falls when it is disabled",
            self.firmware(),
            self.follow(),
            self.speed_percent
        )
    }
}
