//! What the agent is told, one wish after the other, and what is said of each.

use std::sync::Arc;

use super::Exploration;
use crate::agent::Decision;
use crate::domain::Action;
use crate::episode::record::{Author, Episode};
use crate::episode::rollout::End;
use crate::episode::wish::{Expect, NOTHING_ASKED, Wish, WishGrading, WishVerdict, explain, read, read_by, repick};
use crate::house::Outcome;
use crate::house::grading::{Grader, Grading, describe};
use crate::language::instruction;

/// Why nobody grades what is told where nothing is expected.
const NOT_READ: &str = "not read (--expect none)";

impl Exploration {
    /// The episode's first wish becomes the only one.
    pub(super) fn begin_wishes(&mut self) {
        self.wishes = vec![Arc::new(self.first_wish())];
        self.task_aside = None;
        // What a task says without subtasks is read like anything that is typed.
        let is_told = self.episode.task.as_ref().is_some_and(|task| task.subtasks.is_empty());
        if is_told && !matches!(self.expect, Expect::None) {
            self.tell(self.rollout.instruction.clone());
        }
        self.make_start();
        self.episode.examples = Arc::new(self.suggest());
    }

    /// What the episode begins with: its task, or words that nobody grades.
    pub(super) fn first_wish(&self) -> Wish {
        match &self.episode.task {
            Some(task) if self.rollout.env.grader.is_some() => Wish::task(&self.rollout.instruction, task.expert_steps),
            _ => Wish::ungraded(&self.rollout.instruction, 0, NOTHING_ASKED),
        }
    }

    /// The wish in force.
    pub(crate) fn wish(&self) -> Option<&Arc<Wish>> {
        self.wishes.last()
    }

    /// Tells the agent something else, from the next step on; says what that means for the task.
    ///
    /// # Errors
    /// When the text is empty, too long, or holds control characters.
    pub(crate) fn instruct(&mut self, text: &str) -> anyhow::Result<&'static str> {
        let text = instruction::parse(text)?;
        let is_task = self.wish().is_some_and(|wish| wish.grading == WishGrading::Task && wish.verdict.is_none());
        let asked = self
            .episode
            .task
            .as_ref()
            .is_some_and(|task| instruction::normalise(&task.instruction) == instruction::normalise(&text));
        if is_task && asked {
            self.acting.redirected |= self.rollout.instruction != text;
            self.rollout.instruction = text;
            self.acting.decision = None;
            self.told += 1;
            return Ok("the task's own words");
        }
        self.tell(text);
        self.told += 1;
        Ok(match (is_task, asked) {
            (true, _) => "the task is graded on beside it",
            (false, true) => "the task's words again: reset to be graded by the task",
            (false, false) => "applies from the next step",
        })
    }

    /// Which language model is asked what a wish means.
    pub(crate) fn asked_reader(&self) -> Option<&str> {
        match &self.expect {
            Expect::ReadBy(served) => Some(served.name()),
            Expect::Read | Expect::None => None,
        }
    }

    /// A new wish, told in the present state.
    fn tell(&mut self, text: String) {
        let began = self.tree.at();
        let (scene, world) = (self.rollout.env.house.scene(), self.rollout.env.house.world());
        let earlier: Vec<&str> = self.wishes.iter().map(|wish| wish.instruction.as_str()).collect();
        let wish = match &self.expect {
            Expect::Read => read(&text, began, earlier.into_iter(), scene, world),
            Expect::ReadBy(served) => read_by(served, &text, began, &earlier, scene, world),
            Expect::None => Wish::ungraded(&text, began, NOT_READ),
        };
        self.begin(wish);
    }

    /// The wishes of a record that were told after so many steps, told in the present state; with what was said before of the one
    /// in force.
    pub(super) fn tell_again(&mut self, recorded: &[Wish], steps: u32) {
        for (at, wish) in recorded.iter().enumerate().filter(|(_, wish)| wish.began == steps) {
            // The task is graded whatever the agent was told of it.
            if wish.grading == WishGrading::Task {
                continue;
            }
            if let Some(before) = at.checked_sub(1).and_then(|before| recorded.get(before)) {
                self.recall(before);
            }
            let fresh = Wish {
                steps: 0,
                completed: wish.already,
                agent_done: None,
                agent_end: None,
                verdict: None,
                failure: None,
                advice: None,
                ..wish.clone()
            };
            self.begin(fresh);
        }
    }

    /// What a record says came of the wish in force: a person's word and the agent's own are in no step.
    pub(super) fn recall(&mut self, recorded: &Wish) {
        if let Some(wish) = self.wishes.last_mut() {
            let wish = Arc::make_mut(wish);
            (wish.verdict, wish.agent_done, wish.agent_end) =
                (recorded.verdict, recorded.agent_done, recorded.agent_end);
            (wish.failure, wish.advice) = (recorded.failure, recorded.advice.clone());
        }
        self.tree.judge(&self.wishes);
    }

    /// Words of a record that says no more of them.
    ///
    /// # Errors
    /// When they are no instruction.
    pub(super) fn tell_ungraded(&mut self, text: &str) -> anyhow::Result<()> {
        let text = instruction::parse(text)?;
        self.begin(Wish::ungraded(&text, self.tree.at(), "it was not graded when it was given"));
        Ok(())
    }

    /// Another reading of the wish in force, by its number from 1, or the next one; what was done for it is graded anew.
    ///
    /// # Errors
    /// When there is none such.
    pub(crate) fn mean(&mut self, wanted: Option<usize>) -> anyhow::Result<()> {
        let wish = self.wish().cloned().ok_or_else(|| anyhow::anyhow!("no instruction was given yet"))?;
        let is_choice = wish.readings.len() > 1 || wish.is_unsure();
        anyhow::ensure!(is_choice, "there is no other reading of {:?}", wish.instruction);
        let picked = match wanted {
            None => (wish.picked + 1) % wish.readings.len(),
            Some(number) => number.checked_sub(1).filter(|&at| at < wish.readings.len()).ok_or_else(|| {
                anyhow::anyhow!("there is no reading {number}; they are numbered 1 to {}", wish.readings.len())
            })?,
        };
        // What was done for it is done again under the other reading, on a branch of its own: the first one's grades stay.
        let again: Vec<(Decision, Author)> = self
            .tree
            .steps()
            .take(self.tree.at() as usize)
            .skip(wish.began as usize)
            .map(|taken| (taken.decision.clone(), taken.author.clone()))
            .collect();
        if again.is_empty() {
            self.wishes.pop();
        } else {
            self.seek(wish.began);
        }
        let house = &self.rollout.env.house;
        let other = repick(&wish, picked, wish.began, house.scene(), house.world());
        self.begin(other);
        self.write_again();
        for (decision, author) in again {
            if self.end().is_some() {
                break;
            }
            // The policy sees every state, as it did.
            let _ = self.decide();
            self.carry_out(decision, author)?;
        }
        Ok(())
    }

    /// The wish comes into force. One that nothing was done for gives way to it.
    fn begin(&mut self, mut wish: Wish) {
        let now = self.tree.at();
        wish.horizon = self.task_horizon(&wish);
        if self.task_aside.is_none() && self.wishes.last().is_some_and(|last| last.grading == WishGrading::Task) {
            self.task_aside.clone_from(&self.rollout.env.grader);
        }
        let house = &self.rollout.env.house;
        self.rollout.instruction.clone_from(&wish.instruction);
        self.rollout.env.grader = wish.grader(house.scene(), house.world());
        self.rollout.horizon = wish.limit().map(|limit| now + limit);
        self.acting.decision = None;
        self.acting.redirected = true;
        if self.wishes.last().is_some_and(|last| last.began == now && last.verdict.is_none()) {
            self.wishes.pop();
        }
        self.wishes.push(Arc::new(wish));
        self.judge_by_grader();
    }

    /// How many steps a task of a set gives its own words, told where it begins: an evaluation gives them as many.
    fn task_horizon(&self, wish: &Wish) -> Option<u32> {
        let task = self.episode.task.as_ref().filter(|_| self.episode.limited && wish.began == 0)?;
        let is_own = instruction::normalise(&task.instruction) == instruction::normalise(&wish.instruction);
        // What was explored and graded by nobody is kept as a task without a horizon.
        (is_own && task.horizon > 0).then_some(task.horizon)
    }

    /// Counts a step that was just taken for the wish in force, and what it came to.
    pub(super) fn count_step(&mut self, action: Action) {
        let (now, grader) = (self.rollout.steps(), self.rollout.env.grader.as_ref());
        let completed = grader.map_or(0, |grader| grader.completed() as u32);
        let Some(wish) = self.wishes.last_mut() else { return };
        let wish = Arc::make_mut(wish);
        (wish.steps, wish.completed) = (now.saturating_sub(wish.began), completed);
        self.judge_by_grader();
        if self.end() == Some(WishVerdict::OutOfTime) {
            self.explain(Some(action));
        }
    }

    /// Grades a step that was just taken for the task, where that is not what was told; says which subtask it completed.
    pub(super) fn grade_beside(&mut self, action: Action, outcome: Outcome) -> Option<String> {
        let (grader, house) = (self.task_aside.as_mut()?, &self.rollout.env.house);
        let subtask = grader.subtask().map(|subtask| describe(grader.roles(), subtask));
        subtask.filter(|_| grader.observe(house.scene(), house.world(), action, outcome))
    }

    /// How much of the task is done while something else was told, and of how much.
    pub(crate) fn task_beside(&self) -> Option<(usize, usize)> {
        self.task_aside.as_ref().map(|grader| (grader.completed(), grader.total()))
    }

    fn judge_by_grader(&mut self) {
        let verdict = match self.rollout.end() {
            Some(End::Success) => WishVerdict::Done,
            Some(End::Timeout | End::Environment) => WishVerdict::OutOfTime,
            None => return,
        };
        if let Some(wish) = self.wishes.last_mut() {
            Arc::make_mut(wish).verdict = Some(verdict);
        }
    }

    /// Keeps what a person says of the wish in force.
    ///
    /// # Errors
    /// When there is none.
    pub(crate) fn say(&mut self, is_fulfilled: bool) -> anyhow::Result<Arc<Wish>> {
        let wish = self.wishes.last_mut().ok_or_else(|| anyhow::anyhow!("no instruction was given yet"))?;
        let wish = Arc::make_mut(wish);
        wish.verdict = Some(if is_fulfilled { WishVerdict::SaidDone } else { WishVerdict::SaidFailed });
        (wish.failure, wish.advice) = (None, None);
        if !is_fulfilled {
            self.explain(None);
        }
        self.tree.judge(&self.wishes);
        self.wish().cloned().ok_or_else(|| anyhow::anyhow!("no instruction was given yet"))
    }

    /// Hears what the agent's own end says in the present state.
    pub(super) fn hear(&mut self, decision: &Decision) {
        let now = self.tree.at();
        if decision.says_done() == Some(true)
            && let Some(wish) = self.wishes.last_mut()
            && wish.agent_done.is_none()
        {
            Arc::make_mut(wish).agent_done = Some(now);
            self.tree.judge(&self.wishes);
        }
    }

    /// Whether the agent comes to its own end in this state: it says that it is done, and did not before the last step for this
    /// wish.
    ///
    /// # Errors
    /// When the policy cannot go on.
    pub(crate) fn comes_to_its_end(&mut self) -> anyhow::Result<bool> {
        let now = self.tree.at();
        let said = self.tree.last_taken().and_then(|taken| taken.decision.says_done());
        let goes_on = said == Some(true) && self.wish().is_some_and(|wish| wish.began < now);
        Ok(!goes_on && self.decide()?.0.says_done() == Some(true))
    }

    /// Asks the agent's own end about the state in which the wish was judged, where the agent has one.
    pub(crate) fn ask_at_the_end(&mut self) {
        if self.tree.last_taken().is_none_or(|taken| taken.decision.done.is_none()) {
            return;
        }
        // An agent that cannot say is not quoted.
        let done = self.decide().ok().and_then(|(decision, _)| decision.done);
        if let Some(wish) = self.wishes.last_mut() {
            Arc::make_mut(wish).agent_end = done;
            self.tree.judge(&self.wishes);
        }
    }

    /// Finds why the wish in force failed; the last step is not in the tree yet where it was just taken.
    fn explain(&mut self, last: Option<Action>) {
        let Some(wish) = self.wishes.last().cloned() else { return };
        let began = wish.began as usize;
        let Some(start) = self.tree.past().nth(began) else { return };
        let grader = match (wish.grading, &self.episode.task) {
            (WishGrading::Nobody, _) | (WishGrading::Task, None) => return,
            (WishGrading::Task, Some(task)) => Grader::new(
                Grading::Class,
                &task.roles,
                &task.subtasks,
                None,
                (self.rollout.env.house.scene(), &start.world),
            ),
            (WishGrading::Read, _) => match wish.grader(self.rollout.env.house.scene(), &start.world) {
                Some(grader) => grader,
                None => return,
            },
        };
        let taken = self.tree.steps().take(self.tree.at() as usize).skip(began);
        let actions: Vec<Action> = taken.map(|taken| taken.decision.action).chain(last).collect();
        if actions.is_empty() {
            return;
        }
        // Whoever cannot be told why is told nothing; the verdict stands.
        let found = explain(&grader, self.rollout.env.house.scene(), &start.world, &actions);
        if let (Ok(Some((failure, advice))), Some(wish)) = (found, self.wishes.last_mut()) {
            let wish = Arc::make_mut(wish);
            (wish.failure, wish.advice) = (Some(failure), Some(advice));
        }
    }

    /// A branch's episode with what was told last, where no step was taken for it yet.
    pub(super) fn with_open_wishes(&self, branch: usize, mut episode: Episode) -> Episode {
        let tree = &self.tree;
        if branch == tree.branch() && tree.at() == tree.last() {
            episode.wishes = self.wishes.iter().map(|wish| (**wish).clone()).collect();
        }
        episode
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::registry::{Policies, PolicyKind};
    use crate::episode::scenes::Scenes;
    use crate::eval::evaluation::tests::tasks;
    use crate::explore::episode_source::{EpisodeOrigin, EpisodeSource};

    #[test]
    fn a_task_without_subtasks_has_its_own_horizon_as_in_an_evaluation() {
        let (folder, mut set) = tasks();
        let scenes = Scenes::of(&folder.path().join("tasks.json"), &set.value);
        let mut task = set.value.tasks.remove(0);
        (task.roles, task.subtasks, task.sentences) = (Vec::new(), Vec::new(), Vec::new());
        (task.instruction, task.horizon) = ("pick up the mug".into(), 77);
        let origin = EpisodeOrigin::Tasks { tasks: vec![task], index: 0 };
        let source = EpisodeSource::new(origin, 0, scenes);
        let mut exploration = Exploration::new(source, Policies::new(Vec::new()), PolicyKind::Random, None).unwrap();
        assert_eq!(exploration.rollout.horizon, Some(77));
        assert_eq!(exploration.wish().unwrap().limit(), Some(77));
        exploration.instruct("grab a knife").unwrap();
        assert_ne!(exploration.rollout.horizon, Some(77), "other words have a limit of their own");
    }
}
