//! How many steps a second a run takes.

use std::time::Duration;

/// How many steps a second a run takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepRate(usize);

impl Default for StepRate {
    /// Slow enough to follow.
    fn default() -> StepRate {
        StepRate(3)
    }
}

impl StepRate {
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

    /// The next faster one.
    pub fn faster(self) -> StepRate {
        StepRate((self.0 + 1).min(Self::LEVELS.len() - 1))
    }

    /// The next slower one.
    pub(crate) fn slower(self) -> StepRate {
        StepRate(self.0.saturating_sub(1))
    }

    /// As the header shows it.
    pub(crate) fn name(self) -> &'static str {
        Self::LEVELS[self.0].1
    }

    pub(crate) fn between_steps(self) -> Duration {
        Self::LEVELS[self.0].0.map_or(Duration::ZERO, |rate| Duration::from_secs_f32(1.0 / rate))
    }
}
