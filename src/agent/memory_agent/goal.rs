//! What the agent is after: the subtasks that it read in the instruction.

use crate::domain::{Class, SkillKind};
use crate::language::reader::{Context, ReadSubtask, Reader};

/// What a word may mean beside the likeliest with at least this probability will do as well.
const AS_WELL: f32 = 0.2;

/// One subtask, as the agent understands it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Goal {
    /// What is to be done.
    pub(crate) skill: SkillKind,
    /// With what.
    pub(crate) object: Class,
    /// What else may be meant by the word: a lamp is a desk lamp or a floor lamp. Whichever is found will do.
    pub(crate) others: Vec<Class>,
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
        let read = reader.read(instruction, &Context { before, ..Context::default() }).subtasks;
        Ok((read.iter().filter_map(Goal::of).collect(), read))
    }

    /// `None` where the subtask names no thing, or for Put no receptacle.
    pub(crate) fn of(read: &ReadSubtask) -> Option<Goal> {
        let complete = read.skill != SkillKind::Put || read.receptacle.is_some();
        let object = read.object.filter(|_| complete)?;
        let others = read.alternatives.iter().filter(|other| !other.is_receptacle && other.probability >= AS_WELL);
        Some(Goal {
            skill: read.skill,
            object,
            others: others.map(|other| other.class).collect(),
            receptacle: read.receptacle,
            place: read.place,
            slice: read.slice,
        })
    }

    /// Whether a thing of the class will do for the object.
    pub(crate) fn is_object(&self, class: Class) -> bool {
        class == self.object || self.others.contains(&class)
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
