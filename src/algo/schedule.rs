//! The learning-rate schedule: linear warm-up, then linear decay.

use serde::{Deserialize, Serialize};

/// Linear warm-up, then linear decay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Schedule {
    /// The highest learning rate.
    pub(crate) learning_rate: f64,
    /// Steps of the warm-up from zero.
    pub(crate) warmup_steps: u64,
    /// The share of the highest rate that is left at the last step.
    pub(crate) final_fraction: f64,
}

impl Schedule {
    /// The learning rate at `step` (from 0) of `steps`.
    pub(crate) fn at(&self, step: u64, steps: u64) -> f64 {
        if step < self.warmup_steps {
            return self.learning_rate * (step + 1) as f64 / self.warmup_steps as f64;
        }
        let span = steps.saturating_sub(self.warmup_steps).max(1) as f64;
        let done = ((step - self.warmup_steps) as f64 / span).min(1.0);
        self.learning_rate * (1.0 + (self.final_fraction - 1.0) * done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_rises_to_its_height_and_falls_to_its_share() {
        let schedule = Schedule { learning_rate: 0.1, warmup_steps: 10, final_fraction: 0.2 };
        assert!((schedule.at(0, 110) - 0.01).abs() < 1e-12);
        assert!((schedule.at(9, 110) - 0.1).abs() < 1e-12);
        assert!((schedule.at(60, 110) - 0.06).abs() < 1e-12);
        assert!((schedule.at(110, 110) - 0.02).abs() < 1e-12);
    }
}
