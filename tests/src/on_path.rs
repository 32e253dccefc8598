//! Logged setpoints against the accepted trajectories, joint by joint, in the order of the log.
//!
//! Only what was sent counts. A setpoint equals the trajectory at the logged time: bit for bit by the product's sampler,
//! and to 1e-11 rad by a second formula written here. A joint may be off the path only after a stall in which setpoints
//! took turns: the arm then stands where each joint was last sent, the log states the difference, and from cycle to
//! cycle it only gets smaller. In a fast stop a joint may also stand where it was sent last, and the log states how far from the
//! path that is. A trajectory that cuts another one gives the same bits as that one at its cut, makes no setpoint before it,
//! and the other makes none from it on.
use crate::cycle_log::{LoggedCut, LoggedCycle};
use crate::setpoints::Flaw;
use std::collections::BTreeMap;
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};

/// Agreement of the second formula with the product's sampler.
const SECOND_FORMULA_RAD: f64 = 1e-11;
/// Rounding of a sum of three angles.
const ROUNDING_RAD: f64 = 1e-12;

/// What is known of one joint.
#[derive(Clone, Copy, Debug, Default)]
struct Joint {
    last_sent_rad: Option<f64>,
    /// Largest difference from the trajectory that is still allowed, with its sign.
    off_rad: f64,
}

/// Follows a log from its beginning.
#[derive(Debug, Default)]
pub(crate) struct PathCheck {
    trajectories: BTreeMap<u64, Trajectory>,
    /// From when each replacement makes the setpoints.
    begins_s: BTreeMap<u64, f64>,
    joints: [Joint; MAX_JOINTS],
    last: Option<(u64, f64)>,
}

impl PathCheck {
    /// Takes an accepted trajectory, which begins this far from where the arm stands.
    pub(crate) fn accept(
        &mut self,
        trajectory_id: u64,
        file: &serde_json::Value,
        start_offset_rad: &[f64],
    ) -> Result<(), Flaw> {
        let trajectory = read(file)?;
        for (index, joint) in self.joints.iter_mut().enumerate().take(trajectory.joints()) {
            joint.off_rad = start_offset_rad.get(index).copied().unwrap_or(0.0);
            let starts_rad = trajectory.base_rad()[index] + joint.off_rad;
            let stood_rad = joint.last_sent_rad.unwrap_or(starts_rad);
            if (starts_rad - stood_rad).abs() > ROUNDING_RAD {
                let joint = index + 1;
                return Err(Flaw::Log(format!(
                    "trajectory {trajectory_id} begins with joint {joint} at {starts_rad} rad, which was sent to {stood_rad} rad"
                )));
            }
        }
        self.trajectories.insert(trajectory_id, trajectory);
        Ok(())
    }

    /// Takes an accepted replacement, which goes on from another trajectory without a step.
    pub(crate) fn replace(
        &mut self,
        trajectory_id: u64,
        file: &serde_json::Value,
        cut: &LoggedCut,
    ) -> Result<(), Flaw> {
        let trajectory = read(file)?;
        let Some(before) = self.trajectories.get(&cut.trajectory_id) else {
            let cut_id = cut.trajectory_id;
            return Err(Flaw::Log(format!("trajectory {trajectory_id} cuts {cut_id}, never accepted")));
        };
        // Both in the cut and a little before the end of what is kept, where only a changed stroke would show.
        for at_s in [cut.from_s, 0.5 * (cut.from_s + cut.at_s)] {
            let (old, new) = (before.sample(at_s), trajectory.sample(at_s));
            let apart =
                |a: &JointArray, b: &JointArray| a.iter().zip(b).any(|(a, b)| a.to_bits() != b.to_bits());
            if apart(&old.position_rad, &new.position_rad)
                || apart(&old.velocity_rad_s, &new.velocity_rad_s)
                || apart(&old.acceleration_rad_s2, &new.acceleration_rad_s2)
                || apart(&old.jerk_rad_s3, &new.jerk_rad_s3)
            {
                return Err(Flaw::Log(format!(
                    "trajectory {trajectory_id} does not go on from {} at s = {at_s}: {:?} rad, {:?} rad",
                    cut.trajectory_id, new.position_rad, old.position_rad
                )));
            }
        }
        self.trajectories.insert(trajectory_id, trajectory);
        self.begins_s.insert(trajectory_id, cut.from_s);
        Ok(())
    }

    /// A replacement makes every setpoint from its cut on, and none before.
    fn check_begin(&self, cycle: &LoggedCycle) -> Result<(), Flaw> {
        let Some(from_s) = self.begins_s.get(&cycle.trajectory_id) else { return Ok(()) };
        let early = cycle.s < *from_s;
        let late = self.last.is_some_and(|(id, s)| id != cycle.trajectory_id && s > *from_s);
        if early || late {
            let (tick, id, s) = (cycle.tick, cycle.trajectory_id, cycle.s);
            return Err(Flaw::Log(format!(
                "tick {tick}: trajectory {id} takes over at s = {s}, before {:?}; its cut is at {from_s}",
                self.last
            )));
        }
        Ok(())
    }

    /// Compares the setpoints that a cycle has sent with its trajectory; how many there were.
    pub(crate) fn compare(&mut self, cycle: &LoggedCycle) -> Result<usize, Flaw> {
        let on_path = is_on_path(&cycle.phase);
        if on_path && cycle.joint_sent.contains(&true) {
            self.check_begin(cycle)?;
        }
        let compared = if on_path { self.compare_sent(cycle)? } else { 0 };
        for (index, joint) in self.joints.iter_mut().enumerate().filter(|(index, _)| is_sent(cycle, *index)) {
            joint.last_sent_rad = cycle.position_rad.get(index).copied();
        }
        self.last = Some((cycle.trajectory_id, cycle.s));
        Ok(compared)
    }

    fn compare_sent(&mut self, cycle: &LoggedCycle) -> Result<usize, Flaw> {
        let id = cycle.trajectory_id;
        let Some(trajectory) = self.trajectories.get(&id) else {
            return Err(Flaw::Log(format!("tick {}: moves on trajectory {id}, never accepted", cycle.tick)));
        };
        let sampled = trajectory.sample(cycle.s).position_rad;
        let second = second_formula(trajectory, cycle.s);
        let stands = cycle.sigma == 0.0 && self.last == Some((id, cycle.s));
        let mut compared = 0;
        let joints = self.joints.iter_mut().enumerate().take(trajectory.joints());
        for (index, joint) in joints.filter(|(index, _)| is_sent(cycle, *index)) {
            compared += 1;
            let got_rad = cycle.position_rad.get(index).copied().unwrap_or(f64::NAN);
            let stood = joint.last_sent_rad.is_some_and(|last_rad| last_rad.to_bits() == got_rad.to_bits());
            if stands && stood {
                joint.off_rad = got_rad - sampled[index];
                continue;
            }
            let off_rad = cycle.off_path_rad.get(index).copied().unwrap_or(f64::NAN);
            // A joint that missed more setpoints than its drive bridges stays there while the others stop on the path.
            let kept = cycle.phase == "fast-stopping" && stood;
            if kept && (got_rad - sampled[index] - off_rad).abs() <= ROUNDING_RAD {
                joint.off_rad = off_rad;
                continue;
            }
            let want_rad = if off_rad == 0.0 { sampled[index] } else { sampled[index] + off_rad };
            let flaw = |want_rad| Flaw::OffTrajectory {
                tick: cycle.tick,
                joint: index + 1,
                got_rad,
                want_rad,
                off_rad,
                s: cycle.s,
            };
            if got_rad.to_bits() != want_rad.to_bits() {
                return Err(flaw(want_rad));
            }
            if (got_rad - second[index] - off_rad).abs() > SECOND_FORMULA_RAD {
                return Err(flaw(second[index] + off_rad));
            }
            let returns = off_rad == 0.0
                || off_rad.abs() <= joint.off_rad.abs()
                    && off_rad.is_sign_positive() == joint.off_rad.is_sign_positive();
            if !returns {
                return Err(flaw(sampled[index] + joint.off_rad));
            }
            joint.off_rad = off_rad;
        }
        Ok(compared)
    }
}

fn is_sent(cycle: &LoggedCycle, joint: usize) -> bool {
    cycle.joint_sent.get(joint) == Some(&true)
}

/// Phases in which the arm is on its trajectory.
fn is_on_path(phase: &str) -> bool {
    matches!(phase, "moving" | "pausing" | "paused" | "stopping" | "fast-stopping")
}

/// Positions by the definition of Tau-J*, written without a line of the product's sampler.
pub(crate) fn second_formula(trajectory: &Trajectory, t_s: f64) -> JointArray {
    let mut q = *trajectory.base_rad();
    for Stroke { start_s, duration_s, n, delta_rad } in trajectory.strokes() {
        let s = ((t_s - start_s) / duration_s).clamp(0.0, 1.0);
        let phi = 1.0 - (1.0 - s.powf(4.0)).powf(f64::from(*n));
        for (q, delta) in q.iter_mut().zip(delta_rad) {
            *q += delta * phi;
        }
    }
    q
}

/// Reads a trajectory object of the log with plain JSON access.
fn read(file: &serde_json::Value) -> Result<Trajectory, Flaw> {
    let missing = || Flaw::Log(format!("a trajectory that is none: {file}"));
    let joints = |v: &serde_json::Value| -> Option<JointArray> {
        let mut array = [0.0; MAX_JOINTS];
        let list = v.as_array()?;
        for (slot, value) in array.iter_mut().zip(list) {
            *slot = value.as_f64()?;
        }
        (list.len() <= MAX_JOINTS).then_some(array)
    };
    let stroke = |v: &serde_json::Value| -> Option<Stroke> {
        Some(Stroke {
            start_s: v["start_s"].as_f64()?,
            duration_s: v["duration_s"].as_f64()?,
            n: u32::try_from(v["n"].as_u64()?).ok()?,
            delta_rad: joints(&v["delta_rad"])?,
        })
    };
    let count = file["joints"].as_u64().and_then(|n| usize::try_from(n).ok()).ok_or_else(missing)?;
    let base = joints(&file["base_rad"]).ok_or_else(missing)?;
    let strokes = file["strokes"].as_array().ok_or_else(missing)?;
    let strokes: Option<Vec<Stroke>> = strokes.iter().map(stroke).collect();
    Trajectory::new(count, base, &strokes.ok_or_else(missing)?).map_err(|e| Flaw::Log(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two joints that go 0.4 rad and back the other way in 0.4 s.
    fn file() -> serde_json::Value {
        let stroke =
            serde_json::json!({ "start_s": 0.0, "duration_s": 0.4, "n": 5, "delta_rad": [0.4, -0.4] });
        serde_json::json!({ "joints": 2, "base_rad": [0.1, 0.2], "strokes": [stroke] })
    }

    /// Cycles of joints that take turns, with a stall after cycle 100 whose differences are faded out in ten cycles.
    fn log() -> Vec<LoggedCycle> {
        let trajectory = read(&file()).unwrap();
        let at = |s: f64| trajectory.sample(s).position_rad;
        let mut cycles = Vec::new();
        let mut last_rad = [0.0; 2];
        let mut offset_rad = [0.0; 2];
        for tick in 1..=300_u32 {
            let moved = if tick <= 100 { tick } else { tick.saturating_sub(20).max(100) };
            let s = f64::from(moved) * 1e-3;
            let stands = (101..=120).contains(&tick);
            let left = if stands { 1.0 } else { 1.0 - (f64::from(tick.saturating_sub(120)) / 10.0).min(1.0) };
            let off_rad = offset_rad.map(|offset: f64| if stands { 0.0 } else { offset * left });
            let mut position_rad = vec![at(s)[0] + off_rad[0], at(s)[1] + off_rad[1]];
            if stands {
                position_rad = last_rad.to_vec();
                offset_rad = [last_rad[0] - at(s)[0], last_rad[1] - at(s)[1]];
            }
            let joint_sent = if stands { vec![true, true] } else { vec![tick % 2 == 0, tick % 2 == 1] };
            for (joint, sent) in joint_sent.iter().enumerate().filter(|(_, sent)| **sent) {
                assert!(*sent);
                last_rad[joint] = position_rad[joint];
            }
            cycles.push(LoggedCycle {
                tick: tick.into(),
                time_ns: u64::from(tick) * 1_000_000,
                sync: vec![tick.into()],
                frames: vec![tick.into()],
                phase: "moving".into(),
                trajectory_id: 5,
                s,
                sigma: if stands { 0.0 } else { 1.0 },
                position_rad,
                off_path_rad: off_rad.to_vec(),
                joint_sent,
                sent: vec![1],
                lost: vec![0],
                axes: Vec::new(),
            });
        }
        cycles
    }

    fn check(cycles: &[LoggedCycle]) -> Result<usize, Flaw> {
        let mut path = PathCheck::default();
        path.accept(5, &file(), &[])?;
        cycles.iter().map(|cycle| path.compare(cycle)).sum()
    }

    #[test]
    fn way_back_to_the_path_after_a_stall_in_turns_passes() {
        assert_eq!(check(&log()), Ok(300 + 20));
    }

    #[test]
    fn joint_that_was_not_sent_is_not_compared_and_one_that_was_is() {
        let mut cycles = log();
        cycles[199].position_rad[0] += 1e-9; // Joint 1 is sent in even cycles.
        check(&cycles).expect_err("a sent joint beside its path");
        let mut cycles = log();
        cycles[199].position_rad[1] += 1e-3;
        assert_eq!(check(&cycles), Ok(320));
    }

    #[test]
    fn difference_that_no_stall_explains_or_that_grows_fails() {
        type Doctor = fn(&mut Vec<LoggedCycle>);
        let off = |cycle: &mut LoggedCycle, joint: usize, by_rad: f64| {
            cycle.off_path_rad[joint] += by_rad;
            let sampled = read(&file()).unwrap().sample(cycle.s).position_rad[joint];
            cycle.position_rad[joint] = sampled + cycle.off_path_rad[joint];
        };
        // Before any stall; larger than where the arm stood; growing again; to the other side.
        for (at, by_rad) in [(49, 1e-6), (121, 1e-2), (125, -1e-2), (199, 1e-9)] {
            let mut cycles = log();
            off(&mut cycles[at], usize::from(at % 2 == 0), by_rad);
            check(&cycles).expect_err("a difference");
        }
        let doctors: [Doctor; 2] = [
            // A joint that stays where it is while the others continue has not stalled.
            |cycles| cycles[201].position_rad[0] = cycles[199].position_rad[0],
            // An arm that stands stands where it was last sent.
            |cycles| cycles[110].position_rad[0] += 1e-9,
        ];
        for doctor in doctors {
            let mut cycles = log();
            doctor(&mut cycles);
            check(&cycles).expect_err("an arm that is elsewhere");
        }
    }

    /// Goal: a joint that its drive has stopped may stay behind in a fast stop, by the stated difference, and in no other phase.
    #[test]
    fn joint_kept_where_it_was_sent_passes_in_a_fast_stop_with_its_difference_stated() {
        let trajectory = read(&file()).unwrap();
        let kept = |phase: &str, misstated_rad: f64| {
            let mut cycles = log();
            let stands_rad = cycles[200].position_rad[1]; // Joint 2 is sent in odd cycles, as this one.
            for cycle in cycles.iter_mut().skip(201) {
                cycle.phase = phase.into();
                cycle.position_rad[1] = stands_rad;
                cycle.off_path_rad[1] =
                    stands_rad - trajectory.sample(cycle.s).position_rad[1] + misstated_rad;
            }
            check(&cycles)
        };
        assert_eq!(kept("fast-stopping", 0.0), Ok(320));
        kept("fast-stopping", 1e-9).expect_err("elsewhere than stated");
        kept("moving", 0.0).expect_err("a joint that stays behind in motion");
    }

    /// Goal: a replacement passes when it goes on from the trajectory that it cuts, and takes over with the first setpoint from
    /// its cut on; one with a changed stroke, an early and a late takeover fail.
    #[test]
    fn replacement_passes_only_when_it_goes_on_at_its_cut() {
        let at_s = 0.2;
        let file_of = |delta: f64| {
            let kept =
                serde_json::json!({ "start_s": 0.0, "duration_s": 0.4, "n": 5, "delta_rad": [delta, -0.4] });
            let new =
                serde_json::json!({ "start_s": at_s, "duration_s": 0.4, "n": 5, "delta_rad": [0.1, 0.1] });
            serde_json::json!({ "joints": 2, "base_rad": [0.1, 0.2], "strokes": [kept, new] })
        };
        let cut = LoggedCut { trajectory_id: 5, at_s, from_s: at_s };
        let run = |delta: f64, takes_over_s: f64| {
            let mut path = PathCheck::default();
            path.accept(5, &file(), &[])?;
            path.replace(6, &file_of(delta), &cut)?;
            for tick in 1..=590_u32 {
                let s = f64::from(tick) * 1e-3;
                let trajectory_id = if s < takes_over_s { 5 } else { 6 };
                let sampled = path.trajectories[&trajectory_id].sample(s).position_rad;
                path.compare(&LoggedCycle {
                    tick: tick.into(),
                    trajectory_id,
                    s,
                    position_rad: sampled[..2].to_vec(),
                    off_path_rad: vec![0.0; 2],
                    joint_sent: vec![true; 2],
                    sigma: 1.0,
                    ..log()[0].clone()
                })?;
            }
            Ok::<(), Flaw>(())
        };
        run(0.4, at_s).unwrap();
        run(f64::from_bits(0.4_f64.to_bits() + 1), at_s).expect_err("a changed stroke");
        run(0.4, at_s - 1e-3).expect_err("too early");
        run(0.4, at_s + 2e-3).expect_err("too late");
    }

    #[test]
    fn trajectory_that_begins_elsewhere_than_the_arm_stands_fails() {
        let mut path = PathCheck::default();
        path.accept(5, &file(), &[]).unwrap();
        for cycle in &log() {
            path.compare(cycle).unwrap();
        }
        path.accept(6, &file(), &[]).expect_err("back to the beginning at once");
    }
}
