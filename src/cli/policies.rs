//! Which policy acts, from the command line.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::agent::{ExpertPolicy, Policy, RandomPolicy};
use crate::run::evaluate::MakePolicy;

/// Which policy acts.
#[derive(Args)]
pub struct PolicyChoice {
    /// A trained agent's folder
    #[arg(long, value_name = "DIR", conflicts_with = "policy")]
    checkpoint: Option<PathBuf>,
    /// Who acts
    #[arg(long, value_enum, default_value = "agent")]
    policy: Kind,
}

/// The policies that need no checkpoint, and the one that has one.
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
    /// SHA-256 of its checkpoint's files.
    pub checkpoint_hash: Option<String>,
    /// Makes one.
    pub make: Box<MakePolicy<'static>>,
}

impl PolicyChoice {
    /// Opens what was chosen.
    ///
    /// # Errors
    /// When the checkpoint cannot be used.
    pub fn open(&self) -> anyhow::Result<Chosen> {
        let plain = |name: &str, make: fn() -> Box<dyn Policy>| Chosen {
            name: name.into(),
            checkpoint_hash: None,
            make: Box::new(move || Ok(make())),
        };
        match self.policy {
            Kind::Expert => Ok(plain("expert", || Box::new(ExpertPolicy::default()))),
            Kind::Random => Ok(plain("random", || Box::new(RandomPolicy::default()))),
            Kind::Agent => anyhow::bail!("no trained agent yet: {:?}", self.checkpoint),
        }
    }
}
