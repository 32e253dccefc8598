//! Error codes, refused objects and status words of any protocol as sentences.
use crate::bring_up::{Refusal, fault};
use crate::protocols::{self, REGISTRY};

/// Which object or parameter was refused and why.
#[must_use]
pub fn explain_refusal(refusal: &Refusal) -> String {
    explain_refusal_on(refusal, true)
}

/// The same, on a link that has a cable or none.
#[must_use]
pub fn explain_refusal_on(refusal: &Refusal, has_cable: bool) -> String {
    if refusal.object == 0 {
        return explain_on(refusal.code, has_cable);
    }
    match protocols::of_object(refusal.object) {
        Some(words) => (words.explain_refusal)(refusal),
        None => fault::explain_refusal(refusal, has_cable),
    }
}

/// The sentence for any code that [`crate::ServoStatus::error_code`] may hold.
#[must_use]
pub fn explain(code: u32) -> String {
    explain_on(code, true)
}

/// The same, on a link that has a cable or none.
#[must_use]
pub fn explain_on(code: u32, has_cable: bool) -> String {
    match protocols::of_code(code) {
        Some(words) => (words.explain)(code, has_cable),
        None => fault::explain(code, has_cable),
    }
}

/// A servo's status word as text, by the name of its protocol: "0x0218 fault".
#[must_use]
pub fn explain_status(protocol: Option<&str>, word: u32) -> String {
    let known = REGISTRY.iter().find(|known| Some(known.name) == protocol);
    known.map_or_else(|| format!("0x{word:04X}"), |known| (known.status)(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_words_are_explained_by_protocol() {
        for (protocol, word, expected) in [
            (Some("cia402"), 0x0250, "0x0250 switch on disabled"),
            (Some("cia402"), 0x12B7, "0x12B7 operation enabled, warning"),
            (Some("cia402"), 0x0218, "0x0218 fault"),
            (Some("damiao"), 0x1E_1E01, "1 enabled"),
            (Some("damiao"), 0x1E_1E09, "9 under-voltage"),
            (None, 0x0218, "0x0218"),
        ] {
            assert_eq!(explain_status(protocol, word), expected);
        }
    }

    #[test]
    fn no_two_protocols_share_codes() {
        let mut codes: Vec<u16> =
            REGISTRY.iter().filter_map(|known| known.words.as_ref()).map(|w| w.codes).collect();
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), REGISTRY.len() - 1, "all but CiA 402 have codes of their own");
        assert!(codes.iter().all(|codes| (2..0x100).contains(codes)), "{codes:?}");
    }
}
