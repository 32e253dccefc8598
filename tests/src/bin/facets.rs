//! The geometry that mesh files become, for `tests/peers/meshes.py`, which compares it with an independent library.
//!
//! `facets SCENE.toml` prints each obstacle of triangles as `mesh NAME` and one line a triangle: its nine coordinates, in the
//! frame of the file and in metres. `facets ROBOT.toml` prints each link's part as `hull LINK ROUNDING` and one line a face.
use anyhow::{Context, Result};
use std::io::{BufWriter, Write, stdout};
use std::path::PathBuf;
use taustream_arm::{Robot, Scene, Shape};

fn main() -> Result<()> {
    let file =
        std::env::args_os().nth(1).map(PathBuf::from).context("usage: facets SCENE.toml | ROBOT.toml")?;
    let mut out = BufWriter::new(stdout().lock());
    let text = std::fs::read_to_string(&file)?;
    let shapes: Vec<(String, Shape)> = if text.contains("[[joint]]") {
        let robot = Robot::load(&file)?;
        let name = |link: usize| robot.links.get(link).cloned().unwrap_or_default();
        robot.shapes.iter().map(|shape| (name(shape.link), shape.shape.clone())).collect()
    } else {
        Scene::load(&file)?.obstacles.into_iter().map(|obstacle| (obstacle.name, obstacle.shape)).collect()
    };
    for (name, shape) in shapes {
        let (vertices_m, triangles) = match shape {
            Shape::Mesh { vertices_m, triangles } => {
                writeln!(out, "mesh {name}")?;
                (vertices_m, triangles)
            }
            Shape::Hull { vertices_m, triangles, rounding_m } => {
                writeln!(out, "hull {name} {rounding_m:e}")?;
                (vertices_m, triangles)
            }
            Shape::Sphere { .. }
            | Shape::Box { .. }
            | Shape::Cylinder { .. }
            | Shape::Capsule { .. }
            | Shape::Cloud(_) => {
                continue;
            }
        };
        for triangle in triangles {
            let corners = triangle.map(|corner| usize::try_from(corner).ok().and_then(|i| vertices_m.get(i)));
            let numbers = corners.iter().flatten().flat_map(|corner| corner.iter());
            let words: Vec<String> = numbers.map(|number| format!("{number:e}")).collect();
            writeln!(out, "{}", words.join(" "))?;
        }
    }
    Ok(())
}
