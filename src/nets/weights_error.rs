//! Why a weights file cannot be used: it is no whole file, holds what is no number, or belongs to another model.

use std::fmt;
use std::path::PathBuf;

use tch::{Kind, Tensor};

/// What a model expects of one tensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorSpec {
    /// Element type.
    pub kind: Kind,
    /// Length of each dimension, outermost first.
    pub shape: Vec<i64>,
}

impl TensorSpec {
    /// A tensor of 32-bit floats.
    pub(crate) fn float(shape: &[i64]) -> TensorSpec {
        TensorSpec { kind: Kind::Float, shape: shape.to_vec() }
    }

    /// The form of an existing tensor.
    pub(crate) fn of(tensor: &Tensor) -> TensorSpec {
        TensorSpec { kind: tensor.kind(), shape: tensor.size() }
    }
}

impl fmt::Display for TensorSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}{:?}", self.kind, self.shape)
    }
}

/// A tensor that is there, in another form than the model expects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Misshapen {
    /// The tensor's name.
    pub(crate) name: String,
    /// What the file holds.
    pub(crate) found: TensorSpec,
    /// What the model expects.
    pub(crate) expected: TensorSpec,
}

/// Every difference between a weights file and what a model expects.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// Names that the model expects and the file lacks.
    pub(crate) missing: Vec<String>,
    /// Names that the model does not know.
    pub(crate) extra: Vec<String>,
    /// Tensors in another form.
    pub(crate) misshapen: Vec<Misshapen>,
}

impl fmt::Display for Differences {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        if !self.missing.is_empty() {
            parts.push(format!("missing {}", self.missing.join(", ")));
        }
        if !self.extra.is_empty() {
            parts.push(format!("unknown {}", self.extra.join(", ")));
        }
        for Misshapen { name, found, expected } in &self.misshapen {
            parts.push(format!("{name} is {found} where {expected} is expected"));
        }
        f.write_str(&parts.join("; "))
    }
}

/// Why a weights file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is not a safetensors file, or a damaged one.
    #[error("{}: not a whole safetensors file: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file is well formed, and nothing can be computed with what it holds.
    #[error(
        "{}: the tensor {name} holds {what}{}: its training diverged, or the file is damaged; use another checkpoint, or \
         train or fetch this one anew",
        path.display(),
        if *others > 0 { format!(" (so do {others} more)") } else { String::new() }
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The first such tensor.
        name: String,
        /// What should not be there.
        what: &'static str,
        /// How many more tensors are so.
        others: usize,
    },
    /// The file is well formed, and belongs to another model.
    #[error("{}: does not fit the model: {differences}", path.display())]
    Unfit {
        /// The file.
        path: PathBuf,
        /// All that differs.
        differences: Differences,
    },
    /// The file cannot be written; an older file of that name is untouched.
    #[error("{}: cannot be written: {source}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}
