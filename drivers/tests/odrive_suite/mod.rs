//! A bench of a bus in memory: the driver of three `ODrive` axes against simulated drives, in cycles of 2 ms.
use taustream_drivers::bring_up::timing::Timeouts;
use taustream_drivers::protocols::odrive::axis::{AxisPlan, Watchdog};
use taustream_drivers::protocols::odrive::driver::{AxisMapping, OdriveDriver};
use taustream_drivers::protocols::odrive::frames::{Command, Version};
use taustream_drivers::protocols::odrive::sim::{Endpoints, Odrive, OdriveParameters};
use taustream_drivers::sim::{LoopParameters, PlantParameters};
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{
    CanFrame, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver, ServoStatus,
};
use taustream_motion::MAX_JOINTS;

mod bring_up;
mod faults;
mod frames;
mod golden;
mod hostile;
mod operation;
mod shipped;

pub(crate) const JOINTS: usize = 3;
pub(crate) const START_RAD: [f64; JOINTS] = [0.4, -0.7, 1.1];
pub(crate) const CYCLE_NS: u64 = 2_000_000;
pub(crate) const ENDPOINTS: Endpoints =
    Endpoints { watchdog_timeout: 153, enable_watchdog: 154, velocity_limit: 388 };
pub(crate) const TIMEOUT_S: f32 = 0.1;
const GEAR_RATIO: f64 = 10.0;

pub(crate) struct Bench {
    pub(crate) driver: OdriveDriver,
    pub(crate) drives: Vec<Odrive>,
    pub(crate) now: Nanos,
    pub(crate) target: DriveTarget,
    pub(crate) commands: [JointCommand; MAX_JOINTS],
    /// Frames of the newest cycle.
    pub(crate) sent: Vec<CanFrame>,
    /// Frames of the drives that arrive in the next cycle.
    pub(crate) arriving: Vec<CanFrame>,
    /// Drives that neither send nor receive.
    pub(crate) silent: [bool; JOINTS],
}

pub(crate) fn node(joint: usize) -> u8 {
    u8::try_from(joint).unwrap() * 10 + 3
}

fn mapping(joint: usize) -> AxisMapping {
    let sign = if joint == 1 { -1.0 } else { 1.0 };
    AxisMapping { joint, node_id: node(joint), sign, zero_offset_rad: 0.1, gear_ratio: GEAR_RATIO }
}

pub(crate) fn plan() -> AxisPlan {
    AxisPlan {
        hardware: [4, 4, 58],
        firmware: [0, 6, 11],
        watchdog: Watchdog::Written { timeout_s: TIMEOUT_S, endpoints: ENDPOINTS },
        speed_turns_s: 4.0,
        heartbeat: Nanos(100_000_000),
    }
}

fn plant() -> PlantParameters {
    PlantParameters {
        inertia_kg_m2: 0.3,
        viscous_nm_s_rad: 0.3,
        coulomb_nm: 0.3,
        gravity_nm: 3.0,
        gravity_level_rad: 0.0,
        torque_nm_max: 30.0,
        speed_rad_s_max: 4.0,
        brake: true,
        brake_delay_s: 0.02,
    }
}

pub(crate) fn parameters(joint: usize) -> OdriveParameters {
    let AxisMapping { node_id, sign, zero_offset_rad, gear_ratio, .. } = mapping(joint);
    OdriveParameters {
        node_id,
        sign,
        zero_offset_rad,
        gear_ratio,
        start_rad: START_RAD[joint],
        plant: plant(),
        loops: LoopParameters {
            position_gain_1_s: 60.0,
            velocity_bandwidth_rad_s: 400.0,
            integral_time_s: 0.02,
            torque_lag_s: 3e-4,
            extrapolation_s: 0.0,
        },
        version: Version { protocol: 2, hardware: [4, 4, 58], firmware: [0, 6, 11], unreleased: 0 },
        endpoints: ENDPOINTS,
        velocity_limit_turns_s: 10.0,
        watchdog: (0.0, false),
        encoder_period_ms: 4,
        heartbeat_period_ms: 100,
        confirms_writes: true,
        boot_s: 0.05,
        step_ns: 250_000,
    }
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self::with(plan(), |_, _| {})
    }

    /// A bench whose simulated drives are changed before they power up.
    pub(crate) fn with(plan: AxisPlan, change: impl Fn(usize, &mut OdriveParameters)) -> Self {
        let timeouts = Timeouts { step: Nanos(2_000_000_000), feedback: Nanos(50_000_000) };
        let mut driver = OdriveDriver::new(timeouts, 0.05, 2000);
        let mut drives = Vec::new();
        for joint in 0..JOINTS {
            driver.add(mapping(joint), plan);
            let mut parameters = parameters(joint);
            change(joint, &mut parameters);
            drives.push(Odrive::new(parameters));
        }
        Self {
            driver,
            drives,
            now: Nanos(1_000_000_000),
            target: DriveTarget::Disabled,
            commands: [JointCommand::default(); MAX_JOINTS],
            sent: Vec::new(),
            arriving: Vec::new(),
            silent: [false; JOINTS],
        }
    }

    pub(crate) fn step(&mut self) {
        let mut batch = FrameBatch::new();
        self.driver.encode(self.now, self.target, &self.commands, &mut batch);
        self.sent = batch.frames().to_vec();
        for frame in self.arriving.drain(..) {
            self.driver.decode(self.now, &frame);
        }
        for (drive, silent) in self.drives.iter_mut().zip(self.silent) {
            let mut out = Vec::new();
            drive.advance(self.now, &mut out);
            for frame in self.sent.iter().filter(|_| !silent) {
                drive.receive(self.now, frame, &mut out);
            }
            if !silent {
                self.arriving.append(&mut out);
            }
        }
        self.now.0 += CYCLE_NS;
    }

    pub(crate) fn steps(&mut self, count: u32) {
        for _ in 0..count {
            self.step();
        }
    }

    pub(crate) fn status(&self, joint: usize) -> ServoStatus {
        self.driver.status(joint)
    }

    pub(crate) fn states(&self) -> Vec<DriveState> {
        (0..JOINTS).map(|joint| self.status(joint).state).collect()
    }

    pub(crate) fn until(&mut self, state: DriveState) {
        for _ in 0..3_000 {
            if self.states().iter().all(|other| *other == state) {
                return;
            }
            self.step();
        }
        panic!("not {state:?} but {:?}: {}", self.states(), self.why(0));
    }

    pub(crate) fn until_one(&mut self, joint: usize, state: DriveState) {
        for _ in 0..3_000 {
            if self.status(joint).state == state {
                return;
            }
            self.step();
        }
        panic!("joint {joint} is not {state:?} but {:?}: {}", self.status(joint).state, self.why(joint));
    }

    /// What an operator reads about a drive.
    pub(crate) fn why(&self, joint: usize) -> String {
        explain_refusal(&self.status(joint).refusal())
    }

    pub(crate) fn hold(&mut self) {
        for joint in 0..JOINTS {
            let position_rad = self.status(joint).position_rad;
            self.commands[joint] = JointCommand { position_rad, ..JointCommand::default() };
        }
    }

    pub(crate) fn enable(&mut self) {
        self.until(DriveState::Disabled);
        self.steps(50);
        self.hold();
        self.target = DriveTarget::Enabled;
        self.step();
        self.until(DriveState::Enabled);
    }

    pub(crate) fn enabled() -> Self {
        let mut bench = Self::new();
        bench.enable();
        bench
    }

    /// Moves all joints by an angle along half a sine, in so many cycles.
    pub(crate) fn travel(&mut self, by_rad: f64, cycles: u32) -> f64 {
        let from: Vec<f64> = self.commands.iter().map(|command| command.position_rad).collect();
        let duration_s = f64::from(cycles) * 2e-3;
        let mut worst_rad = 0.0_f64;
        for cycle in 1..=cycles {
            let phase = std::f64::consts::PI * f64::from(cycle) / f64::from(cycles);
            for joint in 0..JOINTS {
                self.commands[joint].position_rad = from[joint] + by_rad * 0.5 * (1.0 - phase.cos());
                self.commands[joint].velocity_rad_s =
                    by_rad * 0.5 * phase.sin() * std::f64::consts::PI / duration_s;
            }
            self.step();
            for joint in 0..JOINTS {
                let away_rad = self.drives[joint].position_rad() - self.commands[joint].position_rad;
                worst_rad = worst_rad.max(away_rad.abs());
            }
        }
        self.commands.iter_mut().for_each(|command| command.velocity_rad_s = 0.0);
        worst_rad
    }

    /// Commands of the newest cycle to a joint's drive.
    pub(crate) fn commanded(&self, joint: usize) -> Vec<Command> {
        self.sent.iter().filter_map(|frame| Command::decode(frame, node(joint))).collect()
    }
}
