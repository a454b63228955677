//! The folder that a pretraining writes: whether it is free or holds a training to go on with, and of which preset.

use std::path::Path;

use anyhow::{Context, bail};

use super::spec::Pretraining;
use crate::data::{atomic_file, ensure_free};

/// Whether `out` holds a training with a saved state. That is gone on with only when it is asked for, and no other folder that
/// holds anything is trained into.
pub(super) fn has_state(spec: &Pretraining) -> anyhow::Result<bool> {
    let training = spec.training_folder();
    let has_state = ["visual.safetensors", "state.safetensors"].iter().any(|state| training.join(state).exists());
    if has_state && !spec.resume {
        bail!("{} holds a training already: use --resume, or another folder", spec.out.display());
    }
    // A training that is resumed may have kept a checkpoint before its first state.
    let resumed = spec.resume && training.exists();
    if !(has_state || resumed) {
        ensure_free::check(&spec.out)?;
    }
    Ok(has_state)
}

/// Makes the folder, and keeps the preset there. A training that ended before it saved a state is begun anew: its preset and
/// curves are deleted.
pub(super) fn prepare(spec: &Pretraining, has_state: bool) -> anyhow::Result<()> {
    let training = spec.training_folder();
    std::fs::create_dir_all(&training).with_context(|| format!("{} cannot be made", training.display()))?;
    if !has_state {
        let written = ["preset.toml", "progress.jsonl"].map(|file| training.join(file));
        for file in written.iter().filter(|file| file.exists()) {
            std::fs::remove_file(file).with_context(|| file.display().to_string())?;
        }
    }
    keep_preset(spec, &training.join("preset.toml"))
}

/// A training goes on only with the preset it began with.
fn keep_preset(spec: &Pretraining, path: &Path) -> anyhow::Result<()> {
    let text = toml::to_string(&spec.preset)?;
    let begun = match std::fs::read_to_string(path) {
        Ok(begun) if begun == text => return Ok(()),
        Ok(begun) => begun,
        Err(_) => return atomic_file::write(path, text.as_bytes()),
    };
    let name = path.display();
    if !begun.starts_with(&format!("format_version = {}\n", spec.preset.format_version)) {
        bail!(
            "{name}: another version of sprint began this training: go on with that one, or begin anew with another --out"
        );
    }
    let (other, own) = begun
        .lines()
        .zip(text.lines())
        .find(|(begun, own)| begun != own)
        .unwrap_or(("another number of lines", "this one"));
    bail!("{name}: the training was begun with another preset: {other} there, {own} here")
}
