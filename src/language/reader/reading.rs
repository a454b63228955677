//! What was read.

use serde::Serialize;

use crate::domain::Class;
use crate::domain::skill::{Role, SkillKind, Subtask};

/// Above this confidence a reading may be shown as certain; below it the display should ask.
pub const CERTAIN: f32 = 0.97;

/// The most other readings that are offered.
const ALTERNATIVES: usize = 3;

/// Another class that may have been meant, and how likely.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// The receptacle was meant otherwise, not the object.
    pub is_receptacle: bool,
    /// The class.
    pub class: Class,
    /// How likely beside the one that was chosen.
    pub probability: f32,
}

/// One subtask as it was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadSubtask {
    /// What is to be done.
    pub skill: SkillKind,
    /// With what; `None` where the text says "it" and nothing was named before.
    pub object: Option<Class>,
    /// For Put, into or onto what.
    pub receptacle: Option<Class>,
    /// A slice of the object is meant, not a whole one.
    pub slice: bool,
    /// Words of the object's looks: "red".
    pub looks: Vec<String>,
    /// Where the thing is said to be.
    pub place: Option<Class>,
    /// What else may have been meant, the likeliest first.
    pub alternatives: Vec<Alternative>,
}

/// A text as it was read.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WishReading {
    /// What is to be done, in order.
    pub subtasks: Vec<ReadSubtask>,
    /// How likely all of it is right, from 0 to 1.
    pub confidence: f32,
    /// Words that were not understood.
    pub unread: Vec<String>,
    /// Classes that are asked for and not in the house.
    pub absent: Vec<Class>,
    /// Which language model read it; nothing where the program did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub read_by: Option<String>,
}

impl WishReading {
    /// In words: "pick up a mug, put it in the sink".
    pub fn words(&self) -> String {
        let mut last = None;
        let said = self.subtasks.iter().map(|subtask| {
            let looks: String = subtask.looks.iter().map(|look| format!("{look} ")).collect();
            let named = |class: Class| {
                let what = if subtask.slice { format!("slice of {}", class.spoken()) } else { class.spoken().into() };
                crate::language::grammar::with_article(&format!("{looks}{what}"))
            };
            let object = match subtask.object {
                None => "something".to_string(),
                again if again == last && subtask.skill != SkillKind::Pickup => "it".to_string(),
                Some(class) => named(class),
            };
            if subtask.object.is_some() {
                last = subtask.object;
            }
            match (subtask.skill, subtask.receptacle) {
                (SkillKind::Pickup, _) => format!("pick up {object}"),
                (SkillKind::Put, Some(place)) => format!("put {object} {} the {}", place.preposition(), place.spoken()),
                (SkillKind::Put, None) => format!("put {object} somewhere"),
                (SkillKind::Slice, _) => format!("slice {object}"),
                (SkillKind::Toggle, _) => format!("switch on {object}"),
                (SkillKind::Clean, _) => format!("rinse {object}"),
                (SkillKind::Heat, _) => format!("heat {object}"),
                (SkillKind::Cool, _) => format!("chill {object}"),
            }
        });
        said.collect::<Vec<_>>().join(", ")
    }

    /// The reading with another class in a subtask, and wherever the text means the same thing by it: as an object or as a
    /// receptacle, and as both where a thing is put into another one that is then put somewhere.
    #[must_use]
    pub fn with(&self, at: usize, alternative: Alternative) -> WishReading {
        let mut other = self.clone();
        let chosen = self.subtasks.get(at);
        let chosen =
            chosen.and_then(|chosen| if alternative.is_receptacle { chosen.receptacle } else { chosen.object });
        let Some(was) = chosen else { return other };
        let is = Some(alternative.class);
        let carried = |read: &[ReadSubtask]| {
            let puts = |read: &ReadSubtask| read.skill == SkillKind::Put;
            read.iter().any(|one| puts(one) && one.object == Some(was))
                && read.iter().any(|one| puts(one) && one.receptacle == Some(was))
        };
        let both = carried(&self.subtasks);
        for subtask in &mut other.subtasks {
            if subtask.object == Some(was) && (both || !alternative.is_receptacle) {
                subtask.object = is;
                subtask.slice &= alternative.class.info().slices > 0;
            }
            if subtask.receptacle == Some(was) && (both || alternative.is_receptacle) {
                subtask.receptacle = is;
            }
            subtask.place = subtask.place.filter(|place| Some(*place) != subtask.object);
        }
        let named =
            |class: &Class| other.subtasks.iter().any(|one| [one.object, one.receptacle].contains(&Some(*class)));
        other.absent.retain(named);
        other.confidence = alternative.probability.min(1.0 - self.confidence).max(0.0);
        other
    }

    /// What is done with what, without the looks and places of things: whether two readings are graded alike.
    pub(crate) fn steps(&self) -> Vec<(SkillKind, Option<Class>, Option<Class>, bool)> {
        self.subtasks.iter().map(|one| (one.skill, one.object, one.receptacle, one.slice)).collect()
    }

    /// What was most likely meant if not this: at most three readings with one other class, the likeliest first.
    pub fn alternatives(&self) -> Vec<WishReading> {
        let all = self.subtasks.iter().enumerate();
        let mut all: Vec<(usize, Alternative)> =
            all.flat_map(|(at, subtask)| subtask.alternatives.iter().map(move |&other| (at, other))).collect();
        all.sort_by(|a, b| b.1.probability.total_cmp(&a.1.probability));
        let steps = |reading: &WishReading| -> Vec<_> {
            reading.subtasks.iter().map(|one| (one.skill, one.object, one.receptacle)).collect()
        };
        let mut found: Vec<WishReading> = Vec::new();
        for (at, alternative) in all {
            let other = self.with(at, alternative);
            let known = std::iter::once(self).chain(&found).any(|known| steps(known) == steps(&other));
            let into_itself = other.subtasks.iter().any(|one| one.object.is_some() && one.object == one.receptacle);
            if !known && !into_itself {
                found.push(other);
            }
            if found.len() == ALTERNATIVES {
                break;
            }
        }
        found
    }

    /// The parts and steps that a grader follows; `None` when something was left open. A thing that is put, cleaned, heated or
    /// cooled without a word of picking it up is graded as that alone.
    pub fn task(&self) -> Option<(Vec<Role>, Vec<Subtask>)> {
        let mut roles: Vec<Role> = Vec::new();
        let mut subtasks: Vec<Subtask> = Vec::new();
        let mut part = |class: Class, slice: bool, new: bool| {
            let known = roles.iter().rposition(|role| role.class == class && role.slice == slice && !new);
            known.unwrap_or_else(|| {
                roles.push(Role { class, slice, bound: None, expert: None });
                roles.len() - 1
            }) as u8
        };
        for (at, read) in self.subtasks.iter().enumerate() {
            let class = read.object?;
            // A second mug that is picked up or put after the first one was put is another mug.
            let earlier = &self.subtasks[..at];
            let same = |other: &&ReadSubtask| other.object == read.object && other.slice == read.slice;
            let done = earlier.iter().rev().find(same).is_some_and(|other| other.skill == SkillKind::Put);
            let carried = earlier.iter().any(|other| other.skill == SkillKind::Put && other.receptacle == Some(class));
            let new = done && !carried && matches!(read.skill, SkillKind::Pickup | SkillKind::Put);
            let object = part(class, read.slice, new);
            let receptacle = match read.skill {
                SkillKind::Put => Some(part(read.receptacle?, false, false)),
                _ => None,
            };
            subtasks.push(Subtask { skill: read.skill, object, receptacle, closes: false, literal: None });
        }
        (!subtasks.is_empty()).then_some((roles, subtasks))
    }
}
