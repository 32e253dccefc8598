//! What each joint was commanded last: its position, in which cycle, and whether the kernel took it.
//!
//! The one memory of commands. It is filled once a cycle, after `send`, from frames that know their joints; the track, the
//! guard, supervision and the report read it. A joint whose frame was refused was not commanded, whatever became of the
//! others: its last setpoint stays the one before, and the time since then grows.
//!
//! A drive bridges a gap of `tolerated_gap_periods` of its own setpoints, or a whole stall where the settings say that the
//! motion continues (`after_stall`). A joint that misses more, while others continue,
//! has *stopped*: its drive stands at the last setpoint that it got, so nothing but that is commanded until the arm is at
//! rest (`Track`), and supervision stops the others on their path.
use crate::cycle_state::{CycleState, LostSetpoints};
use crate::guard::GuardedCommand;
use taustream_arm::Settings;
use taustream_arm::settings::SETPOINT_EVERY_MAX;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Setpoints that are remembered of a joint: what the third difference needs besides a new one.
pub(crate) const PAST: usize = 3;
/// Setpoints of a joint, sent or lost, over which losses are counted.
const WINDOW: u32 = u32::BITS;

/// One joint's last command.
#[derive(Clone, Copy, Debug)]
pub struct LastSent {
    /// Positions of the newest setpoints that were taken, newest first, rad.
    pub position_rad: [f64; PAST],
    /// The cycles in which.
    pub tick: [u64; PAST],
    /// Velocity of the newest.
    pub velocity_rad_s: f64,
    /// Acceleration of the newest.
    pub acceleration_rad_s2: f64,
    /// Torque that was commanded with the newest.
    pub torque_nm: f64,
    /// The kernel took the newest setpoint that was due.
    pub taken: bool,
    /// Its drive stands at the newest position for want of setpoints.
    pub stopped: bool,
    /// Setpoints lost in a row.
    consecutive_lost: u32,
    /// The last 32 setpoints that were due, newest in bit 0; set where one was lost.
    lost: u32,
    /// Cycles from one setpoint to the next.
    every: u64,
}

impl LastSent {
    /// A joint at rest at the zero pose.
    const ZERO: Self = Self {
        position_rad: [0.0; PAST],
        tick: [2, 1, 0],
        velocity_rad_s: 0.0,
        acceleration_rad_s2: 0.0,
        torque_nm: 0.0,
        taken: true,
        stopped: false,
        consecutive_lost: 0,
        lost: 0,
        every: 1,
    };

    /// The same joint, at rest at `position_rad` since before `tick`.
    #[must_use]
    pub fn at_rest(self, position_rad: f64, tick: u64) -> Self {
        Self {
            position_rad: [position_rad; PAST],
            tick: [tick, tick.saturating_sub(1), tick.saturating_sub(2)],
            velocity_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
            ..self
        }
    }

    /// Periods from the newest setpoint to cycle `tick`: at least one.
    #[must_use]
    pub fn periods_to(&self, tick: u64) -> u64 {
        tick.saturating_sub(self.tick[0]).max(1)
    }

    fn take(&mut self, setpoint: [f64; 3], tick: u64) {
        let [position_rad, velocity_rad_s, acceleration_rad_s2] = setpoint;
        let [q1, q2, _] = self.position_rad;
        let [t1, t2, _] = self.tick;
        self.position_rad = [position_rad, q1, q2];
        self.tick = [tick, t1, t2];
        (self.velocity_rad_s, self.acceleration_rad_s2) = (velocity_rad_s, acceleration_rad_s2);
    }

    fn note(&mut self, taken: bool) {
        self.taken = taken;
        self.lost = self.lost << 1 | u32::from(!taken);
        self.consecutive_lost = if taken { 0 } else { self.consecutive_lost.saturating_add(1) };
    }
}

/// The last commands of all joints.
#[derive(Clone, Debug)]
pub struct Ledger {
    joints: usize,
    /// Periods of its own setpoints that a drive bridges.
    tolerated: u64,
    /// Lost setpoints among the last 32 of a joint that are tolerated.
    lost_max: u32,
    last: [LastSent; MAX_JOINTS],
    commanded_rad: JointArray,
    /// The newest cycle in which anything left.
    left_tick: u64,
}

impl Ledger {
    /// The zero pose at rest.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let joints = settings.robot.joints.len();
        let mut ledger = Self::of_joints(joints);
        ledger.tolerated = u64::from(settings.bridged_gap_periods()).max(1);
        ledger.lost_max = settings.lost_cycles_max().max(1).saturating_mul(2).min(WINDOW - 1);
        for servo in &settings.servos {
            let every = settings.buses.get(servo.bus).map_or(1, |bus| bus.traffic.setpoint_every);
            if let Some(last) = ledger.last.get_mut(servo.joint) {
                last.every = u64::from(every.clamp(1, SETPOINT_EVERY_MAX));
            }
        }
        ledger
    }

    /// So many joints that get a setpoint in every cycle, at rest at the zero pose.
    #[must_use]
    pub fn of_joints(joints: usize) -> Self {
        Self {
            joints,
            tolerated: 1,
            lost_max: WINDOW - 1,
            last: [LastSent::ZERO; MAX_JOINTS],
            commanded_rad: [0.0; MAX_JOINTS],
            left_tick: 0,
        }
    }

    /// Every joint's last command.
    #[must_use]
    pub fn joints(&self) -> &[LastSent; MAX_JOINTS] {
        &self.last
    }

    /// The position that each joint was commanded last.
    #[must_use]
    pub fn position_rad(&self) -> JointArray {
        self.last.map(|last| last.position_rad[0])
    }

    /// The pose of the newest cycle that left. A joint whose turn has not come counts with the position that it is on the
    /// way to; one whose setpoint was lost, or whose bus has failed, with its last.
    #[must_use]
    pub fn commanded_rad(&self) -> &JointArray {
        &self.commanded_rad
    }

    /// True when a setpoint of the joint is still to be sent before its drive knows `position_rad`. A joint that has had
    /// none for longer than from one turn to the next gets none: its driver has nothing to say to it.
    #[must_use]
    pub fn awaits(&self, joint: usize, position_rad: f64, tick: u64) -> bool {
        let Some(last) = self.last.get(joint) else { return false };
        let differs = last.position_rad[0].to_bits() != position_rad.to_bits();
        differs && (last.consecutive_lost > 0 || last.periods_to(tick) <= last.every)
    }

    /// Finds the joints that have missed more setpoints than their drives bridge, before a cycle's setpoint is made. Where
    /// nothing left at all the whole arm stands, and the track deals with it.
    ///
    /// Real time: no allocation.
    pub fn find_stopped(&mut self, cycle_state: &mut CycleState) {
        let tick = cycle_state.tick.number;
        if tick.saturating_sub(self.left_tick) > self.tolerated {
            return;
        }
        for (joint, last) in self.last.iter_mut().enumerate().take(self.joints) {
            if last.consecutive_lost > 0 && last.periods_to(tick) > self.tolerated * last.every {
                *last =
                    LastSent { stopped: true, tick: last.tick, ..last.at_rest(last.position_rad[0], tick) };
            }
            if last.stopped && cycle_state.lost.is_none() {
                cycle_state.lost =
                    Some(LostSetpoints { joint, count: last.consecutive_lost, tolerated: None });
            }
        }
    }

    /// Notes what became of this cycle's setpoints. `restart` tells that the drives stand still: earlier commands do not
    /// count.
    ///
    /// Real time: no allocation.
    pub fn record(&mut self, command: &GuardedCommand, restart: bool, cycle_state: &mut CycleState) {
        let tick = cycle_state.tick.number;
        let left = cycle_state.setpoints_sent();
        let (joints, command) = (command.joints(), command.setpoint());
        let lost_max = self.lost_max;
        for (joint, last) in self.last.iter_mut().enumerate().take(self.joints) {
            let (due, taken) = (cycle_state.due.contains(joint), cycle_state.taken.contains(joint));
            let position_rad = command.position_rad[joint];
            if restart && left {
                last.stopped = false;
                *last = last.at_rest(last.position_rad[0], tick);
            }
            if !cycle_state.live || cycle_state.unreachable[joint] {
                // Nothing depends on a setpoint before drives are energised, or after their bus has failed.
                (last.lost, last.consecutive_lost) = (0, 0);
            } else if due {
                last.note(taken);
            }
            if taken && restart {
                *last = last.at_rest(position_rad, tick);
            } else if taken {
                let rates = [command.velocity_rad_s[joint], command.acceleration_rad_s2[joint]];
                last.take([position_rad, rates[0], rates[1]], tick);
            }
            if taken || !cycle_state.live {
                last.torque_nm = joints[joint].torque_nm;
            }
            let waits = !due && !cycle_state.unreachable[joint];
            if left {
                self.commanded_rad[joint] = if waits { position_rad } else { last.position_rad[0] };
            }
            let count = last.lost.count_ones();
            if cycle_state.lost.is_none() && count > lost_max {
                cycle_state.lost = Some(LostSetpoints { joint, count, tolerated: Some(lost_max) });
            }
        }
        if left {
            self.left_tick = tick;
        }
    }

    /// The joints of the path stand at this pose.
    ///
    /// Real time: copies.
    pub fn set_pose(&mut self, position_rad: &JointArray, tick: u64) {
        for (last, position_rad) in self.last.iter_mut().zip(position_rad).take(self.joints) {
            *last = LastSent { every: last.every, ..LastSent::ZERO }.at_rest(*position_rad, tick);
        }
        self.commanded_rad = self.position_rad();
    }

    /// The arm stands where each joint was commanded last.
    ///
    /// Real time: copies.
    pub fn rest(&mut self, tick: u64) {
        for last in &mut self.last {
            last.stopped = false;
            *last = last.at_rest(last.position_rad[0], tick);
        }
        self.commanded_rad = self.position_rad();
    }
}
