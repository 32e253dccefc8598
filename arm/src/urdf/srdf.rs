//! What an SRDF file says: which links may touch, and poses with a name. Nothing else of it is used.
use super::model::Model;
use super::xml::{self, Context, Element};
use crate::document::shown;
use crate::named_pose::GroupState;
use crate::reader::{Bounds, FaultList};
use std::collections::BTreeSet;
use std::path::Path;

/// What is used of an SRDF file.
#[derive(Debug, Default)]
pub(crate) struct Semantics {
    /// Pairs of links that may touch, lower index first, in rising order.
    pub(crate) allowed: Vec<(usize, usize)>,
    /// Every `group_state`, of this arm or not.
    pub(crate) states: Vec<GroupState>,
}

/// A revolute joint turns; a finger of a gripper slides, and its state is not used.
const VALUE: Bounds = Bounds::within(-1e3, 1e3, "rad or m");

/// Reads a file; faults go into the book.
pub(crate) fn read(fault_list: &FaultList, model: &Model) -> Semantics {
    let read = (|| {
        let text = xml::read(fault_list.file(), WHAT).map_err(|faults| fault_list.merge(faults)).ok()?;
        let document =
            xml::parse(fault_list.file(), &text).map_err(|faults| fault_list.merge(faults)).ok()?;
        let context = Context::new(fault_list, &text);
        let robot = Element::robot(&context, &document)?;
        let allowed = pairs(&robot, model).into_iter().collect();
        Some(Semantics { allowed, states: states(&robot) })
    })();
    read.unwrap_or_default()
}

/// The group states, each joint with the first of its values (others have joints of several).
fn states(robot: &Element<'_, '_, '_>) -> Vec<GroupState> {
    let state = |element: &Element<'_, '_, '_>| {
        let name = element.name("name")?;
        let value = |joint: &Element<'_, '_, '_>| Some((joint.name("name")?, joint.number("value", &VALUE)?));
        let joints = element.children("joint").iter().filter_map(value).collect();
        Some(GroupState { name, joints })
    };
    robot.children("group_state").iter().filter_map(state).collect()
}

const WHAT: &str = "an SRDF file";

fn pairs(robot: &Element<'_, '_, '_>, model: &Model) -> BTreeSet<(usize, usize)> {
    let mut pairs = BTreeSet::new();
    // Everything off for a link first, then single pairs on again, then single pairs off: the order of MoveIt.
    for element in robot.children("disable_default_collisions") {
        let link = link_of(&element, "link", model);
        pairs
            .extend(link.into_iter().flat_map(|a| (0..model.links.len()).filter_map(move |b| ordered(a, b))));
    }
    for element in robot.children("enable_collisions") {
        if let Some(pair) = pair_of(&element, model) {
            pairs.remove(&pair);
        }
    }
    pairs.extend(robot.children("disable_collisions").iter().filter_map(|element| pair_of(element, model)));
    pairs
}

fn pair_of(element: &Element<'_, '_, '_>, model: &Model) -> Option<(usize, usize)> {
    let (first, second) = (link_of(element, "link1", model), link_of(element, "link2", model));
    ordered(first?, second?)
}

/// A link may always touch itself.
fn ordered(a: usize, b: usize) -> Option<(usize, usize)> {
    (a != b).then_some((a.min(b), a.max(b)))
}

/// A link that does not exist is a misspelt one: the pair that was meant would still be refused, or worse.
fn link_of(element: &Element<'_, '_, '_>, attribute: &str, model: &Model) -> Option<usize> {
    let name = element.name(attribute)?;
    let link = model.link(&name);
    if link.is_none() {
        element.fault(
            attribute,
            &shown(&name),
            &format!("the name of a link of robot {}", shown(&model.name)),
        );
    }
    link
}

/// Reads a file into the faults of the one that names it.
pub(crate) fn load(fault_list: &FaultList, file: &Path, model: &Model) -> Semantics {
    let own = FaultList::new(file);
    let semantics = read(&own, model);
    match own.close(Some(semantics)) {
        Ok(semantics) => semantics,
        Err(faults) => {
            fault_list.merge(faults);
            Semantics::default()
        }
    }
}
