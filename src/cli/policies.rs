//! Which policy acts, from the command line.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use anyhow::Context;
use clap::{Args, ValueEnum};
use sha2::{Digest, Sha256};

use crate::agent::config::Config;
use crate::agent::registry::{Agent, Loaded};
use crate::agent::{ExpertPolicy, LearnedPolicy, LearnedTeam, Policy, RandomPolicy, Solo, Team};
use crate::data::json;
use crate::eval::executor::MakeTeam;
use crate::nets::device;
use crate::nets::embedding_cache::Embedder;
use crate::nets::sentence::default_folder;

/// Makes a policy.
pub type MakePolicy = dyn Fn() -> anyhow::Result<Box<dyn Policy>> + Sync;

/// Which policy acts.
#[derive(Args)]
pub struct PolicyChoice {
    /// The trained agent that acts [default: the shipped one]
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    /// Who acts
    #[arg(long, value_enum, default_value = "agent")]
    policy: Kind,
}

/// Who acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// The trained agent
    Agent,
    /// Shortest paths and interactions, knowing everything
    Expert,
    /// A possible action by chance
    Random,
}

/// A policy that can be made, and what identifies it in a run.
pub struct Chosen {
    /// What it is called in reports.
    pub name: String,
    /// SHA-256 over its checkpoint's configuration and weights.
    pub checkpoint_hash: Option<String>,
    /// Makes one.
    pub make: Box<MakePolicy>,
    /// Makes one that acts in several episodes at once.
    pub team: Arc<MakeTeam>,
    /// The checkpoint's folder.
    pub folder: Option<PathBuf>,
}

impl Chosen {
    /// Notices when the checkpoint is no longer the one that was chosen.
    ///
    /// # Errors
    /// When its files changed or are gone.
    pub fn check_unchanged(&self) -> anyhow::Result<()> {
        let (Some(folder), Some(chosen)) = (&self.folder, &self.checkpoint_hash) else { return Ok(()) };
        unchanged(folder, chosen)
    }
}

fn unchanged(folder: &Path, chosen: &str) -> anyhow::Result<()> {
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
fn hash(folder: &Path) -> anyhow::Result<String> {
    Config::check_there(folder)?;
    let mut digest = Sha256::new();
    for file in ["config.json", "model.safetensors"] {
        let path = folder.join(file);
        digest.update(std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?);
    }
    Ok(json::hex(&digest.finalize()))
}

impl PolicyChoice {
    /// Opens what was chosen.
    ///
    /// # Errors
    /// When the checkpoint or its sentence encoder cannot be used.
    pub fn open(&self, sampling: bool) -> anyhow::Result<Chosen> {
        let plain = |name: &str, make: fn() -> Box<dyn Policy>| Chosen {
            name: name.into(),
            checkpoint_hash: None,
            make: Box::new(move || Ok(make())),
            team: Arc::new(move || Ok(Box::new(Solo(make())))),
            folder: None,
        };
        if self.policy != Kind::Agent && self.checkpoint.is_some() {
            anyhow::bail!("--checkpoint names a trained agent, but --policy asks for another: leave one of them out");
        }
        if sampling && self.policy != Kind::Agent {
            anyhow::bail!("--sample draws the actions of a trained agent; leave it out with --policy expert or random");
        }
        match self.policy {
            Kind::Expert => Ok(plain("expert", || Box::new(ExpertPolicy::new()))),
            Kind::Random => Ok(plain("random", || Box::new(RandomPolicy::new()))),
            Kind::Agent => sampled(self.checkpoint.clone().map_or_else(shipped, Ok)?, sampling),
        }
    }
}

/// A trained agent, several of which share one sentence encoder; it takes the likeliest action.
///
/// # Errors
/// When the checkpoint or its sentence encoder cannot be used.
pub fn learned(folder: PathBuf) -> anyhow::Result<Chosen> {
    sampled(folder, false)
}

fn sampled(folder: PathBuf, sampling: bool) -> anyhow::Result<Chosen> {
    // More threads than one would make sums depend on how many there are, and workers get in each other's way.
    device::set_threads(1);
    let checkpoint_hash = hash(&folder)?;
    let computes = device::best_device();
    let sentences = Arc::new(Mutex::new(Embedder::open(&default_folder(), computes)?));
    let load = {
        let (folder, chosen) = (folder.clone(), checkpoint_hash.clone());
        Arc::new(move || -> anyhow::Result<LearnedPolicy> {
            let mut agent = LearnedPolicy::load(&folder, sentences.clone(), computes)?;
            // What was loaded is what the run's manifest names.
            unchanged(&folder, &chosen)?;
            agent.set_sampling(sampling);
            Ok(agent)
        })
    };
    let name = load()?.name().to_owned();
    let (one, several) = (load.clone(), load);
    Ok(Chosen {
        name,
        checkpoint_hash: Some(checkpoint_hash),
        make: Box::new(move || Ok(Box::new(one()?))),
        team: Arc::new(move || -> anyhow::Result<Box<dyn Team>> {
            Ok(Box::new(LearnedTeam::new(several()?, LearnedTeam::SEATS)))
        }),
        folder: Some(folder),
    })
}

/// The agents that an explorer may let act: the named one first, then those that are found.
pub fn agents(named: Option<&Path>) -> Vec<Agent> {
    let mut folders: Vec<PathBuf> = named.map(Path::to_owned).into_iter().chain(checkpoints()).collect();
    let mut seen = Vec::new();
    folders.retain(|folder| {
        let whole = folder.canonicalize().unwrap_or_else(|_| folder.clone());
        let new = !seen.contains(&whole);
        seen.push(whole);
        new
    });
    let agent = |folder: PathBuf| {
        let name = folder.file_name().map_or_else(|| "agent".into(), |name| name.to_string_lossy().into_owned());
        let loaded = OnceCell::new();
        let load = move || -> anyhow::Result<Loaded> {
            let chosen = match loaded.get() {
                Some(chosen) => chosen,
                None => {
                    let chosen = learned(folder.clone())?;
                    loaded.get_or_init(|| chosen)
                }
            };
            Ok(Loaded { policy: (chosen.make)()?, checkpoint: chosen.checkpoint_hash.clone() })
        };
        Agent { name, load: Box::new(load) }
    };
    folders.into_iter().map(agent).collect()
}

/// The agent that is at home here: it acts when none is named.
const OWN: &str = "sprint";

/// The agent that acts when none is named: the first that is found.
pub fn shipped() -> anyhow::Result<PathBuf> {
    checkpoints().into_iter().next().context(
        "there is no trained agent in checkpoints/: name one with --checkpoint, or let --policy expert or random act",
    )
}

/// The checkpoints in `checkpoints` here and, for a binary in `target/release`, in the repository that it was built in: [`OWN`]
/// first, then by name.
pub fn checkpoints() -> Vec<PathBuf> {
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
        found.sort_by_key(|path| (path.file_name() != Some(OWN.as_ref()), path.clone()));
        found
    };
    folders.iter().flat_map(in_folder).collect()
}
