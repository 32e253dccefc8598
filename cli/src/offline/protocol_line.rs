//! What `check` prints of a servo that is its protocol's own.
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt;
use taustream_arm::Protocol;

/// A protocol's own numbers, under the keys of the settings file in JSON and as a sentence on the screen.
#[derive(Debug)]
pub(super) struct ProtocolLine(pub(super) Protocol);

impl Serialize for ProtocolLine {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, value) in self.0.entries() {
            map.serialize_entry(key, &value)?;
        }
        map.end()
    }
}

impl fmt::Display for ProtocolLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.sentence())
    }
}
