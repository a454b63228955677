//! Ctrl-C and termination end long work gently: the first asks it to save and stop, the second ends the program at once.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;

/// A flag that is set by the first SIGINT or SIGTERM.
///
/// # Errors
/// When the system refuses a handler.
pub(crate) fn on_signals() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        let second = signal_hook::flag::register_conditional_shutdown(signal, 130, stop.clone());
        second.and_then(|_| signal_hook::flag::register(signal, stop.clone())).context("cannot handle signals")?;
    }
    Ok(stop)
}
