//! A drive on a bench, with frames written out by hand, byte by byte, so that a mistake in the shared encoders shows.
use taustream_drivers::sim::{
    Drive, DriveParameters, DriveQuirks, LoopParameters, PlantParameters, PowerState,
};
use taustream_drivers::{CanFrame, CanId, Nanos};

pub(crate) const NODE: u8 = 3;
/// Counts a radian of the test drive: sign -1, gear 100, 4096 counts.
pub(crate) const COUNTS_PER_RAD: f64 = -100.0 * 4096.0 / std::f64::consts::TAU;
pub(crate) const ZERO_RAD: f64 = 0.25;
pub(crate) const START_RAD: f64 = 0.4;

pub(crate) fn parameters() -> DriveParameters {
    DriveParameters {
        node_id: NODE,
        sign: -1.0,
        gear_ratio: 100.0,
        counts_per_rev: 4096.0,
        zero_offset_rad: ZERO_RAD,
        home_offset_counts: 0,
        dummy_mapping: true,
        start_rad: START_RAD,
        plant: PlantParameters {
            inertia_kg_m2: 1.0,
            viscous_nm_s_rad: 1.0,
            coulomb_nm: 1.0,
            gravity_nm: 20.0,
            gravity_level_rad: 0.0,
            torque_nm_max: 120.0,
            speed_rad_s_max: 4.0,
            brake: true,
            brake_delay_s: 0.02,
        },
        loops: LoopParameters {
            position_gain_1_s: 60.0,
            velocity_bandwidth_rad_s: 400.0,
            integral_time_s: 0.02,
            torque_lag_s: 0.3e-3,
            extrapolation_s: 0.0,
        },
        following_window_rad: 0.3,
        following_timeout_ms: 50,
        soft_limit_rad: [-3.0, 3.0],
        brake: None,
        rated_nm: None,
        slow_rad_s2: 15.0,
        quick_rad_s2: 30.0,
        watchdog_ms: 100,
        reaction: taustream_arm::Reaction::Ramp,
        boot_s: 0.02,
        step_ns: 250_000,
        quirks: DriveQuirks::default(),
    }
}

pub(crate) fn frame(id: u16, bytes: &[u8]) -> CanFrame {
    CanFrame::classic(CanId::standard(id), bytes)
}

pub(crate) fn counts(angle_rad: f64) -> i32 {
    ((angle_rad - ZERO_RAD) * COUNTS_PER_RAD).round() as i32
}

/// A drive on a bench: time in milliseconds, frames kept.
pub(crate) struct Bench {
    pub(crate) drive: Drive,
    pub(crate) now_us: u64,
    pub(crate) sent: Vec<CanFrame>,
}

impl Bench {
    /// Powered up, booted, pre-operational.
    pub(crate) fn new(parameters: DriveParameters) -> Self {
        let mut bench = Self { drive: Drive::new(parameters), now_us: 1_000_000, sent: Vec::new() };
        bench.pass_ms(25);
        assert_eq!(bench.take(0x703), [vec![0]], "boot-up");
        bench
    }

    pub(crate) fn now(&self) -> Nanos {
        Nanos(self.now_us * 1000)
    }

    pub(crate) fn pass_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            self.now_us += 1000;
            self.drive.advance(self.now(), &mut self.sent);
        }
    }

    pub(crate) fn send(&mut self, id: u16, bytes: &[u8]) {
        self.drive.receive(self.now(), &frame(id, bytes), &mut self.sent);
    }

    /// Data of the frames sent with this identifier; all frames are forgotten.
    pub(crate) fn take(&mut self, id: u16) -> Vec<Vec<u8>> {
        let all = std::mem::take(&mut self.sent);
        all.iter().filter(|f| f.id() == CanId::standard(id)).map(|f| f.data().to_vec()).collect()
    }

    /// The one SDO answer to a request.
    pub(crate) fn sdo(&mut self, request: [u8; 8]) -> [u8; 8] {
        self.sent.clear();
        self.send(0x600 + u16::from(NODE), &request);
        let answers = self.take(0x583);
        assert_eq!(answers.len(), 1, "answers to {request:02X?}");
        answers[0].clone().try_into().unwrap()
    }

    /// Abort code of an answer; 0 when it is none.
    pub(crate) fn abort(&mut self, request: [u8; 8]) -> u32 {
        let answer = self.sdo(request);
        if answer[0] == 0x80 { u32::from_le_bytes(answer[4..].try_into().unwrap()) } else { 0 }
    }

    pub(crate) fn read(&mut self, index: u16, sub: u8) -> i64 {
        let [low, high] = index.to_le_bytes();
        let a = self.sdo([0x40, low, high, sub, 0, 0, 0, 0]);
        match a[0] {
            0x4F => i64::from(a[4]),
            0x4B => i64::from(u16::from_le_bytes([a[4], a[5]])),
            0x43 => i64::from(u32::from_le_bytes([a[4], a[5], a[6], a[7]])),
            other => panic!("{index:04X}:{sub} answered with {other:02X}: {a:02X?}"),
        }
    }

    pub(crate) fn write(&mut self, index: u16, sub: u8, size: u8, value: i64) -> u32 {
        let [low, high] = index.to_le_bytes();
        let command = 0x23 | (4 - size) << 2;
        let v = value.to_le_bytes();
        let mut bytes = [command, low, high, sub, 0, 0, 0, 0];
        bytes[4..4 + usize::from(size)].copy_from_slice(&v[..usize::from(size)]);
        self.abort(bytes)
    }

    pub(crate) fn must_write(&mut self, index: u16, sub: u8, size: u8, value: i64) {
        let code = self.write(index, sub, size, value);
        assert_eq!(code, 0, "{index:04X}:{sub} = {value} refused with {code:08X}");
    }

    /// The configuration of the common brief: RPDO1 controlword and target, TPDO1 statusword and position, type 1.
    pub(crate) fn configure(&mut self) {
        for (communication, mapping, base, objects) in [
            (0x1400, 0x1600, 0x200, [0x6040_0010_i64, 0x607A_0020]),
            (0x1800, 0x1A00, 0x180, [0x6041_0010, 0x6064_0020]),
        ] {
            let id = i64::from(base + u16::from(NODE));
            self.must_write(communication, 1, 4, id | 0x8000_0000);
            self.must_write(communication, 2, 1, 1);
            self.must_write(mapping, 0, 1, 0);
            self.must_write(mapping, 1, 4, objects[0]);
            self.must_write(mapping, 2, 4, objects[1]);
            self.must_write(mapping, 0, 1, 2);
            self.must_write(communication, 1, 4, id);
        }
        self.must_write(0x60C2, 1, 1, 1);
        self.must_write(0x60C2, 2, 1, 0xFD);
        self.must_write(0x6060, 0, 1, 8);
        self.send(0x000, &[0x01, NODE]);
        self.sent.clear();
    }

    /// One cycle: SYNC, then the RPDO for the next. Returns the TPDO's statusword and position.
    pub(crate) fn cycle(&mut self, controlword: u16, target: i32) -> (u16, i32) {
        self.pass_ms(1);
        self.sent.retain(|f| f.id() != CanId::standard(0x183));
        let others = std::mem::take(&mut self.sent);
        self.send(0x080, &[]);
        let answer = self.take(0x183).pop().expect("a TPDO for a SYNC");
        self.sent = others;
        let mut data = controlword.to_le_bytes().to_vec();
        data.extend(target.to_le_bytes());
        self.send(0x203, &data);
        let word = u16::from_le_bytes([answer[0], answer[1]]);
        (word, i32::from_le_bytes([answer[2], answer[3], answer[4], answer[5]]))
    }

    /// Enables in CSP, target on the spot, until bit 12 is set.
    pub(crate) fn enable(&mut self) {
        let here = counts(self.drive.position_rad());
        for controlword in [0x06, 0x07, 0x0F] {
            for _ in 0..3 {
                self.cycle(controlword, here);
            }
        }
        let mut cycles = 0;
        while self.cycle(0x0F, here).0 & 0x1000 == 0 {
            cycles += 1;
            assert!(cycles < 100, "does not follow: {:?}", self.drive.power_state());
        }
        assert_eq!(self.drive.power_state(), PowerState::OperationEnabled);
    }
}

pub(crate) fn enabled(parameters: DriveParameters) -> Bench {
    let mut bench = Bench::new(parameters);
    bench.configure();
    bench.enable();
    bench
}
