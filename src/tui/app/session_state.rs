//! What was last told of the session.

use crate::agent::registry::PolicyKind;
use crate::agent::{Decision, Values};
use crate::explore::exploration::SessionSnapshot;
use crate::explore::session::{RunMode, StepRate};

/// What was last told of the session.
pub(crate) struct SessionState {
    /// The newest state.
    pub(crate) now: Option<Box<SessionSnapshot>>,
    /// What the policy would do next, and that in words.
    pub(crate) decision: Option<(Decision, String)>,
    /// What its critics say of the present state.
    pub(crate) values: Option<Values>,
    /// The kind of policy that decides, or was asked to.
    pub(crate) policy: PolicyKind,
    /// How it goes on by itself, if it does.
    pub(crate) run_mode: Option<RunMode>,
    /// How fast it does.
    pub(crate) rate: StepRate,
    /// Something slow goes on.
    pub(crate) busy: Option<String>,
    /// Work in the background.
    pub(crate) working: Option<String>,
    /// Why the policy cannot go on.
    pub(crate) trouble: Option<String>,
    /// Instructions that make sense in this house.
    pub(crate) examples: Vec<String>,
    /// What the agent was told before the present instruction.
    pub(crate) replaced: Option<String>,
}

impl SessionState {
    /// Nothing was told yet.
    pub(crate) fn new(policy: PolicyKind) -> SessionState {
        SessionState {
            now: None,
            decision: None,
            values: None,
            policy,
            run_mode: None,
            rate: StepRate::default(),
            busy: Some("building the house".into()),
            working: None,
            trouble: None,
            examples: Vec::new(),
            replaced: None,
        }
    }

    /// What acts is called: a checkpoint's name, where one is loaded.
    pub(crate) fn acts(&self) -> &str {
        let loaded = self.now.as_ref().filter(|now| now.policy == self.policy).map(|now| now.acts.as_str());
        loaded.unwrap_or_else(|| self.policy.name())
    }

    /// Another policy was asked for.
    pub(crate) fn choose(&mut self, policy: PolicyKind) {
        self.policy = policy;
        self.decision = None;
        self.trouble = None;
    }
}
