//! The present state as a screen shows it.

use std::sync::Arc;

use super::{Exploration, Unsaved};
use crate::agent::Reading;
use crate::agent::registry::PolicyKind;
use crate::domain::{Cell, Scene, World};
use crate::episode::branches::FRAMES;
use crate::episode::wish::{WishGrading, WishVerdict, Wishes};
use crate::explore::timeline::Timeline;
use crate::house::House;
use crate::house::grading::describe;
use crate::house::view::{Candidate, Frame, View};

/// Everything that a screen shows of the present state.
#[derive(Clone, Debug)]
pub struct SessionSnapshot {
    /// Counts the episodes of this session, from 1.
    pub(crate) episode: u32,
    /// The floor plan.
    pub scene: Arc<Scene>,
    /// The seed of the house, or of the episode's chance.
    pub(crate) seed: u64,
    /// Everything that can change in the house.
    pub world: World,
    /// What the agent sees.
    pub frame: Arc<Frame>,
    /// Which instances it sees.
    pub(crate) view: View,
    /// What could be done now, by action and distance.
    pub(crate) candidates: Vec<Candidate>,
    /// What the agent is told.
    pub(crate) instruction: String,
    /// How many steps were taken.
    pub(crate) step: u32,
    /// After how many it ends.
    pub(crate) horizon: Option<u32>,
    /// How many the expert takes for the wish in force, from where it was told.
    pub(crate) expert_steps: Option<u32>,
    /// The task, where one applies.
    pub(crate) progress: Option<TaskProgress>,
    /// What was told on the way here, the wish in force last.
    pub(crate) wishes: Wishes,
    /// How many subtasks of the wish in force are done, and of how many; nothing where it is not graded.
    pub(crate) graded: Option<(usize, usize)>,
    /// How much of the task is done while something else was told, and of how much.
    pub(crate) task_beside: Option<(usize, usize)>,
    /// What the wish in force came to, if it is over.
    pub(crate) end: Option<WishVerdict>,
    /// Where the agent has been.
    pub(crate) path: Vec<Cell>,
    /// Which policy decides.
    pub(crate) policy: PolicyKind,
    /// The policy's own name; a checkpoint's.
    pub(crate) acts: String,
    /// What was tried.
    pub(crate) time: Arc<Timeline>,
    /// The frames before this one that the agent sees too, newest first; only where they are asked for.
    pub(crate) recent: Vec<Arc<Frame>>,
    /// What the sentence encoder makes of the instruction.
    pub(crate) reading: Option<Reading>,
    /// Instructions that make sense in this house.
    pub(crate) examples: Arc<Vec<String>>,
    /// What would be lost with this episode.
    pub(crate) unsaved: Unsaved,
}

/// How far a task has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TaskProgress {
    /// What each subtask asks, in words.
    pub(crate) subtasks: Vec<String>,
    /// The step at which each completed subtask was.
    pub(crate) completed_at: Vec<u32>,
    /// What the current one waits for, in words.
    pub(crate) waits_for: String,
}

impl Exploration {
    /// The present state for a screen; draws the frame when it changed.
    pub fn snapshot(&mut self) -> SessionSnapshot {
        let candidates = self.rollout.env.house.candidates();
        let frame = match &self.frames.present {
            Some(frame) => frame.clone(),
            None => self.frames.present.insert(Arc::new(self.rollout.env.house.frame().clone())).clone(),
        };
        let view = self.rollout.env.house.view().clone();
        let progress = self.progress();
        let recent = self.recent();
        let house = &self.rollout.env.house;
        let mut path: Vec<Cell> = self.tree.past().map(|moment| moment.world.agent.cell).collect();
        path.dedup();
        SessionSnapshot {
            episode: self.episode.number,
            scene: house.scene().clone(),
            seed: self.episode.seed,
            world: house.world().clone(),
            frame,
            view,
            candidates,
            instruction: self.rollout.instruction.clone(),
            step: self.rollout.steps(),
            horizon: self.rollout.horizon,
            expert_steps: self.wishes.last().and_then(|wish| wish.expert_steps),
            progress,
            wishes: self.wishes.clone(),
            graded: self.graded(),
            task_beside: self.task_beside(),
            end: self.end(),
            path,
            policy: self.acting.kind,
            acts: self.acting.author.policy.clone(),
            time: Arc::new(Timeline::of(&self.tree)),
            recent,
            reading: self.acting.policy.as_ref().and_then(|policy| policy.reading(&self.rollout.instruction)),
            examples: self.episode.examples.clone(),
            unsaved: self.unsaved(),
        }
    }

    /// How many subtasks the grader of the wish in force has done, and of how many; nothing where it is not graded.
    pub(crate) fn graded(&self) -> Option<(usize, usize)> {
        let is_graded = self.wish().is_some_and(|wish| wish.grading != WishGrading::Nobody);
        let grader = self.rollout.env.grader.as_ref().filter(|_| is_graded)?;
        Some((grader.completed(), grader.total()))
    }

    /// How far the task has come, where one applies.
    pub(crate) fn progress(&self) -> Option<TaskProgress> {
        let (grader, house) = (self.rollout.env.grader.as_ref()?, &self.rollout.env.house);
        let (began, already) = self.wishes.last().map_or((0, 0), |wish| (wish.began, wish.already));
        let own = (1..=self.tree.at()).zip(self.tree.steps()).filter(|&(step, _)| step > began);
        let own = own.filter(|(_, taken)| taken.step.subtask.is_some()).map(|(step, _)| step);
        Some(TaskProgress {
            subtasks: grader.subtasks().iter().map(|subtask| describe(grader.roles(), subtask)).collect(),
            completed_at: std::iter::repeat_n(began, already as usize).chain(own).collect(),
            waits_for: grader.waits_for(house.scene(), house.world()),
        })
    }

    /// The frames before the present one that a trained agent sees too, newest first.
    fn recent(&mut self) -> Vec<Arc<Frame>> {
        if !self.frames.looks_back {
            return Vec::new();
        }
        let scene = self.rollout.env.house.scene().clone();
        let mut worlds: Vec<Arc<World>> =
            self.tree.past().rev().skip(1).take(FRAMES - 1).map(|m| m.world.clone()).collect();
        // Before the first frame there was the first one.
        let first = self.tree.past().next().map(|moment| moment.world.clone());
        worlds.extend(std::iter::repeat_n(first, FRAMES).flatten());
        worlds.truncate(FRAMES - 1);
        let Some(start) = worlds.first() else { return Vec::new() };
        let mut house = House::new(scene, (**start).clone());
        let mut draw = |world: Arc<World>| {
            house.restore((*world).clone());
            Arc::new(house.frame().clone())
        };
        worlds.into_iter().map(&mut draw).collect()
    }

    /// Whether snapshots hold the frames before the present one.
    pub(crate) fn set_looking_back(&mut self, looks_back: bool) {
        self.frames.looks_back = looks_back;
    }
}
