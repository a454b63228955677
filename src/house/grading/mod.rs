//! Graders: which subtasks of a task are done, strictly in order, looked at after every step.

mod class;
mod strict;
mod words;

use serde::{Deserialize, Serialize};

use super::goals::goal_met;
use super::outcome::Outcome;
use crate::domain::skill::{Goal, Role, SkillKind, Subtask};
use crate::domain::world::Instance;
use crate::domain::{Action, ActionType, Scene, World};

pub use words::describe;

/// How subtasks are graded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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

/// Follows a task's subtasks.
#[derive(Clone, Debug)]
pub struct Grader {
    grading: Grading,
    roles: Vec<Role>,
    subtasks: Vec<Subtask>,
    goal: Option<Goal>,
    completed: usize,
    bindings: Vec<Option<Instance>>,
    pending: Option<Pending>,
    before: Option<Before>,
    /// Strict: the whole goal was met at an earlier step.
    finished: bool,
}

/// The first half of a subtask that ends with a close is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pending {
    /// What still has to be closed; `None` when the recording names nothing.
    shut: Option<Instance>,
}

/// What the grader remembers of the world before a step.
#[derive(Clone, Debug, Default)]
struct Before {
    held: Option<u16>,
    /// The openable fixture around each object; only kept while a pickup has to be followed by a close.
    inside: Vec<Option<Instance>>,
}

/// A step as the rules of grading see it.
#[derive(Clone, Copy)]
struct Step<'a> {
    scene: &'a Scene,
    world: &'a World,
    action: Action,
    done: bool,
}

impl Step<'_> {
    /// The action, if it is of that kind and was carried out.
    fn did(&self, kind: ActionType) -> bool {
        self.done && self.action.kind == kind
    }
}

/// What a step came to for the current subtask.
enum Verdict {
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
    /// A grader at the start of a task.
    pub fn new(grading: Grading, roles: &[Role], subtasks: &[Subtask], goal: Option<&Goal>) -> Grader {
        Grader {
            grading,
            roles: roles.to_vec(),
            subtasks: subtasks.to_vec(),
            goal: goal.cloned(),
            completed: 0,
            bindings: roles.iter().map(|role| first_binding(grading, role)).collect(),
            pending: None,
            before: None,
            finished: false,
        }
    }

    /// Looks at the world after a step; `true` when a subtask was completed by it. At most one a step.
    pub fn observe(&mut self, scene: &Scene, world: &World, action: Action, outcome: Outcome) -> bool {
        let completed_one = match self.subtasks.get(self.completed) {
            Some(subtask) if !self.finished => {
                let subtask = subtask.clone();
                let step = Step { scene, world, action, done: outcome.is_done() };
                let verdict = match (self.grading, &subtask.literal) {
                    (Grading::Strict, Some(literal)) => strict::grade(self, &subtask, literal, step),
                    _ => class::grade(self, &subtask, step),
                };
                self.take(verdict)
            }
            _ => false,
        };
        if self.grading == Grading::Strict && !self.finished {
            self.finished = self.goal.as_ref().is_some_and(|goal| goal_met(goal, scene, world));
        }
        if self.grading == Grading::Strict {
            self.find_slices(world);
        }
        self.remember(scene, world);
        completed_one
    }

    fn take(&mut self, verdict: Verdict) -> bool {
        match verdict {
            Verdict::Unchanged => return false,
            Verdict::Half(pending) => self.pending = Some(pending),
            Verdict::Undone => self.pending = None,
            Verdict::Complete => {
                self.pending = None;
                self.completed += 1;
                return true;
            }
        }
        false
    }

    /// The expert's slices exist only once the whole is cut.
    fn find_slices(&mut self, world: &World) {
        for (role, slot) in self.roles.iter().zip(&mut self.bindings) {
            if slot.is_none() {
                *slot = role.expert.and_then(|original| strict::resolve(world, original));
            }
        }
    }

    fn remember(&mut self, scene: &Scene, world: &World) {
        let follows = self.subtask().is_some_and(|subtask| subtask.skill == SkillKind::Pickup && subtask.closes);
        let inside = if follows {
            (0..world.objects.len() as u16).map(|index| class::shell(scene, world, Instance::Object(index))).collect()
        } else {
            Vec::new()
        };
        self.before = Some(Before { held: world.held, inside });
    }

    /// How many subtasks are done.
    pub fn completed(&self) -> usize {
        self.completed
    }

    /// How many there are.
    pub fn total(&self) -> usize {
        self.subtasks.len()
    }

    /// Whether all are done.
    pub fn is_done(&self) -> bool {
        self.completed == self.subtasks.len()
    }

    /// The subtasks, in order.
    pub fn subtasks(&self) -> &[Subtask] {
        &self.subtasks
    }

    /// The subtask that is to be done now; `None` when all are done.
    pub fn subtask(&self) -> Option<&Subtask> {
        self.subtasks.get(self.completed)
    }

    /// The roles.
    pub fn roles(&self) -> &[Role] {
        &self.roles
    }

    /// The instance that plays a role, once one does.
    pub fn binding(&self, role: u8) -> Option<Instance> {
        self.bindings.get(usize::from(role)).copied().flatten()
    }

    /// How subtasks are graded.
    pub fn grading(&self) -> Grading {
        self.grading
    }

    /// Whether an instance may play a role: the bound one, or any other of the class that plays no other role. With strict
    /// grading, the expert's own.
    pub fn fits(&self, scene: &Scene, world: &World, role: u8, instance: Instance) -> bool {
        match self.asked(role) {
            Some(original) => strict::resolve(world, original) == Some(instance),
            None => class::fits(self, scene, world, role, instance),
        }
    }

    /// The expert's instance that strict grading asks for.
    fn asked(&self, role: u8) -> Option<crate::domain::skill::Original> {
        let role = self.roles.get(usize::from(role)).filter(|_| self.grading == Grading::Strict)?;
        role.expert
    }

    /// Whether only the close is missing from the current subtask.
    pub fn is_half_done(&self) -> bool {
        self.pending.is_some()
    }

    /// What the first half of the current subtask left to be closed.
    pub fn to_close(&self) -> Option<Instance> {
        self.pending.and_then(|pending| pending.shut)
    }

    /// What the current subtask still waits for, in words; empty when all are done.
    pub fn waits_for(&self, scene: &Scene, world: &World) -> String {
        words::waits_for(self, scene, world)
    }
}
