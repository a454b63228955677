//! What graders say: a subtask in words, and what it still waits for.

use super::grader::{Grader, Grading};
use super::role_fit;
use crate::domain::skill::{Role, SkillKind, Subtask};
use crate::domain::world::Instance;
use crate::domain::{Scene, World};

/// The role's thing in words: "the apple", "the slice of apple".
fn thing(roles: &[Role], role: u8) -> String {
    match roles.get(usize::from(role)) {
        Some(role) if role.slice => format!("the slice of {}", role.class),
        Some(role) => format!("the {}", role.class),
        None => "something".into(),
    }
}

/// "in the fridge", "on the dining table".
fn place(roles: &[Role], role: Option<u8>) -> String {
    match role.and_then(|role| roles.get(usize::from(role))) {
        Some(role) => format!("{} the {}", role.class.preposition(), role.class),
        None => "down".into(),
    }
}

/// A subtask in words: "put the apple in the fridge".
pub(crate) fn describe(roles: &[Role], subtask: &Subtask) -> String {
    let object = thing(roles, subtask.object);
    match subtask.skill {
        SkillKind::Pickup => format!("pick up {object}"),
        SkillKind::Put => format!("put {object} {}", place(roles, subtask.receptacle)),
        SkillKind::Slice => format!("slice {object}"),
        SkillKind::Toggle => format!("turn on {object}"),
        SkillKind::Clean => format!("rinse {object} in the sink"),
        SkillKind::Heat => format!("heat {object} in the microwave"),
        SkillKind::Cool => format!("cool {object} in the fridge"),
    }
}

/// What the current subtask still waits for: "waits for: the apple in the fridge, then the fridge closed".
pub(super) fn waits_for(grader: &Grader, scene: &Scene, world: &World) -> String {
    let Some(subtask) = grader.subtask() else { return String::new() };
    if grader.finished {
        return "nothing more is credited: the whole goal is met".into();
    }
    let steps = remaining(grader, subtask, scene, world);
    format!("waits for: {}", steps.join(", then "))
}

fn remaining(grader: &Grader, subtask: &Subtask, scene: &Scene, world: &World) -> Vec<String> {
    let closed = |instance: Option<Instance>| match instance.and_then(|instance| world.class_of(scene, instance)) {
        Some(class) => format!("the {class} closed"),
        None => "the door closed".into(),
    };
    if let Some(pending) = grader.pending {
        return vec![closed(pending.shut)];
    }
    let strict = subtask.literal.filter(|_| grader.grading == Grading::Strict);
    let closes = strict.map_or(subtask.closes, |literal| literal.needs_close);
    let object = thing(&grader.roles, subtask.object);
    let held =
        world.held.is_some_and(|held| role_fit::fits(grader, scene, world, subtask.object, Instance::Object(held)));
    let state = world.held.filter(|_| held).and_then(|index| world.object(index));
    let machine = |machine: &str, changed: String| {
        let last = closes.then(|| format!("the {machine} closed"));
        [changed, "in the hand again".into()].into_iter().chain(last).collect()
    };
    let mut steps = match subtask.skill {
        SkillKind::Pickup => vec![format!("{object} in the hand")],
        SkillKind::Put => vec![format!("{object} {}", place(&grader.roles, subtask.receptacle))],
        SkillKind::Slice => vec![format!("{object} sliced")],
        SkillKind::Toggle => vec![format!("{object} switched on")],
        SkillKind::Clean => vec![format!("{object} under the running faucet"), "in the hand again".into()],
        SkillKind::Heat => match state {
            Some(object) if object.hot => vec!["the microwave closed".into()],
            _ => machine("microwave", format!("{object} in the closed microwave while it runs")),
        },
        SkillKind::Cool => match state {
            Some(object) if object.cold => vec!["the fridge closed".into()],
            _ => vec![format!("{object} in the closed fridge"), "in the hand again".into(), "the fridge closed".into()],
        },
    };
    if closes && matches!(subtask.skill, SkillKind::Pickup | SkillKind::Put | SkillKind::Slice) {
        let receptacle = subtask.receptacle.and_then(|role| grader.roles.get(usize::from(role)));
        steps.push(match receptacle.filter(|role| role.class.info().openable) {
            Some(role) => format!("the {} closed", role.class),
            None => "what was opened for it closed".into(),
        });
    }
    steps
}
