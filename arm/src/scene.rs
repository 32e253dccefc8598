//! A scene: obstacles around the arm.
use crate::Faults;
use crate::cloud::Cloud;
use crate::document::{self, Node};
use crate::mesh;
use crate::reader::{Bounds, FaultList, Table};
use crate::zone::{ZONES_MAX, Zone, read_zone};
use nalgebra::{Point3, Translation3, UnitQuaternion};
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use taustream_motion::chain::Pose;

/// A collision shape in its own frame; axes of cylinders and capsules are local z, centred.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Radius.
        radius_m: f64,
    },
    /// A box.
    Box {
        /// Full edge lengths.
        size_m: [f64; 3],
    },
    /// A cylinder.
    Cylinder {
        /// Radius.
        radius_m: f64,
        /// Full length.
        length_m: f64,
    },
    /// A cylinder with half balls at its ends.
    Capsule {
        /// Radius.
        radius_m: f64,
        /// Length between the centres of the balls.
        length_m: f64,
    },
    /// Triangles, already scaled.
    Mesh {
        /// Corners.
        vertices_m: Vec<Point3<f64>>,
        /// Corner indices of each triangle.
        triangles: Vec<[u32; 3]>,
    },
    /// A solid convex body: all points within `rounding_m` of the polyhedron.
    Hull {
        /// Corners of the polyhedron.
        vertices_m: Vec<Point3<f64>>,
        /// Its faces, counter-clockwise from outside.
        triangles: Vec<[u32; 3]>,
        /// How far the body goes beyond the polyhedron: what its few corners leave out of the mesh it was made of.
        rounding_m: f64,
    },
    /// Points with a ball around each, shared by whoever holds the shape.
    Cloud(Arc<Cloud>),
}

/// One obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Its name, for messages.
    pub name: String,
    /// Pose in the base frame.
    pub pose: Pose,
    /// Its shape.
    pub shape: Shape,
}

/// A checked scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The file that it was read from.
    pub file: PathBuf,
    /// Least distance that plans keep from every obstacle.
    pub margin_m: f64,
    /// The obstacles.
    pub obstacles: Vec<Obstacle>,
    /// Where tips have speed limits.
    pub zones: Vec<Zone>,
}

/// Least distance that plans keep where the file gives none.
pub const MARGIN_M_DEFAULT: f64 = 0.02;

/// Most obstacles in a scene.
pub const OBSTACLES_MAX: usize = 1000;

const MARGIN_M: Bounds = Bounds::within(0.0, 1.0, "m");
pub(crate) const CENTER_M: Bounds = Bounds::within(-100.0, 100.0, "m");
pub(crate) const SIZE_M: Bounds = Bounds::above(0.0, 100.0, "m");
pub(crate) const RPY_RAD: Bounds = Bounds::within(-TAU, TAU, "rad");
const POINT_RADIUS_M: Bounds = Bounds::within(1e-4, 1.0, "m");
const SCALE: Bounds = Bounds::above(0.0, 1e4, "");

impl Scene {
    /// Reads and checks a scene file (TOML); mesh files are read too.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn load(file: &Path) -> Result<Self, Faults> {
        Self::from_toml(file, &document::read_text(file, "a scene file in TOML")?)
    }
    /// Checks the text of a scene file; mesh files are looked up beside `file`, and faults name it.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn from_toml(file: &Path, text: &str) -> Result<Self, Faults> {
        let fault_list = FaultList::new(file);
        let scene = Self::read(&fault_list, document::parse_toml(file, text)?);
        fault_list.close(scene)
    }
    fn read(fault_list: &FaultList, node: Node) -> Option<Self> {
        let mut top = Table::top(fault_list, node)?;
        let margin_m = top.number_or("margin_m", MARGIN_M_DEFAULT, &MARGIN_M);
        let mut obstacles = Vec::new();
        let mut complete = true;
        for kind in ["sphere", "box", "cylinder", "capsule", "mesh", "cloud"] {
            for (i, table) in top.tables(kind).into_iter().enumerate() {
                let obstacle = read_obstacle(table, kind, format!("{kind}[{i}]"));
                complete &= obstacle.is_some();
                obstacles.extend(obstacle.map(|obstacle| (format!("{kind}[{i}].name"), obstacle)));
            }
        }
        let mut zones = Vec::new();
        for (i, table) in top.tables("zone").into_iter().enumerate() {
            let zone = read_zone(table, format!("zone[{i}]"));
            complete &= zone.is_some();
            zones.extend(zone);
        }
        top.done();
        if zones.len() > ZONES_MAX {
            let value = format!("{} zones", zones.len());
            fault_list.add(None, "zone", &value, &format!("at most {ZONES_MAX}"));
        }
        if obstacles.len() > OBSTACLES_MAX {
            let value = format!("{} obstacles", obstacles.len());
            fault_list.add(None, "", &value, &format!("at most {OBSTACLES_MAX}"));
        }
        check_names(fault_list, &obstacles);
        let obstacles = obstacles.into_iter().map(|(_, obstacle)| obstacle).collect();
        complete.then_some(Self { file: fault_list.file().to_owned(), margin_m: margin_m?, obstacles, zones })
    }
}

fn read_obstacle(mut table: Table<'_>, kind: &str, default_name: String) -> Option<Obstacle> {
    let name = table.name_or("name", default_name);
    let center_m = table.numbers::<3>("center_m", &CENTER_M);
    // A ball has no direction; every other shape may be turned.
    let rpy_rad =
        if kind == "sphere" { Some([0.0; 3]) } else { table.numbers_or("rpy_rad", [0.0; 3], &RPY_RAD) };
    let shape = read_shape(&mut table, kind);
    table.done();
    Some(Obstacle { name: name?, pose: pose(center_m?, rpy_rad?), shape: shape? })
}

fn read_shape(table: &mut Table<'_>, kind: &str) -> Option<Shape> {
    match kind {
        "sphere" => Some(Shape::Sphere { radius_m: table.number("radius_m", &SIZE_M)? }),
        "box" => Some(Shape::Box { size_m: table.numbers("size_m", &SIZE_M)? }),
        "mesh" => read_mesh(table),
        "cloud" => read_cloud(table),
        _ => {
            let (radius_m, length_m) = (table.number("radius_m", &SIZE_M), table.number("length_m", &SIZE_M));
            let (radius_m, length_m) = (radius_m?, length_m?);
            Some(match kind {
                "cylinder" => Shape::Cylinder { radius_m, length_m },
                _ => Shape::Capsule { radius_m, length_m },
            })
        }
    }
}

fn read_mesh(table: &mut Table<'_>) -> Option<Shape> {
    let file = table.text("file", "the path of an .stl, .obj or .dae file, relative to this file");
    let is_stated = table.has("scale");
    let scale = table.number_or("scale", 1.0, &SCALE);
    let (file, factor) = (file?, scale?);
    let path = document::beside(table.fault_list().file(), &file);
    match mesh::load(&path, mesh::Scale { factor, is_stated }) {
        Ok(mesh) => Some(Shape::Mesh { vertices_m: mesh.vertices_m, triangles: mesh.triangles }),
        Err((value, expected)) => {
            table.fault("file", &value, &expected);
            None
        }
    }
}

fn read_cloud(table: &mut Table<'_>) -> Option<Shape> {
    let file = table.text("file", "the path of a .ply, .pcd or .xyz file, relative to this file");
    let radius_m = table.number("point_radius_m", &POINT_RADIUS_M);
    let scale = table.number_or("scale", 1.0, &SCALE);
    let (file, radius_m, scale) = (file?, radius_m?, scale?);
    let path = document::beside(table.fault_list().file(), &file);
    match Cloud::load(&path, scale, radius_m) {
        Ok(cloud) => Some(Shape::Cloud(Arc::new(cloud))),
        Err((value, expected)) => {
            table.fault("file", &value, &expected);
            None
        }
    }
}

/// The URDF convention: R = Rz(yaw) Ry(pitch) Rx(roll), about fixed axes roll first.
pub(crate) fn pose(center_m: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Pose {
    Pose::from_parts(Translation3::from(center_m), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

fn check_names(fault_list: &FaultList, obstacles: &[(String, Obstacle)]) {
    let mut seen = BTreeSet::new();
    for (key, obstacle) in obstacles {
        if !seen.insert(&obstacle.name) {
            fault_list.add(
                None,
                key,
                &format!("{:?}", obstacle.name),
                "each obstacle's name once in the file",
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn scene(text: &str) -> Scene {
        Scene::from_toml(Path::new("s.toml"), text).unwrap_or_else(|faults| panic!("{faults}"))
    }

    #[test]
    fn empty_file_is_an_empty_world_with_the_default_margin() {
        let world = scene("");
        assert!(world.obstacles.is_empty());
        assert_eq!(world.margin_m.to_bits(), MARGIN_M_DEFAULT.to_bits());
        assert_eq!(scene("margin_m = 0").margin_m.to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn obstacle_without_a_name_is_called_by_its_place() {
        let ball = "[[sphere]]\ncenter_m = [1, 2, 3]\nradius_m = 0.5\n";
        let world =
            scene(&format!("{ball}{ball}[[box]]\nname = \"b\"\ncenter_m = [0, 0, 0]\nsize_m = [1, 2, 3]"));
        let names: Vec<&str> = world.obstacles.iter().map(|obstacle| obstacle.name.as_str()).collect();
        assert_eq!(names, ["sphere[0]", "sphere[1]", "b"]);
        assert_eq!(world.obstacles[0].pose.translation.vector, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(world.obstacles[2].shape, Shape::Box { size_m: [1.0, 2.0, 3.0] });
    }

    /// Roll, then pitch, then yaw about fixed axes: written out as three matrices, not as a library call.
    #[test]
    fn rpy_turns_as_urdf_says() {
        let (roll, pitch, yaw) = (0.3_f64, -0.7_f64, 1.1_f64);
        let text = format!(
            "[[capsule]]\ncenter_m = [0, 0, 0]\nradius_m = 1\nlength_m = 2\nrpy_rad = [{roll}, {pitch}, {yaw}]"
        );
        let turned = scene(&text).obstacles[0].pose.rotation.to_rotation_matrix();
        let x =
            nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, roll.cos(), -roll.sin(), 0.0, roll.sin(), roll.cos());
        let y = nalgebra::Matrix3::new(
            pitch.cos(),
            0.0,
            pitch.sin(),
            0.0,
            1.0,
            0.0,
            -pitch.sin(),
            0.0,
            pitch.cos(),
        );
        let z = nalgebra::Matrix3::new(yaw.cos(), -yaw.sin(), 0.0, yaw.sin(), yaw.cos(), 0.0, 0.0, 0.0, 1.0);
        assert!((turned.matrix() - z * y * x).norm() < 1e-14);
    }

    #[test]
    fn mesh_beside_the_scene_file_is_read_and_scaled() {
        let directory = std::env::temp_dir().join(format!("taustream-arm-scene-{}", std::process::id()));
        std::fs::create_dir_all(directory.join("parts")).unwrap();
        std::fs::write(directory.join("parts/tile.obj"), "v 0 0 0\nv 1000 0 0\nv 0 1000 0\nf 1 2 3\n")
            .unwrap();
        let text =
            "[[mesh]]\nfile = \"parts/tile.obj\"\nscale = 0.001\ncenter_m = [0, 0, 1]\nrpy_rad = [0, 0, 1]\n";
        std::fs::write(directory.join("s.toml"), text).unwrap();
        let world = Scene::load(&directory.join("s.toml"));
        let faults = Scene::from_toml(&directory.join("s.toml"), &text.replace("0.001", "1.0"));
        std::fs::remove_dir_all(&directory).unwrap();
        let Shape::Mesh { vertices_m, triangles } = &world.unwrap().obstacles[0].shape else {
            panic!("no mesh")
        };
        assert_eq!((vertices_m.len(), triangles.len()), (3, 1));
        assert!((vertices_m[1] - Point3::new(1.0, 0.0, 0.0)).norm() < 1e-12);
        assert!(faults.unwrap_err().to_string().contains("mesh[0].file"));
    }
}
