//! A trajectory that is asked for its pose at many instants in any order.
use super::Motion;
use taustream_motion::{JointArray, Trajectory};

/// A trajectory, and where the strokes that have ended have led.
pub struct Course<'a> {
    trajectory: &'a Trajectory,
    /// For each stroke, the end of it and of all before it.
    ended_s: Vec<f64>,
    /// For each stroke, the pose after it and all before it.
    reached_rad: Vec<JointArray>,
}

impl<'a> Course<'a> {
    /// Adds up what the strokes do, in their order.
    #[must_use]
    pub fn new(trajectory: &'a Trajectory) -> Self {
        let strokes = trajectory.strokes();
        let (mut end_s, mut at_rad) = (f64::NEG_INFINITY, *trajectory.base_rad());
        let (mut ended_s, mut reached_rad) =
            (Vec::with_capacity(strokes.len()), Vec::with_capacity(strokes.len()));
        for stroke in strokes {
            end_s = end_s.max(stroke.end_s());
            at_rad.iter_mut().zip(&stroke.delta_rad).for_each(|(at, delta)| *at += delta * 1.0);
            ended_s.push(end_s);
            reached_rad.push(at_rad);
        }
        Self { trajectory, ended_s, reached_rad }
    }

    /// How many strokes in front have surely ended.
    fn ended(&self, t_s: f64) -> usize {
        self.ended_s.partition_point(|end_s| *end_s <= t_s)
    }
}

impl Motion for Course<'_> {
    fn at(&self, t_s: f64) -> JointArray {
        let first = self.ended(t_s);
        let before = first.checked_sub(1).and_then(|last| self.reached_rad.get(last));
        self.trajectory.position_after(first, before.unwrap_or(self.trajectory.base_rad()), t_s)
    }

    fn travel_rad(&self, from_s: f64, to_s: f64) -> JointArray {
        self.trajectory.travel_bound_after(self.ended(from_s.min(to_s)), from_s, to_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::SeededRng;
    use taustream_motion::{MAX_JOINTS, Stroke};

    /// Goal: the same bits as the trajectory's, whatever order the strokes end in.
    #[test]
    fn course_has_the_bits_of_its_trajectory() {
        let mut rng = SeededRng::new(7, 0);
        for _ in 0..50 {
            let mut strokes: Vec<Stroke> = (0..40)
                .map(|_| Stroke {
                    start_s: rng.within(0.0, 3.0),
                    duration_s: rng.within(0.01, 2.0),
                    n: 7,
                    delta_rad: std::array::from_fn(|j| if j < 6 { rng.within(-1.0, 1.0) } else { 0.0 }),
                })
                .collect();
            strokes.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
            let trajectory = Trajectory::new(6, [0.0; MAX_JOINTS], &strokes).unwrap();
            let course = Course::new(&trajectory);
            for _ in 0..200 {
                let (t_s, then_s) = (rng.within(-0.5, 6.0), rng.within(-0.5, 6.0));
                assert_eq!(
                    course.at(t_s).map(f64::to_bits),
                    trajectory.sample(t_s).position_rad.map(f64::to_bits)
                );
                assert_eq!(
                    course.travel_rad(t_s, then_s).map(f64::to_bits),
                    trajectory.travel_bound_rad(t_s, then_s).map(f64::to_bits)
                );
            }
        }
    }
}
