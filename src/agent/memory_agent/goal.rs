//! What the agent is after: the subtasks that it read in the instruction.

use crate::domain::{Class, SkillKind};
use crate::language::reader::{Context, ReadSubtask, Reader};

/// One subtask, as the agent understands it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Goal {
    /// What is to be done.
    pub(crate) skill: SkillKind,
    /// With what.
    pub(crate) object: Class,
    /// For Put, into or onto what.
    pub(crate) receptacle: Option<Class>,
    /// Where the thing is said to be.
    pub(crate) place: Option<Class>,
    /// A slice of it is meant.
    pub(crate) slice: bool,
}

impl Goal {
    /// What is read in an instruction; `before` is what was read in the one before. What names nothing is left out.
    ///
    /// # Errors
    /// When the shipped reader is damaged.
    pub(crate) fn read(instruction: &str, before: &[ReadSubtask]) -> anyhow::Result<(Vec<Goal>, Vec<ReadSubtask>)> {
        let reader = Reader::shipped().map_err(|error| anyhow::anyhow!("{error}"))?;
        let read = reader.read(instruction, &Context { before, house: None }).subtasks;
        Ok((read.iter().filter_map(Goal::of).collect(), read))
    }

    /// `None` where the subtask names no thing, or for Put no receptacle.
    pub(crate) fn of(read: &ReadSubtask) -> Option<Goal> {
        let complete = read.skill != SkillKind::Put || read.receptacle.is_some();
        let object = read.object.filter(|_| complete)?;
        Some(Goal { skill: read.skill, object, receptacle: read.receptacle, place: read.place, slice: read.slice })
    }

    /// What the skill needs besides the object and the receptacle: a knife, a microwave, a fridge, a faucet, a basin.
    pub(crate) fn is_tool(&self, class: Class) -> bool {
        use crate::domain::class::FixtureEffect::{Cool, Heat, Rinse};
        let info = class.info();
        match self.skill {
            SkillKind::Slice => class.is_knife(),
            SkillKind::Heat => info.effect == Some(Heat),
            SkillKind::Cool => info.effect == Some(Cool),
            SkillKind::Clean => info.effect == Some(Rinse) || info.basin,
            SkillKind::Pickup | SkillKind::Put | SkillKind::Toggle => false,
        }
    }
}
