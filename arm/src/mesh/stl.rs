//! STL files, binary and ASCII.
//!
//! An ASCII file may hold any number of `solid` .. `endsolid` blocks; all of their facets count. Every line is understood or
//! refused: a facet that is skipped would be an obstacle that nobody sees.
use super::{Refusal, Triangles};
use crate::document::shown;

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A binary file's length follows from its count, and that decides the format: the customary test, whether it begins
/// with `solid`, takes many binary files for text.
pub(super) fn read(bytes: &[u8]) -> Result<Triangles, Refusal> {
    let count = bytes.get(80..HEADER_BYTES).and_then(|c| c.try_into().ok()).map_or(0, u32::from_le_bytes);
    let binary_bytes = HEADER_BYTES as u64 + u64::from(count) * TRIANGLE_BYTES as u64;
    if bytes.len() as u64 == binary_bytes {
        return Ok(read_binary(bytes.get(HEADER_BYTES..).unwrap_or_default()));
    }
    let text = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let is_solid = text.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // A binary file that was cut off may begin with that word too, but no text has bytes of zero.
    if is_solid && !text.contains(&0) {
        // Names of solids are in any encoding, and mean nothing.
        return read_ascii(&String::from_utf8_lossy(text));
    }
    let value = format!("is {} bytes long, and its header means {binary_bytes}", bytes.len());
    Err((value, "a binary STL file of that length, or an ASCII one that begins with `solid`".to_owned()))
}

fn read_binary(facets: &[u8]) -> Triangles {
    let mut triangle_soup = Triangles::default();
    for facet in facets.as_chunks::<TRIANGLE_BYTES>().0 {
        // The normal before the corners and the attribute behind them mean nothing here.
        let floats = facet.get(12..48).unwrap_or_default().as_chunks::<4>().0;
        let mut corners = [[0.0; 3]; 3];
        for (slot, bytes) in corners.as_flattened_mut().iter_mut().zip(floats) {
            *slot = f64::from(f32::from_le_bytes(*bytes));
        }
        triangle_soup.push(corners);
    }
    triangle_soup
}

/// Where the reader stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Between solids.
    Outside,
    Solid,
    Facet,
    Loop,
    /// Behind the loop of a facet.
    LoopDone,
}

fn read_ascii(text: &str) -> Result<Triangles, Refusal> {
    let mut triangle_soup = Triangles::default();
    let (mut place, mut corners) = (Place::Outside, Vec::with_capacity(3));
    for (i, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next() else { continue };
        let word = word.to_ascii_lowercase();
        let wrong =
            |expected: &str| Err((format!("line {}: {}", i + 1, shown(line.trim())), expected.to_owned()));
        place = match (place, word.as_str()) {
            (Place::Outside, "solid") | (Place::LoopDone, "endfacet") => Place::Solid,
            (Place::Solid, "endsolid") => Place::Outside,
            (Place::Solid, "facet") => Place::Facet,
            (Place::Facet, "outer") => Place::Loop,
            (Place::Loop, "vertex") => {
                let Some(corner) = corner(words) else {
                    return wrong("vertex X Y Z with three finite numbers");
                };
                corners.push(corner);
                Place::Loop
            }
            (Place::Loop, "endloop") => {
                let Ok(facet) = <[[f64; 3]; 3]>::try_from(std::mem::take(&mut corners)) else {
                    return wrong("three vertices in each facet");
                };
                triangle_soup.push(facet);
                Place::LoopDone
            }
            (Place::Outside, _) => return wrong("`solid`: an ASCII STL file is a list of solids"),
            (Place::Solid, _) => return wrong("`facet normal` or `endsolid`"),
            (Place::Facet, _) => return wrong("`outer loop`"),
            (Place::Loop, _) => return wrong("`vertex` or `endloop`"),
            (Place::LoopDone, _) => return wrong("`endfacet`"),
        };
    }
    if place == Place::Outside {
        return Ok(triangle_soup);
    }
    let value = format!("ends inside a solid, after {} facets", triangle_soup.triangles.len());
    Err((value, "an ASCII STL file with an `endsolid` for each `solid`; this one was cut off".to_owned()))
}

fn corner<'w>(words: impl Iterator<Item = &'w str>) -> Option<[f64; 3]> {
    // In the precision of the binary format, so that a mesh is the same in both.
    let numbers: Option<Vec<f64>> = words.map(|word| Some(f64::from(word.parse::<f32>().ok()?))).collect();
    let corner: [f64; 3] = numbers?.try_into().ok()?;
    corner.iter().all(|number| number.is_finite()).then_some(corner)
}
