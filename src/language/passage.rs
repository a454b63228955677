//! Passages: a run of adjacent skills of one trajectory with what one person wrote of each, and whoever sums it up.

use std::ops::Range;

use sha2::{Digest, Sha256};

use super::maker::Maker;
use crate::domain::trajectory::Annotation;
use crate::domain::{Role, Subtask, Trajectory};

/// Skills with a sentence each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage<'a> {
    /// The parts that instances play.
    pub(crate) roles: &'a [Role],
    /// The steps, in order.
    pub(crate) subtasks: &'a [Subtask],
    /// A sentence for each.
    pub(crate) sentences: &'a [String],
}

impl<'a> Passage<'a> {
    /// Some skills of a trajectory in one annotator's words; nothing when the annotation is not aligned or there are no such skills.
    pub(crate) fn of(
        trajectory: &'a Trajectory,
        annotation: &'a Annotation,
        skills: Range<usize>,
    ) -> Option<Passage<'a>> {
        if annotation.steps.len() != trajectory.skills.len() {
            return None;
        }
        let sentences = annotation.steps.get(skills.clone())?;
        Some(Passage { roles: &trajectory.roles, subtasks: trajectory.skills.get(skills)?, sentences })
    }

    /// Identifies what a summary is made of, which is the skills, what they are about, and the sentences: the first 16 digits
    /// of a sha256. Roles count by the order in which they appear.
    pub(crate) fn digest(&self) -> String {
        let mut hash = Sha256::new();
        let mut known: Vec<u8> = Vec::new();
        let mut tell = |role: u8, hash: &mut Sha256| {
            let number = known.iter().position(|&other| other == role).unwrap_or_else(|| {
                known.push(role);
                known.len() - 1
            });
            let (class, slice) =
                self.roles.get(usize::from(role)).map_or(("", false), |role| (role.class.name(), role.slice));
            hash.update(format!(" {number} {class} {slice}"));
        };
        for (subtask, sentence) in self.subtasks.iter().zip(self.sentences) {
            hash.update(format!("{:?}", subtask.skill));
            tell(subtask.object, &mut hash);
            if let Some(receptacle) = subtask.receptacle {
                tell(receptacle, &mut hash);
            }
            hash.update(format!("\n{}\n{sentence}\n", sentence.len()));
        }
        // Sentences of which no skill is told count by themselves.
        for sentence in self.sentences.iter().skip(self.subtasks.len()) {
            hash.update(format!("\n{}\n{sentence}\n", sentence.len()));
        }
        format!("{:x}", hash.finalize())[..16].to_string()
    }

    /// Seeds what is drawn for this passage: the digest's number.
    pub(crate) fn seed(&self) -> u64 {
        u64::from_str_radix(&self.digest(), 16).unwrap_or_default()
    }
}

/// What a summarizer makes of a passage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Summary {
    /// An instruction.
    Sentence(String),
    /// An answer in which there is none.
    Malformed(String),
}

/// Takes the summary of the passage at a position as soon as it is there.
pub(crate) type TakeSummary<'a> = dyn FnMut(usize, Summary) -> anyhow::Result<()> + 'a;

/// Sums passages up.
pub(crate) trait Summarizer {
    /// What it is called where its work is kept: `rules`, `concat`, the name of a model.
    fn source(&self) -> &str;

    /// Changes whenever it would say something else of the same passage.
    fn version(&self) -> u32;

    /// The model that writes, where one does.
    fn maker(&self) -> Option<&Maker> {
        None
    }

    /// How many passages it is best given at once; between two lots a relabelling can be stopped.
    fn together(&self) -> usize;

    /// Sums passages up, in any order.
    ///
    /// # Errors
    /// When it cannot do its work, or what it made is not taken; what was taken until then stands.
    fn summaries(&self, passages: &[Passage<'_>], take: &mut TakeSummary<'_>) -> anyhow::Result<()>;
}

/// One sentence after the other, as they are: what the paper's ablation trains on.
pub(crate) struct Concatenation;

/// The sentences one after the other, each brought into the form of an instruction.
pub(crate) fn concatenated(sentences: &[String]) -> String {
    let instructions: Vec<String> = sentences.iter().map(|sentence| super::instruction::normalise(sentence)).collect();
    instructions.join(" ")
}

impl Summarizer for Concatenation {
    fn source(&self) -> &'static str {
        "concat"
    }

    fn version(&self) -> u32 {
        1
    }

    fn together(&self) -> usize {
        4096
    }

    fn summaries(&self, passages: &[Passage<'_>], take: &mut TakeSummary<'_>) -> anyhow::Result<()> {
        let texts = passages.iter().map(|passage| Summary::Sentence(concatenated(passage.sentences)));
        texts.enumerate().try_for_each(|(index, text)| take(index, text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::SkillKind;
    use crate::domain::trajectory;
    use crate::house::testing::{put_subtask, role, subtask};

    #[test]
    fn sentences_follow_each_other_as_instructions() {
        let texts = ["pick up the Mug ".to_string(), "Put it down!".to_string()];
        assert_eq!(concatenated(&texts), "Pick up the mug. Put it down!");
    }

    #[test]
    fn a_passage_is_identified_by_what_it_says_and_not_by_where_it_stands() {
        let roles = [role("Mug"), role("Desk"), role("Mug"), role("Desk"), role("Shelf")];
        let texts = ["take a mug".to_string(), "put it down".to_string()];
        let digest = |object, place| {
            let subtasks = [subtask(SkillKind::Pickup, object), put_subtask(object, place)];
            Passage { roles: &roles, subtasks: &subtasks, sentences: &texts }.digest()
        };
        assert_eq!(digest(0, 1), digest(2, 3));
        assert_ne!(digest(0, 1), digest(0, 4));
        let subtasks = [subtask(SkillKind::Pickup, 0), put_subtask(2, 1)];
        let another = Passage { roles: &roles, subtasks: &subtasks, sentences: &texts };
        assert_ne!(digest(0, 1), another.digest(), "another mug is put down than was taken");
    }

    #[test]
    fn an_annotation_that_is_not_aligned_gives_no_passage() {
        let mut trajectory = Trajectory {
            roles: vec![role("Mug"), role("Desk")],
            skills: vec![subtask(SkillKind::Pickup, 0), put_subtask(0, 1)],
            skill_starts: vec![0, 1],
            annotations: vec![Annotation { goal: "g".into(), steps: vec!["one".into(), "two".into()] }],
            ..trajectory::testing::empty("t", "s")
        };
        let found = |trajectory: &Trajectory, skills| {
            Passage::of(trajectory, &trajectory.annotations[0], skills).map(|passage| passage.sentences.len())
        };
        assert_eq!(found(&trajectory, 0..2), Some(2));
        assert_eq!(found(&trajectory, 1..3), None);
        trajectory.annotations[0].steps.pop();
        assert_eq!(found(&trajectory, 0..2), None);
    }
}
