//! The agent with a memory as a policy. Each slot is decided by itself, so that a decision depends on its own episode alone.

use std::path::Path;

use anyhow::Context;
use tch::Device;

use super::config::{MemoryConfig, MemoryNetworks};
use super::eyes::{Eyes, Sight};
use super::macro_action::{MacroAction, Purpose};
use super::recollection::Recollection;
use super::weighed::Weighed;
use crate::agent::decision::{ActionDistribution, Decision};
use crate::agent::decision_rule::DecisionOverride;
use crate::agent::policy::{Decisions, Observation, Policy, PolicyState, each_alone};
use crate::agent::value_estimates::{AdvantageScale, Values};
use crate::domain::{Action, ActionType, Class};
use crate::house::view::Candidate;
use crate::nets::chooser::Chooser;
use crate::nets::macro_critic::MacroCritic;

/// A policy from a checkpoint.
pub(crate) struct MemoryPolicy {
    name: String,
    eyes: Eyes,
    chooser: Chooser,
    critic: Option<MacroCritic>,
    /// Own the chooser's and the critic's weights.
    _networks: [tch::nn::VarStore; 2],
    advantage_scale: f32,
    loop_guard: bool,
    /// As its checkpoint says: what is asked for may be taken back.
    own_loop_guard: bool,
    samples: bool,
    slots: Vec<Recollection>,
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
            critic: networks.critic,
            _networks: [networks.chooser_store, networks.critic_store],
            advantage_scale: config.advantage_scale,
            loop_guard: config.loop_guard,
            own_loop_guard: config.loop_guard,
            samples: false,
            slots: (0..MemoryPolicy::SLOTS).map(|_| Recollection::default()).collect(),
        }
    }

    fn decide(&mut self, slot: usize, here: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let known = meet(&mut self.slots, &self.eyes, slot, here)?;
        if let Some(decision) = known.greedy.clone().filter(|_| !self.samples) {
            return Ok(decision);
        }
        let legal = here.environment.legal_actions()?;
        let mut weighed = known.weigh(&self.chooser, &legal)?;
        let critic = self.critic.as_ref().filter(|_| self.advantage_scale > 0.0);
        let values = critic.map(|critic| weighed.values(critic)).transpose()?;
        if let Some(values) = &values {
            weighed.scale(&AdvantageScale { values, weight: self.advantage_scale });
        }
        known.values.clone_from(&values);
        let Weighed { actions, probabilities, done, .. } = weighed;
        let tried = if self.loop_guard { known.begun_here() } else { Vec::new() };
        let greedy = known.choose(&actions, &probabilities, &tried, false);
        let distribution = distribution(&actions, &probabilities, &legal, greedy.first);
        let chosen = if self.samples { known.choose(&actions, &probabilities, &tried, true) } else { greedy };
        let action = chosen.first;
        known.begin(chosen, here.environment);
        let decision = Decision { distribution: Some(distribution), values, done: Some(done), ..Decision::of(action) };
        known.greedy = (!self.samples).then(|| decision.clone());
        Ok(decision)
    }
}

/// What a slot knows here: it reads and looks, where that is not done yet.
fn meet<'a>(
    slots: &'a mut [Recollection],
    eyes: &Eyes,
    slot: usize,
    here: &mut Observation<'_>,
) -> anyhow::Result<&'a mut Recollection> {
    let count = slots.len();
    let known = slots.get_mut(slot).with_context(|| format!("there are {count} slots, not {slot}"))?;
    known.read(here.instruction)?;
    if known.seen_at != Some(here.step) {
        known.look(eyes, here.environment, here.step, here.last)?;
    }
    Ok(known)
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
            *known = Recollection::new(seed);
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

    fn set_deciding(&mut self, asked: DecisionOverride) {
        self.loop_guard = asked.loop_guard.unwrap_or(self.own_loop_guard);
    }

    fn values(&mut self, slot: usize, observation: &mut Observation<'_>) -> anyhow::Result<Option<Values>> {
        let Some(critic) = &self.critic else { return Ok(None) };
        let known = meet(&mut self.slots, &self.eyes, slot, observation)?;
        if known.values.is_none() {
            let weighed = known.weigh(&self.chooser, &observation.environment.legal_actions()?)?;
            known.values = Some(weighed.values(critic)?);
        }
        Ok(known.values.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::super::goal::Goal;
    use super::super::mind::{Mind, Moment};
    use super::super::recollection::Tried;
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
        let networks = MemoryNetworks::new(&config.detector, &config.chooser, config.critic.as_ref(), Device::Cpu);
        MemoryPolicy::with("small".into(), &config, networks)
    }

    fn episode() -> Rollout {
        let (house, roles, asked) = (kitchen_house(), [role("Mug")], [subtask(SkillKind::Pickup, 0)]);
        let grader = Grader::new(Grading::Class, &roles, &asked, None, (house.scene(), house.world()));
        Rollout::new(HouseEnvironment::new(house, Some(grader)), "pick up the mug".into(), Some(12))
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
            assert_eq!(play(&mut policy, &mut first, 0, 1), std::slice::from_ref(decision));
            assert_eq!(play(&mut policy, &mut second, 1, 1), std::slice::from_ref(decision));
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
            let legal = rollout.env.legal_actions().unwrap();
            replayed.observe(&Moment { pose, frame: &frame, seen: &seen, legal: &legal });
            let (actions, _) = replayed.choice(&legal);
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

    #[test]
    fn a_critic_values_what_could_be_done_and_changes_no_decision_unless_it_weighs() {
        let _chance = crate::nets::testing::chance();
        let with = |advantage_scale: f32| {
            tch::manual_seed(4);
            let mut config = small();
            config.critic = Some(config.chooser.clone());
            config.advantage_scale = advantage_scale;
            let (chooser, critic) = (&config.chooser, config.critic.as_ref());
            MemoryPolicy::with(
                "small".into(),
                &config,
                MemoryNetworks::new(&config.detector, chooser, critic, Device::Cpu),
            )
        };
        let mut policy = with(0.0);
        (0..2).for_each(|slot| policy.reset(slot, 7));
        let (mut asked, mut unasked) = (episode(), episode());
        for step in 0..6 {
            let values = policy.values(0, &mut asked.observation()).unwrap().unwrap();
            let decision = play(&mut policy, &mut asked, 0, 1).remove(0);
            assert_eq!(play(&mut policy, &mut unasked, 1, 1), std::slice::from_ref(&decision), "step {step}");
            assert_eq!(decision.values, None);
            assert!(values.state.is_finite());
            assert!(values.choices.iter().any(|choice| choice.kind == decision.action.kind && choice.q.is_finite()));
        }
        let mut weighed = with(5.0);
        weighed.reset(0, 7);
        let mut rollout = episode();
        let decision = rollout.decide(&mut weighed).unwrap();
        assert_eq!(decision.values, weighed.values(0, &mut rollout.observation()).unwrap());
        policy.reset(0, 7);
        let plain = episode().decide(&mut policy).unwrap();
        let probabilities = |decision: Decision| decision.distribution.unwrap().actions;
        assert_ne!(probabilities(plain), probabilities(decision));
    }
}
