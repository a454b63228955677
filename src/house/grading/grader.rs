//! A grader's state: the task, how far it is, and which instances play its roles.

use serde::{Deserialize, Serialize};

use crate::domain::skill::{Goal, Original, Role, Subtask};
use crate::domain::world::Instance;
use crate::domain::{Action, ActionType, Scene, World};

/// How subtasks are graded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Grading {
    /// A subtask asks for classes; the instance that the agent chose is bound for the subtasks after it.
    #[default]
    Class,
    /// The released code taken literally: the expert's own instances, and its two artefacts (a close is asked for when the
    /// expert closed anything anywhere in the skill; nothing is credited once the whole goal is met).
    Strict,
}

impl std::fmt::Display for Grading {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Grading::Class => "class",
            Grading::Strict => "strict",
        })
    }
}

impl std::str::FromStr for Grading {
    type Err = String;

    fn from_str(text: &str) -> Result<Grading, String> {
        match text {
            "class" => Ok(Grading::Class),
            "strict" => Ok(Grading::Strict),
            _ => Err(format!("unknown grader {text:?}: use class or strict")),
        }
    }
}

/// How far a task is, and which instances play its roles.
#[derive(Clone, Debug)]
pub struct Grader {
    pub(super) grading: Grading,
    pub(super) roles: Vec<Role>,
    pub(super) subtasks: Vec<Subtask>,
    pub(super) goal: Option<Goal>,
    pub(super) completed: usize,
    pub(super) bindings: Vec<Option<Instance>>,
    pub(super) pending: Option<Pending>,
    pub(super) before: Before,
    /// Strict: the whole goal was met at an earlier step.
    pub(super) finished: bool,
}

/// The first half of a subtask that ends with a close is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pending {
    /// What still has to be closed; `None` when the recording names nothing.
    pub(super) shut: Option<Instance>,
}

/// What the grader remembers of the world before a step.
#[derive(Clone, Debug, Default)]
pub(super) struct Before {
    pub(super) held: Option<u16>,
    /// The openable fixture around each object; only kept while a pickup has to be followed by a close.
    pub(super) inside: Vec<Option<Instance>>,
}

/// A step as the rules of grading see it.
#[derive(Clone, Copy)]
pub(super) struct GradedStep<'a> {
    pub(super) scene: &'a Scene,
    pub(super) world: &'a World,
    pub(super) action: Action,
    pub(super) done: bool,
}

impl GradedStep<'_> {
    /// The action, if it is of that kind and was carried out.
    pub(super) fn did(&self, kind: ActionType) -> bool {
        self.done && self.action.kind == kind
    }
}

/// What a step came to for the current subtask.
pub(super) enum SubtaskVerdict {
    /// Nothing has changed.
    Unchanged,
    /// The first half is done; the close is still to come.
    Half(Pending),
    /// The first half was undone.
    Undone,
    /// The subtask is done.
    Complete,
}

/// What plays a role from the start: with strict grading the expert's instance does.
fn first_binding(grading: Grading, role: &Role) -> Option<Instance> {
    let experts = role.expert.filter(|original| grading == Grading::Strict && original.slice.is_none());
    experts.map(|original| original.instance).or(role.bound)
}

impl Grader {
    /// A grader at the start of a task, in that state of that scene.
    pub fn new(
        grading: Grading,
        roles: &[Role],
        subtasks: &[Subtask],
        goal: Option<&Goal>,
        (scene, start): (&Scene, &World),
    ) -> Grader {
        let mut grader = Grader {
            grading,
            roles: roles.to_vec(),
            subtasks: subtasks.to_vec(),
            goal: goal.cloned(),
            completed: 0,
            bindings: roles.iter().map(|role| first_binding(grading, role)).collect(),
            pending: None,
            before: Before::default(),
            finished: false,
        };
        grader.remember(scene, start);
        grader
    }

    /// How many subtasks are done.
    pub(crate) fn completed(&self) -> usize {
        self.completed
    }

    /// How many there are.
    pub(crate) fn total(&self) -> usize {
        self.subtasks.len()
    }

    /// Whether all are done.
    pub fn is_done(&self) -> bool {
        self.completed == self.subtasks.len()
    }

    /// The subtasks, in order.
    pub(crate) fn subtasks(&self) -> &[Subtask] {
        &self.subtasks
    }

    /// The subtask that is to be done now; `None` when all are done.
    pub(crate) fn subtask(&self) -> Option<&Subtask> {
        self.subtasks.get(self.completed)
    }

    /// The task's roles; subtasks name them by position.
    pub(crate) fn roles(&self) -> &[Role] {
        &self.roles
    }

    /// The instance that plays a role, once one does.
    pub(crate) fn binding(&self, role: u8) -> Option<Instance> {
        self.bindings.get(usize::from(role)).copied().flatten()
    }

    /// Strict: the whole goal was met before the last subtask was done; nothing more is credited.
    pub(crate) fn is_cut_short(&self) -> bool {
        self.finished && !self.is_done()
    }

    /// Whether only the close is missing from the current subtask.
    pub(crate) fn is_half_done(&self) -> bool {
        self.pending.is_some()
    }

    /// What the first half of the current subtask left to be closed.
    pub(crate) fn to_close(&self) -> Option<Instance> {
        self.pending.and_then(|pending| pending.shut)
    }

    /// The expert's instance that strict grading asks for.
    pub(super) fn expert_instance(&self, role: u8) -> Option<Original> {
        let role = self.roles.get(usize::from(role)).filter(|_| self.grading == Grading::Strict)?;
        role.expert
    }
}
