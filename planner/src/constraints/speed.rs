//! The speed of tips: its proof, and by how much a motion must be slower.
//!
//! At the middle of an interval the tip's velocity is the Jacobian times the joints' velocities. Until the ends of the interval
//! these change by no more than acceleration there and proven peak of the jerk allow, and each column by no more than the joints
//! before it turn it and those behind it move the tip. Nothing that happens between samples can be missed.
use super::{ConstraintViolation, TipFault, TipRules};
use crate::budget::Budget;
use nalgebra::Vector3;
use taustream_arm::Zone;
use taustream_motion::chain::Column;
use taustream_motion::limits::Peaks;
use taustream_motion::{MAX_JOINTS, Setpoint, Trajectory};

/// Most instants of a proof.
const CHECKS_MAX: usize = 400_000;
/// Shortest interval that is halved, s.
const HALF_S_MIN: f64 = 1e-8;
/// Share of a speed limit that a motion is timed to, so that its proof is short.
const SHARE: f64 = 0.995;
/// Spacing of the instants at which a motion is measured, and their bounds.
const SAMPLE_S: f64 = 2e-3;
const SAMPLES: [f64; 2] = [400.0, 20_000.0];

/// What can happen until the ends of an interval.
struct Reach {
    /// How far the tip can go, m.
    moves_m: f64,
    /// How fast it can be, m/s.
    speed_m_s: f64,
}

/// A tip at an instant.
struct At {
    position_m: Vector3<f64>,
    columns: [Column; MAX_JOINTS],
    speed_m_s: f64,
}

impl TipRules<'_> {
    /// The frames whose speed is limited, and the limit of the whole motion.
    fn limited(&self) -> impl Iterator<Item = (usize, Option<f64>)> + '_ {
        let own = self.asked.speed_m_s.map(|_| self.frame);
        let tips = self.chain().tips().iter().copied();
        tips.filter(move |tip| !self.zones.is_empty() || Some(*tip) == own)
            .map(move |tip| (tip, self.asked.speed_m_s.filter(|_| Some(tip) == own)))
    }

    /// True when some speed is limited.
    pub(crate) fn limit_speeds(&self) -> bool {
        self.asked.speed_m_s.is_some() || !self.zones.is_empty()
    }

    fn at(&self, frame: usize, setpoint: &Setpoint) -> At {
        let (tip, columns) = self.chain().jacobian(frame, &setpoint.position_rad);
        let parts = columns.iter().zip(&setpoint.velocity_rad_s).map(|(column, v)| column.linear_m * *v);
        let speed_m_s = parts.sum::<Vector3<f64>>().norm();
        At { position_m: tip.translation.vector, columns, speed_m_s }
    }

    /// The limit that counts at a place, and its zone.
    fn limit_at(&self, position_m: &Vector3<f64>, own_m_s: Option<f64>) -> Option<(f64, Option<&Zone>)> {
        let inside = self.zones.iter().filter(|zone| zone.distance_m(position_m) <= 0.0);
        let zones = inside.map(|zone| (zone.speed_m_s, Some(zone)));
        zones.chain(own_m_s.map(|own| (own, None))).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// By what factor a motion is faster than its limits at the worst of dense samples, when, and what is exceeded there.
    fn fastest(&self, motion: &Trajectory, [from_s, to_s]: [f64; 2]) -> Option<(f64, f64, TipFault)> {
        let samples = ((to_s - from_s) / SAMPLE_S).ceil().clamp(SAMPLES[0], SAMPLES[1]);
        let (mut worst, mut k) = (None::<(f64, f64, TipFault)>, 0.0);
        while k <= samples {
            let at_s = from_s + (to_s - from_s) * k / samples;
            let setpoint = motion.sample(at_s);
            for (frame, own_m_s) in self.limited() {
                let at = self.at(frame, &setpoint);
                let Some((limit_m_s, zone)) = self.limit_at(&at.position_m, own_m_s) else { continue };
                let factor = at.speed_m_s / limit_m_s;
                if worst.as_ref().is_none_or(|(most, ..)| factor > *most) {
                    let (speed_m_s, zone) = (at.speed_m_s, zone.map(|zone| zone.name.clone()));
                    worst = Some((factor, at_s, TipFault::Fast { speed_m_s, limit_m_s, zone }));
                }
            }
            k += 1.0;
        }
        worst
    }

    /// By what factor a motion must be slower to keep the speed limits; at most 1 when it keeps them.
    pub(crate) fn slowdown(&self, motion: &Trajectory) -> f64 {
        if !self.limit_speeds() {
            return 0.0;
        }
        self.fastest(motion, [0.0, motion.duration_s()]).map_or(0.0, |(factor, ..)| factor / SHARE)
    }

    pub(super) fn prove_speed(
        &self,
        motion: &Trajectory,
        (span_s, peaks): ([f64; 2], &Peaks),
        budget: &Budget,
    ) -> Result<(), ConstraintViolation> {
        if !self.limit_speeds() {
            return Ok(());
        }
        let mut checks = 0;
        self.visit(motion, (span_s, peaks), (&mut checks, budget)).map_err(|at_s| {
            match self.fastest(motion, span_s) {
                Some((factor, at_s, fault)) if factor > 1.0 => ConstraintViolation::Broken { at_s, fault },
                _ => ConstraintViolation::Unresolved { checks, at_s },
            }
        })
    }

    /// Proves an interval, or says where it could not be done.
    fn visit(
        &self,
        motion: &Trajectory,
        ([from_s, to_s], peaks): ([f64; 2], &Peaks),
        (checks, budget): (&mut usize, &Budget),
    ) -> Result<(), f64> {
        let (middle_s, half_s) = (0.5 * (from_s + to_s), 0.5 * (to_s - from_s));
        if *checks >= CHECKS_MAX || budget.is_over_after(1) {
            return Err(middle_s);
        }
        *checks += 1;
        let setpoint = motion.sample(middle_s);
        let mut is_settled = true;
        for (frame, own_m_s) in self.limited() {
            let at = self.at(frame, &setpoint);
            if self.limit_at(&at.position_m, own_m_s).is_some_and(|(limit_m_s, _)| at.speed_m_s > limit_m_s) {
                return Err(middle_s);
            }
            let reach = reach(&at, &setpoint, (half_s, peaks));
            let is_slow = |limit_m_s: f64| reach.speed_m_s <= limit_m_s;
            let is_outside = |zone: &Zone| zone.distance_m(&at.position_m) > reach.moves_m;
            is_settled &= own_m_s.is_none_or(is_slow)
                && self.zones.iter().all(|zone| is_slow(zone.speed_m_s) || is_outside(zone));
        }
        if is_settled {
            return Ok(());
        }
        if half_s < HALF_S_MIN {
            return Err(middle_s);
        }
        self.visit(motion, ([from_s, middle_s], peaks), (checks, budget))?;
        self.visit(motion, ([middle_s, to_s], peaks), (checks, budget))
    }
}

/// Bounds of a tip within `half_s` of an instant.
fn reach(at: &At, setpoint: &Setpoint, (half_s, peaks): (f64, &Peaks)) -> Reach {
    let (mut travel, mut faster) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
    for joint in 0..MAX_JOINTS {
        let (v, a) = (setpoint.velocity_rad_s[joint].abs(), setpoint.acceleration_rad_s2[joint].abs());
        let (most_a, most_j) = (peaks.acceleration_rad_s2[joint], peaks.jerk_rad_s3[joint]);
        faster[joint] = (a * half_s + 0.5 * most_j * half_s * half_s).min(most_a * half_s);
        travel[joint] =
            v * half_s + 0.5 * faster[joint].max(a * half_s) * half_s + most_j * half_s.powi(3) / 6.0;
    }
    let levers = at.columns.iter().map(|column| (column.linear_m.norm(), column.angular.norm()));
    let parts: Vec<(f64, f64)> = levers.collect();
    let moves_m: f64 = parts.iter().zip(&travel).map(|((lever_m, _), travel)| lever_m * travel).sum();
    let (mut speed_m_s, mut turned_rad, mut behind_m) = (at.speed_m_s, 0.0, moves_m);
    for (joint, (lever_m, turns)) in parts.iter().enumerate() {
        // Joints before this one, and itself, turn its column; those behind it move the tip away from its axis.
        turned_rad += turns * travel[joint];
        behind_m = (behind_m - lever_m * travel[joint]).max(0.0);
        let changes_m = lever_m * turned_rad + turns * behind_m;
        speed_m_s += (lever_m + changes_m) * faster[joint] + changes_m * setpoint.velocity_rad_s[joint].abs();
    }
    Reach { moves_m, speed_m_s }
}
