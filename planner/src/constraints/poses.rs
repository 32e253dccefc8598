//! The proof that a motion keeps the tip upright and inside its box: recursive bisection with a proven step.
//!
//! A joint turns the tip by no more than it turns itself, and moves it by no more than that times the tip's distance to the
//! joint's axis in the pose that one begins with: changed from the base outwards, each joint finds the part behind it as it was.
//! So at the middle of an interval sums over the columns of the Jacobian bound what can happen until its ends.
use super::{ConstraintViolation, RESERVE, RESOLUTION, Spare, TipFault, TipRules};
use crate::budget::Budget;
use crate::collide::{Course, Motion, StraightEdge};
use taustream_motion::{JointArray, Trajectory};

/// Most poses of a proof.
const CHECKS_MAX: usize = 400_000;
/// Most poses of an edge.
const EDGE_CHECKS_MAX: usize = 2_000;
/// Samples at which the worst instant is looked for, to be stated.
const WORST_SAMPLES: u32 = 2_000;

/// Where a proof ended.
struct Stuck {
    at: f64,
    checks: usize,
}

struct Proof<'p, 'a> {
    rules: &'p TipRules<'a>,
    motion: &'p dyn Motion,
    budget: &'p Budget<'p>,
    /// Kept beyond the constraints.
    reserve: Spare,
    resolution: Spare,
    checks: usize,
    checks_max: usize,
}

impl Proof<'_, '_> {
    fn visit(&mut self, [from, to]: [f64; 2]) -> Result<(), Stuck> {
        let middle = 0.5 * (from + to);
        let stuck = |checks: usize| Err(Stuck { at: middle, checks });
        if self.checks >= self.checks_max || self.budget.is_over_after(1) {
            return stuck(self.checks);
        }
        self.checks += 1;
        let (before, after) = (self.motion.travel_rad(from, middle), self.motion.travel_rad(middle, to));
        let (tip, columns) = self.rules.chain().jacobian(self.rules.frame, &self.motion.at(middle));
        let mut moves = Spare { turn_rad: 0.0, inside_m: 0.0 };
        for (column, (before, after)) in columns.iter().zip(before.iter().zip(&after)) {
            let travel = before.max(*after);
            moves.turn_rad += travel * column.angular.norm();
            moves.inside_m += travel * column.linear_m.norm();
        }
        let found = self.rules.spare(&tip);
        let spare = Spare {
            turn_rad: found.turn_rad - self.reserve.turn_rad,
            inside_m: found.inside_m - self.reserve.inside_m,
        };
        if spare.is_at_least(&moves) {
            return Ok(());
        }
        let is_violated = spare.turn_rad < 0.0 || spare.inside_m < 0.0;
        let is_fine = moves.turn_rad < self.resolution.turn_rad && moves.inside_m < self.resolution.inside_m;
        if is_violated || is_fine || middle <= from || middle >= to {
            return stuck(self.checks);
        }
        self.visit([from, middle])?;
        self.visit([middle, to])
    }
}

impl TipRules<'_> {
    /// True when the straight edge between two poses is proven to keep the constraints of poses.
    #[must_use]
    pub(crate) fn keeps_edge(&self, from_rad: &JointArray, to_rad: &JointArray, budget: &Budget) -> bool {
        if !self.are_of_poses() {
            return true;
        }
        let (motion, reserve) = (&StraightEdge { from_rad, to_rad }, RESERVE);
        let ends = [from_rad, to_rad];
        if ends.iter().any(|pose| self.check_pose(pose).is_err()) {
            return false;
        }
        let half = Spare { turn_rad: 0.5 * RESERVE.turn_rad, inside_m: 0.5 * RESERVE.inside_m };
        let mut proof = Proof {
            rules: self,
            motion,
            budget,
            reserve: Spare {
                turn_rad: reserve.turn_rad - half.turn_rad,
                inside_m: reserve.inside_m - half.inside_m,
            },
            resolution: half,
            checks: 0,
            checks_max: EDGE_CHECKS_MAX,
        };
        proof.visit([0.0, 1.0]).is_ok()
    }

    /// Where a straight edge violates the constraints of poses most; `None` where it does not.
    pub(crate) fn worst_of_edge(&self, from_rad: &JointArray, to_rad: &JointArray) -> Option<TipFault> {
        self.worst(&StraightEdge { from_rad, to_rad }, [0.0, 1.0]).map(|(_, fault)| fault)
    }

    pub(super) fn prove_poses(
        &self,
        motion: &Trajectory,
        span_s: [f64; 2],
        budget: &Budget,
    ) -> Result<(), ConstraintViolation> {
        let course = Course::new(motion);
        let (reserve, resolution) = (Spare { turn_rad: 0.0, inside_m: 0.0 }, RESOLUTION);
        let mut proof = Proof {
            rules: self,
            motion: &course,
            budget,
            reserve,
            resolution,
            checks: 0,
            checks_max: CHECKS_MAX,
        };
        proof.visit(span_s).map_err(|Stuck { at, checks }| match self.worst(&course, span_s) {
            Some((at_s, fault)) => ConstraintViolation::Broken { at_s, fault },
            None => {
                self.at_instant(&course, at).unwrap_or(ConstraintViolation::Unresolved { checks, at_s: at })
            }
        })
    }

    fn at_instant(&self, course: &Course, at_s: f64) -> Option<ConstraintViolation> {
        let tip = self.chain().frame(self.frame, &course.at(at_s));
        let Spare { turn_rad, inside_m } = self.spare(&tip);
        (turn_rad < 0.0 || inside_m < 0.0)
            .then(|| ConstraintViolation::Broken { at_s, fault: self.fault(&tip) })
    }

    /// The sampled pose that violates the constraints of poses most, where one does.
    fn worst(&self, motion: &dyn Motion, [from, to]: [f64; 2]) -> Option<(f64, TipFault)> {
        let mut worst = None::<(f64, f64, TipFault)>;
        for i in 0..=WORST_SAMPLES {
            let at = from + (to - from) * f64::from(i) / f64::from(WORST_SAMPLES);
            let tip = self.chain().frame(self.frame, &motion.at(at));
            let Spare { turn_rad, inside_m } = self.spare(&tip);
            let least = turn_rad.min(inside_m);
            if least < 0.0 && worst.as_ref().is_none_or(|(found, ..)| least < *found) {
                worst = Some((least, at, self.fault(&tip)));
            }
        }
        worst.map(|(_, at, fault)| (at, fault))
    }

    /// The first of some poses that violates the constraints of poses, by its number.
    pub(crate) fn first_violating(&self, poses_rad: &[JointArray]) -> Option<usize> {
        if !self.are_of_poses() {
            return None;
        }
        poses_rad.iter().position(|pose_rad| self.check_pose(pose_rad).is_err())
    }
}
