//! Which policy acts, from the command line.

use std::path::PathBuf;

use clap::Args;

use super::policy_name::{ElsewhereOptions, PolicyName, PolicyNameParser};
use crate::agent::policy_source::{self, PolicySource};

/// Which policy acts.
#[derive(Args)]
pub(crate) struct PolicyChoice {
    /// The trained agent that acts: its folder, or its name among checkpoints/ [default: the shipped one]
    #[arg(long, value_name = "DIR|NAME")]
    checkpoint: Option<PathBuf>,
    /// Who acts
    #[arg(long, value_name = "POLICY", value_parser = PolicyNameParser::HEADLESS, default_value = "agent")]
    policy: PolicyName,
    #[command(flatten)]
    elsewhere: ElsewhereOptions,
}

impl PolicyChoice {
    /// Opens what was chosen.
    ///
    /// # Errors
    /// When the checkpoint or its sentence encoder cannot be used, or a policy from elsewhere.
    pub(crate) fn open(&self, sampling: bool) -> anyhow::Result<PolicySource> {
        if self.policy != PolicyName::Agent && self.checkpoint.is_some() {
            anyhow::bail!("--checkpoint names a trained agent, but --policy asks for another: leave one of them out");
        }
        if sampling && self.policy != PolicyName::Agent {
            anyhow::bail!("--sample draws the actions of a trained agent; leave it out with another --policy");
        }
        match &self.policy {
            PolicyName::Expert => Ok(PolicySource::expert()),
            PolicyName::Random => Ok(PolicySource::random()),
            PolicyName::Elsewhere(elsewhere) => elsewhere.open(self.elsewhere),
            PolicyName::Agent | PolicyName::Manual => {
                let folder = match &self.checkpoint {
                    Some(named) => policy_source::folder_of(named),
                    None => policy_source::shipped()?,
                };
                PolicySource::checkpoint(folder, sampling)
            }
        }
    }
}
