//! Why an episode fell short, in classes: its recorded steps are taken again, and the one subtask that was not done is
//! looked at.

use std::collections::HashSet;
use std::ops::ControlFlow;

use super::failure::Failure;
use super::record::TraceStep;
use super::rollout::{Observer, Rollout, Tick};
use super::scenes::Setting;
use crate::agent::{Decision, Policy};
use crate::domain::{ActionType, Instance, Pose, SkillKind, Subtask, Task};
use crate::env::{Environment, HouseEnvironment};
use crate::house::House;
use crate::house::grading::{Grader, Grading};

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
    /// What was asked for before the step at hand.
    wanted: Wanted,
    /// A grader for each later subtask.
    later: Vec<Grader>,
}

/// Classifies an episode in a house that ended in its time without success.
///
/// # Errors
/// When the steps cannot be taken again.
pub(crate) fn classify(
    task: &Task,
    grading: Grading,
    setting: &Setting,
    trace: &[TraceStep],
) -> anyhow::Result<Failure> {
    let house = House::new(setting.scene.clone(), setting.world.clone());
    let mut rollout = Rollout::new(HouseEnvironment::of_task(task, house, grading), String::new(), None);
    let last_done = trace.iter().rposition(|step| step.subtask.is_some()).map_or(0, |step| step + 1);
    let (before, after) = trace.split_at(last_done);
    rollout.replay(before.iter().map(TraceStep::action), &mut ())?;
    let mut evidence = Evidence { later: later_graders(task, &rollout), ..Evidence::default() };
    rollout.replay(after.iter().map(TraceStep::action), &mut evidence)?;
    Ok(evidence.verdict())
}

/// A grader for each later subtask alone, unless the present one asks for the same.
fn later_graders(task: &Task, rollout: &Rollout) -> Vec<Grader> {
    let Some(grader) = &rollout.env.grader else { return Vec::new() };
    let asked = |subtask: &Subtask| {
        let class = |role: u8| task.roles.get(usize::from(role)).map(|role| (role.class, role.slice));
        (subtask.skill, class(subtask.object), subtask.receptacle.and_then(class))
    };
    let Some(present) = grader.subtask().map(asked) else { return Vec::new() };
    let later = task.subtasks.iter().skip(grader.completed() + 1).filter(|subtask| asked(subtask) != present);
    let (scene, now) = (rollout.env.house.scene(), rollout.env.house.world());
    let alone = |subtask| Grader::new(Grading::Class, &task.roles, std::slice::from_ref(subtask), None, (scene, now));
    later.map(alone).collect()
}

impl Observer<HouseEnvironment> for Evidence {
    fn before(
        &mut self,
        rollout: &mut Rollout,
        _policy: Option<&mut dyn Policy>,
        _decision: &Decision,
    ) -> anyhow::Result<ControlFlow<()>> {
        self.wanted = wanted(rollout);
        if !self.reached {
            let candidates = rollout.env.legal_actions()?;
            self.reached = candidates.iter().any(|candidate| self.wanted.fits(candidate.instance));
        }
        Ok(ControlFlow::Continue(()))
    }

    fn after(&mut self, rollout: &mut Rollout, tick: &Tick) -> anyhow::Result<ControlFlow<()>> {
        let action = tick.decision.action;
        let moved = action.kind.is_interaction() && tick.outcome.is_done();
        let house = &rollout.env.house;
        if moved && let Some(target) = action.target {
            let fits = self.wanted.fits(target);
            self.right_object |= fits;
            self.wrong_object |= !fits && self.wanted.kinds.contains(&action.kind);
            for grader in &mut self.later {
                self.out_of_order |= grader.observe(house.scene(), house.world(), action, tick.outcome);
            }
        }
        self.ends.push((house.world().agent, moved));
        Ok(ControlFlow::Continue(()))
    }
}

/// What the present subtask asks for: interactions of which kinds, with which instances.
#[derive(Default)]
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
    let Some((grader, subtask)) = rollout.env.grader.as_ref().and_then(|it| Some((it, it.subtask()?))) else {
        return Wanted::default();
    };
    let (scene, world) = (rollout.env.house.scene(), rollout.env.house.world());
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
    use crate::domain::{Action, Cell, Heading, Role};
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
        let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, None, (&scene, &world));
        let house = House::new(scene.clone(), world.clone());
        let mut rollout = Rollout::in_house(house, String::new(), Some(grader), None);
        let mut trace = Vec::new();
        for words in what {
            let (kind, target) = words.split_once(' ').unwrap_or((words, ""));
            let kind = ActionType::ALL.into_iter().find(|known| known.to_string() == kind).unwrap();
            let action = match target {
                "" => Action::navigate(kind),
                _ => Action::interact(kind, named(&scene, &world, target)),
            };
            let tick = rollout.carry_out(Decision::of(action)).unwrap();
            assert!(tick.outcome.is_done() || target.is_empty(), "{words}: {}", tick.outcome);
            trace.push(TraceStep::of(&tick, &rollout));
        }
        assert!(rollout.end().is_none(), "the task was done after all");
        classify(&task, Grading::Class, &Setting { scene, world }, &trace).unwrap()
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
