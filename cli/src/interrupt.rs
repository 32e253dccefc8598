//! Ctrl-C and termination as a question that waits ask, so that nothing is torn down half-way.
use crate::failure::Failure;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

static CAME: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on SIGHUP (the terminal was closed), SIGINT and SIGTERM raise a flag instead of ending the process.
pub(crate) fn watch() -> Result<(), Failure> {
    let came = CAME.get_or_init(Arc::default);
    for signal in [SIGHUP, SIGINT, SIGTERM] {
        flag::register(signal, Arc::clone(came))
            .map_err(|e| Failure::Failed(format!("signals cannot be watched: {e}")))?;
    }
    Ok(())
}

/// True when a signal has come since [`watch`] or [`forget`].
pub(crate) fn has_come() -> bool {
    CAME.get().is_some_and(|came| came.load(Ordering::SeqCst))
}

/// Lets the next signal be distinguished from those that have come.
pub(crate) fn forget() {
    if let Some(came) = CAME.get() {
        came.store(false, Ordering::SeqCst);
    }
}

/// Ends a wait after a signal.
pub(crate) fn check() -> Result<(), Failure> {
    if has_come() {
        let what = "interrupted: the arm continues; `taustream stop` stops it";
        return Err(Failure::Interrupted(what.to_owned()));
    }
    Ok(())
}
