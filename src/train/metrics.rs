//! Progress of long work: scalars of each step, handed to loggers that display or keep them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use tch::{Kind, Tensor};

use crate::data::plain_file;

/// One step of a stage: how far it is, and what was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scalars {
    /// The stage, such as `visual_encoder`, `features`, `text_embeddings` or `policy`.
    pub(crate) stage: &'static str,
    /// The step, from 1 to `of`.
    pub(crate) step: u64,
    /// How many steps the stage has.
    pub(crate) of: u64,
    /// Measured numbers by name; empty at most steps.
    #[serde(flatten)]
    pub(crate) values: BTreeMap<String, f64>,
}

impl Scalars {
    /// A step without numbers.
    pub fn new(stage: &'static str, step: u64, of: u64) -> Scalars {
        Scalars { stage, step, of, values: BTreeMap::new() }
    }

    /// Adds a tensor of one element.
    pub(crate) fn add(&mut self, name: &str, value: &Tensor) {
        self.set(name, value.to_kind(Kind::Double).double_value(&[]));
    }

    /// Adds a number, in place of one of the same name.
    pub fn set(&mut self, name: &str, value: f64) {
        self.values.insert(name.to_string(), value);
    }
}

/// Displays or keeps the progress of long work.
pub trait ProgressLogger {
    /// Called after every step.
    ///
    /// # Errors
    /// When it cannot be kept.
    fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()>;
}

/// Appends every step that has numbers to a file, a JSON object a line, and passes everything on.
pub(crate) struct JsonLinesLogger<'a> {
    path: PathBuf,
    file: File,
    next: &'a mut dyn ProgressLogger,
}

impl<'a> JsonLinesLogger<'a> {
    /// Appends to the file, which need not be there.
    ///
    /// # Errors
    /// When it cannot be written to.
    pub(crate) fn open(path: &Path, next: &'a mut dyn ProgressLogger) -> anyhow::Result<JsonLinesLogger<'a>> {
        let file = plain_file::append(path).with_context(|| format!("{} cannot be written to", path.display()))?;
        Ok(JsonLinesLogger { path: path.to_owned(), file, next })
    }
}

impl ProgressLogger for JsonLinesLogger<'_> {
    fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
        if !scalars.values.is_empty() {
            let written = self.file.write_all((serde_json::to_string(scalars)? + "\n").as_bytes());
            written.with_context(|| format!("{} cannot be written to", self.path.display()))?;
        }
        self.next.log(scalars)
    }
}
