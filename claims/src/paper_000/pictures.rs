//! Paths of the tip among the spheres, seen from above and from the side, and a motion's joints over time.
use crate::chart::{FilledArea, Panel, Point, palette};
use std::f64::consts::TAU;
use taustream_arm::scene::Shape;
use taustream_arm::{Robot, Scene};
use taustream_motion::JointArray;

/// Corners of a circle, and points of a segment of a path.
const CORNERS: u32 = 48;
const POINTS: u32 = 40;

/// From above and from the side: the paths of way points, and the spheres.
pub(super) fn views(robot: &Robot, scene: &Scene, paths: &[(&str, Vec<JointArray>)]) -> Vec<Panel> {
    let axes = [("x (m)", "y (m)", [0, 1]), ("x (m)", "z (m)", [0, 2])];
    let view = |(x, y, [i, j]): (&str, &str, [usize; 2])| {
        let mut panel = Panel::new(x, y);
        panel.is_map = true;
        for obstacle in &scene.obstacles {
            if let Shape::Sphere { radius_m } = obstacle.shape {
                let centre = obstacle.pose.translation.vector;
                let points = circle([centre[i], centre[j]], radius_m);
                panel.filled_areas.push(FilledArea { points, colour: palette(7), opacity: 0.3 });
            }
        }
        for (name, corners) in paths {
            let tip = tip_path(robot, corners);
            if let [first, .., last] = tip.as_slice() {
                panel.ends((first[i], first[j]), (last[i], last[j]));
            }
            panel.line(name, tip.into_iter().map(|p| (p[i], p[j])).collect());
        }
        panel
    };
    axes.map(view).to_vec()
}

fn tip_path(robot: &Robot, corners: &[JointArray]) -> Vec<[f64; 3]> {
    let place = |q: &JointArray| -> [f64; 3] {
        let frames = robot.chain.frames(q);
        frames.get(robot.chain.tip_frame()).map_or([f64::NAN; 3], |f| f.translation.vector.into())
    };
    let segment = |pair: &[JointArray]| -> Vec<[f64; 3]> {
        let [from, to] = pair else { return Vec::new() };
        let at = |i: u32| {
            let share = f64::from(i) / f64::from(POINTS);
            place(&std::array::from_fn(|j| from[j] + share * (to[j] - from[j])))
        };
        (0..=POINTS).map(at).collect()
    };
    corners.windows(2).flat_map(segment).collect()
}

fn circle(centre: [f64; 2], radius: f64) -> Vec<Point> {
    let at = |i: u32| {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(CORNERS)).sin_cos();
        (centre[0] + radius * cos, centre[1] + radius * sin)
    };
    (0..CORNERS).map(at).collect()
}
