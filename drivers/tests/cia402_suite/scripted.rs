//! A scripted CiA 402 drive.
//!
//! Written from the protocol tables alone, with bytes as bytes: it shares no encoder with the code under test.
use std::collections::BTreeMap;
use taustream_drivers::{CanFrame, CanId};

/// Statuswords of the table, with bits 4, 9 and so on as drives have them.
pub(crate) const SWITCH_ON_DISABLED: u16 = 0x0250;
pub(crate) const READY: u16 = 0x0231;
pub(crate) const SWITCHED_ON: u16 = 0x0233;
pub(crate) const ENABLED: u16 = 0x0237;
pub(crate) const QUICK_STOP: u16 = 0x0217;
pub(crate) const FAULT: u16 = 0x0218;
pub(crate) const FOLLOWS: u16 = 0x1000;

pub(crate) fn frame(id: u16, bytes: &[u8]) -> CanFrame {
    CanFrame::classic(CanId::standard(id), bytes)
}

pub(crate) fn hex(frame: &CanFrame) -> String {
    let bytes: Vec<String> = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:03X} {}", frame.id().raw(), bytes.join(" ")).trim_end().to_owned()
}

/// One drive that does what its script says and notes what it was sent.
pub(crate) struct Scripted {
    pub(crate) id: u8,
    /// 0x7F pre-operational, 0x05 operational, 0x04 stopped.
    pub(crate) nmt: u8,
    pub(crate) status: u16,
    pub(crate) position: i32,
    /// Width and value of objects that can be read.
    pub(crate) objects: BTreeMap<(u16, u8), (usize, u32)>,
    /// Objects that are refused, with the abort code.
    pub(crate) refused: BTreeMap<(u16, u8), u32>,
    /// Every write is refused with this code, when it is not 0.
    pub(crate) read_only: u32,
    /// What objects hold once they were written, in place of what was written.
    pub(crate) stuck: BTreeMap<(u16, u8), u32>,
    /// Objects that cannot be written.
    pub(crate) fixed: Vec<(u16, u8)>,
    /// A reset of its communication leaves its objects as they are.
    pub(crate) keeps: bool,
    /// The modes display follows the mode.
    pub(crate) shows_mode: bool,
    /// Bytes of the statusword in an SDO answer.
    pub(crate) status_bytes: usize,
    /// Sends and takes nothing.
    pub(crate) silent: bool,
    /// Follows the controlword through the state machine; otherwise `status` is the test's.
    pub(crate) responds: bool,
    /// Answers reads of four-byte objects by segments.
    pub(crate) segments: bool,
    /// Requests for this object are answered under the name of the next one.
    pub(crate) misnamed: Option<(u16, u8)>,
    /// Everything that it sends stands under the node id of another.
    pub(crate) answers_as: Option<u8>,
    /// Time that an SDO answer takes.
    pub(crate) answer_ms: u64,
    /// Answers on their way, with the time at which they come.
    late: Vec<(u64, CanFrame)>,
    ms: u64,
    pub(crate) control: u16,
    pub(crate) target: i32,
    pub(crate) seen: Vec<CanFrame>,
    latched: Option<(u16, i32)>,
    segment: Option<u32>,
    heartbeat_ms: u64,
    reset_seen: bool,
}

impl Scripted {
    pub(crate) fn new(id: u8) -> Self {
        let mut objects = BTreeMap::new();
        objects.insert((0x1000, 0), (4, 0x0002_0192));
        objects.insert((0x1018, 1), (4, 0x0000_0539));
        objects.insert((0x6502, 0), (4, 0x0000_0080));
        objects.insert((0x6061, 0), (1, 0));
        objects.insert((0x603F, 0), (2, 0x7305));
        Self {
            id,
            nmt: 0x7F,
            status: SWITCH_ON_DISABLED,
            position: 1_000 * i32::from(id),
            objects,
            refused: BTreeMap::new(),
            read_only: 0,
            stuck: BTreeMap::new(),
            fixed: Vec::new(),
            keeps: false,
            shows_mode: true,
            status_bytes: 2,
            silent: false,
            responds: true,
            segments: false,
            misnamed: None,
            answers_as: None,
            answer_ms: 0,
            late: Vec::new(),
            ms: 0,
            control: 0,
            target: 0,
            seen: Vec::new(),
            latched: None,
            segment: None,
            heartbeat_ms: 0,
            reset_seen: false,
        }
    }

    fn me(&self, base: u16) -> u16 {
        base + u16::from(self.id)
    }

    fn mine(&self, base: u16) -> u16 {
        base + u16::from(self.answers_as.unwrap_or(self.id))
    }

    pub(crate) fn take(&mut self, sent: &CanFrame, out: &mut Vec<CanFrame>) {
        if self.silent {
            return;
        }
        let id = u16::try_from(sent.id().raw()).unwrap();
        let data = sent.data();
        let mine = id == self.me(0x600) || id == self.me(0x200) || (id == 0 && data[1] == self.id);
        if mine {
            self.seen.push(*sent);
        }
        match id {
            0x000 if data[1] == self.id || data[1] == 0 => match data[0] {
                0x01 => self.nmt = 0x05,
                0x02 => self.nmt = 0x04,
                0x80 => self.nmt = 0x7F,
                _ => self.boot(out),
            },
            0x080 if self.nmt == 0x05 => self.sync(out),
            id if id == self.me(0x200) && self.nmt == 0x05 && data.len() == 6 => {
                let target = i32::from_le_bytes(data[2..6].try_into().unwrap());
                self.latched = Some((u16::from_le_bytes([data[0], data[1]]), target));
            }
            id if id == self.me(0x600) && self.nmt != 0x04 => {
                let mut answers = Vec::new();
                self.sdo(data, &mut answers);
                let due = self.ms + self.answer_ms;
                self.late.extend(answers.into_iter().map(|answer| (due, answer)));
                self.release(out);
            }
            _ => {}
        }
    }

    pub(crate) fn boot(&mut self, out: &mut Vec<CanFrame>) {
        self.nmt = 0x7F;
        self.heartbeat_ms = 0;
        // A reset of communication forgets what was written there.
        if self.read_only == 0 && !self.keeps {
            self.objects.retain(|(index, _), _| matches!(index, 0x1000 | 0x1018 | 0x2000..));
        }
        out.push(frame(self.mine(0x700), &[0x00]));
    }

    fn release(&mut self, out: &mut Vec<CanFrame>) {
        let ms = self.ms;
        out.extend(self.late.extract_if(.., |(due, _)| *due <= ms).map(|(_, answer)| answer));
    }

    pub(crate) fn tick(&mut self, ms: u64, out: &mut Vec<CanFrame>) {
        self.ms = ms;
        self.release(out);
        if self.heartbeat_ms > 0 && ms.is_multiple_of(self.heartbeat_ms) && !self.silent {
            out.push(frame(self.mine(0x700), &[self.nmt]));
        }
    }

    fn sync(&mut self, out: &mut Vec<CanFrame>) {
        if let Some((control, target)) = self.latched.take() {
            self.control = control;
            if self.responds {
                self.apply(control);
            }
            if self.status & 0x6F == 0x27 {
                self.target = target;
            }
        }
        let ([a, b], [c, d, e, f]) = (self.status.to_le_bytes(), self.position.to_le_bytes());
        out.push(frame(self.mine(0x180), &[a, b, c, d, e, f]));
    }

    fn apply(&mut self, control: u16) {
        let rising = control & 0x80 != 0 && !self.reset_seen;
        self.reset_seen = control & 0x80 != 0;
        self.status = match (self.status & 0x6F, control & 0x8F) {
            (0x08 | 0x28, _) if rising => SWITCH_ON_DISABLED,
            (0x08 | 0x28, _) => self.status,
            (_, word) if word & 0x02 == 0 => SWITCH_ON_DISABLED,
            (0x40 | 0x50 | 0x60 | 0x10 | 0x23 | 0x27, 0x06) => READY,
            (0x21 | 0x27, 0x07) => SWITCHED_ON,
            (0x23, 0x0F) => ENABLED | FOLLOWS,
            _ => self.status,
        };
    }

    fn sdo(&mut self, data: &[u8], out: &mut Vec<CanFrame>) {
        let reply = self.mine(0x580);
        let (index, sub) = (u16::from_le_bytes([data[1], data[2]]), data[3]);
        let number = u32::from_le_bytes(data[4..8].try_into().unwrap());
        let wrong = u8::from(self.misnamed == Some((index, sub)));
        let head = |command: u8| [command, data[1] + wrong, data[2], data[3]];
        let mut answer = |head: [u8; 4], number: u32| {
            out.push(frame(reply, &[head, number.to_le_bytes()].concat()));
        };
        if let Some(code) = self.refused.get(&(index, sub)) {
            return answer(head(0x80), *code);
        }
        if data[0] != 0x40 && self.fixed.contains(&(index, sub)) {
            return answer(head(0x80), 0x0601_0002);
        }
        match data[0] {
            0x40 => match self.read(index, sub) {
                Some((4, value)) if self.segments => {
                    self.segment = Some(value);
                    answer(head(0x41), 4);
                }
                Some((width, value)) => answer(head(0x43 | u8::try_from(4 - width).unwrap() << 2), value),
                None => answer(head(0x80), 0x0602_0000),
            },
            0x60 => {
                let [a, b, c, d] = self.segment.take().unwrap().to_le_bytes();
                out.push(frame(reply, &[0x07, a, b, c, d, 0, 0, 0]));
            }
            0x23 | 0x27 | 0x2B | 0x2F if self.read_only != 0 => answer(head(0x80), self.read_only),
            0x23 | 0x27 | 0x2B | 0x2F => {
                let width = 4 - usize::from(data[0] >> 2 & 3);
                let held = self.stuck.get(&(index, sub)).copied().unwrap_or(number);
                self.objects.insert((index, sub), (width, held));
                match (index, sub) {
                    (0x6060, 0) if self.shows_mode => drop(self.objects.insert((0x6061, 0), (1, number))),
                    (0x6040, 0) if self.responds => self.apply(u16::try_from(number).unwrap()),
                    (0x1017, 0) => self.heartbeat_ms = u64::from(number),
                    _ => {}
                }
                answer(head(0x60), 0);
            }
            _ => {}
        }
    }

    fn read(&self, index: u16, sub: u8) -> Option<(usize, u32)> {
        match (index, sub) {
            (0x6041, 0) => Some((self.status_bytes, 0xA5A5_0000 | u32::from(self.status))),
            (0x6064, 0) => Some((4, self.position.cast_unsigned())),
            other => self.objects.get(&other).copied(),
        }
    }
}
