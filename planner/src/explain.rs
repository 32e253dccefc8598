//! What planning did, stage by stage, for whoever asks why it took so long or found nothing.

/// One stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// What was tried, and what came of it: counts, or what was in the way.
    pub what: String,
    /// How long it took.
    pub took_s: f64,
    /// How long the best verified motion takes after it; `None` while there is none.
    pub motion_s: Option<f64>,
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:>9.2} ms  {}", self.took_s * 1e3, self.what)?;
        match self.motion_s {
            Some(motion_s) => write!(f, "; best motion {motion_s:.3} s"),
            None => Ok(()),
        }
    }
}

/// Why there is no motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Explanation {
    /// What was done, in its order.
    pub stages: Vec<Stage>,
}
