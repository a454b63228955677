//! `sprint explore`: opens what the explorer starts in, and starts it.

mod display;
mod origin;

use std::io::Write;

use anyhow::bail;
use clap::Args;

pub(crate) use self::display::Display;
pub(super) use self::display::{GraphicsName, settings};
pub(crate) use self::origin::Origin;
use super::checkpoint;
use super::exit_status::ExitStatus;
use super::policy_name::{ExternalPolicyOptions, PolicyName, PolicyNameParser};
use super::streams::StandardOutput;
use crate::agent::registry::PolicyKind;
use crate::tui::config::ExplorerConfig;

/// Where the explorer starts, and who acts.
#[derive(Args)]
pub(crate) struct Explore {
    #[command(flatten)]
    from: Origin,
    #[command(flatten)]
    display: Display,
    /// Who acts at first [default: agent]
    #[arg(long, value_name = "POLICY", value_parser = PolicyNameParser::EXPLORER)]
    policy: Option<PolicyName>,
    #[command(flatten)]
    remote: ExternalPolicyOptions,
    /// Print a file of settings with a comment on each, and end
    #[arg(long)]
    print_config: bool,
}

impl Explore {
    /// Explores until the person leaves.
    ///
    /// # Errors
    /// When what it should start in cannot be opened, or there is no terminal.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        if self.print_config {
            write!(StandardOutput::lock(), "{}", ExplorerConfig::commented())?;
            return Ok(ExitStatus::Ok);
        }
        let manual = matches!(self.policy, Some(PolicyName::Manual));
        let kind = match self.policy {
            None | Some(PolicyName::Agent | PolicyName::Manual | PolicyName::External(_)) => PolicyKind::Agent,
            Some(PolicyName::Expert) => PolicyKind::Expert,
            Some(PolicyName::Random) => PolicyKind::Random,
        };
        let is_named = self.policy.is_some() || self.from.is_named();
        // What is wrong with it is said before there is a screen.
        self.from.expect()?;
        let Explore { display, mut from, policy, remote, .. } = self;
        from.options = remote;
        from.checkpoint = from.checkpoint.as_deref().map(checkpoint::folder).transpose()?;
        if let Some(PolicyName::External(named)) = &policy {
            if from.checkpoint.is_some() {
                bail!("--checkpoint names a trained agent, but --policy asks for another: leave one of them out");
            }
            from.other_policy = Some(named.clone());
        }
        if let Some(open) = from.remote(kind)? {
            if matches!(policy, Some(PolicyName::Agent)) {
                bail!("the trained agents act in House only: name --policy random or manual with --env");
            }
            let agent = from.external_policy(kind)?;
            return display.show_remote(manual || policy.is_none(), open, agent);
        }
        if !is_named && !display.plain {
            return display.show_screen(kind, manual, || from.list(), || from.list());
        }
        // The screen shows what is wrong with an agent; a script is told by the exit code.
        let is_chosen = from.checkpoint.is_some() || from.other_policy.is_some();
        let needed = display.plain && is_chosen && kind == PolicyKind::Agent;
        let list = from.clone().unnamed();
        display.show(kind, manual, &list, move || {
            let mut exploration = from.exploration(kind)?;
            if needed {
                exploration.choose(kind)?;
            }
            Ok(exploration)
        })
    }
}
