//! The robot digest: a hash over everything that changes what a setpoint means.
//!
//! A trajectory made for one description must not run on another, and a description must not change its digest
//! because a comment has moved. So the hash is SHA-256 over canonical bytes of the checked values, not over the
//! file. What is in it and why, and why servo bindings are not: docs/adr/0002-robot-digest.md.
//!
//! The bytes, integers and floats little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 24 | the ASCII text `taustream robot digest 2` |
//! | string | name of the robot |
//! | u32 | number of joints |
//! | per joint, base to tip: | |
//! | string | name of the joint |
//! | 2 x f64 | lowest and highest `position_rad`, or `position_m` |
//! | 3 x f64 | motion: `velocity_rad_s`, `acceleration_rad_s2`, `jerk_rad_s3` |
//! | 3 x f64 | stop: the same (with the defaults filled in) |
//! | then: | |
//! | u32 | number of pairs in `allowed_contacts` |
//! | 2 x u32 | per pair: indices of the links, lower first, pairs in rising order |
//! | u8 | kind of geometry: 0 rows, 1 a URDF |
//! | rows, per joint: | |
//! | u8 | kind of row: 0 standard (`dh`), 1 modified (`mdh`) |
//! | 4 x f64 | `a_m`, `alpha_rad`, `d_m`, `theta_offset_rad` |
//! | f64 | `link_radius_m` |
//! | a URDF: | |
//! | 2 x u32 | base link and tip link; links, joints and parts are counted from 0 in the order of the file |
//! | u32 | number of links; per link: string name; u8 0, or 1 with f64 mass and the origin of its `<inertial>` |
//! | u32 | number of joints; per joint: string name; u8 type (0 fixed, 1 revolute, 2 continuous, 3 prismatic, 4 planar, 5 floating); u32 parent; u32 child; origin; 3 x f64 axis |
//! | u32 | number of joints that are held; per joint: u32 joint; f64 position |
//! | u32 | number of solid parts; per part: u32 link; origin; u8 kind; the mesh file's SHA-256 (32) for a mesh; numbers: sphere (0) radius, box (1) 3 sizes, cylinder (2) and capsule (3) radius and length, mesh as one hull (4) and as convex parts (5) 3 scales |
//! | u32 | number of pairs that the SRDF lets touch; per pair 2 x u32, as above |
//! | then, only when rows have masses or there is a payload: | |
//! | u8 | 1 when rows have masses, otherwise 0; with 1, per joint f64 mass and 3 x f64 centre of its link |
//! | u8 | 1 when there is a payload, otherwise 0; with 1, f64 mass and 3 x f64 centre |
//! | then, only when base or rows have capsules: | |
//! | u8 | 2 |
//! | base, then per joint: | u32 number of capsules; per capsule 3 x f64 `from_m`, 3 x f64 `to_m`, f64 `radius_m` |
//! | then, only when links keep another margin than the default, or pairs have one of their own: | |
//! | string | `link margins` |
//! | f64 | the margin of all pairs |
//! | u32 | number of pairs with one of their own; per pair 2 x u32 links, f64 margin |
//! | then, only when a URDF's arm has more than one tip: | |
//! | string | `tips` |
//! | u32 | number of tips; per tip u32 link |
//! | then, only when the joints have groups: | |
//! | string | `groups` |
//! | u32 | number of groups; per group: string name; u32 number of joints, per joint u32; u32 0 without a tip, else its place among the tips, from 1 |
//! | then, only when some joint is prismatic, whose positions and rates above are in m: | |
//! | string | `prismatic` |
//! | u32 | number of prismatic joints; per joint u32 |
//!
//! With feed-forward torques (`[feed_forward]` of a settings file) gravity and moments of inertia change what is commanded. The
//! digest in messages then is that of the torque model, over these bytes:
//!
//! | bytes | what |
//! |---|---|
//! | 24 | the ASCII text `taustream torque model 1` |
//! | 32 | the robot digest |
//! | 3 x f64 | gravity |
//! | 6 x f64 | per mass, links in the order above and the payload last: xx, yy, zz, xy, xz, yz |
//!
//! A string is its length in bytes as u32, then its UTF-8 bytes. An origin is x, y, z, roll, pitch, yaw as 6 x f64. An f64 is its
//! IEEE 754 bits; -0.0 is written as 0.0, because both mean the same.
use crate::capsule::Capsule;
use crate::description::{Description, Geometry, Joint};
use crate::group::Group;
use crate::link_margin::LinkMargins;
use crate::mass::Weight;
use crate::rows::{Row, RowKind};
use sha2::{Digest, Sha256};

const HEADER: &[u8; 24] = b"taustream robot digest 2";
const TORQUE_HEADER: &[u8; 24] = b"taustream torque model 1";

/// The digest of a description.
pub(crate) fn of(description: &Description) -> [u8; 32] {
    Sha256::digest(bytes(description)).into()
}

/// The digest of a description whose masses make torques: `digest` is the description's own.
pub(crate) fn of_torque_model(description: &Description, digest: &[u8; 32]) -> [u8; 32] {
    let mut out = [TORQUE_HEADER.as_slice(), digest].concat();
    description.gravity_m_s2.iter().for_each(|number| put_number(&mut out, *number));
    match &description.geometry {
        Geometry::Rows(rows) => {
            rows.iter()
                .filter_map(|row| row.weight.as_ref())
                .for_each(|weight| put_moments(&mut out, weight));
        }
        Geometry::Urdf(arm) => arm.put_moments(&mut out),
    }
    description.payload.iter().for_each(|weight| put_moments(&mut out, weight));
    Sha256::digest(out).into()
}

fn put_moments(out: &mut Vec<u8>, weight: &Weight) {
    weight.inertia_kg_m2.iter().for_each(|number| put_number(out, *number));
}

/// The digest of a file's bytes.
pub(crate) fn of_bytes(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

fn bytes(description: &Description) -> Vec<u8> {
    // Taken apart, so that a new field cannot be forgotten here without the compiler saying so.
    // Gravity and moments of inertia change no setpoint: they are in the digest of the torque model.
    // A pose's name moves nothing. A link that is acknowledged to have no shape has none either way.
    let Description {
        name,
        joints,
        geometry,
        allowed_contacts,
        margins,
        base_capsules,
        unmodelled_links: _,
        payload,
        gravity_m_s2: _,
        poses: _,
        groups,
        notices: _,
    } = description;
    let mut out = HEADER.to_vec();
    put_text(&mut out, name);
    put_count(&mut out, joints.len());
    for joint in joints {
        put_joint(&mut out, joint);
    }
    put_count(&mut out, allowed_contacts.len());
    for (first, second) in allowed_contacts {
        put_count(&mut out, *first);
        put_count(&mut out, *second);
    }
    match geometry {
        Geometry::Rows(rows) => {
            out.push(0);
            rows.iter().for_each(|row| put_row(&mut out, row));
        }
        Geometry::Urdf(arm) => {
            out.push(1);
            arm.put(&mut out);
        }
    }
    put_weights(&mut out, geometry, payload.as_ref());
    put_capsules(&mut out, geometry, base_capsules);
    put_margins(&mut out, margins);
    put_tips(&mut out, geometry);
    put_groups(&mut out, groups);
    put_prismatic(&mut out, joints);
    out
}

/// Which joints slide; nothing when all turn.
fn put_prismatic(out: &mut Vec<u8>, joints: &[Joint]) {
    let prismatic: Vec<usize> = joints
        .iter()
        .enumerate()
        .filter(|(_, joint)| joint.kind.is_prismatic())
        .map(|(index, _)| index)
        .collect();
    if !prismatic.is_empty() {
        put_text(out, "prismatic");
        put_count(out, prismatic.len());
        prismatic.iter().for_each(|joint| put_count(out, *joint));
    }
}

/// The tips of a tree; nothing for a serial arm.
fn put_tips(out: &mut Vec<u8>, geometry: &Geometry) {
    let Geometry::Urdf(arm) = geometry else { return };
    if arm.tips.len() > 1 {
        put_text(out, "tips");
        put_count(out, arm.tips.len());
        arm.tips.iter().for_each(|tip| put_count(out, *tip));
    }
}

/// Which joints belong together; nothing when the file does not say.
fn put_groups(out: &mut Vec<u8>, groups: &[Group]) {
    if groups.is_empty() {
        return;
    }
    put_text(out, "groups");
    put_count(out, groups.len());
    for Group { name, joints, tip } in groups {
        put_text(out, name);
        put_count(out, joints.len());
        joints.iter().for_each(|joint| put_count(out, *joint));
        put_count(out, tip.map_or(0, |tip| tip + 1));
    }
}

/// The capsules of base and links; nothing at all when there are none, as with weights.
fn put_capsules(out: &mut Vec<u8>, geometry: &Geometry, base: &[Capsule]) {
    let Geometry::Rows(rows) = geometry else { return };
    if base.is_empty() && rows.iter().all(|row| row.capsules.is_empty()) {
        return;
    }
    out.push(2);
    for capsules in std::iter::once(base).chain(rows.iter().map(|row| row.capsules.as_slice())) {
        put_count(out, capsules.len());
        for Capsule { from_m, to_m, radius_m } in capsules {
            from_m.iter().chain(to_m).for_each(|number| put_number(out, *number));
            put_number(out, *radius_m);
        }
    }
}

/// What links keep from each other; nothing when it is the default.
fn put_margins(out: &mut Vec<u8>, margins: &LinkMargins) {
    if *margins == LinkMargins::default() {
        return;
    }
    put_text(out, "link margins");
    put_number(out, margins.all_m);
    put_count(out, margins.pairs.len());
    for ((first, second), margin_m) in &margins.pairs {
        put_count(out, *first);
        put_count(out, *second);
        put_number(out, *margin_m);
    }
}

/// What links and payload weigh; nothing at all when nothing is stated, so that a description that states none keeps
/// the digest which it had before there were such keys.
fn put_weights(out: &mut Vec<u8>, geometry: &Geometry, payload: Option<&Weight>) {
    let weights: Vec<&Weight> = match geometry {
        Geometry::Rows(rows) => rows.iter().filter_map(|row| row.weight.as_ref()).collect(),
        // A URDF's masses stand with its links.
        Geometry::Urdf(_) => Vec::new(),
    };
    if weights.is_empty() && payload.is_none() {
        return;
    }
    out.push(u8::from(!weights.is_empty()));
    weights.iter().for_each(|weight| put_weight(out, weight));
    out.push(u8::from(payload.is_some()));
    payload.iter().for_each(|weight| put_weight(out, weight));
}

fn put_weight(out: &mut Vec<u8>, weight: &Weight) {
    let Weight { mass_kg, center_m, inertia_kg_m2: _ } = weight;
    put_number(out, *mass_kg);
    center_m.iter().for_each(|number| put_number(out, *number));
}

fn put_joint(out: &mut Vec<u8>, Joint { name, kind: _, limits, torque_nm_max: _ }: &Joint) {
    // The torque changes no setpoint's meaning: it says which motions a drive can follow.
    put_text(out, name);
    limits.position_rad.iter().for_each(|number| put_number(out, *number));
    for set in [&limits.motion, &limits.stop] {
        for number in [set.velocity_rad_s, set.acceleration_rad_s2, set.jerk_rad_s3] {
            put_number(out, number);
        }
    }
}

fn put_row(out: &mut Vec<u8>, row: &Row) {
    // Weights, capsules and kinds of joints come after all rows.
    let Row {
        kind,
        joint_kind: _,
        a_m,
        alpha_rad,
        d_m,
        theta_offset_rad,
        link_radius_m,
        capsules: _,
        weight: _,
    } = row;
    out.push(match kind {
        RowKind::Standard => 0,
        RowKind::Modified => 1,
    });
    for number in [a_m, alpha_rad, d_m, theta_offset_rad, link_radius_m] {
        put_number(out, *number);
    }
}

pub(crate) fn put_text(out: &mut Vec<u8>, text: &str) {
    put_count(out, text.len());
    out.extend_from_slice(text.as_bytes());
}

/// Counts here are at most a few thousand: names are short, joints few.
pub(crate) fn put_count(out: &mut Vec<u8>, count: usize) {
    out.extend_from_slice(&u32::try_from(count).unwrap_or(u32::MAX).to_le_bytes());
}

pub(crate) fn put_number(out: &mut Vec<u8>, number: f64) {
    // Adding zero turns -0.0 into 0.0 and changes nothing else.
    out.extend_from_slice(&(number + 0.0).to_bits().to_le_bytes());
}

#[cfg(test)]
mod tests {
    use crate::Robot;
    use std::path::Path;

    const TEXT: &str = "name = \"r\"\nallowed_contacts = [[\"base\", \"link2\"]]\n\
        [[joint]]\nname = \"a\"\nlink_radius_m = 0.0625\nposition_rad = [-1.5, 2.5]\n\
        dh = { a_m = 0.0, alpha_rad = 1.25, d_m = 0.375, theta_offset_rad = 0.125 }\n\
        motion = { velocity_rad_s = 3.5, acceleration_rad_s2 = 15.0, jerk_rad_s3 = 150.0 }\n\
        stop = { acceleration_rad_s2 = 30.0, jerk_rad_s3 = 600.0 }\n\
        [[joint]]\nname = \"b\"\nlink_radius_m = 0.0\nposition_rad = [-1.0, 1.0]\n\
        dh = { a_m = 0.5, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }\n\
        motion = { velocity_rad_s = 1.0, acceleration_rad_s2 = 2.0, jerk_rad_s3 = 4.0 }\n";

    fn digest(text: &str) -> String {
        Robot::from_toml(Path::new("r.toml"), text)
            .unwrap_or_else(|faults| panic!("{faults}\n{text}"))
            .digest_hex()
    }

    #[test]
    fn digest_changes_with_every_value_of_the_file() {
        let edits = [
            ("name = \"r\"", "name = \"s\""),
            ("name = \"a\"", "name = \"c\""),
            ("link_radius_m = 0.0625", "link_radius_m = 0.06250000000000001"),
            ("[-1.5, 2.5]", "[-1.5000000000000002, 2.5]"),
            ("[-1.5, 2.5]", "[-1.5, 2.5000000000000004]"),
            ("a_m = 0.0", "a_m = 5e-324"),
            ("alpha_rad = 1.25", "alpha_rad = -1.25"),
            ("d_m = 0.375", "d_m = 0.37500000000000006"),
            ("theta_offset_rad = 0.125", "theta_offset_rad = 0.25"),
            ("velocity_rad_s = 3.5", "velocity_rad_s = 3.25"),
            ("acceleration_rad_s2 = 15.0", "acceleration_rad_s2 = 15.5"),
            ("jerk_rad_s3 = 150.0", "jerk_rad_s3 = 151.0"),
            ("acceleration_rad_s2 = 30.0", "acceleration_rad_s2 = 31.0"),
            ("jerk_rad_s3 = 600.0", "jerk_rad_s3 = 601.0"),
            ("[[\"base\", \"link2\"]]", "[]"),
            ("[[\"base\", \"link2\"]]", "[[\"base\", \"link1\"]]"),
            ("a_m = 0.5", "a_m = 0.25"),
        ];
        let mut seen = vec![digest(TEXT)];
        for (from, to) in edits {
            let text = TEXT.replacen(from, to, 1);
            assert_ne!(text, TEXT, "{from:?} stands nowhere");
            let edited = digest(&text);
            assert!(!seen.contains(&edited), "{from:?} -> {to:?} leaves the digest as it was");
            seen.push(edited);
        }
        let massive = TEXT
            .replace("link_radius_m", "link_mass_kg = 2.0\nlink_center_m = [0.1, 0.0, 0.0]\nlink_radius_m");
        let payload = |mass: &str| {
            TEXT.replacen(
                "[[joint]]",
                &format!("[payload]\nmass_kg = {mass}\ncenter_m = [0, 0, 0]\n[[joint]]"),
                1,
            )
        };
        let heavier = [
            massive.clone(),
            massive.replacen("= 2.0", "= 2.5", 1),
            massive.replacen("[0.1, ", "[0.2, ", 1),
            payload("1.0"),
            payload("0.0"),
        ];
        for text in heavier {
            let edited = digest(&text);
            assert!(!seen.contains(&edited), "{text}");
            seen.push(edited);
        }
        let capsules = |radius: &str, to: &str| {
            let own = format!(
                "link_capsules = [{{ from_m = [0, 0, 0], to_m = [0, 0, {to}], radius_m = {radius} }}]"
            );
            TEXT.replacen("link_radius_m = 0.0\n", &format!("{own}\n"), 1)
        };
        let based =
            format!("base_capsules = [{{ from_m = [0, 0, 0], to_m = [0, 0, 0], radius_m = 0.1 }}]\n{TEXT}");
        for text in [capsules("0.1", "0.2"), capsules("0.11", "0.2"), capsules("0.1", "0.25"), based] {
            let edited = digest(&text);
            assert!(!seen.contains(&edited), "{text}");
            seen.push(edited);
        }
        let modified = digest(&TEXT.replace("dh = ", "mdh = "));
        let (head, tail) = TEXT.split_at(TEXT.rfind("[[joint]]").unwrap());
        let swapped = TEXT.replace("name = \"a\"", "name = \"x\"").replace("name = \"b\"", "name = \"a\"");
        let swapped = digest(&swapped.replace("name = \"x\"", "name = \"b\""));
        let longer = digest(&format!("{head}{tail}{}", tail.replace("name = \"b\"", "name = \"c\"")));
        for other in [modified, swapped, longer] {
            assert!(!seen.contains(&other));
            seen.push(other);
        }
    }

    #[test]
    fn digest_keeps_through_comments_order_of_keys_and_writing_of_numbers() {
        let edits = [
            ("name = \"r\"", "# A comment.\n\nname   =   'r'"),
            ("a_m = 0.0, alpha_rad = 1.25", "alpha_rad = 125e-2, a_m = -0.0"),
            ("d_m = 0.375", "d_m = +0.3750"),
            ("[-1.0, 1.0]", "[-1, 1]"),
            ("[[\"base\", \"link2\"]]", "[[\"link2\", \"base\"],]"),
            (
                "jerk_rad_s3 = 4.0 }\n",
                "jerk_rad_s3 = 4.0 }\nstop = { acceleration_rad_s2 = 4, jerk_rad_s3 = 16 }\n",
            ),
        ];
        let mut text = TEXT.to_owned();
        for (from, to) in edits {
            assert!(text.contains(from), "{from:?} stands nowhere");
            text = text.replacen(from, to, 1);
            assert_eq!(digest(&text), digest(TEXT), "{from:?} -> {to:?}");
        }
    }

    /// Goal: what only weighs proven motions against each other makes no trajectory file useless.
    #[test]
    fn digest_keeps_through_gravity_and_moments_of_inertia() {
        let massive =
            TEXT.replace("link_radius_m", "link_mass_kg = 2.0\nlink_center_m = [0.1, 0, 0]\nlink_radius_m");
        let spread =
            massive.replace("link_radius_m", "link_inertia_kg_m2 = [1, 1, 1, 0, 0, 0]\nlink_radius_m");
        let on_a_wall = spread.replacen("name", "gravity_m_s2 = [9.81, 0, 0]\nname", 1);
        for text in [spread, on_a_wall] {
            assert_eq!(digest(&text), digest(&massive), "{text}");
        }
    }

    /// Goal: planner and streamer compute torques by one model. The bytes are put together here a second time.
    #[test]
    fn digest_of_the_torque_model_changes_with_gravity_and_moments_of_inertia() {
        let robot = |text: &str| {
            Robot::from_toml(Path::new("r.toml"), text).unwrap_or_else(|faults| panic!("{faults}\n{text}"))
        };
        let payload =
            "[payload]\nmass_kg = 1.0\ncenter_m = [0, 0, 0]\ninertia_kg_m2 = [1, 1, 1, 0, 0, 0]\n[[joint]]";
        let massive = TEXT
            .replace("link_radius_m", "link_mass_kg = 2.0\nlink_center_m = [0.1, 0, 0]\nlink_radius_m")
            .replacen("[[joint]]", payload, 1);
        let spread =
            massive.replacen("link_radius_m", "link_inertia_kg_m2 = [1, 1, 1, 0, 0, 0]\nlink_radius_m", 1);
        let heavier = spread.replacen("mass_kg = 1.0", "mass_kg = 1.5", 1);
        let turned = spread.replacen("ia_kg_m2 = [1, 1, 1, 0,", "ia_kg_m2 = [1, 1, 1, 0.1,", 1);
        let on_a_wall = spread.replacen("name", "gravity_m_s2 = [9.81, 0, 0]\nname", 1);
        let mut seen = Vec::new();
        for text in [massive, spread.clone(), heavier, turned, on_a_wall] {
            let model = robot(&text).torque_model_digest;
            assert!(!seen.contains(&model), "{text}");
            seen.push(model);
        }
        let robot = robot(&spread);
        let mut bytes = b"taustream torque model 1".to_vec();
        bytes.extend(robot.digest);
        let moments = [[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], [0.0; 6], [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]].concat();
        for number in [0.0, 0.0, -9.806_65_f64].into_iter().chain(moments) {
            bytes.extend(number.to_le_bytes());
        }
        assert_eq!(robot.torque_model_digest, super::of_bytes(&bytes));
        assert_eq!(robot.message_digest, robot.digest, "a robot file alone commands no torque");
    }

    /// A file made by one version must be known to the next. The number was computed from the table in the header by
    /// other means (Python's struct and hashlib).
    #[test]
    fn digest_of_a_known_description_is_a_known_number() {
        assert_eq!(digest(TEXT), "69918f5e2cbd7a47b0c2f80f0ea37caeecc93f3357638f973b7bfb9cdafe4e6b");
    }
}
