//! The planner's follower with an arm that runs whatever it makes, some milliseconds later.
use std::time::Instant;
use taustream_messages::target::Target;
use taustream_motion::cut::kept;
use taustream_motion::{JointLimits, MAX_JOINTS, Trajectory};
use taustream_planner::stream::{Follower, Piece, Reference, Trend};

/// One joint that follows.
pub(super) struct Following {
    follower: Follower,
    trend: Trend,
    latency_s: f64,
    /// What runs, and what takes over at its cut.
    running: Option<Trajectory>,
    successor: Option<(f64, Trajectory)>,
    reference: Reference,
    from_rad: f64,
    planning_us: Vec<f64>,
    strokes_max: usize,
}

impl Following {
    pub(super) fn new(from_rad: f64, limits: &JointLimits, latency_s: f64) -> Self {
        let mut base_rad = [0.0; MAX_JOINTS];
        if let Some(first) = base_rad.first_mut() {
            *first = from_rad;
        }
        Self {
            follower: Follower::new(1, &[*limits; MAX_JOINTS]),
            trend: Trend::default(),
            latency_s,
            running: Trajectory::new(1, base_rad, &[]).ok(),
            successor: None,
            reference: Reference::at_rest(&base_rad),
            from_rad,
            planning_us: Vec::new(),
            strokes_max: 0,
        }
    }

    /// One target, wanted as soon as possible.
    pub(super) fn take(&mut self, now_s: f64, target_rad: f64) {
        self.take_chunk(now_s, &[(0.0, target_rad)]);
    }

    /// Targets with their times after now.
    pub(super) fn take_chunk(&mut self, now_s: f64, targets: &[(f64, f64)]) {
        self.run_until(now_s);
        let begun = Instant::now();
        let targets: Vec<Target> = targets.iter().map(|(due_s, q)| target(*due_s, *q)).collect();
        let cut_s = now_s + self.latency_s;
        let Some(running) = self.successor.as_ref().map(|(_, next)| next).or(self.running.as_ref()) else {
            return;
        };
        let takes_over_s = self.successor.as_ref().map_or(cut_s, |(from_s, _)| from_s.min(cut_s));
        let kept = kept(running, cut_s, takes_over_s);
        let from = (&self.reference, cut_s);
        let piece = match targets.as_slice() {
            [one] => {
                let lead = self.trend.note(now_s, one);
                self.follower.to_pose(&kept, from, (&one.position_rad, lead.as_ref()))
            }
            chunk => self.follower.through(&kept, from, (chunk, &|due_s| now_s + due_s)),
        };
        self.planning_us.push(begun.elapsed().as_secs_f64() * 1e6);
        // Without a piece, what runs goes on.
        let Some(Piece { trajectory, reference, .. }) = piece else { return };
        self.strokes_max = self.strokes_max.max(trajectory.strokes().len());
        self.reference = reference;
        self.successor = Some((takes_over_s, trajectory));
    }

    /// Setpoint at an instant, rad.
    pub(super) fn at(&self, t_s: f64) -> f64 {
        let next = self.successor.as_ref().filter(|(from_s, _)| t_s >= *from_s).map(|(_, next)| next);
        let [first, ..] = next
            .or(self.running.as_ref())
            .map_or([self.from_rad; MAX_JOINTS], |trajectory| trajectory.sample(t_s).position_rad);
        first
    }

    fn run_until(&mut self, now_s: f64) {
        if self.successor.as_ref().is_some_and(|(from_s, _)| *from_s <= now_s) {
            self.running = self.successor.take().map(|(_, next)| next);
        }
    }

    pub(super) fn planning_us_median(&self) -> f64 {
        let mut sorted = self.planning_us.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    }

    pub(super) fn strokes_max(&self) -> usize {
        self.strokes_max
    }
}

fn target(due_s: f64, q: f64) -> Target {
    let mut position_rad = [0.0; MAX_JOINTS];
    if let Some(first) = position_rad.first_mut() {
        *first = q;
    }
    Target { due_s, position_rad, velocity_rad_s: None }
}
