//! Counts in messages: "1 stroke", "2 strokes".
use std::fmt::Display;

/// A count with its noun, in the plural unless the count is 1.
#[must_use]
pub fn counted<N: Copy + Display + PartialEq + From<u8>>(count: N, noun: &str) -> String {
    let ending = if count == N::from(1) {
        ""
    } else if ["s", "x", "sh", "ch"].iter().any(|end| noun.ends_with(end)) {
        "es"
    } else {
        "s"
    };
    format!("{count} {noun}{ending}")
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn counted_noun_is_singular_for_one_alone() {
        assert_eq!(counted(1_usize, "stroke"), "1 stroke");
        assert_eq!(counted(0_u32, "stroke"), "0 strokes");
        assert_eq!(counted(2_u64, "bus"), "2 buses");
        assert_eq!(counted(3_usize, "mesh"), "3 meshes");
        assert_eq!(counted(1_usize, "box"), "1 box");
    }
}
