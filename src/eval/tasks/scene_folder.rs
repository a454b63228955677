//! Where the scenes of a task set lie, as its file says it: relative, so that both can be moved together.

use std::path::Path;

use anyhow::Context;

use crate::domain::{Task, TaskSet};

/// The set with these of its tasks, as it is written in another folder: the scenes are where they were.
///
/// # Errors
/// When the scenes' folder cannot be found.
pub(crate) fn as_seen_from(set: &TaskSet, tasks: &[Task], file: &Path, folder: &Path) -> anyhow::Result<TaskSet> {
    let scenes = set.scenes.as_ref().map(|scenes| {
        let beside = file.parent().unwrap_or(Path::new("")).join(scenes);
        // A set of generated houses may name a folder that is not there.
        if beside.is_dir() { relative(&beside, folder) } else { Ok(scenes.clone()) }
    });
    Ok(TaskSet { scenes: scenes.transpose()?, tasks: tasks.to_vec(), ..set.clone() })
}

/// How `folder` is written in a file that lies in `from`: relative, so that both can be moved together.
pub(crate) fn relative(folder: &Path, from: &Path) -> anyhow::Result<String> {
    let real = |path: &Path| path.canonicalize().with_context(|| format!("cannot read {}", path.display()));
    let (to, from) = (real(folder)?, real(from)?);
    let shared = to.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| std::path::Component::ParentDir);
    let path: std::path::PathBuf = up.chain(to.components().skip(shared)).collect();
    path.into_os_string().into_string().ok().with_context(|| format!("{} is not a Unicode path", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_named_relative_to_the_task_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("data/scenes")).unwrap();
        std::fs::create_dir_all(folder.path().join("sets/mine")).unwrap();
        let name = |from: &str| relative(&folder.path().join("data/scenes"), &folder.path().join(from)).unwrap();
        assert_eq!(name("sets/mine"), "../../data/scenes");
        assert_eq!(name("data"), "scenes");
    }
}
