//! The arm among its obstacles, from above, from the front and from the side, all at one scale.
use super::outline::{View, clipped, outline, outlines};
use nalgebra::Point3;
use plotters::prelude::{ChartBuilder, Circle, Color, IntoFont, LineSeries, Polygon, RGBColor, Text};
use std::ops::Range;
use taustream_arm::{Robot, Scene};
use taustream_claims::chart::{Area, Drawn, Point, span, ticks};
use taustream_motion::{JointArray, Trajectory};

/// Poses of the arm from start to end; more run together.
const POSES: u32 = 9;
/// Points of the path of the tip.
const PATH_POINTS: u32 = 400;
/// Obstacles are shown whole up to this much of the arm's own extent beyond it, so that a floor does not make the arm a dot.
const AROUND: f64 = 1.0;
/// Room for the axes' words, px.
const LABELS_PX: (u32, u32) = (64, 42);
const MARGIN_PX: u32 = 12;
const TITLE_PX: u32 = 30;
/// Height of an obstacle's name.
const LABEL_PX: u32 = 12;
/// The arm at the start and at the end; poses between are between.
const FIRST: RGBColor = RGBColor(150, 200, 232);
const LAST: RGBColor = RGBColor(8, 48, 107);
const PATH: RGBColor = RGBColor(213, 94, 0);
const OBSTACLE: RGBColor = RGBColor(110, 110, 110);

/// What is drawn, in the base frame.
pub(super) struct Stage<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    poses_rad: Vec<JointArray>,
    /// One line a tip.
    tips_m: Vec<Vec<Point3<f64>>>,
}

/// One view's outlines.
struct Seen {
    view: View,
    /// One entry a pose, one outline a link.
    arm: Vec<Vec<Vec<Point>>>,
    /// Origins of the frames, one line a pose and tip.
    sticks: Vec<Vec<Point>>,
    obstacles: Vec<(String, Vec<Point>)>,
    /// One path a tip.
    tips: Vec<Vec<Point>>,
    x_m: Range<f64>,
    y_m: Range<f64>,
}

impl<'a> Stage<'a> {
    /// The arm along a trajectory.
    pub(super) fn of(robot: &'a Robot, scene: &'a Scene, trajectory: &Trajectory) -> Self {
        let at = |share: f64| trajectory.sample(share * trajectory.duration_s()).position_rad;
        let shares = |count: u32| (0..count).map(move |k| f64::from(k) / f64::from(count - 1));
        let tip = |frame: usize| {
            let point = |share| Point3::from(robot.chain.frame(frame, &at(share)).translation.vector);
            shares(PATH_POINTS).map(point).collect()
        };
        Self {
            robot,
            scene,
            poses_rad: shares(POSES).map(at).collect(),
            tips_m: robot.chain.tips().iter().map(|frame| tip(*frame)).collect(),
        }
    }

    /// Draws the three views beside each other.
    pub(super) fn draw(&self, area: &Area<'_>) -> Drawn {
        let areas = area.split_evenly((1, 3));
        let seen = View::ALL.map(|view| self.seen(view));
        let (width_px, height_px) = areas.first().map_or((1, 1), Area::dim_in_pixel);
        let across_px = width_px.saturating_sub(LABELS_PX.0 + 2 * MARGIN_PX).max(1);
        let up_px = height_px.saturating_sub(LABELS_PX.1 + 2 * MARGIN_PX + TITLE_PX).max(1);
        // One scale for all: metres look the same in every direction and every view.
        let need =
            |s: &Seen| f64::max(length(&s.x_m) / f64::from(across_px), length(&s.y_m) / f64::from(up_px));
        let m_per_px = seen.iter().map(need).fold(0.0, f64::max) * 1.04;
        for (area, seen) in areas.iter().zip(&seen) {
            let x_m = around(&seen.x_m, m_per_px * f64::from(across_px));
            let y_m = around(&seen.y_m, m_per_px * f64::from(up_px));
            draw_view(area, seen, x_m, y_m)?;
        }
        Ok(())
    }

    fn seen(&self, view: View) -> Seen {
        let mut arm = Vec::new();
        let mut sticks = Vec::new();
        for q in &self.poses_rad {
            let frames = self.robot.chain.frames(q);
            let link = |shape: &taustream_arm::LinkShape| {
                let frame = frames.get(shape.frame).copied().unwrap_or_default();
                outline(&shape.shape, &(frame * shape.pose), view)
            };
            arm.push(self.robot.shapes.iter().map(link).collect());
            let chain = &self.robot.chain;
            for tip in chain.tips() {
                let used = std::iter::once(0).chain(chain.movers(*tip).map(|joint| joint + 1));
                let origin = |frame: usize| frames.get(frame).copied().unwrap_or_default().translation.vector;
                sticks.push(used.map(|frame| view.of(&Point3::from(origin(frame)))).collect());
            }
        }
        let obstacle = |o: &taustream_arm::Obstacle| {
            let mut name = Some(o.name.clone());
            let named = |outline| (name.take().unwrap_or_default(), outline);
            outlines(&o.shape, &o.pose, view).into_iter().map(named).collect::<Vec<_>>()
        };
        let obstacles: Vec<(String, Vec<Point>)> = self.scene.obstacles.iter().flat_map(obstacle).collect();
        let seen = |tip_m: &Vec<Point3<f64>>| tip_m.iter().map(|p| view.of(p)).collect();
        let tips: Vec<Vec<Point>> = self.tips_m.iter().map(seen).collect();

        let own =
            || arm.iter().flatten().flatten().chain(sticks.iter().flatten()).chain(tips.iter().flatten());
        let others = || obstacles.iter().flat_map(|(_, o)| o);
        let x_m = reach(own().map(|p| p.0), others().map(|p| p.0));
        let y_m = reach(own().map(|p| p.1), others().map(|p| p.1));
        Seen { view, arm, sticks, obstacles, tips, x_m, y_m }
    }
}

fn length(range: &Range<f64>) -> f64 {
    range.end - range.start
}

/// A range of this length about the middle of another.
fn around(range: &Range<f64>, length_m: f64) -> Range<f64> {
    let middle = 0.5 * (range.start + range.end);
    middle - 0.5 * length_m..middle + 0.5 * length_m
}

/// The arm's own extent, and of the others' what is near it.
fn reach(own: impl Iterator<Item = f64>, others: impl Iterator<Item = f64>) -> Range<f64> {
    let own = span(own);
    let near_m = AROUND * length(&own);
    let (low, high) = (own.start - near_m, own.end + near_m);
    span(others.map(|v| v.clamp(low, high)).chain([own.start, own.end]))
}

fn draw_view(area: &Area<'_>, seen: &Seen, x_m: Range<f64>, y_m: Range<f64>) -> Drawn {
    let (title, right, up) = seen.view.words();
    let (low, high) = ((x_m.start, y_m.start), (x_m.end, y_m.end));
    let plain = ticks(&x_m, &y_m);
    let m_per_px = length(&x_m) / f64::from(area.dim_in_pixel().0.max(1));
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN_PX)
        .caption(title, ("sans-serif", 18))
        .x_label_area_size(LABELS_PX.1)
        .y_label_area_size(LABELS_PX.0)
        .build_cartesian_2d(x_m, y_m)?;
    chart
        .configure_mesh()
        .x_desc(right)
        .y_desc(up)
        .x_labels(7)
        .y_labels(7)
        .x_label_formatter(&plain)
        .y_label_formatter(&plain)
        .label_style(("sans-serif", 13))
        .light_line_style(RGBColor(248, 248, 248))
        .bold_line_style(RGBColor(232, 232, 232))
        .draw()?;

    for (_, obstacle) in &seen.obstacles {
        let shown = clipped(obstacle.clone(), low, high);
        chart.draw_series([Polygon::new(shown.clone(), OBSTACLE.mix(0.28))])?;
        chart.draw_series([closed(&shown, OBSTACLE, 1)])?;
    }
    let poses = seen.arm.len();
    let each = seen.sticks.len() / poses.max(1);
    for (index, (links, sticks)) in (0_u32..).zip(seen.arm.iter().zip(seen.sticks.chunks(each.max(1)))) {
        let colour = between(f64::from(index) / f64::from(POSES - 1));
        let is_end = index == 0 || usize::try_from(index).is_ok_and(|i| i + 1 == poses);
        let opacity = if is_end { 0.38 } else { 0.10 };
        chart.draw_series(links.iter().map(|link| Polygon::new(link.clone(), colour.mix(opacity))))?;
        if is_end {
            chart.draw_series(links.iter().map(|link| closed(link, colour, 1)))?;
        }
        for stick in sticks {
            chart.draw_series([open(stick, colour, if is_end { 2 } else { 1 })])?;
            chart.draw_series(
                stick.iter().map(|p| Circle::new(*p, if is_end { 3 } else { 1 }, colour.filled())),
            )?;
        }
    }
    for tip in &seen.tips {
        chart.draw_series(LineSeries::new(tip.iter().copied(), PATH.stroke_width(2)))?;
        let ends = tip.first().into_iter().chain(tip.last());
        chart.draw_series(ends.map(|p| Circle::new(*p, 4, PATH.filled())))?;
    }
    let font = ("sans-serif", LABEL_PX).into_font().color(&OBSTACLE);
    for (name, at) in labels(seen, (low, high), m_per_px) {
        chart.draw_series([Text::new(name.to_owned(), at, font.clone())])?;
    }
    Ok(())
}

/// Where the names of obstacles stand: on their obstacle, moved down until they hide no other name.
fn labels(seen: &Seen, (low, high): (Point, Point), m_per_px: f64) -> Vec<(&str, Point)> {
    let height_m = f64::from(LABEL_PX) * m_per_px;
    let mut placed: Vec<(&str, Point, f64)> = Vec::new();
    for (name, obstacle) in seen.obstacles.iter().filter(|(name, _)| !name.is_empty()) {
        let shown = clipped(obstacle.clone(), low, high);
        if shown.is_empty() {
            continue;
        }
        let (x, y) = (span(shown.iter().map(|p| p.0)), span(shown.iter().map(|p| p.1)));
        let letters: u32 = name.chars().map(|_| 1).sum();
        let width_m = 0.6 * height_m * f64::from(letters);
        let left = (x.start + 0.1 * length(&x)).min(high.0 - width_m).max(low.0);
        let mut at = (left, y.start + 0.5 * length(&y));
        let hides = |at: Point, placed: &[(&str, Point, f64)]| {
            placed.iter().any(|(_, other, wide_m)| {
                (at.1 - other.1).abs() < height_m && at.0 < other.0 + wide_m && other.0 < at.0 + width_m
            })
        };
        // Each step passes one name at least, so that as many steps as names suffice.
        for _ in 0..placed.len() {
            if hides(at, &placed) {
                at.1 -= 1.1 * height_m;
            }
        }
        placed.push((name, at, width_m));
    }
    placed.into_iter().map(|(name, at, _)| (name, at)).collect()
}

/// The colour of a pose on the way.
fn between(share: f64) -> RGBColor {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two colours")]
    let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
    RGBColor(mix(FIRST.0, LAST.0), mix(FIRST.1, LAST.1), mix(FIRST.2, LAST.2))
}

fn open(points: &[Point], colour: RGBColor, width_px: u32) -> plotters::element::PathElement<Point> {
    plotters::element::PathElement::new(points.to_vec(), colour.stroke_width(width_px))
}

fn closed(points: &[Point], colour: RGBColor, width_px: u32) -> plotters::element::PathElement<Point> {
    let ring: Vec<Point> = points.iter().chain(points.first()).copied().collect();
    plotters::element::PathElement::new(ring, colour.stroke_width(width_px))
}
