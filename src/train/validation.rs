//! Measures a policy in generated houses that no training saw: one-skill tasks, and whether it follows its instruction.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::Context;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::metrics::{ProgressLogger, Scalars};
use super::preset::ValidationSpec;
use crate::agent::{ExpertPolicy, Policy, RandomPolicy};
use crate::domain::task::SceneRef;
use crate::domain::{Class, Heading, Instance, Pose, Role, Room, Scene, SkillKind, Subtask, World};
use crate::env::{Environment, HouseEnvironment};
use crate::episode::rollout::{AfterEach, End, Rollout, Tick};
use crate::house::grading::{Grader, Grading};
use crate::house::{House, generate};
use crate::language::phrases;
use crate::report::stats;

/// Houses for validation have seeds from here on; those of collections lie below.
const FIRST_SEED: u64 = 1 << 40;

/// A success rate, displayed with its 95 % Wilson interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Rate {
    /// How often it worked.
    pub(crate) successes: usize,
    /// How often it was tried.
    pub(crate) trials: usize,
}

impl Rate {
    fn count(&mut self, success: bool) {
        self.successes += usize::from(success);
        self.trials += 1;
    }
}

impl std::fmt::Display for Rate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let share = 100.0 * self.successes as f64 / self.trials.max(1) as f64;
        let [low, high] = stats::wilson(self.successes, self.trials).map(|end| 100.0 * end);
        write!(f, "{share:.1} % ({} of {}, 95 % interval {low:.0} to {high:.0} %)", self.successes, self.trials)
    }
}

/// Success rates of a policy in houses that no training saw.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ValidationReport {
    /// One-skill tasks that the policy solved.
    pub(crate) agent: Rate,
    /// The same tasks, solved by chance.
    pub(crate) random: Rate,
    /// The policy's rate for each kind of skill.
    pub(crate) by_skill: BTreeMap<String, Rate>,
    /// Of two objects in view, the instruction names one: how often the policy picks up that one first.
    pub(crate) instructed_first: Rate,
    /// How often it picks up the other one.
    pub(crate) other_first: Rate,
    /// From one and the same start: how often it picks up first the one and, with the instruction swapped, the other.
    pub(crate) follows_both: Rate,
}

/// Plays the tasks and the swapped instructions of `spec`.
///
/// # Errors
/// When the policy fails.
pub(crate) fn validate(
    policy: &mut dyn Policy,
    spec: &ValidationSpec,
    logger: &mut dyn ProgressLogger,
) -> anyhow::Result<ValidationReport> {
    let mut report = ValidationReport::default();
    let mut chance = RandomPolicy::new();
    let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
    let mut number = 0;
    while report.agent.trials < spec.tasks {
        let (reference, scene, world) = unseen_house(spec.seed, number);
        number += 1;
        let Some(task) = generate::task(&scene, &world, reference, 1, &mut rng) else { continue };
        let start = task.start.clone().unwrap_or(world);
        let house = House::new(scene.clone(), start);
        let environment = HouseEnvironment::of_task(&task, house, Grading::Class);
        let mut rollout = Rollout::new(environment, task.instruction.clone(), Some(task.horizon));
        let mut solve = |policy: &mut dyn Policy| -> anyhow::Result<bool> {
            rollout.restart()?;
            policy.reset(0, number);
            rollout.run(policy, &mut ())?;
            Ok(rollout.end() == Some(End::Success))
        };
        let solved = solve(policy)?;
        report.agent.count(solved);
        report.random.count(solve(&mut chance)?);
        if let Some(subtask) = task.subtasks.first() {
            report.by_skill.entry(format!("{:?}", subtask.skill)).or_default().count(solved);
        }
        logger.log(&Scalars::new("tasks", report.agent.trials as u64, spec.tasks as u64))?;
    }
    while report.follows_both.trials < spec.swaps {
        let (_, scene, world) = unseen_house(spec.seed + 1, number);
        number += 1;
        let Some(case) = object_pair(&scene, &world, &mut rng) else { continue };
        let house = House::new(case.scene.clone(), case.world.clone());
        let mut rollout = Rollout::in_house(house, String::new(), None, None);
        let start = rollout.env.snapshot().context("a house can go back to where it was")?;
        let mut right = [false; 2];
        for (instructed, right) in right.iter_mut().enumerate() {
            rollout.env.restore(&start)?;
            rollout.set_steps(0);
            let first = case.first_pickup(policy, instructed, &mut rollout, &mut rng)?;
            *right = first == Some(case.objects[instructed]);
            report.instructed_first.count(*right);
            report.other_first.count(first == Some(case.objects[1 - instructed]));
        }
        report.follows_both.count(right == [true; 2]);
        logger.log(&Scalars::new("swaps", report.follows_both.trials as u64, spec.swaps as u64))?;
    }
    Ok(report)
}

fn unseen_house(seed: u64, number: u64) -> (SceneRef, Arc<Scene>, World) {
    let (room, seed) = (Room::ALL[(number % 4) as usize], FIRST_SEED + seed * 1_000_000 + number);
    let (scene, world) = generate::house(room, seed);
    (SceneRef::Generated { room, seed }, Arc::new(scene), world)
}

/// A start from which two objects of different classes are in view, each the only one of its class there.
struct ObjectPair {
    scene: Arc<Scene>,
    world: World,
    objects: [Class; 2],
    /// Twice the expert's steps to each.
    horizons: [u32; 2],
}

/// Places that are tried in a house.
const TRIES: usize = 20;

fn object_pair(scene: &Arc<Scene>, world: &World, rng: &mut ChaCha8Rng) -> Option<ObjectPair> {
    for _ in 0..TRIES {
        let mut world = world.clone();
        let cell = scene.cells[rng.random_range(0..scene.cells.len())];
        world.agent = Pose { cell, heading: Heading::from_quarters(rng.random_range(0..4)), horizon: 30 };
        let mut house = House::new(scene.clone(), world.clone());
        let mut counts: BTreeMap<Class, usize> = BTreeMap::new();
        for sighting in &house.view().sightings.clone() {
            if let Instance::Object(index) = sighting.instance
                && let Some(object) = world.object(index)
                && object.class.info().pickupable
            {
                *counts.entry(object.class).or_default() += 1;
            }
        }
        let single: Vec<Class> = counts.into_iter().filter(|(_, count)| *count == 1).map(|(class, _)| class).collect();
        if single.len() < 2 {
            continue;
        }
        let first = rng.random_range(0..single.len());
        let second = (first + rng.random_range(1..single.len())) % single.len();
        let objects = [single[first], single[second]];
        let horizon = |class: Class| expert_steps(scene, &world, class).map(|steps| 2 * steps);
        if let (Some(one), Some(other)) = (horizon(objects[0]), horizon(objects[1])) {
            return Some(ObjectPair { scene: scene.clone(), world, objects, horizons: [one, other] });
        }
    }
    None
}

fn pickup(class: Class) -> ([Role; 1], [Subtask; 1]) {
    let role = Role { class, slice: false, bound: None, expert: None };
    ([role], [Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None }])
}

fn expert_steps(scene: &Arc<Scene>, world: &World, class: Class) -> Option<u32> {
    const TOO_MANY: u32 = 60;
    let (roles, subtasks) = pickup(class);
    let grader = Grader::new(Grading::Class, &roles, &subtasks, None, (scene, world));
    let house = House::new(scene.clone(), world.clone());
    let mut rollout = Rollout::in_house(house, String::new(), Some(grader), Some(TOO_MANY));
    rollout.run(&mut ExpertPolicy::new(), &mut ()).ok()?;
    (rollout.end() == Some(End::Success)).then_some(rollout.steps())
}

impl ObjectPair {
    /// The class that the policy picks up first when it is instructed to take one of the two.
    fn first_pickup(
        &self,
        policy: &mut dyn Policy,
        instructed: usize,
        rollout: &mut Rollout,
        rng: &mut ChaCha8Rng,
    ) -> anyhow::Result<Option<Class>> {
        let (roles, subtasks) = pickup(self.objects[instructed]);
        rollout.instruction = phrases::sentence(&roles, &subtasks[0], rng);
        rollout.horizon = Some(self.horizons[instructed]);
        policy.reset(0, instructed as u64);
        let mut first = None;
        let mut until_pickup = AfterEach(|rollout: &mut Rollout, _: &Tick| {
            let world = rollout.env.house.world();
            first = world.held.and_then(|index| world.object(index)).map(|object| object.class);
            Ok(if first.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        });
        rollout.run(policy, &mut until_pickup)?;
        Ok(first)
    }
}
