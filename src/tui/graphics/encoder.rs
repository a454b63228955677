//! The thread that encodes frames. It always takes the newest; older ones that it did not get to are dropped.

use std::sync::{Arc, Condvar, Mutex, PoisonError};

use super::job::Job;
use super::picture::Picture;

/// What has to be drawn before it can be encoded.
type Drawing = Box<dyn FnOnce() -> Job + Send>;

/// A place for one drawing: a newer one replaces it.
#[derive(Default)]
struct WaitingJob {
    job: Option<Drawing>,
    closed: bool,
}

/// Hands frames to the encoding thread; the thread ends when this is dropped.
pub struct PictureEncoder {
    slot: Arc<(Mutex<WaitingJob>, Condvar)>,
}

impl PictureEncoder {
    /// Starts the thread; finished pictures go to `deliver`, which says whether anybody still wants them.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub fn start(deliver: impl Fn(Picture) -> bool + Send + 'static) -> std::io::Result<PictureEncoder> {
        let slot = Arc::new((Mutex::new(WaitingJob::default()), Condvar::new()));
        let shared = slot.clone();
        std::thread::Builder::new().name("encoder".into()).spawn(move || {
            while let Some(job) = take(&shared) {
                if !deliver(Picture::encode(&job())) {
                    break;
                }
            }
        })?;
        Ok(PictureEncoder { slot })
    }

    /// Leaves a frame to be encoded, in place of one that still waits.
    pub(crate) fn submit(&self, job: Job) {
        self.submit_drawing(move || job);
    }

    /// The same of a frame that the thread has to draw first.
    pub(crate) fn submit_drawing(&self, drawing: impl FnOnce() -> Job + Send + 'static) {
        let (slot, filled) = &*self.slot;
        slot.lock().unwrap_or_else(PoisonError::into_inner).job = Some(Box::new(drawing));
        filled.notify_one();
    }
}

impl Drop for PictureEncoder {
    fn drop(&mut self) {
        let (slot, filled) = &*self.slot;
        slot.lock().unwrap_or_else(PoisonError::into_inner).closed = true;
        filled.notify_one();
    }
}

/// Waits for a job; `None` when no more will come.
fn take(shared: &(Mutex<WaitingJob>, Condvar)) -> Option<Drawing> {
    let (slot, filled) = shared;
    let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
    loop {
        if slot.closed {
            return None;
        }
        if let Some(job) = slot.job.take() {
            return Some(job);
        }
        slot = filled.wait(slot).unwrap_or_else(PoisonError::into_inner);
    }
}
