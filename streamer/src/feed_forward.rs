//! Torque beside the position: what the model of the arm says that a setpoint needs.
//!
//! It is computed from the setpoint that has passed the guard, a braking one included, and passes the torque guard before it is
//! sent. Masses are those of the robot file, its payload included; what the planner's scene attaches does not count.
use crate::cycle_state::CycleState;
use crate::guard::GuardedCommand;
use crate::last_sent::Ledger;
use crate::torque_guard::TorqueGuard;
use taustream_arm::{JointTorque, Settings};
use taustream_drivers::ServoStatus;
use taustream_motion::dynamics::Dynamics;
use taustream_motion::{JointArray, MAX_JOINTS, Setpoint};

/// Speed at which dry friction is compensated by three quarters; below it less, at rest not at all: the direction in which
/// friction holds a joint at rest is not known.
const FRICTION_SPEED_RAD_S: f64 = 0.02;

/// What settings ask for, with the arm's dynamics.
#[derive(Clone, Debug)]
struct Model {
    settings: taustream_arm::FeedForward,
    dynamics: Option<Dynamics>,
}

impl Model {
    fn torque_nm(&self, at: &Setpoint) -> JointArray {
        let mut torques = self.mass_torque_nm(at);
        for ((torque, joint), velocity_rad_s) in
            torques.iter_mut().zip(&self.settings.joints).zip(&at.velocity_rad_s)
        {
            let friction_nm = joint.map_or(0.0, |joint| friction_nm(&joint, *velocity_rad_s));
            *torque = self.settings.share * (*torque + friction_nm);
        }
        torques
    }

    fn mass_torque_nm(&self, at: &Setpoint) -> JointArray {
        let Some(dynamics) = &self.dynamics else { return [0.0; MAX_JOINTS] };
        let Setpoint { position_rad: q, velocity_rad_s: v, acceleration_rad_s2: a, .. } = at;
        match (self.settings.gravity, self.settings.inertia) {
            (false, false) => [0.0; MAX_JOINTS],
            (true, false) => dynamics.holding_nm(q),
            (true, true) => dynamics.torques_nm(q, v, a),
            (false, true) => {
                let mut torques = dynamics.torques_nm(q, v, a);
                torques
                    .iter_mut()
                    .zip(dynamics.holding_nm(q))
                    .for_each(|(torque, holding)| *torque -= holding);
                torques
            }
        }
    }
}

/// Torque against friction at a speed.
fn friction_nm(joint: &JointTorque, velocity_rad_s: f64) -> f64 {
    joint.coulomb_nm * (velocity_rad_s / FRICTION_SPEED_RAD_S).tanh()
        + joint.viscous_nm_s_rad * velocity_rad_s
}

/// The stage that adds torques to commands.
#[derive(Debug)]
pub struct FeedForward {
    model: Option<Model>,
    guard: TorqueGuard,
}

impl FeedForward {
    /// As the settings ask for.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let model = settings.feed_forward.map(|wanted| Model {
            settings: wanted,
            // Settings whose masses are not known were refused.
            dynamics: settings.robot.dynamics().ok().filter(|_| wanted.uses_masses()),
        });
        Self { model, guard: TorqueGuard::new(settings) }
    }

    /// Notes which drives follow.
    ///
    /// Real time: no allocation.
    pub fn read(&mut self, servos: &[ServoStatus; MAX_JOINTS]) {
        if self.model.is_some() {
            self.guard.read(servos);
        }
    }

    /// The command with its torques; none before drives follow.
    ///
    /// Real time: closed forms, no allocation.
    #[must_use]
    pub fn add(&self, command: GuardedCommand, ledger: &Ledger, cycle_state: &CycleState) -> GuardedCommand {
        let Some(model) = self.model.as_ref().filter(|_| cycle_state.live) else { return command };
        let requested_nm = model.torque_nm(command.setpoint());
        command.with_torque(&self.guard.limit(&requested_nm, ledger, cycle_state.tick.number))
    }
}
