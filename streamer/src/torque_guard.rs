//! The last check of torques before the bus: what passes it is finite, at most the joint's limit, and changes no faster than
//! the joint's rate from the torque that was sent last.
//!
//! A joint gets a torque only while its drive follows with its full gains. From then on the torque rises from zero by the rate:
//! a model that is wrong moves the joint slowly, by the rate over the drive's stiffness.
use crate::last_sent::{LastSent, Ledger};
use taustream_arm::settings::SETPOINT_EVERY_MAX;
use taustream_arm::{JointTorque, Settings};
use taustream_drivers::{DriveState, JointSet, ServoStatus};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Limits of the torques of an arm.
#[derive(Clone, Debug)]
pub struct TorqueGuard {
    limits: [Option<JointTorque>; MAX_JOINTS],
    period_s: f64,
    /// Joints whose drives have ended the ramp of enabling and follow.
    following: JointSet,
}

impl TorqueGuard {
    /// The limits that settings state; without any no torque passes.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            limits: settings.feed_forward.map_or([None; MAX_JOINTS], |feed_forward| feed_forward.joints),
            period_s: f64::from(settings.cycle.period_us) * 1e-6,
            following: JointSet::EMPTY,
        }
    }

    /// Notes which drives follow.
    ///
    /// Real time: no allocation.
    pub fn read(&mut self, servos: &[ServoStatus; MAX_JOINTS]) {
        let follows = |(joint, servo): (usize, &ServoStatus)| {
            if servo.state == DriveState::Enabled { JointSet::of(joint) } else { JointSet::EMPTY }
        };
        self.following = servos.iter().enumerate().map(follows).fold(JointSet::EMPTY, JointSet::union);
    }

    /// What passes of the torques that a model requests, in cycle `tick`.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn limit(&self, requested_nm: &JointArray, ledger: &Ledger, tick: u64) -> JointArray {
        let mut passed = [0.0; MAX_JOINTS];
        let joints = self.limits.iter().zip(ledger.joints()).zip(requested_nm);
        for (joint, (slot, ((limit, last), requested_nm))) in passed.iter_mut().zip(joints).enumerate() {
            if let Some(limit) = limit.as_ref().filter(|_| self.following.contains(joint)) {
                *slot = self.limit_joint(limit, last, *requested_nm, tick);
            }
        }
        passed
    }

    fn limit_joint(&self, limit: &JointTorque, last: &LastSent, requested_nm: f64, tick: u64) -> f64 {
        // What is no number is no torque; the one that acts is withdrawn by the rate.
        let requested_nm = if requested_nm.is_finite() { requested_nm } else { 0.0 };
        let most_nm = limit.torque_nm_max;
        // A drive that has missed setpoints is not made to catch up.
        let periods = u32::try_from(last.periods_to(tick)).unwrap_or(u32::MAX).min(SETPOINT_EVERY_MAX);
        let step_nm = limit.rate_nm_s_max * self.period_s * f64::from(periods);
        let sent_nm = last.torque_nm;
        requested_nm.clamp(-most_nm, most_nm).clamp(sent_nm - step_nm, sent_nm + step_nm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cycle_state::CycleState;
    use crate::guard::Guard;
    use crate::tick::Tick;
    use crate::track::RequestedSetpoint;
    use taustream_motion::{JointLimits, Setpoint};

    const JOINT: JointTorque =
        JointTorque { torque_nm_max: 10.0, rate_nm_s_max: 100.0, coulomb_nm: 0.0, viscous_nm_s_rad: 0.0 };
    const STEP_NM: f64 = 0.1;

    fn servos(state: DriveState) -> [ServoStatus; MAX_JOINTS] {
        [ServoStatus { state, ..ServoStatus::UNKNOWN }; MAX_JOINTS]
    }

    fn guard() -> TorqueGuard {
        let mut guard =
            TorqueGuard { limits: [None; MAX_JOINTS], period_s: 1e-3, following: JointSet::EMPTY };
        (guard.limits[0], guard.limits[2]) = (Some(JOINT), Some(JOINT));
        guard
    }

    /// Sends torques in cycle `tick` to the joints that `taken` names.
    fn send(ledger: &mut Ledger, torques_nm: &JointArray, tick: u64, taken: JointSet) {
        let mut cycle_state = CycleState::begin(Tick { number: tick, ..Tick::default() });
        let all = JointSet::of(0).union(JointSet::of(2));
        (cycle_state.live, cycle_state.due, cycle_state.taken) = (true, all, taken);
        let requested = RequestedSetpoint { setpoint: Setpoint::default(), restart: false, live: false };
        let mut guard = Guard::new([JointLimits::default(); MAX_JOINTS], 6, 1_000);
        let command = guard.limit(&requested, ledger, &mut cycle_state).with_torque(torques_nm);
        ledger.record(&command, false, &mut cycle_state);
    }

    #[test]
    fn torque_is_zero_until_the_drive_follows_and_at_once_when_it_does_not() {
        let (mut guard, mut ledger) = (guard(), Ledger::of_joints(6));
        let all = JointSet::of(0).union(JointSet::of(2));
        for state in [DriveState::Absent, DriveState::Disabled, DriveState::Enabling, DriveState::Fault] {
            guard.read(&servos(state));
            let passed = guard.limit(&[5.0; MAX_JOINTS], &ledger, 10);
            assert!(passed.iter().all(|torque| *torque == 0.0), "{state:?}: {passed:?}");
        }
        guard.read(&servos(DriveState::Enabled));
        send(&mut ledger, &[0.0; MAX_JOINTS], 10, all);
        for tick in 11..200_u32 {
            let passed = guard.limit(&[5.0; MAX_JOINTS], &ledger, u64::from(tick));
            let expected = (f64::from(tick - 10) * STEP_NM).min(5.0);
            assert!((passed[0] - expected).abs() < 1e-9, "{passed:?} in cycle {tick}");
            let others = [1, 3, 4, 5, 6, 7].map(|joint| passed[joint]);
            assert!(others.iter().all(|torque| *torque == 0.0), "not in the settings: {passed:?}");
            send(&mut ledger, &passed, u64::from(tick), all);
        }
        let mut one = servos(DriveState::Enabled);
        one[0].state = DriveState::Fault;
        guard.read(&one);
        let passed = guard.limit(&[5.0; MAX_JOINTS], &ledger, 200);
        assert!(passed[0] == 0.0 && (passed[2] - 5.0).abs() < 1e-9, "{passed:?}");
    }

    /// Goal: whatever a model says and whichever frames are lost, what is sent is finite, inside its limit, and no step is larger
    /// than the rate permits.
    #[test]
    fn torque_of_any_model_stays_finite_inside_its_limit_and_rate() {
        for seed in 0..50_u64 {
            let (mut guard, mut ledger) = (guard(), Ledger::of_joints(6));
            guard.read(&servos(DriveState::Enabled));
            send(&mut ledger, &[0.0; MAX_JOINTS], 10, JointSet::of(0).union(JointSet::of(2)));
            let (mut state, mut sent) = (seed * 2 + 1, [0.0; MAX_JOINTS]);
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                state >> 33
            };
            let (mut tick, mut last) = (10, [10_u64; MAX_JOINTS]);
            for _ in 0..2_000 {
                tick += 1 + random() % 20 / 19 * (random() % 50);
                let mut requested = || match random() % 8 {
                    0 => f64::NAN,
                    1 => f64::INFINITY,
                    2 => -1e300,
                    #[expect(clippy::cast_precision_loss, reason = "31 bits")]
                    n => (random() % 400) as f64 * 0.1 - 5.0 * n as f64,
                };
                let requested_nm = std::array::from_fn(|_| requested());
                let passed = guard.limit(&requested_nm, &ledger, tick);
                let lost = random() % 3 == 0;
                for joint in [0, 2] {
                    #[expect(clippy::cast_precision_loss, reason = "few")]
                    let periods = (tick - last[joint]).min(u64::from(SETPOINT_EVERY_MAX)) as f64;
                    let step_nm = (passed[joint] - sent[joint]).abs();
                    assert!(
                        passed[joint].is_finite() && passed[joint].abs() <= 10.0,
                        "seed {seed}: {passed:?}"
                    );
                    assert!(
                        step_nm <= periods * STEP_NM + 1e-9,
                        "seed {seed}: {step_nm} Nm in {periods} periods"
                    );
                    if joint == 2 || !lost {
                        (sent[joint], last[joint]) = (passed[joint], tick);
                    }
                }
                let taken = if lost { JointSet::of(2) } else { JointSet::of(0).union(JointSet::of(2)) };
                send(&mut ledger, &passed, tick, taken);
            }
        }
    }
}
