//! A first timing of a path with rounded corners: how fast each corner is passed, and how each segment gets from one speed
//! to the next.
//!
//! A corner that may be cut by `e` turns the direction of motion, and each joint's share of the turn is a change of its
//! velocity. With constant acceleration a the change takes W = u |turn| / a at a speed of u and cuts u |turn| W / 8; with a
//! triangle of acceleration, which the jerk j decides, it takes 2 (u |turn| / j)^(1/2) and cuts u |turn| W / 12. The lower of the
//! two speeds is taken. What comes out is where a fit begins ([`super::tube`]), and is neither smooth nor checked.
use super::line::LineLimits;
use taustream_motion::JointArray;

/// Share of a segment that a rounded corner may take.
const REACH: f64 = 0.45;
/// Halvings of a search for a speed.
const HALVINGS: usize = 40;
/// Below this the direction does not change (no unit).
const TURN_MIN: f64 = 1e-9;

/// A segment with its limits along it, by the length of the joint vector.
#[derive(Clone, Copy, Debug)]
struct Segment {
    from_rad: JointArray,
    to_rad: JointArray,
    length_rad: f64,
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
    jerk_rad_s3: f64,
}

/// One segment's motion: a ramp from one speed to the peak, a cruise, a ramp to the next.
#[derive(Clone, Copy, Debug)]
struct Piece {
    start_s: f64,
    speeds_rad_s: [f64; 3],
    rise_s: f64,
    cruise_s: f64,
    fall_s: f64,
}

/// When the arm is where along a path.
#[derive(Clone, Debug)]
pub(super) struct Law {
    segments: Vec<Segment>,
    pieces: Vec<Piece>,
}

impl Law {
    /// A law for distinct corners, of which each inner one may be cut by so much; `None` where no motion is possible.
    pub(super) fn new(path: &super::Path, deviations_rad: &[f64]) -> Option<Self> {
        let segment = |pair: &[JointArray]| Segment::of(path, pair.first()?, pair.get(1)?);
        let segments: Vec<Segment> = path.corners_rad.windows(2).map(segment).collect::<Option<_>>()?;
        let inner = segments.windows(2).zip(deviations_rad);
        let mut speeds = vec![0.0];
        speeds.extend(inner.map(|(pair, deviation_rad)| corner_speed(path, pair, *deviation_rad)));
        speeds.resize(segments.len() + 1, 0.0);
        if let Some(last) = speeds.last_mut() {
            *last = 0.0;
        }
        for (i, segment) in segments.iter().enumerate() {
            speeds[i + 1] = segment.reached(speeds[i], speeds[i + 1]);
        }
        for (i, segment) in segments.iter().enumerate().rev() {
            speeds[i] = segment.reached(speeds[i + 1], speeds[i]);
        }
        let mut start_s = 0.0;
        let pieces: Vec<Piece> = segments
            .iter()
            .zip(speeds.windows(2))
            .map(|(segment, ends)| {
                let piece = segment.piece(start_s, ends[0], ends[1]);
                start_s = piece.end_s();
                piece
            })
            .collect();
        (!pieces.is_empty() && start_s.is_finite()).then_some(Self { segments, pieces })
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.pieces.last().map_or(0.0, Piece::end_s)
    }

    /// The segment and the pose at a time.
    pub(super) fn at(&self, t_s: f64) -> (usize, JointArray) {
        let last = self.pieces.len() - 1;
        let i = self.pieces.partition_point(|piece| piece.end_s() <= t_s).min(last);
        let (segment, piece) = (&self.segments[i], &self.pieces[i]);
        let share = (piece.distance_rad(t_s) / segment.length_rad).clamp(0.0, 1.0);
        let pose = |j: usize| segment.from_rad[j] + share * (segment.to_rad[j] - segment.from_rad[j]);
        (i, std::array::from_fn(pose))
    }
}

impl Segment {
    fn of(path: &super::Path, from_rad: &JointArray, to_rad: &JointArray) -> Option<Self> {
        let line = LineLimits::between(from_rad, to_rad, (path.joints, path.limits))?;
        let length_rad = super::distance(from_rad, to_rad);
        Some(Self {
            from_rad: *from_rad,
            to_rad: *to_rad,
            length_rad,
            velocity_rad_s: line.velocity * length_rad,
            acceleration_rad_s2: line.acceleration * length_rad,
            jerk_rad_s3: line.jerk * length_rad,
        })
    }

    /// Time for a change of speed.
    fn ramp_s(&self, from_rad_s: f64, to_rad_s: f64) -> f64 {
        let (change, a, j) = ((to_rad_s - from_rad_s).abs(), self.acceleration_rad_s2, self.jerk_rad_s3);
        if change >= a * a / j { change / a + a / j } else { 2.0 * (change / j).sqrt() }
    }

    fn ramp_rad(&self, from_rad_s: f64, to_rad_s: f64) -> f64 {
        0.5 * (from_rad_s + to_rad_s) * self.ramp_s(from_rad_s, to_rad_s)
    }

    /// The highest speed up to `most_rad_s` that is reached over the whole segment.
    fn reached(&self, from_rad_s: f64, most_rad_s: f64) -> f64 {
        let fits = |to: f64| self.ramp_rad(from_rad_s, to) <= self.length_rad;
        if most_rad_s <= from_rad_s { most_rad_s } else { highest(from_rad_s, most_rad_s, fits) }
    }

    fn piece(&self, start_s: f64, from: f64, to: f64) -> Piece {
        let fits = |peak: f64| self.ramp_rad(from, peak) + self.ramp_rad(to, peak) <= self.length_rad;
        let least = from.max(to);
        let peak = highest(least, self.velocity_rad_s.max(least), fits);
        let left_rad = self.length_rad - self.ramp_rad(from, peak) - self.ramp_rad(to, peak);
        Piece {
            start_s,
            speeds_rad_s: [from, peak, to],
            rise_s: self.ramp_s(from, peak),
            cruise_s: (left_rad / peak).max(0.0),
            fall_s: self.ramp_s(peak, to),
        }
    }
}

/// The highest value between two that fits, if the lower one does.
fn highest(mut low: f64, mut high: f64, fits: impl Fn(f64) -> bool) -> f64 {
    if fits(high) {
        return high;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

impl Piece {
    fn end_s(&self) -> f64 {
        self.start_s + self.rise_s + self.cruise_s + self.fall_s
    }

    /// How far along the segment: the speed follows 3 x^2 - 2 x^3 in the ramps.
    fn distance_rad(&self, t_s: f64) -> f64 {
        let t_s = t_s - self.start_s;
        let [from, peak, to] = self.speeds_rad_s;
        let ramp = |[from, to]: [f64; 2], span_s: f64, t_s: f64| {
            let x = if span_s > 0.0 { (t_s / span_s).clamp(0.0, 1.0) } else { 0.0 };
            span_s * (from * x + (to - from) * (x * x * x * (1.0 - 0.5 * x)))
        };
        ramp([from, peak], self.rise_s, t_s)
            + peak * (t_s - self.rise_s).clamp(0.0, self.cruise_s)
            + ramp([peak, to], self.fall_s, t_s - self.rise_s - self.cruise_s)
    }
}

/// How fast the corner between two segments is passed.
fn corner_speed(path: &super::Path, segments: &[Segment], deviation_rad: f64) -> f64 {
    let [a, b] = segments else { return 0.0 };
    let (mut square, mut acceleration, mut jerk) = (0.0, f64::INFINITY, f64::INFINITY);
    for (j, limits) in path.limits.iter().enumerate().take(path.joints) {
        let direction = |s: &Segment| (s.to_rad[j] - s.from_rad[j]) / s.length_rad;
        let turn = direction(b) - direction(a);
        square += turn * turn;
        acceleration = acceleration.min(limits.motion.acceleration_rad_s2 / turn.abs());
        jerk = jerk.min(limits.motion.jerk_rad_s3 / turn.abs());
    }
    let turn = square.sqrt().max(TURN_MIN);
    let most = a.velocity_rad_s.min(b.velocity_rad_s);
    // What the corner takes of a segment is at most its share of it.
    let deviation = deviation_rad.min(turn * REACH * a.length_rad.min(b.length_rad) / 4.0);
    let by_acceleration = (8.0 * deviation * acceleration / turn).sqrt();
    let by_jerk = (6.0 * deviation * jerk.sqrt() / turn).powf(2.0 / 3.0);
    by_acceleration.min(by_jerk).min(most)
}
