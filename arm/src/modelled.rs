//! Whether the shapes of a robot hold the robot: links that move and have none, and masses outside of their link's.
use crate::body::Body;
use crate::document::{Node, Value, shown};
use crate::mass::LinkMass;
use crate::reader::{FaultList, Table};
use crate::robot::LinkShape;
use crate::scene::Shape;
use crate::{Fault, Faults, Robot, hull};
use parry3d_f64::math::Pose;
use taustream_motion::chain;

/// A centre of mass further outside than this is reported; files round.
const OUTSIDE_M: f64 = 1e-3;

/// A link that the robot file lists as having no shape.
#[derive(Clone, Debug)]
pub(crate) struct Listed {
    pub(crate) name: String,
    line: Option<usize>,
}

/// Takes `unmodelled_links`.
pub(crate) fn read(top: &mut Table<'_>) -> Vec<Listed> {
    let Some(node) = top.take(KEY) else { return Vec::new() };
    let name = |item: &Node| match &item.value {
        Value::Text(name) => Some(Listed { name: name.clone(), line: item.line }),
        Value::Flag(_)
        | Value::Integer(_)
        | Value::Number(_)
        | Value::List(_)
        | Value::Table(_)
        | Value::Other(_) => None,
    };
    let listed: Option<Vec<Listed>> =
        if let Value::List(items) = &node.value { items.iter().map(name).collect() } else { None };
    if listed.is_none() {
        top.fault(KEY, &node.to_string(), "a list of names of links: [\"link6\"]");
    }
    listed.unwrap_or_default()
}

const KEY: &str = "unmodelled_links";

/// Refuses names that are no links, and links that have shapes: then there is nothing to acknowledge.
pub(crate) fn check(
    fault_list: &FaultList,
    listed: &[Listed],
    links: &[String],
    has_shape: impl Fn(usize) -> bool,
) {
    for (i, Listed { name, line }) in listed.iter().enumerate() {
        let key = format!("{KEY}[{i}]");
        match links.iter().position(|link| link == name) {
            None => {
                fault_list.add(
                    *line,
                    &key,
                    &shown(name),
                    "the name of a link (`taustream check` lists them)",
                );
            }
            Some(link) if has_shape(link) => {
                fault_list.add(
                    *line,
                    &key,
                    &shown(name),
                    "a link without collision shape; this one has some",
                );
            }
            Some(_) if listed.iter().take(i).any(|other| other.name == *name) => {
                fault_list.add(*line, &key, &shown(name), "each link once");
            }
            Some(_) => {}
        }
    }
}

impl Robot {
    /// Refuses to plan for an arm part of which could pass through anything.
    ///
    /// # Errors
    /// The links that move, have no collision shape and are not listed in `unmodelled_links`.
    pub fn require_modelled(&self) -> Result<(), Faults> {
        if self.unlisted_links.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = self.unlisted_links.iter().map(|name| format!("{name:?}")).collect();
        let names = names.join(", ");
        let remedy = if self.ends.is_some() { "<collision> geometry in the URDF" } else { "link_capsules" };
        let expected = format!(
            "a collision shape for each link that moves: nothing keeps {names} from hitting anything. Give them {remedy}, or \
             acknowledge it: unmodelled_links = [{names}]"
        );
        Err(Faults(vec![Fault::new(&self.file, KEY, &format!("missing for {names}"), &expected)]))
    }
}

/// The shapes of a link, with parts that stand together as their common hull: a mass is centred in the gap of a fork.
fn filled<'a>(own: impl Iterator<Item = &'a LinkShape>) -> Vec<LinkShape> {
    let mut filled: Vec<LinkShape> = Vec::new();
    for shape in own {
        if let Some(last) = filled.last_mut()
            && last.pose == shape.pose
            && let (Shape::Hull { vertices_m: first, .. }, Shape::Hull { vertices_m: second, rounding_m, .. }) =
                (&last.shape, &shape.shape)
            && let Ok(hull) = hull::of(&[first.as_slice(), second.as_slice()].concat())
        {
            let rounding_m = rounding_m.max(hull.rounding_m);
            last.shape = Shape::Hull { vertices_m: hull.vertices_m, triangles: hull.triangles, rounding_m };
        } else {
            filled.push(shape.clone());
        }
    }
    filled
}

/// What is said of masses whose centre is not inside of their link's shapes.
pub(crate) fn masses_outside(links: &[String], shapes: &[LinkShape], masses: &[LinkMass]) -> Vec<String> {
    let here = Pose::identity();
    let mut said = Vec::new();
    for mass in masses {
        let own = filled(shapes.iter().filter(|shape| shape.link == mass.link && shape.frame == mass.frame));
        let at = chain::Pose::translation(mass.center_m.x, mass.center_m.y, mass.center_m.z);
        let Some(point) = Body::new(&Shape::Sphere { radius_m: 0.0 }, &at) else { continue };
        let to_shape_m = |shape: &LinkShape| {
            let body = Body::new(&shape.shape, &shape.pose)?;
            Some(body.distance_m(&body.placed(&here), &point, &point.placed(&here)))
        };
        let Some(outside_m) = own.iter().filter_map(to_shape_m).reduce(f64::min).filter(|d| *d > OUTSIDE_M)
        else {
            continue;
        };
        let (name, center) = (links.get(mass.link).map_or("", String::as_str), mass.center_m);
        said.push(format!(
            "link {name}: its centre of mass ({:.4}, {:.4}, {:.4}) m lies {outside_m:.4} m OUTSIDE of its collision shapes: they do not \
             hold the whole link, or the mass is wrong",
            center.x, center.y, center.z
        ));
    }
    said
}
