//! The motion of an axis: every state change, and its limits under random commands, by differences of what it commands.
mod common;

use common::SeededRng;
use taustream_motion::axis::{Activity, AxisFeedback, AxisMotion, ContactRule};
use taustream_motion::brake::Brake;
use taustream_motion::{JointLimits, LimitSet};

const DT_S: f64 = 1e-3;
const FORCE_NM: f64 = 0.6;

fn limits() -> JointLimits {
    let motion = LimitSet { velocity_rad_s: 2.0, acceleration_rad_s2: 20.0, jerk_rad_s3: 400.0 };
    let stop = LimitSet { velocity_rad_s: 2.0, acceleration_rad_s2: 40.0, jerk_rad_s3: 1600.0 };
    JointLimits { position_rad: [0.0, 1.5], motion, stop }
}

const RULE: ContactRule = ContactRule { lag_rad: 0.1, torque_nm: FORCE_NM, time_s: 0.02, squeeze_rad: 0.05 };

fn gripper(at_rad: f64) -> AxisMotion {
    let mut axis = AxisMotion::new(limits(), Some(RULE));
    axis.rest_at(at_rad);
    axis
}

fn at(axis: &AxisMotion) -> f64 {
    axis.setpoint().state.position_rad
}

/// A servo without delay that stops at an object, with the torque of a spring.
fn feedback(axis: &AxisMotion, object_rad: f64) -> AxisFeedback {
    let position_rad = at(axis).max(object_rad);
    let lag_rad = at(axis) - position_rad;
    AxisFeedback { position_rad, lag_rad, torque_nm: 10.0 * lag_rad }
}

fn run(axis: &mut AxisMotion, seconds: f64, object_rad: f64) {
    let mut t_s = 0.0;
    while t_s < seconds {
        axis.advance(DT_S);
        let seen = feedback(axis, object_rad);
        axis.observe(&seen, DT_S);
        t_s += DT_S;
    }
}

#[test]
fn axis_goes_to_its_target_in_one_stroke_and_holds() {
    let mut axis = gripper(1.5);
    assert_eq!(axis.activity(), Activity::Holding);
    let stroke_s = axis.stroke_s(0.2);
    axis.go_to(0.2, f64::INFINITY);
    assert_eq!(axis.activity(), Activity::Moving);
    run(&mut axis, stroke_s - 0.01, -10.0);
    assert_eq!(axis.activity(), Activity::Moving);
    run(&mut axis, 0.02, -10.0);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, 0.2));
}

#[test]
fn axis_stopped_in_motion_rests_where_its_brake_ends_and_goes_no_further() {
    let mut axis = gripper(1.5);
    axis.go_to(0.0, f64::INFINITY);
    run(&mut axis, 0.4, -10.0);
    let rest_rad = Brake::from_state(axis.setpoint().state, 40.0, 1600.0).rest_rad();
    axis.stop();
    assert!((axis.target_rad() - rest_rad).abs() < 1e-15);
    run(&mut axis, 1.0, -10.0);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, rest_rad));
    assert!(rest_rad > 0.1, "stopped only at {rest_rad}");
}

#[test]
fn axis_with_a_new_target_in_motion_brakes_and_goes_there() {
    let mut axis = gripper(1.5);
    axis.go_to(0.0, f64::INFINITY);
    run(&mut axis, 0.4, -10.0);
    axis.go_to(1.2, f64::INFINITY);
    assert_eq!((axis.activity(), axis.target_rad()), (Activity::Moving, 1.2));
    run(&mut axis, 0.1, -10.0);
    axis.go_to(1.3, f64::INFINITY);
    run(&mut axis, 3.0, -10.0);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, 1.3));
}

/// Goal: contact by torque holds with that torque, contact by distance by the squeeze at most.
#[test]
fn axis_closing_on_an_object_holds_it_within_the_squeeze() {
    for (torque_nm, ahead_rad) in
        [(0.3, [0.0299, 0.0301]), (0.7, [0.0499, 0.0501]), (f64::INFINITY, [0.0499, 0.0501])]
    {
        let mut axis = gripper(1.5);
        axis.go_to(0.0, torque_nm);
        run(&mut axis, 3.0, 0.7);
        assert_eq!(axis.activity(), Activity::InContact, "{torque_nm}");
        let ahead = 0.7 - at(&axis);
        assert!((ahead_rad[0]..=ahead_rad[1]).contains(&ahead), "{torque_nm} Nm: {ahead} rad ahead");
        // The object is pulled out: there is nothing to hold any more.
        run(&mut axis, 0.1, -10.0);
        assert_eq!(axis.activity(), Activity::Holding);
    }
}

#[test]
fn axis_in_contact_relaxes_to_where_it_is_measured_and_opens_again() {
    let mut axis = gripper(1.5);
    axis.go_to(0.0, FORCE_NM);
    run(&mut axis, 3.0, 0.7);
    axis.relax(0.7);
    run(&mut axis, 1.0, 0.7);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, 0.7));
    axis.go_to(1.5, FORCE_NM);
    run(&mut axis, 3.0, 0.7);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, 1.5));
}

#[test]
fn axis_whose_servo_has_stopped_goes_on_from_rest_to_where_it_was_going() {
    let mut axis = gripper(1.5);
    axis.go_to(0.0, f64::INFINITY);
    run(&mut axis, 0.4, -10.0);
    let stood_rad = at(&axis) + 0.01;
    axis.resume_at(stood_rad);
    assert_eq!((axis.activity(), at(&axis), axis.target_rad()), (Activity::Moving, stood_rad, 0.0));
    axis.stop();
    axis.resume_at(at(&axis));
    run(&mut axis, 2.0, -10.0);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, stood_rad), "a brake is not resumed");
    axis.go_to(0.2, f64::INFINITY);
    run(&mut axis, 3.0, -10.0);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, 0.2));
}

#[test]
fn axis_without_a_rule_knows_no_contact_and_bad_numbers_change_nothing() {
    let mut axis = AxisMotion::new(limits(), None);
    axis.rest_at(1.0);
    for (target_rad, torque_nm) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.5, f64::NAN), (1e9, 1.0)] {
        axis.go_to(target_rad, torque_nm);
        axis.relax(f64::NAN);
        assert_eq!(
            (axis.activity(), axis.target_rad()),
            (Activity::Holding, 1.0),
            "{target_rad} {torque_nm}"
        );
    }
    axis.go_to(0.0, FORCE_NM);
    run(&mut axis, 3.0, 0.7);
    assert_eq!((axis.activity(), at(&axis)), (Activity::Holding, 0.0));
    let mut gripper = gripper(1.0);
    let nothing = AxisFeedback { position_rad: f64::NAN, lag_rad: f64::NAN, torque_nm: f64::NAN };
    (0..100).for_each(|_| gripper.observe(&nothing, DT_S));
    assert_eq!(gripper.activity(), Activity::Holding);
}

/// Goal: whatever is asked at whatever moment, the commands stay inside the range, and their differences inside the stop
/// limits.
#[test]
fn axis_under_random_commands_keeps_range_and_stop_limits() {
    let stop = limits().stop;
    for seed in 0..300 {
        let mut rng = SeededRng::from_seed(seed);
        let start_rad = rng.within(0.0, 1.5);
        let mut axis = gripper(start_rad);
        let mut past = [start_rad; 3];
        for cycle in 0..4000 {
            match rng.whole(0, 150) {
                0 => axis.go_to(rng.within(0.0, 1.5), f64::INFINITY),
                1 => axis.stop(),
                2 => axis.relax(rng.within(-0.5, 2.0)),
                _ => {}
            }
            axis.advance(DT_S);
            let q = at(&axis);
            let [q1, q2, q3] = past;
            let velocity = (q - q1) / DT_S;
            let acceleration = (q - 2.0 * q1 + q2) / DT_S.powi(2);
            let jerk = (q - 3.0 * q1 + 3.0 * q2 - q3) / DT_S.powi(3);
            let where_ = format!("seed {seed}, cycle {cycle}");
            assert!((-1.1e-3..=1.5 + 1.1e-3).contains(&q), "{where_}: at {q}");
            assert!(velocity.abs() <= stop.velocity_rad_s * 1.001, "{where_}: {velocity} rad/s");
            assert!(
                acceleration.abs() <= stop.acceleration_rad_s2 * 1.001,
                "{where_}: {acceleration} rad/s^2"
            );
            assert!(jerk.abs() <= stop.jerk_rad_s3 * 1.001 + 1e-3, "{where_}: {jerk} rad/s^3");
            past = [q, q1, q2];
        }
    }
}
