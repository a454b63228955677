//! Progress of long commands on standard error: a bar in a terminal, else a line now and then.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::streams::say;
use crate::train::metrics::{ProgressLogger, Scalars};

/// The stages of a command, one after the other, each with how far it is, the time that is left, and the latest numbers.
pub(crate) struct Progress {
    terminal: bool,
    stage: String,
    bar: ProgressBar,
    began: Instant,
    /// Where the stage was when it began: a resumed one does not begin at 0.
    first: u64,
    last_line: Instant,
    /// The bar tells the time that is left.
    timed: bool,
}

/// A bar's parts, with what is said of the time.
fn style(left: &str) -> ProgressStyle {
    let template = format!("{{prefix}} {{wide_bar}} {{pos}}/{{len}}{left} {{msg}}");
    ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// The time between two lines without a terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

impl Progress {
    /// Shows nothing until the first [`Progress::show`].
    pub(crate) fn new() -> Progress {
        let (terminal, now) = (std::io::stderr().is_terminal(), Instant::now());
        Progress {
            terminal,
            stage: String::new(),
            bar: ProgressBar::hidden(),
            began: now,
            first: 0,
            last_line: now,
            timed: false,
        }
    }

    /// `done` of `total` of a stage; `message` is empty where there is nothing new to say.
    pub(crate) fn show(&mut self, stage: &str, done: u64, total: u64, message: &str) {
        if self.stage != stage {
            self.begin(stage, done);
        }
        if self.terminal {
            // Before anything is done nobody knows how long the rest takes.
            if !self.timed && done > self.first {
                self.timed = true;
                self.bar.set_style(style(" {eta} left"));
            }
            self.bar.set_length(total);
            self.bar.set_position(done);
            if !message.is_empty() {
                self.bar.set_message(message.to_string());
            }
        } else if done >= total || self.last_line.elapsed() >= BETWEEN_LINES {
            self.line(done, total, message);
        }
    }

    /// Takes the bar off the screen.
    pub(crate) fn end(&self) {
        self.bar.finish_and_clear();
    }

    fn begin(&mut self, stage: &str, done: u64) {
        self.end();
        (self.stage, self.first) = (stage.to_string(), done);
        self.began = Instant::now();
        self.last_line = self.began;
        if self.terminal {
            self.timed = false;
            self.bar = ProgressBar::new(0).with_style(style(""));
            self.bar.set_prefix(stage.to_string());
        }
    }

    fn line(&mut self, done: u64, total: u64, message: &str) {
        self.last_line = Instant::now();
        let rate = self.began.elapsed().as_secs_f64() / done.saturating_sub(self.first).max(1) as f64;
        let left = match done > self.first {
            true => format!("  {:.0} s left", rate * total.saturating_sub(done) as f64),
            false => String::new(),
        };
        say(format!("{} {done}/{total}{left}  {message}", self.stage).trim_end());
    }
}

impl ProgressLogger for Progress {
    /// Every step that has numbers is a line without a terminal.
    fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
        let Scalars { stage, step, of, values } = scalars;
        let numbers: Vec<String> = values.iter().map(|(name, value)| format!("{name} {value:.3}")).collect();
        let numbers = numbers.join("  ");
        if self.terminal || numbers.is_empty() {
            self.show(stage, *step, *of, &numbers);
            return Ok(());
        }
        if self.stage != *stage {
            self.begin(stage, *step);
        }
        self.line(*step, *of, &numbers);
        Ok(())
    }
}

/// One stage that several threads work at.
pub(crate) struct Counter {
    stage: &'static str,
    total: u64,
    progress: Mutex<(Progress, u64)>,
}

impl Counter {
    /// Nothing is done yet of `total`.
    pub(crate) fn new(stage: &'static str, total: u64) -> Counter {
        Counter { stage, total, progress: Mutex::new((Progress::new(), 0)) }
    }

    /// So many more are done.
    pub(crate) fn add(&self, count: u64) {
        if let Ok(mut guard) = self.progress.lock() {
            let (progress, done) = &mut *guard;
            *done += count;
            progress.show(self.stage, *done, self.total, "");
        }
    }

    /// Takes the bar off the screen.
    pub(crate) fn end(&self) {
        if let Ok(guard) = self.progress.lock() {
            guard.0.end();
        }
    }
}
