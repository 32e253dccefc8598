//! CAN frames, classic and FD, in one fixed-size type.
use taustream_motion::MAX_JOINTS;

/// Flag of a 29-bit id in [`CanId`].
const EXTENDED: u32 = 0x8000_0000;
/// Flag of a remote request in [`CanId`].
const REMOTE: u32 = 0x4000_0000;
/// Flag of an error frame in [`CanId`].
const ERROR: u32 = 0x2000_0000;
/// Largest 11-bit id.
const STANDARD_MAX: u32 = 0x7FF;
/// Largest 29-bit id.
const EXTENDED_MAX: u32 = 0x1FFF_FFFF;

/// A CAN id with its kind, laid out as `canid_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct CanId(u32);

impl CanId {
    /// An 11-bit id; higher bits are cut off.
    #[must_use]
    pub const fn standard(id: u16) -> Self {
        Self(id as u32 & STANDARD_MAX)
    }
    /// A 29-bit id; higher bits are cut off.
    #[must_use]
    pub const fn extended(id: u32) -> Self {
        Self(id & EXTENDED_MAX | EXTENDED)
    }
    /// A remote request under this 11-bit id; its frame has no data.
    #[must_use]
    pub const fn standard_remote(id: u16) -> Self {
        Self(id as u32 & STANDARD_MAX | REMOTE)
    }
    /// From the kernel's representation.
    #[must_use]
    pub const fn from_raw(raw: u32) -> Self {
        Self(raw)
    }
    /// As the kernel represents it.
    #[must_use]
    pub const fn raw(self) -> u32 {
        self.0
    }
    /// The 11-bit id of a standard data frame; `None` for extended, remote and error frames, and for an id that no
    /// kernel gives (more than 11 bits without the flag): its low bits must not be taken for an id.
    #[must_use]
    pub const fn as_standard_data(self) -> Option<u16> {
        if self.0 <= STANDARD_MAX { Some((self.0 & STANDARD_MAX) as u16) } else { None }
    }
    /// The 29-bit id of an extended data frame; `None` for standard, remote and error frames.
    #[must_use]
    pub const fn as_extended_data(self) -> Option<u32> {
        let flags = self.0 & !EXTENDED_MAX;
        if flags == EXTENDED { Some(self.0 & EXTENDED_MAX) } else { None }
    }
    /// The 11-bit id of a remote request; `None` for every other frame.
    #[must_use]
    pub const fn as_standard_remote(self) -> Option<u16> {
        let id = self.0 & !REMOTE;
        if self.is_remote() && id <= STANDARD_MAX { Some((id & STANDARD_MAX) as u16) } else { None }
    }
    /// True for an error frame of the kernel.
    #[must_use]
    pub const fn is_error(self) -> bool {
        self.0 & ERROR != 0
    }
    /// True for a remote request.
    #[must_use]
    pub const fn is_remote(self) -> bool {
        self.0 & REMOTE != 0
    }
}

/// One frame, laid out as `canfd_frame`; a classic frame uses the first 8 data bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(8))]
pub struct CanFrame {
    id: CanId,
    len: u8,
    flags: u8,
    reserved: [u8; 2],
    data: [u8; 64],
}

/// Size of a classic frame at the kernel's interface.
pub const CLASSIC_SIZE: usize = 16;
/// Size of an FD frame at the kernel's interface.
pub const FD_SIZE: usize = 72;
/// `CANFD_FDF`: the frame is an FD frame.
const FDF: u8 = 0x04;
/// `CANFD_BRS`: its data phase has the other bit rate.
const BRS: u8 = 0x01;

impl CanFrame {
    /// A classic data frame; bytes beyond 8 are cut off.
    #[must_use]
    pub fn classic(id: CanId, bytes: &[u8]) -> Self {
        Self::with(id, bytes, 8, 0)
    }
    /// An FD frame with bit rate switch; bytes beyond 64 are cut off.
    #[must_use]
    pub fn fd(id: CanId, bytes: &[u8]) -> Self {
        Self::with(id, bytes, 64, FDF | BRS)
    }
    fn with(id: CanId, bytes: &[u8], most: usize, flags: u8) -> Self {
        let mut frame = Self { id, len: 0, flags, reserved: [0; 2], data: [0; 64] };
        for (slot, byte) in frame.data.iter_mut().zip(bytes.iter().take(most)) {
            *slot = *byte;
            frame.len += 1;
        }
        frame
    }
    /// Its id.
    #[must_use]
    pub fn id(&self) -> CanId {
        self.id
    }
    /// Its data; a length beyond the kind's largest (it came from outside) is cut off.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        let most = if self.is_fd() { 64 } else { 8 };
        self.data.get(..usize::from(self.len).min(most)).unwrap_or(&[])
    }
    /// True for an FD frame whose data phase has a bit rate of its own.
    #[must_use]
    pub fn switches_bit_rate(&self) -> bool {
        self.is_fd() && self.flags & BRS != 0
    }
    /// True for an FD frame.
    #[must_use]
    pub fn is_fd(&self) -> bool {
        self.flags & FDF != 0
    }
    /// Makes a slot of which a socket filled `size` bytes a well-formed frame; false when no kind of frame has
    /// that size. What the sender left in unused bytes is zeroed: equal frames must compare equal.
    pub(crate) fn settle(&mut self, size: usize) -> bool {
        let most = match size {
            CLASSIC_SIZE => {
                self.flags = 0;
                8
            }
            FD_SIZE => {
                self.flags |= FDF;
                64
            }
            _ => return false,
        };
        self.len = self.len.min(most);
        self.reserved = [0; 2];
        if let Some(unused) = self.data.get_mut(usize::from(self.len)..) {
            unused.fill(0);
        }
        true
    }
    /// Bytes at the kernel's interface.
    #[must_use]
    pub fn wire_size(&self) -> usize {
        if self.is_fd() { FD_SIZE } else { CLASSIC_SIZE }
    }
}

impl Default for CanFrame {
    fn default() -> Self {
        Self::classic(CanId::standard(0), &[])
    }
}

const _: () = assert!(size_of::<CanFrame>() == FD_SIZE);

/// Most frames that one bus sends, or hands over, in one cycle.
pub const BATCH_MAX: usize = 64;

/// Joints of an arm, by index.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointSet(u16);

impl JointSet {
    /// No joint.
    pub const EMPTY: Self = Self(0);

    /// One joint; none for an index beyond [`MAX_JOINTS`].
    #[must_use]
    pub const fn of(joint: usize) -> Self {
        if joint < MAX_JOINTS { Self(1 << joint) } else { Self::EMPTY }
    }
    /// The joints of both.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
    /// Whether a joint is in it.
    #[must_use]
    pub const fn contains(self, joint: usize) -> bool {
        self.0 & Self::of(joint).0 != 0
    }
}

const _: () = assert!(MAX_JOINTS <= 16, "a joint set has a bit for each joint");

/// The frames of one cycle on one bus, in sending order. Fixed capacity, no allocation.
#[derive(Clone, Debug)]
pub struct FrameBatch {
    frames: [CanFrame; BATCH_MAX],
    /// The joints whose setpoints each frame holds.
    joints: [JointSet; BATCH_MAX],
    count: usize,
    more: bool,
}

impl FrameBatch {
    /// Empty.
    #[must_use]
    pub fn new() -> Self {
        Self {
            frames: [CanFrame::default(); BATCH_MAX],
            joints: [JointSet::EMPTY; BATCH_MAX],
            count: 0,
            more: false,
        }
    }
    /// Clears all frames.
    pub fn clear(&mut self) {
        (self.count, self.more) = (0, false);
    }
    /// Appends a frame without a setpoint; false when the batch is full.
    pub fn push(&mut self, frame: CanFrame) -> bool {
        self.push_setpoints(frame, JointSet::EMPTY)
    }
    /// Appends a frame that holds the setpoints of `joints`; false when the batch is full.
    pub fn push_setpoints(&mut self, frame: CanFrame, joints: JointSet) -> bool {
        let at = self.count;
        let (Some(slot), Some(set)) = (self.frames.get_mut(at), self.joints.get_mut(at)) else {
            return false;
        };
        (*slot, *set) = (frame, joints);
        self.count += 1;
        true
    }
    /// The joints whose setpoints are in the first `count` frames.
    #[must_use]
    pub fn setpoints_in(&self, count: usize) -> JointSet {
        let joints = self.joints.iter().take(count.min(self.count));
        joints.fold(JointSet::EMPTY, |all, set| all.union(*set))
    }
    /// The frames.
    #[must_use]
    pub fn frames(&self) -> &[CanFrame] {
        self.frames.get(..self.count).unwrap_or(&[])
    }
    /// All slots, for a link that fills them itself and then calls [`Self::set_count`].
    pub fn slots(&mut self) -> &mut [CanFrame; BATCH_MAX] {
        &mut self.frames
    }
    /// How many slots hold a frame; more than fit are cut off.
    pub fn set_count(&mut self, count: usize) {
        self.count = count.min(BATCH_MAX);
    }
    /// True when the link that filled it may hold more: it took as much as one call takes.
    #[must_use]
    pub fn may_have_more(&self) -> bool {
        self.more
    }
    /// For a link: whether it may hold more.
    pub fn set_more(&mut self, more: bool) {
        self.more = more;
    }
}

impl Default for FrameBatch {
    fn default() -> Self {
        Self::new()
    }
}
