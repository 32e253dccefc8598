//! The simulated motor alone.
use std::f64::consts::{PI, TAU};
use taustream_drivers::codec::mit::MitCommand;
use taustream_drivers::protocols::robstride::frames::{
    Feedback, Mode, Operation, POSITION_REACH_RAD, Parameter, Reply, Request, ranges,
};
use taustream_drivers::protocols::robstride::{RobStrideMotor, RobStrideParameters};
use taustream_drivers::sim::{Disturbance, Mounting, PlantParameters, ServoModel};
use taustream_drivers::{CanFrame, Nanos};

const HOST: u8 = 0xFD;
const NODE: u8 = 7;
const REACH: [f64; 3] = [POSITION_REACH_RAD, 33.0, 14.0];

/// A joint that hangs from a motor of the size of an RS00.
fn parameters() -> RobStrideParameters {
    let plant = PlantParameters {
        inertia_kg_m2: 0.02,
        viscous_nm_s_rad: 0.05,
        coulomb_nm: 0.02,
        gravity_nm: 1.0,
        gravity_level_rad: 0.0,
        torque_nm_max: 14.0,
        speed_rad_s_max: 33.0,
        brake: false,
        brake_delay_s: 0.0,
    };
    RobStrideParameters {
        node_id: NODE,
        host_id: 0,
        identity: [1, 2, 3, 4, 5, 6, 7, 8],
        mounting: Mounting { sign: -1.0, zero_offset_rad: 0.5, start_rad: 1.0, plant, step_ns: 250_000 },
        reach: REACH,
        gains_max: [500.0, 5.0],
        torque_limit_nm: 14.0,
        run_mode: 0,
        timeout_ms: 0,
        has_timeout: true,
        has_version: true,
        forgets_revolutions: true,
        continuous_ms: 0,
        boot_s: 0.05,
    }
}

struct Bench {
    motor: RobStrideMotor,
    now: Nanos,
}

impl Bench {
    fn with(change: impl FnOnce(&mut RobStrideParameters)) -> Self {
        let mut parameters = parameters();
        change(&mut parameters);
        let mut bench = Self { motor: RobStrideMotor::new(parameters), now: Nanos(1_000_000_000) };
        bench.wait(100);
        bench
    }
    fn new() -> Self {
        Self::with(|_| {})
    }
    fn wait(&mut self, ms: u32) -> Vec<CanFrame> {
        let mut out = Vec::new();
        for _ in 0..ms {
            self.now.0 += 1_000_000;
            self.motor.advance(self.now, &mut out);
        }
        out
    }
    fn ask(&mut self, request: Request) -> Option<Reply> {
        let mut out = Vec::new();
        self.motor.receive(self.now, &request.encode(HOST, NODE), &mut out);
        assert!(out.len() <= 1, "one answer at most: {out:?}");
        out.first().map(|frame| Reply::decode(frame, NODE, HOST).unwrap())
    }
    fn feedback(&mut self, request: Request) -> Feedback {
        match self.ask(request) {
            Some(Reply::Feedback(feedback)) => feedback,
            other => panic!("{request:?} is answered by {other:?}"),
        }
    }
    fn value(&mut self, parameter: Parameter) -> [u8; 4] {
        match self.ask(Request::Read(parameter.index())) {
            Some(Reply::Value { index, read: true, value }) if index == parameter.index() => value,
            other => panic!("{parameter:?} is answered by {other:?}"),
        }
    }
    /// The motor follows the command for so long.
    fn follow(&mut self, command: MitCommand, ms: u32) -> Feedback {
        let packed = Operation::encode(&command, &ranges(REACH, 500.0, 5.0)).unwrap();
        let mut feedback = self.feedback(Request::Operation(packed));
        for _ in 0..ms {
            self.wait(1);
            feedback = self.feedback(Request::Operation(packed));
        }
        feedback
    }
}

fn position_rad(feedback: Feedback) -> f64 {
    feedback.values(&ranges(REACH, 500.0, 5.0)).position_rad
}

/// How an energised motor is recognised without touching it: the watchdog that it holds is written again.
#[test]
fn writing_back_what_was_read_answers_with_the_state_and_changes_nothing() {
    let mut bench = Bench::with(|motor| motor.timeout_ms = 500);
    let held = bench.value(Parameter::Timeout);
    assert_eq!(u32::from_le_bytes(held), 10_000);
    assert_eq!(bench.feedback(Request::Write(Parameter::Timeout.index(), held)).mode, Mode::Reset);
    bench.feedback(Request::Enable);
    let there = MitCommand {
        position_rad: -0.5,
        stiffness_nm_rad: 60.0,
        damping_nm_s_rad: 1.5,
        ..MitCommand::default()
    };
    bench.follow(there, 500);
    let before_rad = bench.motor.position_rad();
    for _ in 0..400 {
        bench.wait(1);
        assert_eq!(bench.feedback(Request::Write(Parameter::Timeout.index(), held)).mode, Mode::Run);
    }
    assert!((bench.motor.position_rad() - before_rad).abs() < 1e-4, "it holds");
    assert_eq!(bench.value(Parameter::Timeout), held);
}

#[test]
fn motor_follows_within_its_spring_and_reads_its_own_angle() {
    let mut bench = Bench::new();
    assert_eq!(bench.feedback(Request::Enable).mode, Mode::Run);
    let command = MitCommand {
        position_rad: -0.8,
        stiffness_nm_rad: 200.0,
        damping_nm_s_rad: 2.0,
        ..MitCommand::default()
    };
    let feedback = bench.follow(command, 2_000);
    // Motor angle = (link - 0.5) * -1; gravity of at most 1 Nm bends a spring of 200 Nm/rad by 5 mrad.
    let off_rad = position_rad(feedback) + 0.8;
    assert!(off_rad.abs() < 0.006 && off_rad.abs() > 1e-4, "{off_rad}");
    assert!((bench.motor.position_rad() - 1.3).abs() < 0.006);
    let float = f64::from(f32::from_le_bytes(bench.value(Parameter::Position)));
    assert!((float - position_rad(feedback)).abs() < 2.0 * TAU * 4.0 / 65_535.0, "{float}");
}

#[test]
fn watchdog_takes_torque_away_after_its_time_and_only_then() {
    let mut bench = Bench::new();
    bench.feedback(Request::Write(Parameter::Timeout.index(), 2_000_u32.to_le_bytes()));
    bench.feedback(Request::Enable);
    bench.wait(99);
    assert!(bench.motor.is_enabled());
    bench.wait(3);
    assert!(!bench.motor.is_enabled());
    assert_eq!(bench.feedback(Request::Write(0x7028, [0; 4])).mode, Mode::Reset);
    // Old firmware has no such parameter, and holds for ever.
    let mut old = Bench::with(|motor| motor.has_timeout = false);
    assert_eq!(
        old.ask(Request::Read(0x7028)),
        Some(Reply::Value { index: 0x7028, read: false, value: [0; 4] })
    );
    old.feedback(Request::Write(0x7028, 2_000_u32.to_le_bytes()));
    old.feedback(Request::Enable);
    old.wait(1_000);
    assert!(old.motor.is_enabled());
}

#[test]
fn fault_is_reported_by_itself_kept_and_cleared_by_a_stop_that_says_so() {
    for (code, bits, reported) in [(0x01, 0x01, 1 << 2), (0x10, 0x10, 1 << 14), (0x7305, 0x02, 1 << 16)] {
        let mut bench = Bench::new();
        bench.feedback(Request::Enable);
        let mut out = Vec::new();
        bench.motor.disturb(Disturbance::Fault(code), &mut out);
        assert_eq!(Reply::decode(&out[0], NODE, HOST), Some(Reply::Fault { faults: reported, warnings: 0 }));
        let feedback = bench.feedback(Request::Enable);
        assert_eq!((feedback.mode, feedback.faults), (Mode::Reset, bits), "it does not energise");
        assert_eq!(bench.feedback(Request::Stop).faults, bits);
        assert_eq!(bench.feedback(Request::ClearFault).faults, 0);
        assert_eq!(bench.feedback(Request::Enable).mode, Mode::Run);
    }
}

#[test]
fn power_cycle_forgets_revolutions_and_what_was_written() {
    for (zero_flag, low_rad) in [(0, 0.0), (1, -PI)] {
        let mut bench = Bench::new();
        bench.feedback(Request::Write(0x7029, [zero_flag, 0, 0, 0]));
        bench.feedback(Request::Write(0x7028, 2_000_u32.to_le_bytes()));
        bench.feedback(Request::Enable);
        let command = MitCommand {
            position_rad: -7.0,
            stiffness_nm_rad: 50.0,
            damping_nm_s_rad: 3.0,
            ..MitCommand::default()
        };
        let feedback = bench.follow(command, 3_000);
        assert!((position_rad(feedback) + 7.0).abs() < 0.05, "{}", position_rad(feedback));
        bench.motor.disturb(Disturbance::Restart, &mut Vec::new());
        assert_eq!(bench.ask(Request::Stop), None, "it starts up");
        bench.wait(60);
        let after_rad = position_rad(bench.feedback(Request::Stop));
        assert!((low_rad - 1e-3..low_rad + TAU).contains(&after_rad) || zero_flag == 0, "{after_rad}");
        let turns = (after_rad + 7.0) / TAU;
        assert!((turns - turns.round()).abs() < 0.1, "{after_rad}");
        assert_eq!(bench.value(Parameter::Timeout), [0; 4]);
    }
}

#[test]
fn values_that_are_no_numbers_or_outside_are_not_taken() {
    let mut bench = Bench::new();
    let limit = bench.value(Parameter::TorqueLimit);
    for bad in [f32::NAN, f32::INFINITY, -1.0, 14.1] {
        bench.feedback(Request::Write(Parameter::TorqueLimit.index(), bad.to_le_bytes()));
        assert_eq!(bench.value(Parameter::TorqueLimit), limit, "{bad}");
    }
    bench.feedback(Request::Write(Parameter::TorqueLimit.index(), 3.0_f32.to_le_bytes()));
    assert_eq!(bench.value(Parameter::TorqueLimit), 3.0_f32.to_le_bytes());
    bench.motor.disturb(Disturbance::RefuseWrites(1), &mut Vec::new());
    bench.feedback(Request::Write(Parameter::TorqueLimit.index(), 2.0_f32.to_le_bytes()));
    assert_eq!(bench.value(Parameter::TorqueLimit), 3.0_f32.to_le_bytes());
    assert_eq!(
        bench.ask(Request::Read(0x2222)),
        Some(Reply::Value { index: 0x2222, read: false, value: [0; 4] })
    );
}

#[test]
fn request_for_the_version_stops_a_motor_that_does_not_know_it() {
    let mut old = Bench::with(|motor| motor.has_version = false);
    old.feedback(Request::Enable);
    assert_eq!(old.feedback(Request::Version).mode, Mode::Reset, "which is why it is never sent");
    let mut new = Bench::new();
    new.feedback(Request::Enable);
    assert_eq!(new.ask(Request::Version), Some(Reply::Version([0, 3, 0, 13])));
    assert!(new.motor.is_enabled());
}
