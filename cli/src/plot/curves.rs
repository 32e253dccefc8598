//! Motions of one joint over each other: position, velocity, acceleration and jerk beside their limits.
use super::panel::{draw_panels, motion_limits, titles, undrawable};
use crate::failure::Failure;
use plotters::prelude::{IntoDrawingArea, IntoFont, SVGBackend, WHITE};
use std::path::Path;
use taustream_arm::RobotJoint;
use taustream_claims::chart::{Area, Curve, Drawn, palette, thinned};
use taustream_motion::JointKind;

const SIZE_PX: (u32, u32) = (1200, 900);

/// A motion of one joint.
pub(crate) struct JointMotion {
    /// Stands in the legend.
    pub(crate) what: String,
    /// When it ends (s).
    pub(crate) duration_s: f64,
    /// Time (s), then position, velocity, acceleration and jerk (rad, rad/s, rad/s^2, rad/s^3).
    pub(crate) samples: Vec<(f64, [f64; 4])>,
}

/// Draws motions of one joint as SVG.
///
/// # Errors
/// When plotters cannot draw it.
pub(crate) fn svg(
    file: &Path,
    title: &str,
    motions: &[JointMotion],
    joint: &[RobotJoint],
) -> Result<String, Failure> {
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, SIZE_PX).into_drawing_area();
    let drawn = draw(&root, title, motions, joint);
    drop(root);
    drawn.map_err(|e| undrawable(file, e.as_ref()))?;
    Ok(svg)
}

fn draw(root: &Area<'_>, title: &str, motions: &[JointMotion], joint: &[RobotJoint]) -> Drawn {
    root.fill(&WHITE)?;
    let body = root.titled(title, ("sans-serif", 22).into_font())?;
    // A joint's whole range would flatten its motion; of several equal legends one is enough.
    let mut limits = motion_limits(joint);
    limits[0].clear();
    limits.iter_mut().flatten().for_each(|line| line.label.clear());
    let mut order = 0;
    let panels = [(); 4].map(|()| {
        let curve = |(i, motion): (usize, &JointMotion)| {
            let value = |values: &[f64; 4]| values.get(order).copied().unwrap_or(f64::NAN);
            let points = motion.samples.iter().map(|(t_s, values)| (*t_s, value(values)));
            let label = if order == 0 { motion.what.clone() } else { String::new() };
            let colour = palette(i);
            Curve { label, colour, width_px: 2, opacity: 1.0, points: thinned(points.collect()) }
        };
        let panel = motions.iter().enumerate().map(curve).collect();
        order += 1;
        panel
    });
    let kinds: Vec<JointKind> = joint.iter().map(|joint| joint.kind).collect();
    draw_panels((&body, titles(&kinds)), &panels, &limits)?;
    Ok(root.present()?)
}
