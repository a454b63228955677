//! `sprint open`: a recorded episode in the explorer, at any of its steps, ready to go on or to fork.

use std::path::PathBuf;

use clap::Args;

use super::environment::EnvironmentChoice;
use super::exit_status::ExitStatus;
use super::explore::{Display, Origin};
use super::recorded::{recorded, recorded_remotely};
use super::recorded_policy::RecordedPolicy;

/// Which episode, and how to show it.
#[derive(Args)]
pub(crate) struct Open {
    /// The run folder, with the episode (its number from 1, or its task's id) and the step: RUN, RUN#3, RUN#3:17
    #[arg(value_name = "RUN[#EPISODE[:STEP]]")]
    episode: String,
    /// The task file that the run was made from, where the folder does not hold it
    #[arg(long, value_name = "FILE")]
    tasks: Option<PathBuf>,
    #[command(flatten)]
    policy: RecordedPolicy,
    #[command(flatten)]
    environment: EnvironmentChoice,
    #[command(flatten)]
    display: Display,
}

impl Open {
    /// Opens the episode.
    ///
    /// # Errors
    /// When it cannot be read, its tasks are not at hand, or the simulator does not come to what was recorded.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let (episode, tasks, policy) = (&self.episode, self.tasks.as_deref(), &self.policy);
        let remote = recorded_remotely(episode, tasks, policy, self.environment.reach())?;
        if let Some((open, agent)) = remote {
            return self.display.paused().show_remote(true, open, agent);
        }
        let (kind, open) = recorded(episode, tasks, policy)?;
        self.display.paused().show(kind, false, &Origin::default(), open)
    }
}
