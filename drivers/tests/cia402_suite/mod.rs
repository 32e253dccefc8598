//! A bench that runs the CiA 402 master against scripted drives, and the tests that need more than a scenario.
//!
//! Every cycle of every test also proves that encode and decode do not allocate.
use std::path::Path;
use std::sync::OnceLock;
use taustream_arm::Settings;
use taustream_drivers::codec::cia402::Cia402Driver;
use taustream_drivers::{
    CanFrame, CanId, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver, ServoStatus,
};
use taustream_motion::MAX_JOINTS;

mod as_they_are;
mod bring_up;
#[path = "../counting/mod.rs"]
mod counting;
mod encoding;
mod frames;
mod homing;
mod operation;
mod properties;
mod scripted;
mod sdo_client;

pub(crate) use counting::{CountingAllocator, allocations};
pub(crate) use scripted::{
    ENABLED, FAULT, FOLLOWS, QUICK_STOP, READY, SWITCH_ON_DISABLED, SWITCHED_ON, Scripted, frame, hex,
};

/// A master and its scripted drives; one step is one cycle of 1 ms.
pub(crate) struct Bench {
    pub(crate) settings: Settings,
    pub(crate) driver: Cia402Driver,
    pub(crate) drives: Vec<Scripted>,
    pub(crate) now: Nanos,
    pub(crate) ms: u64,
    pub(crate) drive_target: DriveTarget,
    pub(crate) commands: [JointCommand; MAX_JOINTS],
    /// Frames of the newest cycle.
    pub(crate) sent: Vec<CanFrame>,
    /// Statusword and position of the newest TPDO that the master was given, by drive.
    pub(crate) last_received: Vec<Option<(u16, i32)>>,
}

/// The settings of this suite with this many servos.
pub(crate) fn settings(servos: usize) -> Settings {
    // Reading the robot works out which links may touch: once is enough.
    static READ: OnceLock<Settings> = OnceLock::new();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cia402_suite/six_servos.toml");
    let mut settings = READ.get_or_init(|| Settings::load(&file).unwrap()).clone();
    settings.servos.truncate(servos);
    settings
}

impl Bench {
    /// Drives with the node ids of the settings.
    pub(crate) fn new(servos: usize) -> Self {
        Self::with(settings(servos))
    }

    pub(crate) fn with(settings: Settings) -> Self {
        let driver = Cia402Driver::new(&settings, 0).unwrap();
        let servos = settings.servos.len();
        let drives = settings.servos.iter().map(|servo| Scripted::new(servo.node_id)).collect();
        Self {
            settings,
            driver,
            drives,
            now: Nanos(7_000_000_000),
            ms: 0,
            drive_target: DriveTarget::Disabled,
            commands: [JointCommand::default(); MAX_JOINTS],
            sent: Vec::new(),
            last_received: vec![None; servos],
        }
    }

    pub(crate) fn step(&mut self) {
        let mut batch = FrameBatch::new();
        let Self { driver, now, drive_target, commands, .. } = self;
        let calls = allocations(|| driver.encode(*now, *drive_target, commands, &mut batch));
        assert_eq!(calls, 0, "encode allocated in cycle {}", self.ms);
        self.sent = batch.frames().to_vec();
        let mut replies = Vec::new();
        for drive in &mut self.drives {
            for frame in &self.sent {
                drive.take(frame, &mut replies);
            }
            drive.tick(self.ms, &mut replies);
        }
        for reply in &replies {
            self.decode(reply);
            for (last_received, drive) in self.last_received.iter_mut().zip(&self.drives) {
                *last_received = tpdo(reply, drive.id).or(*last_received);
            }
        }
        self.now.0 += 1_000_000;
        self.ms += 1;
    }

    /// Gives the master a frame, and holds it to its promise of no allocation.
    pub(crate) fn decode(&mut self, frame: &CanFrame) {
        let Self { driver, now, .. } = self;
        let calls = allocations(|| driver.decode(*now, frame));
        assert_eq!(calls, 0, "decode allocated on {frame:?}");
    }

    pub(crate) fn steps(&mut self, count: u64) {
        for _ in 0..count {
            self.step();
        }
    }

    pub(crate) fn status(&self, joint: usize) -> ServoStatus {
        self.driver.status(joint)
    }

    pub(crate) fn states(&self) -> Vec<DriveState> {
        (0..self.drives.len()).map(|joint| self.status(joint).state).collect()
    }

    /// Steps until every drive is in the state; fails after `most` cycles.
    pub(crate) fn until(&mut self, state: DriveState, most: u64) {
        for _ in 0..most {
            if self.states().iter().all(|other| *other == state) {
                return;
            }
            self.step();
        }
        let codes: Vec<String> = (0..self.drives.len())
            .map(|joint| format!("{:X?}", (self.status(joint).error_code, self.status(joint).refused_object)))
            .collect();
        panic!("not {state:?} after {most} cycles but {:?}, codes {codes:?}", self.states());
    }

    /// Sets the commands to where the joints are, as the streamer does before it enables.
    pub(crate) fn hold(&mut self) {
        for joint in 0..self.drives.len() {
            self.commands[joint].position_rad = self.status(joint).position_rad;
        }
    }

    /// All drives up, configured and energised.
    pub(crate) fn enabled(servos: usize) -> Self {
        let mut bench = Self::new(servos);
        bench.until(DriveState::Disabled, 2_000);
        bench.hold();
        bench.drive_target = DriveTarget::Enabled;
        bench.step();
        bench.until(DriveState::Enabled, 100);
        bench
    }

    /// Controlword and target of the newest cycle's RPDO to a drive.
    pub(crate) fn rpdo(&self, drive: usize) -> Option<(u16, i32)> {
        let id = u32::from(0x200 + u16::from(self.drives[drive].id));
        let frame = self.sent.iter().find(|frame| frame.id().raw() == id)?;
        let data = frame.data();
        let target = i32::from_le_bytes(data[2..6].try_into().unwrap());
        Some((u16::from_le_bytes([data[0], data[1]]), target))
    }
}

fn tpdo(frame: &CanFrame, node: u8) -> Option<(u16, i32)> {
    if frame.id().raw() != 0x180 + u32::from(node) {
        return None;
    }
    let data = frame.data();
    Some((u16::from_le_bytes([data[0], data[1]]), i32::from_le_bytes(data[2..6].try_into().ok()?)))
}

/// Random numbers from a numbered seed (splitmix64).
pub(crate) struct SeededRng(u64);

impl SeededRng {
    pub(crate) fn from_seed(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5DEE_CE66)
    }
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    pub(crate) fn word(&mut self) -> u16 {
        u16::try_from(self.next() >> 48).unwrap()
    }
    pub(crate) fn below(&mut self, count: u64) -> usize {
        usize::try_from(self.next() % count).unwrap()
    }
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(u32::try_from(self.next() >> 32).unwrap()) / f64::from(u32::MAX)
    }
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.within(0.0, 1.0) < probability
    }
    /// A frame that is often nearly right: ids of the protocol, objects of the plan, any length.
    pub(crate) fn frame(&mut self) -> CanFrame {
        let bases = [0x000, 0x080, 0x180, 0x200, 0x280, 0x580, 0x580, 0x580, 0x600, 0x700, 0x700, 0x7FF];
        let node = u16::try_from(self.below(5)).unwrap();
        let id = if self.chance(0.9) { bases[self.below(12)] + node } else { self.word() };
        let mut bytes = self.next().to_le_bytes();
        if self.chance(0.5) {
            bytes[0] = [0x43, 0x4B, 0x4F, 0x60, 0x80, 0x41, 0x00, 0x05, 0x7F, 0x37][self.below(10)];
            bytes[1..4].copy_from_slice(
                &[[0x41, 0x60, 0], [0x61, 0x60, 0], [0, 0x14, 1], [0x40, 0x60, 0]][self.below(4)],
            );
        }
        let len = if self.chance(0.7) { [1, 6, 8][self.below(3)] } else { self.below(9) };
        match self.below(20) {
            0 => CanFrame::fd(CanId::standard(id), &bytes),
            1 => CanFrame::classic(
                CanId::from_raw(u32::from(self.word()) << 16 | u32::from(self.word())),
                &bytes[..len],
            ),
            _ => CanFrame::classic(CanId::standard(id), &bytes[..len]),
        }
    }
}
