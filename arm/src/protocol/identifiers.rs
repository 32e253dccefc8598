//! The CAN identifiers with which the servos of a bus send and receive.
//!
//! Two servos that send under one identifier destroy each other's frames, and one that receives what another sends takes
//! feedback for commands. Neither shows on a desk with one motor, so it is refused in the settings.

/// Identifiers that a servo uses for one purpose: those that agree with `id` in the bits of `mask`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Use {
    id: u32,
    mask: u32,
    /// 29 bits instead of 11.
    is_extended: bool,
    /// What for.
    pub(crate) what: &'static str,
    /// The key that decides it.
    pub(crate) key: &'static str,
    /// Every servo of the protocol uses it in common.
    is_shared: bool,
}

impl Use {
    /// One 11-bit identifier.
    pub(crate) const fn standard(id: u16, what: &'static str, key: &'static str) -> Self {
        Self { id: id as u32, mask: 0x7FF, is_extended: false, what, key, is_shared: false }
    }
    /// The 29-bit identifiers that agree with the first number in the bits of the second.
    pub(crate) const fn extended([id, mask]: [u32; 2], what: &'static str, key: &'static str) -> Self {
        Self { id, mask, is_extended: true, what, key, is_shared: false }
    }
    /// The same, in common with every servo of the protocol.
    pub(crate) const fn shared(self) -> Self {
        Self { is_shared: true, ..self }
    }
    /// True when both cannot be on one bus.
    pub(crate) fn clashes(&self, other: &Self) -> bool {
        let meet =
            self.is_extended == other.is_extended && (self.id ^ other.id) & self.mask & other.mask == 0;
        meet && !(self.is_shared && other.is_shared && self.what == other.what)
    }
    /// The identifier as people write it.
    pub(crate) fn number(&self) -> String {
        if self.is_extended { format!("0x{:08X}", self.id) } else { format!("0x{:03X}", self.id) }
    }
}
