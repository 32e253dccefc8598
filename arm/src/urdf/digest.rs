//! The part of the robot digest that comes from a URDF; the table is in [`crate::digest`].
use super::arm::{FixedJoint, SolidPart, UrdfArm};
use super::model::{Inertial, Joint, Kind, Link, Model, Origin};
use crate::digest::{put_count, put_number, put_text};
use crate::scene::Shape;

impl UrdfArm {
    /// Appends the canonical bytes of everything that decides where the arm is and what it can hit.
    ///
    /// Numbers as the files state them, and not what is derived from them: a sine may differ by a bit between two
    /// machines, a digest must not.
    pub(crate) fn put(&self, out: &mut Vec<u8>) {
        // Taken apart, so that a new field cannot be forgotten here without the compiler saying so. The moving
        // joints follow from the rest, notices mean nothing. Tips beyond the first come with the groups.
        let Self {
            model,
            tree: _,
            base,
            tips,
            moving: _,
            fixed_joints,
            parts,
            skipped: _,
            allowed,
            states: _,
            notices: _,
        } = self;
        let Model { name: _, links, joints } = model;
        put_count(out, *base);
        put_count(out, tips.first().copied().unwrap_or_default());
        put_count(out, links.len());
        for link in links {
            put_link(out, link);
        }
        put_count(out, joints.len());
        for joint in joints {
            put_joint(out, joint);
        }
        put_count(out, fixed_joints.len());
        for FixedJoint { joint, position } in fixed_joints {
            put_count(out, *joint);
            put_number(out, *position);
        }
        put_count(out, parts.len());
        for part in parts {
            put_part(out, part);
        }
        put_count(out, allowed.len());
        for (first, second) in allowed {
            put_count(out, *first);
            put_count(out, *second);
        }
    }
}

impl UrdfArm {
    /// Appends the moments of inertia of every link that has a mass.
    pub(crate) fn put_moments(&self, out: &mut Vec<u8>) {
        let inertials = self.model.links.iter().filter_map(|link| link.inertial);
        inertials.flat_map(|inertial| inertial.inertia_kg_m2).for_each(|moment| put_number(out, moment));
    }
}

fn put_link(out: &mut Vec<u8>, link: &Link) {
    // Its parts come later, with their meshes read; whether it can be seen does not matter.
    let Link { name, parts: _, is_visible: _, inertial } = link;
    put_text(out, name);
    match inertial {
        None => out.push(0),
        // How a mass is spread changes no setpoint: it is in the digest of the torque model only.
        Some(Inertial { mass_kg, origin, inertia_kg_m2: _ }) => {
            out.push(1);
            put_number(out, *mass_kg);
            put_origin(out, origin);
        }
    }
}

fn put_joint(out: &mut Vec<u8>, joint: &Joint) {
    // Limits are the robot file's, which may only narrow these; a joint that follows another is held.
    let Joint { name, line: _, kind, parent, child, origin, axis, position: _, limits: _, mimic: _ } = joint;
    put_text(out, name);
    out.push(match kind {
        Kind::Fixed => 0,
        Kind::Revolute => 1,
        Kind::Continuous => 2,
        Kind::Prismatic => 3,
        Kind::Planar => 4,
        Kind::Floating => 5,
    });
    put_count(out, *parent);
    put_count(out, *child);
    put_origin(out, origin);
    axis.iter().for_each(|number| put_number(out, *number));
}

fn put_origin(out: &mut Vec<u8>, Origin { xyz_m, rpy_rad }: &Origin) {
    xyz_m.iter().chain(rpy_rad).for_each(|number| put_number(out, *number));
}

/// A mesh that counts as its convex hull, and one that counts as several convex parts. Less was proven of the second: parts
/// touch less often than hulls do, and pairs that touch always are not compared. Another method of cutting needs another number.
const ONE_HULL: u8 = 4;
const CONVEX_PARTS: u8 = 5;

fn put_part(out: &mut Vec<u8>, part: &SolidPart) {
    let SolidPart { link, origin, shapes, mesh } = part;
    put_count(out, *link);
    put_origin(out, origin);
    let (kind, numbers): (u8, Vec<f64>) = match (shapes.as_slice(), mesh) {
        ([Shape::Sphere { radius_m }], _) => (0, vec![*radius_m]),
        ([Shape::Box { size_m }], _) => (1, size_m.to_vec()),
        ([Shape::Cylinder { radius_m, length_m }], _) => (2, vec![*radius_m, *length_m]),
        ([Shape::Capsule { radius_m, length_m }], _) => (3, vec![*radius_m, *length_m]),
        // Shapes of triangles come from files only.
        ([_], mesh) => (ONE_HULL, mesh.map_or(Vec::new(), |(_, scale)| scale.to_vec())),
        (_, mesh) => (CONVEX_PARTS, mesh.map_or(Vec::new(), |(_, scale)| scale.to_vec())),
    };
    out.push(kind);
    out.extend(mesh.iter().flat_map(|(digest, _)| digest));
    numbers.iter().for_each(|number| put_number(out, *number));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: a mesh that counts as one hull keeps the bytes that it had before there were parts, and one that counts as parts has others.
    #[test]
    fn bytes_of_a_mesh_say_whether_it_counts_as_parts() {
        let hull = || Shape::Hull { vertices_m: Vec::new(), triangles: Vec::new(), rounding_m: 0.0 };
        let bytes = |shapes: Vec<Shape>| {
            let mut out = Vec::new();
            put_part(
                &mut out,
                &SolidPart { link: 3, origin: Origin::NONE, shapes, mesh: Some(([7; 32], [0.5; 3])) },
            );
            out
        };
        let mut expected = vec![3, 0, 0, 0];
        expected.extend([0; 48]);
        expected.push(4);
        expected.extend([7; 32]);
        expected.extend([0.5_f64.to_le_bytes(); 3].concat());
        assert_eq!(bytes(vec![hull()]), expected);
        expected[52] = 5;
        assert_eq!(bytes(vec![hull(), hull()]), expected);
    }
}
