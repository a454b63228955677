//! Every task that the generator emits is one that the expert can do.

use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use sprint_explorer::domain::Room;
use sprint_explorer::domain::task::SceneRef;
use sprint_explorer::house::expert::Expert;
use sprint_explorer::house::grading::{Grader, Grading};
use sprint_explorer::house::{House, generate};

/// The longest generated task, in subtasks.
const LONGEST: u64 = 8;

/// Does the tasks of these seeds; how many there were, and what went wrong.
fn done_by_expert(seeds: std::ops::Range<u64>) -> (usize, Vec<String>) {
    let results: Vec<Option<String>> = seeds.into_par_iter().filter_map(one).collect();
    (results.len(), results.into_iter().flatten().collect())
}

/// `None` when the generator emits no task; else what went wrong, if anything.
fn one(seed: u64) -> Option<Option<String>> {
    let room = Room::ALL[(seed % 4) as usize];
    let length = 1 + (seed / 4 % LONGEST) as usize;
    let (scene, world) = generate::house(room, seed);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let task = generate::task(&scene, &world, SceneRef::Generated { room, seed }, length, &mut rng)?;
    let mut house = House::new(Arc::new(scene), task.start.unwrap_or(world));
    let begun = (house.scene().as_ref(), house.world());
    let mut grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, task.goal.as_ref(), begun);
    let mut expert = Expert::new();
    for _ in 0..task.horizon {
        if grader.is_done() {
            break;
        }
        let action = match expert.next(&mut house, &grader) {
            Ok(action) => action,
            Err(no_way) => return Some(Some(format!("{}: {no_way}", task.id))),
        };
        let outcome = house.step(action);
        grader.observe(house.scene(), house.world(), action, outcome);
    }
    let waits = grader.waits_for(house.scene(), house.world());
    Some((!grader.is_done()).then(|| format!("{}: {waits}", task.id)))
}

#[test]
fn the_expert_does_every_generated_task() {
    let (tasks, failures) = done_by_expert(0..48);
    assert!(failures.is_empty(), "{failures:#?}");
    assert!(tasks >= 40, "the generator emitted only {tasks} of 48 tasks");
}

#[test]
#[ignore = "takes minutes: cargo test --release --test sprint -- --ignored ten_thousand"]
fn the_expert_does_ten_thousand_generated_tasks() {
    let (mut tasks, mut failures, mut seed) = (0, Vec::new(), 1000);
    while tasks < 10_000 {
        let (more, wrong) = done_by_expert(seed..seed + 1000);
        (tasks, seed) = (tasks + more, seed + 1000);
        failures.extend(wrong);
    }
    assert!(failures.is_empty(), "{} of {tasks}: {failures:#?}", failures.len());
}
