//! What links keep from each other: one margin for all pairs, and pairs with one of their own.
//!
//! Models, zeros and sags are wrong by millimetres, so two links whose models pass at a tenth of a millimetre may touch. A
//! margin of 0 is allowed for a pair that must come close; it then has to keep more than 0 m.
use crate::description::{pair_of, two_links_of};
use crate::reader::{Bounds, Table};

/// Where the robot file gives none (m).
pub const LINK_MARGIN_M_DEFAULT: f64 = 0.003;

/// More than the length of a large arm's link is a slip of the unit.
const MARGIN_M: Bounds = Bounds::within(0.0, 0.5, "m");

/// The margins between the links of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkMargins {
    /// Of every pair that has none of its own (m).
    pub all_m: f64,
    /// Pairs with a margin of their own, lower link first, sorted, each once (m).
    pub pairs: Vec<((usize, usize), f64)>,
}

impl Default for LinkMargins {
    fn default() -> Self {
        Self { all_m: LINK_MARGIN_M_DEFAULT, pairs: Vec::new() }
    }
}

impl LinkMargins {
    /// The margin of a pair, in either order (m).
    #[must_use]
    pub fn of(&self, a: usize, b: usize) -> f64 {
        let pair = (a.min(b), a.max(b));
        self.pairs.iter().find(|(links, _)| *links == pair).map_or(self.all_m, |(_, margin_m)| *margin_m)
    }

    pub(crate) fn set(&mut self, pair: (usize, usize), margin_m: f64) {
        self.pairs.retain(|(links, _)| *links != pair);
        self.pairs.push((pair, margin_m));
        self.pairs.sort_unstable_by_key(|(links, _)| *links);
    }

    /// Reads `link_margin_m` and every `[[link_margin]]`; the links are not known after a fault in the geometry.
    pub(crate) fn read(top: &mut Table<'_>, links: Option<&[String]>) -> Option<Self> {
        let all_m = top.number_or("link_margin_m", LINK_MARGIN_M_DEFAULT, &MARGIN_M);
        let mut pairs: Vec<((usize, usize), f64)> = Vec::new();
        for mut table in top.tables("link_margin") {
            let margin_m = table.number("margin_m", &MARGIN_M);
            let expected = links.map_or_else(|| "two different links".to_owned(), two_links_of);
            let Some(node) = table.take("links") else {
                table.fault("links", "missing", &expected);
                table.done();
                continue;
            };
            let pair = links.map(|links| pair_of(&node, links));
            match pair {
                Some(None) => table.fault("links", &node.to_string(), &expected),
                Some(Some(pair)) if pairs.iter().any(|(links, _)| *links == pair) => {
                    table.fault("links", &node.to_string(), "each pair once");
                }
                Some(Some(pair)) => pairs.extend(margin_m.map(|margin_m| (pair, margin_m))),
                None => {}
            }
            table.done();
        }
        pairs.sort_unstable_by_key(|(links, _)| *links);
        Some(Self { all_m: all_m?, pairs })
    }
}

#[cfg(test)]
mod tests {
    use crate::Robot;
    use std::path::Path;

    fn ur5(keys: &str) -> Result<Robot, String> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
        let text = std::fs::read_to_string(file).unwrap();
        // Keys of the top stand before the first table, tables behind the last.
        let (top, tables) =
            keys.split_once("[[").map_or((keys, String::new()), |(a, b)| (a, format!("[[{b}")));
        Robot::from_toml(Path::new("r.toml"), &format!("{top}\n{text}\n{tables}")).map_err(|f| f.to_string())
    }

    #[test]
    fn margins_of_pairs_replace_the_one_of_all_in_both_orders() {
        let plain = ur5("").unwrap();
        assert!((plain.margins.of(1, 4) - 0.003).abs() < 1e-12);
        let stated =
            ur5("link_margin_m = 0.01\n[[link_margin]]\nlinks = [\"link4\", \"link1\"]\nmargin_m = 0\n")
                .unwrap();
        assert!((stated.margins.of(2, 5) - 0.01).abs() < 1e-12);
        assert!(stated.margins.of(1, 4) + stated.margins.of(4, 1) < 1e-12);
        assert_ne!(plain.digest, stated.digest, "what may move where is another robot");
        assert_eq!(plain.digest, ur5("link_margin_m = 0.003\n").unwrap().digest, "the default may be stated");
    }

    #[test]
    fn margins_that_are_none_are_refused_with_key_and_remedy() {
        let pair =
            |links: &str, margin: &str| format!("[[link_margin]]\nlinks = {links}\nmargin_m = {margin}\n");
        let known = pair("[\"link1\", \"link4\"]", "0.001");
        let table: [(String, &str); 8] = [
            ("link_margin_m = -0.001\n".into(), "link_margin_m"),
            ("link_margin_m = 3\n".into(), "link_margin_m"),
            ("link_margin_m = nan\n".into(), "link_margin_m"),
            (pair("[\"link1\", \"nobody\"]", "0.001"), "two different links of"),
            (pair("[\"link1\", \"link1\"]", "0.001"), "two different links of"),
            (pair("[\"link1\"]", "0.001"), "two different links of"),
            (pair("[\"link1\", \"link4\"]", "-1"), "link_margin[0].margin_m"),
            (format!("{known}{known}"), "each pair once"),
        ];
        for (keys, words) in table {
            let faults = ur5(&keys).unwrap_err();
            assert!(faults.contains(words), "{keys}: {faults}");
        }
        let extra = ur5(&format!("{known}margin_mm = 3\n")).unwrap_err();
        assert!(extra.contains("margin_mm"), "{extra}");
    }
}
