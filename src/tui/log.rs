//! The log: what happened, as lines with a meaning.

use std::collections::VecDeque;

/// How a line of the log is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tone {
    Done,
    Impossible,
    /// A subtask or the task is complete.
    Good,
    /// Something went wrong.
    Bad,
    /// What else is worth knowing.
    Note,
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LogEntry {
    pub(crate) step: Option<u32>,
    /// An action, or a sentence about what happened.
    pub(crate) text: String,
    /// What it came to.
    pub(crate) outcome: String,
    /// How it is meant.
    pub(crate) tone: Tone,
}

/// Lines that the log keeps.
const MOST: usize = 500;

/// What happened, oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct EventLog {
    entries: VecDeque<LogEntry>,
}

impl EventLog {
    /// The lines, oldest first.
    pub(crate) fn entries(&self) -> impl DoubleEndedIterator<Item = &LogEntry> {
        self.entries.iter()
    }

    /// Adds a line, unless it is the last one again. The oldest makes room.
    pub(crate) fn write(&mut self, entry: LogEntry) {
        if self.entries.back() == Some(&entry) {
            return;
        }
        if self.entries.len() == MOST {
            self.entries.pop_front();
        }
        self.entries.push_back(entry);
    }

    /// The last thing that was done at a step, with what it came to.
    pub(crate) fn done_at(&self, step: u32) -> Option<&LogEntry> {
        self.entries.iter().rev().find(|entry| entry.step == Some(step) && !entry.outcome.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(step: u32, text: &str, outcome: &str) -> LogEntry {
        LogEntry { step: Some(step), text: text.into(), outcome: outcome.into(), tone: Tone::Done }
    }

    #[test]
    fn the_log_keeps_the_newest_lines_and_none_twice_in_a_row() {
        let mut log = EventLog::default();
        for step in 0..MOST as u32 + 3 {
            log.write(entry(step, "turn", "ok"));
            log.write(entry(step, "turn", "ok"));
        }
        assert_eq!(log.entries().count(), MOST);
        assert_eq!(log.entries().next().unwrap().step, Some(3));
        log.write(entry(7, "a note", ""));
        assert_eq!(log.done_at(7).unwrap().text, "turn");
        assert!(log.done_at(1).is_none());
    }
}
