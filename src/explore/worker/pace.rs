//! How fast the policy runs.

use std::time::Duration;

/// How fast the policy runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace(usize);

impl Pace {
    /// Steps a second; none for as fast as it can.
    const LEVELS: [(Option<f32>, &'static str); 8] = [
        (Some(0.5), "0.5/s"),
        (Some(1.0), "1/s"),
        (Some(2.0), "2/s"),
        (Some(4.0), "4/s"),
        (Some(8.0), "8/s"),
        (Some(15.0), "15/s"),
        (Some(30.0), "30/s"),
        (None, "full speed"),
    ];

    /// Slow enough to follow.
    pub const START: Pace = Pace(3);

    /// The next faster one.
    pub fn faster(self) -> Pace {
        Pace((self.0 + 1).min(Self::LEVELS.len() - 1))
    }

    /// The next slower one.
    pub fn slower(self) -> Pace {
        Pace(self.0.saturating_sub(1))
    }

    /// In words.
    pub fn name(self) -> &'static str {
        Self::LEVELS[self.0].1
    }

    pub(crate) fn between_steps(self) -> Duration {
        Self::LEVELS[self.0].0.map_or(Duration::ZERO, |rate| Duration::from_secs_f32(1.0 / rate))
    }
}
