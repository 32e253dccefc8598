//! The simulated motor alone.
use taustream_drivers::Nanos;
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::cubemars::frames::{Feedback, Request, Special};
use taustream_drivers::protocols::cubemars::{CubeMarsMotor, CubeMarsParameters};
use taustream_drivers::sim::{Disturbance, Mounting, PlantParameters, ServoModel};

const NODE: u8 = 3;
const REACH: [f64; 3] = [12.5, 50.0, 25.0];

/// A joint that hangs from a motor of the size of an AK70-10.
fn parameters() -> CubeMarsParameters {
    let plant = PlantParameters {
        inertia_kg_m2: 0.03,
        viscous_nm_s_rad: 0.05,
        coulomb_nm: 0.02,
        gravity_nm: 2.0,
        gravity_level_rad: 0.0,
        torque_nm_max: 25.0,
        speed_rad_s_max: 40.0,
        brake: false,
        brake_delay_s: 0.0,
    };
    CubeMarsParameters {
        node_id: NODE,
        feedback_id: u16::from(NODE),
        mounting: Mounting { sign: -1.0, zero_offset_rad: 0.5, start_rad: 1.0, plant, step_ns: 250_000 },
        reach: REACH,
        torque_nm_max: 25.0,
        timeout_ms: 100,
        short_feedback: false,
        boot_s: 0.05,
    }
}

struct Bench {
    motor: CubeMarsMotor,
    now: Nanos,
}

impl Bench {
    fn with(change: impl FnOnce(&mut CubeMarsParameters)) -> Self {
        let mut parameters = parameters();
        change(&mut parameters);
        let mut bench = Self { motor: CubeMarsMotor::new(parameters), now: Nanos(1_000_000_000) };
        bench.wait(100);
        bench
    }
    fn wait(&mut self, ms: u32) {
        for _ in 0..ms {
            self.now.0 += 1_000_000;
            self.motor.advance(self.now, &mut Vec::new());
        }
    }
    fn ask(&mut self, request: Request) -> Option<Feedback> {
        let mut out = Vec::new();
        self.motor.receive(self.now, &request.encode(NODE), &mut out);
        assert!(out.len() <= 1, "one answer at most: {out:?}");
        out.first().map(|frame| Feedback::decode(frame, NODE, u16::from(NODE)).unwrap())
    }
    fn follow(&mut self, command: MitCommand, ms: u32) -> f64 {
        let [position_rad, velocity_rad_s, torque_nm] = REACH;
        let ranges = MitRanges::symmetric(position_rad, velocity_rad_s, torque_nm);
        let packed = Request::Mit(command.encode(&ranges).unwrap());
        for _ in 0..ms {
            self.ask(packed);
            self.wait(1);
        }
        self.ask(packed).unwrap().values(&ranges).position_rad
    }
}

fn hold(position_rad: f64) -> MitCommand {
    MitCommand { position_rad, stiffness_nm_rad: 200.0, damping_nm_s_rad: 3.0, ..MitCommand::default() }
}

#[test]
fn motor_follows_in_motor_mode_alone() {
    let mut bench = Bench::with(|_| {});
    bench.follow(hold(-0.6), 100);
    assert!(!bench.motor.is_enabled(), "a command does not energise");
    bench.ask(Request::Special(Special::Enter));
    let read_rad = bench.follow(hold(-0.6), 2_000);
    // Motor angle = (link - 0.5) * -1; gravity of at most 2 Nm bends a spring of 200 Nm/rad by 10 mrad.
    assert!((read_rad + 0.6).abs() < 0.011 && (bench.motor.position_rad() - 1.1).abs() < 0.011, "{read_rad}");
}

/// The case that no feedback tells: the command is gone, motor mode is not, and the next command acts at full gains.
#[test]
fn motor_whose_time_ran_out_is_limp_in_motor_mode_and_follows_the_next_command_at_once() {
    let mut bench = Bench::with(|_| {});
    bench.ask(Request::Special(Special::Enter));
    bench.follow(hold(-0.6), 1_000);
    let held_rad = bench.motor.position_rad();
    bench.wait(90);
    assert!((bench.motor.position_rad() - held_rad).abs() < 1e-3, "until then it holds");
    bench.wait(1_000);
    assert!((bench.motor.position_rad() - held_rad).abs() > 0.2, "it falls");
    assert!(bench.motor.is_enabled());
    bench.follow(hold(-0.6), 1_000);
    assert!((bench.motor.position_rad() - held_rad).abs() < 0.02, "it snaps back");
    // Without that time it holds for ever.
    let mut endless = Bench::with(|motor| motor.timeout_ms = 0);
    endless.ask(Request::Special(Special::Enter));
    endless.follow(hold(-0.6), 1_000);
    let held_rad = endless.motor.position_rad();
    endless.wait(3_000);
    assert!((endless.motor.position_rad() - held_rad).abs() < 1e-3);
}

#[test]
fn error_ends_motor_mode_and_leaving_it_clears_the_error() {
    for (code, error) in [(1, 1), (7, 7), (0x7305, 2)] {
        let mut bench = Bench::with(|_| {});
        bench.ask(Request::Special(Special::Enter));
        bench.motor.disturb(Disturbance::Fault(code), &mut Vec::new());
        assert_eq!(bench.ask(Request::Special(Special::Enter)).unwrap().error(), error);
        assert!(!bench.motor.is_enabled());
        assert_eq!(bench.ask(Request::Special(Special::Exit)).unwrap().error(), 0);
        bench.ask(Request::Special(Special::Enter));
        assert!(bench.motor.is_enabled());
    }
}

#[test]
fn zero_is_here_after_a_second_without_an_answer() {
    let mut bench = Bench::with(|motor| motor.mounting.plant.gravity_nm = 0.0);
    bench.ask(Request::Special(Special::SetZero));
    bench.wait(900);
    assert_eq!(bench.ask(Request::Special(Special::Exit)), None);
    bench.wait(200);
    let read = bench.ask(Request::Special(Special::Exit)).unwrap();
    assert!(read.values(&MitRanges::symmetric(12.5, 50.0, 25.0)).position_rad.abs() < 5e-4);
}

#[test]
fn old_firmware_answers_with_six_bytes_and_a_restart_takes_motor_mode_away() {
    let mut bench = Bench::with(|motor| motor.short_feedback = true);
    assert_eq!(bench.ask(Request::Special(Special::Enter)).unwrap().health, None);
    bench.motor.disturb(Disturbance::Restart, &mut Vec::new());
    assert_eq!(bench.ask(Request::Special(Special::Exit)), None, "it starts up");
    bench.wait(60);
    assert!(!bench.motor.is_enabled() && bench.ask(Request::Special(Special::Exit)).is_some());
}
