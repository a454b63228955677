//! Tasks in generated houses. A task is emitted only when the expert has solved it.

use std::sync::Arc;

use rand::Rng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::chain::{SkillChain, Stock};
use crate::domain::skill::{Original, SkillKind};
use crate::domain::task::SceneRef;
use crate::domain::world::{Instance, Parent};
use crate::domain::{ActionType, Heading, Pose, Scene, Task, World};
use crate::house::House;
use crate::house::expert::Expert;
use crate::house::grading::{Grader, Grading};
use crate::language::phrases::origins;
use crate::language::task_wording::TaskWording;

/// How many chains are drawn before a house is given up for a length.
const DRAWS: usize = 60;
/// The skills of tasks of one subtask, as often as they are drawn.
const SINGLES: [SkillKind; 9] = {
    use SkillKind::{Clean, Cool, Heat, Pickup, Put, Slice, Toggle};
    [Pickup, Pickup, Put, Put, Slice, Toggle, Clean, Heat, Cool]
};
/// An expert that takes more actions a subtask has lost its way.
const LONGEST: usize = 120;

/// A task of `length` subtasks in a house, from a random start pose; `None` when no draw gives one that the expert solves.
pub fn task(scene: &Scene, world: &World, reference: SceneRef, length: usize, rng: &mut ChaCha8Rng) -> Option<Task> {
    let stock = Stock::of(scene, world);
    let shared = Arc::new(scene.clone());
    (0..DRAWS).find_map(|_| {
        let chain = match length {
            1 => SkillChain::single(&stock, *SINGLES.choose(rng)?, rng)?,
            _ => {
                let in_hand = rng.random_bool(0.2);
                SkillChain::draw(&stock, length, in_hand, rng)?
            }
        };
        let start = start(scene, world, &chain, rng)?;
        let Solved { chain, steps } = solve(&shared, start.clone(), chain).ok()?;
        let origins = origins(scene, &start, &chain.roles);
        let story = TaskWording { roles: &chain.roles, subtasks: &chain.subtasks, origins: &origins };
        let (instruction, sentences) = (story.instruction(rng), story.sentences(rng));
        Some(Task {
            id: format!("{}-{length}-{:08x}", scene.name, rng.random::<u32>()),
            scene: reference.clone(),
            start: Some(start),
            instruction,
            sentences,
            roles: chain.roles,
            subtasks: chain.subtasks,
            expert_steps: steps,
            horizon: 2 * steps,
            goal: None,
            source: None,
            env: None,
            seed: None,
            reworded: false,
        })
    })
}

/// The house with the agent anywhere and in its hand what the chain starts with.
fn start(scene: &Scene, world: &World, chain: &SkillChain, rng: &mut ChaCha8Rng) -> Option<World> {
    let mut world = world.clone();
    let cell = *scene.cells.choose(rng)?;
    let heading = Heading::from_quarters(rng.random_range(0..4));
    world.agent = Pose { cell, heading, horizon: 30 };
    let bound = chain.roles.iter().filter_map(|role| role.bound);
    for instance in bound {
        if let Instance::Object(index) = instance {
            world.objects[usize::from(index)].parent = Parent::Hand;
            world.held = Some(index);
        }
    }
    Some(world)
}

struct Solved {
    chain: SkillChain,
    steps: u32,
}

/// Lets the expert do the chain, or says why it cannot. Fills in the expert's instances, and which subtasks it ended with a Close.
fn solve(scene: &Arc<Scene>, start: World, mut chain: SkillChain) -> Result<Solved, String> {
    // Everything that was opened has to be closed, as ALFRED's expert does; what was not opened need not be.
    for subtask in &mut chain.subtasks {
        subtask.closes = subtask.skill != SkillKind::Toggle;
    }
    let mut grader = Grader::new(Grading::Class, &chain.roles, &chain.subtasks, None, (scene, &start));
    let mut house = House::new(Arc::clone(scene), start);
    let mut expert = Expert::new();
    let mut steps = 0;
    while !grader.is_done() {
        if steps >= LONGEST * chain.subtasks.len() {
            return Err(format!("lost the way: {}", grader.waits_for(scene, house.world())));
        }
        let action = expert.next(&mut house, &grader).map_err(|no_way| no_way.to_string())?;
        let outcome = house.step(action);
        steps += 1;
        if !outcome.is_done() {
            return Err(format!("{outcome}"));
        }
        let current = grader.completed();
        if grader.observe(scene, house.world(), action, outcome) {
            chain.subtasks[current].closes = action.kind == ActionType::Close;
        }
    }
    for (number, role) in (0u8..).zip(&mut chain.roles) {
        role.expert = grader.binding(number).map(|instance| original(house.world(), instance));
    }
    Ok(Solved { chain, steps: steps as u32 })
}

/// An instance as it can be named before anything is cut.
fn original(world: &World, instance: Instance) -> Original {
    let slice_of = match instance {
        Instance::Object(index) => world.object(index).and_then(|object| object.slice_of),
        Instance::Fixture(_) => None,
    };
    match slice_of {
        Some((whole, part)) => Original { instance: Instance::Object(whole), slice: Some(part) },
        None => Original { instance, slice: None },
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rayon::prelude::*;

    use super::super::house;
    use super::*;
    use crate::domain::Room;

    /// A task of each length in each room, in turn.
    fn numbered(number: u64) -> (Scene, Task) {
        let (room, seed) = (Room::ALL[number as usize % 4], number);
        let (scene, world) = house(room, seed);
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let length = 1 + (number as usize / 4) % 8;
        let task = task(&scene, &world, SceneRef::Generated { room, seed }, length, &mut rng);
        let task = task.unwrap_or_else(|| panic!("no task of {length} in {}", scene.name));
        assert_eq!((task.subtasks.len(), task.sentences.len()), (length, length));
        (scene, task)
    }

    /// Solves a task from what it says alone; the steps taken.
    fn solve_again(scene: Scene, task: &Task) -> Result<u32, String> {
        let begun = (&scene, task.start.as_ref().unwrap());
        let mut grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, None, begun);
        let mut house = House::new(Arc::new(scene), task.start.clone().unwrap());
        let mut expert = Expert::new();
        for step in 0..task.horizon {
            if grader.is_done() {
                return Ok(step);
            }
            let action = expert.next(&mut house, &grader).map_err(|no_way| no_way.to_string())?;
            let outcome = house.step(action);
            let world = house.world().clone();
            grader.observe(house.scene(), &world, action, outcome);
        }
        if grader.is_done() { Ok(task.horizon) } else { Err(grader.waits_for(house.scene(), house.world())) }
    }

    fn assert_solvable(count: u64) {
        let fails = |number: u64| {
            let (scene, task) = numbered(number);
            match solve_again(scene, &task) {
                Ok(steps) if steps == task.expert_steps => None,
                other => Some(format!("{} {:?}: {other:?}, not {}", task.id, task.instruction, task.expert_steps)),
            }
        };
        let failures: Vec<String> = (0..count).into_par_iter().filter_map(fails).collect();
        assert!(failures.is_empty(), "{} of {count}: {failures:#?}", failures.len());
    }

    #[test]
    fn the_expert_solves_every_task_of_a_sample() {
        assert_solvable(64);
    }

    #[test]
    fn the_same_random_numbers_give_the_same_task() {
        let twice = [0, 1].map(|_| (0..8).map(|number| numbered(number).1).collect::<Vec<_>>());
        assert_eq!(twice[0], twice[1]);
    }

    #[test]
    fn what_a_task_starts_with_in_the_hand_is_a_bound_role() {
        for (scene, task) in (0..32).map(numbered) {
            let start = task.start.unwrap();
            assert!(scene.has_cell(start.agent.cell));
            let bound: Vec<Instance> = task.roles.iter().filter_map(|role| role.bound).collect();
            assert_eq!(bound, start.held.map(Instance::Object).into_iter().collect::<Vec<_>>());
            let takes_hand = |skill| !matches!(skill, SkillKind::Pickup | SkillKind::Toggle);
            assert!(start.held.is_some() || !takes_hand(task.subtasks[0].skill));
            assert!(task.roles.iter().all(|role| role.expert.is_some()), "{}", task.id);
        }
    }
}
