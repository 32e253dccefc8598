//! The robot digest: a hash over everything that changes what a setpoint means.
//!
//! A trajectory made for one description must not run on another, and a description must not change its digest
//! because somebody moved a comment. So the hash is SHA-256 over canonical bytes of the checked values, not over the
//! file. What is in it and why, and why servo bindings are not: docs/adr/0002-robot-digest.md.
//!
//! The bytes, integers and floats little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 24 | the ASCII text `taustream robot digest 1` |
//! | string | name of the robot |
//! | u32 | number of joints |
//! | per joint, base to tip: | |
//! | string | name of the joint |
//! | u8 | kind of row: 0 standard (`dh`), 1 modified (`mdh`) |
//! | 4 x f64 | a_m, alpha_rad, d_m, theta_offset_rad |
//! | f64 | link_radius_m |
//! | 2 x f64 | lowest and highest position_rad |
//! | 3 x f64 | motion: velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 |
//! | 3 x f64 | stop: the same (with the defaults filled in) |
//! | then: | |
//! | u32 | number of pairs in `allowed_contacts` |
//! | 2 x u32 | per pair: indices of the links, lower first, pairs in rising order |
//!
//! A string is its length in bytes as u32, then its UTF-8 bytes. An f64 is its IEEE 754 bits; -0.0 is written as 0.0,
//! because both mean the same.
use crate::description::{Description, JointRow, RowKind};
use sha2::{Digest, Sha256};

const HEADER: &[u8; 24] = b"taustream robot digest 1";

/// The digest of a description.
pub(crate) fn of(description: &Description) -> [u8; 32] {
    Sha256::digest(bytes(description)).into()
}

fn bytes(description: &Description) -> Vec<u8> {
    let mut out = HEADER.to_vec();
    put_text(&mut out, &description.name);
    put_count(&mut out, description.joints.len());
    for joint in &description.joints {
        put_joint(&mut out, joint);
    }
    put_count(&mut out, description.allowed_contacts.len());
    for (first, second) in &description.allowed_contacts {
        put_count(&mut out, *first);
        put_count(&mut out, *second);
    }
    out
}

fn put_joint(out: &mut Vec<u8>, joint: &JointRow) {
    // Taken apart, so that a new field cannot be forgotten here without the compiler saying so.
    let JointRow { name, kind, a_m, alpha_rad, d_m, theta_offset_rad, link_radius_m, limits } = joint;
    put_text(out, name);
    out.push(match kind {
        RowKind::Standard => 0,
        RowKind::Modified => 1,
    });
    let [low, high] = limits.position_rad;
    for number in [a_m, alpha_rad, d_m, theta_offset_rad, link_radius_m, &low, &high] {
        put_number(out, *number);
    }
    for set in [&limits.motion, &limits.stop] {
        for number in [set.velocity_rad_s, set.acceleration_rad_s2, set.jerk_rad_s3] {
            put_number(out, number);
        }
    }
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    put_count(out, text.len());
    out.extend_from_slice(text.as_bytes());
}

/// Counts here are at most a few thousand: names are short, joints few.
fn put_count(out: &mut Vec<u8>, count: usize) {
    out.extend_from_slice(&u32::try_from(count).unwrap_or(u32::MAX).to_le_bytes());
}

fn put_number(out: &mut Vec<u8>, number: f64) {
    // Adding zero turns -0.0 into 0.0 and changes nothing else.
    out.extend_from_slice(&(number + 0.0).to_bits().to_le_bytes());
}
