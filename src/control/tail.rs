//! What happens in a run, for whoever listens.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};

/// The last events, and those who hear of the next.
#[derive(Debug, Default)]
pub(crate) struct Tail {
    state: Mutex<Listeners>,
}

#[derive(Debug, Default)]
struct Listeners {
    last: VecDeque<String>,
    listeners: Vec<SyncSender<String>>,
}

/// Events that one who begins to listen still hears of.
const KEPT: usize = 10;
/// Lines that one who listens may be behind; one who is further behind is dropped, so that a run never waits.
const BEHIND: usize = 1000;

impl Tail {
    /// Something happened.
    pub(crate) fn say(&self, line: String) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.listeners.retain(|listener| listener.try_send(line.clone()).is_ok());
        state.last.push_back(line);
        if state.last.len() > KEPT {
            state.last.pop_front();
        }
    }

    /// The last events and all that follow.
    pub(super) fn listen(&self) -> Receiver<String> {
        let (tell, heard) = sync_channel(BEHIND);
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        for line in &state.last {
            let _ = tell.try_send(line.clone());
        }
        state.listeners.push(tell);
        heard
    }

    /// Nothing happens any more.
    pub(super) fn end(&self) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).listeners.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_who_listens_hears_the_last_and_the_next_and_one_who_does_not_read_is_dropped() {
        let tail = Tail::default();
        (0..20).for_each(|number| tail.say(number.to_string()));
        let (reads, lazy) = (tail.listen(), tail.listen());
        assert_eq!(reads.try_iter().collect::<Vec<_>>(), (10..20).map(|number| number.to_string()).collect::<Vec<_>>());
        for number in 0..2 * BEHIND {
            tail.say(number.to_string());
            assert_eq!(reads.try_recv().unwrap(), number.to_string());
        }
        assert_eq!(lazy.iter().count(), BEHIND);
        tail.end();
        assert_eq!(reads.iter().count(), 0);
    }
}
