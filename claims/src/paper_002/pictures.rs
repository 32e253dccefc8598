//! The scenes with paths and virtual obstacles.
use super::Method;
use super::journeys::Visit;
use crate::chart::{Curve, FilledArea, Panel, Point, palette};
use crate::figure::Figure;
use std::f64::consts::TAU;
use taustream_optimizers::papers::planar::{Journey, Obstacle, PlanarShape};

/// Corners of a circle.
const CORNERS: u32 = 48;
/// Radius at which a virtual obstacle is drawn (cm).
const VIRTUAL_CM: f64 = 2.0;
/// Scenes of figure 8, and steps that it shows.
const TRAPS: [&str; 3] = ["l", "u", "wide-u"];
const STEPS_SHOWN: usize = 1_200;

/// A picture with a panel for each scene: the first run of each method.
pub(super) fn figures(visits: &[Visit]) -> Vec<Figure> {
    let panels: Vec<Panel> = visits.iter().map(panel).collect();
    let title = "Paper 002: first run of each way; purple: virtual obstacles of RBF";
    let distance: Vec<Panel> =
        visits.iter().filter(|v| TRAPS.contains(&v.scene.name)).map(distance).collect();
    let title_8 = "Paper 002, figure 8: distance to the goal, first run of each way";
    vec![
        Figure::of("002-scenes.svg", title, 2, &panels),
        Figure::of("002-distance.svg", title_8, 2, &distance),
    ]
}

/// How far a robot is from its goal after every step: virtual obstacles show as spikes.
fn distance(visit: &Visit) -> Panel {
    let mut panel = Panel::new(&format!("{}: steps", visit.scene.name), "distance to the goal (cm)");
    let goal = visit.scene.robots.first().map_or([0.0; 2], |[_, goal]| *goal);
    for (method, journeys) in Method::ALL.iter().zip(&visit.journeys) {
        let path = journeys.first().and_then(|j| j.paths_cm.first()).map_or(&[][..], Vec::as_slice);
        // A robot that is stuck stays where it is.
        let points = path.iter().take(STEPS_SHOWN).enumerate();
        let away = |(i, p): (usize, &[f64; 2])| (i as f64, (p[0] - goal[0]).hypot(p[1] - goal[1]));
        panel.line(method.name(), points.map(away).collect());
    }
    panel
}

fn panel(visit: &Visit) -> Panel {
    let mut panel = Panel::new(&format!("{}: x (cm)", visit.scene.name), "y (cm)");
    panel.is_map = true;
    for obstacle in &visit.scene.obstacles {
        outline(&mut panel, obstacle);
    }
    for [start, goal] in &visit.scene.robots {
        panel.ends((start[0], start[1]), (goal[0], goal[1]));
    }
    for (method, journeys) in Method::ALL.iter().zip(&visit.journeys) {
        if let Some(journey) = journeys.first() {
            paths(&mut panel, *method, journey);
        }
    }
    panel
}

fn outline(panel: &mut Panel, obstacle: &Obstacle) {
    match &obstacle.shape {
        PlanarShape::Disc { centre_cm, radius_cm } => {
            let points = circle(*centre_cm, *radius_cm);
            panel.filled_areas.push(FilledArea { points, colour: palette(7), opacity: 0.3 });
        }
        PlanarShape::Walls { corners_cm } => {
            let points = corners_cm.iter().map(|c| (c[0], c[1])).collect();
            panel.curves.push(curve(String::new(), 7, 3, points));
        }
    }
}

fn paths(panel: &mut Panel, method: Method, journey: &Journey) {
    let colour = Method::ALL.iter().position(|w| *w == method).unwrap_or(0);
    for (i, path) in journey.paths_cm.iter().enumerate() {
        let label = if i == 0 { method.name().to_owned() } else { String::new() };
        panel.curves.push(curve(label, colour, 1, path.iter().map(|p| (p[0], p[1])).collect()));
    }
    if method == Method::Robust {
        for made in &journey.virtuals {
            let points = circle(made.centre_cm, VIRTUAL_CM);
            panel.filled_areas.push(FilledArea { points, colour: palette(4), opacity: 0.8 });
        }
    }
}

fn curve(label: String, colour: usize, width_px: u32, points: Vec<Point>) -> Curve {
    Curve { label, colour: palette(colour), width_px, opacity: 1.0, points }
}

fn circle(centre: [f64; 2], radius: f64) -> Vec<Point> {
    let at = |i: u32| {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(CORNERS)).sin_cos();
        (centre[0] + radius * cos, centre[1] + radius * sin)
    };
    (0..CORNERS).map(at).collect()
}
