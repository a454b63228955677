//! What holds in a state by itself, whatever action led to it: subtasks that need not be done, and a whole task that is still
//! fulfilled.

use super::class;
use super::grader::{GradedStep, Grader, SubtaskVerdict};
use crate::domain::skill::{SkillKind, Subtask};
use crate::domain::world::Instance;
use crate::domain::{Action, ActionType, Object, Scene, World};

impl Grader {
    /// Counts the first subtasks as done that hold already: what is to be picked up is in the hand, what is to be sliced is,
    /// the lamp shines. How many those are.
    pub(crate) fn settle(&mut self, scene: &Scene, world: &World) -> usize {
        let before = self.completed;
        while let Some(subtask) = self.subtask().cloned() {
            let holds = match subtask.skill {
                SkillKind::Pickup => {
                    let held = world.held.map(Instance::Object);
                    let held = held.filter(|&held| self.fits(scene, world, subtask.object, held));
                    if let (Some(held), Some(slot)) = (held, self.bindings.get_mut(usize::from(subtask.object))) {
                        *slot = Some(held);
                    }
                    held.is_some()
                }
                SkillKind::Slice | SkillKind::Toggle => {
                    // A turn that was not taken: these two are judged by the state alone.
                    let action = Action::navigate(ActionType::RotateLeft);
                    let step = GradedStep { scene, world, action, done: false };
                    matches!(class::grade(self, &subtask, step), SubtaskVerdict::Complete)
                }
                SkillKind::Put | SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => false,
            };
            if !holds {
                break;
            }
            self.completed += 1;
        }
        self.remember(scene, world);
        self.completed - before
    }

    /// Whether every subtask is done and nothing was undone since: each thing is still where it was last put, still in the
    /// hand where nothing came after its pickup, still sliced, clean, hot, cold or switched on.
    pub(crate) fn still_holds(&self, world: &World) -> bool {
        self.is_done() && (0..self.subtasks.len()).all(|at| self.is_undone_later(at) || self.holds(at, world))
    }

    /// Whether a later subtask moves the thing on: then the end need not be as this one left it.
    fn is_undone_later(&self, at: usize) -> bool {
        let subtask = &self.subtasks[at];
        let moves = |other: &Subtask| other.skill != SkillKind::Slice && other.skill != SkillKind::Toggle;
        let mut later = self.subtasks[at + 1..].iter();
        match subtask.skill {
            // There is one hand: whatever is held or put down after it takes its place.
            SkillKind::Pickup => later.any(moves),
            SkillKind::Put | SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => {
                later.any(|other| moves(other) && other.object == subtask.object)
            }
            SkillKind::Slice | SkillKind::Toggle => false,
        }
    }

    fn holds(&self, at: usize, world: &World) -> bool {
        let subtask = &self.subtasks[at];
        let Some(thing) = self.binding(subtask.object) else { return true };
        let is = |property: fn(&Object) -> bool| match thing {
            Instance::Object(index) => world.object(index).is_some_and(property),
            Instance::Fixture(_) => false,
        };
        match subtask.skill {
            SkillKind::Pickup => world.held.map(Instance::Object) == Some(thing),
            SkillKind::Put => {
                let place = subtask.receptacle.and_then(|role| self.binding(role));
                place.is_none_or(|place| world.is_in(thing, place))
            }
            SkillKind::Slice => is(|object| object.sliced),
            SkillKind::Toggle => world.is_on(thing),
            SkillKind::Clean => is(|object| object.clean),
            SkillKind::Heat => is(|object| object.hot),
            SkillKind::Cool => is(|object| object.cold),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::house::grading::Grading;
    use crate::house::rules;
    use crate::house::testing::{kitchen, named, put_subtask, role, subtask};

    #[test]
    fn what_is_in_the_hand_need_not_be_picked_up() {
        let (scene, mut world) = kitchen();
        let roles = [role("Mug"), role("SideTable")];
        let asked = [subtask(SkillKind::Pickup, 0), put_subtask(0, 1)];
        let mut grader = Grader::new(Grading::Class, &roles, &asked, None, (&scene, &world));
        assert_eq!(grader.settle(&scene, &world), 0);
        let mug = named(&scene, &world, "Mug");
        assert!(rules::apply(&scene, &mut world, Action::interact(ActionType::Pickup, mug)).is_done());
        assert_eq!((grader.settle(&scene, &world), grader.completed()), (1, 1));
        assert_eq!(grader.binding(0), Some(mug));
        let table = named(&scene, &world, "SideTable");
        let put = Action::interact(ActionType::Put, table);
        let outcome = rules::apply(&scene, &mut world, put);
        assert!(grader.observe(&scene, &world, put, outcome) && grader.is_done());
    }

    #[test]
    fn what_was_put_away_and_taken_again_no_longer_holds() {
        let (scene, mut world) = kitchen();
        let (roles, asked) = ([role("Mug"), role("SideTable")], [put_subtask(0, 1)]);
        let mut grader = Grader::new(Grading::Class, &roles, &asked, None, (&scene, &world));
        let mut act = |grader: &mut Grader, kind, name: &str| {
            let action = Action::interact(kind, named(&scene, &world, name));
            let outcome = rules::apply(&scene, &mut world, action);
            assert!(outcome.is_done(), "{kind} {name}: {outcome}");
            grader.observe(&scene, &world, action, outcome);
            grader.still_holds(&world)
        };
        assert!(!act(&mut grader, ActionType::Pickup, "Mug"));
        assert!(act(&mut grader, ActionType::Put, "SideTable"));
        assert!(!act(&mut grader, ActionType::Pickup, "Mug"), "it is out again");
        assert!(act(&mut grader, ActionType::Put, "SideTable"));
    }
}
