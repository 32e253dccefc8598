//! Clear poses whose tip is at a target.
use super::error::GoalError;
use super::inverse::Inverse;
use super::swarm::Swarm;
use super::target::{TipError, TipTarget};
use super::time_s;
use super::turns::nearest_turn;
use crate::budget::Budget;
use crate::constraints::{TipFault, TipRules};
use crate::margin_exit::is_clear;
use crate::plan::nearest_inside;
use crate::verify::Contact;
use crate::world::World;
use std::f64::consts::PI;
use std::time::Duration;
use taustream_arm::Robot;
use taustream_arm::rng::SeededRng;
use taustream_motion::JointArray;
use taustream_optimizers::{METHODS, Method, Reading};

/// Poses that differ by less in every joint are one.
const SAME_RAD: f64 = 1e-3;
/// Poses that are enough to choose from.
const POSES_MAX: usize = 16;
/// Guesses in a row without a new clear pose, once there is one, that end the search.
const STALE_MAX: usize = 24;
/// Random numbers of the guesses.
const STREAM: u64 = 63;

/// How poses are looked for.
#[derive(Clone, Copy, Debug, Default)]
pub enum Finder {
    /// Inverse kinematics from the start and from random guesses.
    #[default]
    Inverse,
    /// A swarm under the cost of Lv et al. (2019), whose finds inverse kinematics makes exact. For positions only.
    Swarm(&'static Method),
}

impl Finder {
    /// The swarm of a name.
    #[must_use]
    pub fn swarm(name: &str) -> Option<Self> {
        METHODS.iter().find(|m| m.name == name).map(Self::Swarm)
    }

    /// What it is called.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Inverse => "inverse kinematics".to_owned(),
            Self::Swarm(method) => method.name.to_uppercase(),
        }
    }

    /// How much is tried, from the deadline alone, so that one seed gives one answer wherever the clock does not cut in.
    fn tries(self, deadline: Duration) -> usize {
        let ms = usize::try_from(deadline.as_millis()).unwrap_or(usize::MAX);
        match self {
            Self::Inverse => ms.clamp(32, 256),
            Self::Swarm(_) => (ms / 200).clamp(4, 20),
        }
    }
}

/// A search for poses.
pub(super) struct Search<'a> {
    pub(super) world: &'a World<'a>,
    pub(super) budget: &'a Budget<'a>,
    pub(super) start_rad: JointArray,
    pub(super) target: &'a TipTarget,
    /// Farthest that the tip can be from its first joint.
    pub(super) reach_m: f64,
    pub(super) finder: Finder,
    pub(super) reading: Reading,
    pub(super) seed: u64,
    /// What the tip must keep, where that is asked for.
    pub(super) rules: Option<TipRules<'a>>,
}

/// Clear poses at the target, those that take least time first.
pub(super) struct Poses {
    pub(super) clear: Vec<JointArray>,
    pub(super) tries: usize,
}

impl Search<'_> {
    /// # Errors
    /// How far off the nearest pose is, or what is in the way of the clearest.
    pub(super) fn run(&self, deadline: Duration) -> Result<Poses, GoalError> {
        let robot = self.world.robot();
        let mut poses = Poses { clear: Vec::new(), tries: 0 };
        let (mut nearest, mut there, mut stale) = (None::<TipError>, 0, 0);
        let (mut least_contact, mut violating) = (None::<Contact>, None);
        for number in (0_u64..).take(self.finder.tries(deadline)) {
            if stale >= STALE_MAX || poses.clear.len() >= POSES_MAX {
                break;
            }
            // The first guess is tried however late it is: an answer needs a pose.
            if number > 0 && self.budget.is_over() {
                break;
            }
            let Some(pose) = self.guess(number)? else { break };
            poses.tries += 1;
            stale += usize::from(!poses.clear.is_empty());
            let error = self.target.error(robot, &pose);
            if !self.target.is_reached(&error) {
                nearest = Some(nearest.map_or(error, |nearest| self.nearer(nearest, error)));
                continue;
            }
            there += 1;
            if let Some(Err(fault)) = self.rules.as_ref().map(|rules| rules.check_pose(&pose)) {
                violating = Some(fault);
                continue;
            }
            if is_clear(self.world, &pose) {
                stale = if poses.keep(pose) { 0 } else { stale };
            } else if let Some((pair, distance_m)) = self.world.closest(&pose) {
                let contact = self.world.contact_of(&pair, distance_m);
                let gap_m = |c: &Contact| c.distance_m - c.required_m;
                if least_contact.as_ref().is_none_or(|least| gap_m(&contact) > gap_m(least)) {
                    least_contact = Some(contact);
                }
            }
        }
        let tries = poses.tries;
        match (poses.clear.is_empty(), least_contact, nearest) {
            (false, ..) => {
                let time_s = |pose: &JointArray| time_s(robot, &self.start_rad, pose);
                poses.clear.sort_by(|a, b| time_s(a).total_cmp(&time_s(b)));
                Ok(poses)
            }
            (true, Some(contact), _) => Err(GoalError::NoClearPose { tries, poses: there, contact }),
            (true, None, _) if violating.is_some() => {
                let fault = violating.unwrap_or(TipFault::NONE);
                Err(GoalError::NoKeptPose { tries, poses: there, fault })
            }
            (true, None, Some(error)) => {
                let by_rad = error.angle_rad(self.target);
                Err(GoalError::Missed { tries, by_m: error.position_m, by_rad })
            }
            (true, None, None) => Err(GoalError::NoTime),
        }
    }

    /// The exact pose next to a guess, every joint in the turn that is nearest to the start.
    fn guess(&self, number: u64) -> Result<Option<JointArray>, GoalError> {
        let robot = self.world.robot();
        let rough = match self.finder {
            Finder::Inverse if number == 0 => Some(nearest_inside(robot, &self.start_rad)),
            Finder::Inverse => Some(self.random(number)),
            Finder::Swarm(method) => {
                let swarm = Swarm {
                    world: self.world,
                    budget: self.budget,
                    start_rad: self.start_rad,
                    tip_frame: self.target.frame(robot),
                    target_m: self.target.position_m,
                    reach_m: self.reach_m,
                    reading: self.reading,
                };
                swarm.run(method, self.seed.wrapping_add(number.wrapping_mul(0x9E37_79B9_7F4A_7C15)))?
            }
        };
        Ok(rough.map(|rough| {
            let exact = Inverse::new(robot, self.target, self.reach_m).polish(&rough);
            let exact = nearest_inside(robot, &nearest_turn(robot, &self.start_rad, &exact));
            // Where the orientation is free, a pose that keeps the constraints is beside many that do not.
            let kept = self.rules.as_ref().filter(|rules| rules.check_pose(&exact).is_err());
            kept.and_then(|rules| rules.project(&exact, Some(self.target))).unwrap_or(exact)
        }))
    }

    /// A random pose inside the ranges, no revolute joint more than half a turn from the start.
    fn random(&self, number: u64) -> JointArray {
        let mut rng = SeededRng::new(self.seed.wrapping_add(number), STREAM);
        let mut pose = self.start_rad;
        for (q, joint) in pose.iter_mut().zip(&self.world.robot().joints) {
            let [low, high] = joint.limits.position_rad;
            if joint.kind.is_prismatic() {
                *q = rng.within(low, high);
                continue;
            }
            let from = (*q - PI).min(high).max(low);
            let to = (*q + PI).max(low).min(high);
            *q = rng.within(from, to);
        }
        pose
    }

    /// Of two errors the smaller one, by position unless that is as good as reached.
    fn nearer(&self, a: TipError, b: TipError) -> TipError {
        let whole_m =
            |error: &TipError| error.position_m + self.reach_m * error.angle_rad(self.target).unwrap_or(0.0);
        if whole_m(&b) < whole_m(&a) { b } else { a }
    }
}

impl Poses {
    /// Keeps a pose unless it is known already.
    fn keep(&mut self, pose: JointArray) -> bool {
        let same = |a: &JointArray| a.iter().zip(&pose).all(|(x, y)| (x - y).abs() < SAME_RAD);
        let is_new = !self.clear.iter().any(same);
        if is_new {
            self.clear.push(pose);
        }
        is_new
    }
}

/// One polished run: the pose, clear or not, when it is there. What the finders are measured by.
///
/// # Errors
/// When the method's numbers make no sense.
pub(super) fn one_try(search: &Search) -> Result<Option<JointArray>, GoalError> {
    let robot: &Robot = search.world.robot();
    let pose = search.guess(1)?;
    Ok(pose.filter(|pose| search.target.is_reached(&search.target.error(robot, pose))))
}
