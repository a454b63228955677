//! Progress of long work on standard error: one bar a stage, with the time that is left, and the latest numbers.

use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use super::streams::say;
use crate::train::metrics::{Report, Scalars};

/// Shows scalars as they come. Without a terminal, a line now and then.
pub struct Bars {
    bar: ProgressBar,
    stage: &'static str,
    plain: bool,
    begun: Instant,
    first: u64,
    said: Instant,
}

/// Seconds between two lines without a terminal.
const QUIET: u64 = 10;

impl Bars {
    /// No stage has begun.
    pub fn new() -> Bars {
        let plain = !std::io::IsTerminal::is_terminal(&std::io::stderr());
        let now = Instant::now();
        Bars { bar: ProgressBar::hidden(), stage: "", plain, begun: now, first: 0, said: now }
    }

    fn begin(&mut self, scalars: &Scalars) {
        self.bar.finish_and_clear();
        self.stage = scalars.stage;
        (self.begun, self.first) = (Instant::now(), scalars.step);
        self.said = self.begun;
        let style = ProgressStyle::with_template("{prefix} {wide_bar} {pos}/{len} {eta} left {msg}");
        self.bar = ProgressBar::new(scalars.of).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        self.bar.set_prefix(scalars.stage);
    }

    /// Takes the bar off the screen.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}

impl Report for Bars {
    fn step(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
        if self.stage != scalars.stage {
            self.begin(scalars);
        }
        let numbers: Vec<String> = scalars.values.iter().map(|(name, value)| format!("{name} {value:.3}")).collect();
        let numbers = numbers.join("  ");
        if !self.plain {
            self.bar.set_position(scalars.step);
            if !numbers.is_empty() {
                self.bar.set_message(numbers);
            }
        } else if !numbers.is_empty() || scalars.step == scalars.of || self.said.elapsed().as_secs() >= QUIET {
            self.said = Instant::now();
            let done = (scalars.step - self.first).max(1) as f64;
            let left = self.begun.elapsed().as_secs_f64() / done * (scalars.of - scalars.step.min(scalars.of)) as f64;
            say(&format!("{} {}/{}  {left:.0} s left  {numbers}", scalars.stage, scalars.step, scalars.of));
        }
        Ok(())
    }
}
