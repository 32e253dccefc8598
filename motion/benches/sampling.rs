//! What sampling costs: one active stroke of six joints beside quintics of the same shape.
//!
//! Run with `cargo bench -p taustream-motion`. The candidates take turns in short slices, so that a busy machine slows
//! all of them; what counts is the ratio of the medians.
use std::hint::black_box;
use std::time::Instant;
use taustream_motion::profile::{Profile, Quintic};
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointArray, MAX_JOINTS, Setpoint, Stroke, Trajectory};

const JOINTS: usize = 6;
const SLICES: usize = 2_001;
const SAMPLES_A_SLICE: u32 = 1_000;
const DURATION_S: f64 = 2.0;

/// Six quintics with coefficients of their own, as trajectory interfaces hand them over.
struct Quintics {
    coefficients: [[f64; 6]; JOINTS],
}

impl Quintics {
    fn new(base_rad: &JointArray, delta_rad: &JointArray) -> Self {
        let mut coefficients = [[0.0; 6]; JOINTS];
        for (row, (base, delta)) in coefficients.iter_mut().zip(base_rad.iter().zip(delta_rad)) {
            let t3 = DURATION_S.powi(3);
            *row = [
                *base,
                0.0,
                0.0,
                10.0 * delta / t3,
                -15.0 * delta / (t3 * DURATION_S),
                6.0 * delta / (t3 * DURATION_S * DURATION_S),
            ];
        }
        Self { coefficients }
    }

    // Called, not inlined, as the stroke is from another crate.
    #[inline(never)]
    fn sample(&self, t_s: f64) -> Setpoint {
        let t = t_s.clamp(0.0, DURATION_S);
        let mut out = Setpoint::default();
        for (joint, [a, b, c, d, e, f]) in self.coefficients.iter().enumerate() {
            out.position_rad[joint] = a + t * (b + t * (c + t * (d + t * (e + t * f))));
            out.velocity_rad_s[joint] = b + t * (2.0 * c + t * (3.0 * d + t * (4.0 * e + t * 5.0 * f)));
            out.acceleration_rad_s2[joint] = 2.0 * c + t * (6.0 * d + t * (12.0 * e + t * 20.0 * f));
            out.jerk_rad_s3[joint] = 6.0 * d + t * (24.0 * e + t * 60.0 * f);
        }
        out
    }
}

/// A quintic in the place of phi, everything else as in a stroke: the leanest quintic there is.
#[inline(never)]
fn shared_quintic(base_rad: &JointArray, stroke: &Stroke, t_s: f64) -> Setpoint {
    let mut out = Setpoint { position_rad: *base_rad, ..Setpoint::default() };
    let phi = Quintic.at((t_s - stroke.start_s) / stroke.duration_s);
    let rate = 1.0 / stroke.duration_s;
    for (joint, delta) in stroke.delta_rad.iter().enumerate() {
        out.position_rad[joint] += delta * phi.value;
        out.velocity_rad_s[joint] += delta * (phi.d1 * rate);
        out.acceleration_rad_s2[joint] += delta * (phi.d2 * rate * rate);
        out.jerk_rad_s3[joint] += delta * (phi.d3 * rate * rate * rate);
    }
    out
}

/// Nanoseconds a sample of one slice.
fn slice(sample: &mut dyn FnMut(f64) -> Setpoint) -> f64 {
    let begin = Instant::now();
    for step in 0..SAMPLES_A_SLICE {
        let t_s = DURATION_S * (f64::from(step) + 0.5) / f64::from(SAMPLES_A_SLICE);
        black_box(sample(black_box(t_s)));
    }
    begin.elapsed().as_secs_f64() * 1e9 / f64::from(SAMPLES_A_SLICE)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let (mut base_rad, mut delta_rad) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
    for joint in 0..JOINTS {
        let place = f64::from(u32::try_from(joint).unwrap_or(0));
        base_rad[joint] = 0.1 * place - 0.2;
        delta_rad[joint] = 0.7 - 0.3 * place;
    }
    println!("p, v, a, j of {JOINTS} joints, one active stroke; median of {SLICES} alternating slices");
    for n in [4, 5, 10, 64] {
        let stroke = Stroke { start_s: 0.0, duration_s: DURATION_S, n, delta_rad };
        let Ok(trajectory) = Trajectory::new(JOINTS, base_rad, &[stroke]) else { return };
        let quintics = Quintics::new(&base_rad, &delta_rad);
        let mut cursor = Cursor::at_start(&trajectory);
        let mut times: [Vec<f64>; 4] = [(); 4].map(|()| Vec::with_capacity(SLICES));
        for _ in 0..SLICES {
            times[0].push(slice(&mut |t_s| trajectory.sample(t_s)));
            times[1].push(slice(&mut |t_s| quintics.sample(t_s)));
            times[2].push(slice(&mut |t_s| cursor.sample(&trajectory, t_s)));
            times[3].push(slice(&mut |t_s| shared_quintic(&base_rad, &stroke, t_s)));
        }
        let [stroke_ns, quintic_ns, cursor_ns, shared_ns] = times.map(|mut times| median(&mut times));
        println!(
            "n = {n:2}: stroke {stroke_ns:.1} ns, with cursor {cursor_ns:.1} ns, quintic a joint {quintic_ns:.1} ns, shared quintic {shared_ns:.1} ns; stroke/quintic {:.2}, stroke/shared quintic {:.2}",
            stroke_ns / quintic_ns,
            stroke_ns / shared_ns
        );
    }
}
