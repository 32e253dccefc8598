//! The mechanics of a simulated motor that takes gains in each command: the spring and damper that they make of it.
use super::mechanics::Mechanics;
use super::plant::PlantParameters;
use crate::codec::mit::{MitCommand, MitState};
use crate::servo::Nanos;

/// Where the motor sits on the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// Motor direction against link direction, +1.0 or -1.0.
    pub sign: f64,
    /// Link angle where the motor says 0.
    pub zero_offset_rad: f64,
    /// Link angle at power-up.
    pub start_rad: f64,
    /// Mechanics.
    pub plant: PlantParameters,
    /// Step of the simulated mechanics, 10,000 to 1,000,000 ns.
    pub step_ns: u64,
}

/// The torque of `kp (p - q) + kd (v - w) + t`, taken at the end of the step: stable for any gains. Motor side.
pub(crate) fn spring_nm(
    command: &MitCommand,
    [q_rad, w_rad_s]: [f64; 2],
    inertia_kg_m2: f64,
    dt_s: f64,
) -> f64 {
    let (kp, kd) = (command.stiffness_nm_rad, command.damping_nm_s_rad);
    let wanted_nm = kp * (command.position_rad - q_rad - dt_s * w_rad_s)
        + kd * (command.velocity_rad_s - w_rad_s)
        + command.torque_nm;
    wanted_nm / (1.0 + dt_s * (kd + dt_s * kp) / inertia_kg_m2)
}

/// A motor on its joint. Angles are the motor's own unless they are said to be the link's.
#[derive(Clone, Debug)]
pub(crate) struct Impedance {
    mounting: Mounting,
    pub(crate) mechanics: Mechanics,
    /// The newest command. A motor without torque keeps it and takes it up when it is energised: the worst that the
    /// manuals leave open.
    pub(crate) commanded: MitCommand,
    energised: bool,
    torque_nm: f64,
    /// Angle that counts as zero.
    zero_shift_rad: f64,
}

impl Impedance {
    pub(crate) fn new(mounting: Mounting) -> Self {
        Self {
            mechanics: Mechanics::new(mounting.plant, mounting.start_rad, mounting.step_ns),
            mounting,
            commanded: MitCommand::default(),
            energised: false,
            torque_nm: 0.0,
            zero_shift_rad: 0.0,
        }
    }

    pub(crate) const fn is_energised(&self) -> bool {
        self.energised
    }

    pub(crate) fn energise(&mut self, energised: bool) {
        self.energised = energised;
        self.torque_nm = 0.0;
        self.mechanics.plant.energise(energised);
    }

    /// Moves the mechanics up to the last whole step before `now`. The motor gives `torque_nm_max` at most.
    pub(crate) fn move_on(&mut self, now: Nanos, torque_nm_max: f64) {
        let dt_s = self.mechanics.step_s();
        for _ in self.mechanics.due(now) {
            self.torque_nm = if self.energised { self.spring_nm(dt_s, torque_nm_max) } else { 0.0 };
            self.mechanics.plant.step(self.mounting.sign * self.torque_nm, dt_s);
        }
    }

    fn spring_nm(&self, dt_s: f64, torque_nm_max: f64) -> f64 {
        let at = [self.read_rad(0.0), self.mechanics.plant.velocity_rad_s * self.mounting.sign];
        let wanted_nm = spring_nm(&self.commanded, at, self.mounting.plant.inertia_kg_m2, dt_s);
        wanted_nm.clamp(-torque_nm_max, torque_nm_max)
    }

    /// Angle of the output shaft as the motor reads it, `ahead_s` after the last whole step.
    fn read_rad(&self, ahead_s: f64) -> f64 {
        let link_rad = self.mechanics.read_rad(ahead_s);
        (link_rad - self.mounting.zero_offset_rad) * self.mounting.sign - self.zero_shift_rad
    }

    /// What the motor measures.
    pub(crate) fn state(&self, now: Nanos) -> MitState {
        MitState {
            position_rad: self.read_rad(self.mechanics.ahead_s(now)),
            velocity_rad_s: self.mechanics.plant.velocity_rad_s * self.mounting.sign,
            torque_nm: self.torque_nm,
        }
    }

    /// From now on the motor reads this angle where it stands.
    pub(crate) fn set_reading(&mut self, position_rad: f64) {
        self.zero_shift_rad += self.read_rad(0.0) - position_rad;
    }
}
