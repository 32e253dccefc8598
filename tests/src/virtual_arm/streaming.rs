//! A planner that follows a random stream of targets: the shipped follower, with the shipped choice of the cut.
use super::random::SeededRng;
use std::collections::VecDeque;
use std::time::Duration;
use taustream_arm::Robot;
use taustream_messages::target::Target;
use taustream_messages::{Phase, Replaces, Report};
use taustream_motion::cut::kept;
use taustream_motion::limits::check_motion_from;
use taustream_motion::{JointArray, Trajectory};
use taustream_planner::stream::{Follower, Piece, Reference, Trend};
use taustream_planner::stream_cut;

/// How far from the home pose a target may be, rad.
const REACH_RAD: f64 = 0.9;
/// Pieces that are remembered: one runs, one waits, others were refused.
const PIECES_MAX: usize = 16;

/// A piece that was offered to the streamer.
struct Offered {
    id: u64,
    trajectory: Trajectory,
    reference: Reference,
}

/// Targets, and what is made of them.
pub struct Streaming {
    follower: Follower,
    trend: Trend,
    offered: VecDeque<Offered>,
    target_rad: JointArray,
    period_ms: u64,
    /// A planted fault: the follower continues as if the arm rested where the last piece ends.
    skips_reference: bool,
}

impl Streaming {
    /// For a robot that stands at home.
    #[must_use]
    pub fn new(robot: &Robot, home_rad: &JointArray, skips_reference: bool) -> Self {
        Self {
            follower: Follower::new(robot.joints.len(), &robot.limits()),
            trend: Trend::default(),
            offered: VecDeque::new(),
            target_rad: *home_rad,
            period_ms: 20,
            skips_reference,
        }
    }

    /// When the next target comes, ms from now: 2 to 200, steady for a while, with gaps.
    pub fn next_ms(&mut self, rng: &mut SeededRng) -> u64 {
        if rng.chance(0.02) {
            self.period_ms = rng.whole(2, 200);
        }
        if rng.chance(0.02) { rng.whole(200, 900) } else { self.period_ms + rng.whole(0, self.period_ms / 4) }
    }

    /// The next piece, and what it replaces; what it is based on is forgotten when it is not offered.
    pub fn next_piece(
        &mut self,
        rng: &mut SeededRng,
        (robot, home_rad): (&Robot, &JointArray),
        (report, now_ns): (&Report, u64),
    ) -> Option<(Trajectory, Replaces, Reference)> {
        self.move_target(rng, robot, home_rad);
        let latency_s = rng.within(0.001, 0.03);
        let phase = Phase::from_code(report.phase)?;
        let (base, reference, replaces, cut_s, folded_s) = if phase == Phase::Holding && report.energised == 1
        {
            let base = Trajectory::new(robot.joints.len(), report.command_rad, &[]).ok()?;
            (base, Reference::at_rest(&report.command_rad), Replaces::Rest, 0.0, 0.0)
        } else if matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused) {
            let waits = report.successor_id != 0;
            let trajectory_id = if waits { report.successor_id } else { report.trajectory_id };
            let own = self.offered.iter().find(|offered| offered.id == trajectory_id)?;
            let cut = stream_cut::cut(report, now_ns, latency_s, own.trajectory.duration_s());
            let replaces = Replaces::Cut { trajectory_id, at_s: cut.at_s };
            (own.trajectory.clone(), own.reference.clone(), replaces, cut.at_s, cut.folded_s)
        } else {
            return None;
        };
        let reference = match reference.end_rad().filter(|_| self.skips_reference) {
            Some(end_rad) => Reference::at_rest_from(cut_s, end_rad),
            None => reference,
        };
        let kept = kept(&base, cut_s, folded_s);
        let from = (&reference, cut_s);
        let now_s = Duration::from_nanos(now_ns).as_secs_f64();
        let piece = if rng.chance(0.1) {
            self.trend.clear();
            let targets = self.chunk(rng, robot, home_rad);
            self.follower.through(&kept, from, (&targets, &|due_s| report.trajectory_s + due_s))
        } else {
            let target = Target { due_s: 0.0, position_rad: self.target_rad, velocity_rad_s: None };
            let lead = self.trend.note(now_s, &target);
            self.follower.to_pose(&kept, from, (&self.target_rad, lead.as_ref()))
        };
        let Piece { trajectory, reference, .. } = piece?;
        // The planner sends nothing that it has not proven.
        let is_proven = check_motion_from(&trajectory, &robot.limits(), cut_s).is_ok();
        (is_proven || self.skips_reference).then_some((trajectory, replaces, reference))
    }

    /// The piece was offered under this id.
    pub fn offered(&mut self, id: u64, trajectory: Trajectory, reference: Reference) {
        if self.offered.len() == PIECES_MAX {
            self.offered.pop_front();
        }
        self.offered.push_back(Offered { id, trajectory, reference });
    }

    /// A walk, and now and then a jump; some targets come twice.
    fn move_target(&mut self, rng: &mut SeededRng, robot: &Robot, home_rad: &JointArray) {
        if rng.chance(0.1) {
            return;
        }
        let reach_rad = if rng.chance(0.05) { REACH_RAD } else { rng.within(0.0, 0.05) };
        for (joint, described) in robot.joints.iter().enumerate() {
            let [low, high] = described.limits.position_rad;
            let walked_rad = self.target_rad[joint] + rng.within(-reach_rad, reach_rad);
            let near_home_rad = walked_rad.clamp(home_rad[joint] - REACH_RAD, home_rad[joint] + REACH_RAD);
            self.target_rad[joint] = near_home_rad.clamp(low + 0.1, high - 0.1);
        }
    }

    fn chunk(&mut self, rng: &mut SeededRng, robot: &Robot, home_rad: &JointArray) -> Vec<Target> {
        let mut due_s = 0.0;
        (0..rng.whole(2, 12))
            .map(|_| {
                self.move_target(rng, robot, home_rad);
                due_s += rng.within(0.005, 0.1);
                Target { due_s, position_rad: self.target_rad, velocity_rad_s: None }
            })
            .collect()
    }
}
