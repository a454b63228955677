//! What the agent carries from step to step in a slot: its mind, what it was told, and what it has begun where.

use std::collections::BTreeSet;

use anyhow::Context;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tch::Device;

use super::eyes::Eyes;
use super::features::side_by_side;
use super::goal::Goal;
use super::macro_action::{MacroAction, Purpose};
use super::mind::{Mind, Moment};
use super::progress::Progress;
use super::weighed::Weighed;
use crate::agent::decision::Decision;
use crate::agent::value_estimates::Values;
use crate::domain::{Action, ActionType, Cell, Class, Pose};
use crate::env::Environment;
use crate::house::view::Candidate;
use crate::language::instruction::normalise;
use crate::language::reader::ReadSubtask;
use crate::nets::chooser::Chooser;

/// From this probability on a goal counts as reached.
const REACHED: f32 = 0.5;

/// So many times as likely is what goes on with what was set out to last: of two equally good ends, one is reached.
const COMMITMENT: f32 = 2.5;

/// So many times as likely is what brings about the goal now: what can be done is certain, what is seen is not.
const AT_ONCE: f32 = 20.0;

/// All that is carried from step to step in a slot.
#[derive(Clone, Debug)]
pub struct Recollection {
    pub(super) mind: Mind,
    /// The instruction that was read last, and what was read.
    read: Option<(String, Vec<ReadSubtask>)>,
    /// The step that was seen last.
    pub(super) seen_at: Option<u32>,
    /// What was begun where: a pose, and how much had been done for which goal.
    pub(super) tried: BTreeSet<Tried>,
    /// What was set out to last, and where.
    aim: Option<Aim>,
    /// What was decided at the step that was seen last: it counts as begun once it is known to have been done.
    decided: Option<(Action, Tried, Aim)>,
    /// The likeliest decision in the state that was seen last.
    pub(super) greedy: Option<Decision>,
    /// What the critic makes of that state, once it was asked.
    pub(super) values: Option<Values>,
    rng: ChaCha8Rng,
}

/// What was set out to, and where.
type Aim = (Purpose, Option<Cell>);

/// What was begun: where, at which goal, after how many interactions, and how.
pub(super) type Tried = (Pose, usize, usize, ActionType, Option<Class>);

impl Default for Recollection {
    fn default() -> Recollection {
        Recollection {
            mind: Mind::default(),
            read: None,
            seen_at: None,
            tried: BTreeSet::new(),
            aim: None,
            decided: None,
            greedy: None,
            values: None,
            rng: ChaCha8Rng::seed_from_u64(0),
        }
    }
}

impl Recollection {
    /// At the start of an episode; `seed` drives what is drawn by chance.
    pub(super) fn new(seed: u64) -> Recollection {
        Recollection { rng: ChaCha8Rng::seed_from_u64(seed), ..Recollection::default() }
    }

    /// Reads the instruction, where it is another one than before.
    pub(super) fn read(&mut self, instruction: &str) -> anyhow::Result<()> {
        let instruction = normalise(instruction);
        if self.read.as_ref().is_none_or(|(read, _)| *read != instruction) {
            let before = self.read.take().map(|(_, subtasks)| subtasks).unwrap_or_default();
            let (goals, subtasks) = Goal::read(&instruction, &before)?;
            self.mind.set_goals(goals);
            self.tried.clear();
            (self.aim, self.decided, self.greedy, self.values) = (None, None, None, None);
            self.read = Some((instruction, subtasks));
        }
        Ok(())
    }

    /// Looks at the present state, `step` into the episode, to which `last` led.
    ///
    /// # Errors
    /// When the environment or the eyes fail, or there is no odometry.
    pub(super) fn look(
        &mut self,
        eyes: &Eyes,
        environment: &mut dyn Environment,
        step: u32,
        last: Option<Action>,
    ) -> anyhow::Result<()> {
        let pose = environment.odometry();
        let pose = pose.with_context(|| format!("a map needs odometry, which {} does not tell", environment.name()))?;
        if let Some(last) = last {
            let target = last.target.and_then(|target| environment.class_of(target));
            self.mind.acted(last, target);
        }
        if let Some((_, tried, aim)) = self.decided.take().filter(|decided| Some(decided.0) == last) {
            self.tried.insert(tried);
            self.aim = Some(aim);
        }
        let seen = eyes.look(environment)?;
        let legal = environment.legal_actions()?;
        self.mind.observe(&Moment { pose, frame: environment.frame()?, seen: &seen, legal: &legal });
        (self.seen_at, self.greedy, self.values) = (Some(step), None, None);
        Ok(())
    }

    /// What could be done, and what is made of it. Goals that are reached are passed.
    pub(super) fn weigh(&mut self, chooser: &Chooser, legal: &[Candidate]) -> anyhow::Result<Weighed> {
        loop {
            let (actions, choice) = self.mind.choice(legal);
            let choices = side_by_side(&[&choice], chooser.device());
            let (log_probabilities, done) = tch::no_grad(|| chooser.forward(&choices));
            let progress = &mut self.mind.progress;
            let done = if progress.can_be_reached() { done.sigmoid().double_value(&[0]) as f32 } else { 0.0 };
            if done >= REACHED && !progress.is_last() {
                progress.advance();
                continue;
            }
            let probabilities = Vec::<f32>::try_from(log_probabilities.exp().squeeze_dim(0).to_device(Device::Cpu))?;
            return Ok(Weighed { actions, choices, done, probabilities });
        }
    }

    fn situation(&self) -> (Pose, usize, usize) {
        let progress = &self.mind.progress;
        (self.mind.memory.odometry.pose(), progress.at, progress.done.len())
    }

    /// What was begun in this very situation before.
    pub(super) fn begun_here(&self) -> Vec<(ActionType, Option<Class>)> {
        let here = self.situation();
        let begun = self.tried.iter().filter(|(pose, at, done, ..)| (*pose, *at, *done) == here);
        begun.map(|(.., kind, class)| (*kind, *class)).collect()
    }

    /// The first action that is likeliest in all, or one by chance; what was begun here before is left out while there is another.
    pub(super) fn choose(
        &mut self,
        actions: &[MacroAction],
        probabilities: &[f32],
        tried: &[(ActionType, Option<Class>)],
        by_chance: bool,
    ) -> MacroAction {
        let is_new = |action: &&MacroAction| !tried.contains(&action.beginning());
        let any_new = actions.iter().any(|action| is_new(&action));
        let open: Vec<(usize, &MacroAction)> =
            actions.iter().enumerate().filter(|(_, action)| !any_new || is_new(action)).collect();
        let aim = self.aim;
        let progress = &self.mind.progress;
        let weight = |index: usize| {
            let goes_on = actions.get(index).is_some_and(|action| goes_on(aim, action));
            let fulfils = actions.get(index).is_some_and(|action| fulfils(action, progress));
            let factor = if fulfils { AT_ONCE } else { 1.0 } * if goes_on { COMMITMENT } else { 1.0 };
            probabilities.get(index).copied().unwrap_or(0.0) * factor
        };
        let by_chance = by_chance.then(|| self.rng.random::<f32>());
        let chosen = match by_chance {
            Some(drawn) => {
                let mut left = drawn * open.iter().map(|(index, _)| weight(*index)).sum::<f32>();
                open.iter().find(|(index, _)| {
                    left -= weight(*index);
                    left <= 0.0
                })
            }
            None => {
                let total = |first: Action| {
                    open.iter().filter(|(_, other)| other.first == first).map(|(index, _)| weight(*index)).sum::<f32>()
                };
                let totals = open.iter().map(|(_, action)| total(action.first));
                let likeliest = totals.enumerate().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
                likeliest.and_then(|(at, _)| open.get(at))
            }
        };
        chosen.or(open.first()).map_or_else(turn_right, |(_, action)| (*action).clone())
    }

    /// Remembers what is about to be done.
    pub(super) fn begin(&mut self, chosen: MacroAction, environment: &dyn Environment) {
        let (pose, at, done) = self.situation();
        let (kind, class) = chosen.beginning();
        self.decided = Some((chosen.first, (pose, at, done, kind, class), (chosen.purpose, chosen.at)));
        let class = chosen.first.target.and_then(|target| environment.class_of(target));
        let cell = chosen.at.unwrap_or_else(|| self.mind.ahead());
        self.mind.attempt(chosen.first, class.map(|class| (class, cell)));
    }
}

/// Whether a macro action goes on with what was set out to last.
fn goes_on(aim: Option<Aim>, action: &MacroAction) -> bool {
    let near = |(was, is): (Cell, Cell)| was.apart(is) <= 2;
    aim.is_some_and(|(purpose, at)| purpose == action.purpose && at.zip(action.at).is_some_and(near))
}

/// Whether what can be done now brings about the goal.
fn fulfils(action: &MacroAction, progress: &Progress) -> bool {
    let Purpose::Interact(kind, class) = action.purpose else { return false };
    action.first.kind == kind && progress.is_fulfilled_by(kind, class)
}

fn turn_right() -> MacroAction {
    let first = Action::navigate(ActionType::RotateRight);
    MacroAction {
        purpose: Purpose::Look(first.kind),
        thing: None,
        steps: 1,
        cost: 1.0,
        first,
        at: None,
        novelty: Default::default(),
    }
}
