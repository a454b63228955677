//! The agent with a memory as a policy. Each slot is decided by itself, so that a decision depends on its own episode alone.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::Context;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tch::{Device, Kind, Tensor};

use super::config::{MemoryConfig, MemoryNetworks};
use super::eyes::{Eyes, Sight};
use super::features::Choice;
use super::goal::Goal;
use super::macro_action::{MacroAction, Purpose};
use super::mind::{Mind, Moment};
use crate::agent::decision::{ActionDistribution, Decision};
use crate::agent::policy::{Decisions, Observation, Policy, PolicyState, each_alone};
use crate::domain::{Action, ActionType, Cell, Class, Pose};
use crate::house::view::Candidate;
use crate::language::instruction::normalise;
use crate::language::reader::ReadSubtask;
use crate::nets::chooser::{Choices, Chooser};

/// From this probability on a goal counts as reached.
const REACHED: f32 = 0.5;

/// So many times as likely is what goes on with what was set out to last: of two equally good ends, one is reached.
const COMMITMENT: f32 = 2.5;

/// A policy from a checkpoint.
pub(crate) struct MemoryPolicy {
    name: String,
    eyes: Eyes,
    chooser: Chooser,
    /// Owns the chooser's weights.
    _networks: tch::nn::VarStore,
    loop_guard: bool,
    samples: bool,
    slots: Vec<Recollection>,
}

/// All that is carried from step to step in a slot.
#[derive(Clone, Debug)]
pub struct Recollection {
    mind: Mind,
    /// The instruction that was read last, and what was read.
    read: Option<(String, Vec<ReadSubtask>)>,
    /// The step that was seen last, with what could be done in it.
    seen_at: Option<u32>,
    /// What was begun where: a pose, and how much had been done for which goal.
    tried: BTreeSet<Tried>,
    /// What was set out to last, and where.
    aim: Option<Aim>,
    /// What was decided at the step that was seen last: it counts as begun once it is known to have been done.
    decided: Option<(Action, Tried, Aim)>,
    /// The likeliest decision in the state that was seen last.
    greedy: Option<Decision>,
    rng: ChaCha8Rng,
}

/// What was set out to, and where.
type Aim = (Purpose, Option<Cell>);

/// What was begun: where, at which goal, after how many interactions, and how.
type Tried = (Pose, usize, usize, ActionType, Option<Class>);

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
            rng: ChaCha8Rng::seed_from_u64(0),
        }
    }
}

impl MemoryPolicy {
    const SLOTS: usize = 8;

    /// Loads a checkpoint; it decides greedily.
    ///
    /// # Errors
    /// When the checkpoint is malformed.
    pub(crate) fn load(folder: &Path, device: Device) -> anyhow::Result<MemoryPolicy> {
        let config = MemoryConfig::read(folder)?;
        let networks = MemoryNetworks::load(folder, &config, device)?;
        let name = folder.file_name().map_or_else(|| "agent".to_string(), |name| name.to_string_lossy().into_owned());
        Ok(MemoryPolicy::with(name, &config, networks))
    }

    /// A policy of networks at hand.
    pub(crate) fn with(name: String, config: &MemoryConfig, networks: MemoryNetworks) -> MemoryPolicy {
        let eyes = match config.sight {
            Sight::Detector => Eyes::Detector(Box::new(networks.detector.frozen())),
            Sight::Simulator => Eyes::Simulator,
        };
        MemoryPolicy {
            name,
            eyes,
            chooser: networks.chooser,
            _networks: networks.chooser_store,
            loop_guard: config.loop_guard,
            samples: false,
            slots: (0..MemoryPolicy::SLOTS).map(|_| Recollection::default()).collect(),
        }
    }

    fn decide(&mut self, slot: usize, here: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let slots = self.slots.len();
        let known = self.slots.get_mut(slot).with_context(|| format!("there are {slots} slots, not {slot}"))?;
        known.read(here.instruction)?;
        if known.seen_at != Some(here.step) {
            known.look(&self.eyes, here)?;
        }
        if let Some(decision) = known.greedy.clone().filter(|_| !self.samples) {
            return Ok(decision);
        }
        let legal = here.environment.legal_actions()?;
        let (actions, done, probabilities) = known.weigh(&self.chooser, &legal)?;
        let tried = if self.loop_guard { known.begun_here() } else { Vec::new() };
        let greedy = known.choose(&actions, &probabilities, &tried, false);
        let distribution = distribution(&actions, &probabilities, &legal, greedy.first);
        let chosen = if self.samples { known.choose(&actions, &probabilities, &tried, true) } else { greedy };
        let action = chosen.first;
        known.begin(chosen, here);
        let decision = Decision { distribution: Some(distribution), done: Some(done), ..Decision::of(action) };
        known.greedy = (!self.samples).then(|| decision.clone());
        Ok(decision)
    }
}

impl Recollection {
    /// Reads the instruction, where it is another one than before.
    fn read(&mut self, instruction: &str) -> anyhow::Result<()> {
        let instruction = normalise(instruction);
        if self.read.as_ref().is_none_or(|(read, _)| *read != instruction) {
            let before = self.read.take().map(|(_, subtasks)| subtasks).unwrap_or_default();
            let (goals, subtasks) = Goal::read(&instruction, &before)?;
            self.mind.set_goals(goals);
            self.tried.clear();
            (self.aim, self.decided, self.greedy) = (None, None, None);
            self.read = Some((instruction, subtasks));
        }
        Ok(())
    }

    fn look(&mut self, eyes: &Eyes, here: &mut Observation<'_>) -> anyhow::Result<()> {
        let environment = &mut *here.environment;
        let pose = environment.odometry();
        let pose = pose.with_context(|| format!("a map needs odometry, which {} does not tell", environment.name()))?;
        if let Some(last) = here.last {
            let target = last.target.and_then(|target| environment.class_of(target));
            self.mind.acted(last, target);
        }
        if let Some((_, tried, aim)) = self.decided.take().filter(|decided| Some(decided.0) == here.last) {
            self.tried.insert(tried);
            self.aim = Some(aim);
        }
        let seen = eyes.look(environment)?;
        self.mind.observe(&Moment { pose, frame: environment.frame()?, seen: &seen });
        (self.seen_at, self.greedy) = (Some(here.step), None);
        Ok(())
    }

    /// What could be done, how probably the instruction is fulfilled, and how probable each macro action is. Goals that are
    /// reached are passed.
    fn weigh(&mut self, chooser: &Chooser, legal: &[Candidate]) -> anyhow::Result<(Vec<MacroAction>, f32, Vec<f32>)> {
        loop {
            let (actions, choice) = self.mind.choice(legal);
            let (log_probabilities, done) = tch::no_grad(|| chooser.forward(&alone(&choice, chooser.device())));
            let done = done.sigmoid().double_value(&[0]) as f32;
            let progress = &mut self.mind.progress;
            if done >= REACHED && !progress.is_last() {
                progress.advance();
                continue;
            }
            let probabilities = Vec::<f32>::try_from(log_probabilities.exp().squeeze_dim(0).to_device(Device::Cpu))?;
            let done = if progress.goals.is_empty() { 0.0 } else { done };
            return Ok((actions, done, probabilities));
        }
    }

    fn situation(&self) -> (Pose, usize, usize) {
        let progress = &self.mind.progress;
        (self.mind.memory.odometry.pose(), progress.at, progress.done.len())
    }

    /// What was begun in this very situation before.
    fn begun_here(&self) -> Vec<(ActionType, Option<Class>)> {
        let here = self.situation();
        let begun = self.tried.iter().filter(|(pose, at, done, ..)| (*pose, *at, *done) == here);
        begun.map(|(.., kind, class)| (*kind, *class)).collect()
    }

    /// The first action that is likeliest in all, or one by chance; what was begun here before is left out while there is another.
    fn choose(
        &mut self,
        actions: &[MacroAction],
        probabilities: &[f32],
        tried: &[(ActionType, Option<Class>)],
        by_chance: bool,
    ) -> MacroAction {
        let is_new = |action: &&MacroAction| !tried.contains(&beginning(action));
        let any_new = actions.iter().any(|action| is_new(&action));
        let open: Vec<(usize, &MacroAction)> =
            actions.iter().enumerate().filter(|(_, action)| !any_new || is_new(action)).collect();
        let aim = self.aim;
        let weight = |index: usize| {
            let goes_on = actions.get(index).is_some_and(|action| goes_on(aim, action));
            probabilities.get(index).copied().unwrap_or(0.0) * if goes_on { COMMITMENT } else { 1.0 }
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
    fn begin(&mut self, chosen: MacroAction, here: &Observation<'_>) {
        let (pose, at, done) = self.situation();
        let (kind, class) = beginning(&chosen);
        self.decided = Some((chosen.first, (pose, at, done, kind, class), (chosen.purpose, chosen.at)));
        let class = chosen.first.target.and_then(|target| here.environment.class_of(target));
        let cell = chosen.at.unwrap_or_else(|| self.mind.ahead());
        self.mind.attempt(chosen.first, class.map(|class| (class, cell)));
    }
}

/// Whether a macro action goes on with what was set out to last.
fn goes_on(aim: Option<Aim>, action: &MacroAction) -> bool {
    let near = |a: Cell, b: Cell| (a.x - b.x).abs().max((a.z - b.z).abs()) <= 2;
    let same =
        |(purpose, at): Aim| purpose == action.purpose && at.zip(action.at).is_some_and(|(was, is)| near(was, is));
    aim.is_some_and(same)
}

/// How a macro action begins, as the loop guard tells beginnings apart.
fn beginning(action: &MacroAction) -> (ActionType, Option<Class>) {
    let class = match action.purpose {
        Purpose::Interact(_, class) if action.first.kind.is_interaction() => Some(class),
        _ => None,
    };
    (action.first.kind, class)
}

fn turn_right() -> MacroAction {
    let first = Action::navigate(ActionType::RotateRight);
    MacroAction { purpose: Purpose::Look(first.kind), thing: None, steps: 1, cost: 1.0, first, at: None }
}

/// A batch of one choice.
fn alone(choice: &Choice, device: Device) -> Choices {
    let count = choice.len() as i64;
    let classes: Vec<i64> = choice.classes.iter().map(|&class| class.into()).collect();
    Choices {
        situation: Tensor::from_slice(&choice.situation).unsqueeze(0).to_device(device),
        goal: Tensor::from_slice(&choice.goal.map(i64::from)).unsqueeze(0).to_device(device),
        actions: Tensor::from_slice(&choice.actions).view([1, count, -1]).to_device(device),
        classes: Tensor::from_slice(&classes).unsqueeze(0).to_device(device),
        present: Tensor::ones([1, count], (Kind::Float, device)),
    }
}

/// The probabilities of macro actions as those of what they begin with.
fn distribution(
    actions: &[MacroAction],
    probabilities: &[f32],
    legal: &[Candidate],
    greedy: Action,
) -> ActionDistribution {
    let mut of_kinds = [None; ActionType::COUNT];
    let mut choices: Vec<(ActionType, Class, f32)> = Vec::new();
    let mut objects: Vec<(Class, f32, bool)> = Vec::new();
    for (action, &probability) in actions.iter().zip(probabilities) {
        *of_kinds[action.first.kind.index()].get_or_insert(0.0) += probability;
        let Purpose::Interact(kind, class) = action.purpose else { continue };
        if action.first.kind.is_interaction() {
            choices.push((kind, class, probability));
        }
        match objects.iter_mut().find(|(known, ..)| *known == class) {
            Some((_, sum, _)) => *sum += probability,
            None => {
                let possible = legal.iter().any(|candidate| candidate.class == class && candidate.kind == kind);
                objects.push((class, probability, possible));
            }
        }
    }
    objects.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let entropy = -of_kinds.iter().flatten().filter(|&&p| p > 0.0).map(|p| p * p.ln()).sum::<f32>();
    ActionDistribution { actions: of_kinds, objects, choices, entropy, greedy }
}

impl Policy for MemoryPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn slots(&self) -> usize {
        self.slots.len()
    }

    fn reset(&mut self, slot: usize, seed: u64) {
        if let Some(known) = self.slots.get_mut(slot) {
            *known = Recollection { rng: ChaCha8Rng::seed_from_u64(seed), ..Recollection::default() };
        }
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        each_alone(observations, |slot, here| self.decide(slot, here))
    }

    fn state(&self, slot: usize) -> PolicyState {
        self.slots.get(slot).map_or(PolicyState::Nothing, |known| PolicyState::Recollection(Box::new(known.clone())))
    }

    fn restore(&mut self, slot: usize, state: PolicyState) {
        if let (Some(known), PolicyState::Recollection(was)) = (self.slots.get_mut(slot), state) {
            *known = *was;
        }
    }

    fn set_sampling(&mut self, samples: bool) {
        self.samples = samples;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::memory_agent::config::tests::small;
    use crate::domain::skill::SkillKind;
    use crate::env::{Environment, HouseEnvironment};
    use crate::episode::rollout::Rollout;
    use crate::house::grading::{Grader, Grading};
    use crate::house::testing::{kitchen_house, role, subtask};

    fn policy() -> MemoryPolicy {
        tch::manual_seed(4);
        let config = small();
        let networks = MemoryNetworks::new(&config.detector, &config.chooser, Device::Cpu);
        MemoryPolicy::with("small".into(), &config, networks)
    }

    fn episode() -> Rollout {
        let grader = Grader::new(Grading::Class, &[role("Mug")], &[subtask(SkillKind::Pickup, 0)], None);
        Rollout::new(HouseEnvironment::new(kitchen_house(), Some(grader)), "pick up the mug".into(), Some(12))
    }

    /// Plays on for some steps in a slot: what was decided in each.
    fn play(policy: &mut MemoryPolicy, rollout: &mut Rollout, slot: usize, steps: usize) -> Vec<Decision> {
        rollout.slot = slot;
        let mut decided = Vec::new();
        for _ in 0..steps {
            let decision = rollout.decide(policy).unwrap();
            rollout.carry_out(decision.clone()).unwrap();
            decided.push(decision);
        }
        decided
    }

    #[test]
    fn what_is_decided_depends_on_the_episode_alone_not_on_the_slot_or_on_others() {
        let _chance = crate::nets::testing::chance();
        let mut policy = policy();
        (0..2).for_each(|slot| policy.reset(slot, 7));
        let alone = play(&mut policy, &mut episode(), 0, 8);
        policy.reset(0, 7);
        let (mut first, mut second) = (episode(), episode());
        for decision in &alone {
            assert_eq!(play(&mut policy, &mut first, 0, 1), [decision.clone()]);
            assert_eq!(play(&mut policy, &mut second, 1, 1), [decision.clone()]);
        }
        assert!(alone.iter().all(|decision| decision.done.is_some_and(|done| (0.0..=1.0).contains(&done))));
    }

    #[test]
    fn restored_it_goes_on_as_it_did_and_deciding_twice_looks_once() {
        let _chance = crate::nets::testing::chance();
        let mut policy = policy();
        policy.set_sampling(true);
        policy.reset(0, 7);
        let mut rollout = episode();
        play(&mut policy, &mut rollout, 0, 4);
        let (state, world, last) = (policy.state(0), rollout.env.snapshot().unwrap(), rollout.last());
        let went_on = play(&mut policy, &mut rollout, 0, 6);
        policy.restore(0, state.clone());
        rollout.env.restore(&world).unwrap();
        rollout.set_steps(4);
        rollout.set_last(last);
        assert_eq!(play(&mut policy, &mut rollout, 0, 6), went_on);
        policy.set_sampling(false);
        policy.restore(0, state);
        rollout.env.restore(&world).unwrap();
        rollout.set_steps(4);
        rollout.set_last(last);
        let [once, twice] = [rollout.decide(&mut policy), rollout.decide(&mut policy)].map(Result::unwrap);
        assert_eq!(once, twice);
    }

    #[test]
    fn an_episode_that_is_replayed_is_remembered_as_it_was_played() {
        let _chance = crate::nets::testing::chance();
        let mut policy = policy();
        policy.set_sampling(true);
        policy.reset(0, 11);
        let mut rollout = episode();
        let origin = rollout.env.house.world().agent;
        let mut replayed = Mind::default();
        replayed.set_goals(Goal::read("pick up the mug", &[]).unwrap().0);
        for _ in 0..10 {
            let pose = rollout.env.house.world().agent.relative_to(origin);
            let (scene, world) = (rollout.env.house.scene().clone(), rollout.env.house.world().clone());
            let frame = rollout.env.house.frame().clone();
            let seen = Eyes::Simulator.look_at(&scene, &world, &frame).unwrap();
            let decision = rollout.decide(&mut policy).unwrap();
            replayed.observe(&Moment { pose, frame: &frame, seen: &seen });
            let (actions, _) = replayed.choice(&rollout.env.legal_actions().unwrap());
            let played = &policy.slots[0].mind;
            assert_eq!((&played.memory, &played.progress), (&replayed.memory, &replayed.progress));
            let action = decision.action;
            let class = action.target.and_then(|target| world.class_of(&scene, target));
            let at = actions.iter().find(|it| it.first == action).and_then(|it| it.at);
            let at = at.unwrap_or_else(|| replayed.ahead());
            replayed.attempt(action, class.map(|class| (class, at)));
            rollout.carry_out(decision).unwrap();
        }
    }

    #[test]
    fn what_somebody_else_did_is_what_was_done() {
        let _chance = crate::nets::testing::chance();
        let mut policy = policy();
        policy.reset(0, 1);
        let mut rollout = episode();
        rollout.decide(&mut policy).unwrap();
        rollout.carry_out(Decision::of(Action::navigate(ActionType::RotateLeft))).unwrap();
        rollout.decide(&mut policy).unwrap();
        let known = &policy.slots[0];
        assert_eq!(known.mind.memory.odometry.pose().heading, crate::domain::Heading::West);
        assert!(known.mind.progress.done.is_empty());
        let own = |tried: &&Tried| tried.3 != ActionType::RotateLeft;
        assert_eq!(known.tried.iter().filter(own).count(), 0, "{:?}", known.tried);
    }

    #[test]
    fn probabilities_of_all_that_could_be_done_add_up_to_one() {
        let _chance = crate::nets::testing::chance();
        let mut policy = policy();
        policy.reset(0, 1);
        let mut rollout = episode();
        for decision in play(&mut policy, &mut rollout, 0, 6) {
            let total: f32 = decision.distribution.unwrap().actions.iter().flatten().sum();
            assert!((total - 1.0).abs() < 1e-4, "{total}");
        }
    }

    #[test]
    fn another_instruction_is_another_goal_and_what_was_seen_is_kept() {
        let _chance = crate::nets::testing::chance();
        let mut policy = policy();
        policy.reset(0, 1);
        let mut rollout = episode();
        play(&mut policy, &mut rollout, 0, 3);
        rollout.instruction = "put the mug in the sink".into();
        rollout.decide(&mut policy).unwrap();
        let mind = &policy.slots[0].mind;
        let goal = mind.progress.goal().unwrap();
        assert_eq!((goal.skill, goal.receptacle), (SkillKind::Put, Class::named("Sink")));
        assert_eq!(mind.memory.step, 3, "frames since the start of the episode");
        assert!(mind.memory.map.things(0.3).len() > 3);
    }
}
