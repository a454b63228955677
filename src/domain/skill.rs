//! Skills: the annotated steps of a task, and the goal of a whole ALFRED trajectory.

use serde::{Deserialize, Serialize};

use super::class::Class;
use super::world::Instance;

/// The kind of a skill, after GotoLocation is merged into the skill that follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[allow(missing_docs)]
pub enum SkillKind {
    Pickup,
    Put,
    Slice,
    Toggle,
    Clean,
    Heat,
    Cool,
}

impl SkillKind {
    /// Every kind.
    pub(crate) const ALL: [SkillKind; 7] = [
        SkillKind::Pickup,
        SkillKind::Put,
        SkillKind::Slice,
        SkillKind::Toggle,
        SkillKind::Clean,
        SkillKind::Heat,
        SkillKind::Cool,
    ];
}

/// An instance as the expert's recording names it: a thing that exists at the start, or one of the slices it fell into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Original {
    /// The thing itself, or what the slice is cut from.
    pub(crate) instance: Instance,
    /// Which slice, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) slice: Option<u8>,
}

/// A part that some instance plays in a task: "the apple", "the slice that we heat". The class grader binds a role to
/// the instance that the agent chose. Two roles are never bound to one thing or lamp; furniture may take what several roles
/// ask a place for.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Role {
    /// The class that is asked for.
    #[schemars(schema_with = "Class::vocabulary_schema")]
    pub(crate) class: Class,
    /// A slice of that class is asked for, not a whole one.
    #[serde(default)]
    pub(crate) slice: bool,
    /// The instance that already plays it when the task starts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<Instance>,
    /// The expert's instance, for the strict grader.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) expert: Option<Original>,
}

/// What the released code's grader asks of a subtask beyond its roles (strict grading only).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Literal {
    /// The expert's skill has a Close anywhere.
    pub(crate) needs_close: bool,
    /// The thing whose state the released code reads: the cleaned, heated or cooled thing, else the skill's object.
    pub(crate) object: Original,
    /// The target of the expert's last action in the skill.
    pub(crate) last_target: Option<Original>,
}

/// One step of a task: a skill with the roles it is about.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Subtask {
    /// What is to be done.
    pub skill: SkillKind,
    /// With what: a position in the task's roles. For Toggle, the lamp.
    pub object: u8,
    /// For Put, into or onto what: a position in the task's roles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receptacle: Option<u8>,
    /// The receptacle has to be closed again at the end.
    #[serde(default)]
    pub closes: bool,
    /// For strict grading against ALFRED's recordings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub literal: Option<Literal>,
}

/// ALFRED's seven task types.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub(crate) enum GoalKind {
    LookAtObjInLight,
    PickAndPlaceSimple,
    PickAndPlaceWithMovableRecep,
    PickCleanThenPlaceInRecep,
    PickCoolThenPlaceInRecep,
    PickHeatThenPlaceInRecep,
    PickTwoObjAndPlace,
}

/// The goal of a whole ALFRED trajectory, matched by parts of names as ALFRED does.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Which of the seven conditions.
    pub(crate) kind: GoalKind,
    /// The object.
    pub(crate) object: Class,
    /// Its slices are meant.
    pub(crate) sliced: bool,
    /// Where it must end up.
    pub(crate) receptacle: Option<Class>,
    /// The movable receptacle that must carry it.
    pub(crate) movable: Option<Class>,
    /// The lamp that must shine.
    pub(crate) lamp: Option<Class>,
}
