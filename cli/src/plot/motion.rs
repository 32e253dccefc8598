//! A trajectory: position, velocity, acceleration and jerk of every joint, beside its limits where the robot is known,
//! and the arm in three views.
use super::panel::{JOINT_COLOURS, draw_panels, motion_limits, titles, undrawable};
use super::views::Stage;
use crate::failure::Failure;
use plotters::prelude::{IntoDrawingArea, IntoFont, RGBColor, SVGBackend, WHITE};
use std::path::Path;
use taustream_arm::text::counted;
use taustream_arm::{Robot, Scene, TrajectoryFile};
use taustream_claims::chart::{Area, Curve, Drawn, thinned};
use taustream_motion::trajectory::Cursor;

/// Samples of each curve.
const SAMPLES: u32 = 900;
const WIDTH_PX: u32 = 1500;
const VIEWS_PX: u32 = 520;
const CURVES_PX: u32 = 920;
const TITLE_PX: u32 = 44;

/// Draws the trajectory of a file as SVG; with a robot, its limits and the arm too.
pub(crate) fn svg(
    path: &Path,
    file: &TrajectoryFile,
    arm: Option<(&Robot, &Scene)>,
) -> Result<String, Failure> {
    let height_px = TITLE_PX + CURVES_PX + if arm.is_some() { VIEWS_PX } else { 0 };
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, (WIDTH_PX, height_px)).into_drawing_area();
    let drawn = draw(&root, path, file, arm);
    drop(root);
    drawn.map_err(|e| undrawable(path, e.as_ref()))?;
    Ok(svg)
}

fn draw(root: &Area<'_>, path: &Path, file: &TrajectoryFile, arm: Option<(&Robot, &Scene)>) -> Drawn {
    root.fill(&WHITE)?;
    let trajectory = &file.trajectory;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let views = if arm.is_some() {
        "; the arm from light (start) to dark (end), its tip's path in orange"
    } else {
        ""
    };
    let title = format!(
        "{name}: {}, {:.3} s, {}{views}",
        file.robot,
        trajectory.duration_s(),
        counted(trajectory.strokes().len(), "stroke")
    );
    let body = root.titled(&title, ("sans-serif", 22).into_font())?;
    let curves_area = match arm {
        None => body,
        Some((robot, scene)) => {
            let (views, curves) = body.split_vertically(VIEWS_PX);
            Stage::of(robot, scene, trajectory).draw(&views)?;
            curves
        }
    };
    let robot = arm.map(|(robot, _)| robot);
    let joints = robot.map_or(&[][..], |robot| &robot.joints);
    draw_panels((&curves_area, titles(&file.kinds)), &curves(file, robot), &motion_limits(joints))?;
    Ok(root.present()?)
}

fn curves(file: &TrajectoryFile, robot: Option<&Robot>) -> [Vec<Curve>; 4] {
    let trajectory = &file.trajectory;
    let mut cursor = Cursor::at_start(trajectory);
    let times = (0..=SAMPLES).map(|k| trajectory.duration_s() * f64::from(k) / f64::from(SAMPLES));
    let samples: Vec<_> = times.map(|t_s| (t_s, cursor.sample(trajectory, t_s))).collect();
    let mut order = 0;
    [(); 4].map(|()| {
        let curve = |(j, colour): (usize, RGBColor)| {
            let points = samples.iter().map(|(t_s, s)| {
                let blocks = [&s.position_rad, &s.velocity_rad_s, &s.acceleration_rad_s2, &s.jerk_rad_s3];
                let value = blocks.get(order).and_then(|b| b.get(j)).copied().unwrap_or(f64::NAN);
                (*t_s, value)
            });
            let name = robot.and_then(|r| r.joints.get(j)).map(|joint| joint.name.clone());
            Curve {
                label: name.unwrap_or_else(|| format!("joint {}", j + 1)),
                colour,
                width_px: 2,
                opacity: 1.0,
                points: thinned(points.collect()),
            }
        };
        let panel = (0..trajectory.joints()).zip(JOINT_COLOURS).map(curve).collect();
        order += 1;
        panel
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;
    use taustream_motion::{MAX_JOINTS, Stroke, Trajectory};

    fn shipped() -> (Robot, Scene) {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
        let robot = Robot::load(&config.join("robots/ur5.toml")).unwrap();
        (robot, Scene::load(&config.join("scenes/pillars.toml")).unwrap())
    }

    fn file(strokes: &[Stroke]) -> TrajectoryFile {
        let mut base_rad = [0.0; MAX_JOINTS];
        (base_rad[1], base_rad[2]) = (-1.57, 1.57);
        TrajectoryFile {
            robot: "ur5".into(),
            digest: None,
            kinds: Default::default(),
            trajectory: Trajectory::new(6, base_rad, strokes).unwrap(),
        }
    }

    fn stroke() -> Stroke {
        let mut delta_rad = [0.0; MAX_JOINTS];
        delta_rad[0] = 1.0;
        Stroke { start_s: 0.0, duration_s: 4.0, n: 10, delta_rad }
    }

    #[test]
    fn picture_with_a_robot_has_views_limits_and_obstacles_and_without_only_curves() {
        let (robot, scene) = shipped();
        let whole = svg(Path::new("move.json"), &file(&[stroke()]), Some((&robot, &scene))).unwrap();
        for word in [
            "top",
            "front",
            "side",
            "shoulder_pan",
            "limit of all joints",
            "jerk (rad/s^3)",
            "x (m)",
            "z (m)",
            "<polygon",
        ] {
            assert!(whole.contains(word), "no `{word}`");
        }
        for obstacle in &scene.obstacles {
            assert!(whole.contains(&obstacle.name), "no `{}`", obstacle.name);
        }
        let curves = svg(Path::new("move.json"), &file(&[stroke()]), None).unwrap();
        assert!(curves.contains("joint 6") && !curves.contains("<polygon"));
        assert!(whole.len() < 2_000_000, "{} bytes", whole.len());
    }

    #[test]
    fn arm_that_never_moves_in_an_empty_world_is_drawn() {
        let (robot, _) = shipped();
        let empty = Scene { file: PathBuf::new(), ..Scene::default() };
        assert!(svg(Path::new("rest.json"), &file(&[]), Some((&robot, &empty))).unwrap().contains("</svg>"));
    }
}
