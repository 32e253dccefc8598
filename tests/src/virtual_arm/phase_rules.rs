//! What the phases of an arm allow: who may be energised, how long a stop may take, what a failed bus forbids.
use taustream_arm::Settings;
use taustream_messages::{Command, Phase};
use taustream_motion::MAX_JOINTS;
use taustream_motion::stopping::StopRules;

/// After the phase of energising has ended a drive may still come on by a frame that was on its way, ms.
const ON_ITS_WAY_MS: u64 = 20;
/// Rest is expected so long after the last setpoint that moved, ms: a motor in MIT mode is a spring, whose swing fades with a
/// time constant of 0.16 s at the shipped gains and inertias, from the largest speed to [`MOVING_RAD_S`] in 0.7 s.
const REST_AFTER_MS: u64 = 1_000;
/// Above this a joint moves, rad/s.
const MOVING_RAD_S: f64 = 0.05;
/// Cycles beyond the stated ones until a bus counts as failed: the cycle in which it fails, and the next one's evaluation.
const EVALUATION_CYCLES: u64 = 3;

/// One cycle as seen from outside.
#[derive(Clone, Copy, Debug)]
pub struct ArmView {
    /// Cycle number.
    pub tick: u64,
    /// Ticks that were skipped before it.
    pub skipped: u64,
    /// The phase after it.
    pub phase: Phase,
    /// A bus cannot carry frames.
    pub bus_lost: bool,
    /// Drives that follow commands.
    pub enabled: [bool; MAX_JOINTS],
    /// True speeds of the links.
    pub speed_rad_s: [f64; MAX_JOINTS],
    /// A drive was disturbed within the last second, or still is.
    pub disturbed: bool,
}

/// Phases in which setpoints move.
pub(crate) fn moves(phase: Phase) -> bool {
    matches!(phase, Phase::Moving | Phase::Pausing | Phase::Stopping | Phase::FastStopping | Phase::Braking)
}

/// Follows the phases.
#[derive(Clone, Debug)]
pub(crate) struct PhaseRules {
    stop_ticks: u64,
    brake_ticks: u64,
    lost_cycles_max: u64,
    /// An operator's `enable` was accepted and not used up.
    permitted: bool,
    phase: Phase,
    /// Ticks in which the phase of now has run, those not counted that were skipped.
    in_phase: u64,
    energising: Option<u64>,
    enabled: [bool; MAX_JOINTS],
    lost_cycles: u64,
    last_moved: u64,
}

impl PhaseRules {
    /// The rules of an arm.
    pub(crate) fn new(settings: &Settings) -> Self {
        let (limits, joints) = (settings.robot.limits(), settings.robot.joints.len());
        let period_s = f64::from(settings.cycle.period_us) * 1e-6;
        // To no acceleration, which adds speed; to the largest deceleration; down; and the acceleration out again.
        let brakes_s = limits.iter().take(joints).map(|limits| {
            let [a, j] = [limits.stop.acceleration_rad_s2, limits.stop.jerk_rad_s3];
            limits.stop.velocity_rad_s / a + 2.5 * a / j
        });
        let every = settings.buses.iter().map(|bus| bus.traffic.setpoint_every).max().unwrap_or(1);
        let ticks = |seconds: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few seconds")]
            let ticks = (seconds / period_s).ceil() as u64;
            // Setpoints that take turns end a turn later; the phase changes in the cycle after.
            ticks + u64::from(every) + 2
        };
        Self {
            stop_ticks: ticks(StopRules::new(&limits, joints).longest_stop_s()),
            brake_ticks: ticks(brakes_s.fold(0.0, f64::max)),
            lost_cycles_max: u64::from(settings.lost_cycles_max()),
            permitted: false,
            phase: Phase::Configuring,
            in_phase: 0,
            energising: None,
            enabled: [false; MAX_JOINTS],
            lost_cycles: 0,
            last_moved: 0,
        }
    }

    /// A command was accepted.
    pub(crate) fn accepted(&mut self, command: Command) {
        self.permitted |= command == Command::Enable;
    }

    /// Takes in one cycle; what is wrong with it.
    pub(crate) fn check(&mut self, view: &ArmView) -> Vec<String> {
        let mut wrong = Vec::new();
        self.in_phase = if view.phase == self.phase { self.in_phase + 1 } else { 0 };
        if moves(view.phase) || moves(self.phase) || view.phase == Phase::Enabling {
            self.last_moved = view.tick;
        }
        if view.phase == Phase::Enabling {
            self.energising = Some(view.tick);
        }
        self.check_energised(view, &mut wrong);
        if view.skipped > 0 {
            // A stall parts joints whose setpoints take turns, or were lost; a fade-out of one ramp brings them together.
            self.in_phase = 0;
        }
        let stops = matches!(view.phase, Phase::Pausing | Phase::Stopping | Phase::FastStopping);
        let brakes = view.phase == Phase::Braking;
        let most = stops.then_some(self.stop_ticks).or(brakes.then_some(self.brake_ticks));
        if let Some(most) = most.filter(|most| self.in_phase > *most) {
            wrong.push(format!("{:?} for {} cycles; it ends within {most}", view.phase, self.in_phase));
            self.in_phase = 0;
        }
        self.lost_cycles = if view.bus_lost { self.lost_cycles + 1 } else { 0 };
        if self.lost_cycles > self.lost_cycles_max + EVALUATION_CYCLES && view.phase == Phase::Moving {
            wrong.push(format!("moving with a bus that was lost {} cycles ago", self.lost_cycles));
            self.lost_cycles = 0;
        }
        let rests = view.tick.saturating_sub(self.last_moved) > REST_AFTER_MS && !view.disturbed;
        let moving = view.speed_rad_s.iter().position(|speed| speed.abs() > MOVING_RAD_S);
        if let (true, Some(joint)) = (rests, moving) {
            let speed_rad_s = view.speed_rad_s[joint];
            wrong.push(format!("joint {} turns at {speed_rad_s} rad/s in {:?}", joint + 1, view.phase));
        }
        if matches!(view.phase, Phase::Disabled | Phase::Configuring) {
            self.permitted = false;
        }
        self.phase = view.phase;
        wrong
    }

    fn check_energised(&mut self, view: &ArmView, wrong: &mut Vec<String>) {
        let energising = self.energising.is_some_and(|at| view.tick.saturating_sub(at) <= ON_ITS_WAY_MS);
        for (joint, (before, now)) in self.enabled.iter_mut().zip(view.enabled).enumerate() {
            if now && !*before && !(self.permitted && energising) {
                wrong.push(format!("joint {} is energised in {:?} without `enable`", joint + 1, view.phase));
            }
            *before = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_arm::arms;

    fn rules() -> PhaseRules {
        PhaseRules::new(&arms::ALL[0].settings().unwrap())
    }

    fn view(tick: u64, phase: Phase) -> ArmView {
        ArmView {
            tick,
            skipped: 0,
            phase,
            bus_lost: false,
            enabled: [false; MAX_JOINTS],
            speed_rad_s: [0.0; MAX_JOINTS],
            disturbed: false,
        }
    }

    fn found(rules: &mut PhaseRules, views: impl Iterator<Item = ArmView>) -> Vec<String> {
        views.flat_map(|view| rules.check(&view)).collect()
    }

    #[test]
    fn moving_on_a_lost_bus_is_found_and_a_stop_is_not() {
        let lost = |phase| move |tick| ArmView { bus_lost: tick > 5, ..view(tick, phase) };
        assert!(found(&mut rules(), (1..12).map(lost(Phase::Moving))).is_empty());
        let wrong = found(&mut rules(), (1..20).map(lost(Phase::Moving)));
        assert!(wrong.iter().any(|text| text.contains("lost")), "{wrong:?}");
        assert!(found(&mut rules(), (1..20).map(lost(Phase::FastStopping))).is_empty());
    }

    #[test]
    fn stop_without_an_end_is_found() {
        for phase in [Phase::Stopping, Phase::Pausing, Phase::FastStopping, Phase::Braking] {
            let wrong = found(&mut rules(), (1..5_000).map(|tick| view(tick, phase)));
            assert!(wrong.iter().any(|text| text.contains("ends within")), "{phase:?}: {wrong:?}");
        }
    }

    #[test]
    fn drive_that_comes_on_without_enable_is_found_and_with_it_is_not() {
        let on = |tick| ArmView { enabled: [tick > 3; MAX_JOINTS], ..view(tick, Phase::Enabling) };
        assert!(!found(&mut rules(), (1..6).map(on)).is_empty());
        let mut permitted = rules();
        permitted.accepted(Command::Enable);
        assert!(found(&mut permitted, (1..6).map(on)).is_empty());
    }

    #[test]
    fn joint_that_turns_while_the_arm_holds_is_found() {
        let turns = |tick| ArmView { speed_rad_s: [0.1; MAX_JOINTS], ..view(tick, Phase::Holding) };
        assert!(found(&mut rules(), (1..900).map(turns)).is_empty());
        assert!(!found(&mut rules(), (1..1_100).map(turns)).is_empty());
    }
}
