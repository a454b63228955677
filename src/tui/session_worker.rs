//! The worker of a session on the screen: what it tells, and that its end is waited for.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::time::Instant;

use super::opening::Open;
use super::update::Msg;
use super::{terminal, worker};
use crate::explore::session::SessionCommand;
use crate::explore::steering::ExplorerControl;

/// Where a worker tells what happens, as long as anybody wants to know.
pub(super) struct Told {
    tell: SyncSender<Msg>,
    is_heard: Arc<AtomicBool>,
    /// Those who steer from elsewhere hear it, too.
    control: Arc<ExplorerControl>,
}

impl Told {
    pub(super) fn new(tell: SyncSender<Msg>, is_heard: Arc<AtomicBool>, control: Arc<ExplorerControl>) -> Told {
        Told { tell, is_heard, control }
    }

    fn tell(&self, msg: Msg) {
        if self.is_heard.load(Ordering::Relaxed) {
            // Whoever does not listen any more commands nothing any more either.
            drop(self.tell.send(msg));
        }
    }
}

/// Says that the worker and all that it set to work ended, however they did.
impl Drop for Told {
    fn drop(&mut self) {
        self.tell(Msg::WorkerGone);
    }
}

/// Starts the worker that opens an exploration, which is kept in that file as it goes on.
pub(super) fn start_worker(open: Open, session: Option<PathBuf>, told: Told) -> io::Result<Sender<SessionCommand>> {
    let tell_event = move |event| {
        told.control.hear(&event);
        told.tell(Msg::Session(event));
    };
    let open = move || {
        let exploration = open()?;
        Ok(match session {
            Some(path) => exploration.kept_in(path),
            None => exploration,
        })
    };
    worker::start(open, tell_event, terminal::say_last_words)
}

/// Waits for those who still compute: libtorch must not be taken down under them, as the end of the program does.
pub(super) fn let_work_end(messages: &Receiver<Msg>, until: Instant) {
    while let Ok(msg) = messages.recv_timeout(until.saturating_duration_since(Instant::now())) {
        if matches!(msg, Msg::WorkerGone) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;
    use std::time::Duration;

    use super::*;

    fn told(tell: &SyncSender<Msg>) -> Told {
        Told::new(tell.clone(), Arc::new(AtomicBool::new(true)), ExplorerControl::new(|| true))
    }

    #[test]
    fn the_end_waits_for_those_who_still_compute_and_hears_them_out() {
        let (tell, messages) = sync_channel(1);
        let computed = Arc::new(AtomicBool::new(false));
        let (done, gone) = (computed.clone(), told(&tell));
        std::thread::spawn(move || {
            let _gone = gone;
            // The queue holds one message: unheard, the worker would wait here for ever.
            for _ in 0..3 {
                tell.send(Msg::Paste(String::new())).unwrap();
            }
            done.store(true, Ordering::Relaxed);
        });
        let_work_end(&messages, Instant::now() + Duration::from_secs(60));
        assert!(computed.load(Ordering::Relaxed));
    }

    #[test]
    fn the_end_does_not_wait_for_a_worker_past_its_time() {
        let (tell, messages) = sync_channel(1);
        let still_working = told(&tell);
        drop(tell);
        let_work_end(&messages, Instant::now());
        assert!(messages.try_recv().is_err(), "the worker is still there, and has said nothing");
        drop(still_working);
        assert!(matches!(messages.try_recv(), Ok(Msg::WorkerGone)));
    }
}
