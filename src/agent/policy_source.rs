//! Where policies come from: a checkpoint folder, the expert, chance. Each can make as many as are asked for.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context;
use sha2::{Digest, Sha256};

use super::config::CheckpointConfig;
use super::decision_rule::DecisionOverride;
use super::experts::expert::ExpertPolicy;
use super::learned::{LearnedPolicy, SharedEmbedder};
use super::memory_agent::MemoryPolicy;
use super::memory_agent::config::MemoryConfig;
use super::policy::Policy;
use super::policy_place::PolicyPlace;
use super::random::RandomPolicy;
use super::registry::{Loaded, NamedAgent};
use super::sentence_encoders;
use crate::data::{json, plain_file};
use crate::nets::device;

/// Makes a policy; whoever acts on a thread of his own has one of his own.
pub(crate) type MakePolicy = dyn Fn() -> anyhow::Result<Box<dyn Policy>> + Send + Sync;

/// How often a checkpoint is read that is replaced meanwhile.
const TRIES: usize = 5;

/// A policy that can be made, and what identifies it in a run.
#[derive(Clone)]
pub struct PolicySource {
    /// What it is called in reports.
    pub(crate) name: String,
    /// SHA-256 over its checkpoint's configuration and weights.
    pub(crate) checkpoint_hash: Option<String>,
    /// Makes one.
    pub make: Arc<MakePolicy>,
    /// The checkpoint's folder.
    folder: Option<PathBuf>,
    /// Where it is, as `--policy` takes it, if it is none of the program's own.
    place: Option<String>,
}

impl PolicySource {
    /// The expert, who knows everything.
    pub(crate) fn expert() -> PolicySource {
        PolicySource::plain("expert", || Box::new(ExpertPolicy::new()))
    }

    /// A possible action by chance.
    pub fn random() -> PolicySource {
        PolicySource::plain("random", || Box::new(RandomPolicy::new()))
    }

    /// A policy of that name, which `make` makes.
    pub(crate) fn of(name: &str, make: Arc<MakePolicy>) -> PolicySource {
        PolicySource { name: name.into(), checkpoint_hash: None, make, folder: None, place: None }
    }

    /// The same, with the hash of its weights.
    pub(crate) fn with_hash(self, checkpoint_hash: Option<String>) -> PolicySource {
        PolicySource { checkpoint_hash, ..self }
    }

    /// The same, which is there, as `--policy` takes it.
    pub(crate) fn at(self, place: String) -> PolicySource {
        PolicySource { place: Some(place), ..self }
    }

    /// Where it is, if it is none of the program's own.
    pub(crate) fn place(&self) -> Option<PolicyPlace> {
        let (policy, checkpoint) = (self.name.clone(), self.checkpoint_hash.clone());
        self.place.clone().map(|place| PolicyPlace { policy, checkpoint, place })
    }

    fn plain(name: &str, make: fn() -> Box<dyn Policy>) -> PolicySource {
        PolicySource::of(name, Arc::new(move || Ok(make())))
    }

    /// A trained agent; all that are made share one sentence encoder. It draws its actions where `sampling`, else it takes the
    /// likeliest, and decides as `asked`.
    ///
    /// # Errors
    /// When the checkpoint or its sentence encoder cannot be used, or the agent cannot decide so.
    pub(crate) fn checkpoint(folder: PathBuf, sampling: bool, asked: DecisionOverride) -> anyhow::Result<PolicySource> {
        anyhow::ensure!(
            asked.decision.is_none() || !MemoryConfig::is_there(&folder),
            "{}: an agent with a memory chooses among ways to act, so that --decision says nothing to it",
            folder.display()
        );
        // More threads than one would make sums depend on how many there are, and workers get in each other's way.
        device::set_threads(1);
        let computes = device::best_device();
        let sentences = sentence_encoders::open_for(&folder, computes)?;
        let loading = |chosen: String| {
            let (folder, sentences) = (folder.clone(), sentences.clone());
            move || -> anyhow::Result<Box<dyn Policy>> {
                let mut agent = load_agent(&folder, sentences.clone(), computes)?;
                // What was loaded is what the run's manifest names.
                check_hash(&folder, &chosen)?;
                agent.set_sampling(sampling);
                agent.set_deciding(asked);
                Ok(agent)
            }
        };
        // A training may be about to keep a newer one.
        let mut tries = 0;
        let (checkpoint_hash, load, agent) = loop {
            let checkpoint_hash = hash(&folder)?;
            let load = loading(checkpoint_hash.clone());
            tries += 1;
            match load() {
                Ok(agent) => break (checkpoint_hash, load, agent),
                Err(error) if tries == TRIES || hash(&folder)? == checkpoint_hash => return Err(error),
                Err(_) => {}
            }
        };
        let name = agent.name().to_owned();
        // Whoever needs only one has what was read, whatever a training puts there afterwards.
        let read = Mutex::new(Some(agent));
        let take_read = move || read.lock().unwrap_or_else(PoisonError::into_inner).take();
        let make = Arc::new(move || take_read().map_or_else(&load, Ok));
        Ok(PolicySource { name, checkpoint_hash: Some(checkpoint_hash), make, folder: Some(folder), place: None })
    }

    /// Notices when the checkpoint is no longer the one that was chosen.
    ///
    /// # Errors
    /// When its files changed or are gone.
    pub(crate) fn check_unchanged(&self) -> anyhow::Result<()> {
        let (Some(folder), Some(chosen)) = (&self.folder, &self.checkpoint_hash) else { return Ok(()) };
        check_hash(folder, chosen)
    }
}

fn check_hash(folder: &Path, chosen: &str) -> anyhow::Result<()> {
    let now = hash(folder)?;
    anyhow::ensure!(
        now == chosen,
        "{}: the checkpoint was replaced while the run was under way (its hash was {chosen}, now it is {now}); what is \
         recorded is of the first one: put that back, or evaluate the new one with another --out",
        folder.display()
    );
    Ok(())
}

/// SHA-256 over a checkpoint's configuration and weights.
///
/// # Errors
/// When there is no checkpoint, or it cannot be read.
pub(crate) fn hash(folder: &Path) -> anyhow::Result<String> {
    CheckpointConfig::check_there(folder)?;
    let mut digest = Sha256::new();
    for file in ["config.json", "model.safetensors"] {
        let path = folder.join(file);
        digest.update(plain_file::read(&path).with_context(|| format!("cannot read {}", path.display()))?);
    }
    Ok(json::hex(&digest.finalize()))
}

/// The agent of a checkpoint, of whatever kind it is; it decides greedily.
///
/// # Errors
/// When the checkpoint is malformed, or was trained with another sentence encoder.
pub(crate) fn load_agent(
    folder: &Path,
    sentences: Option<SharedEmbedder>,
    computes: tch::Device,
) -> anyhow::Result<Box<dyn Policy>> {
    // More threads than one would make sums depend on how many there are, and workers get in each other's way.
    device::set_threads(1);
    Ok(match MemoryConfig::is_there(folder) {
        true => Box::new(MemoryPolicy::load(folder, computes)?),
        false => Box::new(LearnedPolicy::load(folder, sentences, computes)?),
    })
}

/// The policy that a run was made with, by its name and the hash of its checkpoint, which may be `named` or lie where
/// [`checkpoints`] do; `None` where it is not at hand.
///
/// # Errors
/// When it is there and cannot be used.
pub(crate) fn find(
    name: &str,
    checkpoint: Option<&str>,
    (sampling, asked): (bool, DecisionOverride),
    named: Option<&Path>,
) -> anyhow::Result<Option<PolicySource>> {
    let Some(wanted) = checkpoint else {
        return Ok(match name {
            "expert" => Some(PolicySource::expert()),
            "random" => Some(PolicySource::random()),
            _ => None,
        });
    };
    for folder in named.map(folder_of).into_iter().chain(checkpoints()) {
        if hash(&folder)? == wanted {
            return PolicySource::checkpoint(folder, sampling, asked).map(Some);
        }
    }
    Ok(None)
}

/// The folder of a checkpoint that was named: a path, or where there is nothing, the name of one of [`checkpoints`].
pub(crate) fn folder_of(named: &Path) -> PathBuf {
    let is_name = named.file_name() == Some(named.as_os_str()) && !named.exists();
    let known = is_name.then(|| checkpoints().into_iter().find(|folder| folder.file_name() == named.file_name()));
    known.flatten().unwrap_or_else(|| named.to_owned())
}

/// The agents that an explorer may let act: the named one first, then those that are found. They decide as `asked`.
pub(crate) fn agents(named: Option<&Path>, asked: DecisionOverride) -> Vec<NamedAgent> {
    let mut folders: Vec<PathBuf> = named.map(folder_of).into_iter().chain(checkpoints()).collect();
    let mut seen = Vec::new();
    folders.retain(|folder| {
        let whole = folder.canonicalize().unwrap_or_else(|_| folder.clone());
        let new = !seen.contains(&whole);
        seen.push(whole);
        new
    });
    let agent = |folder: PathBuf| {
        let name = folder.file_name().map_or_else(|| "agent".into(), |name| name.to_string_lossy().into_owned());
        agent_of(name, move || PolicySource::checkpoint(folder.clone(), false, asked))
    };
    folders.into_iter().map(agent).collect()
}

/// An agent of that name which `open` opens, once.
pub(crate) fn agent_of(name: String, open: impl Fn() -> anyhow::Result<PolicySource> + 'static) -> NamedAgent {
    let opened = OnceCell::new();
    let load = move || -> anyhow::Result<Loaded> {
        let chosen = match opened.get() {
            Some(chosen) => chosen,
            None => {
                let chosen: PolicySource = open()?;
                opened.get_or_init(|| chosen)
            }
        };
        let (checkpoint, place) = (chosen.checkpoint_hash.clone(), chosen.place());
        Ok(Loaded { policy: (chosen.make)()?, checkpoint, place })
    };
    NamedAgent { name, load: Box::new(load) }
}

/// The agent that acts when none is named.
const DEFAULT: &str = "sprint-memory";

/// The agent that acts when none is named: the first that is found.
pub(crate) fn shipped() -> anyhow::Result<PathBuf> {
    checkpoints().into_iter().next().context(
        "there is no trained agent in checkpoints/: name one with --checkpoint, or let --policy expert or random act",
    )
}

/// The checkpoints in `checkpoints` here and, for a binary in `target/release`, in the repository that it was built in: [`DEFAULT`]
/// first, then by name.
pub(crate) fn checkpoints() -> Vec<PathBuf> {
    let program = std::env::current_exe().and_then(|path| path.canonicalize()).ok();
    let near: Option<PathBuf> = program
        .iter()
        .flat_map(|path| path.ancestors().skip(1).take(3))
        .map(|folder| folder.join("checkpoints"))
        .find(|folder| folder.is_dir());
    let here = Path::new("checkpoints").canonicalize().ok().filter(|folder| folder.is_dir());
    let mut folders: Vec<PathBuf> = here.into_iter().chain(near).collect();
    folders.dedup();
    let in_folder = |folder: &PathBuf| -> Vec<PathBuf> {
        let entries = folder.read_dir().into_iter().flatten().filter_map(Result::ok).map(|entry| entry.path());
        let whole = |path: &PathBuf| path.join("config.json").is_file() && path.join("model.safetensors").is_file();
        let mut found: Vec<PathBuf> = entries.filter(whole).collect();
        found.sort_by_key(|path| (path.file_name() != Some(DEFAULT.as_ref()), path.clone()));
        found
    };
    folders.iter().flat_map(in_folder).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::needed;

    #[test]
    fn an_agent_acts_though_a_training_replaced_its_checkpoint_and_no_second_one_is_made() {
        let Some(clone) = needed::agent("tests/agents/clone") else { return };
        let folder = tempfile::tempdir().unwrap();
        for file in clone.read_dir().unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file()) {
            std::fs::copy(&file, folder.path().join(file.file_name().unwrap())).unwrap();
        }
        let asked = DecisionOverride::default();
        let source = PolicySource::checkpoint(folder.path().to_owned(), false, asked).unwrap();
        let config = folder.path().join("config.json");
        let newer = std::fs::read_to_string(&config).unwrap() + "\n";
        std::fs::write(&config, newer).unwrap();
        assert!((source.make)().is_ok(), "what was read is at hand");
        let refused = (source.make)().err().unwrap().to_string();
        assert!(refused.contains("the checkpoint was replaced while the run was under way"), "{refused}");
    }
}
