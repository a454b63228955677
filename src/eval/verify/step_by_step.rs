//! Episodes that nobody evaluates again as a whole, taken step by step: what a person explored, where policies, instructions
//! and checkpoints change on the way; what an error cut short; and what a policy played that is not at hand.

use std::collections::VecDeque;

use super::sources::Sources;
use super::verdict::{Agreement, Mismatch};
use crate::agent::{Decision, Policy, PolicyState};
use crate::domain::Task;
use crate::episode::branches::{FRAMES, SavedState, look_back};
use crate::episode::record::{Author, Episode, TraceStep};
use crate::episode::rollout::{EndedBy, Rollout};
use crate::episode::scenes::Setting;
use crate::episode::wish::WishGrading;
use crate::house::House;
use crate::house::grading::{Grader, Grading};
use crate::language::instruction;

/// An episode to be taken step by step.
pub(super) struct RecordedEpisode<'a> {
    pub(super) episode: &'a Episode,
    pub(super) task: &'a Task,
    pub(super) setting: Setting,
    /// Who acted where the record does not say so.
    pub(super) author: Author,
    pub(super) grading: Grading,
    /// Whose word ended it.
    pub(super) end: EndedBy,
    /// The place of the episode in its run, from which the policy's slot follows.
    pub(super) index: usize,
}

impl RecordedEpisode<'_> {
    /// How far the record agrees.
    ///
    /// # Errors
    /// When a policy cannot be made, or the environment fails.
    pub(super) fn retrace(self, sources: &mut Sources<'_, '_>) -> anyhow::Result<Agreement> {
        let mut agreement = Agreement::default();
        agreement.mismatch = self.first_mismatch(sources, &mut agreement)?;
        Ok(agreement)
    }

    fn first_mismatch(self, sources: &mut Sources<'_, '_>, agreed: &mut Agreement) -> anyhow::Result<Option<Mismatch>> {
        let RecordedEpisode { episode, task, setting, mut author, grading, end, index } = self;
        let start = setting.world.digest();
        if start != episode.start_hash {
            return Ok(Some(Mismatch::at(0, "start", &episode.start_hash, start)));
        }
        let begun = (&*setting.scene, &setting.world);
        let grader = Grader::new(grading, &task.roles, &task.subtasks, task.goal.as_ref(), begun);
        let grader = (!task.subtasks.is_empty()).then_some(grader);
        let house = House::new(setting.scene, setting.world);
        let mut rollout = Rollout::in_house(house, episode.instruction.clone(), grader, None);
        let mut policy: Option<Box<dyn Policy>> = None;
        // Whose policy that is.
        let mut present: Option<Author> = None;
        let named = episode.trace.iter().filter_map(|step| step.author.as_ref()).find(|by| !by.is_hand());
        let first = match episode.trace.first().and_then(|step| step.author.as_ref()) {
            None => Some(author.clone()),
            Some(_) => named.cloned(),
        };
        let mut past: VecDeque<SavedState> = VecDeque::new();
        for (number, recorded) in (1..).zip(&episode.trace) {
            if number <= episode.prefix_steps {
                // The expert led here, unseen by the run's policy.
                if let Some(mismatch) = take(&mut rollout, number, recorded)? {
                    return Ok(Some(mismatch));
                }
                agreed.steps += 1;
                continue;
            }
            if let Some(wish) = episode.wishes.iter().rev().find(|wish| wish.began + 1 == number) {
                // What a wish was read as is in the record: a later reader may read it otherwise.
                if wish.grading != WishGrading::Task {
                    rollout.instruction.clone_from(&wish.instruction);
                    rollout.env.grader = wish.grader(rollout.env.house.scene(), rollout.env.house.world());
                }
            } else if let Some(text) = recorded.instruction.as_ref().filter(|_| episode.wishes.is_empty()) {
                let own = instruction::normalise(&task.instruction) == instruction::normalise(text);
                rollout.instruction.clone_from(text);
                if !own {
                    rollout.env.grader = None;
                }
            }
            if let Some(by) = &recorded.author {
                author = by.clone();
            }
            // While a person acts, the policy before (or the first one to come) looks on.
            let acts = if author.is_hand() { present.clone().or_else(|| first.clone()) } else { Some(author.clone()) };
            if let Some(acts) = acts.filter(|acts| present.as_ref() != Some(acts)) {
                policy = sources.make(&acts)?;
                if let Some(policy) = policy.as_deref_mut() {
                    rollout.slot = index % policy.slots().max(1);
                    let before: Vec<SavedState> = past.iter().cloned().collect();
                    look_back(policy, &acts, &mut rollout, &before, number - 1);
                }
                present = Some(acts);
            }
            if let Some(policy) = policy.as_deref_mut() {
                let chosen = rollout.decide(policy).map(|decision| decision.action);
                if !author.is_hand() {
                    if !chosen.as_ref().is_ok_and(|chosen| *chosen == recorded.action()) {
                        let found = chosen.map_or_else(|error| format!("{error:#}"), |chosen| format!("{chosen:?}"));
                        let recorded = format!("{:?}", recorded.action());
                        return Ok(Some(Mismatch::at(number, "choice", recorded, found)));
                    }
                    agreed.choices += 1;
                }
            }
            past.push_front(SavedState::of(&rollout, &author, PolicyState::Nothing));
            past.truncate(FRAMES - 1);
            if let Some(mismatch) = take(&mut rollout, number, recorded)? {
                return Ok(Some(mismatch));
            }
            agreed.steps += 1;
        }
        Ok(Mismatch::of_counts(episode, end))
    }
}

/// Takes a recorded step; how what it comes to differs from the record.
fn take(rollout: &mut Rollout, number: u32, recorded: &TraceStep) -> anyhow::Result<Option<Mismatch>> {
    let tick = rollout.carry_out(Decision::of(recorded.action()))?;
    Ok(Mismatch::of_step(number, recorded, &TraceStep::of(&tick, rollout)))
}
