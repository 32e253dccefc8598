//! Whether the drives can bear a motion: the torque of every joint along it, beside the greatest that its file states.
//!
//! A slower motion needs less torque only down to what gravity asks for at standstill. Torques are known where masses are
//! and may be right ([`Robot::mass_doubt`]); they are rigid-body torques, without friction and the motors' own inertia.
use taustream_arm::Robot;
use taustream_motion::dynamics::Dynamics;
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointArray, JointKind, Trajectory};

/// Instants a second of a proof, and of a plan, which keeps [`PLANNED_SHARE`] for what lies between them.
const PROVEN_HZ: f64 = 1_000.0;
const PLANNED_HZ: f64 = 200.0;
/// Share of the greatest torque that a plan uses.
const PLANNED_SHARE: f64 = 0.99;
/// Fewest and most instants of a motion.
const INSTANTS: [f64; 2] = [256.0, 50_000.0];
/// A motion that is made slower gets this much slower than it must.
const SLOWER: f64 = 1.001;

/// What one joint has to bear at most.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PeakTorque {
    /// The torque, without its sign.
    pub torque_nm: f64,
    /// When.
    pub at_s: f64,
}

/// A joint that would have to bear more than it can.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "joint {} ({name}) needs {torque_nm:.1} {unit} at t = {at_s:.3} s, {:.1} {unit} more than its {limit_nm:.1} {unit} ({}, or effort in \
     the URDF); standing still there takes {holding_nm:.1} {unit}: {}",
    joint + 1,
    (torque_nm - limit_nm).max(0.0),
    kind.force_key(),
    if *slower_helps {
        "move slower"
    } else {
        "no speed helps; keep away from that pose, carry less, or correct the file"
    },
    unit = kind.force_unit()
)]
pub struct Overload {
    /// Zero-based index of the joint.
    pub joint: usize,
    /// Its name.
    pub name: String,
    /// Torques below are in Nm, or forces in N.
    pub kind: JointKind,
    /// When the torque is greatest.
    pub at_s: f64,
    /// The torque then, without its sign.
    pub torque_nm: f64,
    /// The greatest that the joint can.
    pub limit_nm: f64,
    /// What standing still takes there.
    pub holding_nm: f64,
    /// A slower motion needs less than the joint can there.
    pub slower_helps: bool,
}

/// What a motion needs to be borne.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Load {
    /// Nothing: every joint can.
    Borne,
    /// To be slower by this factor.
    Slower(f64, Overload),
    /// No speed helps.
    Unbearable(Overload),
}

/// The torques that an arm's drives have, beside its dynamics.
#[derive(Clone, Debug)]
pub struct TorqueLimits<'a> {
    robot: &'a Robot,
    dynamics: Dynamics,
}

/// Why torques are not checked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unchecked {
    /// No joint states what it can.
    #[error("torques are not checked: no joint states torque_nm_max (or effort in the URDF)")]
    NoLimits,
    /// No link states a mass.
    #[error("torques are not checked: no link states a mass")]
    NoMasses,
    /// The masses cannot be right.
    #[error("torques are not checked: {0}")]
    Doubtful(String),
}

impl<'a> TorqueLimits<'a> {
    /// Of an arm whose masses may be right, and one of whose joints states its torque.
    ///
    /// # Errors
    /// What is missing.
    pub fn of(robot: &'a Robot) -> Result<Self, Unchecked> {
        if robot.joints.iter().all(|joint| joint.torque_nm_max.is_none()) {
            return Err(Unchecked::NoLimits);
        }
        let dynamics = robot.dynamics().map_err(|_| Unchecked::NoMasses)?;
        match robot.mass_doubt() {
            Some(doubt) => Err(Unchecked::Doubtful(doubt)),
            None => Ok(Self { robot, dynamics }),
        }
    }

    /// What each joint bears at most, at a thousand instants a second.
    ///
    /// # Errors
    /// The joint that is farthest beyond its torque.
    pub fn prove(&self, motion: &Trajectory) -> Result<Vec<PeakTorque>, Overload> {
        let mut peaks = vec![PeakTorque::default(); self.robot.joints.len()];
        let load = self.walk(motion, (PROVEN_HZ, 1.0), |at_s, torques| {
            for (peak, torque) in peaks.iter_mut().zip(torques) {
                if torque.abs() > peak.torque_nm {
                    *peak = PeakTorque { torque_nm: torque.abs(), at_s };
                }
            }
        });
        match load {
            Load::Borne => Ok(peaks),
            Load::Slower(_, overload) | Load::Unbearable(overload) => Err(overload),
        }
    }

    /// What a candidate needs, at fewer instants and with a reserve.
    pub(crate) fn load(&self, motion: &Trajectory) -> Load {
        self.walk(motion, (PLANNED_HZ, PLANNED_SHARE), |_, _| ())
    }

    fn walk(
        &self,
        motion: &Trajectory,
        (hz, share): (f64, f64),
        mut look: impl FnMut(f64, &JointArray),
    ) -> Load {
        let [least, most] = INSTANTS;
        let (instants, duration_s) =
            ((motion.duration_s() * hz).ceil().clamp(least, most), motion.duration_s());
        let (mut slowest, mut worst, mut i) = (0.0_f64, None::<Overload>, 0.0);
        let mut cursor = Cursor::at_start(motion);
        while i <= instants {
            let at_s = duration_s * i / instants;
            i += 1.0;
            let at = cursor.sample(motion, at_s);
            let torques =
                self.dynamics.torques_nm(&at.position_rad, &at.velocity_rad_s, &at.acceleration_rad_s2);
            look(at_s, &torques);
            for (overload, factor) in self.beyond(at_s, share, &torques, &at.position_rad) {
                slowest = slowest.max(factor);
                let over = |o: &Overload| o.torque_nm / o.limit_nm;
                // What no speed helps against comes first.
                let rank = |o: &Overload| (!o.slower_helps, over(o));
                if worst.as_ref().is_none_or(|w| rank(w) < rank(&overload)) {
                    worst = Some(overload);
                }
            }
        }
        match worst {
            None => Load::Borne,
            Some(overload) if slowest.is_finite() => Load::Slower(SLOWER * slowest, overload),
            Some(overload) => Load::Unbearable(overload),
        }
    }

    /// The joints beyond their torques at one instant, and how much slower the motion must be for each.
    fn beyond(
        &self,
        at_s: f64,
        share: f64,
        torques: &JointArray,
        pose_rad: &JointArray,
    ) -> Vec<(Overload, f64)> {
        let limit = |joint: usize| self.robot.joints.get(joint).and_then(|j| j.torque_nm_max);
        let is_beyond = |joint: &usize| limit(*joint).is_some_and(|l| torques[*joint].abs() > share * l);
        let beyond: Vec<usize> = (0..self.robot.joints.len()).filter(is_beyond).collect();
        if beyond.is_empty() {
            return Vec::new();
        }
        let holding = self.dynamics.holding_nm(pose_rad);
        let overload = |joint: usize| {
            let limit_nm = limit(joint)?;
            let (torque, held) = (torques[joint], holding[joint]);
            // Torque is what holding takes, plus the rest over the square of how much slower it is.
            let room = torque.signum().mul_add(share * limit_nm, -held) / (torque - held);
            let factor =
                if held.abs() < share * limit_nm && room > 0.0 { room.recip().sqrt() } else { f64::INFINITY };
            let name = self.robot.joints.get(joint)?.name.clone();
            let (torque_nm, holding_nm) = (torque.abs(), held.abs());
            let slower_helps = factor.is_finite();
            let kind = self.robot.kind(joint);
            Some((
                Overload { joint, name, kind, at_s, torque_nm, limit_nm, holding_nm, slower_helps },
                factor,
            ))
        };
        beyond.into_iter().filter_map(overload).collect()
    }
}
