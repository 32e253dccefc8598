//! Masses by measured torques: what links or a payload weigh, and where, so that the torques that hold the arm in the model are
//! those that its drives report.
//!
//! Torques at rest are linear in the mass and the first moment (mass times centre) of everything that moves with a joint. Rest does
//! not show all of them: what it does not show stays where the robot file has it, because each unknown is held to the file's value
//! with an uncertainty that is stated here. The answer says of each body whether the torques determine it.
//!
//! Source: Atkeson, An and Hollerbach, "Estimation of inertial parameters of manipulator links and loads", International Journal
//! of Robotics Research 5(3), 1986: torques linear in the parameters, ridge regression for those that cannot be determined.
use crate::{NoMasses, Robot};
use nalgebra::{SMatrix, SVector, Vector3};
use taustream_motion::dynamics::{Body, Dynamics};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Mass and first moment of a body.
const PARTS: usize = 4;
const UNKNOWNS_MAX: usize = PARTS * MAX_JOINTS;
/// Fewest poses that a fit is made of.
pub const POSES_MIN: usize = 4;
/// A fit is tried on every so manyth pose, which it was not made of; with fewer than twice as many poses it is not tried.
const FOLDS: usize = 4;
/// How often the noise of each joint is estimated anew from what the fit leaves.
const NOISE_ROUNDS: usize = 4;
/// Least noise of a torque, as a share of the joint's greatest, and beside that.
const NOISE_SHARE_MIN: f64 = 0.005;
const NOISE_NM_MIN: f64 = 1e-4;
/// Largest torque in Nm, and largest position, that are taken for measured ones.
const PLAUSIBLE: f64 = 1e5;
/// How uncertain the masses of a robot file are: a share of the mass, and beside that.
const FILE_MASS_SHARE: f64 = 0.3;
const FILE_MASS_KG: f64 = 0.05;
/// And their centres, by their mass and beside that.
const FILE_CENTER_M: f64 = 0.05;
const FILE_MOMENT_KG_M: f64 = 0.005;
/// How uncertain a payload is of which nothing is known.
const PAYLOAD_KG: f64 = 20.0;
const PAYLOAD_MOMENT_KG_M: f64 = 6.0;
/// A body is determined when the torques leave less than this share of the uncertainty of its best known part.
const DETERMINED_SHARE: f64 = 0.5;

/// What was measured in one pose at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldPose {
    /// The pose.
    pub q_rad: JointArray,
    /// Torque at each joint without dry friction: the mean of two approaches from opposite sides.
    pub torque_nm: JointArray,
}

/// What is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// What moves with each joint.
    Links,
    /// What the tip carries; the links are as the robot file has them.
    Payload,
}

/// A mass and its centre, in the frame behind its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMass {
    /// The mass.
    pub mass_kg: f64,
    /// Its centre; zero for no mass.
    pub center_m: Vector3<f64>,
}

/// One body before and after the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedBody {
    /// Zero-based joint that it moves with.
    pub joint: usize,
    /// As the robot file has it; without the payload, unless the payload is meant.
    pub before: PointMass,
    /// As the torques have it.
    pub after: PointMass,
    /// Standard deviation of the mass that is left.
    pub mass_sigma_kg: f64,
    /// True when the torques determine something of it; otherwise it is mostly the file's.
    pub is_determined: bool,
}

/// How far model and drives agree at one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Greatest measured torque, without its sign.
    pub torque_nm_max: f64,
    /// Root mean square of measured less modelled torque, with the masses of the file.
    pub before_rms_nm: f64,
    /// The same with the fitted ones.
    pub after_rms_nm: f64,
    /// The same on poses that the fit was not made of; NaN with too few poses.
    pub unseen_rms_nm: f64,
    /// Largest difference that is left, without its sign.
    pub worst_nm: f64,
    /// Index of the pose where.
    pub worst_pose: usize,
}

/// The masses that fit.
#[derive(Clone, Debug, PartialEq)]
pub struct MassFit {
    /// The bodies that were fitted, base to tip.
    pub bodies: Vec<FittedBody>,
    /// How far the model agrees, by joint.
    pub joints: Vec<Agreement>,
}

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MassFitError {
    /// Too little to go by.
    #[error("{got} poses; a fit of masses needs {POSES_MIN} at least, and better 12")]
    TooFewPoses {
        /// How many there are.
        got: usize,
    },
    /// A pose or torque that no arm has.
    #[error("pose {}: the {what} of joint {} is {value}; it must be a number within +-{PLAUSIBLE:e}", pose + 1, joint + 1)]
    Implausible {
        /// Zero-based index of the pose.
        pose: usize,
        /// Zero-based index of the joint.
        joint: usize,
        /// Position or torque.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// The file has no masses to begin with.
    #[error(transparent)]
    NoMasses(#[from] NoMasses),
    /// A robot whose payload is not one.
    #[error("robot `{robot}` has {tips} tips; what each carries is fitted with its links")]
    SeveralTips {
        /// The robot's name.
        robot: String,
        /// How many.
        tips: usize,
    },
    /// What no body weighs.
    #[error(
        "the torques fit best with {mass_kg:.3} kg at joint {} ({name}), which no body weighs: look for a joint whose torque has the \
         wrong sign or scale, a wrong gravity_m_s2, or something that the arm touches",
        joint + 1
    )]
    Negative {
        /// Zero-based index of the joint.
        joint: usize,
        /// Its name.
        name: String,
        /// The mass.
        mass_kg: f64,
    },
    /// Numbers with which nothing can be solved.
    #[error("the torques cannot be fitted: the equations have no solution in these numbers")]
    Unsolvable,
}

/// One unknown: a part of a body, and how uncertain it is.
#[derive(Clone, Copy)]
struct Column {
    body: usize,
    part: usize,
    sigma: f64,
}

type Changes = SVector<f64, UNKNOWNS_MAX>;
type Square = SMatrix<f64, UNKNOWNS_MAX, UNKNOWNS_MAX>;

/// What poses ask of the unknowns; changes are counted in their uncertainties.
struct Problem {
    columns: Vec<Column>,
    /// For each pose, what each unknown adds to the torques.
    effects: Vec<Vec<JointArray>>,
    /// For each pose, measured torque less that of the file's masses.
    missing: Vec<JointArray>,
    joints: usize,
}

/// The best changes, and what is left of each one's uncertainty, as a share.
struct Solution {
    changes: Changes,
    left: Changes,
}

/// Fits masses to torques of poses at rest.
///
/// # Errors
/// [`MassFitError`].
pub fn fit(robot: &Robot, poses: &[HeldPose], unknown: Unknown) -> Result<MassFit, MassFitError> {
    check(robot, poses)?;
    let file = robot.dynamics()?;
    if unknown == Unknown::Payload && robot.tips.len() > 1 {
        return Err(MassFitError::SeveralTips { robot: robot.name.clone(), tips: robot.tips.len() });
    }
    let bodies = robot.bodies();
    let problem = Problem::of(robot, (&file, &bodies), poses, unknown);
    let everyone = vec![true; poses.len()];
    let noise_nm = problem.first_noise_nm(poses);
    let (solution, noise_nm) = problem.solve(noise_nm, &everyone).ok_or(MassFitError::Unsolvable)?;
    let joints = problem.agreements(poses, &solution, &noise_nm);
    let bodies = problem.bodies(robot, (&bodies, unknown), &solution)?;
    Ok(MassFit { bodies, joints })
}

fn check(robot: &Robot, poses: &[HeldPose]) -> Result<(), MassFitError> {
    if poses.len() < POSES_MIN {
        return Err(MassFitError::TooFewPoses { got: poses.len() });
    }
    for (pose, held) in poses.iter().enumerate() {
        for (what, values) in [("position", &held.q_rad), ("torque", &held.torque_nm)] {
            let mut used = values.iter().enumerate().take(robot.joints.len());
            if let Some((joint, value)) = used.find(|(_, value)| !(-PLAUSIBLE..=PLAUSIBLE).contains(*value)) {
                return Err(MassFitError::Implausible { pose, joint, what, value: *value });
            }
        }
    }
    Ok(())
}

/// The torques of one part of one body alone.
fn effect_nm(robot: &Robot, column: Column, q_rad: &JointArray) -> JointArray {
    let holding = |center_m: Vector3<f64>| {
        let mut bodies = [Body::NONE; MAX_JOINTS];
        if let Some(body) = bodies.get_mut(column.body) {
            *body = Body { mass_kg: 1.0, center_m, ..Body::NONE };
        }
        Dynamics::new(robot.chain, bodies, robot.gravity_m_s2).holding_nm(q_rad)
    };
    let at_joint = holding(Vector3::zeros());
    let Some(axis) = column.part.checked_sub(1) else { return at_joint };
    let aside = holding(Vector3::ith(axis, 1.0));
    std::array::from_fn(|joint| aside[joint] - at_joint[joint])
}

impl Problem {
    fn of(
        robot: &Robot,
        (file, bodies): (&Dynamics, &[Body; MAX_JOINTS]),
        poses: &[HeldPose],
        unknown: Unknown,
    ) -> Self {
        let joints = robot.joints.len();
        let columns = columns(robot, bodies, unknown);
        let effects = |held: &HeldPose| {
            let of = |column: &Column| effect_nm(robot, *column, &held.q_rad).map(|nm| nm * column.sigma);
            columns.iter().map(of).collect()
        };
        let missing = |held: &HeldPose| {
            let modelled = file.holding_nm(&held.q_rad);
            std::array::from_fn(|j| held.torque_nm[j] - modelled[j])
        };
        Self {
            effects: poses.iter().map(effects).collect(),
            missing: poses.iter().map(missing).collect(),
            columns,
            joints,
        }
    }

    fn first_noise_nm(&self, poses: &[HeldPose]) -> JointArray {
        let of = |joint: usize| {
            let most_nm = poses.iter().map(|held| held.torque_nm[joint].abs()).fold(0.0, f64::max);
            NOISE_SHARE_MIN * most_nm + NOISE_NM_MIN
        };
        std::array::from_fn(|joint| if joint < self.joints { of(joint) } else { 1.0 })
    }

    /// Solves for the changes with the poses that `with` names; the noise that goes with them is at least `least_nm`.
    fn solve(&self, least_nm: JointArray, with: &[bool]) -> Option<(Solution, JointArray)> {
        // What the masses of the file leave is noise until more is known.
        let mut noise_nm = self.noise_nm(&Changes::zeros(), &least_nm, with);
        let mut solution = self.solve_once(&noise_nm, with)?;
        for _ in 0..NOISE_ROUNDS {
            noise_nm = self.noise_nm(&solution.changes, &least_nm, with);
            solution = self.solve_once(&noise_nm, with)?;
        }
        Some((solution, noise_nm))
    }

    fn solve_once(&self, noise_nm: &JointArray, with: &[bool]) -> Option<Solution> {
        // In units of uncertainties, what is known beforehand is the identity.
        let (mut normal, mut right) = (Square::identity(), Changes::zeros());
        for (effects, missing) in self.chosen(with) {
            for joint in 0..self.joints {
                let weight = 1.0 / (noise_nm[joint] * noise_nm[joint]);
                for (i, effect) in effects.iter().enumerate() {
                    let weighed = weight * effect[joint];
                    right[i] += weighed * missing[joint];
                    for (k, other) in effects.iter().enumerate() {
                        normal[(i, k)] += weighed * other[joint];
                    }
                }
            }
        }
        let inverse = normal.cholesky()?.inverse();
        let left = Changes::from_fn(|i, _| inverse[(i, i)].sqrt());
        let changes = inverse * right;
        changes.iter().chain(left.iter()).all(|value| value.is_finite()).then_some(Solution { changes, left })
    }

    fn chosen<'a>(&'a self, with: &'a [bool]) -> impl Iterator<Item = (&'a Vec<JointArray>, &'a JointArray)> {
        let all = self.effects.iter().zip(&self.missing).zip(with);
        all.filter(|(_, with)| **with).map(|(pose, _)| pose)
    }

    /// What changes leave of the torques that are missing in one pose.
    fn left_nm(effects: &[JointArray], missing: &JointArray, changes: &Changes) -> JointArray {
        let mut left = *missing;
        for (effect, change) in effects.iter().zip(changes.iter()) {
            left.iter_mut().zip(effect).for_each(|(left, effect)| *left -= effect * change);
        }
        left
    }

    fn noise_nm(&self, changes: &Changes, least_nm: &JointArray, with: &[bool]) -> JointArray {
        let left: Vec<JointArray> =
            self.chosen(with).map(|(effects, missing)| Self::left_nm(effects, missing, changes)).collect();
        std::array::from_fn(|joint| rms(left.iter().map(|left| left[joint])).max(least_nm[joint]))
    }

    fn agreements(&self, poses: &[HeldPose], solution: &Solution, noise_nm: &JointArray) -> Vec<Agreement> {
        let left = |changes: &Changes| -> Vec<JointArray> {
            let pairs = self.effects.iter().zip(&self.missing);
            pairs.map(|(effects, missing)| Self::left_nm(effects, missing, changes)).collect()
        };
        let after = left(&solution.changes);
        let unseen = self.unseen_nm(noise_nm);
        let of = |joint: usize| {
            let worst = after.iter().map(|left| left[joint].abs()).enumerate();
            let (worst_pose, worst_nm) =
                worst.fold((0, 0.0), |most, next| if next.1 > most.1 { next } else { most });
            Agreement {
                torque_nm_max: poses.iter().map(|held| held.torque_nm[joint].abs()).fold(0.0, f64::max),
                before_rms_nm: rms(self.missing.iter().map(|left| left[joint])),
                after_rms_nm: rms(after.iter().map(|left| left[joint])),
                unseen_rms_nm: unseen
                    .as_ref()
                    .map_or(f64::NAN, |unseen| rms(unseen.iter().map(|left| left[joint]))),
                worst_nm,
                worst_pose,
            }
        };
        (0..self.joints).map(of).collect()
    }

    /// What fits that were made without a pose leave there.
    fn unseen_nm(&self, noise_nm: &JointArray) -> Option<Vec<JointArray>> {
        let count = self.missing.len();
        if count < 2 * FOLDS {
            return None;
        }
        let mut unseen = Vec::with_capacity(count);
        for fold in 0..FOLDS {
            let with: Vec<bool> = (0..count).map(|pose| pose % FOLDS != fold).collect();
            let solution = self.solve_once(noise_nm, &with)?;
            let without: Vec<bool> = with.iter().map(|with| !with).collect();
            let left = |(effects, missing): (&Vec<JointArray>, &JointArray)| {
                Self::left_nm(effects, missing, &solution.changes)
            };
            unseen.extend(self.chosen(&without).map(left));
        }
        Some(unseen)
    }

    fn bodies(
        &self,
        robot: &Robot,
        (bodies, unknown): (&[Body; MAX_JOINTS], Unknown),
        solution: &Solution,
    ) -> Result<Vec<FittedBody>, MassFitError> {
        let mut fitted = Vec::new();
        for (index, four) in self.columns.chunks_exact(PARTS).enumerate() {
            let Some(joint) = four.first().map(|column| column.body) else { continue };
            let payload = robot.payload.filter(|payload| payload.frame == joint + 1);
            let payload = payload.map(|p| (p.mass_kg, p.center_m.coords * p.mass_kg));
            let (payload_kg, payload_kg_m) = payload.unwrap_or((0.0, Vector3::zeros()));
            let (mass_kg, moment_kg_m) = match unknown {
                Unknown::Payload => (payload_kg, payload_kg_m),
                Unknown::Links => {
                    let body = bodies[joint];
                    (body.mass_kg - payload_kg, body.center_m * body.mass_kg - payload_kg_m)
                }
            };
            let at = PARTS * index;
            let sigma = |part: usize| four.get(part).map_or(0.0, |column| column.sigma);
            let change = |part: usize| solution.changes[at + part] * sigma(part);
            let after_kg = mass_kg + change(0);
            if after_kg < 0.0 {
                let name = robot.joints.get(joint).map_or_else(String::new, |joint| joint.name.clone());
                return Err(MassFitError::Negative { joint, name, mass_kg: after_kg });
            }
            let left = (0..PARTS).map(|part| solution.left[at + part]).fold(1.0, f64::min);
            fitted.push(FittedBody {
                joint,
                before: point_mass(mass_kg, moment_kg_m),
                after: point_mass(after_kg, moment_kg_m + Vector3::new(change(1), change(2), change(3))),
                mass_sigma_kg: solution.left[at] * sigma(0),
                is_determined: left < DETERMINED_SHARE,
            });
        }
        Ok(fitted)
    }
}

/// What is unknown, four parts a body.
fn columns(robot: &Robot, bodies: &[Body; MAX_JOINTS], unknown: Unknown) -> Vec<Column> {
    let parts = |body: usize, [mass, moment]: [f64; 2]| {
        [mass, moment, moment, moment].into_iter().enumerate().map(move |(part, sigma)| Column {
            body,
            part,
            sigma,
        })
    };
    match unknown {
        Unknown::Payload => {
            let body = robot.chain.tip_frame().saturating_sub(1);
            parts(body, [PAYLOAD_KG, PAYLOAD_MOMENT_KG_M]).collect()
        }
        Unknown::Links => bodies
            .iter()
            .enumerate()
            .take(robot.joints.len())
            .flat_map(|(joint, body)| {
                let mass_kg = FILE_MASS_SHARE * body.mass_kg + FILE_MASS_KG;
                parts(joint, [mass_kg, FILE_CENTER_M * body.mass_kg + FILE_MOMENT_KG_M])
            })
            .collect(),
    }
}

fn point_mass(mass_kg: f64, moment_kg_m: Vector3<f64>) -> PointMass {
    let center_m = if mass_kg > 0.0 { moment_kg_m / mass_kg } else { Vector3::zeros() };
    PointMass { mass_kg, center_m }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}
