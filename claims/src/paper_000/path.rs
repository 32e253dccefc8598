//! A path by corners, and the cost of its motion.
use super::{SEGMENT_S, refused};
use crate::run_context::Stop;
use taustream_arm::{Robot, Scene};
use taustream_motion::dynamics::Dynamics;
use taustream_motion::profile::Profile;
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::cost::ControlPointCost;
use taustream_optimizers::cost::{CostModel, PaperCost};
use taustream_optimizers::papers::control_points::CONTROL_POINTS;

/// The clearance is found to this (m), from none to this.
const CLEARANCE_M: [f64; 2] = [1e-4, 1.0];
/// Points of a curve.
const POINTS: u32 = 600;

/// A path: corners with straight joint lines between them, and the profile along each.
pub(super) struct TipPath {
    pub(super) corners: Vec<JointArray>,
    pub(super) profile: Box<dyn Profile + Send>,
}

/// The cost of a path.
#[derive(Clone, Copy)]
pub(super) struct PathCost {
    pub(super) cost: PaperCost,
    pub(super) clearance_m: f64,
    /// Highest velocity, acceleration, jerk, and jump of the jerk at a corner.
    pub(super) peaks: [f64; 4],
}

impl TipPath {
    /// With three control points segments have 6 s each, as in the paper; others share its 24 s so that all have the
    /// same peak of the jerk, which is then the lowest that there is.
    fn segments_s(&self) -> Vec<f64> {
        let whole_s = SEGMENT_S * (CONTROL_POINTS + 1) as f64;
        if self.corners.len() == CONTROL_POINTS + 2 {
            return vec![SEGMENT_S; CONTROL_POINTS + 1];
        }
        let shares: Vec<f64> = self.pairs().map(|(a, b)| widest_rad(a, b).cbrt()).collect();
        let all: f64 = shares.iter().sum();
        shares.into_iter().map(|share| whole_s * share / all).collect()
    }

    fn pairs(&self) -> impl Iterator<Item = (&JointArray, &JointArray)> {
        self.corners.windows(2).filter_map(|p| if let [a, b] = p { Some((a, b)) } else { None })
    }

    pub(super) fn worth(&self, robot: &Robot, scene: &Scene) -> Result<PathCost, Stop> {
        let rate = |expansion_m: f64| self.rate(robot, scene, expansion_m);
        let cost = rate(CostModel::default().expansion_m)?;
        let [exactly_m, mut far_m] = CLEARANCE_M;
        let mut near_m = 0.0;
        while far_m - near_m > exactly_m {
            let middle_m = 0.5 * (near_m + far_m);
            if rate(middle_m)?.collision { far_m = middle_m } else { near_m = middle_m }
        }
        Ok(PathCost { cost, clearance_m: near_m, peaks: self.peaks() })
    }

    fn rate(&self, robot: &Robot, scene: &Scene, expansion_m: f64) -> Result<PaperCost, Stop> {
        let (Some(first), Some(last)) = (self.corners.first(), self.corners.last()) else {
            return Err(Stop::Refused("a way without ends".to_owned()));
        };
        let inner = self.corners.len().saturating_sub(2);
        // A path without corners equals one with a corner in its middle.
        let halved = [std::array::from_fn(|j| 0.5 * (first[j] + last[j]))];
        let points = if inner == 0 { &halved[..] } else { &self.corners[1..=inner] };
        let model = CostModel { expansion_m, ..CostModel::default() };
        let problem =
            ControlPointCost::new(robot, scene, [*first, *last], points.len(), model).map_err(refused)?;
        let joints = robot.joints.len();
        let x: Vec<f64> = points.iter().flat_map(|q| q.iter().take(joints).copied()).collect();
        problem.rate_exactly(&x).ok_or_else(|| Stop::Refused("a way that is none".to_owned()))
    }

    fn peaks(&self) -> [f64; 4] {
        let peaks = self.profile.peaks();
        let start = self.profile.ends()[0].d3;
        let mut highest = [0.0_f64; 4];
        for ((a, b), time_s) in self.pairs().zip(self.segments_s()) {
            let widest = widest_rad(a, b);
            let per = [time_s, time_s.powi(2), time_s.powi(3), time_s.powi(3)];
            let factors = [peaks.c_v, peaks.c_a, peaks.c_j, start.abs()];
            for ((highest, factor), per) in highest.iter_mut().zip(factors).zip(per) {
                *highest = highest.max(widest * factor / per);
            }
        }
        highest
    }

    /// Joint angles, or a derivative of them, over time.
    pub(super) fn curve(&self, joint: usize, order: usize) -> Vec<(f64, f64)> {
        let mut points = Vec::new();
        let mut from_s = 0.0;
        let each = POINTS / u32::try_from(self.corners.len().max(1)).unwrap_or(1);
        for ((a, b), time_s) in self.pairs().zip(self.segments_s()) {
            for i in 0..=each {
                let s = f64::from(i) / f64::from(each.max(1));
                let phi = self.profile.at(s);
                let delta = b[joint] - a[joint];
                let values = [
                    a[joint] + delta * phi.value,
                    delta * phi.d1 / time_s,
                    delta * phi.d2 / time_s.powi(2),
                    delta * phi.d3 / time_s.powi(3),
                ];
                points.push((from_s + s * time_s, values[order]));
            }
            from_s += time_s;
        }
        points
    }
}

impl TipPath {
    /// Torques of the joints over time, and what every joint has to bear at most (Nm).
    pub(super) fn torques(&self, robot: &Robot, dynamics: &Dynamics) -> (Vec<(f64, JointArray)>, JointArray) {
        let joints = robot.joints.len();
        let curves: Vec<[Vec<(f64, f64)>; 3]> =
            (0..joints).map(|joint| [0, 1, 2].map(|order| self.curve(joint, order))).collect();
        let count = curves.first().map_or(0, |c| c[0].len());
        let mut highest = [0.0; MAX_JOINTS];
        let mut over_time = Vec::with_capacity(count);
        for i in 0..count {
            let of = |order: usize| -> JointArray {
                let value =
                    |joint: usize| curves.get(joint).and_then(|c| c[order].get(i)).map_or(0.0, |p| p.1);
                std::array::from_fn(value)
            };
            let torques = dynamics.torques_nm(&of(0), &of(1), &of(2));
            for (highest, torque) in highest.iter_mut().zip(torques) {
                *highest = f64::max(*highest, torque.abs());
            }
            over_time.push((curves.first().and_then(|c| c[0].get(i)).map_or(0.0, |p| p.0), torques));
        }
        (over_time, highest)
    }
}

/// Travel of the joint that moves farthest.
fn widest_rad(a: &JointArray, b: &JointArray) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
