//! The run folder of what was explored: an episode a branch, with its tasks, so that it can be opened and verified by itself.

use std::path::Path;

use anyhow::ensure;
use sha2::{Digest, Sha256};

use crate::agent::DecisionOverride;
use crate::agent::policy_place::PolicyPlace;
use crate::data::{atomic_file, json};
use crate::domain::{Scene, TaskSet};
use crate::episode::record::Episode;
use crate::episode::rollout::EndedBy;
use crate::house::grading::Grading;
use crate::report::summary::RunSummary;
use crate::report::summary_files;
use crate::run_dir::layout::{MANIFEST, TASKS};
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::policy_places;
use crate::run_dir::writer::RunWriter;

/// The folder with its scenes, where they come from a dataset.
pub(super) const SCENES: &str = "scenes";

/// Writes a new run folder; `scene` goes with it where the tasks name one.
///
/// # Errors
/// When the folder holds something else, or cannot be written to.
pub(super) fn write(
    path: &Path,
    set: &TaskSet,
    scenes_hash: String,
    scene: Option<&Scene>,
    (episodes, places): (&[Episode], &[PolicyPlace]),
) -> anyhow::Result<()> {
    ensure!(!path.join(MANIFEST).exists(), "{} holds a run already; name another folder", path.display());
    let mut bytes = serde_json::to_vec_pretty(set)?;
    bytes.push(b'\n');
    let manifest = RunManifest {
        format_version: RunManifest::FORMAT,
        sprint_version: env!("CARGO_PKG_VERSION").into(),
        task_set: set.name.clone(),
        task_set_hash: json::hex(&Sha256::digest(&bytes)),
        scenes_hash,
        policy: RunManifest::EXPLORED.into(),
        checkpoint_hash: None,
        tasks: set.tasks.len(),
        seeds: 1,
        grader: Grading::Class,
        end: EndedBy::Grader,
        step_by_step: false,
        sampling: false,
        deciding: DecisionOverride::default(),
        instruction_variants: false,
        all_start_subtasks: false,
        shard: None,
        reader: None,
    };
    let mut folder = RunWriter::open(path, &manifest)?;
    atomic_file::write(&path.join(TASKS), &bytes)?;
    policy_places::write(path, places)?;
    if let Some(scene) = scene {
        json::write(&path.join(SCENES).join(format!("{}.json", scene.name)), scene)?;
    }
    for episode in episodes {
        folder.append(episode)?;
    }
    summary_files::write(&RunSummary::of(&manifest, &set.tasks, episodes, false), folder.path())
}
