//! The one table of phases: what may follow what, and on which event.
//!
//! The table knows nothing of drives, times or reasons; `supervise` decides which event has happened. An event
//! that a phase does not list changes nothing. docs: the resumption table describes this table.
use taustream_messages::Phase;

/// What can happen to the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Every drive is configured, not energised, and has given feedback for long enough to know its speed.
    DrivesReady,
    /// A drive that was ready is not any more, without a fault.
    DrivesLost,
    /// Drives were found holding from before this start, and are ours.
    HoldAdopted,
    /// The operator asked for energised drives.
    EnableRequested,
    /// The operator requested the adoption of drives that hold.
    AdoptRequested,
    /// Every drive is energised and follows.
    DrivesEnabled,
    /// A trajectory was accepted.
    Accepted,
    /// The trajectory has been run to its end.
    EndReached,
    /// The operator asked for a pause.
    PauseRequested,
    /// The operator requested to resume.
    ResumeRequested,
    /// The operator asked to stop.
    StopRequested,
    /// sigma has come to 0, or the brake to its end.
    AtRest,
    /// The loop stalled for too long to continue by itself.
    StalledLong,
    /// Something that is answered by a fast stop on the path.
    StopFault,
    /// A setpoint failed the guard.
    GuardTrip,
    /// A fault without motion, or torque off: there is nothing to slow down.
    HardFault,
    /// The fault is cleared and the drives hold.
    ClearedHolding,
    /// The fault is cleared and nothing is energised.
    ClearedOff,
    /// The operator asked for de-energised drives.
    DisableRequested,
    /// Every drive is de-energised.
    DrivesDisabled,
    /// The operator asked a joint to home itself.
    HomeRequested,
    /// Its homing is over, and its drive follows commands again.
    HomingEnded,
}

impl Event {
    /// Every event.
    pub const ALL: [Self; 22] = [
        Self::DrivesReady,
        Self::DrivesLost,
        Self::HoldAdopted,
        Self::EnableRequested,
        Self::AdoptRequested,
        Self::DrivesEnabled,
        Self::Accepted,
        Self::EndReached,
        Self::PauseRequested,
        Self::ResumeRequested,
        Self::StopRequested,
        Self::AtRest,
        Self::StalledLong,
        Self::StopFault,
        Self::GuardTrip,
        Self::HardFault,
        Self::ClearedHolding,
        Self::ClearedOff,
        Self::DisableRequested,
        Self::DrivesDisabled,
        Self::HomeRequested,
        Self::HomingEnded,
    ];

    /// The words that logs show.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::DrivesReady => "drives ready",
            Self::DrivesLost => "a drive is no longer ready",
            Self::HoldAdopted => "holding drives adopted",
            Self::EnableRequested => "enable requested",
            Self::AdoptRequested => "adoption requested",
            Self::DrivesEnabled => "drives energised",
            Self::Accepted => "trajectory accepted",
            Self::EndReached => "end of trajectory",
            Self::PauseRequested => "pause requested",
            Self::ResumeRequested => "resume requested",
            Self::StopRequested => "stop requested",
            Self::AtRest => "at rest",
            Self::StalledLong => "loop stalled",
            Self::StopFault => "fast stop",
            Self::GuardTrip => "guard trip",
            Self::HardFault => "fault",
            Self::ClearedHolding => "fault cleared, drives hold",
            Self::ClearedOff => "fault cleared, drives off",
            Self::DisableRequested => "disable requested",
            Self::DrivesDisabled => "drives de-energised",
            Self::HomeRequested => "homing requested",
            Self::HomingEnded => "homing has ended",
        }
    }
}

/// The phase after an event; `None` when the event means nothing in this phase.
///
/// Real time: a table.
#[must_use]
#[expect(clippy::match_same_arms, reason = "rows are grouped by meaning, not by result")]
pub fn next(phase: Phase, event: Event) -> Option<Phase> {
    use Event as E;
    use Phase as P;
    Some(match (phase, event) {
        (P::Fault, E::HardFault) => return None,
        (_, E::HardFault) => P::Fault,

        (P::Configuring, E::DrivesReady) | (P::Disabling, E::DrivesDisabled) | (P::Fault, E::ClearedOff) => {
            P::Disabled
        }
        (P::Disabled, E::DrivesLost) => P::Configuring,
        (P::Disabled, E::EnableRequested) | (P::Locked, E::AdoptRequested) => P::Enabling,
        (P::Enabling, E::DrivesEnabled) | (P::Locked, E::EnableRequested) => P::Holding,

        (P::Holding, E::Accepted) | (P::Pausing | P::Paused, E::ResumeRequested) => P::Moving,
        (P::Moving | P::Pausing | P::Stopping, E::EndReached)
        | (P::Stopping, E::AtRest)
        | (P::Paused, E::StopRequested) => P::Holding,
        (P::Moving, E::PauseRequested) => P::Pausing,
        (P::Pausing, E::AtRest) | (P::Moving, E::StalledLong) => P::Paused,
        (P::Moving | P::Pausing, E::StopRequested) => P::Stopping,

        (P::Moving | P::Pausing | P::Stopping, E::StopFault) => P::FastStopping,
        (P::Moving | P::Pausing | P::Stopping | P::FastStopping, E::GuardTrip) => P::Braking,
        // At rest, or not yet energised, there is nothing to slow down.
        (P::Holding | P::Paused | P::Locked | P::Enabling | P::Homing, E::StopFault)
        | (P::FastStopping, E::AtRest | E::EndReached)
        | (P::Braking, E::AtRest) => P::Fault,

        (P::Disabled | P::Holding | P::Locked, E::HomeRequested) => P::Homing,
        (P::Fault, E::ClearedHolding)
        | (P::Configuring | P::Disabled, E::HoldAdopted)
        | (P::Homing, E::HomingEnded) => P::Locked,
        (P::Holding | P::Paused | P::Locked | P::Enabling | P::Homing, E::DisableRequested) => P::Disabling,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table as the documentation draws it, one line a phase, written independently of the match above.
    const TABLE: &str = "
        configuring: DrivesReady>disabled HoldAdopted>locked HardFault>fault
        disabled: DrivesLost>configuring HoldAdopted>locked EnableRequested>enabling HomeRequested>homing HardFault>fault
        enabling: DrivesEnabled>holding DisableRequested>disabling StopFault>fault HardFault>fault
        holding: Accepted>moving DisableRequested>disabling HomeRequested>homing StopFault>fault HardFault>fault
        moving: EndReached>holding PauseRequested>pausing StopRequested>stopping StalledLong>paused StopFault>fast-stopping GuardTrip>braking HardFault>fault
        pausing: EndReached>holding ResumeRequested>moving StopRequested>stopping AtRest>paused StopFault>fast-stopping GuardTrip>braking HardFault>fault
        paused: ResumeRequested>moving StopRequested>holding DisableRequested>disabling StopFault>fault HardFault>fault
        stopping: EndReached>holding AtRest>holding StopFault>fast-stopping GuardTrip>braking HardFault>fault
        fast-stopping: EndReached>fault AtRest>fault GuardTrip>braking HardFault>fault
        braking: AtRest>fault HardFault>fault
        fault: ClearedHolding>locked ClearedOff>disabled
        locked: EnableRequested>holding AdoptRequested>enabling DisableRequested>disabling HomeRequested>homing StopFault>fault HardFault>fault
        disabling: DrivesDisabled>disabled HardFault>fault
        homing: HomingEnded>locked DisableRequested>disabling StopFault>fault HardFault>fault";

    fn drawn(phase: Phase, event: Event) -> Option<&'static str> {
        let row = TABLE.lines().find_map(|l| l.trim().strip_prefix(&format!("{}: ", phase.word()))).unwrap();
        let name = format!("{event:?}");
        row.split(' ').find_map(|cell| cell.split_once('>').filter(|(e, _)| *e == name).map(|(_, to)| to))
    }

    #[test]
    fn phases_on_every_event_follow_the_drawn_table() {
        let mut listed = 0;
        for phase in Phase::ALL {
            for event in Event::ALL {
                let got = next(phase, event).map(Phase::word);
                assert_eq!(got, drawn(phase, event), "{phase:?} on {event:?}");
                listed += usize::from(got.is_some());
            }
        }
        assert_eq!(listed, TABLE.matches('>').count(), "the drawn table names an event that does not exist");
    }

    #[test]
    fn phases_after_a_fault_move_only_by_clearing_it() {
        for event in Event::ALL {
            let cleared = matches!(event, Event::ClearedHolding | Event::ClearedOff);
            assert_eq!(next(Phase::Fault, event).is_some(), cleared, "{event:?}");
        }
    }
}
