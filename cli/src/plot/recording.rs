//! Joint curves as SVG: position, velocity, acceleration and jerk over time, commanded and measured.
//!
//! Commanded derivatives are the streamer's own. Drives send positions only, so measured velocity and acceleration are those of a
//! cubic fitted to the measured positions around each instant (Savitzky and Golay, Analytical Chemistry 36, 1964, for
//! uneven times); the pictures say so. Text stays text: no font file is needed to draw, the viewer's sans-serif is used.
use super::panel::{JOINT_COLOURS, PANELS, draw_panels, motion_limits, titles, undrawable};
use crate::failure::Failure;
use crate::output::write_whole;
use plotters::prelude::{IntoDrawingArea, IntoFont, RGBColor, SVGBackend, WHITE};
use std::path::{Path, PathBuf};
use taustream_arm::RobotJoint;
use taustream_claims::chart::{Area, Curve, Drawn, LimitLine, Point, thinned};
use taustream_motion::{JointArray, JointKind, Setpoint};

/// One instant of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    /// Seconds since the recording began.
    pub(crate) t_s: f64,
    /// What the streamer sent.
    pub(crate) commanded: Setpoint,
    /// What the drives answered; NaN before the first answer.
    pub(crate) measured_rad: JointArray,
    /// How old each answer was: what was measured, was measured that much earlier.
    pub(crate) measured_age_s: JointArray,
}

/// Half the width of the fit, in samples.
const FIT_HALF_WIDTH: usize = 5;
/// The panel of the jerk.
const JERK: usize = 3;
const SIZE_PX: (u32, u32) = (1100, 1180);
const COMMANDED: RGBColor = RGBColor(31, 119, 180);
const MEASURED: RGBColor = RGBColor(255, 127, 14);
/// Writes `motion.svg` with all joints and one picture a joint into `directory`; the files that were written.
pub(crate) fn write_all(
    directory: &Path,
    joints: &[RobotJoint],
    samples: &[Sample],
) -> Result<Vec<PathBuf>, Failure> {
    let measured: Vec<Vec<[f64; 4]>> = (0..joints.len()).map(|j| measured_derivatives(samples, j)).collect();
    let mut files = Vec::new();

    let overview = directory.join("motion.svg");
    let panels = PANELS.map(|_| Vec::new());
    let panels = add_overview(panels, joints, samples, &measured);
    let title = "All joints: commanded (thin, dark) over measured (wide, light)";
    let kinds: Vec<JointKind> = joints.iter().map(|joint| joint.kind).collect();
    draw((&overview, title), titles(&kinds), &panels, &motion_limits(joints))?;
    files.push(overview);

    for (j, joint) in joints.iter().enumerate() {
        let name = &joint.name;
        let file = directory.join(format!("joint{}-{}.svg", j + 1, file_word(name)));
        let title = format!("Joint {} {name}: commanded and measured", j + 1);
        let measured = measured.get(j).map_or(&[][..], Vec::as_slice);
        draw(
            (&file, &title),
            titles(&[joint.kind]),
            &joint_panels(j, samples, measured),
            &motion_limits(std::slice::from_ref(joint)),
        )?;
        files.push(file);
    }
    Ok(files)
}

/// Names of joints come from files: only harmless characters may stand in a file name.
fn file_word(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' }).collect()
}

fn add_overview(
    mut panels: [Vec<Curve>; 4],
    joints: &[RobotJoint],
    samples: &[Sample],
    measured: &[Vec<[f64; 4]>],
) -> [Vec<Curve>; 4] {
    for (order, panel) in panels.iter_mut().enumerate() {
        for (j, (joint, colour)) in joints.iter().zip(JOINT_COLOURS).enumerate() {
            let of_joint = measured.get(j).map_or(&[][..], Vec::as_slice);
            let points = measured_points(samples, of_joint, order);
            panel.push(Curve { label: String::new(), colour, width_px: 5, opacity: 0.3, points });
            let points = commanded_points(samples, j, order);
            panel.push(Curve { label: joint.name.clone(), colour, width_px: 1, opacity: 1.0, points });
        }
    }
    panels
}

fn joint_panels(j: usize, samples: &[Sample], measured: &[[f64; 4]]) -> [Vec<Curve>; 4] {
    let mut order = 0;
    PANELS.map(|_| {
        let commanded = Curve {
            label: "commanded".to_owned(),
            colour: COMMANDED,
            width_px: 2,
            opacity: 1.0,
            points: commanded_points(samples, j, order),
        };
        let label = if order == 0 { "measured" } else { "measured, by cubic fit" };
        let points = measured_points(samples, measured, order);
        order += 1;
        let measured = Curve { label: label.to_owned(), colour: MEASURED, width_px: 1, opacity: 1.0, points };
        if measured.points.is_empty() { vec![commanded] } else { vec![commanded, measured] }
    })
}

fn commanded_points(samples: &[Sample], j: usize, order: usize) -> Vec<Point> {
    let value = |s: &Sample| {
        let c = &s.commanded;
        let block = [&c.position_rad, &c.velocity_rad_s, &c.acceleration_rad_s2, &c.jerk_rad_s3];
        block.get(order).and_then(|b| b.get(j)).copied().unwrap_or(f64::NAN)
    };
    thinned(samples.iter().map(|s| (s.t_s, value(s))).collect())
}

/// The measured curve of a panel. Encoder counts leave nothing but noise of the third derivative: it is not drawn.
fn measured_points(samples: &[Sample], measured: &[[f64; 4]], order: usize) -> Vec<Point> {
    if order == JERK {
        return Vec::new();
    }
    let value = |m: &[f64; 4]| m.get(order).copied().unwrap_or(f64::NAN);
    thinned(samples.iter().zip(measured).map(|(s, m)| (s.t_s, value(m))).collect())
}

/// Position, velocity, acceleration and jerk of one joint at every sample, from its measured positions.
fn measured_derivatives(samples: &[Sample], joint: usize) -> Vec<[f64; 4]> {
    let at = |array: &JointArray| array.get(joint).copied().unwrap_or(f64::NAN);
    let points: Vec<Point> =
        samples.iter().map(|s| (s.t_s - at(&s.measured_age_s), at(&s.measured_rad))).collect();
    (0..points.len())
        .map(|i| {
            let first = i.saturating_sub(FIT_HALF_WIDTH);
            let last = (i + FIT_HALF_WIDTH + 1).min(points.len());
            let (t_s, q) = points.get(i).copied().unwrap_or((f64::NAN, f64::NAN));
            let fit = cubic_at(t_s, points.get(first..last).unwrap_or(&[]));
            // The position is what was measured; only its derivatives need the fit.
            fit.map_or([q, f64::NAN, f64::NAN, f64::NAN], |[_, v, a, j]| [q, v, a, j])
        })
        .collect()
}

/// Value and derivatives at `t_s` of the cubic that fits the points best; `None` when they do not determine one.
fn cubic_at(t_s: f64, points: &[Point]) -> Option<[f64; 4]> {
    // Times in units of the window keep the normal equations well conditioned.
    let scale_s = points.iter().map(|(t, _)| (t - t_s).abs()).fold(0.0, f64::max);
    if points.len() < 5 || scale_s <= 0.0 || !points.iter().all(|(t, q)| t.is_finite() && q.is_finite()) {
        return None;
    }
    let mut system = [[0.0; 5]; 4];
    for (t, q) in points {
        let x = (t - t_s) / scale_s;
        let powers = [1.0, x, x * x, x * x * x];
        for (row, p) in system.iter_mut().zip(powers) {
            for (cell, r) in row.iter_mut().zip(powers.iter().chain(std::iter::once(q))) {
                *cell += p * r;
            }
        }
    }
    let [c0, c1, c2, c3] = solve(system)?;
    Some([c0, c1 / scale_s, 2.0 * c2 / scale_s.powi(2), 6.0 * c3 / scale_s.powi(3)])
}

/// Four equations (coefficients, then the right side) by elimination with row exchange.
fn solve(mut m: [[f64; 5]; 4]) -> Option<[f64; 4]> {
    const SINGULAR: f64 = 1e-9;
    for c in 0..4 {
        let pivot = (c..4).max_by(|a, b| m[*a][c].abs().total_cmp(&m[*b][c].abs()))?;
        m.swap(c, pivot);
        if m[c][c].abs() < SINGULAR {
            return None;
        }
        let pivot = m[c];
        for row in m.iter_mut().skip(c + 1) {
            let factor = row[c] / pivot[c];
            for (cell, p) in row.iter_mut().zip(pivot) {
                *cell -= factor * p;
            }
        }
    }
    let mut x = [0.0; 4];
    for r in (0..4).rev() {
        let known: f64 = (r + 1..4).map(|c| m[r][c] * x[c]).sum();
        x[r] = (m[r][4] - known) / m[r][r];
    }
    Some(x)
}

fn draw_on(
    root: &Area<'_>,
    (title, titles): (&str, [&str; 4]),
    panels: &[Vec<Curve>; 4],
    limits: &[Vec<LimitLine>; 4],
) -> Drawn {
    root.fill(&WHITE)?;
    let body = root.titled(title, ("sans-serif", 24).into_font())?;
    draw_panels((&body, titles), panels, limits)?;
    Ok(root.present()?)
}

fn draw(
    (file, title): (&Path, &str),
    titles: [&str; 4],
    panels: &[Vec<Curve>; 4],
    limits: &[Vec<LimitLine>; 4],
) -> Result<(), Failure> {
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, SIZE_PX).into_drawing_area();
    let drawn = draw_on(&root, (title, titles), panels, limits);
    drop(root);
    drawn.map_err(|e| undrawable(file, e.as_ref()))?;
    write_whole(file, &svg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_motion::MAX_JOINTS;

    fn recording(samples: usize, measured_rad: impl Fn(f64) -> f64) -> Vec<Sample> {
        let sample = |i: usize| {
            let t_s = 0.01 * i as f64;
            let (measured_rad, measured_age_s) = ([measured_rad(t_s); MAX_JOINTS], [0.0; MAX_JOINTS]);
            Sample { t_s, commanded: Setpoint::default(), measured_rad, measured_age_s }
        };
        (0..samples).map(sample).collect()
    }

    fn joints() -> Vec<RobotJoint> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
        taustream_arm::Robot::load(&file).unwrap().joints
    }

    /// Goal: what is drawn as measured derivative is the derivative. Method: a cubic is fitted exactly, at its ends too.
    #[test]
    fn measured_derivatives_of_a_cubic_are_exact() {
        let samples = recording(40, |t| 0.3 - 1.2 * t + 2.0 * t * t - 0.7 * t * t * t);
        for (s, [_, v, a, j]) in samples.iter().zip(measured_derivatives(&samples, 0)) {
            let t = s.t_s;
            assert!((v - (-1.2 + 4.0 * t - 2.1 * t * t)).abs() < 1e-9, "velocity at {t}: {v}");
            assert!((a - (4.0 - 4.2 * t)).abs() < 1e-6, "acceleration at {t}: {a}");
            assert!((j + 4.2).abs() < 1e-3, "jerk at {t}: {j}");
        }
    }

    #[test]
    fn measured_derivatives_of_what_was_not_measured_are_left_out() {
        let samples = recording(20, |t| if t < 0.1 { f64::NAN } else { t });
        let derivatives = measured_derivatives(&samples, 0);
        assert!(
            measured_points(&samples, &derivatives, 1)
                .iter()
                .all(|(t, v)| *t > 0.1 && (v - 1.0).abs() < 1e-9)
        );
        assert!(measured_derivatives(&samples[..3], 0).iter().all(|d| d[1].is_nan()));
    }

    #[test]
    fn plot_has_axes_words_and_curves_without_any_font_file() {
        let dir = std::env::temp_dir().join(format!("taustream-plot-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let samples = recording(5000, f64::sin);
        let joint = |name: &str| RobotJoint { name: name.to_owned(), ..joints()[0].clone() };
        let files = write_all(&dir, &[joint("pan/../x"), joint("lift")], &samples).unwrap();
        assert_eq!(files.len(), 3);
        assert!(files.iter().all(|f| f.parent() == Some(dir.as_path())), "{files:?}");
        for file in &files {
            let svg = std::fs::read_to_string(file).unwrap();
            for word in ["time (s)", "jerk (rad/s^3)", "limit", "<polyline", "</svg>"] {
                assert!(svg.contains(word), "{}: no {word}", file.display());
            }
            assert!(svg.len() < 1_000_000, "{} bytes", svg.len());
        }
        // A recording of nothing is drawn as empty axes, not as a failure.
        assert!(write_all(&dir, &[joint("pan")], &[]).is_ok());
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
