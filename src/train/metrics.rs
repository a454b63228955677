//! Progress of long work: scalars that are returned and reported, never printed from inside.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;

use anyhow::Context;
use serde::Serialize;
use tch::{Kind, Tensor};

/// What one step of a stage has to say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scalars {
    /// The stage: `visual`, `features`, `sentences`, `policy`.
    pub stage: &'static str,
    /// How far it is.
    pub step: u64,
    /// Where it ends.
    pub of: u64,
    /// Numbers by name; empty at most steps.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

impl Scalars {
    /// No numbers yet.
    pub fn new(stage: &'static str, step: u64, of: u64) -> Scalars {
        Scalars { stage, step, of, values: BTreeMap::new() }
    }

    /// Adds a scalar tensor.
    pub fn add(&mut self, name: &str, value: &Tensor) {
        self.set(name, value.to_kind(Kind::Double).double_value(&[]));
    }

    /// Adds a number.
    pub fn set(&mut self, name: &str, value: f64) {
        self.values.insert(name.to_string(), value);
    }
}

/// Takes note of progress.
pub trait Report {
    /// After a step.
    ///
    /// # Errors
    /// When it cannot be written down.
    fn step(&mut self, scalars: &Scalars) -> anyhow::Result<()>;
}

/// Appends every step that has numbers to a file, a JSON object a line, and passes everything on.
pub struct Journal<'a> {
    file: File,
    next: &'a mut dyn Report,
}

impl<'a> Journal<'a> {
    /// Opens or begins the file.
    ///
    /// # Errors
    /// When it cannot be written to.
    pub fn open(path: &Path, next: &'a mut dyn Report) -> anyhow::Result<Journal<'a>> {
        let file = OpenOptions::new().create(true).append(true).open(path);
        Ok(Journal { file: file.with_context(|| format!("{} cannot be written to", path.display()))?, next })
    }
}

impl Report for Journal<'_> {
    fn step(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
        if !scalars.values.is_empty() {
            self.file.write_all((serde_json::to_string(scalars)? + "\n").as_bytes())?;
        }
        self.next.step(scalars)
    }
}
