//! What a URDF file says: links with their solid parts, and joints between them. Nothing is derived here.
use super::xml::{Context, Element};
use crate::document::shown;
use crate::mass::{MASS_KG, MOMENT_KG_M2};
use crate::reader::Bounds;
use crate::scene::Shape;
use crate::text::counted;
use std::collections::BTreeSet;

/// A pose in the frame before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Origin {
    pub(crate) xyz_m: [f64; 3],
    /// Fixed axes, roll first.
    pub(crate) rpy_rad: [f64; 3],
}

impl Origin {
    pub(crate) const NONE: Self = Self { xyz_m: [0.0; 3], rpy_rad: [0.0; 3] };
}

/// What a solid part is made of.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Solid {
    /// A shape that the file states itself.
    Primitive(Shape),
    /// A mesh file, as the file names it.
    Mesh { named: String, scale: [f64; 3] },
}

/// A `<collision>`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    /// How faults and notices call it.
    pub(crate) path: String,
    pub(crate) line: Option<usize>,
    pub(crate) origin: Origin,
    pub(crate) solid: Solid,
}

/// A `<link>`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) parts: Vec<Part>,
    /// It can be seen: without parts it is solid in the world, but not here.
    pub(crate) is_visible: bool,
    pub(crate) inertial: Option<Inertial>,
}

/// The mass of a link, where its centre is, and its moments of inertia along the origin's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Inertial {
    pub(crate) mass_kg: f64,
    pub(crate) origin: Origin,
    /// xx, yy, zz, xy, xz, yz.
    pub(crate) inertia_kg_m2: [f64; 6],
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Fixed,
    Revolute,
    Continuous,
    Prismatic,
    Planar,
    Floating,
}

impl Kind {
    const ALL: [(&'static str, Self); 6] = [
        ("fixed", Self::Fixed),
        ("revolute", Self::Revolute),
        ("continuous", Self::Continuous),
        ("prismatic", Self::Prismatic),
        ("planar", Self::Planar),
        ("floating", Self::Floating),
    ];
    pub(crate) fn word(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(word, _)| word)
    }
}

/// A `<joint>`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) line: Option<usize>,
    pub(crate) kind: Kind,
    /// Index of the link before it.
    pub(crate) parent: usize,
    /// Index of the link behind it.
    pub(crate) child: usize,
    pub(crate) origin: Origin,
    /// As written, not of unit length; never zero.
    pub(crate) axis: [f64; 3],
    /// Lowest and highest position (rad or m), inside the soft limits where the file states such.
    pub(crate) position: Option<[f64; 2]>,
    pub(crate) limits: StatedLimits,
    pub(crate) mimic: Option<Mimic>,
}

/// The rates that a `<limit>` states. Each may be 0, which is what generators write when they know none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct StatedLimits {
    /// rad/s or m/s.
    pub(crate) velocity: Option<f64>,
    /// rad/s^2 or m/s^2: the lower one of `acceleration` and `deceleration` (URDF 1.2).
    pub(crate) acceleration: Option<f64>,
    /// rad/s^3 or m/s^3 (URDF 1.2).
    pub(crate) jerk: Option<f64>,
    /// Nm or N, above 0: the greatest torque or force.
    pub(crate) effort: Option<f64>,
}

/// Another joint decides where this one is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mimic {
    pub(crate) joint: String,
    pub(crate) offset: f64,
}

/// A URDF file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Model {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
}

/// Most links; a humanoid with hands has a hundred.
const LINKS_MAX: usize = 1000;
/// Most solid parts: every pair of them is looked at.
const PARTS_MAX: usize = 500;
const LENGTH_M: Bounds = Bounds::within(-100.0, 100.0, "m");
const ANGLE_RAD: Bounds = Bounds::within(-100.0, 100.0, "rad");
const SIZE_M: Bounds = Bounds::above(0.0, 100.0, "m");
const SCALE: Bounds = Bounds::within(-1e4, 1e4, "");
const AXIS: Bounds = Bounds::within(-1e6, 1e6, "");
const POSITION: Bounds = Bounds::within(-1e9, 1e9, "rad or m");
const VELOCITY: Bounds = Bounds::within(0.0, 1e9, "rad/s or m/s");
const ACCELERATION: Bounds = Bounds::within(0.0, 1e9, "rad/s^2 or m/s^2");
/// Nm or N; less than nothing is taken for nothing.
const EFFORT: Bounds = Bounds::within(-1e9, 1e9, "Nm or N");
const JERK: Bounds = Bounds::within(0.0, 1e12, "rad/s^3 or m/s^3");

impl Model {
    /// Reads the whole file; complete only when no fault was noted.
    pub(crate) fn read(context: &Context<'_>, robot: &Element<'_, '_, '_>) -> Option<Self> {
        let name = robot.name("name");
        let (link_elements, joint_elements) = (robot.children("link"), robot.children("joint"));
        if link_elements.is_empty() || link_elements.len() > LINKS_MAX || joint_elements.len() > LINKS_MAX {
            let value = format!(
                "{} and {}",
                counted(link_elements.len(), "link"),
                counted(joint_elements.len(), "joint")
            );
            robot.fault("", &value, &format!("1 to {LINKS_MAX} links, and at most as many joints"));
            return None;
        }
        let parts = link_elements.iter().map(|l| l.children("collision").len()).sum::<usize>();
        if parts > PARTS_MAX {
            let expected = format!("at most {PARTS_MAX} parts in the whole file; simplify the geometry");
            robot.fault("", &format!("{parts} <collision> elements"), &expected);
            return None;
        }
        let mut names = BTreeSet::new();
        let link_names: Vec<Option<String>> = link_elements.iter().map(|e| own_name(e, &mut names)).collect();
        let links =
            link_elements.iter().zip(&link_names).filter_map(|(e, name)| read_link(e, name.as_deref()));
        let links = links.collect();
        let mut names = BTreeSet::new();
        // Compared with all names, so that a faulty link is not also called missing.
        let joints = joint_elements.iter().filter_map(|e| read_joint(e, &link_names, &mut names)).collect();
        context.fault_list.is_clean().then_some(Self { name: name?, links, joints })
    }
    pub(crate) fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }
}

/// A name that no other element of its kind has.
fn own_name(element: &Element<'_, '_, '_>, names: &mut BTreeSet<String>) -> Option<String> {
    let name = element.name("name")?;
    if !names.insert(name.clone()) {
        element.fault("name", &shown(&name), "each name once among links, and once among joints");
    }
    Some(name)
}

fn read_link(element: &Element<'_, '_, '_>, name: Option<&str>) -> Option<Link> {
    let parts: Vec<Option<Part>> = element.children("collision").iter().map(read_part).collect();
    let inertial = element.child("inertial").map(|inertial| read_inertial(&inertial));
    let is_visible = !element.children("visual").is_empty();
    Some(Link {
        name: name?.to_owned(),
        parts: parts.into_iter().flatten().collect(),
        is_visible,
        inertial: match inertial {
            Some(read) => Some(read?),
            None => None,
        },
    })
}

fn read_origin(element: &Element<'_, '_, '_>) -> Option<Origin> {
    let Some(origin) = element.child("origin") else { return Some(Origin::NONE) };
    let xyz_m = origin.vector_or("xyz", [0.0; 3], &LENGTH_M);
    let rpy_rad = origin.vector_or("rpy", [0.0; 3], &ANGLE_RAD);
    Some(Origin { xyz_m: xyz_m?, rpy_rad: rpy_rad? })
}

fn read_inertial(element: &Element<'_, '_, '_>) -> Option<Inertial> {
    let origin = read_origin(element);
    let mass = element.need("mass", "<mass value=\"kg\"/>").and_then(|mass| mass.number("value", &MASS_KG));
    let inertia = read_moments(element);
    Some(Inertial { mass_kg: mass?, origin: origin?, inertia_kg_m2: inertia? })
}

/// Moments of inertia; those of a point when there are none.
fn read_moments(element: &Element<'_, '_, '_>) -> Option<[f64; 6]> {
    let Some(inertia) = element.child("inertia") else { return Some([0.0; 6]) };
    // Every one is looked at, so that two bad ones are two faults.
    let read =
        ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"].map(|key| inertia.number_or(key, 0.0, &MOMENT_KG_M2));
    let [xx, yy, zz, xy, xz, yz] = read;
    Some([xx?, yy?, zz?, xy?, xz?, yz?])
}

fn read_part(element: &Element<'_, '_, '_>) -> Option<Part> {
    const SHAPES: &str = "one of <sphere>, <box>, <cylinder>, <capsule>, <mesh> in <geometry>";
    let origin = read_origin(element);
    let geometry = element.need("geometry", SHAPES)?;
    let shape = match geometry.tags().as_slice() {
        [tag @ ("sphere" | "box" | "cylinder" | "capsule" | "mesh")] => Some(*tag),
        other => {
            geometry.fault("", &shown(&other.join(", ")), SHAPES);
            None
        }
    };
    let solid = match shape? {
        "sphere" => {
            Solid::Primitive(Shape::Sphere { radius_m: geometry.child("sphere")?.number("radius", &SIZE_M)? })
        }
        "box" => Solid::Primitive(Shape::Box { size_m: geometry.child("box")?.vector("size", &SIZE_M)? }),
        "cylinder" => {
            let (radius_m, length_m) = round(&geometry.child("cylinder")?)?;
            Solid::Primitive(Shape::Cylinder { radius_m, length_m })
        }
        "capsule" => {
            let (radius_m, length_m) = round(&geometry.child("capsule")?)?;
            Solid::Primitive(Shape::Capsule { radius_m, length_m })
        }
        _ => read_mesh(&geometry.child("mesh")?)?,
    };
    Some(Part { path: element.path().to_owned(), line: element.line(), origin: origin?, solid })
}

fn round(element: &Element<'_, '_, '_>) -> Option<(f64, f64)> {
    let (radius_m, length_m) = (element.number("radius", &SIZE_M), element.number("length", &SIZE_M));
    Some((radius_m?, length_m?))
}

fn read_mesh(element: &Element<'_, '_, '_>) -> Option<Solid> {
    let named =
        element.text("filename", "the path of a mesh file: package://, file:// or relative to this file");
    // A negative factor mirrors, which some files use for left and right; zero flattens.
    let scale = element.vector_or("scale", [1.0; 3], &SCALE);
    if let Some(scale) = scale
        && scale.iter().any(|s| s.abs() < 1e-9)
    {
        element.fault("scale", &format!("{scale:?}"), "three factors that are not 0");
        return None;
    }
    Some(Solid::Mesh { named: named?, scale: scale? })
}

fn read_joint(
    element: &Element<'_, '_, '_>,
    links: &[Option<String>],
    names: &mut BTreeSet<String>,
) -> Option<Joint> {
    let name = own_name(element, names);
    let kind = read_kind(element);
    let parent = read_end(element, "parent", links);
    let child = read_end(element, "child", links);
    let origin = read_origin(element);
    let axis = read_axis(element, kind);
    let position = read_position(element);
    let limits = read_limits(element);
    let mimic = element.child("mimic").map(|mimic| {
        let joint = mimic.name("joint");
        let offset = mimic.number_or("offset", 0.0, &POSITION);
        Some(Mimic { joint: joint?, offset: offset? })
    });
    Some(Joint {
        name: name?,
        line: element.line(),
        kind: kind?,
        parent: parent?,
        child: child?,
        origin: origin?,
        axis: axis?,
        position: position?,
        limits: limits?,
        mimic: match mimic {
            Some(read) => Some(read?),
            None => None,
        },
    })
}

fn read_kind(element: &Element<'_, '_, '_>) -> Option<Kind> {
    const EXPECTED: &str = "fixed, revolute, continuous, prismatic, planar or floating";
    let word = element.text("type", EXPECTED)?;
    let kind = Kind::ALL.iter().find(|(name, _)| *name == word).map(|(_, kind)| *kind);
    if kind.is_none() {
        element.fault("type", &shown(&word), EXPECTED);
    }
    kind
}

fn read_end(element: &Element<'_, '_, '_>, which: &'static str, links: &[Option<String>]) -> Option<usize> {
    let end = element.need(which, "the name of a link, as <parent link=\"..\"/> and <child link=\"..\"/>")?;
    let name = end.name("link")?;
    let found = links.iter().position(|link| link.as_ref() == Some(&name));
    if found.is_none() {
        end.fault("link", &shown(&name), "the name of a <link> of this file");
    }
    found
}

/// Fixed joints often carry an axis of zeros; it means nothing there.
fn read_axis(element: &Element<'_, '_, '_>, kind: Option<Kind>) -> Option<[f64; 3]> {
    const X: [f64; 3] = [1.0, 0.0, 0.0];
    let Some(axis) = element.child("axis") else { return Some(X) };
    let xyz = axis.vector_or("xyz", X, &AXIS)?;
    let length = xyz.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length > 1e-6 {
        return Some(xyz);
    }
    if matches!(kind, Some(Kind::Fixed | Kind::Floating)) {
        return Some(X);
    }
    axis.fault("xyz", &format!("{xyz:?}"), "a direction: three numbers that are not all 0");
    None
}

/// `None` after a fault, `Some(None)` where the file states no range.
#[expect(clippy::option_option, reason = "a missing range and a faulty one are distinguished")]
fn read_position(element: &Element<'_, '_, '_>) -> Option<Option<[f64; 2]>> {
    let Some(limit) = element.child("limit") else { return Some(None) };
    if !limit.has("lower") && !limit.has("upper") {
        return Some(None);
    }
    let (lower, upper) = (limit.number_or("lower", 0.0, &POSITION), limit.number_or("upper", 0.0, &POSITION));
    let [mut lower, mut upper] = [lower?, upper?];
    if let Some(safety) = element.child("safety_controller") {
        let soft = [
            safety.number_or("soft_lower_limit", lower, &POSITION),
            safety.number_or("soft_upper_limit", upper, &POSITION),
        ];
        // Both 0 is what generators write when they have none.
        if let [Some(low), Some(high)] = soft
            && low < high
        {
            (lower, upper) = (lower.max(low), upper.min(high));
        }
    }
    if lower > upper {
        limit.fault("lower", &format!("{lower:?}"), &format!("at most the upper limit, {upper:?}"));
        return None;
    }
    // No range at all, which is what generators write when they know none.
    Some((lower < upper).then_some([lower, upper]))
}

/// What the file states of a joint's rates.
fn read_limits(element: &Element<'_, '_, '_>) -> Option<StatedLimits> {
    let Some(limit) = element.child("limit") else { return Some(StatedLimits::default()) };
    // Every one is looked at, so that two bad ones are two faults.
    let read = |attribute: &str, bounds: &Bounds| {
        if limit.has(attribute) { limit.number(attribute, bounds).map(Some) } else { Some(None) }
    };
    let effort = read("effort", &EFFORT);
    let velocity = read("velocity", &VELOCITY);
    let acceleration = read("acceleration", &ACCELERATION);
    let deceleration = read("deceleration", &ACCELERATION);
    let jerk = read("jerk", &JERK);
    let slower = match (acceleration?, deceleration?) {
        (Some(up), Some(down)) => Some(up.min(down)),
        (up, down) => up.or(down),
    };
    // Generators write 0, and some -1, when they know none.
    let effort = effort?.filter(|effort| *effort > 0.0);
    Some(StatedLimits { velocity: velocity?, acceleration: slower, jerk: jerk?, effort })
}
