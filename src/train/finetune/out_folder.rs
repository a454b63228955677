//! The folder that a finetuning writes: whether it is free or holds one to go on with, and of what.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use crate::data::folder_lock::FolderLock;
use crate::data::{atomic_file, ensure_free, folder, text_file};
use crate::domain::Task;

/// The file with all hyper-parameters, and below them what the finetuning belongs to.
const BEGUN: &str = "finetune.toml";
/// Characters of a task's id in the name of its folder.
const LONGEST_NAME: usize = 60;

/// The folder, before anything is written.
#[derive(Clone, Copy)]
pub(super) struct OutFolder<'a> {
    pub(super) out: &'a Path,
    /// Go on with the finetuning that was begun there.
    pub(super) resume: bool,
}

impl OutFolder<'_> {
    /// Whether something may be finetuned into it.
    ///
    /// # Errors
    /// When it holds a finetuning and is not to be resumed, or something else.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        let name = self.out.display();
        if self.out.join(BEGUN).exists() {
            ensure!(self.resume, "{name} holds a finetuning already: use --resume, or another folder");
            return Ok(());
        }
        ensure_free::check(self.out)
    }

    /// Makes the folder, and keeps there what is finetuned and how. No other process may write it while what is returned lives.
    ///
    /// # Errors
    /// When it was begun with other hyper-parameters, or belongs to something else; both values are named.
    pub(super) fn prepare(&self, config: &str, identity: &BTreeMap<String, String>) -> anyhow::Result<FolderLock> {
        let lock = FolderLock::take(self.out)?;
        self.check()?;
        let path = self.out.join(BEGUN);
        let begun: toml::Table = [("begun_with", identity)]
            .into_iter()
            .map(|(name, values)| Ok((name.to_string(), toml::Value::try_from(values)?)))
            .collect::<anyhow::Result<_>>()?;
        let text = format!("{config}\n{}", toml::to_string(&begun)?);
        match text_file::read(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => atomic_file::write(&path, text.as_bytes())?,
            Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
            Ok(found) if found == text => {}
            Ok(found) => {
                let differs = found.lines().zip(text.lines()).find(|(found, own)| found != own);
                let (there, here) = differs.unwrap_or(("another number of lines", "this one"));
                anyhow::bail!(
                    "{}: the finetuning was begun otherwise: {there} there, {here} here; begin another one with another --out",
                    path.display()
                );
            }
        }
        folder::make(&self.out.join("training"))
            .with_context(|| format!("{} cannot be made", self.out.join("training").display()))?;
        Ok(lock)
    }

    /// The folder of a task's checkpoint, by the task's number from 1 in its set.
    pub(super) fn of_task(&self, number: usize, task: &Task) -> PathBuf {
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
        let name: String = task.id.chars().map(plain).take(LONGEST_NAME).collect();
        self.out.join("tasks").join(format!("{number:02}-{name}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(checkpoint: &str) -> BTreeMap<String, String> {
        [("checkpoint".to_string(), checkpoint.to_string())].into()
    }

    #[test]
    fn a_finetuning_is_gone_on_with_only_as_it_was_begun_and_only_when_it_is_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let new = OutFolder { out: &out, resume: false };
        new.check().unwrap();
        drop(new.prepare("steps = 5\n", &identity("a")).unwrap());
        let error = new.check().unwrap_err().to_string();
        assert!(error.contains("holds a finetuning already: use --resume"), "{error}");
        let resumed = OutFolder { resume: true, ..new };
        drop(resumed.prepare("steps = 5\n", &identity("a")).unwrap());
        for (config, checkpoint, named) in
            [("steps = 6\n", "a", "steps = 5 there, steps = 6 here"), ("steps = 5\n", "b", "checkpoint = \"a\" there")]
        {
            let error = resumed.prepare(config, &identity(checkpoint)).err().unwrap().to_string();
            assert!(error.contains(named), "{error}");
        }
        std::fs::remove_file(out.join(BEGUN)).unwrap();
        std::fs::write(out.join("config.json"), "{}").unwrap();
        assert!(resumed.check().unwrap_err().to_string().contains("holds a checkpoint"));
    }

    #[test]
    fn a_tasks_folder_is_named_by_its_number_and_what_of_its_id_a_folder_may_be_called() {
        let task = Task { id: "a b/../c".into(), ..crate::data::taskset::tests::sample_set().tasks.remove(0) };
        let folder = OutFolder { out: Path::new("out"), resume: false }.of_task(3, &task);
        assert_eq!(folder, Path::new("out/tasks/03-a-b-..-c"));
    }
}
