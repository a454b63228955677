//! Questions about the present state that change nothing.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::Exploration;
use crate::analysis::chain::Chain;
use crate::analysis::instruction_ab::Contrast;
use crate::analysis::{chain, instruction_ab};
use crate::domain::{Role, Subtask};
use crate::episode::wish::WishGrading;
use crate::explore::breakpoints::{Facts, gap};
use crate::explore::example_wishes::example_wishes;
use crate::language::{instruction, nouns, phrases};

impl Exploration {
    /// What conditions ask of the present state.
    pub(crate) fn facts(&mut self) -> Facts {
        let classes = |exploration: &mut Exploration| {
            let seen = exploration.rollout.env.house.view().sightings.clone();
            let house = &exploration.rollout.env.house;
            seen.iter().filter_map(|seen| house.world().class_of(house.scene(), seen.instance)).collect()
        };
        let (distribution, values) = match &self.acting.decision {
            Some((decision, values)) => (decision.distribution.as_ref(), values.as_ref()),
            None => (None, None),
        };
        Facts {
            step: self.tree.at(),
            completed: self.rollout.env.grader.as_ref().map_or(0, |grader| grader.completed() as u32),
            failed: self.tree.last_taken().is_some_and(|taken| !taken.step.outcome.is_done()),
            value: values.map(|values| values.state),
            gap: gap(distribution, values),
            entropy: distribution.map(|distribution| distribution.entropy),
            seen: classes(self),
        }
    }

    /// The instruction in force and another, in the present state.
    ///
    /// # Errors
    /// When the other text is no instruction, or the policy has no distribution.
    pub(crate) fn contrast(&mut self, other: &str) -> anyhow::Result<Contrast> {
        // The policy has looked at this state once, as always.
        self.decide()?;
        let policy = self.acting.policy.as_deref_mut().ok_or_else(|| anyhow::anyhow!("no policy is loaded"))?;
        instruction_ab::contrast(policy, &mut self.rollout, other)
    }

    /// A chain from the present state: the links of `text`, or without any the task's own sentences. Subtasks grade it where
    /// there is one for each link.
    ///
    /// # Errors
    /// When there is neither text nor task.
    pub(crate) fn chain(&self, text: &str) -> anyhow::Result<Chain> {
        let house = &self.rollout.env.house;
        let left = self.rollout.env.grader.as_ref().map(|grader| {
            let mut roles = grader.roles().to_vec();
            for (at, role) in (0u8..).zip(&mut roles) {
                role.bound = grader.binding(at);
            }
            (roles, grader.subtasks().get(grader.completed()..).unwrap_or_default().to_vec())
        });
        let typed = chain::split(text);
        let mut links = typed.clone();
        if links.is_empty() {
            let (roles, subtasks) = left.as_ref().filter(|(_, subtasks)| !subtasks.is_empty()).ok_or_else(|| {
                anyhow::anyhow!("there is no task whose steps would be a chain: type one, with ; between the links")
            })?;
            let told = self.wishes.last().filter(|wish| wish.grading == WishGrading::Task);
            let task = self.episode.task.as_ref().filter(|task| told.is_some() && !task.sentences.is_empty());
            let mut rng = ChaCha8Rng::seed_from_u64(0);
            links = match task {
                Some(task) => task.sentences.iter().rev().take(subtasks.len()).rev().cloned().collect(),
                None => subtasks.iter().map(|subtask| phrases::sentence(roles, subtask, &mut rng)).collect(),
            };
            links = links.iter().map(|link| instruction::normalise(link)).collect();
        }
        // What a person typed is graded by the task only where every link is about what its subtask is about.
        let about = |roles: &[Role], subtask: &Subtask, link: &str| {
            let objects = std::iter::once(subtask.object).chain(subtask.receptacle);
            objects.filter_map(|at| roles.get(usize::from(at))).any(|role| nouns::names(link, role.class))
        };
        let graded = left.filter(|(roles, subtasks)| {
            subtasks.len() == links.len()
                && (typed.is_empty() || subtasks.iter().zip(&links).all(|(subtask, link)| about(roles, subtask, link)))
        });
        Ok(Chain { scene: house.scene().clone(), start: house.world().clone(), links, graded })
    }

    /// A few wishes that can be fulfilled from the present state, the same for the same house and seed.
    pub(crate) fn example_wishes(&self) -> Vec<String> {
        let house = &self.rollout.env.house;
        example_wishes(house.scene(), house.world(), self.episode.seed)
    }

    /// Instructions that make sense in this house: the task's own, its steps in training's words, and a pickup of each thing.
    pub(crate) fn suggest(&self) -> Vec<String> {
        let mut found: Vec<String> = Vec::new();
        if let Some(task) = &self.episode.task {
            found.push(instruction::normalise(&task.instruction));
            found.extend(task.sentences.iter().map(|sentence| instruction::normalise(sentence)));
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            for subtask in &task.subtasks {
                found.push(instruction::normalise(&phrases::sentence(&task.roles, subtask, &mut rng)));
            }
        }
        let objects = &self.rollout.env.house.world().objects;
        let mut names: Vec<&str> =
            objects.iter().filter(|o| o.class.info().pickupable).map(|object| object.class.spoken()).collect();
        names.sort_unstable();
        names.dedup();
        found.extend(names.into_iter().map(|name| format!("Pick up the {name}.")));
        found.dedup();
        found
    }
}
