//! Settings that only make sense together.
//!
//! Each is fine by itself; their owner would find out by an arm that stops for no reason, or does not stop in time.
use crate::bus_load::{BusLoad, HEARTBEAT_MS, REFUSED_PERCENT};
use crate::reader::FaultList;
use crate::settings::{CycleSettings, Settings, Supervision, Traffic};

/// Times that only make sense in one order.
pub(crate) fn check_times(fault_list: &FaultList, cycle: &CycleSettings, supervision: &Supervision) {
    let period_ms = f64::from(cycle.period_us) * 1e-3;
    let gap_ms = f64::from(cycle.tolerated_gap_periods) * period_ms;
    let (watchdog_ms, stall_ms) = (cycle.drive_watchdog_ms, cycle.stall_resume_ms);
    // A gap that trips the drives cannot be one that they bridge.
    if f64::from(watchdog_ms) <= gap_ms {
        let expected =
            format!("more than the tolerated gap of {gap_ms} ms (tolerated_gap_periods x period_us)");
        fault_list.add(None, "cycle.drive_watchdog_ms", &watchdog_ms.to_string(), &expected);
    }
    if stall_ms > watchdog_ms {
        let expected = format!("at most drive_watchdog_ms = {watchdog_ms}: after it the drives have tripped");
        fault_list.add(None, "cycle.stall_resume_ms", &stall_ms.to_string(), &expected);
    }
    // A stall of ours must be reported as such before the drives count their master as lost. Its last heartbeat may have left
    // a whole heartbeat's time before the stall.
    let heartbeat_ms = watchdog_ms.saturating_add(u32::from(HEARTBEAT_MS));
    if u32::from(cycle.heartbeat_lost_ms) <= heartbeat_ms {
        let expected = format!(
            "more than {heartbeat_ms} ms: drive_watchdog_ms = {watchdog_ms} and the {HEARTBEAT_MS} ms between two heartbeats"
        );
        fault_list.add(None, "cycle.heartbeat_lost_ms", &cycle.heartbeat_lost_ms.to_string(), &expected);
    }
    // Our own stop keeps the arm on its path; the drives' does not, so ours must come first.
    let lost_ms = f64::from(supervision.lost_cycles_max) * period_ms;
    if lost_ms >= f64::from(watchdog_ms) {
        let expected = format!("fewer cycles than drive_watchdog_ms = {watchdog_ms} (now {lost_ms} ms)");
        fault_list.add(
            None,
            "supervision.lost_cycles_max",
            &supervision.lost_cycles_max.to_string(),
            &expected,
        );
    }
    // Feedback is one cycle old when it is looked at; below two periods, jitter alone would stop the arm.
    let age_ms = supervision.feedback_age_s_max * 1e3;
    if age_ms < 2.0 * period_ms {
        let expected = format!("at least two periods, {} s", 2e-3 * period_ms);
        fault_list.add(
            None,
            "supervision.feedback_age_s_max",
            &format!("{:?}", supervision.feedback_age_s_max),
            &expected,
        );
    }
}

/// A step that a joint makes at full speed, over the gap that is tolerated, is no jump.
pub(crate) fn check_jump(fault_list: &FaultList, settings: &Settings) {
    let period_s = f64::from(settings.cycle.period_us) * 1e-6;
    let longest_s = f64::from(settings.cycle.tolerated_gap_periods + 1) * period_s;
    let jump_rad = settings.supervision.position_jump_rad_max;
    let fastest = settings
        .all_slots()
        .max_by(|a, b| a.limits.motion.velocity_rad_s.total_cmp(&b.limits.motion.velocity_rad_s));
    let Some(joint) = fastest else { return };
    let step_rad = joint.limits.motion.velocity_rad_s * longest_s;
    if jump_rad <= step_rad {
        let expected = format!(
            "more than {step_rad:.5} rad, which joint {} makes in {longest_s} s at full speed",
            joint.name
        );
        fault_list.add(None, "supervision.position_jump_rad_max", &format!("{jump_rad:?}"), &expected);
    }
}

/// An arm with joints that fall begins slowly after each enable: what falls in motion falls harder.
pub(crate) fn check_limp_risk(fault_list: &FaultList, settings: &Settings) {
    let first_percent = settings.supervision.first_speed_percent;
    let Some(servo) = settings.servos.iter().find(|servo| servo.limp_risk_acknowledged) else { return };
    if first_percent > LIMP_RISK_PERCENT_MAX {
        let joint = settings.slot(servo.joint).map_or("?", |slot| &slot.name);
        let expected = format!(
            "at most {LIMP_RISK_PERCENT_MAX} percent: joint {joint} falls when commands stop (limp_risk_acknowledged), and each \
             enable begins at this speed"
        );
        fault_list.add(None, "supervision.first_speed_percent", &format!("{first_percent:?}"), &expected);
    }
}

/// Highest first speed of an arm with joints that fall.
const LIMP_RISK_PERCENT_MAX: f64 = 25.0;

/// A bus that its own cycle does not fit on would lose setpoints from the first second.
pub(crate) fn check_loads(fault_list: &FaultList, settings: &Settings) {
    for (i, bus) in settings.buses.iter().enumerate() {
        let Some(load) = settings.bus_load(i).filter(BusLoad::is_refused) else { continue };
        let value = format!("{:.1} % full in the worst case", load.percent);
        let best =
            settings.remedies(i).into_iter().filter(|remedy| remedy.suffices).map(|remedy| remedy.what);
        let remedies: Vec<String> = best.take(2).collect();
        let expected = format!(
            "at most {REFUSED_PERCENT} % on {}, for instance by {} (`taustream check` lists all remedies)",
            bus.interface,
            if remedies.is_empty() { "more buses".to_owned() } else { remedies.join("; or by ") }
        );
        fault_list.add(None, &format!("bus[{i}]"), &value, &expected);
    }
}

/// Rarer setpoints and answers only make sense within the limits of supervision.
pub(crate) fn check_traffic(fault_list: &FaultList, settings: &Settings) {
    let period_ms = f64::from(settings.cycle.period_us) * 1e-3;
    for (i, bus) in settings.buses.iter().enumerate() {
        let Traffic { setpoint_every, feedback_every, packed, .. } = bus.traffic;
        let servos = settings.servos.iter().filter(|servo| servo.bus == i).count();
        if packed && servos < 2 {
            fault_list.add(
                None,
                &format!("bus[{i}].packed"),
                "true",
                "two servos on the bus that share a frame",
            );
        }
        // What a drive waits for when all goes well, and the gap that it bridges on top, must not trip it.
        let wait_periods = settings.cycle.tolerated_gap_periods + setpoint_every - 1;
        let wait_ms = f64::from(wait_periods) * period_ms;
        let watchdog_ms = settings.cycle.drive_watchdog_ms;
        if setpoint_every > 1 && f64::from(watchdog_ms) <= wait_ms {
            let expected = format!(
                "setpoints that come, with the tolerated gap, more often than every drive_watchdog_ms = \
                 {watchdog_ms} (now {wait_ms} ms)"
            );
            fault_list.add(None, &format!("bus[{i}].setpoint_every"), &setpoint_every.to_string(), &expected);
        }
        // One answer is one cycle old when it is looked at; below one more, jitter alone would stop the arm.
        let age_s = settings.supervision.feedback_age_s_max;
        let least_s = f64::from(feedback_every + 1) * period_ms * 1e-3;
        if feedback_every > 1 && age_s < least_s {
            let expected = format!("feedback_age_s_max = {age_s:?} to be {least_s} s or more");
            fault_list.add(None, &format!("bus[{i}].feedback_every"), &feedback_every.to_string(), &expected);
        }
    }
}
