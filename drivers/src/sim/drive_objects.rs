//! A simulated drive's dictionary as SDO and PDOs meet it: rules that tie objects together, and live values.
use super::dictionary::{AbortCode, Bytes, Dictionary};
use super::drive::{Drive, DriveParameters};
use super::drive_motion::{counts, reaction_code};
use super::objects::{Access, CONSUMERS, HISTORY};
use super::pdo::{self, Pdos};
use super::planted::{ObjectChange, PlantedObject, as_ratio};
use super::power::PowerState;
use super::quirks::fixed_pdos;
use super::sdo_server::Objects;
use crate::codec::digital_inputs::{NEGATIVE_LIMIT, POSITIVE_LIMIT};
use crate::codec::object::{RPDO_COMMUNICATION, TPDO_MAPPING};
use crate::codec::{Address, error_text};
use crate::frame::CanFrame;

/// "save", least significant byte first.
const SAVE: i64 = 0x6576_6173;
/// "load", least significant byte first.
const LOAD: i64 = 0x6461_6F6C;

/// An SDO request at work on a drive.
pub(super) struct Session<'a> {
    pub(super) drive: &'a mut Drive,
    /// Where emergencies go that a write provokes.
    pub(super) out: &'a mut Vec<CanFrame>,
}

impl Objects for Session<'_> {
    fn read(&mut self, address: Address) -> Result<Bytes, AbortCode> {
        self.drive.publish();
        self.drive.publish_history();
        let value = self.drive.dictionary.read(address)?;
        if address.index == 0x1003 && address.sub > self.drive.errors.count() {
            // CiA 301, 0x1003: the subindex exists, but nothing has been entered there.
            return Err(error_text::ABORT_NO_DATA);
        }
        Ok(value)
    }

    fn write(&mut self, address: Address, bytes: &[u8], sized: bool) -> Result<(), AbortCode> {
        let drive = &mut *self.drive;
        let value = drive.dictionary.check_write(address, bytes, sized)?;
        if drive.refuse_writes != 0 {
            return Err(drive.refuse_writes);
        }
        pdo::check_write(&drive.dictionary, address, value)?;
        if !drive.parameters.dummy_mapping && pdo::maps_dummy(address, value) {
            return Err(error_text::ABORT_NOT_MAPPABLE);
        }
        drive.check_write(address, value)?;
        if !matches!(address.index, 0x1003 | 0x1010 | 0x1011 | 0x2002) {
            drive.dictionary.set(address.index, address.sub, value);
        }
        drive.written(address, value, self.out);
        Ok(())
    }
}

impl Drive {
    /// The dictionary with the values that this drive is shipped with.
    pub(super) fn shipped(parameters: &DriveParameters) -> Dictionary {
        let mut dictionary = Dictionary::new(parameters.node_id);
        let per_rad = parameters.counts_per_rad();
        let limits = parameters.soft_limit_rad.map(|angle_rad| {
            register((angle_rad - parameters.zero_offset_rad) * per_rad, i32::MIN, i32::MAX)
        });
        let window = parameters.following_window_rad * per_rad.abs();
        let speed = parameters.plant.speed_rad_s_max * per_rad.abs();
        for (index, sub, value) in [
            (0x2000, 1, i64::from(parameters.watchdog_ms)),
            (0x2000, 2, reaction_code(parameters.reaction)),
            (0x6065, 0, register(window, 0, i32::MAX)),
            (0x6066, 0, i64::from(parameters.following_timeout_ms)),
            (0x6076, 0, register(parameters.stated_rated_nm() * 1000.0, 0, i32::MAX)),
            (0x607C, 0, i64::from(parameters.home_offset_counts)),
            (0x607D, 1, limits[0].min(limits[1])),
            (0x607D, 2, limits[0].max(limits[1])),
            (0x607F, 0, register(speed, 1, i32::MAX)),
            (0x6080, 0, register(60.0 * speed / parameters.counts_per_rev, 1, i32::MAX)),
            (0x6081, 0, register(0.5 * speed, 1, i32::MAX)),
            (0x6083, 0, register(parameters.slow_rad_s2 * per_rad.abs(), 1, i32::MAX)),
            (0x6084, 0, register(parameters.slow_rad_s2 * per_rad.abs(), 1, i32::MAX)),
            (0x6099, 1, register(0.1 * speed, 1, i32::MAX)),
            (0x6099, 2, register(0.01 * speed, 1, i32::MAX)),
            (0x609A, 0, register(parameters.slow_rad_s2 * per_rad.abs(), 1, i32::MAX)),
            (0x60C5, 0, register(2.0 * parameters.quick_rad_s2 * per_rad.abs(), 1, i32::MAX)),
            (0x60C6, 0, register(2.0 * parameters.quick_rad_s2 * per_rad.abs(), 1, i32::MAX)),
            (0x6085, 0, register(parameters.quick_rad_s2 * per_rad.abs(), 1, i32::MAX)),
        ] {
            dictionary.ship(Address::new(index, sub), value);
        }
        for (index, value) in [
            (0x608F, parameters.counts_per_rev),
            (0x6091, parameters.gear_ratio),
            (0x6092, parameters.counts_per_rev * parameters.gear_ratio),
        ] {
            for (at, sub) in [1, 2].into_iter().enumerate() {
                let part = as_ratio(value).and_then(|ratio| ratio.get(at).copied());
                // A drive that cannot state a number does not have the object.
                let change = part.map_or(ObjectChange::Absent, ObjectChange::Value);
                let _has_it = dictionary.plant(PlantedObject { address: Address::new(index, sub), change });
            }
        }
        if parameters.quirks.fixed_pdos {
            for (address, value) in fixed_pdos(parameters.node_id) {
                dictionary.ship(address, value);
            }
            dictionary.fix(RPDO_COMMUNICATION..=0x1AFF);
        }
        dictionary
    }

    /// Writes the live values into the dictionary, as they are now.
    pub(super) fn publish(&mut self) {
        let ahead_s = self.mechanics.ahead_s(self.now);
        let per_rad = self.parameters.counts_per_rad();
        let torque = 1000.0 * self.controller.torque_nm() / self.parameters.unit_nm();
        let velocity = register(self.mechanics.plant.velocity_rad_s * per_rad, i32::MIN, i32::MAX);
        let demand = counts(self, self.controller.reference_rad());
        for (index, value) in [
            (0x1001, i64::from(self.errors.register())),
            (0x603F, i64::from(self.errors.code())),
            (0x6041, i64::from(self.statusword())),
            (0x6061, self.mode_display()),
            (0x6062, i64::from(demand)),
            (0x6064, i64::from(self.counts(ahead_s))),
            (0x606C, velocity),
            (0x6077, register(torque * self.parameters.sign, i32::from(i16::MIN), i32::from(i16::MAX))),
            (0x60F4, self.following_error()),
            (0x60FD, self.digital_inputs()),
        ] {
            self.dictionary.set(index, 0, value);
        }
    }

    fn mode_display(&self) -> i64 {
        let hidden =
            self.parameters.quirks.late_mode_display && self.power.state() != PowerState::OperationEnabled;
        if hidden { 0 } else { self.dictionary.get(0x6060, 0) }
    }

    /// The statusword.
    #[must_use]
    pub fn statusword(&self) -> u16 {
        let state = self.power.state();
        let powered = matches!(
            state,
            PowerState::SwitchedOn
                | PowerState::OperationEnabled
                | PowerState::QuickStopActive
                | PowerState::FaultReactionActive
        );
        let bit = |on: bool, at: u16| u16::from(on) << at;
        state.status_bits()
            | bit(powered, 4)
            | bit(self.warning || self.held, 7)
            | bit(true, 9)
            | bit(self.limited || self.forced_inputs & (NEGATIVE_LIMIT | POSITIVE_LIMIT) != 0, 11)
            | self.mode_bits()
    }

    /// Takes the heartbeats to watch from the dictionary.
    pub(super) fn watch_heartbeats(&mut self) {
        for sub in 1..=CONSUMERS {
            self.consumers.set(usize::from(sub - 1), self.dictionary.get(0x1016, sub));
        }
    }

    fn publish_history(&mut self) {
        self.dictionary.set(0x1003, 0, i64::from(self.errors.count()));
        for sub in 1..=HISTORY {
            self.dictionary.set(0x1003, sub, i64::from(self.errors.entry(sub)));
        }
    }

    /// Rules beyond one object's range.
    fn check_write(&self, address: Address, value: i64) -> Result<(), AbortCode> {
        let energised = self.power.is_energised();
        match address.index {
            0x1010 if value != SAVE => Err(error_text::ABORT_STORE),
            0x1011 if value != LOAD => Err(error_text::ABORT_STORE),
            0x1010 | 0x1011 if energised => Err(error_text::ABORT_DEVICE_STATE),
            // CiA 301: one node may be watched by one entry only.
            0x1016 if self.watched_elsewhere(address.sub, value) => Err(error_text::ABORT_INCOMPATIBLE),
            // CiA 301: 1 is reserved, and the counter changes only while the SYNC period is 0.
            0x1019 if value == 1 => Err(error_text::ABORT_RANGE),
            0x1019 if self.dictionary.get(0x1006, 0) != 0 => Err(error_text::ABORT_DEVICE_STATE),
            // Changing the mode of a moving motor would take its setpoint away.
            0x6060 if value != self.dictionary.get(0x6060, 0) && !self.may_leave_mode(value) => {
                Err(error_text::ABORT_DEVICE_STATE)
            }
            _ => Ok(()),
        }
    }

    fn watched_elsewhere(&self, sub: u8, entry: i64) -> bool {
        let active = |entry: i64| entry & 0xFFFF != 0 && entry >> 16 != 0;
        (1..=CONSUMERS).filter(|other| *other != sub).any(|other| {
            let theirs = self.dictionary.get(0x1016, other);
            active(theirs) && active(entry) && theirs >> 16 == entry >> 16
        })
    }

    /// What a written object sets in motion.
    fn written(&mut self, address: Address, value: i64, out: &mut Vec<CanFrame>) {
        match address.index {
            0x1003 => self.errors.clear_history(),
            0x1010 => self.dictionary.store(),
            0x1011 => self.dictionary.restore(),
            0x1016 => self.watch_heartbeats(),
            RPDO_COMMUNICATION..=0x17FF | 0x1800..TPDO_MAPPING | TPDO_MAPPING..=0x1AFF => {
                self.pdos = Pdos::compile(&self.dictionary);
            }
            0x60FE => self.work_brake(),
            0x2002 => self.fail(u16::try_from(value).unwrap_or(0x1000), out),
            0x6040 | 0x6060 | 0x607A | 0x60B0..=0x60B2 | 0x60C1 | 0x60FF => self.commanded(self.now, out),
            _ => {}
        }
    }
}

impl Dictionary {
    /// Takes a value from an RPDO; one that an SDO could not write either is ignored.
    pub(super) fn take(&mut self, address: Address, value: i64) {
        let fits = self.spec(address).is_ok_and(|spec| {
            let listed = spec.choices.is_empty() || spec.choices.contains(&value);
            spec.access == Access::ReadWrite && listed && (spec.low..=spec.high).contains(&value)
        });
        if fits {
            self.set(address.index, address.sub, value);
        }
    }
}

/// A computed value as a register holds it: whole, and at the ends of its range when beyond.
fn register(value: f64, low: i32, high: i32) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "clamped to 32 bits")]
    let whole = value.round().clamp(f64::from(low), f64::from(high)) as i64;
    whole
}
