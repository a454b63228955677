//! Which environment, from the command line.

use std::time::Duration;

use clap::Args;

use crate::domain::EnvironmentName;
use crate::env::remote::{Patience, RemoteSettings};

/// Seconds that an environment in another process may take for each answer, unless told otherwise.
const PATIENCE: u64 = 60;

/// Where it happens.
#[derive(Args, Clone)]
pub(crate) struct EnvironmentChoice {
    /// The environment: house, gym:ID (a Gymnasium environment in a child process), or openenv:URL (a server that speaks
    /// `OpenEnv`). With tasks of another environment than House: where that is found now [default: house, or the tasks' own]
    #[arg(long, value_name = "house|gym:ID|openenv:URL")]
    env: Option<EnvironmentName>,
    /// How long an environment in another process may take for each answer
    #[arg(long, value_name = "SECONDS", default_value_t = PATIENCE, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    env_timeout: u64,
}

impl Default for EnvironmentChoice {
    /// Nothing is named.
    fn default() -> EnvironmentChoice {
        EnvironmentChoice { env: None, env_timeout: PATIENCE }
    }
}

impl EnvironmentChoice {
    /// The environment that was named, where that is not House.
    pub(crate) fn remote(&self) -> Option<&EnvironmentName> {
        self.env.as_ref().filter(|name| **name != EnvironmentName::House)
    }

    /// How environments in other processes are reached.
    pub(crate) fn reach(&self) -> RemoteSettings {
        let answer = Duration::from_secs(self.env_timeout);
        RemoteSettings { patience: Patience { answer, ..Patience::USUAL }, found_at: self.remote().cloned() }
    }
}
