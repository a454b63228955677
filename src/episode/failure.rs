//! Why an episode fell short, in classes: its recorded steps are taken again, and the one subtask that was not done is
//! looked at.

use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use super::record::Step;
use super::rollout::Rollout;
use super::scenes::Setting;
use crate::domain::{Action, ActionType, Instance, Pose, SkillKind, Subtask, Task};
use crate::house::House;
use crate::house::grading::{Grader, Grading};

/// What kept an episode from success; the first that applies, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// A later subtask was done while its turn had not come.
    OutOfOrder,
    /// The right kind of interaction with a thing that was not asked for.
    WrongObject,
    /// The right thing, but not what was to be done with it.
    WrongAction,
    /// At the end the agent turned on the spot or pushed against something.
    Stuck,
    /// The thing was never in view and in reach.
    NeverReached,
    /// None of these: the thing was in reach and the time ran out.
    Timeout,
}

impl Failure {
    /// Every class.
    pub const ALL: [Failure; 6] = [
        Failure::OutOfOrder,
        Failure::WrongObject,
        Failure::WrongAction,
        Failure::Stuck,
        Failure::NeverReached,
        Failure::Timeout,
    ];

    /// The class in words.
    pub fn words(self) -> &'static str {
        match self {
            Failure::OutOfOrder => "out of order",
            Failure::WrongObject => "wrong object",
            Failure::WrongAction => "right object, wrong action",
            Failure::Stuck => "stuck",
            Failure::NeverReached => "never reached the object",
            Failure::Timeout => "timeout",
        }
    }
}

/// An agent that saw no more than [`STUCK_POSES`] poses in its last this many steps, and moved nothing, is stuck.
const STUCK_STEPS: usize = 12;
/// Turning on the spot shows four.
const STUCK_POSES: usize = 4;

/// What the agent did in the subtask that it did not complete.
#[derive(Default)]
struct Evidence {
    out_of_order: bool,
    wrong_object: bool,
    right_object: bool,
    reached: bool,
    /// The agent's last poses, and whether it moved anything, step by step.
    ends: Vec<(Pose, bool)>,
}

/// Classifies an episode that ended in its time without success.
pub fn classify(task: &Task, grading: Grading, setting: &Setting, trace: &[Step]) -> Failure {
    let grader = Grader::new(grading, &task.roles, &task.subtasks, task.goal.as_ref());
    let house = House::new(setting.scene.clone(), setting.world.clone());
    let mut rollout = Rollout::new(house, String::new(), Some(grader), None);
    let last_done = trace.iter().rposition(|step| step.subtask.is_some()).map_or(0, |step| step + 1);
    for step in &trace[..last_done] {
        rollout.act(action(step));
    }
    let mut evidence = Evidence::default();
    let mut later = later_graders(task, &rollout);
    for step in &trace[last_done..] {
        look(&mut rollout, action(step), &mut evidence, &mut later);
    }
    evidence.verdict()
}

fn action(step: &Step) -> Action {
    Action { kind: step.kind, target: step.target }
}

/// A grader for each later subtask alone, unless the present one asks for the same.
fn later_graders(task: &Task, rollout: &Rollout) -> Vec<Grader> {
    let Some(grader) = &rollout.grader else { return Vec::new() };
    let asked = |subtask: &Subtask| {
        let class = |role: u8| task.roles.get(usize::from(role)).map(|role| (role.class, role.slice));
        (subtask.skill, class(subtask.object), subtask.receptacle.and_then(class))
    };
    let Some(present) = grader.subtask().map(asked) else { return Vec::new() };
    let later = task.subtasks.iter().skip(grader.completed() + 1).filter(|subtask| asked(subtask) != present);
    later.map(|subtask| Grader::new(Grading::Class, &task.roles, std::slice::from_ref(subtask), None)).collect()
}

/// Takes one recorded step, and notes what it says.
fn look(rollout: &mut Rollout, action: Action, evidence: &mut Evidence, later: &mut [Grader]) {
    let wanted = wanted(rollout);
    if !evidence.reached {
        let candidates = rollout.house.candidates();
        evidence.reached = candidates.iter().any(|candidate| wanted.fits(candidate.instance));
    }
    let tick = rollout.act(action);
    let moved = action.kind.is_interaction() && tick.outcome.is_done();
    if moved && let Some(target) = action.target {
        let fits = wanted.fits(target);
        evidence.right_object |= fits;
        evidence.wrong_object |= !fits && wanted.kinds.contains(&action.kind);
        let (scene, world) = (rollout.house.scene().clone(), rollout.house.world());
        for grader in later {
            evidence.out_of_order |= grader.observe(&scene, world, action, tick.outcome);
        }
    }
    evidence.ends.push((rollout.house.world().agent, moved));
}

/// What the present subtask asks for: interactions of which kinds, with which instances.
struct Wanted {
    kinds: &'static [ActionType],
    instances: HashSet<Instance>,
}

impl Wanted {
    fn fits(&self, instance: Instance) -> bool {
        self.instances.contains(&instance)
    }
}

fn wanted(rollout: &Rollout) -> Wanted {
    let none = Wanted { kinds: &[], instances: HashSet::new() };
    let Some(grader) = &rollout.grader else { return none };
    let Some(subtask) = grader.subtask() else { return none };
    let (scene, world) = (rollout.house.scene(), rollout.house.world());
    // What is held already is not gone for; then the place to put it is.
    let role = subtask.receptacle.unwrap_or(subtask.object);
    let objects = (0..world.objects.len() as u16).map(Instance::Object);
    let fixtures = (0..scene.fixtures.len() as u16).map(Instance::Fixture);
    let instances = objects.chain(fixtures).filter(|&instance| grader.fits(scene, world, role, instance)).collect();
    let kinds: &[ActionType] = match subtask.skill {
        SkillKind::Pickup => &[ActionType::Pickup],
        SkillKind::Put => &[ActionType::Put],
        SkillKind::Slice => &[ActionType::Slice],
        SkillKind::Toggle => &[ActionType::ToggleOn],
        SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => &[ActionType::Pickup],
    };
    Wanted { kinds, instances }
}

impl Evidence {
    fn verdict(&self) -> Failure {
        let end = &self.ends[self.ends.len().saturating_sub(STUCK_STEPS)..];
        let poses: HashSet<Pose> = end.iter().map(|(pose, _)| *pose).collect();
        let is_stuck = end.len() == STUCK_STEPS && poses.len() <= STUCK_POSES && end.iter().all(|(_, moved)| !moved);
        match () {
            () if self.out_of_order => Failure::OutOfOrder,
            () if self.wrong_object => Failure::WrongObject,
            () if self.right_object => Failure::WrongAction,
            () if is_stuck => Failure::Stuck,
            () if !self.reached => Failure::NeverReached,
            () => Failure::Timeout,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::task::SceneRef;
    use crate::domain::{Cell, Heading, Role};
    use crate::explore::session_export::ungraded;
    use crate::house::testing::{kitchen, named, role, subtask};

    /// In front of the counter, with tomato, knife and counter in view and in reach.
    const COUNTER: (Cell, Heading, i16) = (Cell { x: 4, z: 9 }, Heading::North, 45);
    /// In front of the floor lamp, far from the counter.
    const LAMP: (Cell, Heading, i16) = (Cell { x: 8, z: 1 }, Heading::East, 0);

    fn one(skill: SkillKind, class: &str) -> (Vec<Role>, Vec<Subtask>) {
        (vec![role(class)], vec![subtask(skill, 0)])
    }

    /// What kept an episode in the kitchen from success: the agent stands in `place` and does `what`, an action a word pair.
    fn why(
        (roles, subtasks): (Vec<Role>, Vec<Subtask>),
        (cell, heading, horizon): (Cell, Heading, i16),
        what: &[&str],
    ) -> Failure {
        let (scene, mut world) = kitchen();
        world.agent = Pose { cell, heading, horizon };
        let task = Task { roles, subtasks, ..ungraded(SceneRef::Named(scene.name.clone())) };
        let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, None);
        let house = House::new(scene.clone(), world.clone());
        let mut rollout = Rollout::new(house, String::new(), Some(grader), None);
        let mut trace = Vec::new();
        for words in what {
            let (kind, target) = words.split_once(' ').unwrap_or((words, ""));
            let kind = ActionType::ALL.into_iter().find(|known| known.to_string() == kind).unwrap();
            let action = match target {
                "" => Action::navigate(kind),
                _ => Action::interact(kind, named(&scene, &world, target)),
            };
            let tick = rollout.act(action);
            assert!(tick.outcome.is_done() || target.is_empty(), "{words}: {}", tick.outcome);
            trace.push(Step::of(&tick, &rollout));
        }
        assert!(rollout.end().is_none(), "the task was done after all");
        classify(&task, Grading::Class, &Setting { scene, world }, &trace)
    }

    #[test]
    fn whoever_walks_where_the_thing_is_not_never_reached_it() {
        let away = ["RotateLeft", "RotateLeft", "MoveAhead", "MoveAhead", "MoveAhead", "RotateLeft", "MoveAhead"];
        let failure = why(one(SkillKind::Pickup, "Tomato"), LAMP, &away);
        assert_eq!((failure, failure.words()), (Failure::NeverReached, "never reached the object"));
    }

    #[test]
    fn a_closed_door_keeps_a_thing_out_of_reach() {
        let before_the_fridge = (Cell { x: 8, z: 6 }, Heading::East, 30);
        let failure = why(one(SkillKind::Pickup, "Lettuce"), before_the_fridge, &["LookDown", "LookUp", "LookUp"]);
        assert_eq!(failure, Failure::NeverReached);
    }

    #[test]
    fn whoever_takes_another_thing_took_the_wrong_object() {
        let failure = why(one(SkillKind::Pickup, "Mug"), COUNTER, &["Pickup Tomato", "RotateLeft"]);
        assert_eq!((failure, failure.words()), (Failure::WrongObject, "wrong object"));
    }

    #[test]
    fn whoever_takes_what_was_to_be_sliced_did_the_wrong_thing_to_the_right_object() {
        let failure = why(one(SkillKind::Slice, "Tomato"), COUNTER, &["Pickup Tomato", "RotateLeft"]);
        assert_eq!((failure, failure.words()), (Failure::WrongAction, "right object, wrong action"));
    }

    #[test]
    fn whoever_does_the_second_thing_first_is_out_of_order() {
        let both = vec![subtask(SkillKind::Pickup, 0), subtask(SkillKind::Toggle, 1)];
        let failure = why((vec![role("Mug"), role("FloorLamp")], both), LAMP, &["ToggleOn FloorLamp", "RotateLeft"]);
        assert_eq!((failure, failure.words()), (Failure::OutOfOrder, "out of order"));
    }

    #[test]
    fn whoever_turns_on_the_spot_or_pushes_against_furniture_is_stuck() {
        for what in ["RotateLeft", "MoveAhead"] {
            // Whether the thing is in reach or not.
            for wanted in ["Tomato", "Laptop"] {
                let failure = why(one(SkillKind::Pickup, wanted), COUNTER, &[what; STUCK_STEPS]);
                assert_eq!((failure, failure.words()), (Failure::Stuck, "stuck"), "{what} {wanted}");
            }
        }
        let shorter = why(one(SkillKind::Pickup, "Tomato"), COUNTER, &["RotateLeft"; STUCK_STEPS - 1]);
        assert_eq!(shorter, Failure::Timeout, "a few turns are a look around");
    }

    #[test]
    fn whoever_had_it_in_reach_and_walked_on_ran_out_of_time() {
        let on = ["RotateLeft", "MoveAhead", "RotateLeft", "MoveAhead", "MoveAhead", "MoveAhead", "RotateRight"];
        let failure = why(one(SkillKind::Pickup, "Tomato"), COUNTER, &on);
        assert_eq!((failure, failure.words()), (Failure::Timeout, "timeout"));
    }

    #[test]
    fn only_what_happened_after_the_last_success_counts() {
        // The tomato was asked for first and taken; then the mug was never reached.
        let both = vec![subtask(SkillKind::Pickup, 0), subtask(SkillKind::Pickup, 1)];
        let steps = ["Pickup Tomato", "RotateRight", "MoveAhead"];
        assert_eq!(why((vec![role("Tomato"), role("Laptop")], both), COUNTER, &steps), Failure::NeverReached);
    }
}
