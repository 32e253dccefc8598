//! The mechanics of one simulated joint: motor, gear and link as one inertia under torque, friction and gravity.
//!
//! Each joint stands alone: the gravity load is that of a pendulum on the joint's own angle, `m g l` at most, and
//! neither couples to other joints nor changes with their pose, unless the simulator weighs the arm's masses
//! ([`Plant::weight_nm`]). The inertia is one number a joint in either case. That is enough for what the simulator is for:
//! an arm that falls when torque goes, that needs time and torque to follow, and that cannot jump.
//!
//! Semi-implicit Euler with implicit dry friction: stable at rest (no chatter) and for any step well below the
//! closed loop's time constants. Link side, SI units.

/// What a joint is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantParameters {
    /// Inertia of motor, gear and link about the joint axis, seen at the link.
    pub inertia_kg_m2: f64,
    /// Viscous friction.
    pub viscous_nm_s_rad: f64,
    /// Dry friction.
    pub coulomb_nm: f64,
    /// Greatest gravity torque, `m g l`; it pulls the angle upward (a negative one downward) when level.
    pub gravity_nm: f64,
    /// Angle at which the link is level, where gravity pulls hardest.
    pub gravity_level_rad: f64,
    /// Torque that the motor can give, at the link.
    pub torque_nm_max: f64,
    /// Speed above which the motor has no more torque to accelerate (back-EMF).
    pub speed_rad_s_max: f64,
    /// A brake holds the joint while the motor is not energised.
    pub brake: bool,
    /// How long the brake takes to open or close.
    pub brake_delay_s: f64,
}

/// Brakes are dimensioned to hold well more than the motor gives.
const BRAKE_FACTOR: f64 = 2.0;
/// Share of the speed range over which the torque fades out.
const FADE: f64 = 0.05;

/// Motion of one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plant {
    pub(crate) parameters: PlantParameters,
    pub(crate) position_rad: f64,
    pub(crate) velocity_rad_s: f64,
    /// The joint is jammed.
    pub(crate) jammed: bool,
    /// Link angle that the joint cannot pass, and the direction in which it lies: +1 or -1.
    object: Option<(f64, f64)>,
    /// Torque of the arm's weight in its pose; `None`: the joint is a pendulum.
    pub(crate) weight_nm: Option<f64>,
    energised: bool,
    brake_closed: bool,
    brake_shall_close: bool,
    brake_moves_s: f64,
}

impl Plant {
    /// At rest, de-energised.
    pub(crate) fn new(parameters: PlantParameters, position_rad: f64) -> Self {
        Self {
            parameters,
            position_rad,
            velocity_rad_s: 0.0,
            jammed: false,
            object: None,
            weight_nm: None,
            energised: false,
            brake_closed: parameters.brake,
            brake_shall_close: true,
            brake_moves_s: 0.0,
        }
    }

    /// Power to the motor; the brake opens with it and closes without it, after its delay.
    pub(crate) fn energise(&mut self, energised: bool) {
        self.energised = energised;
        self.shut_brake(!energised);
    }

    /// Begins to close the brake, or to open it, whether the motor is energised or not.
    pub(crate) fn shut_brake(&mut self, shut: bool) {
        if shut != self.brake_shall_close {
            self.brake_shall_close = shut;
            self.brake_moves_s = self.parameters.brake_delay_s;
        }
    }

    /// True when nothing but the motor holds the joint.
    pub(crate) const fn is_free(&self) -> bool {
        !self.brake_closed
    }

    /// Puts a rigid object in the way of the joint, or takes it away.
    pub(crate) fn place_object(&mut self, at_rad: Option<f64>) {
        self.object = at_rad.map(|at_rad| (at_rad, 1.0_f64.copysign(at_rad - self.position_rad)));
    }

    /// Moves on by `dt_s` under a motor torque.
    pub(crate) fn step(&mut self, torque_nm: f64, dt_s: f64) {
        self.move_brake(dt_s);
        let p = self.parameters;
        let motor_nm = if self.energised { self.available_nm(torque_nm) } else { 0.0 };
        let pendulum_nm = p.gravity_nm * (self.position_rad - p.gravity_level_rad).cos();
        let gravity_nm = self.weight_nm.unwrap_or(pendulum_nm);
        let brake_nm = if self.brake_closed { BRAKE_FACTOR * p.torque_nm_max } else { 0.0 };

        // Viscous friction implicitly, so that no coefficient can make it unstable.
        let driven = self.velocity_rad_s + dt_s * (motor_nm + gravity_nm) / p.inertia_kg_m2;
        let driven = driven / (1.0 + dt_s * p.viscous_nm_s_rad / p.inertia_kg_m2);
        // Dry friction takes speed away, at most all of it: it never reverses a motion.
        let held = dt_s * (p.coulomb_nm + brake_nm) / p.inertia_kg_m2;
        self.velocity_rad_s =
            if self.jammed || driven.abs() <= held { 0.0 } else { driven - held.copysign(driven) };
        self.position_rad += dt_s * self.velocity_rad_s;
        if let Some((at_rad, direction)) = self.object
            && (self.position_rad - at_rad) * direction > 0.0
        {
            (self.position_rad, self.velocity_rad_s) = (at_rad, 0.0);
        }
    }

    /// The torque that the motor gives at the present speed: a motor at its speed limit brakes but does not drive.
    fn available_nm(&self, torque_nm: f64) -> f64 {
        let p = self.parameters;
        let wanted = torque_nm.clamp(-p.torque_nm_max, p.torque_nm_max);
        if wanted * self.velocity_rad_s <= 0.0 {
            return wanted;
        }
        let room = 1.0 + (p.speed_rad_s_max - self.velocity_rad_s.abs()) / (FADE * p.speed_rad_s_max);
        wanted * room.clamp(0.0, 1.0)
    }

    fn move_brake(&mut self, dt_s: f64) {
        if self.brake_moves_s > 0.0 {
            self.brake_moves_s -= dt_s;
        }
        if self.brake_moves_s <= 0.0 {
            self.brake_closed = self.parameters.brake && self.brake_shall_close;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 250e-6;

    fn pendulum() -> PlantParameters {
        PlantParameters {
            inertia_kg_m2: 1.0,
            viscous_nm_s_rad: 0.5,
            coulomb_nm: 1.0,
            gravity_nm: 20.0,
            gravity_level_rad: 0.0,
            torque_nm_max: 100.0,
            speed_rad_s_max: 4.0,
            brake: false,
            brake_delay_s: 0.0,
        }
    }

    fn run(plant: &mut Plant, torque_nm: f64, seconds: f64) {
        let mut at_s = 0.0;
        while at_s < seconds {
            plant.step(torque_nm, DT_S);
            at_s += DT_S;
        }
    }

    #[test]
    fn limp_joint_falls_as_a_free_body_at_first_and_comes_to_rest_hanging() {
        let mut parameters = pendulum();
        (parameters.coulomb_nm, parameters.viscous_nm_s_rad) = (0.0, 0.0);
        let mut plant = Plant::new(parameters, 0.0);
        run(&mut plant, 0.0, 0.05);
        // a t^2 / 2 with a = m g l / J = 20 rad/s^2.
        assert!((plant.position_rad - 0.025).abs() < 0.001, "fell {} rad", plant.position_rad);

        let mut plant = Plant::new(pendulum(), 0.0);
        run(&mut plant, 0.0, 30.0);
        // Dry friction of 1 Nm holds within asin(1/20) of the lowest point.
        let lowest = std::f64::consts::FRAC_PI_2;
        assert!((plant.position_rad - lowest).abs() < 0.06, "rests at {} rad", plant.position_rad);
        assert!(plant.velocity_rad_s.abs() < 1e-12);
    }

    #[test]
    fn energy_of_a_frictionless_pendulum_is_kept_over_a_minute() {
        let mut parameters = pendulum();
        (parameters.coulomb_nm, parameters.viscous_nm_s_rad) = (0.0, 0.0);
        let mut plant = Plant::new(parameters, 0.0);
        let energy = |plant: &Plant| 0.5 * plant.velocity_rad_s.powi(2) - 20.0 * plant.position_rad.sin();
        let mut worst = 0.0_f64;
        for _ in 0..240_000 {
            plant.step(0.0, DT_S);
            worst = worst.max(energy(&plant).abs());
        }
        assert!(worst < 0.2, "energy drifts by {worst} J of 20");
    }

    #[test]
    fn brake_holds_a_joint_that_gravity_pulls_and_opens_only_after_its_delay() {
        let mut parameters = pendulum();
        (parameters.brake, parameters.brake_delay_s) = (true, 0.02);
        let mut plant = Plant::new(parameters, 0.3);
        run(&mut plant, 0.0, 1.0);
        assert!((plant.position_rad - 0.3).abs() < 1e-12, "slipped to {}", plant.position_rad);
        plant.energise(true);
        run(&mut plant, 0.0, 0.019);
        assert!(!plant.is_free());
        run(&mut plant, 0.0, 0.5);
        assert!(plant.is_free() && plant.position_rad > 0.4, "still at {}", plant.position_rad);
    }

    #[test]
    fn speed_and_torque_stay_inside_the_motor_whatever_is_asked() {
        let mut parameters = pendulum();
        parameters.gravity_nm = 0.0;
        let mut plant = Plant::new(parameters, 0.0);
        plant.energise(true);
        plant.step(1e12, DT_S);
        assert!(plant.velocity_rad_s <= 100.0 * DT_S, "more than 100 Nm: {}", plant.velocity_rad_s);
        run(&mut plant, 1e12, 2.0);
        assert!((3.9..=4.0 * (1.0 + 2.0 * FADE)).contains(&plant.velocity_rad_s), "{}", plant.velocity_rad_s);
    }

    #[test]
    fn dry_friction_holds_small_torques_and_a_jam_holds_all() {
        let mut parameters = pendulum();
        parameters.gravity_nm = 0.9;
        let mut plant = Plant::new(parameters, 0.0);
        run(&mut plant, 0.0, 1.0);
        assert!(plant.position_rad.abs() < 1e-15);
        plant.energise(true);
        run(&mut plant, 50.0, 0.1);
        assert!(plant.velocity_rad_s > 1.0);
        plant.place_object(Some(plant.position_rad + 0.02));
        let stop_rad = plant.position_rad + 0.02;
        run(&mut plant, 50.0, 0.5);
        assert!((plant.position_rad - stop_rad).abs() < 1e-15, "passed the object: {}", plant.position_rad);
        run(&mut plant, -50.0, 0.1);
        assert!(plant.position_rad < stop_rad - 0.01, "stuck to the object: {}", plant.position_rad);
        plant.jammed = true;
        let at_rad = plant.position_rad;
        run(&mut plant, 50.0, 0.1);
        assert!((plant.position_rad - at_rad).abs() < 1e-15 && plant.velocity_rad_s.abs() < 1e-15);
    }
}
