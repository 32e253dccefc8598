//! A bench of a bus in memory: the driver of a Piper against the six joints of a simulated one, in cycles of 5 ms.
use std::sync::Arc;
use taustream_drivers::bring_up::timing::Timeouts;
use taustream_drivers::protocols::piper::controller::ArmPlan;
use taustream_drivers::protocols::piper::driver::{JointSlot, PiperDriver};
use taustream_drivers::protocols::piper::frames::{Command, FOLLOW_FAST, JOINTS, Limits};
use taustream_drivers::protocols::piper::sim::{PiperJoint, PiperParameters, SharedArm};
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

pub(crate) const START_RAD: [f64; JOINTS] = [0.3, 1.2, -1.0, 0.2, -0.3, 0.5];
/// Ranges of the joints, as the arm counts, degrees.
const RANGES_DEG: [[f64; 2]; JOINTS] =
    [[-150.0, 150.0], [0.0, 180.0], [-170.0, 0.0], [-100.0, 100.0], [-70.0, 70.0], [-120.0, 120.0]];
pub(crate) const CYCLE_NS: u64 = 5_000_000;

pub(crate) struct Bench {
    pub(crate) driver: PiperDriver,
    pub(crate) arm: Vec<PiperJoint>,
    pub(crate) now: Nanos,
    pub(crate) target: DriveTarget,
    pub(crate) commands: [JointCommand; MAX_JOINTS],
    /// Frames of the newest cycle.
    pub(crate) sent: Vec<CanFrame>,
    /// Frames of the arm that arrive in the next cycle.
    pub(crate) arriving: Vec<CanFrame>,
    /// Joints whose part of the controller neither sends nor receives.
    pub(crate) silent: [bool; JOINTS],
}

fn slot(joint: usize) -> JointSlot {
    // Joint 2 is mounted the other way round here, so that signs and zeros count.
    let (sign, zero_offset_rad) = if joint == 1 { (-1.0, 1.5) } else { (1.0, 0.0) };
    JointSlot { joint, sign, zero_offset_rad }
}

pub(crate) fn plan() -> ArmPlan {
    ArmPlan {
        firmware: *b"S-V1.6-3",
        speed_percent: 100,
        follow: FOLLOW_FAST,
        joints: RANGES_DEG.map(|range| (range.map(f64::to_radians), 3.0)),
    }
}

fn parameters(joint: usize, arm: &Arc<SharedArm>) -> PiperParameters {
    let JointSlot { sign, zero_offset_rad, .. } = slot(joint);
    let [least, most] = RANGES_DEG[joint];
    #[expect(clippy::cast_possible_truncation, reason = "hundreds of degrees")]
    let [least_decidegrees, most_decidegrees] = [least * 10.0, most * 10.0].map(|angle| angle as i16);
    let number = u8::try_from(joint + 1).unwrap();
    PiperParameters {
        number,
        sign,
        zero_offset_rad,
        start_rad: START_RAD[joint],
        plant: PlantParameters {
            inertia_kg_m2: 0.1,
            viscous_nm_s_rad: 0.1,
            // Friction holds it when it is off, as a support does.
            coulomb_nm: 1.2,
            gravity_nm: 1.0,
            gravity_level_rad: 0.0,
            torque_nm_max: 20.0,
            speed_rad_s_max: 4.0,
            brake: false,
            brake_delay_s: 0.0,
        },
        loops: LoopParameters {
            position_gain_1_s: 60.0,
            velocity_bandwidth_rad_s: 400.0,
            integral_time_s: 0.02,
            torque_lag_s: 3e-4,
            extrapolation_s: 0.0,
        },
        limits: Limits { joint: number, most_decidegrees, least_decidegrees, speed_mrad_s: 3000 },
        firmware: *b"S-V1.6-3",
        boot_s: 0.05,
        step_ns: 250_000,
        arm: Arc::clone(arm),
    }
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self::with(|_, _| {})
    }

    /// A bench whose simulated joints are changed before they power up.
    pub(crate) fn with(change: impl Fn(usize, &mut PiperParameters)) -> Self {
        let timeouts = Timeouts { step: Nanos(2_000_000_000), feedback: Nanos(50_000_000) };
        let shared = Arc::default();
        let arm = (0..JOINTS).map(|joint| {
            let mut parameters = parameters(joint, &shared);
            change(joint, &mut parameters);
            PiperJoint::new(parameters)
        });
        Self {
            driver: PiperDriver::new(plan(), std::array::from_fn(slot), timeouts, 0.05, 5000),
            arm: arm.collect(),
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
        for (joint, silent) in self.arm.iter_mut().zip(self.silent) {
            let mut out = Vec::new();
            joint.advance(self.now, &mut out);
            for frame in self.sent.iter().filter(|_| !silent) {
                joint.receive(self.now, frame, &mut out);
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
        for _ in 0..2_000 {
            if self.states().iter().all(|other| *other == state) {
                return;
            }
            self.step();
        }
        panic!("not {state:?} but {:?}: {}", self.states(), self.why(0));
    }

    pub(crate) fn until_one(&mut self, joint: usize, state: DriveState) {
        for _ in 0..2_000 {
            if self.status(joint).state == state {
                return;
            }
            self.step();
        }
        panic!("joint {joint} is not {state:?} but {:?}: {}", self.status(joint).state, self.why(joint));
    }

    /// What an operator reads about a joint.
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
        self.steps(20);
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

    /// What the newest cycle commands.
    pub(crate) fn commanded(&self) -> Vec<Command> {
        self.sent.iter().map(|frame| Command::decode(frame).unwrap()).collect()
    }

    /// A frame of somebody else to the arm.
    pub(crate) fn inject(&mut self, command: Command) {
        for joint in &mut self.arm {
            joint.receive(self.now, &command.encode(), &mut Vec::new());
        }
    }
}
