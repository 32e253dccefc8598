//! Homing against scripted drives: which controlword, target and object at which moment, and what drives do wrong.
use super::{Bench, ENABLED, FOLLOWS, settings};
use taustream_arm::{Cia402, HomingSettings, OptionalObject, VelocityUnit};
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{DriveState, HomingState, ServoDriver};

const HOMED: u16 = 0x1400;
const ERROR: u16 = 0x2000;
/// What the settings below write: offset, method, two speeds in rpm of the motor, acceleration in rpm a second.
const PARAMETERS: [(u16, u8); 5] = [(0x607C, 0), (0x6098, 0), (0x6099, 1), (0x6099, 2), (0x609A, 0)];

fn homing(method: i8) -> HomingSettings {
    HomingSettings {
        method,
        velocity_unit: VelocityUnit::Rpm,
        switch_speed_rad_s: 0.5,
        zero_speed_rad_s: 0.1,
        acceleration_rad_s2: 2.0,
        timeout_s: 2.0,
    }
}

/// One energised drive that is set up to home itself.
fn enabled(change: impl Fn(&mut Cia402)) -> Bench {
    let mut settings = settings(1);
    let mut cia402 = *settings.servos[0].protocol.get::<Cia402>().unwrap();
    cia402.homing = Some(homing(17));
    change(&mut cia402);
    settings.servos[0].protocol = cia402.into();
    let mut bench = Bench::with(settings);
    bench.until(DriveState::Disabled, 2_000);
    bench.hold();
    bench.drive_target = taustream_drivers::DriveTarget::Enabled;
    bench.step();
    bench.until(DriveState::Enabled, 200);
    bench.drives[0].seen.clear();
    bench
}

/// Steps until it is so; fails after `most` cycles.
fn until(bench: &mut Bench, most: u64, is: impl Fn(&Bench) -> bool) {
    for _ in 0..most {
        if is(bench) {
            return;
        }
        bench.step();
    }
    panic!("not after {most} cycles: {:?}", bench.status(0));
}

fn mode(bench: &Bench) -> u32 {
    bench.drives[0].objects[&(0x6060, 0)].1
}

/// In its homing mode, without the bit of the mode before.
fn ready(bench: &mut Bench) {
    bench.driver.set_homing(Some(0));
    until(bench, 500, |bench| mode(bench) == 6);
    bench.drives[0].status = ENABLED;
}

/// The start bit is set.
fn running(bench: &mut Bench) {
    ready(bench);
    until(bench, 200, |bench| bench.drives[0].control & 0x10 != 0);
}

fn failure(bench: &Bench) -> (u32, u32) {
    let homing = bench.status(0).homing;
    let HomingState::Failed { code, object } = homing else { panic!("{homing:?}") };
    (code, object)
}

fn written(bench: &Bench) -> Vec<(u16, u8)> {
    let sdo = bench.drives[0].seen.iter().filter(|frame| frame.id().raw() == 0x601);
    let writes = sdo.filter(|frame| frame.data()[0] & 0xE0 == 0x20);
    writes.map(|frame| (u16::from_le_bytes([frame.data()[1], frame.data()[2]]), frame.data()[3])).collect()
}

/// Goal: from request to release, step by step: parameters, mode, start, end, target where it holds, mode, command.
#[test]
fn homing_writes_what_differs_starts_and_returns_where_the_drive_holds() {
    let mut bench = enabled(|_| {});
    // The method is there already, and cannot be written.
    bench.drives[0].objects.insert((0x6098, 0), (1, 17));
    bench.drives[0].fixed.push((0x6098, 0));
    running(&mut bench);
    let mut expected: Vec<(u16, u8)> = PARAMETERS.into_iter().filter(|at| at.0 != 0x6098).collect();
    expected.push((0x6060, 0));
    assert_eq!(written(&bench), expected);
    let gear = bench.settings.servos[0].protocol.get::<Cia402>().unwrap().gear_ratio;
    let rpm = 0.5 * gear * 60.0 / std::f64::consts::TAU;
    assert!((f64::from(bench.drives[0].objects[&(0x6099, 1)].1) - rpm).abs() <= 0.5);
    assert_eq!((bench.status(0).state, bench.status(0).homing), (DriveState::Homing, HomingState::Running));
    // In motion the target is where the drive is.
    for position in [-7_000, -7_100, -7_200] {
        bench.drives[0].position = position;
        bench.steps(3);
        assert_eq!(bench.rpdo(0), Some((0x001F, position)));
    }
    // Homed: the position counts from there, and the drive holds 3 counts beside it.
    bench.drives[0].position = 250;
    bench.drives[0].objects.insert((0x6062, 0), (4, 253));
    bench.drives[0].status = ENABLED | HOMED;
    until(&mut bench, 1_000, |bench| bench.rpdo(0) == Some((0x000F, 253)));
    assert_eq!(mode(&bench), 6, "the target comes before the mode");
    let held = bench.status(0).hold_position_rad;
    assert!(held.is_finite());
    until(&mut bench, 500, |bench| mode(bench) == 8);
    assert_eq!(bench.status(0).homing, HomingState::Returning);
    bench.drives[0].status = ENABLED | FOLLOWS;
    until(&mut bench, 500, |bench| bench.status(0).homing == HomingState::Attained);
    // The command is still where the joint was before: it does not reach the drive.
    bench.driver.set_homing(None);
    bench.steps(100);
    assert_eq!((bench.rpdo(0), bench.status(0).state), (Some((0x000F, 253)), DriveState::Homing));
    bench.commands[0].position_rad = held;
    bench.steps(2);
    assert_eq!((bench.rpdo(0), bench.status(0).state), (Some((0x000F, 253)), DriveState::Enabled));
}

#[test]
fn homing_without_a_request_never_begins_and_without_settings_never_either() {
    let mut bench = enabled(|_| {});
    bench.steps(500);
    assert_eq!((written(&bench), mode(&bench)), (vec![], 8));
    let mut bench = enabled(|cia402| cia402.homing = None);
    bench.driver.set_homing(Some(0));
    bench.steps(500);
    assert_eq!((written(&bench), bench.status(0).state), (vec![], DriveState::Enabled));
}

/// Goal: the position demand of a drive that counts otherwise is not followed.
#[test]
fn homing_returns_where_it_is_measured_when_the_demand_is_elsewhere() {
    let mut bench = enabled(|_| {});
    running(&mut bench);
    bench.drives[0].position = 250;
    bench.drives[0].objects.insert((0x6062, 0), (4, 2_000_000_000));
    bench.drives[0].status = ENABLED | HOMED;
    until(&mut bench, 1_000, |bench| mode(bench) == 8);
    assert_eq!(bench.rpdo(0), Some((0x000F, 250)));
}

/// Goal: each way in which a homing fails has its words, and the drive is back in its position mode.
#[test]
fn homing_that_fails_says_why_and_returns() {
    // What the drive shows after the start, and the words.
    let cases = [
        (ENABLED | ERROR, "statusword bit 13"),
        (ENABLED, "within its time"),
        (ENABLED | 0x0400, "within its time"),
    ];
    for (status, words) in cases {
        let mut bench = enabled(|_| {});
        running(&mut bench);
        bench.drives[0].status = status;
        until(&mut bench, 4_000, |bench| mode(bench) == 8);
        bench.drives[0].status = ENABLED | FOLLOWS;
        until(&mut bench, 500, |bench| matches!(bench.status(0).homing, HomingState::Failed { .. }));
        let (code, object) = failure(&bench);
        let text = bench.driver.explain(code);
        assert!(object == 0 && text.contains(words), "{status:04X}: {text}");
        assert_eq!(bench.status(0).state, DriveState::Homing, "it holds");
    }
}

/// Goal: the end of an earlier homing is not taken for that of this one.
#[test]
fn homing_that_does_not_begin_is_not_taken_for_one_that_has_ended() {
    let mut bench = enabled(|_| {});
    bench.driver.set_homing(Some(0));
    until(&mut bench, 500, |bench| mode(bench) == 6);
    bench.drives[0].status = ENABLED | HOMED;
    until(&mut bench, 2_000, |bench| mode(bench) == 8);
    bench.drives[0].status = ENABLED | FOLLOWS;
    until(&mut bench, 500, |bench| matches!(bench.status(0).homing, HomingState::Failed { .. }));
    let text = bench.driver.explain(failure(&bench).0);
    assert!(text.contains("did not begin"), "{text}");
    // Where nothing moves, it is all that can be seen.
    let mut bench = enabled(|cia402| cia402.homing = Some(homing(37)));
    bench.driver.set_homing(Some(0));
    until(&mut bench, 500, |bench| mode(bench) == 6);
    bench.drives[0].status = ENABLED | HOMED;
    until(&mut bench, 2_000, |bench| mode(bench) == 8);
    bench.drives[0].status = ENABLED | FOLLOWS;
    until(&mut bench, 500, |bench| bench.status(0).homing == HomingState::Attained);
}

/// Goal: an object that is refused ends it before anything moves, and names the object and the remedy.
#[test]
fn homing_parameter_that_is_refused_is_named_before_anything_moves() {
    for (index, sub) in PARAMETERS {
        let mut bench = enabled(|_| {});
        bench.drives[0].refused.insert((index, sub), 0x0602_0000);
        bench.driver.set_homing(Some(0));
        until(&mut bench, 1_000, |bench| matches!(bench.status(0).homing, HomingState::Failed { .. }));
        let (code, object) = failure(&bench);
        assert_eq!(object, u32::from(index) << 8 | u32::from(sub));
        let refusal = taustream_drivers::bring_up::Refusal { code, object, numbers: [0.0; 2] };
        let text = explain_refusal(&refusal);
        assert!(text.contains(&format!("absent_objects = [0x{index:04X}]")), "{text}");
        assert_eq!(mode(&bench), 8);
        // Its owner says that it is fixed in the drive.
        let listed = OptionalObject::from_index(index).unwrap();
        let mut bench = enabled(|cia402| cia402.features.absent = cia402.features.absent.with(listed));
        bench.drives[0].refused.insert((index, sub), 0x0602_0000);
        running(&mut bench);
    }
}

/// Goal: an object that holds another value than the one that it confirmed ends it likewise.
#[test]
fn homing_parameter_that_is_not_taken_is_named() {
    let mut bench = enabled(|_| {});
    bench.drives[0].stuck.insert((0x6099, 1), 9);
    bench.driver.set_homing(Some(0));
    until(&mut bench, 1_000, |bench| matches!(bench.status(0).homing, HomingState::Failed { .. }));
    assert_eq!(failure(&bench).1, 0x0060_9901);
    assert_eq!(bench.status(0).refused_numbers[0].to_bits(), 9.0_f64.to_bits());
}

/// Goal: a drive that does not stop by halt is stopped by quick stop.
#[test]
fn homing_that_halt_does_not_stop_ends_by_quick_stop() {
    let mut bench = enabled(|_| {});
    running(&mut bench);
    bench.driver.set_homing(None);
    bench.step();
    assert_eq!(bench.rpdo(0).unwrap().0, 0x010F, "at once");
    for cycle in 0..1_500 {
        bench.drives[0].position += 50;
        bench.step();
        let control = bench.rpdo(0).unwrap().0;
        if control == 0x0002 {
            assert!(cycle > 900, "halt has its second");
            return;
        }
        assert_eq!(control, 0x010F);
    }
    panic!("no quick stop");
}

/// Goal: without feedback nobody homes: the drive is halted, and then stopped by quick stop, because nothing shows that it rests.
#[test]
fn homing_without_feedback_is_stopped() {
    let mut bench = enabled(|_| {});
    running(&mut bench);
    bench.drives[0].silent = true;
    until(&mut bench, 200, |bench| bench.rpdo(0).is_some_and(|(control, _)| control == 0x010F));
    until(&mut bench, 1_200, |bench| bench.rpdo(0).is_some_and(|(control, _)| control != 0x010F));
    assert_ne!(bench.rpdo(0).unwrap().0 & 0x10, 0x10);
}

/// Goal: a drive that loses its torque in its homing mode is brought back to its position mode before it counts as disabled.
#[test]
fn homing_that_loses_its_torque_does_not_leave_the_drive_in_its_mode() {
    let mut bench = enabled(|_| {});
    running(&mut bench);
    bench.drive_target = taustream_drivers::DriveTarget::Disabled;
    for _ in 0..1_000 {
        bench.step();
        if bench.status(0).state == DriveState::Disabled {
            assert_eq!(mode(&bench), 8);
            return;
        }
    }
    panic!("{:?}", bench.status(0));
}
