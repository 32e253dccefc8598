//! Ways in which simulated CiA 402 drives depart from what masters expect, as drives that are sold do.
//!
//! Objects that are absent, fixed, wider or refused with another abort code are [`super::PlantedObject`]s.
use super::drive::Drive;
use super::drive_motion::{counts, whole};
use super::objects::INVALID;
use super::power::PowerState;
use crate::codec::canopen::{COB_PDO_STEP, COB_RPDO1, COB_TPDO1, PDO_NO_RTR};
use crate::codec::{Address, SdoResponse};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use std::collections::VecDeque;

/// What a drive does otherwise; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveQuirks {
    /// PDO 1 is mapped and on as cyclic synchronous position needs it, the others are off, and none can be changed.
    pub fixed_pdos: bool,
    /// The modes display (0x6061) follows only in operation enabled.
    pub late_mode_display: bool,
    /// Setpoints are cut off at the speed of its limits (0x607F, 0x6080).
    pub limits_setpoints: bool,
    /// Time that an SDO answer takes.
    pub sdo_answer_s: f64,
    /// Time from the command to switch on to the state switched on.
    pub switch_on_s: f64,
    /// Rising edges that a fault reset takes, beyond the first.
    pub reset_edges: u8,
    /// How often it falls from ready-to-switch-on to switch-on-disabled after a power-up, instead of switching on.
    pub falls_back: u8,
}

/// What the quirks of a drive remember.
#[derive(Clone, Debug, Default)]
pub(super) struct QuirkState {
    /// Since when it is switching on.
    switching: Option<Nanos>,
    /// Rising edges of fault reset in this fault.
    edges: u8,
    reset_bit: bool,
    fallen: u8,
    /// SDO answers on their way.
    answers: VecDeque<(Nanos, SdoResponse)>,
}

/// Controlword bit 7.
const FAULT_RESET: u16 = 0x80;
/// Bits of the controlword that command switch-on, or switch-on and enable, and their value.
const SWITCH_ON: (u16, u16) = (0x87, 0x07);
const SHUTDOWN: u16 = 0x06;
const DISABLE_VOLTAGE: u16 = 0x00;

impl Drive {
    /// The controlword that acts, in place of the one that was commanded.
    pub(super) fn acting_controlword(&mut self, now: Nanos, word: u16) -> u16 {
        let quirks = self.parameters.quirks;
        let state = self.power.state();
        let rises = word & FAULT_RESET != 0 && !self.quirks.reset_bit;
        self.quirks.reset_bit = word & FAULT_RESET != 0;
        if state == PowerState::Fault {
            self.quirks.edges = self.quirks.edges.saturating_add(u8::from(rises));
            return if self.quirks.edges > quirks.reset_edges { word } else { word & !FAULT_RESET };
        }
        self.quirks.edges = 0;
        let switches_on = state == PowerState::ReadyToSwitchOn && word & SWITCH_ON.0 == SWITCH_ON.1;
        if !switches_on {
            self.quirks.switching = None;
            return word;
        }
        if self.quirks.fallen < quirks.falls_back {
            self.quirks.fallen += 1;
            return DISABLE_VOLTAGE;
        }
        let since = *self.quirks.switching.get_or_insert(now);
        if now.since_s(since) < quirks.switch_on_s { SHUTDOWN } else { word }
    }

    /// A setpoint as the drive takes it, where it cuts off at its limits of speed; counts.
    pub(super) fn within_speed(&self, target: i64, period_s: f64) -> i64 {
        if !self.parameters.quirks.limits_setpoints {
            return target;
        }
        let profile = whole(self.dictionary.get(0x607F, 0));
        let motor = whole(self.dictionary.get(0x6080, 0)) / 60.0 * self.parameters.counts_per_rev;
        #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
        let step = (profile.min(motor) * period_s).round() as i64;
        let before = i64::from(counts(self, self.controller.target_rad()));
        target.clamp(before.saturating_sub(step), before.saturating_add(step))
    }

    /// It is switching on, and the time for it has passed.
    pub(super) fn has_switched_on(&self, now: Nanos) -> bool {
        self.quirks.switching.is_some_and(|since| {
            self.power.state() == PowerState::ReadyToSwitchOn
                && now.since_s(since) >= self.parameters.quirks.switch_on_s
        })
    }

    /// Sends an SDO answer now, or when its time has come.
    pub(super) fn send_answer(&mut self, now: Nanos, answer: SdoResponse, out: &mut Vec<CanFrame>) {
        if self.parameters.quirks.sdo_answer_s > 0.0 {
            self.quirks.answers.push_back((now, answer));
        } else {
            out.push(answer.encode(self.parameters.node_id));
        }
    }

    /// Sends the SDO answers whose time has come.
    pub(super) fn send_late_answers(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        let (takes_s, node) = (self.parameters.quirks.sdo_answer_s, self.parameters.node_id);
        while let Some((_, answer)) =
            self.quirks.answers.pop_front_if(|(asked, _)| now.since_s(*asked) >= takes_s)
        {
            out.push(answer.encode(node));
        }
    }

    /// The power went, or the communication was reset.
    pub(super) fn forget_quirks(&mut self, communication_only: bool) {
        if communication_only {
            self.quirks.answers.clear();
        } else {
            self.quirks = QuirkState::default();
        }
    }
}

/// The values of the PDO parameters that [`DriveQuirks::fixed_pdos`] fixes.
pub(super) fn fixed_pdos(node_id: u8) -> Vec<(Address, i64)> {
    /// Controlword and target position; statusword and position.
    const MAPPED: [(u16, [i64; 2]); 2] =
        [(0x1600, [0x6040_0010, 0x607A_0020]), (0x1A00, [0x6041_0010, 0x6064_0020])];
    let node = i64::from(node_id);
    let mut all = Vec::new();
    for number in 0..super::objects::PDOS {
        let off = if number == 0 { 0 } else { INVALID };
        let step = i64::from(number * COB_PDO_STEP);
        all.push((Address::new(0x1400 + number, 1), off + i64::from(COB_RPDO1) + step + node));
        let no_rtr = i64::from(PDO_NO_RTR);
        all.push((Address::new(0x1800 + number, 1), off + no_rtr + i64::from(COB_TPDO1) + step + node));
    }
    for (mapping, entries) in MAPPED {
        all.push((Address::new(mapping - 0x200, 2), 1));
        all.push((Address::new(mapping, 0), 2));
        all.extend((1..).zip(entries).map(|(sub, entry)| (Address::new(mapping, sub), entry)));
    }
    all
}
