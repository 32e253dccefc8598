//! How a motion continues after a stall of the streamer's loop: a gap between two setpoints that the drives do not bridge.
use crate::document::shown;
use crate::protocol::Protocol;
use crate::reader::Table;
use crate::settings::Settings;

/// What follows a stall of up to `stall_resume_ms`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterStall {
    /// The last setpoint again until the joints rest, then a ramp up to speed.
    Freeze,
    /// The setpoint that the path has by now, at full speed.
    GoOn,
}

impl AfterStall {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Freeze, Self::GoOn];

    /// The word in settings.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Freeze => "freeze",
            Self::GoOn => "go-on",
        }
    }
}

const WORDS: &str = "\"freeze\" or \"go-on\": what follows a stall of the streamer's loop";

/// Reads `after_stall`.
pub(crate) fn read(table: &mut Table<'_>, protocol: Option<&Protocol>) -> Option<AfterStall> {
    let word = table.text_if_there("after_stall", WORDS);
    if !table.had("after_stall") {
        return protocol.map(Protocol::after_stall);
    }
    let word = word?;
    let found = AfterStall::ALL.into_iter().find(|policy| policy.word() == word);
    if found.is_none() {
        table.fault("after_stall", &shown(&word), WORDS);
    }
    found
}

impl Settings {
    /// How the arm continues after a stall: all joints move along one path, so one that freezes freezes all.
    #[must_use]
    pub fn after_stall(&self) -> AfterStall {
        let freezes = self.servos.iter().any(|servo| servo.after_stall == AfterStall::Freeze);
        if freezes { AfterStall::Freeze } else { AfterStall::GoOn }
    }

    /// The longest gap between two setpoints, in periods, over which the motion continues along its path.
    #[must_use]
    pub fn bridged_gap_periods(&self) -> u32 {
        let cycle = &self.cycle;
        let stall_periods = cycle.stall_resume_ms.saturating_mul(1_000) / cycle.period_us.max(1);
        match self.after_stall() {
            AfterStall::Freeze => cycle.tolerated_gap_periods,
            AfterStall::GoOn => cycle.tolerated_gap_periods.max(stall_periods),
        }
    }
}
