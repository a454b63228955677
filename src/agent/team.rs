//! The seam between the evaluator and whatever acts in several episodes at once.

use super::policy::{Decision, Observation, Policy};

/// A decision for each situation; `None` where a seat is empty.
pub type Decisions = Vec<Option<anyhow::Result<Decision>>>;

/// Acts in several episodes at once, each in a seat of its own. What it decides in one seat never depends on who sits in
/// the others: the evaluator relies on it, so that results do not change with the number of threads.
pub trait Team: Send {
    /// A short name for reports.
    fn name(&self) -> &str;

    /// How many episodes it acts in at once.
    fn seats(&self) -> usize;

    /// A new episode starts in a seat; `seed` drives whatever is drawn by chance there.
    fn begin(&mut self, seat: usize, seed: u64);

    /// Decides for every seat that has a situation, in the order of the seats.
    ///
    /// # Errors
    /// Where all fail together (a forward pass); a seat's own failure is in its place among the decisions.
    fn decide(&mut self, situations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions>;
}

/// A policy that acts in one episode at a time.
pub struct Solo(pub Box<dyn Policy>);

impl Team for Solo {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn seats(&self) -> usize {
        1
    }

    fn begin(&mut self, _seat: usize, seed: u64) {
        self.0.begin(seed);
    }

    fn decide(&mut self, situations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        Ok(situations.iter_mut().map(|situation| situation.as_mut().map(|here| self.0.decide(here))).collect())
    }
}
