//! Arguments of `taustream scene`.
use clap::{ArgGroup, Args, Subcommand};
use std::path::PathBuf;
use taustream_messages::scene::{FAR_M, MASS_KG_MAX, ObjectShape, is_object_name};

const SCENE_HELP: &str = "\
Examples:
  taustream scene list
  taustream scene add crate --box 0.3,0.2,0.2 --at 0.5,0.1,0.1 --rpy 0,0,0.4
  taustream scene move crate --at 0.5,0.2,0.1
  taustream scene attach crate --mass-kg 1.2      the tip takes it where it is; the arm must be at rest
  taustream scene detach crate                    the tip leaves it where it is
  taustream scene add tool --capsule 0.02,0.1 --at 0,0,0.05 --tip --mass-kg 0.4
  taustream scene add bin --cloud bin.pcd --point-radius-m 0.005 --at 0.5,0,0.1 --replace
  taustream scene remove crate

Every change is checked at once against the motion that runs: what is in its way makes the planner lead the arm to its goal by
another way, or stop it on its path. The answer states which link, which object, where and when. Objects are lost when the planner
ends, unless it was started with --keep-scene FILE. Programs send the same as a message of fixed size: docs/scene.md.";

/// `taustream scene`
#[derive(Args, Debug)]
#[command(after_help = SCENE_HELP)]
pub(crate) struct SceneArgs {
    /// What to do.
    #[command(subcommand)]
    pub(crate) action: SceneAction,
}

impl SceneArgs {
    /// True when a file of the caller is read.
    pub(crate) fn reads_a_file(&self) -> bool {
        matches!(&self.action, SceneAction::Add(add) if add.file.is_some() || add.cloud.is_some())
    }
}

/// What to do with the running planner's scene.
#[derive(Debug, Subcommand)]
pub(crate) enum SceneAction {
    /// List the objects.
    List,
    /// Add an object, or all of a scene file.
    Add(Box<AddArgs>),
    /// Remove an object.
    Remove(NameArgs),
    /// Move an object.
    Move(MoveArgs),
    /// Fix an object to the tip, where both are now.
    Attach(AttachArgs),
    /// Leave an object of the tip where it is now.
    Detach(NameArgs),
}

/// The name of an object.
#[derive(Args, Debug)]
pub(crate) struct NameArgs {
    /// Its name.
    #[arg(value_name = "NAME", value_parser = name)]
    pub(crate) name: String,
}

/// `taustream scene add`
#[derive(Args, Debug)]
#[command(group = ArgGroup::new("shape").args(["sphere", "box", "cylinder", "capsule", "cloud"]), group = ArgGroup::new("what").required(true).args(["name", "file"]))]
pub(crate) struct AddArgs {
    /// Its name: letters, digits, '_', '-' and '.'.
    #[arg(value_name = "NAME", value_parser = name, requires = "shape")]
    pub(crate) name: Option<String>,
    /// Add every object of a scene file instead; its margin does not count, and meshes are refused.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["shape", "at", "rpy", "tip", "mass_kg"])]
    pub(crate) file: Option<PathBuf>,
    /// A ball: its radius, m.
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = sphere)]
    pub(crate) sphere: Option<ObjectShape>,
    /// A box: its edges along x, y and z, m.
    #[arg(long = "box", id = "box", value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = cuboid)]
    pub(crate) cuboid: Option<ObjectShape>,
    /// A cylinder along its z axis: radius and length, m.
    #[arg(long, value_name = "R,L", allow_hyphen_values = true, value_parser = cylinder)]
    pub(crate) cylinder: Option<ObjectShape>,
    /// A capsule along its z axis: radius, and length between the centres of its ends, m.
    #[arg(long, value_name = "R,L", allow_hyphen_values = true, value_parser = capsule)]
    pub(crate) capsule: Option<ObjectShape>,
    /// Points that a camera saw: a .ply, .pcd or .xyz file of up to 16384 points; --at is where its origin is.
    #[arg(long, value_name = "FILE", requires = "point_radius_m", conflicts_with_all = ["tip", "mass_kg"])]
    pub(crate) cloud: Option<PathBuf>,
    /// Radius of the ball around each point of --cloud, m: half the distance of neighbours closes a surface.
    #[arg(long, value_name = "M", requires = "cloud", allow_negative_numbers = true, value_parser = point_radius_m)]
    pub(crate) point_radius_m: Option<f64>,
    /// Where its centre is, in the frame of the base, or of the tip with --tip, m.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = position, required_unless_present = "file")]
    pub(crate) at: Option<Triple>,
    /// How it is turned: roll, pitch and yaw about the fixed axes x, y and z, rad.
    #[arg(long, value_name = "R,P,Y", allow_hyphen_values = true, value_parser = angles)]
    pub(crate) rpy: Option<Triple>,
    /// Fix it to the tip at once.
    #[arg(long)]
    pub(crate) tip: bool,
    /// What it weighs, kg; counts at the tip.
    #[arg(long, value_name = "KG", allow_negative_numbers = true, default_value_t = 0.0, value_parser = mass_kg)]
    pub(crate) mass_kg: f64,
    /// Take the place of objects of the same name.
    #[arg(long)]
    pub(crate) replace: bool,
}

impl AddArgs {
    /// The shape that was given.
    pub(crate) fn shape(&self) -> Option<ObjectShape> {
        self.sphere.or(self.cuboid).or(self.cylinder).or(self.capsule)
    }
}

/// `taustream scene move`
#[derive(Args, Debug)]
pub(crate) struct MoveArgs {
    /// Its name.
    #[arg(value_name = "NAME", value_parser = name)]
    pub(crate) name: String,
    /// Where its centre is now, in the frame that it is fixed to, m.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = position)]
    pub(crate) at: Triple,
    /// How it is turned now, rad; without it, as before.
    #[arg(long, value_name = "R,P,Y", allow_hyphen_values = true, value_parser = angles)]
    pub(crate) rpy: Option<Triple>,
}

/// `taustream scene attach`
#[derive(Args, Debug)]
pub(crate) struct AttachArgs {
    /// Its name.
    #[arg(value_name = "NAME", value_parser = name)]
    pub(crate) name: String,
    /// What it weighs, kg.
    #[arg(long, value_name = "KG", allow_negative_numbers = true, default_value_t = 0.0, value_parser = mass_kg)]
    pub(crate) mass_kg: f64,
}

/// Three numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Triple(pub(crate) [f64; 3]);

fn name(text: &str) -> Result<String, String> {
    if is_object_name(text) {
        return Ok(text.to_owned());
    }
    Err("expected 1 to 64 letters, digits, '_', '-' or '.'".to_owned())
}

fn numbers<const N: usize>(text: &str, of: &str, fits: impl Fn(f64) -> bool) -> Result<[f64; N], String> {
    let parsed: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let all = parsed.and_then(|all| <[f64; N]>::try_from(all).ok());
    all.filter(|all| all.iter().all(|x| fits(*x)))
        .ok_or_else(|| format!("expected {of}, separated by commas"))
}

fn size(x: f64) -> bool {
    x > 0.0 && x <= FAR_M
}

fn sphere(text: &str) -> Result<ObjectShape, String> {
    numbers::<1>(text, "a radius above 0 and up to 100 m", size)
        .map(|[radius_m]| ObjectShape::Sphere { radius_m })
}

fn cuboid(text: &str) -> Result<ObjectShape, String> {
    numbers::<3>(text, "three edges above 0 and up to 100 m", size).map(|size_m| ObjectShape::Box { size_m })
}

fn cylinder(text: &str) -> Result<ObjectShape, String> {
    numbers::<2>(text, "radius and length, above 0 and up to 100 m", size)
        .map(|[radius_m, length_m]| ObjectShape::Cylinder { radius_m, length_m })
}

fn capsule(text: &str) -> Result<ObjectShape, String> {
    numbers::<2>(text, "radius and length, above 0 and up to 100 m", size)
        .map(|[radius_m, length_m]| ObjectShape::Capsule { radius_m, length_m })
}

fn point_radius_m(text: &str) -> Result<f64, String> {
    let radius_m = text.trim().parse().ok().filter(|radius_m| *radius_m > 0.0 && *radius_m <= 1.0);
    radius_m.ok_or_else(|| "expected m, above 0 and up to 1".to_owned())
}

fn position(text: &str) -> Result<Triple, String> {
    numbers(text, "x, y and z from -100 to 100 m", |x| x.abs() <= FAR_M).map(Triple)
}

fn angles(text: &str) -> Result<Triple, String> {
    numbers(text, "roll, pitch and yaw from -6.3 to 6.3 rad", |x| x.abs() <= 6.3).map(Triple)
}

fn mass_kg(text: &str) -> Result<f64, String> {
    let mass_kg = text.trim().parse().ok().filter(|mass| (0.0..=MASS_KG_MAX).contains(mass));
    mass_kg.ok_or_else(|| "expected kg, from 0 to 100000".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_objects_must_be_finite_in_range_and_as_many_as_there_are() {
        for text in ["", "1,2", "1,2,3,4", "nan,0,0", "inf,0,0", "0,0,101", "a,b,c"] {
            assert!(position(text).is_err(), "{text}");
        }
        for text in ["0,1,1", "-1,1,1", "nan,1,1", "1,1", "101,1,1"] {
            assert!(cuboid(text).is_err(), "{text}");
        }
        assert_eq!(position(" 1, -2 ,3"), Ok(Triple([1.0, -2.0, 3.0])));
        for text in ["", "a b", "a/b", "\u{1b}[2J"] {
            assert!(name(text).is_err(), "{text}");
        }
    }
}
