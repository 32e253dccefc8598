//! Digital inputs of a drive (0x60FD): a limit switch in motion, switches that are only said, and drives without the object.
use super::arm::{Arm, shipped};
use super::quirks::{ELBOW, said_when, state, with_objects};
use taustream_arm::Settings;
use taustream_drivers::sim::FaultRequest;
use taustream_drivers::words::explain_status;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

fn with_inputs(mut settings: Settings) -> Settings {
    state(&mut settings, |features| features.digital_inputs = true);
    settings
}

/// Makes inputs of the elbow's drive active, from now on.
fn activate(arm: &mut Arm, bits: u8) {
    let names = arm.simulator.joints();
    let request = FaultRequest::parse(&format!("joint=elbow,kind=inputs,value={bits}"), &names).unwrap();
    arm.simulator.request(arm.now, request);
}

fn words(arm: &Arm) -> String {
    explain_status(Some("cia402"), arm.status(ELBOW).status_word)
}

/// Cycles until the elbow is in this state; how many it took.
fn cycles_to(arm: &mut Arm, state: DriveState, most: u32) -> u32 {
    for cycles in 0..most {
        if arm.status(ELBOW).state == state {
            return cycles;
        }
        arm.cycle(DriveTarget::Enabled);
    }
    panic!("not {state:?} after {most} cycles: {:?}", arm.status(ELBOW));
}

/// Goal: a limit switch that becomes active while the drive follows is a fault of its joint, named; the drive keeps its torque and
/// goes on to follow, so that the arm can be stopped on its path.
#[test]
fn limit_switch_in_motion_is_a_fault_that_names_it() {
    for (bits, name, other) in [(1, "negative", "positive"), (2, "positive", "negative")] {
        let mut arm = Arm::with(with_inputs(shipped()));
        arm.enable();
        arm.move_and_measure(0.3);
        activate(&mut arm, bits);
        let cycles = cycles_to(&mut arm, DriveState::Fault, 50);
        assert!(cycles > 0, "it was in fault before");
        let said = arm.driver.explain(arm.status(ELBOW).error_code);
        assert!(said.contains(&format!("{name} limit switch has become active")), "{said}");
        assert!(
            words(&arm).contains(&format!("internal limit active, {name} limit switch active")),
            "{}",
            words(&arm)
        );
        assert!(!words(&arm).contains(other), "{}", words(&arm));
        assert!(arm.simulator.drive(ELBOW).unwrap().is_enabled(), "it lost its torque");
        let worst_rad = arm.move_and_measure(0.2)[ELBOW];
        // The motion before ended without a ramp; a joint that did not follow would be 0.3 rad off.
        assert!((1e-9..0.02).contains(&worst_rad), "it does not follow the stop: {worst_rad} rad");
        let all = arm.states();
        assert!((0..6).all(|joint| joint == ELBOW || all[joint] == DriveState::Enabled), "{all:?}");

        // Still on the switch, it may be led off it; then the switch counts again.
        arm.driver.clear_faults();
        cycles_to(&mut arm, DriveState::Enabled, 10);
        for _ in 0..500 {
            arm.cycle(DriveTarget::Enabled);
        }
        assert_eq!(arm.status(ELBOW).state, DriveState::Enabled, "one that was active already is no fault");
        arm.simulator.clear(Some(ELBOW));
        for _ in 0..500 {
            arm.cycle(DriveTarget::Enabled);
        }
        assert!(!words(&arm).contains("limit"), "{}", words(&arm));
        activate(&mut arm, bits);
        cycles_to(&mut arm, DriveState::Fault, 50);
    }
}

/// Goal: a joint that stands on its switch can be energised, and the switch is said.
#[test]
fn joint_on_its_switch_is_energised() {
    let mut arm = Arm::with(with_inputs(shipped()));
    arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    activate(&mut arm, 1);
    for _ in 0..300 {
        arm.cycle(DriveTarget::Disabled);
    }
    assert!(words(&arm).contains("negative limit switch active"), "{}", words(&arm));
    arm.enable();
}

/// Goal: home switch and interlock are words of the status within their period, and no fault; they show by no bit of the statusword.
#[test]
fn home_switch_and_interlock_are_said() {
    let mut arm = Arm::with(with_inputs(shipped()));
    arm.enable();
    activate(&mut arm, 0xC);
    for _ in 0..300 {
        arm.cycle(DriveTarget::Enabled);
    }
    assert!(words(&arm).ends_with(", home switch active, interlock active"), "{}", words(&arm));
    assert_eq!(arm.status(ELBOW).state, DriveState::Enabled);
}

/// Goal: without the key the object is not read, and a switch is the drive's own affair.
#[test]
fn inputs_are_read_by_key_alone() {
    for (settings, reads) in [(shipped(), false), (with_inputs(shipped()), true)] {
        let mut arm = Arm::with(settings);
        arm.enable();
        activate(&mut arm, 1);
        let mut asked = 0;
        for _ in 0..1_000 {
            arm.cycle(DriveTarget::Enabled);
            asked += arm.sent.iter().filter(|frame| frame.data().starts_with(&[0x40, 0xFD, 0x60])).count();
        }
        assert_eq!(asked > 0, reads);
        // Every 200 ms, and once for the bit of the statusword: what `check` counts.
        assert!(asked <= 7, "{asked} requests in a second");
        assert_eq!(arm.status(ELBOW).state == DriveState::Fault, reads);
    }
}

#[test]
fn drive_without_digital_inputs_is_refused_with_the_key() {
    let settings = || with_objects(&["object=0x60FD,value=absent"]);
    let said = said_when(&mut Arm::with(with_inputs(settings())), DriveState::Refused, 3_000);
    assert!(said.starts_with("object 0x60FD:00") && said.contains("take digital_inputs out"), "{said}");
    said_when(&mut Arm::with(settings()), DriveState::Disabled, 3_000);
}
