use std::sync::{Arc, Mutex};

use super::*;
use crate::agent::ActionDistribution;
use crate::agent::config::tests::small;
use crate::agent::logit_adjustment::LogitAdjustment;
use crate::domain::{ActionType, Heading, SkillKind};
use crate::env::{Environment, HouseEnvironment};
use crate::house::grading::{Grader, Grading};
use crate::house::testing::{kitchen_house, role, subtask};
use crate::needed;
use crate::nets::critic::CriticSpec;
use crate::nets::device;
use crate::nets::embedding_cache::Embedder;
use crate::nets::episodic::AttentionSpec;
use crate::nets::policy::PolicySpec;
use crate::nets::sentence::{SentenceEncoder, default_folder};

/// A fresh agent with a critic; nothing where there is no sentence encoder.
fn fresh(goal: Option<[i64; 4]>) -> Option<LearnedPolicy> {
    let folder = needed::sentence_encoder(&default_folder())?;
    let embedder = Embedder::new(SentenceEncoder::load(&folder, Device::Cpu).unwrap(), None);
    let embedding = embedder.encoder().width() as i64;
    let small = small();
    let config = CheckpointConfig {
        policy: PolicySpec { embedding, goal_channels: goal, ..small.policy },
        critic: Some(CriticSpec {
            channels: [4; 4],
            downsample: false,
            hidden: vec![8],
            dropout: 0.2,
            action_embedding: 4,
            object_embedding: 4,
            shared_trunk: true,
        }),
        ..small
    };
    let networks = Networks::new(
        config.build_visual_encoder(Device::Cpu).unwrap(),
        &config.policy,
        config.critic.as_ref(),
        Device::Cpu,
    );
    LearnedPolicy::with("a".into(), config, networks, Some(Arc::new(Mutex::new(embedder))), Device::Cpu).ok()
}

/// A fresh agent whose logits are all but equal, so that whatever rounds otherwise decides otherwise; nothing where there is no
/// sentence encoder.
pub(crate) fn undecided() -> Option<LearnedPolicy> {
    tch::manual_seed(7);
    let agent = fresh(None)?;
    tch::no_grad(|| {
        let is_head = |name: &str| name.starts_with("actions") || name.starts_with("objects");
        for (name, mut weight) in agent.networks.policy_store.variables() {
            if is_head(&name) {
                let _ = weight.g_mul_scalar_(1e-7);
            }
        }
    });
    Some(agent)
}

/// An agent without a critic, and one with.
const CLONE: &str = "tests/agents/clone";
const ALFRED: &str = "checkpoints/alfred";

fn shipped(folder: &str) -> Option<LearnedPolicy> {
    device::set_threads(1);
    let sentences = Embedder::open(&needed::sentence_encoder(&default_folder())?, Device::Cpu).unwrap();
    let folder = needed::agent(folder)?;
    Some(LearnedPolicy::load(&folder, Some(Arc::new(Mutex::new(sentences))), Device::Cpu).unwrap())
}

fn kitchen(grader: Option<Grader>) -> HouseEnvironment {
    HouseEnvironment::new(kitchen_house(), grader)
}

fn turned(heading: Heading) -> HouseEnvironment {
    let mut house = kitchen_house();
    let mut world = house.world().clone();
    world.agent.heading = heading;
    house.restore(world);
    HouseEnvironment::new(house, None)
}

fn at<'a>(environment: &'a mut HouseEnvironment, instruction: &'static str, step: u32) -> Observation<'a> {
    Observation { environment, instruction, step, last: None }
}

#[test]
fn a_critic_values_what_is_possible_and_changes_no_decision() {
    let _chance = crate::nets::testing::chance();
    let Some(mut agent) = fresh(None) else { return };
    let policy: &mut dyn Policy = &mut agent;
    policy.reset(0, 1);
    let mut house = kitchen(None);
    let decision = policy.act_in(0, at(&mut house, "take the mug", 0)).unwrap();
    let values = policy.values(0, &mut at(&mut house, "take the mug", 0)).unwrap().unwrap();
    assert_eq!(policy.act_in(0, at(&mut house, "take the mug", 0)).unwrap(), decision);
    let candidates = house.legal_actions().unwrap();
    let wanted: std::collections::BTreeSet<_> = candidates.iter().map(|c| (c.kind, c.class.index())).collect();
    assert_eq!(values.choices.len(), 5 + wanted.len());
    assert!(values.state.is_finite() && values.q(ActionType::MoveAhead, None).is_some());
}

#[test]
fn what_a_decision_was_weighed_by_is_what_the_critic_says() {
    let _chance = crate::nets::testing::chance();
    let Some(mut agent) = fresh(None) else { return };
    agent.config.advantage_scale = Some(10.0);
    let policy: &mut dyn Policy = &mut agent;
    policy.reset(2, 1);
    let mut house = kitchen(None);
    let weighed_by = policy.act_in(2, at(&mut house, "take the mug", 0)).unwrap().values;
    assert!(weighed_by.is_some());
    assert_eq!(policy.values(2, &mut at(&mut house, "take the mug", 0)).unwrap(), weighed_by);
}

#[test]
fn an_agent_says_how_much_of_an_instruction_it_reads() {
    let _chance = crate::nets::testing::chance();
    let Some(mut agent) = fresh(None) else { return };
    let read = agent.reading("take the mug").unwrap();
    assert!(read.tokens > 3 && read.cut == 0, "{read:?}");
    assert_eq!(fresh(Some([4; 4])).unwrap().reading("take the mug"), None, "it is shown its goal");
    agent.config.policy.attention = Some(AttentionSpec { vocabulary_size: 9, layers: 1, heads: 1, feedforward: 4 });
    assert_eq!(agent.reading("take the mug"), Some(Reading { tokens: 3, cut: 0 }));
    assert_eq!(agent.reading(&"mug ".repeat(130)), Some(Reading { tokens: 128, cut: 2 }));
}

#[test]
fn an_agent_that_is_shown_its_goal_needs_a_task_and_lacks_it_in_its_own_slot_alone() {
    let _chance = crate::nets::testing::chance();
    let Some(mut agent) = fresh(Some([4; 4])) else { return };
    let (scene, start) = crate::house::testing::kitchen();
    let (roles, asked) = ([role("Mug")], [subtask(SkillKind::Pickup, 0)]);
    let grader = Grader::new(Grading::default(), &roles, &asked, None, (&scene, &start));
    let (mut without, mut with) = (kitchen(None), kitchen(Some(grader)));
    let mut observations: Vec<Option<Observation<'_>>> = (0..agent.slots()).map(|_| None).collect();
    (0..agent.slots()).for_each(|slot| agent.reset(slot, 1));
    observations[1] = Some(at(&mut without, "", 0));
    observations[3] = Some(at(&mut with, "", 0));
    let mut decided = agent.act(&mut observations).unwrap();
    assert!(decided[3].take().unwrap().is_ok() && decided[0].is_none());
    let error = decided[1].take().unwrap().unwrap_err();
    assert!(error.to_string().contains("which a task has"), "{error}");
}

/// What the agent thinks in one slot in ten steps, with these other slots taken.
fn thoughts(agent: &mut LearnedPolicy, slot: usize, others: &[usize]) -> Vec<ActionDistribution> {
    let mut houses: Vec<Option<HouseEnvironment>> = (0..agent.slots()).map(|_| None).collect();
    for &other in others {
        houses[other] = Some(turned(Heading::ALL[other % 4]));
    }
    houses[slot] = Some(turned(Heading::West));
    (0..agent.slots()).for_each(|slot| agent.reset(slot, slot as u64));
    let mut thoughts = Vec::new();
    for step in 0..10 {
        let said = ["Take the mug.", "Slice the bread.", "Open the fridge."];
        let mut observations: Vec<Option<Observation<'_>>> = Vec::new();
        for (place, house) in houses.iter_mut().enumerate() {
            let instruction = if place == slot { "Put the apple in the sink." } else { said[place % 3] };
            observations.push(house.as_mut().map(|house| at(house, instruction, step)));
        }
        let decisions = agent.act(&mut observations).unwrap();
        for (place, decision) in decisions.into_iter().enumerate() {
            let Some(decision) = decision.map(Result::unwrap) else { continue };
            if let Some(house) = &mut houses[place] {
                house.step(decision.action).unwrap();
            }
            if place == slot {
                thoughts.extend(decision.distribution);
            }
        }
    }
    thoughts
}

#[test]
fn a_decision_depends_on_its_own_slot_alone_bit_for_bit() {
    // The second weighs its policy by its critic.
    for name in [CLONE, ALFRED] {
        let Some(mut agent) = shipped(name) else { return };
        agent.config.advantage_scale = agent.networks.critic.is_some().then_some(10.0);
        for slot in [0, 5] {
            let alone = thoughts(&mut agent, slot, &[]);
            assert_eq!(alone.len(), 10);
            assert_eq!(thoughts(&mut agent, slot, &[1, 2]), alone);
            assert_eq!(thoughts(&mut agent, slot, &[0, 1, 2, 3, 4, 5, 6, 7]), alone);
        }
    }
}

/// What a shipped agent thinks first.
fn first_thought(name: &str, change: impl Fn(&mut CheckpointConfig)) -> Option<ActionDistribution> {
    let mut agent = shipped(name)?;
    change(&mut agent.config);
    Some(thoughts(&mut agent, 3, &[0, 1, 2]).remove(0))
}

#[test]
fn frequent_actions_lose_as_much_as_the_adjustment_says() {
    let mut ahead = Vec::new();
    let shares: Vec<f32> = (0..ActionType::COUNT).map(|action| if action == 0 { 0.45 } else { 0.05 }).collect();
    for adjustment in [None, Some(LogitAdjustment { strength: 0.5, action_frequencies: shares })] {
        let Some(thought) = first_thought(CLONE, |config| config.logit_adjustment = adjustment.clone()) else {
            return;
        };
        let odds = |action: usize| thought.actions[action].unwrap();
        ahead.push(odds(0) / odds(1));
    }
    // Nine times the share, at half strength: a third of the odds.
    assert!((ahead[0] / ahead[1] - 3.0).abs() < 1e-3, "{ahead:?}");
}

#[test]
fn an_agent_that_weighs_by_its_critic_thinks_otherwise_than_by_its_policy_alone() {
    let [alone, weighed] = [None, Some(10.0)].map(|scale| first_thought(ALFRED, |it| it.advantage_scale = scale));
    let (Some(alone), Some(weighed)) = (alone, weighed) else { return };
    let apart = |(a, b): (&Option<f32>, &Option<f32>)| (a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs() > 1e-3;
    assert!(alone.actions.iter().zip(&weighed.actions).any(apart), "{alone:?} {weighed:?}");
}
