//! The worker of a session on the screen: what it tells, and that its end is waited for.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender};
use std::time::{Duration, Instant};

use super::opening::Open;
use super::update::Msg;
use super::{terminal, worker};
use crate::explore::session::SessionCommand;
use crate::explore::session_file::SessionFile;
use crate::explore::steering::ExplorerControl;

/// How often it is looked whether a worker is still there.
const GLANCE: Duration = Duration::from_millis(10);

/// Where a worker tells what happens, as long as anybody wants to know.
pub(super) struct Told {
    tell: SyncSender<Msg>,
    is_heard: Arc<AtomicBool>,
    /// Those who steer from elsewhere hear it, too.
    control: Arc<ExplorerControl>,
    /// Given back at its end.
    _at_work: AtWork,
}

/// What every worker holds as long as it works, heard or not.
pub(super) type AtWork = Arc<()>;

impl Told {
    pub(super) fn new(
        tell: SyncSender<Msg>,
        is_heard: Arc<AtomicBool>,
        control: Arc<ExplorerControl>,
        at_work: AtWork,
    ) -> Told {
        Told { tell, is_heard, control, _at_work: at_work }
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
pub(super) fn start_worker(open: Open, session: Option<SessionFile>, told: Told) -> io::Result<Sender<SessionCommand>> {
    let tell_event = move |event| {
        told.control.hear(&event);
        told.tell(Msg::Session(event));
    };
    let open = move || {
        let exploration = open()?;
        Ok(match session {
            Some(file) => exploration.kept_in(file),
            None => exploration,
        })
    };
    worker::start(open, tell_event, terminal::say_last_words)
}

/// Waits for those who still compute, also for a session that was left for another one: libtorch must not be taken down under
/// them, as the end of the program does.
pub(super) fn let_work_end(messages: &Receiver<Msg>, at_work: AtWork, until: Instant) {
    let workers = Arc::downgrade(&at_work);
    drop(at_work);
    while workers.strong_count() > 0 {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return;
        }
        // Unheard, a worker would wait for room in the queue for ever.
        match messages.recv_timeout(left.min(GLANCE)) {
            Ok(_) | Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(left.min(GLANCE)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use super::*;

    fn told(tell: &SyncSender<Msg>, is_heard: bool, at_work: &AtWork) -> Told {
        let is_heard = Arc::new(AtomicBool::new(is_heard));
        Told::new(tell.clone(), is_heard, ExplorerControl::new(|| true), at_work.clone())
    }

    #[test]
    fn the_end_waits_for_those_who_still_compute_and_hears_them_out() {
        let (tell, messages) = sync_channel(1);
        let computed = Arc::new(AtomicBool::new(false));
        let at_work = AtWork::default();
        let (done, gone) = (computed.clone(), told(&tell, true, &at_work));
        std::thread::spawn(move || {
            let _gone = gone;
            // The queue holds one message: unheard, the worker would wait here for ever.
            for _ in 0..3 {
                tell.send(Msg::Paste(String::new())).unwrap();
            }
            done.store(true, Ordering::Relaxed);
        });
        let_work_end(&messages, at_work, Instant::now() + Duration::from_secs(60));
        assert!(computed.load(Ordering::Relaxed));
    }

    #[test]
    fn the_end_waits_for_the_worker_of_a_session_that_was_left_for_another_one() {
        let (tell, messages) = sync_channel(1);
        let at_work = AtWork::default();
        let (left, goes) = std::sync::mpsc::channel::<()>();
        let computed = Arc::new(AtomicBool::new(false));
        let (done, gone) = (computed.clone(), told(&tell, false, &at_work));
        std::thread::spawn(move || {
            let _gone = gone;
            goes.recv().unwrap();
            done.store(true, Ordering::Relaxed);
        });
        // The session that is shown has ended.
        drop(told(&tell, true, &at_work));
        left.send(()).unwrap();
        let_work_end(&messages, at_work, Instant::now() + Duration::from_secs(60));
        assert!(computed.load(Ordering::Relaxed));
    }

    #[test]
    fn the_end_does_not_wait_for_a_worker_past_its_time() {
        let (tell, messages) = sync_channel(1);
        let at_work = AtWork::default();
        let still_working = told(&tell, true, &at_work);
        drop(tell);
        let_work_end(&messages, at_work, Instant::now());
        assert!(messages.try_recv().is_err(), "the worker is still there, and has said nothing");
        drop(still_working);
        assert!(matches!(messages.try_recv(), Ok(Msg::WorkerGone)));
    }
}
