//! The cache of the Hub's programs: contents by their names, and for each commit links to them.

use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use super::git_name;
use super::name::HubName;
use super::revision::{FILES, HubFile, Revision};
use crate::data::{atomic_file, text_file};

/// The cache.
pub(crate) struct HubCache {
    root: PathBuf,
}

impl HubCache {
    /// In that folder.
    pub(crate) fn new(root: PathBuf) -> HubCache {
        HubCache { root }
    }

    /// Where the Hub's other programs have it: `HF_HUB_CACHE`, else `hub` in `HF_HOME`, else in the user's cache folder.
    pub(crate) fn of_user() -> HubCache {
        let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let home = || set("HF_HOME").map(|home| home.join("hub"));
        let in_cache = || {
            let base = set("XDG_CACHE_HOME").or_else(|| set("HOME").map(|home| home.join(".cache")));
            base.unwrap_or_else(std::env::temp_dir).join("huggingface").join("hub")
        };
        HubCache::new(set("HF_HUB_CACHE").or_else(home).unwrap_or_else(in_cache))
    }

    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    fn repository(&self, name: &HubName) -> PathBuf {
        self.root.join(format!("models--{}", name.repository.replace('/', "--")))
    }

    fn snapshot(&self, name: &HubName, commit: &str) -> PathBuf {
        self.repository(name).join("snapshots").join(commit)
    }

    /// Where a file's content lies.
    pub(super) fn blob(&self, name: &HubName, file: &HubFile) -> PathBuf {
        self.repository(name).join("blobs").join(&file.content)
    }

    /// Whether a file's content is there.
    pub(super) fn has(&self, name: &HubName, file: &HubFile) -> bool {
        self.blob(name, file).is_file()
    }

    /// The folder of a checkpoint that is there whole.
    pub(super) fn folder(&self, name: &HubName) -> Option<PathBuf> {
        let noted = text_file::read(&self.repository(name).join("refs").join(&name.revision));
        let commit = noted.map_or_else(|_| name.revision.clone(), |commit| commit.trim().to_owned());
        let folder = self.snapshot(name, &commit);
        FILES.iter().all(|file| folder.join(file).is_file()).then_some(folder)
    }

    /// Notes which contents a revision has.
    ///
    /// # Errors
    /// When the cache cannot be written to.
    pub(super) fn link(&self, name: &HubName, found: &Revision) -> anyhow::Result<()> {
        let folder = self.snapshot(name, &found.commit);
        let linked = || -> io::Result<()> {
            std::fs::create_dir_all(&folder)?;
            for file in &found.files {
                let link = folder.join(file.name);
                if !link.exists() {
                    let _ = std::fs::remove_file(&link);
                    std::os::unix::fs::symlink(Path::new("../../blobs").join(&file.content), &link)?;
                }
            }
            Ok(())
        };
        linked().with_context(|| format!("cannot write {}", folder.display()))?;
        if name.is_commit() {
            return Ok(());
        }
        atomic_file::write(&self.repository(name).join("refs").join(&name.revision), found.commit.as_bytes())
    }

    /// Checks a checkpoint's files against what their contents are called.
    ///
    /// # Errors
    /// When one is damaged.
    pub(super) fn check(&self, folder: PathBuf) -> anyhow::Result<PathBuf> {
        for file in FILES {
            let path = folder.join(file);
            let kept = path.canonicalize().with_context(|| format!("cannot read {}", path.display()))?;
            let called = kept.file_name().unwrap_or_default().to_string_lossy().into_owned();
            // A cache without links has copies under their own names.
            if git_name::is_one(&called) {
                let found = git_name::of(&kept, &called)?;
                ensure!(found == called, "{}: damaged: remove it, and it is fetched anew", kept.display());
            }
        }
        Ok(folder)
    }
}
