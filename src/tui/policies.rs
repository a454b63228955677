//! The policies that may act, made on demand: loading the agent takes a while.

use crate::agent::Policy;

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
pub type LoadAgent = Box<dyn Fn() -> anyhow::Result<Box<dyn Policy>> + Send>;

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
            PolicyKind::Expert => anyhow::bail!("not yet"),
            PolicyKind::Random => Ok(Box::new(RandomPolicy(rand_chacha::rand_core::SeedableRng::seed_from_u64(0)))),
        }
    }
}

struct RandomPolicy(rand_chacha::ChaCha8Rng);
impl Policy for RandomPolicy {
    fn name(&self) -> &str {
        "random"
    }
    fn begin(&mut self, seed: u64) {
        self.0 = rand_chacha::rand_core::SeedableRng::seed_from_u64(seed)
    }
    fn decide(&mut self, s: &mut crate::agent::Situation<'_>) -> anyhow::Result<crate::agent::Decision> {
        use crate::domain::{Action, ActionType};
        use rand::Rng;
        let c = s.house.candidates();
        let n = self.0.random_range(0..5 + c.len());
        let action = if n < 5 { Action::navigate(ActionType::ALL[n]) } else { c[n - 5].action() };
        let mut actions = [None; 12];
        for a in &mut actions[..5] {
            *a = Some(0.1)
        }
        for x in &c {
            actions[x.kind.index()] = Some(0.2)
        }
        let objects = c
            .iter()
            .map(|x| (x.class, 0.2, true))
            .chain(crate::domain::Class::all().take(4).map(|c| (c, 0.05, false)))
            .collect();
        Ok(crate::agent::Decision {
            action,
            mind: Some(crate::agent::Mind { actions, objects, entropy: 0.62, greedy: action }),
        })
    }
}
