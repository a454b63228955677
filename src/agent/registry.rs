//! The policies that may act, made on demand: loading the agent takes a while.

use super::policy_place::PolicyPlace;
use super::{ExpertPolicy, Policy, RandomPolicy};

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
    pub(crate) const ALL: [PolicyKind; 3] = [PolicyKind::Agent, PolicyKind::Expert, PolicyKind::Random];

    /// The name that `--policy` takes.
    pub(crate) fn name(self) -> &'static str {
        match self {
            PolicyKind::Agent => "agent",
            PolicyKind::Expert => "expert",
            PolicyKind::Random => "random",
        }
    }

    /// The next kind, around.
    pub(crate) fn next(self) -> PolicyKind {
        let at = PolicyKind::ALL.iter().position(|&kind| kind == self).unwrap_or(0);
        PolicyKind::ALL[(at + 1) % PolicyKind::ALL.len()]
    }
}

/// What tells policies apart: a name, and the hash of a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct PolicyIdentity {
    /// What it is called.
    pub(crate) name: String,
    /// SHA-256 of its checkpoint, where it has one.
    pub(crate) checkpoint: Option<String>,
}

/// A policy that acts, and what identifies it beside its name.
pub(crate) struct Loaded {
    pub(crate) policy: Box<dyn Policy>,
    /// SHA-256 of its checkpoint, where it has one.
    pub(crate) checkpoint: Option<String>,
    /// Where it is, if it is none of the program's own.
    pub(crate) place: Option<PolicyPlace>,
}

/// Loads an agent, wherever its checkpoint lies.
pub(crate) type LoadAgent = Box<dyn Fn() -> anyhow::Result<Loaded>>;

/// An agent that may act.
pub struct NamedAgent {
    /// The name of its checkpoint.
    pub(crate) name: String,
    pub(crate) load: LoadAgent,
}

/// Makes policies.
pub struct Policies {
    agents: Vec<NamedAgent>,
    chosen: usize,
}

impl Policies {
    /// With these agents; the first acts.
    pub fn new(agents: Vec<NamedAgent>) -> Policies {
        Policies { agents, chosen: 0 }
    }

    /// The names of the agents.
    pub(crate) fn agents(&self) -> Vec<String> {
        self.agents.iter().map(|agent| agent.name.clone()).collect()
    }

    /// Which of them is meant by "the agent".
    pub(crate) fn chosen(&self) -> usize {
        self.chosen
    }

    /// From now on another agent is meant by "the agent": by its name, or its number from 1.
    ///
    /// # Errors
    /// When there is no such agent; says which there are.
    pub(crate) fn choose(&mut self, wanted: &str) -> anyhow::Result<()> {
        self.chosen = self.find(wanted)?;
        Ok(())
    }

    fn find(&self, wanted: &str) -> anyhow::Result<usize> {
        let numbered = || wanted.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let found = self.agents.iter().position(|agent| agent.name == wanted).or_else(numbered);
        found.filter(|&at| at < self.agents.len()).ok_or_else(|| {
            anyhow::anyhow!("there is no checkpoint {wanted:?}; there are: {}", self.agents().join(", "))
        })
    }

    /// A policy by its name: a kind, or the name or number of an agent.
    ///
    /// # Errors
    /// When there is none, or it cannot be loaded.
    pub(crate) fn named(&self, wanted: &str) -> anyhow::Result<Loaded> {
        match PolicyKind::ALL.into_iter().find(|kind| kind.name() == wanted) {
            Some(kind) => self.make(kind),
            None => (self.agents[self.find(wanted)?].load)(),
        }
    }

    /// A policy of that kind.
    ///
    /// # Errors
    /// When the agent cannot be loaded.
    pub(crate) fn make(&self, kind: PolicyKind) -> anyhow::Result<Loaded> {
        let plain = |policy| Ok(Loaded { policy, checkpoint: None, place: None });
        match kind {
            PolicyKind::Agent => match self.agents.get(self.chosen) {
                Some(agent) => (agent.load)(),
                None => anyhow::bail!(
                    "there is no checkpoint in checkpoints/: name one with --checkpoint, or let the expert (e) or chance (x) act"
                ),
            },
            PolicyKind::Expert => plain(Box::new(ExpertPolicy::new())),
            PolicyKind::Random => plain(Box::<RandomPolicy>::default()),
        }
    }
}
