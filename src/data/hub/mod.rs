//! Checkpoints by the name that they have on the Hugging Face Hub: fetched once, into the cache that its other programs use, too.
//! Weights are safetensors, which hold numbers and no code. Ours, because the crate `hf-hub` brings dozens of others for what
//! is two kinds of requests, and does not check what it fetched.

mod cache;
mod git_name;
mod name;
mod requests;
mod revision;

pub(crate) use cache::HubCache;
pub(crate) use name::HubName;
pub(crate) use requests::Hub;

use std::path::PathBuf;

use anyhow::{Context, bail};

impl HubName {
    /// The folder of the checkpoint, fetched where it is not in the cache; `note` is told what is done meanwhile.
    ///
    /// # Errors
    /// When it is neither in the cache nor can be fetched, or is damaged.
    pub(crate) fn folder(&self, hub: &Hub, cache: &HubCache, note: &mut dyn FnMut(&str)) -> anyhow::Result<PathBuf> {
        if let (true, Some(folder)) = (self.is_commit(), cache.folder(self)) {
            return cache.check(folder);
        }
        let Some(unreachable) = self.fetch(hub, cache, note).map_or_else(Some, |()| None) else {
            let folder = cache.folder(self).context("what was fetched is gone again")?;
            return cache.check(folder);
        };
        match cache.folder(self) {
            Some(folder) if hub.is_offline() => cache.check(folder),
            Some(folder) => {
                note(&format!("{self}: taken as it was fetched before, because of this: {unreachable:#}"));
                cache.check(folder)
            }
            None if hub.is_offline() => bail!(
                "{self}: neither a folder here nor in the Hub's cache ({}), and HF_HUB_OFFLINE is set",
                cache.root().display()
            ),
            None => Err(unreachable.context(format!(
                "{self}: neither a folder here nor in the Hub's cache ({}), and it cannot be fetched",
                cache.root().display()
            ))),
        }
    }

    fn fetch(&self, hub: &Hub, cache: &HubCache, note: &mut dyn FnMut(&str)) -> anyhow::Result<()> {
        let found = hub.revision(self)?;
        for file in &found.files {
            if !cache.has(self, file) {
                note(&format!("fetching {self}: {}, {:.1} MB", file.name, file.size as f64 / 1e6));
                hub.download(self, &found.commit, file, cache)?;
            }
        }
        cache.link(self, &found)
    }
}

#[cfg(test)]
mod tests;
