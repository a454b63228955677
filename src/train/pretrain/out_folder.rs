//! The folder that a training writes: whether it is free or holds a training to go on with, and of which preset.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use crate::data::folder_lock::FolderLock;
use crate::data::{atomic_file, ensure_free, folder, text_file};

/// A checkpoint's folder with that of its training.
#[derive(Clone, Copy)]
pub(crate) struct TrainingFolder<'a> {
    /// The checkpoint's folder.
    pub(crate) out: &'a Path,
    /// The files of the stages' states, in the training's folder.
    pub(crate) states: &'a [&'a str],
    /// Go on with the training that was begun there.
    pub(crate) resume: bool,
}

impl TrainingFolder<'_> {
    /// The folder beside the checkpoint with the training's states and curves.
    pub(crate) fn training(&self) -> PathBuf {
        self.out.join("training")
    }

    /// Whether it holds a training with a saved state. That is gone on with only when it is asked for, and no other folder that
    /// holds anything is trained into.
    pub(crate) fn has_state(&self) -> anyhow::Result<bool> {
        let training = self.training();
        let has_state = self.states.iter().any(|state| training.join(state).exists());
        if has_state && !self.resume {
            bail!("{} holds a training already: use --resume, or another folder", self.out.display());
        }
        // A training that is resumed may have kept a checkpoint before its first state.
        let resumed = self.resume && training.exists();
        if !(has_state || resumed) {
            ensure_free::check(self.out)?;
        }
        Ok(has_state)
    }

    /// Makes the folder, and keeps the preset there. A training that ended before it saved a state is begun anew: its preset and
    /// curves are deleted. No other process may train into the folder while what is returned lives.
    pub(crate) fn prepare(&self, has_state: bool, preset: &str, format_version: u32) -> anyhow::Result<FolderLock> {
        let lock = FolderLock::take(self.out)?;
        // Another training may have ended there since it was looked for.
        anyhow::ensure!(self.has_state()? == has_state, "{} was just written by another process", self.out.display());
        let training = self.training();
        folder::make(&training).with_context(|| format!("{} cannot be made", training.display()))?;
        if !has_state {
            let written = ["preset.toml", "progress.jsonl"].map(|file| training.join(file));
            for file in written.iter().filter(|file| file.exists()) {
                std::fs::remove_file(file).with_context(|| file.display().to_string())?;
            }
        }
        keep_preset(&training.join("preset.toml"), preset, format_version)?;
        Ok(lock)
    }
}

/// A training goes on only with the preset it began with.
fn keep_preset(path: &Path, text: &str, format_version: u32) -> anyhow::Result<()> {
    let begun = match text_file::read(path) {
        Ok(begun) if begun == text => return Ok(()),
        Ok(begun) => begun,
        Err(error) if error.kind() == ErrorKind::NotFound => return atomic_file::write(path, text.as_bytes()),
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
    };
    let name = path.display();
    if !begun.starts_with(&format!("format_version = {format_version}\n")) {
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
