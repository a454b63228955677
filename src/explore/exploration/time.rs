//! Time travel: to another step or branch of what was tried, and along a recorded episode.

use std::sync::Arc;

use super::Exploration;
use crate::agent::{Decision, PolicyState};
use crate::domain::Action;
use crate::episode::branches;
use crate::episode::branches::{FRAMES, SavedState};
use crate::episode::record::{Author, Episode};
use crate::explore::episode_source::EpisodeStart;
use crate::explore::side_by_side::beside;
use crate::explore::timeline::Divergence;
use crate::house::House;

impl Exploration {
    /// Goes to a step of the branch in hand, or to its end.
    pub(crate) fn seek(&mut self, step: u32) {
        self.tree.seek(step);
        self.settle();
    }

    /// Takes another branch in hand.
    ///
    /// # Errors
    /// When there is none of that number.
    pub(crate) fn switch(&mut self, branch: usize) -> anyhow::Result<()> {
        anyhow::ensure!(self.tree.switch(branch), "there is no branch {}", branch + 1);
        self.settle();
        Ok(())
    }

    /// The branch of that number from 1, or of that name: places are how the screen names them.
    ///
    /// # Errors
    /// When there is none; says which there are.
    pub(crate) fn branch(&self, wanted: &str) -> anyhow::Result<usize> {
        let branches = self.tree.branches();
        let numbered = wanted.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let named = || branches.iter().position(|branch| branch.name == wanted);
        numbered.filter(|&at| at < branches.len()).or_else(named).ok_or_else(|| {
            let names: Vec<&str> = branches.iter().map(|branch| branch.name.as_str()).collect();
            anyhow::anyhow!("there is no branch {wanted:?}; there are: {}", names.join(", "))
        })
    }

    /// Takes the steps of links, told one after the other, from a branch and step; then goes back to where the last one began,
    /// with its words in force.
    ///
    /// # Errors
    /// When a step cannot be taken again.
    pub(crate) fn open_link(
        &mut self,
        (branch, step): (usize, u32),
        links: &[(String, Vec<Action>)],
    ) -> anyhow::Result<()> {
        self.switch(branch)?;
        self.seek(step);
        let author = self.acting.author.clone();
        let mut entry = step;
        for (words, actions) in links {
            entry = self.tree.at();
            self.instruct(words)?;
            for &action in actions {
                anyhow::ensure!(!self.tree.is_full(), "no more steps are remembered in this episode");
                // The policy sees every state, as it did.
                let _ = self.decide();
                self.carry_out(Decision::of(action), author.clone())?;
            }
        }
        self.seek(entry);
        if let Some((words, _)) = links.last() {
            self.instruct(words)?;
        }
        Ok(())
    }

    /// Gives a branch another name.
    ///
    /// # Errors
    /// When the name is empty or taken.
    pub(crate) fn rename(&mut self, branch: usize, name: &str) -> anyhow::Result<()> {
        anyhow::ensure!(self.tree.rename(branch, name), "{name:?} is empty, or another branch's name");
        self.write_again();
        Ok(())
    }

    /// Where another branch and the one in hand part, and what they do from there.
    pub(crate) fn divergence(&self, other: usize) -> Divergence {
        Divergence::of(&self.tree, self.tree.branch(), other)
    }

    /// The same, with what the agent sees on both: at the step in hand, or where they part if that lies ahead.
    pub(crate) fn parted(&self, other: usize) -> Divergence {
        let mut divergence = self.divergence(other);
        let stories = [self.tree.story(self.tree.branch()), self.tree.story(other)];
        let wanted = self.tree.at().max(divergence.shared + 1);
        let steps = stories.each_ref().map(|story| wanted.min(story.len().saturating_sub(1) as u32));
        let mut house = House::new(self.rollout.env.house.scene().clone(), self.rollout.env.house.world().clone());
        let mut draw = |side: usize| {
            let (moment, _) = stories[side].get(steps[side] as usize)?;
            house.restore((*moment.world).clone());
            Some(house.frame().clone())
        };
        if let (Some(left), Some(right)) = (draw(0), draw(1)) {
            divergence.frames = Some((Arc::new(beside(&left, &right)), steps));
        }
        divergence
    }

    /// Brings house and policy to the state in hand.
    fn settle(&mut self) {
        let moment = self.tree.saved_state().clone();
        moment.restore(&mut self.rollout, self.tree.at());
        self.wishes.clone_from(&moment.wishes);
        self.task_aside.clone_from(&moment.task_aside);
        self.frames.present = None;
        self.acting.decision = None;
        self.acting.redirected = false;
        if moment.author == self.acting.author && !matches!(moment.carried, PolicyState::Nothing) {
            if let Some(policy) = self.acting.policy.as_deref_mut() {
                policy.restore(0, moment.carried);
            }
        } else {
            self.look_back();
        }
    }

    /// Whether going on from here follows what was recorded: there is something, and what was told or chosen here since is not
    /// something else.
    pub(crate) fn follows_recording(&self) -> bool {
        let Some(next) = self.tree.next() else { return false };
        let is_told = match (&next.wish, self.wishes.last()) {
            (Some(next), Some(wish)) => next.is_same(wish),
            _ => *next.instruction == *self.rollout.instruction,
        };
        !self.acting.redirected || (is_told && (next.author == self.acting.author || next.author.is_hand()))
    }

    /// The policy begins anew here, having seen the frames before this one.
    pub(crate) fn look_back(&mut self) {
        self.acting.decision = None;
        let Some(policy) = self.acting.policy.as_deref_mut() else { return };
        let before: Vec<SavedState> = self.tree.past().rev().skip(1).take(FRAMES - 1).cloned().collect();
        branches::look_back(policy, &self.acting.author, &mut self.rollout, &before, self.tree.at());
    }

    /// Back to the start, with the present instruction. What was tried stays.
    pub(crate) fn reset(&mut self) {
        let instruction = self.rollout.instruction.clone();
        self.back_to_task();
        // The text was checked when it came in.
        let _ = self.instruct(&instruction);
        self.make_start();
    }

    /// At the start, graded by the task alone, as if nothing had been told.
    pub(super) fn back_to_task(&mut self) {
        self.seek(0);
        let start = EpisodeStart {
            scene: self.rollout.env.house.scene().clone(),
            world: self.rollout.env.house.world().clone(),
            task: self.episode.task.clone(),
            reference: self.episode.reference.clone(),
            limited: self.episode.limited,
        };
        let fresh = start.rollout();
        self.rollout.env.grader = fresh.env.grader;
        self.rollout.horizon = fresh.horizon;
        self.wishes = vec![Arc::new(self.first_wish())];
        self.task_aside = None;
    }

    /// Takes the steps of a recorded episode again, and stays at its end. The policy looks at every state where `thinks`;
    /// returns the first step at which it would not choose what was recorded.
    ///
    /// # Errors
    /// When a step does not come to what was recorded.
    pub(crate) fn retrace(&mut self, episode: &Episode, author: &Author, thinks: bool) -> anyhow::Result<Option<u32>> {
        // The task is graded whatever the agent is told of it, until that changes on the way.
        self.rollout.instruction.clone_from(&episode.instruction);
        self.rollout.horizon = self.rollout.horizon.map(|horizon| horizon + episode.prefix_steps);
        self.acting.decision = None;
        self.make_start();
        let mut author = author.clone();
        let mut parted = None;
        for (number, recorded) in (1..).zip(&episode.trace) {
            self.tell_again(&episode.wishes, number - 1);
            if let Some(told) = recorded.instruction.as_ref().filter(|_| episode.wishes.is_empty()) {
                self.tell_ungraded(told)?;
            }
            if let Some(by) = &recorded.author {
                author = by.clone();
            }
            let action = recorded.action();
            if thinks && number > episode.prefix_steps {
                let would = self.decide().map(|(decision, _)| decision.action);
                if !author.is_hand() && author == self.acting.author && would.ok() != Some(action) {
                    parted = parted.or(Some(number));
                }
            }
            self.carry_out(Decision::of(action), author.clone())?;
            let found = self.tree.steps().nth(number as usize - 1).map(|taken| taken.step.outcome);
            anyhow::ensure!(
                found == Some(recorded.outcome),
                "step {number} ({}) came to {:?}; recorded is {:?}: the simulator or the scene is another one",
                recorded.kind,
                found.map(|outcome| outcome.to_string()).unwrap_or_default(),
                recorded.outcome.to_string()
            );
        }
        self.tell_again(&episode.wishes, episode.trace.len() as u32);
        if let Some(last) = episode.wishes.last() {
            self.recall(last);
        }
        Ok(parted)
    }
}

#[cfg(test)]
mod tests {
    use crate::agent::registry::PolicyKind;
    use crate::explore::testing;

    #[test]
    fn an_episode_that_was_told_other_words_or_none_is_graded_as_it_was() {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Random).unwrap();
        (0..3).for_each(|_| drop(exploration.step().unwrap()));
        let episode = exploration.explored().episodes.remove(0);
        for told in ["Dance.", ""] {
            let mut again = testing::exploration();
            let other = crate::episode::record::Episode { instruction: told.into(), ..episode.clone() };
            again.retrace(&other, exploration.author(), false).unwrap();
            assert_eq!((again.instruction(), again.tree().at()), (told, 3));
            assert!(again.rollout().env.grader.is_some());
        }
    }
}
