//! Where on its path an arm comes to rest when it is stopped now: computed as the streamer stops it.
use taustream_motion::peaks_ahead::{AT_REST, PeaksAhead, Stretch, cell_count, fill, span_s};
use taustream_motion::stopping::{Situation, SpeedRequest, StopRules};
use taustream_motion::time_scale::TimeScale;
use taustream_motion::{JointLimits, MAX_JOINTS, Trajectory};

/// Steps in which the way of a stop is summed up, s: short enough for an exact sum.
const STEP_S: f64 = 0.01;

/// What a motion does from now on, as its stops are chosen from.
pub struct StopAhead<'a> {
    rules: StopRules,
    pieces: Vec<(&'a Trajectory, f64, Vec<Stretch>)>,
}

/// Trajectory times at which the arm rests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// After a stop.
    pub gentle_rest_s: f64,
    /// After a fast stop.
    pub fast_rest_s: f64,
}

impl<'a> StopAhead<'a> {
    /// The tables of the trajectory that runs and, behind it, of one that takes over at an instant.
    #[must_use]
    pub fn new(limits: &[JointLimits; MAX_JOINTS], joints: usize, pieces: &[(&'a Trajectory, f64)]) -> Self {
        let table = |(trajectory, from_s): &(&'a Trajectory, f64)| {
            let mut cells = vec![AT_REST; cell_count(trajectory)];
            fill(&mut cells, trajectory, limits);
            (*trajectory, *from_s, cells)
        };
        Self { rules: StopRules::new(limits, joints), pieces: pieces.iter().map(table).collect() }
    }

    /// Where stops end that begin at a trajectory time, at a speed from 0 to 1.
    #[must_use]
    pub fn stops(&self, s: f64, speed: f64) -> Stops {
        Stops {
            gentle_rest_s: self.rest_s(SpeedRequest::Stop, s, speed),
            fast_rest_s: self.rest_s(SpeedRequest::FastStop, s, speed),
        }
    }

    fn rest_s(&self, request: SpeedRequest, s: f64, speed: f64) -> f64 {
        let mut pieces = self.pieces.iter();
        let Some((first, _, cells)) = pieces.next() else { return s };
        let mut ahead = PeaksAhead::new(cells, span_s(first));
        for (next, from_s, cells) in pieces {
            ahead = ahead.then(*from_s, cells, span_s(next));
        }
        let mut scale = TimeScale::settled(speed);
        let situation = Situation { now_s: 0.0, s, ahead, approaching: false, waits_s: 0.0 };
        self.rules.apply(request, &mut scale, &situation);
        let (mut at_s, mut rest_s) = (0.0, s);
        // No stop takes longer than the longest.
        while !scale.is_settled(at_s) && at_s <= self.rules.longest_stop_s() {
            rest_s += scale.advance_s(at_s, at_s + STEP_S);
            at_s += STEP_S;
        }
        rest_s
    }
}
