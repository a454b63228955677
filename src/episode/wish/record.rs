//! What is known and recorded of a wish.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::domain::{Class, Role, Scene, Subtask, World};
use crate::episode::failure::Failure;
use crate::house::grading::{Grader, Grading, describe};
use crate::language::reader::WishReading;

/// The wishes of an episode up to a state, in the order in which they were told.
pub(crate) type Wishes = Vec<Arc<Wish>>;

/// Who says when a wish is fulfilled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum WishGrading {
    /// The subtasks of the episode's task.
    Task,
    /// The subtasks as which it was read.
    Read,
    /// A person alone.
    #[default]
    Nobody,
}

/// What a wish came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WishVerdict {
    /// Every subtask is done, the grader says.
    Done,
    /// It took too long.
    OutOfTime,
    /// A person says that it is fulfilled.
    SaidDone,
    /// A person says that it failed.
    SaidFailed,
}

impl WishVerdict {
    /// Whether it was fulfilled.
    pub(crate) fn is_fulfilled(self) -> bool {
        matches!(self, WishVerdict::Done | WishVerdict::SaidDone)
    }

    /// In a word, whoever says so.
    pub(crate) fn short(self) -> &'static str {
        match self {
            WishVerdict::Done | WishVerdict::SaidDone => "done",
            WishVerdict::OutOfTime => "out of time",
            WishVerdict::SaidFailed => "failed",
        }
    }

    /// In words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            WishVerdict::Done => "done",
            WishVerdict::OutOfTime => "out of time",
            WishVerdict::SaidDone => "done, you say",
            WishVerdict::SaidFailed => "failed, you say",
        }
    }
}

/// What a person told the agent, and what came of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wish {
    /// The words, as the agent got them.
    pub(crate) instruction: String,
    /// After how many steps of the episode it was told.
    pub(crate) began: u32,
    /// Who says when it is fulfilled.
    pub(crate) grading: WishGrading,
    /// What was understood, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) understood: String,
    /// How likely the reading is right, from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) confidence: Option<f32>,
    /// Which language model understood it so; nothing where the program read it itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) read_by: Option<String>,
    /// Why the language model that was to read it did not, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) unasked: Option<String>,
    /// Why it is not graded, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) ungraded: Option<String>,
    /// Words that nothing was made of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) unread: Vec<String>,
    /// Classes that it asks for and the house does not hold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) absent: Vec<Class>,
    /// The parts that things play in it, where it is graded as it was read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) roles: Vec<Role>,
    /// The subtasks as which it was read, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) subtasks: Vec<Subtask>,
    /// How many of the subtasks held already when it was told.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(crate) already: u32,
    /// How many actions the expert takes for it, from where it was told; nothing where that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) expert_steps: Option<u32>,
    /// How many steps were taken for it.
    #[serde(default)]
    pub(crate) steps: u32,
    /// How many of its subtasks are done.
    #[serde(default)]
    pub(crate) completed: u32,
    /// After how many steps of the episode the agent itself first said that it is done, where it has an end of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) agent_done: Option<u32>,
    /// How likely that is by the agent's own end, in the state in which the verdict fell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) agent_end: Option<f32>,
    /// What it came to; nothing while it goes on, or where the next one was told before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) verdict: Option<WishVerdict>,
    /// What kept it from being fulfilled, where it is graded and failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) failure: Option<Failure>,
    /// The same in words, with what to do about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) advice: Option<String>,
    /// What it may have meant, the best reading first.
    #[serde(skip)]
    pub(crate) readings: Vec<WishReading>,
    /// The reading by which it is graded.
    #[serde(skip)]
    pub(crate) picked: usize,
    /// How many steps its task gives it, where it is a task's own words.
    #[serde(skip)]
    pub(crate) horizon: Option<u32>,
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(number: &u32) -> bool {
    *number == 0
}

impl Wish {
    /// The episode's own task.
    pub(crate) fn task(instruction: &str, expert_steps: u32) -> Wish {
        let expert_steps = (expert_steps > 0).then_some(expert_steps);
        Wish { instruction: instruction.into(), grading: WishGrading::Task, expert_steps, ..Wish::default() }
    }

    /// Words that a person alone can judge, and why.
    pub(crate) fn ungraded(instruction: &str, began: u32, why: &str) -> Wish {
        Wish { instruction: instruction.into(), began, ungraded: Some(why.into()), ..Wish::default() }
    }

    /// Whether a person told it, or a task that says no subtasks.
    pub(crate) fn is_told(&self) -> bool {
        self.grading != WishGrading::Task && self.ungraded.as_deref() != Some(NOTHING_ASKED)
    }

    /// Whether the same was asked at the same time, whatever came of it.
    pub(crate) fn is_same(&self, other: &Wish) -> bool {
        let asked = |wish: &Wish| (wish.began, wish.grading, wish.subtasks.len());
        asked(self) == asked(other)
            && self.instruction == other.instruction
            && self.roles == other.roles
            && self.subtasks == other.subtasks
    }

    /// A grader that begins in that state, where it is graded as it was read.
    pub(crate) fn grader(&self, scene: &Scene, world: &World) -> Option<Grader> {
        (self.grading == WishGrading::Read).then(|| {
            let mut grader = Grader::new(Grading::Class, &self.roles, &self.subtasks, None, (scene, world));
            grader.settle(scene, world);
            grader
        })
    }

    /// How many steps it may take: as many as its task gives it. A person waits longer than that: until the agent had time to
    /// search for what the expert knows the place of.
    pub(crate) fn limit(&self) -> Option<u32> {
        let of_person = || (PATIENCE * self.expert_steps.unwrap_or(UNKNOWN)).max(LEAST);
        (self.grading == WishGrading::Read).then(|| self.horizon.unwrap_or_else(of_person))
    }

    /// What it was read as, in the words of the subtasks.
    pub(crate) fn subtasks_in_words(&self) -> Vec<String> {
        self.subtasks.iter().map(|subtask| describe(&self.roles, subtask)).collect()
    }

    /// Readings beside the one in force, each with its number for [`pick`](Wish::readings) and what it would mean otherwise.
    pub(crate) fn alternatives(&self) -> Vec<(usize, String)> {
        let Some(own) = self.readings.get(self.picked) else { return Vec::new() };
        let others = self.readings.iter().enumerate().filter(|&(at, _)| at != self.picked);
        others.map(|(at, other)| (at + 1, difference(own, other))).collect()
    }

    /// Whether there is a reading that nothing is graded by as it is too unsure: a person may say that it is meant.
    pub(crate) fn is_unsure(&self) -> bool {
        let is_whole = |reading: &WishReading| reading.task().is_some() && reading.absent.is_empty();
        self.grading == WishGrading::Nobody && self.readings.get(self.picked).is_some_and(is_whole)
    }

    /// Who says what of its end, in a few words: "done", "done, you say; the agent: done at step 12".
    pub(crate) fn verdict_in_words(&self) -> String {
        let own = match self.verdict {
            Some(verdict) => verdict.words(),
            None if self.failure.is_some() => "failed",
            None => "open",
        };
        let failure = self.failure.map_or(String::new(), |failure| format!(" ({})", failure.words()));
        let agent = self.agent_in_words().map_or(String::new(), |words| format!("; {words}"));
        format!("{own}{failure}{agent}")
    }

    /// What the agent's own end says: "the agent: done at step 12".
    pub(crate) fn agent_in_words(&self) -> Option<String> {
        match (self.agent_done, self.agent_end) {
            (Some(step), _) => Some(format!("the agent: done at step {step}")),
            (None, Some(likely)) => Some(format!("the agent: not done ({likely:.2})")),
            (None, None) => None,
        }
    }
}

/// Why nobody grades what an episode without a task begins with.
pub(crate) const NOTHING_ASKED: &str = "nothing was asked yet";
/// The limit of a person's wish, as a multiple of the expert's steps.
const PATIENCE: u32 = 4;
/// The least limit of a person's wish.
const LEAST: u32 = 60;
/// What an expert might take where it knows no way.
const UNKNOWN: u32 = 50;

/// What another reading means otherwise, in a word or two: "butter knife".
fn difference(own: &WishReading, other: &WishReading) -> String {
    let classes = |reading: &WishReading| -> Vec<Option<Class>> {
        reading.subtasks.iter().flat_map(|subtask| [subtask.object, subtask.receptacle]).collect()
    };
    let (own, others) = (classes(own), classes(other));
    if own.len() != others.len() {
        return other.words();
    }
    let mut names: Vec<&str> = Vec::new();
    for class in own.iter().zip(&others).filter(|(a, b)| a != b).filter_map(|(_, class)| *class) {
        if !names.contains(&class.spoken()) {
            names.push(class.spoken());
        }
    }
    names.join(", ")
}
