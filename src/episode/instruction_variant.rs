//! The instruction an agent gets for a task: the task's own, or a variant that shows whether the agent listens to it.

use std::collections::BTreeSet;

use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::domain::Task;
use crate::language::{instruction, phrases};

/// How the instruction is derived from the task's own.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub(crate) enum InstructionVariant {
    /// The task's own.
    #[default]
    Original,
    /// Another task's of the set.
    Swapped,
    /// Nothing at all.
    Empty,
    /// The task's own words in another order.
    Shuffled,
    /// The same task in the words of the program's grammar.
    Paraphrased,
}

impl InstructionVariant {
    /// Every variant, the task's own first.
    pub(crate) const ALL: [InstructionVariant; 5] = [
        InstructionVariant::Original,
        InstructionVariant::Swapped,
        InstructionVariant::Empty,
        InstructionVariant::Shuffled,
        InstructionVariant::Paraphrased,
    ];

    /// Whether it is the task's own.
    pub(crate) fn is_original(&self) -> bool {
        *self == InstructionVariant::Original
    }

    /// What it is called in files and reports.
    pub(crate) fn name(self) -> &'static str {
        match self {
            InstructionVariant::Original => "original",
            InstructionVariant::Swapped => "swapped",
            InstructionVariant::Empty => "empty",
            InstructionVariant::Shuffled => "shuffled",
            InstructionVariant::Paraphrased => "paraphrased",
        }
    }
}

/// The task's own instruction, or all its steps, each normalised, in one line.
pub(crate) fn task_instruction(task: &Task, step_by_step: bool) -> String {
    if step_by_step {
        task.sentences.iter().map(|sentence| instruction::normalise(sentence)).collect::<Vec<_>>().join(" ")
    } else {
        instruction::normalise(&task.instruction)
    }
}

/// The instruction for the task at `index`; `rng_seed` drives what is drawn.
pub(crate) fn instruction_for(
    tasks: &[Task],
    index: usize,
    variant: InstructionVariant,
    step_by_step: bool,
    rng_seed: u64,
) -> String {
    let task = &tasks[index];
    let own = task_instruction(task, step_by_step);
    let mut rng = ChaCha8Rng::seed_from_u64(rng_seed);
    match variant {
        InstructionVariant::Original => own,
        InstructionVariant::Swapped => swapped(tasks, index, step_by_step).unwrap_or(own),
        InstructionVariant::Empty => String::new(),
        InstructionVariant::Shuffled => shuffled(&own, &mut rng),
        InstructionVariant::Paraphrased => {
            let mut said = String::new();
            // The grammar has dozens of ways to say a thing; a handful of draws finds one that differs.
            for _ in 0..20 {
                said = instruction::normalise(&phrases::instruction(&task.roles, &task.subtasks, &mut rng));
                if said != own {
                    break;
                }
            }
            said
        }
    }
}

/// The instruction of the next task that has another one.
fn swapped(tasks: &[Task], index: usize, step_by_step: bool) -> Option<String> {
    let own = task_instruction(&tasks[index], step_by_step);
    let others = (1..tasks.len()).map(|ahead| task_instruction(&tasks[(index + ahead) % tasks.len()], step_by_step));
    others.into_iter().find(|other| *other != own)
}

/// Whether the instructions of the set differ, so that they can be swapped.
pub(crate) fn can_swap(tasks: &[Task], step_by_step: bool) -> bool {
    tasks.iter().map(|task| task_instruction(task, step_by_step)).collect::<BTreeSet<_>>().len() > 1
}

fn shuffled(own: &str, rng: &mut ChaCha8Rng) -> String {
    let mut words: Vec<&str> = own.trim_end_matches(['.', '!', '?']).split(' ').collect();
    let before = words.clone();
    let differs = before.iter().collect::<BTreeSet<_>>().len() > 1;
    for _ in 0..20 {
        words.shuffle(rng);
        if !differs || words != before {
            break;
        }
    }
    if differs && words == before {
        words.rotate_left(rng.random_range(1..before.len()));
    }
    instruction::normalise(&words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;

    #[test]
    fn every_wording_says_what_it_should_and_the_same_each_time() {
        let mut tasks = sample_set().tasks;
        tasks[1].instruction = "Heat the potato.".into();
        let say = |variant, chance| instruction_for(&tasks, 0, variant, false, chance);
        assert_eq!(say(InstructionVariant::Original, 1), "Put the apple in the fridge.");
        assert_eq!(say(InstructionVariant::Swapped, 1), "Heat the potato.");
        assert_eq!(say(InstructionVariant::Empty, 1), "");
        let mut words: Vec<String> =
            say(InstructionVariant::Shuffled, 1).to_lowercase().replace('.', "").split(' ').map(String::from).collect();
        words.sort();
        assert_eq!(words, ["apple", "fridge", "in", "put", "the", "the"]);
        for chance in 0..20 {
            for variant in [InstructionVariant::Shuffled, InstructionVariant::Paraphrased] {
                assert_eq!(say(variant, chance), say(variant, chance));
                assert_ne!(say(variant, chance), say(InstructionVariant::Original, chance), "{variant:?}");
            }
        }
        assert!(say(InstructionVariant::Paraphrased, 3).to_lowercase().contains("apple"));
    }

    #[test]
    fn a_set_of_one_instruction_has_nothing_to_swap() {
        let mut tasks = sample_set().tasks;
        assert!(!can_swap(&tasks, false));
        tasks[1].instruction = "Heat the potato.".into();
        assert!(can_swap(&tasks, false));
    }

    #[test]
    fn the_agent_is_told_the_normalised_instruction_or_all_steps() {
        let mut task = sample_set().tasks.remove(0);
        task.instruction = "  put it   AWAY".into();
        task.sentences = vec!["take   it".into(), "drop it!".into()];
        assert_eq!(task_instruction(&task, false), "Put it away.");
        assert_eq!(task_instruction(&task, true), "Take it. Drop it!");
    }
}
