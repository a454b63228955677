//! A span of a recording as a task: where it starts, what it is about, and what has to come to one and the same place.

use std::ops::Range;

use crate::domain::skill::{Goal, Original};
use crate::domain::task::Task;
use crate::domain::world::{Instance, World};
use crate::domain::{Role, Scene, Subtask, Trajectory};
use crate::house::{Outcome, Replay, goals};

/// Cuts a span out of a trajectory, without words yet: the expert's actions before it are replayed, and what they handled
/// stays bound.
///
/// # Errors
/// When there is no such span, or the actions before it are not possible.
pub(crate) fn span_task(
    id: String,
    trajectory: &Trajectory,
    scene: &Scene,
    span: Range<usize>,
) -> Result<Task, String> {
    if span.is_empty() || span.end > trajectory.skills.len() {
        return Err(format!("skills {span:?} do not exist; there are {}", trajectory.skills.len()));
    }
    let from = trajectory.skill_range(span.start).start;
    let until = trajectory.skill_range(span.end - 1).end;
    let before = trajectory.actions.get(..from).filter(|_| from < until && until <= trajectory.actions.len());
    let before = before.ok_or_else(|| format!("skill_starts: skills {span:?} are not a run of its actions"))?;
    let mut replay = Replay::new(scene, trajectory.start.clone(), before);
    let mut number = 0;
    while let Some((_, outcome)) = replay.step() {
        if let Outcome::Impossible(reason) = outcome {
            return Err(format!("the expert's action {number} is not possible: {reason}"));
        }
        number += 1;
    }
    let start = replay.finish();
    let (roles, subtasks) = roles(trajectory, span.clone(), &start)?;
    let expert_steps = (until - from) as u32;
    Ok(Task {
        id,
        scene: trajectory.scene.clone(),
        start: Some(start),
        instruction: String::new(),
        sentences: Vec::new(),
        roles,
        subtasks,
        expert_steps,
        horizon: 2 * expert_steps,
        goal: trajectory.goal.clone(),
        source: Some((trajectory.id.clone(), span.start as u8)),
        env: None,
        seed: None,
        reworded: false,
    })
}

/// The roles that a span and the skills before it are about, renumbered; those that were handled before carry what they are
/// bound to, so that nothing else is taken for them.
///
/// A recording names one piece of furniture for whatever was put there. A task asks for one only where ALFRED's goal does;
/// elsewhere each Put may choose its own of the class.
fn roles(trajectory: &Trajectory, span: Range<usize>, start: &World) -> Result<(Vec<Role>, Vec<Subtask>), String> {
    let recorded =
        |number: u8| trajectory.roles.get(usize::from(number)).ok_or_else(|| format!("there is no role {number}"));
    let mut parts: Vec<Part> = Vec::new();
    let mut subtasks = Vec::new();
    for (number, skill) in trajectory.skills[..span.end].iter().enumerate() {
        let before = number < span.start;
        let mut part = |recorded: u8, shared: bool| {
            let known = parts.iter().position(|part| shared && part.shared && part.recorded == recorded);
            known.unwrap_or_else(|| {
                parts.push(Part { recorded, shared, before });
                parts.len() - 1
            }) as u8
        };
        let object = part(skill.object, true);
        let receptacle = match skill.receptacle {
            Some(number) => {
                let shared = is_shared(trajectory.goal.as_ref(), recorded(skill.object)?, recorded(number)?);
                // Where something was put before does not matter to what comes, unless more has to come there.
                (shared || !before).then(|| part(number, shared))
            }
            None => None,
        };
        if !before {
            subtasks.push(Subtask { object, receptacle, ..skill.clone() });
        }
    }
    let role = |part: &Part| {
        let role = recorded(part.recorded)?;
        let bound = role.expert.filter(|_| part.before).and_then(|expert| now(expert, start));
        Ok(Role { bound, ..role.clone() })
    };
    let roles = parts.iter().map(role).collect::<Result<_, String>>()?;
    Ok((roles, subtasks))
}

/// A role of a task that is cut from a recording.
struct Part {
    /// The number of the recording's own.
    recorded: u8,
    /// Whether all that name it there mean it here.
    shared: bool,
    /// It was handled before the task begins.
    before: bool,
}

/// Whether a Put means the same receptacle as others that name it.
fn is_shared(goal: Option<&Goal>, object: &Role, receptacle: &Role) -> bool {
    let is_furniture = matches!(receptacle.expert, Some(Original { instance: Instance::Fixture(_), .. }));
    !is_furniture || goal.is_none_or(|goal| goals::asks_for_one_receptacle(goal, object, receptacle))
}

/// The instance that an original is in a world.
fn now(original: Original, world: &World) -> Option<Instance> {
    match (original.instance, original.slice) {
        (instance, None) => Some(instance),
        (Instance::Object(whole), Some(slice)) => {
            let cut = world.objects.iter().position(|object| object.slice_of == Some((whole, slice)));
            cut.map(|number| Instance::Object(number as u16))
        }
        (Instance::Fixture(_), Some(_)) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Class;
    use crate::domain::skill::GoalKind;
    use crate::domain::task::SceneRef;
    use crate::house::testing::{kitchen, named, put_subtask, role};

    /// A demonstration in the test kitchen that only says what is put where: a knife and two mugs, all on the counter.
    fn puts(kind: GoalKind, mug_on_counter: bool) -> Trajectory {
        let (scene, start) = kitchen();
        let expert = |name: &str| Some(Original { instance: named(&scene, &start, name), slice: None });
        let roles = ["Knife", "CounterTop", "Mug", "Mug2", "Plate"];
        let roles = roles.map(|name| Role { expert: expert(name), ..role(name.trim_end_matches('2')) });
        let holder = if mug_on_counter { 1 } else { 4 };
        let skills = [(0, 1), (2, holder), (3, holder)].map(|(thing, place)| put_subtask(thing, place));
        let goal = Goal {
            kind,
            object: Class::named("Mug").unwrap(),
            sliced: false,
            receptacle: Class::named("CounterTop"),
            movable: None,
            lamp: None,
        };
        Trajectory {
            id: "puts".into(),
            split: "train".into(),
            scene: SceneRef::Named(scene.name.clone()),
            start,
            actions: Vec::new(),
            skill_starts: vec![0, 1, 2],
            roles: roles.to_vec(),
            skills: skills.to_vec(),
            goal: Some(goal),
            annotations: Vec::new(),
            boxes: Vec::new(),
            choices: Vec::new(),
        }
    }

    /// The receptacles' roles in a span, and which of all roles are bound at its start.
    fn places(trajectory: &Trajectory, span: Range<usize>) -> (Vec<u8>, Vec<bool>) {
        let (roles, subtasks) = roles(trajectory, span, &trajectory.start).unwrap();
        let places: Vec<u8> = subtasks.iter().filter_map(|subtask| subtask.receptacle).collect();
        let holder = if trajectory.skills[1].receptacle == Some(1) { "CounterTop" } else { "Plate" };
        assert!(places[places.len() - 2..].iter().all(|&place| roles[usize::from(place)].class.name() == holder));
        (places, roles.iter().map(|role| role.bound.is_some()).collect())
    }

    #[test]
    fn only_what_the_goal_wants_together_has_to_come_to_one_piece_of_furniture() {
        let heat = puts(GoalKind::PickHeatThenPlaceInRecep, true);
        assert_eq!(places(&heat, 0..3), (vec![1, 3, 5], vec![false; 6]), "each has its own");
        assert_eq!(places(&heat, 1..3), (vec![2, 4], vec![true, false, false, false, false]), "the knife is bound");
        let two = puts(GoalKind::PickTwoObjAndPlace, true);
        assert_eq!(places(&two, 0..3), (vec![1, 3, 3], vec![false; 5]), "two mugs together, the knife anywhere");
        let (second, bound) = places(&Trajectory { skills: two.skills[..].to_vec(), ..two.clone() }, 1..3);
        assert_eq!((second, bound), (vec![2, 2], vec![true, false, false, false]));
    }

    #[test]
    fn the_second_of_two_things_has_to_come_to_where_the_first_was_put_before_the_task() {
        let two = puts(GoalKind::PickTwoObjAndPlace, true);
        let (roles, subtasks) = roles(&two, 2..3, &two.start).unwrap();
        let place = &roles[usize::from(subtasks[0].receptacle.unwrap())];
        assert_eq!(place.bound, two.roles[1].expert.map(|expert| expert.instance));
    }

    #[test]
    fn what_things_are_put_in_to_be_carried_is_one_thing_whatever_the_goal() {
        let carried = puts(GoalKind::PickHeatThenPlaceInRecep, false);
        assert_eq!(places(&carried, 0..3).0, [1, 3, 3]);
    }

    #[test]
    fn a_recording_without_a_goal_means_the_furniture_that_it_names() {
        let own = Trajectory { goal: None, ..puts(GoalKind::PickTwoObjAndPlace, true) };
        assert_eq!(places(&own, 0..3).0, [1, 1, 1]);
    }
}
