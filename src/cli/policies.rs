//! Which policy acts, from the command line.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::agent::policy_source::{self, PolicySource};

/// Which policy acts.
#[derive(Args)]
pub(crate) struct PolicyChoice {
    /// The trained agent that acts: its folder, or its name among checkpoints/ [default: the shipped one]
    #[arg(long, value_name = "DIR|NAME")]
    checkpoint: Option<PathBuf>,
    /// Who acts
    #[arg(long, value_enum, default_value = "agent")]
    policy: Kind,
}

/// Who acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// The trained agent
    Agent,
    /// Shortest paths and interactions, knowing everything
    Expert,
    /// A possible action by chance
    Random,
}

impl PolicyChoice {
    /// Opens what was chosen.
    ///
    /// # Errors
    /// When the checkpoint or its sentence encoder cannot be used.
    pub(crate) fn open(&self, sampling: bool) -> anyhow::Result<PolicySource> {
        if self.policy != Kind::Agent && self.checkpoint.is_some() {
            anyhow::bail!("--checkpoint names a trained agent, but --policy asks for another: leave one of them out");
        }
        if sampling && self.policy != Kind::Agent {
            anyhow::bail!("--sample draws the actions of a trained agent; leave it out with --policy expert or random");
        }
        match self.policy {
            Kind::Expert => Ok(PolicySource::expert()),
            Kind::Random => Ok(PolicySource::random()),
            Kind::Agent => {
                let folder = match &self.checkpoint {
                    Some(named) => policy_source::folder_of(named),
                    None => policy_source::shipped()?,
                };
                PolicySource::checkpoint(folder, sampling)
            }
        }
    }
}
