//! What a finetuning is asked for.

use std::path::PathBuf;

use tch::Device;

use crate::agent::learned::SharedEmbedder;
use crate::house::grading::Grading;

/// What to finetune, on what, into where.
pub(crate) struct Finetuning {
    /// The checkpoint that is finetuned.
    pub(crate) checkpoint: PathBuf,
    /// A checkpoint whose critic is taken, where the first has none.
    pub(crate) critic_from: Option<PathBuf>,
    /// The task file.
    pub(crate) tasks: PathBuf,
    /// The task of that number from 1, or of that id; all where none is named.
    pub(crate) only: Option<String>,
    /// How subtasks are graded, and so rewarded.
    pub(crate) grading: Grading,
    /// The folder to write.
    pub(crate) out: PathBuf,
    /// A file with hyper-parameters.
    pub(crate) config: Option<PathBuf>,
    /// Environment steps of each task, instead of the file's.
    pub(crate) steps: Option<u64>,
    /// The seed, instead of the file's.
    pub(crate) seed: Option<u64>,
    /// Tasks that are trained side by side.
    pub(crate) jobs: usize,
    /// Go on with the finetuning that was begun in `out`.
    pub(crate) resume: bool,
    /// Embeds the instructions.
    pub(crate) embedder: SharedEmbedder,
    /// Where to compute.
    pub(crate) device: Device,
}
