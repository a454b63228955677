//! The policies that may act, made on demand: loading the agent takes a while.

use crate::agent::{ExpertPolicy, Policy, RandomPolicy};

/// Who acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolicyKind {
    /// The trained agent.
    Agent,
    /// The expert, who reads the task's subtasks.
    Expert,
    /// Chance.
    Random,
}

impl PolicyKind {
    /// Every kind.
    pub const ALL: [PolicyKind; 3] = [PolicyKind::Agent, PolicyKind::Expert, PolicyKind::Random];

    /// The name that `--policy` takes.
    pub fn name(self) -> &'static str {
        match self {
            PolicyKind::Agent => "agent",
            PolicyKind::Expert => "expert",
            PolicyKind::Random => "random",
        }
    }

    /// The next kind, around.
    pub fn next(self) -> PolicyKind {
        let at = PolicyKind::ALL.iter().position(|&kind| kind == self).unwrap_or(0);
        PolicyKind::ALL[(at + 1) % PolicyKind::ALL.len()]
    }
}

/// Loads the agent, wherever its checkpoint lies.
pub type LoadAgent = Box<dyn Fn() -> anyhow::Result<Box<dyn Policy>>>;

/// Makes policies.
pub struct Policies {
    agent: LoadAgent,
}

impl Policies {
    /// With what loads the agent.
    pub fn new(agent: LoadAgent) -> Policies {
        Policies { agent }
    }

    /// A policy of that kind.
    ///
    /// # Errors
    /// When the agent cannot be loaded.
    pub fn make(&self, kind: PolicyKind) -> anyhow::Result<Box<dyn Policy>> {
        match kind {
            PolicyKind::Agent => (self.agent)(),
            PolicyKind::Expert => Ok(Box::new(ExpertPolicy::new())),
            PolicyKind::Random => Ok(Box::new(RandomPolicy::new())),
        }
    }
}
