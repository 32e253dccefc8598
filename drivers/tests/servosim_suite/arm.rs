//! Six simulated drives and the CiA 402 master, joined in memory: bring-up, a motion, an orderly end, and faults.
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::codec::cia402::Cia402Driver;
use taustream_drivers::sim::settings::drives;
use taustream_drivers::sim::{Drive, FaultRequest, ServoSimulator};
use taustream_drivers::{
    CanFrame, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver, ServoStatus,
};
use taustream_motion::MAX_JOINTS;

const PERIOD_NS: u64 = 1_000_000;
const START_RAD: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];

/// The shipped arm, its drives and its master.
pub(super) struct Arm {
    pub(super) settings: Settings,
    pub(super) simulator: ServoSimulator,
    pub(super) driver: Cia402Driver,
    pub(super) now: Nanos,
    pub(super) commands: [JointCommand; MAX_JOINTS],
    out: Vec<Vec<CanFrame>>,
    /// What the master sent in the newest cycle.
    pub(super) sent: Vec<CanFrame>,
}

/// The shipped settings.
pub(super) fn shipped() -> Settings {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
    Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"))
}

/// The weight of each joint pulls hardest where it starts.
pub(super) fn level(settings: &mut Settings) {
    let levels = START_RAD.iter().map(|angle_rad| toml::Value::Float(*angle_rad)).collect();
    let levels = toml::Value::Array(levels);
    settings.simulator.get_or_insert_default().insert("gravity_level_rad".to_owned(), levels);
}

impl Arm {
    fn new() -> Self {
        Self::with(shipped())
    }

    pub(super) fn with(settings: Settings) -> Self {
        let setups = drives(&settings, Some(&START_RAD)).unwrap_or_else(|faults| panic!("{faults}"));
        let simulator = ServoSimulator::new(setups, 1, 1);
        let driver = Cia402Driver::new(&settings, 0).unwrap();
        let out = vec![Vec::new()];
        let mut commands = [JointCommand::default(); MAX_JOINTS];
        for (command, start_rad) in commands.iter_mut().zip(START_RAD) {
            command.position_rad = start_rad;
        }
        Self { settings, simulator, driver, now: Nanos(1_000_000_000), commands, out, sent: Vec::new() }
    }

    /// The master is gone for this long.
    pub(super) fn alone(&mut self, ms: u64) {
        for _ in 0..ms {
            self.now.0 += PERIOD_NS;
            self.simulator.advance(self.now, &mut self.out);
            self.out[0].clear();
        }
    }

    /// One cycle: the answers of the last one are taken, then SYNC and setpoints go out and are answered.
    pub(super) fn cycle(&mut self, drive_target: DriveTarget) {
        self.now.0 += PERIOD_NS;
        self.simulator.advance(self.now, &mut self.out);
        for frame in self.out[0].drain(..) {
            self.driver.decode(self.now, &frame);
        }
        let mut batch = FrameBatch::new();
        self.driver.encode(self.now, drive_target, &self.commands, &mut batch);
        self.simulator.receive(self.now, 0, batch.frames(), &mut self.out);
        self.sent = batch.frames().to_vec();
    }

    pub(super) fn status(&self, joint: usize) -> ServoStatus {
        self.driver.status(joint)
    }

    pub(super) fn states(&self) -> [DriveState; 6] {
        std::array::from_fn(|joint| self.status(joint).state)
    }

    /// Cycles until every drive is in a state.
    pub(super) fn reach(&mut self, drive_target: DriveTarget, state: DriveState) {
        for _ in 0..10_000 {
            self.cycle(drive_target);
            if self.states() == [state; 6] {
                return;
            }
        }
        panic!("not all {state:?} within 10 s: {:?}", self.states());
    }

    pub(super) fn enable(&mut self) {
        self.reach(DriveTarget::Disabled, DriveState::Disabled);
        for joint in 0..6 {
            self.commands[joint].position_rad = self.status(joint).position_rad;
        }
        self.reach(DriveTarget::Enabled, DriveState::Enabled);
    }

    /// The worst |measured - commanded two cycles ago| while moving all joints along a raised cosine.
    pub(super) fn move_and_measure(&mut self, seconds: f64) -> [f64; 6] {
        let base_rad: [f64; 6] = std::array::from_fn(|joint| self.commands[joint].position_rad);
        let mut worst_rad = [0.0_f64; 6];
        let mut due_rad = [base_rad; 3];
        let mut t_s = 0.0;
        while t_s < seconds {
            t_s += 1e-3;
            for joint in 0..6 {
                // Half a radian there and back: peaks of 1.5 rad/s and 9 rad/s^2.
                self.commands[joint].position_rad = base_rad[joint] + 0.25 * (1.0 - (6.0 * t_s).cos());
            }
            self.cycle(DriveTarget::Enabled);
            due_rad.rotate_left(1);
            due_rad[2] = std::array::from_fn(|joint| self.commands[joint].position_rad);
            for joint in 0..6 {
                let error_rad = self.status(joint).position_rad - due_rad[0][joint];
                worst_rad[joint] = worst_rad[joint].max(error_rad.abs());
            }
        }
        worst_rad
    }
}

/// Goal: master and simulator agree on bring-up, scales, signs, zeros and timing.
/// Method: the shipped settings, whose six servos differ in sign and zero; three seconds of motion; an orderly end.
#[test]
fn six_drives_come_up_follow_a_motion_and_are_disabled_in_order() {
    let mut arm = Arm::new();
    arm.enable();
    for joint in 0..6 {
        let hold_position_rad = arm.simulator.drive(joint).unwrap().position_rad();
        assert!(
            (hold_position_rad - START_RAD[joint]).abs() < 0.01,
            "joint {joint} sagged to {hold_position_rad}"
        );
    }
    let worst_rad = arm.move_and_measure(3.0);
    println!("worst tracking errors {worst_rad:.6?} rad");
    for (joint, worst_rad) in worst_rad.into_iter().enumerate() {
        assert!(worst_rad < 0.005, "joint {joint} lags {worst_rad} rad behind");
        // A joint that does not move at all would have been 0.5 rad off.
        assert!(worst_rad > 1e-9);
    }
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    for joint in 0..6 {
        assert_eq!(arm.status(joint).error_code, 0, "joint {joint}");
    }
}

/// Goal: every fault kind shows at the master as what it is, at the one joint that has it.
/// Method: the elbow's fault begins in the middle of a motion of all joints.
#[test]
fn faults_on_request_reach_the_master_as_what_they_are() {
    let silent = |s: ServoStatus, now: Nanos| {
        s.received.is_none_or(|received| now.since_s(received) > 0.02) || s.state != DriveState::Enabled
    };
    let fault = |s: ServoStatus, code: u32| s.state == DriveState::Fault && s.error_code == code;
    for kind in
        ["silence", "drop,value=1", "fault,value=0x4310", "stuck", "jump,value=0.2", "warning", "restart"]
    {
        let mut arm = Arm::new();
        arm.enable();
        let names = arm.simulator.joints();
        let order = FaultRequest::parse(&format!("joint=elbow,after=moving,at_s=0.25,kind={kind}"), &names);
        arm.simulator.request(arm.now, order.unwrap_or_else(|error| panic!("{kind}: {error}")));
        let mut found_at = None;
        let mut last_rad = arm.status(2).position_rad;
        for tick in 0..1500 {
            let t_s = f64::from(tick) * 1e-3;
            for joint in 0..6 {
                arm.commands[joint].position_rad = START_RAD[joint] + 0.4 * (1.0 - (5.0 * t_s).cos());
            }
            arm.cycle(DriveTarget::Enabled);
            let status = arm.status(2);
            let found = match kind {
                "silence" | "drop,value=1" => silent(status, arm.now),
                "fault,value=0x4310" => fault(status, 0x4310),
                "stuck" => fault(status, 0x8611),
                "jump,value=0.2" => (status.position_rad - last_rad).abs() > 0.15,
                "warning" => status.warning,
                "restart" => status.state != DriveState::Enabled,
                other => panic!("no check for {other}"),
            };
            last_rad = status.position_rad;
            if found {
                found_at = found_at.or(Some(tick));
            }
        }
        assert!(found_at.is_some_and(|tick| tick > 240), "{kind} seen at {found_at:?}: {:?}", arm.status(2));
        for joint in [0, 1, 3, 4, 5] {
            assert_eq!(arm.status(joint).state, DriveState::Enabled, "{kind} touched joint {joint}");
        }
    }
}

/// Goal: late answers are late by what was asked, and come in order again afterwards.
#[test]
fn delayed_drive_answers_late_and_recovers_when_cleared() {
    let mut arm = Arm::new();
    arm.enable();
    let names = arm.simulator.joints();
    let order = FaultRequest::parse("joint=2,kind=delay,value=7", &names).unwrap();
    arm.simulator.request(arm.now, order);
    let base_rad = arm.commands[1].position_rad;
    let mut lag_rad = 0.0_f64;
    for tick in 0..400 {
        let t_s = f64::from(tick) * 1e-3;
        for joint in 0..6 {
            arm.commands[joint].position_rad = START_RAD[joint] + t_s;
        }
        arm.cycle(DriveTarget::Enabled);
        // At 1 rad/s a millisecond is a milliradian.
        lag_rad = base_rad + t_s - arm.status(1).position_rad;
    }
    assert!((0.007..0.013).contains(&lag_rad), "lags {lag_rad} rad at 1 rad/s");
    arm.simulator.clear(Some(1));
    arm.cycle(DriveTarget::Enabled);
    for _ in 0..300 {
        arm.cycle(DriveTarget::Enabled);
    }
    let still_rad = (arm.commands[1].position_rad - arm.status(1).position_rad).abs();
    assert!(still_rad < 0.003, "still {still_rad} rad behind");
}

/// Goal: when the master vanishes mid-motion, the drives stop by their own watchdog and the brakes hold.
#[test]
fn master_that_vanishes_leaves_the_arm_stopped_and_held() {
    let mut arm = Arm::new();
    arm.enable();
    arm.move_and_measure(0.26);
    assert!(arm.simulator.drive(1).unwrap().velocity_rad_s().abs() > 1.0);
    let watchdog_ms = u64::from(arm.settings.cycle.drive_watchdog_ms);
    for _ in 0..watchdog_ms + 400 {
        arm.now.0 += PERIOD_NS;
        arm.simulator.advance(arm.now, &mut arm.out);
    }
    let fault_frame = arm.out[0].iter().any(|f| f.id().raw() == 0x082 && f.data()[..2] == [0x50, 0x82]);
    assert!(fault_frame, "no EMCY 0x8250 of node 2");
    let rest_rad: Vec<f64> = (0..6).map(|joint| arm.simulator.drive(joint).unwrap().position_rad()).collect();
    for _ in 0..1000 {
        arm.now.0 += PERIOD_NS;
        arm.simulator.advance(arm.now, &mut arm.out);
    }
    for joint in 0..6 {
        let drive = arm.simulator.drive(joint).unwrap();
        assert!((drive.position_rad() - rest_rad[joint]).abs() < 1e-9, "joint {joint} still moves");
        assert_eq!(drive.get::<Drive>().unwrap().statusword() & 0x4F, 0x08, "joint {joint} is not in fault");
    }
}
