//! When the next frame may be sent: after the terminal said that it has taken in the one before. Otherwise a slow link fills
//! with frames, and what a key does is seen only behind all of them.

use std::time::{Duration, Instant};

/// Asks a terminal whether it is there; it answers `ESC [ 0 n` when it comes to the question.
pub(crate) const QUESTION: &[u8] = b"\x1b[5n";
/// A frame may take so long on its way; then the answer is given up.
const LONGEST: Duration = Duration::from_secs(10);
/// Answers given up in a row, after which no more are waited for.
const GIVEN_UP: u32 = 3;

/// What is known of the terminal's answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Habit {
    /// It was asked for the first time.
    Unknown,
    Answers,
    /// It does not answer: it is neither asked nor waited for, unless an answer comes after all.
    Silent,
}

/// Keeps one frame on its way at most.
pub(crate) struct Pacer {
    habit: Habit,
    /// When the last question was asked, while its answer is out.
    asked: Option<Instant>,
    given_up: u32,
    /// How long a first answer is waited for.
    first: Duration,
}

impl Pacer {
    /// Nothing was asked yet; `first` is how long a first answer is waited for.
    pub(crate) fn new(first: Duration) -> Pacer {
        Pacer { habit: Habit::Unknown, asked: None, given_up: 0, first }
    }

    /// How long the next frame has to wait, unless an answer comes; `None` where it may be sent now.
    pub(crate) fn waits(&mut self, now: Instant) -> Option<Duration> {
        let limit = if self.habit == Habit::Unknown { self.first } else { LONGEST };
        let left = limit.saturating_sub(now.saturating_duration_since(self.asked?));
        if !left.is_zero() {
            return Some(left);
        }
        self.asked = None;
        self.given_up += 1;
        if self.habit == Habit::Unknown || self.given_up >= GIVEN_UP {
            self.habit = Habit::Silent;
        }
        None
    }

    /// The terminal was never asked.
    pub(crate) fn is_unused(&self) -> bool {
        self.habit == Habit::Unknown && self.asked.is_none()
    }

    /// It was asked for the first time, and has not answered yet.
    pub(crate) fn awaits_first(&self) -> bool {
        self.habit == Habit::Unknown && self.asked.is_some()
    }

    /// A frame is sent; whether the question belongs behind it.
    pub(crate) fn sends(&mut self, now: Instant) -> bool {
        let asks = self.habit != Habit::Silent;
        self.asked = asks.then_some(now);
        asks
    }

    /// An answer came.
    pub(crate) fn answered(&mut self) {
        (self.habit, self.asked, self.given_up) = (Habit::Answers, None, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: Duration = Duration::from_millis(300);

    #[test]
    fn a_frame_is_sent_when_the_terminal_has_taken_in_the_one_before() {
        let (mut pacer, start) = (Pacer::new(FIRST), Instant::now());
        assert!(pacer.waits(start).is_none() && pacer.sends(start));
        assert_eq!(pacer.waits(start), Some(FIRST));
        pacer.answered();
        assert!(pacer.waits(start).is_none() && pacer.sends(start));
        assert_eq!(pacer.waits(start + Duration::from_secs(9)), Some(Duration::from_secs(1)));
        pacer.answered();
        assert_eq!(pacer.waits(start + Duration::from_secs(9)), None);
    }

    #[test]
    fn a_terminal_that_never_answers_is_waited_for_once() {
        let (mut pacer, start) = (Pacer::new(FIRST), Instant::now());
        assert!(pacer.sends(start));
        assert_eq!(pacer.waits(start + FIRST), None);
        assert!(!pacer.sends(start + FIRST));
        assert_eq!(pacer.waits(start + FIRST), None);
        pacer.answered();
        assert!(pacer.sends(start), "a late answer is one all the same");
    }

    #[test]
    fn lost_answers_are_given_up() {
        let (mut pacer, mut now) = (Pacer::new(FIRST), Instant::now());
        pacer.answered();
        for _ in 0..GIVEN_UP {
            assert!(pacer.sends(now));
            assert!(pacer.waits(now).is_some());
            now += LONGEST;
            assert!(pacer.waits(now).is_none());
        }
        assert!(!pacer.sends(now));
    }
}
