//! Scenarios one after another, each repeated, with a message, where the host held the whole machine up: the arm then pauses or faults, as it must, and the
//! scenario's own event never comes. A fault of the product comes back in every try.
use anyhow::{Error, Result};
use std::time::Instant;

/// How often a scenario is tried on a host that stalls the machine. Beside ordinary load on all processors one in 80 needed a
/// second try.
const TRIES: usize = 4;

/// A scenario that did not end well.
#[derive(Debug)]
pub struct Failed {
    /// What did not hold.
    pub error: Error,
    /// The host held the machine up: the streamer's own counters say so.
    pub stalled: bool,
}

impl<E: Into<Error>> From<E> for Failed {
    fn from(error: E) -> Self {
        Self { error: error.into(), stalled: false }
    }
}

/// Performs a scenario, which gets the number of the attempt and says what was seen; prints how it went. Whether it
/// passed.
pub fn passes(name: &str, perform: impl Fn(usize) -> Result<String, Failed>) -> bool {
    let since = Instant::now();
    let result = with_retries(name, perform);
    let took_s = since.elapsed().as_secs_f64();
    match &result {
        Ok(seen) => println!("ok     {name}: {seen}; {took_s:.1} s"),
        Err(error) => println!("FAILED {name}: {error:#}; {took_s:.1} s"),
    }
    result.is_ok()
}

/// Again only after a stall of the host; what did not hold in the last try is the error.
fn with_retries<T>(name: &str, perform: impl Fn(usize) -> Result<T, Failed>) -> Result<T> {
    for attempt in 1..TRIES {
        match perform(attempt) {
            Err(Failed { error, stalled: true }) => {
                let reason: String = format!("{error:#}").chars().take(400).collect();
                println!("       {name}: the host stalled the machine, trying again: {reason}");
            }
            outcome => return outcome.map_err(|failed| failed.error),
        }
    }
    perform(TRIES).map_err(|failed| failed.error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::anyhow;
    use std::cell::Cell;

    fn tries(stalled: bool, good_at: usize) -> (usize, bool) {
        let made = Cell::new(0);
        let outcome = with_retries("a", |attempt| {
            made.set(attempt);
            if attempt == good_at { Ok(()) } else { Err(Failed { error: anyhow!("no"), stalled }) }
        });
        (made.get(), outcome.is_ok())
    }

    #[test]
    fn scenario_is_tried_again_after_a_stall_only() {
        assert_eq!(tries(false, 9), (1, false));
        assert_eq!(tries(true, 9), (4, false));
        assert_eq!(tries(true, 2), (2, true));
        assert_eq!(tries(false, 1), (1, true));
    }
}
