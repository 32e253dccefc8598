//! Whether setpoints lie on the path of the trajectory that was accepted.
use crate::on_path::second_formula;
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};
use taustream_streamer::report::CycleRecord;

/// Difference between two formulas for one position, and rounding of sums of angles.
const FORMULA_RAD: f64 = 1e-9;

/// A trajectory that was offered.
#[derive(Clone, Debug)]
struct Offered {
    id: u64,
    trajectory: Trajectory,
    /// From when it makes the setpoints, for one that goes on from the trajectory before it: its cut; where it cuts one that may
    /// still wait, also the cut of that one.
    from_s: Option<[f64; 2]>,
}

/// The trajectory that runs, and how far it has come.
#[derive(Clone, Debug, Default)]
pub(crate) struct Path {
    offered: Vec<Offered>,
    running: Option<Offered>,
    last: Option<(u64, f64)>,
    /// What each joint was sent last.
    sent_rad: [Option<f64>; MAX_JOINTS],
    /// Joints may be beside the path by what the log states: a stall or a loss has parted them.
    parted: bool,
}

impl Path {
    /// A trajectory was offered under this id.
    pub(crate) fn offer(&mut self, id: u64, trajectory: Trajectory, from_s: Option<[f64; 2]>) {
        self.offered.push(Offered { id, trajectory, from_s });
    }

    /// A trajectory goes on from the one before it.
    pub(crate) fn goes_on(&self, id: u64) -> bool {
        self.running.iter().chain(&self.offered).any(|offered| offered.id == id && offered.from_s.is_some())
    }

    /// The loop stood still, or frames of a cycle were lost.
    pub(crate) fn part(&mut self) {
        self.parted = true;
    }

    /// Compares a cycle's claim with the path; what is wrong with it. `tolerance_rad` is that of a trajectory's base.
    pub(crate) fn check(&mut self, cycle: &CycleRecord, joints: usize, limits: [f64; 2]) -> Option<String> {
        if !cycle.joint_sent.iter().any(|sent| *sent) {
            return None; // Nothing of it left: the next cycle takes its place.
        }
        let [period_s, tolerance_rad] = limits;
        let id = cycle.trajectory_id;
        if self.running.as_ref().is_none_or(|running| running.id != id) {
            let at = self.offered.iter().position(|offered| offered.id == id);
            let Some(at) = at else { return Some(format!("moves on trajectory {id}, never offered")) };
            let begins = self.offered.swap_remove(at);
            // What was offered earlier is not taken any more.
            self.offered.retain(|offered| offered.id > id);
            match begins.from_s {
                None => (self.last, self.parted) = (None, false),
                Some(from_s) => {
                    if let Some(text) = self.late_or_early(from_s, cycle.s) {
                        return Some(format!("trajectory {id} {text}"));
                    }
                }
            }
            self.running = Some(begins);
        }
        let trajectory = &self.running.as_ref()?.trajectory;
        let held = self.last.is_some_and(|(_, s)| s.to_bits() == cycle.s.to_bits()) && cycle.sigma <= 0.0;
        if let Some((tick, s)) = self.last.replace((cycle.tick, cycle.s)) {
            #[expect(clippy::cast_precision_loss, reason = "periods of one run")]
            let elapsed_s = cycle.tick.saturating_sub(tick) as f64 * period_s;
            let advanced_s = cycle.s - s;
            if advanced_s < -FORMULA_RAD || advanced_s > elapsed_s + FORMULA_RAD {
                return Some(format!("trajectory time advances {advanced_s} s in {elapsed_s} s"));
            }
        }
        let on_path: JointArray = second_formula(trajectory, cycle.s);
        let wrong = (0..joints).filter(|joint| cycle.joint_sent[*joint]).find_map(|joint| {
            let (is_rad, off_rad) = (cycle.position_rad[joint], cycle.off_path_rad[joint]);
            // An arm that stands after a stall stands where each joint was sent last.
            if held && self.sent_rad[joint].is_some_and(|sent_rad| sent_rad.to_bits() == is_rad.to_bits()) {
                return None;
            }
            let beside_rad = is_rad - on_path[joint];
            let explained = self.parted || beside_rad.abs() <= tolerance_rad + FORMULA_RAD;
            let as_stated = (beside_rad - off_rad).abs() <= FORMULA_RAD;
            (!explained || !as_stated).then(|| {
                format!("joint {} is {beside_rad:e} rad beside its path, stated {off_rad:e}", joint + 1)
            })
        });
        for (joint, sent_rad) in
            self.sent_rad.iter_mut().enumerate().filter(|(joint, _)| cycle.joint_sent[*joint])
        {
            *sent_rad = Some(cycle.position_rad[joint]);
        }
        wrong
    }

    /// A successor makes every setpoint from its cut on, and none before.
    fn late_or_early(&self, from_s: [f64; 2], s: f64) -> Option<String> {
        let before = self.last.map_or(f64::NEG_INFINITY, |(_, s)| s);
        let in_time = from_s.iter().any(|from_s| before <= *from_s && *from_s <= s);
        (!in_time).then(|| format!("takes over between {before} s and {s} s, not at one of {from_s:?} s"))
    }
}
