//! Curves over time, one panel a quantity.
use crate::failure::Failure;
use plotters::coord::Shift;
use plotters::prelude::{
    ChartBuilder, Color, DashedLineSeries, DrawingArea, LineSeries, PathElement, RGBColor, SVGBackend,
    SeriesLabelPosition, ShapeStyle, WHITE,
};
use std::ops::Range;
use std::path::Path;
use taustream_motion::MAX_JOINTS;

/// Most points of one curve; more cannot be seen and make the file heavy.
const POINTS_MAX: usize = 1200;
/// Share of the time axis that is left to the legend.
const LEGEND_SHARE: f64 = 0.16;
/// One colour a joint, told apart by colour-blind eyes too (Okabe and Ito).
pub(super) const JOINT_COLOURS: [RGBColor; MAX_JOINTS] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(150, 150, 0),
    RGBColor(0, 0, 0),
];
/// Title of each panel, and its quantity's order of derivation.
pub(super) const PANELS: [&str; 4] =
    ["position (rad)", "velocity (rad/s)", "acceleration (rad/s^2)", "jerk (rad/s^3)"];

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Point = (f64, f64);
/// plotters' errors have a type for every backend; nobody tells them apart.
pub(super) type Drawn = Result<(), Box<dyn std::error::Error>>;

/// A curve of one panel.
pub(super) struct Curve {
    pub(super) label: String,
    pub(super) colour: RGBColor,
    pub(super) width_px: u32,
    pub(super) opacity: f64,
    pub(super) points: Vec<Point>,
}

/// A value that curves must keep to, drawn across the panel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LimitLine {
    pub(super) value: f64,
    pub(super) colour: RGBColor,
    /// Stands in the legend; empty does not.
    pub(super) label: String,
}

/// Why a picture could not be made.
pub(super) fn undrawable(file: &Path, why: &dyn std::error::Error) -> Failure {
    Failure::Failed(format!("{} cannot be drawn: {why}", file.display()))
}

/// The four panels below each other.
pub(super) fn draw_panels(body: &Area<'_>, panels: &[Vec<Curve>; 4], limits: &[Vec<LimitLine>; 4]) -> Drawn {
    let areas = body.split_evenly((4, 1));
    for ((area, name), (curves, limits)) in areas.iter().zip(PANELS).zip(panels.iter().zip(limits)) {
        draw_panel(area, name, curves, limits)?;
    }
    Ok(())
}

fn draw_panel(area: &Area<'_>, name: &str, curves: &[Curve], limits: &[LimitLine]) -> Drawn {
    let (times, values) = ranges(curves, limits);
    let ends = [times.start, times.end - (times.end - times.start) * LEGEND_SHARE / (1.0 + LEGEND_SHARE)];
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(16)
        .x_label_area_size(34)
        .y_label_area_size(74)
        .build_cartesian_2d(times, values)?;
    chart
        .configure_mesh()
        .x_desc("time (s)")
        .y_desc(name)
        .x_labels(12)
        .y_labels(6)
        .label_style(("sans-serif", 14))
        .light_line_style(RGBColor(245, 245, 245))
        .draw()?;
    for limit in limits {
        let style = limit.colour.mix(0.8).stroke_width(1);
        let points = ends.map(|t| (t, limit.value));
        let series = chart.draw_series(DashedLineSeries::new(points, 7, 5, style))?;
        if !limit.label.is_empty() {
            series
                .label(limit.label.clone())
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 6, y)], style));
        }
    }
    for curve in curves {
        let style: ShapeStyle = curve.colour.mix(curve.opacity).stroke_width(curve.width_px);
        let series = chart.draw_series(LineSeries::new(curve.points.iter().copied(), style))?;
        if !curve.label.is_empty() {
            series
                .label(curve.label.clone())
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style.stroke_width(2)));
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .label_font(("sans-serif", 13))
        .draw()?;
    Ok(())
}

/// The axes: all points and limits, with a little room above and below.
fn ranges(curves: &[Curve], limits: &[LimitLine]) -> (Range<f64>, Range<f64>) {
    let points = || curves.iter().flat_map(|c| &c.points);
    let times = span(points().map(|p| p.0));
    let values = span(points().map(|p| p.1).chain(limits.iter().map(|l| l.value)));
    let room = 0.06 * (values.end - values.start);
    // The legend stands right of the curves, where it hides none.
    let times = times.start..times.end + LEGEND_SHARE * (times.end - times.start);
    (times, values.start - room..values.end + room)
}

/// Least and largest value; never empty, so that an axis can be drawn.
pub(super) fn span(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low < high {
        low..high
    } else if low.is_finite() {
        low - 0.5..low + 0.5
    } else {
        0.0..1.0
    }
}

/// Finite points, evenly thinned; the last one stays.
pub(super) fn thinned(points: Vec<Point>) -> Vec<Point> {
    let points: Vec<Point> = points.into_iter().filter(|(t, y)| t.is_finite() && y.is_finite()).collect();
    let step = points.len().div_ceil(POINTS_MAX).max(1);
    let last = points.last().copied();
    let mut kept: Vec<Point> = points.into_iter().step_by(step).collect();
    if kept.last().copied() != last {
        kept.extend(last);
    }
    kept
}
