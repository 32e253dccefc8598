//! How the links of a URDF hang together: one tree with one root.
use super::model::Model;
use crate::document::shown;
use crate::reader::FaultList;

/// The tree.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    /// The links, every one after the link that it hangs on.
    pub(crate) order: Vec<usize>,
    /// The joint before each link; none before the root.
    pub(crate) joint_before: Vec<Option<usize>>,
}

impl Tree {
    /// Checks that every link hangs on the root by exactly one way.
    pub(crate) fn of(fault_list: &FaultList, model: &Model) -> Option<Self> {
        let name = |link: usize| model.links.get(link).map_or(String::new(), |l| shown(&l.name));
        let mut joint_before: Vec<Option<usize>> = vec![None; model.links.len()];
        for (index, joint) in model.joints.iter().enumerate() {
            let key = format!("joint {}.child", shown(&joint.name));
            if let Some(slot @ None) = joint_before.get_mut(joint.child) {
                *slot = Some(index);
            } else {
                let expected = "a link that no other joint has as its child: links form a tree";
                fault_list.add(joint.line, &key, &name(joint.child), expected);
            }
        }
        let roots: Vec<usize> = joint_before
            .iter()
            .enumerate()
            .filter(|(_, joint)| joint.is_none())
            .map(|(link, _)| link)
            .collect();
        let &[root] = roots.as_slice() else {
            let names: Vec<String> = roots.iter().take(8).map(|link| name(*link)).collect();
            let (value, expected) = match names.as_slice() {
                [] => (
                    "no root".to_owned(),
                    "one link that is no joint's child: the joints of this file go round in a circle",
                ),
                _ => (
                    format!("{} roots: {}", roots.len(), names.join(", ")),
                    "one link that is no joint's child",
                ),
            };
            fault_list.add(None, "link", &value, expected);
            return None;
        };
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); model.links.len()];
        for joint in &model.joints {
            if let Some(list) = children.get_mut(joint.parent) {
                list.push(joint.child);
            }
        }
        let mut order = vec![root];
        let mut next = 0;
        // A link twice in the order would have two joints before it, which was noted.
        while let Some(link) = order.get(next).copied().filter(|_| fault_list.is_clean()) {
            order.extend(children.get(link).into_iter().flatten());
            next += 1;
        }
        // What cannot be reached has a joint before it, so it hangs in a circle.
        if let Some(lost) = (0..model.links.len()).find(|link| fault_list.is_clean() && !order.contains(link))
        {
            let expected = format!("links that hang on the root {}: this one hangs in a circle", name(root));
            fault_list.add(None, "link", &name(lost), &expected);
        }
        fault_list.is_clean().then_some(Self { order, joint_before })
    }
    /// The joints from one link to one further out; `None` when the first does not carry the second.
    pub(crate) fn path(&self, model: &Model, from: usize, to: usize) -> Option<Vec<usize>> {
        let mut joints = Vec::new();
        let mut link = to;
        while link != from {
            let joint = (*self.joint_before.get(link)?)?;
            joints.push(joint);
            link = model.joints.get(joint)?.parent;
        }
        joints.reverse();
        Some(joints)
    }
}
