//! Curves over time, one panel a quantity.
use crate::failure::Failure;
use plotters::prelude::RGBColor;
use std::path::Path;
use taustream_claims::chart::{Area, COLOURS, Curve, Drawn, LimitLine, Panel, draw_panel};
use taustream_motion::MAX_JOINTS;

/// One colour a joint.
pub(super) const JOINT_COLOURS: [RGBColor; MAX_JOINTS] = COLOURS;
/// Title of each panel, and its quantity's order of derivation.
pub(super) const PANELS: [&str; 4] =
    ["position (rad)", "velocity (rad/s)", "acceleration (rad/s^2)", "jerk (rad/s^3)"];

/// Why a picture could not be made.
pub(super) fn undrawable(file: &Path, why: &dyn std::error::Error) -> Failure {
    Failure::Failed(format!("{} cannot be drawn: {why}", file.display()))
}

/// The four panels below each other.
pub(super) fn draw_panels(body: &Area<'_>, panels: &[Vec<Curve>; 4], limits: &[Vec<LimitLine>; 4]) -> Drawn {
    let areas = body.split_evenly((4, 1));
    for ((area, name), (curves, limits)) in areas.iter().zip(PANELS).zip(panels.iter().zip(limits)) {
        let (curves, limits) = (curves.clone(), limits.clone());
        draw_panel(area, &Panel { curves, limits, ..Panel::new("time (s)", name) })?;
    }
    Ok(())
}
