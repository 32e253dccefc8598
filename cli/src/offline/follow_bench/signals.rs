//! Motions that senders of targets mean.

/// A motion of one joint, as whoever sends targets means it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Signal {
    /// 0.5 rad at 0.5 Hz.
    Swing,
    /// Like a hand that is tracked: slow and quick parts, 0.1 to 2.7 Hz, with tremor and noise of the tracker.
    Hand,
}

/// Amplitude (rad), frequency (Hz) and phase of the parts of a hand's motion; tremor last.
const HAND: [[f64; 3]; 7] = [
    [0.35, 0.11, 0.3],
    [0.20, 0.37, 1.9],
    [0.10, 0.73, 4.1],
    [0.045, 1.21, 2.2],
    [0.018, 1.93, 5.0],
    [0.008, 2.71, 0.7],
    [0.0008, 9.1, 1.1],
];
/// Amplitude of the tracker's noise, rad.
const NOISE_RAD: f64 = 0.0005;

impl Signal {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Swing => "swing",
            Self::Hand => "hand",
        }
    }

    /// Where the joint is meant to be, rad.
    pub(super) fn at(self, t_s: f64) -> f64 {
        let wave = |[amplitude_rad, hz, phase]: [f64; 3]| {
            amplitude_rad * (std::f64::consts::TAU * hz * t_s + phase).sin()
        };
        match self {
            Self::Swing => wave([0.5, 0.5, 0.0]),
            Self::Hand => HAND.into_iter().map(wave).sum(),
        }
    }

    /// What a sender measures of it: the k-th target.
    pub(super) fn target(self, k: u32, t_s: f64) -> f64 {
        match self {
            Self::Swing => self.at(t_s),
            // A fixed sequence without a pattern: the golden ratio's multiples.
            Self::Hand => {
                self.at(t_s) + NOISE_RAD * (2.0 * (f64::from(k) * 0.618_033_988_749_894_9).fract() - 1.0)
            }
        }
    }
}
