//! Why a wish failed, in the evaluator's classes, with what a person may do about it.

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::domain::skill::SkillKind;
use crate::domain::task::SceneRef;
use crate::domain::{Action, Class, Role, Scene, Subtask, Task, World};
use crate::env::HouseEnvironment;
use crate::episode::diagnosis::classify;
use crate::episode::failure::Failure;
use crate::episode::record::TraceStep;
use crate::episode::rollout::{AfterEach, Rollout, Tick};
use crate::episode::scenes::Setting;
use crate::house::House;
use crate::house::grading::{Grader, Grading};

/// Why `actions`, taken from a state, did not fulfil what `grader` asked there; nothing where they did.
///
/// # Errors
/// When the steps cannot be taken again.
pub(crate) fn explain(
    grader: &Grader,
    scene: &Arc<Scene>,
    world: &World,
    actions: &[Action],
) -> anyhow::Result<Option<(Failure, String)>> {
    let (task, setting) = as_task(grader, scene, world);
    let house = House::new(scene.clone(), world.clone());
    let mut rollout = Rollout::new(HouseEnvironment::of_task(&task, house, Grading::Class), String::new(), None);
    let mut seen: HashSet<Class> = HashSet::new();
    look(&mut rollout, &mut seen);
    let mut trace = Vec::new();
    rollout.replay(
        actions.iter().copied(),
        &mut AfterEach(|rollout: &mut Rollout, tick: &Tick| {
            look(rollout, &mut seen);
            trace.push(TraceStep::of(tick, rollout));
            Ok(ControlFlow::Continue(()))
        }),
    )?;
    let Some(grader) = rollout.env.grader.as_ref() else { return Ok(None) };
    let Some(subtask) = grader.subtask() else { return Ok(None) };
    let role = |role: u8| grader.roles().get(usize::from(role)).map(|role| role.class);
    let Some(thing) = role(subtask.receptacle.unwrap_or(subtask.object)) else { return Ok(None) };
    let failure = classify(&task, Grading::Class, &setting, &trace)?;
    Ok(Some((failure, advice(failure, thing, seen.contains(&thing)))))
}

fn look(rollout: &mut Rollout, seen: &mut HashSet<Class>) {
    let sightings = rollout.env.house.view().sightings.clone();
    let house = &rollout.env.house;
    seen.extend(sightings.iter().filter_map(|seen| house.world().class_of(house.scene(), seen.instance)));
}

/// What is left to do as a task of its own. What is to be put somewhere is gone for first, also where nobody says so: only
/// then can it be told what the agent never reached.
fn as_task(grader: &Grader, scene: &Arc<Scene>, world: &World) -> (Task, Setting) {
    let mut roles: Vec<Role> = grader.roles().to_vec();
    for (at, role) in (0u8..).zip(&mut roles) {
        role.bound = grader.binding(at);
    }
    let mut subtasks: Vec<Subtask> = Vec::new();
    for subtask in grader.subtasks().iter().skip(grader.completed()) {
        let is_gone_for = subtasks.iter().any(|earlier| earlier.object == subtask.object);
        let is_held = world
            .held
            .is_some_and(|held| grader.fits(scene, world, subtask.object, crate::domain::Instance::Object(held)));
        if subtask.skill == SkillKind::Put && !is_gone_for && !is_held {
            subtasks.push(Subtask {
                skill: SkillKind::Pickup,
                object: subtask.object,
                receptacle: None,
                closes: false,
                literal: None,
            });
        }
        subtasks.push(subtask.clone());
    }
    let task = Task {
        id: "wish".into(),
        scene: SceneRef::Named(scene.name.clone()),
        start: None,
        instruction: String::new(),
        sentences: Vec::new(),
        roles,
        subtasks,
        expert_steps: 0,
        horizon: 1,
        goal: None,
        source: None,
        env: None,
        seed: None,
        reworded: false,
    };
    (task, Setting { scene: scene.clone(), world: world.clone() })
}

/// What happened and what to do about it. The explorer's verbs stand between backticks; a screen names their keys.
fn advice(failure: Failure, thing: Class, was_seen: bool) -> String {
    let name = thing.spoken();
    match failure {
        Failure::NeverReached if !was_seen => format!("it never saw a {name}: try another house (`next`), or `values`"),
        Failure::NeverReached => format!("it saw a {name} and never got to it: `manual` takes over, or `values`"),
        Failure::OutOfOrder => "it did a later step first: tell it one step at a time".into(),
        Failure::WrongObject => format!("it took something else for the {name}: `compare` tries other words"),
        Failure::WrongAction => format!("it did something else with the {name}: tell it that step alone"),
        Failure::Stuck => "it turned on the spot or pushed on: `manual` takes over for a step".into(),
        // The last three are of evaluations in which the agent's own word ends an episode.
        Failure::Timeout | Failure::StoppedEarly | Failure::Undone | Failure::NeverStopped => {
            format!("the {name} was in reach: tell it again, and it goes on")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{ActionType, Cell, Heading, Pose};
    use crate::house::testing::{kitchen, put_subtask, role};

    #[test]
    fn a_thing_to_be_put_away_that_was_never_seen_is_named_before_its_place() {
        let (scene, mut world) = kitchen();
        // In front of the counter, with the laptop behind.
        world.agent = Pose { cell: Cell { x: 4, z: 9 }, heading: Heading::North, horizon: 45 };
        let grader =
            Grader::new(Grading::Class, &[role("Laptop"), role("Sink")], &[put_subtask(0, 1)], None, (&scene, &world));
        let (failure, advice) =
            explain(&grader, &scene, &world, &[Action::navigate(ActionType::LookDown)]).unwrap().unwrap();
        assert_eq!(failure, Failure::NeverReached);
        assert_eq!(advice, "it never saw a laptop: try another house (`next`), or `values`");
    }
}
