//! Which policy acts, from the command line.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::checkpoint;
use super::policy_name::{ExternalPolicyOptions, PolicyName, PolicyNameParser};
use crate::agent::policy_source::{self, PolicySource};
use crate::agent::{DecisionOverride, DecisionRule};

/// Which policy acts.
#[derive(Args)]
pub(crate) struct PolicyChoice {
    /// The trained agent that acts: its folder, its name among checkpoints/, or ORG/NAME[@REVISION] on the Hub [default: the
    /// shipped one]
    #[arg(long, value_name = "DIR|NAME")]
    checkpoint: Option<PathBuf>,
    /// Who acts
    #[arg(long, value_name = "POLICY", value_parser = PolicyNameParser::HEADLESS, default_value = "agent")]
    policy: PolicyName,
    #[command(flatten)]
    remote: ExternalPolicyOptions,
}

/// How a trained agent decides, where not as its checkpoint says.
#[derive(Args, Clone, Copy, Default)]
pub(crate) struct Deciding {
    /// The rule by which the agent decides: paper (of the possible actions the likeliest, then its class), or mass (the likeliest
    /// pair of both, adjusted and weighed as its checkpoint says) [default: its checkpoint's]
    #[arg(long, value_enum)]
    decision: Option<RuleName>,
    /// Whether the agent is kept from repeating itself [default: as its checkpoint says]
    #[arg(long, value_enum, value_name = "on|off")]
    loop_guard: Option<OnOff>,
}

#[derive(Clone, Copy, ValueEnum)]
enum RuleName {
    Mass,
    Paper,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum OnOff {
    On,
    Off,
}

impl Deciding {
    /// What is asked.
    pub(crate) fn asked(self) -> DecisionOverride {
        DecisionOverride {
            decision: self.decision.map(|rule| match rule {
                RuleName::Mass => DecisionRule::Mass,
                RuleName::Paper => DecisionRule::Paper,
            }),
            loop_guard: self.loop_guard.map(|guard| guard == OnOff::On),
        }
    }
}

impl PolicyChoice {
    /// Whether the policy is none of the program's own.
    pub(crate) fn is_external(&self) -> bool {
        matches!(self.policy, PolicyName::External(_))
    }

    /// Opens what was chosen.
    ///
    /// # Errors
    /// When the checkpoint or its sentence encoder cannot be used, or an external policy.
    pub(crate) fn open(&self, sampling: bool, asked: DecisionOverride) -> anyhow::Result<PolicySource> {
        if self.policy != PolicyName::Agent && self.checkpoint.is_some() {
            anyhow::bail!("--checkpoint names a trained agent, but --policy asks for another: leave one of them out");
        }
        if sampling && !self.policy.can_sample() {
            anyhow::bail!(
                "--sample draws the actions of a trained agent or of an exported policy; leave it out with another"
            );
        }
        if !asked.is_none() && self.policy != PolicyName::Agent {
            anyhow::bail!("--decision and --loop-guard are for trained agents; leave them out with another --policy");
        }
        match &self.policy {
            PolicyName::Expert => Ok(PolicySource::expert()),
            PolicyName::Random => Ok(PolicySource::random()),
            PolicyName::External(remote) => remote.open(self.remote, sampling),
            PolicyName::Agent | PolicyName::Manual => {
                let folder = match &self.checkpoint {
                    Some(named) => checkpoint::folder(named)?,
                    None => policy_source::shipped()?,
                };
                PolicySource::checkpoint(folder, sampling, asked)
            }
        }
    }
}
