//! One panel of curves. Text stays text: no font file is needed to draw, the viewer's sans-serif is used.
use crate::number;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{
    Cartesian2d, ChartBuilder, ChartContext, Circle, Color, DashedLineSeries, DrawingArea, LineSeries,
    PathElement, Polygon, RGBColor, SVGBackend, SeriesLabelPosition, ShapeStyle, WHITE,
};
use std::ops::Range;

/// Most points of one curve; more cannot be seen and make the file heavy.
const POINTS_MAX: usize = 1200;
/// Width of a letter of the legend, of what stands before its labels, and of the axes beside the curves (px).
const LETTER_PX: f64 = 7.2;
const LEGEND_PX: f64 = 40.0;
const AXES_PX: f64 = 104.0;
/// Most of the curves' width that the legend may take, in shares of it.
const LEGEND_SHARE_MAX: f64 = 1.5;
/// Size of a mark (px).
const MARK_PX: i32 = 5;
/// Least value that a logarithmic axis shows: what is below is rounding.
const LOG_LEAST: f64 = 1e-16;
/// Colours distinguished by colour-blind eyes too (Okabe and Ito), and four more for panels of many curves.
pub const COLOURS: [RGBColor; 12] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(150, 150, 0),
    RGBColor(0, 0, 0),
    RGBColor(120, 60, 20),
    RGBColor(110, 80, 200),
    RGBColor(140, 140, 140),
    RGBColor(200, 30, 60),
];

/// The colour of curve number `i`; they repeat after twelve.
#[must_use]
pub fn palette(i: usize) -> RGBColor {
    COLOURS.iter().copied().cycle().nth(i % COLOURS.len()).unwrap_or(RGBColor(0, 0, 0))
}

/// What is drawn on.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A point of a panel.
pub type Point = (f64, f64);
/// plotters' errors have a type for every backend; they are not distinguished.
pub type Drawn = Result<(), Box<dyn std::error::Error>>;

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Stands in the legend; empty does not.
    pub label: String,
    /// Its colour.
    pub colour: RGBColor,
    /// Its width.
    pub width_px: u32,
    /// From 0 to 1.
    pub opacity: f64,
    /// Its points.
    pub points: Vec<Point>,
}

/// A value that curves must keep to, drawn across the panel.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitLine {
    /// The value.
    pub value: f64,
    /// Its colour.
    pub colour: RGBColor,
    /// Stands in the legend; empty does not.
    pub label: String,
}

/// A filled outline: a spread, an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct FilledArea {
    /// Its corners.
    pub points: Vec<Point>,
    /// Its colour.
    pub colour: RGBColor,
    /// From 0 to 1.
    pub opacity: f64,
}

/// A place that is more than a point of a curve: a start, a goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where.
    pub at: Point,
    /// Stands in the legend; empty does not.
    pub label: String,
    /// A filled mark; a ring otherwise.
    pub is_filled: bool,
}

/// Curves over one pair of axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Name of the horizontal axis.
    pub x: String,
    /// Name of the vertical axis.
    pub y: String,
    /// The vertical axis is logarithmic.
    pub is_log: bool,
    /// A length is the same in both directions, as on a map.
    pub is_map: bool,
    /// Curves.
    pub curves: Vec<Curve>,
    /// Limits.
    pub limits: Vec<LimitLine>,
    /// Filled outlines, below the curves.
    pub filled_areas: Vec<FilledArea>,
    /// Marks, above the curves.
    pub marks: Vec<Mark>,
}

impl Panel {
    /// An empty panel.
    #[must_use]
    pub fn new(x: &str, y: &str) -> Self {
        Self { x: x.to_owned(), y: y.to_owned(), ..Self::default() }
    }

    /// Adds a curve in the next colour.
    pub fn line(&mut self, label: &str, points: Vec<Point>) {
        let colour = palette(self.curves.len());
        self.curves.push(Curve { label: label.to_owned(), colour, width_px: 2, opacity: 1.0, points });
    }

    /// Marks where a way begins and where it is to end; in the legend once a panel.
    pub fn ends(&mut self, start: Point, goal: Point) {
        for (at, label, is_filled) in [(start, "start", false), (goal, "goal", true)] {
            let is_known = self.marks.iter().any(|mark| mark.label == label);
            let label = if is_known { String::new() } else { label.to_owned() };
            self.marks.push(Mark { at, label, is_filled });
        }
    }

    /// How much wider than the curves the panel is, for its legend.
    fn legend_share(&self, area: &Area<'_>) -> f64 {
        let labels = self.curves.iter().map(|c| &c.label).chain(self.limits.iter().map(|l| &l.label));
        let longest =
            labels.chain(self.marks.iter().map(|m| &m.label)).map(|l| l.chars().count()).max().unwrap_or(0);
        if longest == 0 {
            return 0.0;
        }
        let legend_px = LEGEND_PX + LETTER_PX * longest as f64;
        let curves_px = f64::from(area.dim_in_pixel().0) - AXES_PX - legend_px;
        (legend_px / curves_px.max(1.0)).min(LEGEND_SHARE_MAX)
    }

    /// The same panel with its values as the vertical axis has them.
    fn scaled(&self) -> Self {
        let mut scaled = self.clone();
        if self.is_log {
            let curves = scaled.curves.iter_mut().flat_map(|c| c.points.iter_mut());
            for (_, y) in curves.chain(scaled.filled_areas.iter_mut().flat_map(|f| f.points.iter_mut())) {
                *y = y.max(LOG_LEAST).log10();
            }
            for limit in &mut scaled.limits {
                limit.value = limit.value.max(LOG_LEAST).log10();
            }
        }
        scaled
    }
}

/// Draws a panel with its legend on the right.
///
/// # Errors
/// When plotters cannot draw it.
pub fn draw_panel(area: &Area<'_>, panel: &Panel) -> Drawn {
    let scaled = panel.scaled();
    let Panel { curves, limits, filled_areas, is_log, .. } = &scaled;
    let (across, values) = ranges(area, &scaled);
    let legend = scaled.legend_share(area);
    let ends = [across.start, across.end - (across.end - across.start) * legend / (1.0 + legend)];
    let plain = ticks(&across, &values);
    let power = |exponent: &f64| format!("{:.1e}", 10_f64.powf(*exponent));
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(16)
        .x_label_area_size(34)
        .y_label_area_size(74)
        .build_cartesian_2d(across, values)?;
    chart
        .configure_mesh()
        .x_desc(&panel.x)
        .y_desc(&panel.y)
        .x_labels(12)
        .y_labels(6)
        .x_label_formatter(&plain)
        .y_label_formatter(if *is_log { &power } else { &plain })
        .label_style(("sans-serif", 14))
        .light_line_style(RGBColor(245, 245, 245))
        .draw()?;
    for limit in limits {
        let style = limit.colour.mix(0.8).stroke_width(1);
        let points = ends.map(|x| (x, limit.value));
        let series = chart.draw_series(DashedLineSeries::new(points, 7, 5, style))?;
        if !limit.label.is_empty() {
            series
                .label(limit.label.clone())
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 6, y)], style));
        }
    }
    chart
        .draw_series(filled_areas.iter().map(|f| Polygon::new(f.points.clone(), f.colour.mix(f.opacity))))?;
    for curve in curves {
        let style: ShapeStyle = curve.colour.mix(curve.opacity).stroke_width(curve.width_px);
        let series = chart.draw_series(LineSeries::new(curve.points.iter().copied(), style))?;
        if !curve.label.is_empty() {
            series
                .label(curve.label.clone())
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style.stroke_width(2)));
        }
    }
    marks(&mut chart, &scaled.marks)?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .label_font(("sans-serif", 13))
        .draw()?;
    Ok(())
}

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Rings and dots above the curves.
fn marks(chart: &mut Chart<'_, '_>, marks: &[Mark]) -> Drawn {
    let black = COLOURS[7];
    for mark in marks {
        let style = if mark.is_filled { black.filled() } else { black.stroke_width(2) };
        let series = chart.draw_series([Circle::new(mark.at, MARK_PX, style)])?;
        if !mark.label.is_empty() {
            series.label(mark.label.clone()).legend(move |(x, y)| Circle::new((x + 9, y), MARK_PX, style));
        }
    }
    Ok(())
}

/// Words of the ticks of two axes. Ticks are sums of steps: one that should be zero is what their rounding leaves, and
/// would read "-0.0".
pub fn ticks(across: &Range<f64>, values: &Range<f64>) -> impl Fn(&f64) -> String + use<> {
    let rounding = 1e-9 * (across.end - across.start).min(values.end - values.start);
    move |at| number::figures(if at.abs() < rounding { 0.0 } else { *at })
}

/// The axes: all points and limits, with a little room above and below.
fn ranges(area: &Area<'_>, panel: &Panel) -> (Range<f64>, Range<f64>) {
    let outlines = || panel.filled_areas.iter().flat_map(|f| &f.points);
    let marks = || panel.marks.iter().map(|mark| &mark.at);
    let points = || panel.curves.iter().flat_map(|c| &c.points).chain(outlines()).chain(marks());
    let mut across = span(points().map(|p| p.0));
    if panel.is_map {
        // What touches the frame looks cut off.
        let side = 0.05 * (across.end - across.start);
        across = across.start - side..across.end + side;
    }
    let values = span(points().map(|p| p.1).chain(panel.limits.iter().map(|l| l.value)));
    let room = 0.06 * (values.end - values.start);
    let mut values = values.start - room..values.end + room;
    // The legend stands right of the curves, where it hides none.
    let mut across = across.start..across.end + panel.legend_share(area) * (across.end - across.start);
    if panel.is_map {
        let (width_px, height_px) = area.dim_in_pixel();
        let [wide, high] = [width_px, height_px].map(f64::from);
        let scale = ((across.end - across.start) / wide).max((values.end - values.start) / high);
        across.end = across.start + scale * wide;
        values.end = values.start + scale * high;
    }
    (across, values)
}

/// Least and largest value; never empty, so that an axis can be drawn.
#[must_use]
pub fn span(values: impl Iterator<Item = f64>) -> Range<f64> {
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
#[must_use]
pub fn thinned(points: Vec<Point>) -> Vec<Point> {
    let points: Vec<Point> = points.into_iter().filter(|(t, y)| t.is_finite() && y.is_finite()).collect();
    let step = points.len().div_ceil(POINTS_MAX).max(1);
    let last = points.last().copied();
    let mut kept: Vec<Point> = points.into_iter().step_by(step).collect();
    if kept.last().copied() != last {
        kept.extend(last);
    }
    kept
}
