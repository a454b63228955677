//! Graders: which subtasks of a task are done, strictly in order, looked at after every step.

mod class;
mod grader;
mod role_fit;
mod standing;
mod strict;
mod words;

use super::goals::goal_met;
use super::outcome::Outcome;
use crate::domain::skill::SkillKind;
use crate::domain::world::Instance;
use crate::domain::{Action, Scene, World};

use grader::{Before, GradedStep, SubtaskVerdict};
pub use grader::{Grader, Grading};
pub(crate) use words::describe;

impl Grader {
    /// Looks at the world after a step; `true` when a subtask was completed by it. At most one a step.
    pub fn observe(&mut self, scene: &Scene, world: &World, action: Action, outcome: Outcome) -> bool {
        let completed_one = match self.subtasks.get(self.completed) {
            Some(subtask) if !self.finished => {
                let subtask = subtask.clone();
                let step = GradedStep { scene, world, action, done: outcome.is_done() };
                let verdict = match (self.grading, &subtask.literal) {
                    (Grading::Strict, Some(literal)) => strict::grade(self, &subtask, literal, step),
                    _ => class::grade(self, &subtask, step),
                };
                self.take(verdict)
            }
            _ => false,
        };
        if self.grading == Grading::Strict && !self.finished {
            self.finished = self.goal.as_ref().is_some_and(|goal| goal_met(goal, scene, world));
        }
        if self.grading == Grading::Strict {
            self.find_slices(world);
        }
        self.remember(scene, world);
        completed_one
    }

    fn take(&mut self, verdict: SubtaskVerdict) -> bool {
        match verdict {
            SubtaskVerdict::Unchanged => return false,
            SubtaskVerdict::Half(pending) => self.pending = Some(pending),
            SubtaskVerdict::Undone => self.pending = None,
            SubtaskVerdict::Complete => {
                self.pending = None;
                self.completed += 1;
                return true;
            }
        }
        false
    }

    /// The expert's slices exist only once the whole is cut.
    fn find_slices(&mut self, world: &World) {
        for (role, slot) in self.roles.iter().zip(&mut self.bindings) {
            if slot.is_none() {
                *slot = role.expert.and_then(|original| strict::resolve(world, original));
            }
        }
    }

    pub(super) fn remember(&mut self, scene: &Scene, world: &World) {
        let follows = self.subtask().is_some_and(|subtask| subtask.skill == SkillKind::Pickup && subtask.closes);
        let inside = if follows {
            (0..world.objects.len() as u16).map(|index| class::shell(scene, world, Instance::Object(index))).collect()
        } else {
            Vec::new()
        };
        self.before = Before { held: world.held, inside };
    }

    /// Whether an instance may play a role: the bound one, or any other of the class that plays no other role. With strict
    /// grading, the expert's own.
    pub(crate) fn fits(&self, scene: &Scene, world: &World, role: u8, instance: Instance) -> bool {
        role_fit::fits(self, scene, world, role, instance)
    }

    /// What the current subtask still waits for, in words; empty when all are done.
    pub fn waits_for(&self, scene: &Scene, world: &World) -> String {
        words::waits_for(self, scene, world)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{closing, kitchen, named, put_subtask, role, slice_role, subtask};
    use super::*;
    use crate::domain::ActionType;
    use crate::domain::skill::{Goal, GoalKind, Literal, Original, Role, Subtask};
    use crate::house::rules;
    use ActionType::{Close, Open, Pickup, Put, Slice, ToggleOff, ToggleOn};

    /// Acts by the rules alone (sight and reach do not matter to graders); after which steps a subtask was completed.
    fn play(grader: &mut Grader, script: &[(ActionType, &str)]) -> Vec<usize> {
        let (scene, mut world) = kitchen();
        play_on(grader, &scene, &mut world, script)
    }

    fn play_on(grader: &mut Grader, scene: &Scene, world: &mut World, script: &[(ActionType, &str)]) -> Vec<usize> {
        let mut completed = Vec::new();
        for (step, &(kind, name)) in script.iter().enumerate() {
            let target = match name.split_once('/') {
                Some((whole, part)) => {
                    let Instance::Object(whole) = named(scene, world, whole) else { panic!("{whole} has no slices") };
                    let part = part.parse().unwrap();
                    strict::resolve(world, Original { instance: Instance::Object(whole), slice: Some(part) }).unwrap()
                }
                None => named(scene, world, name),
            };
            let action = Action::interact(kind, target);
            let outcome = rules::apply(scene, world, action);
            assert!(outcome.is_done(), "step {step}, {kind} {name}: {outcome}");
            if grader.observe(scene, world, action, outcome) {
                completed.push(step);
            }
        }
        completed
    }

    fn by_class(roles: &[Role], subtasks: &[Subtask]) -> Grader {
        let (scene, start) = kitchen();
        Grader::new(Grading::Class, roles, subtasks, None, (&scene, &start))
    }

    #[test]
    fn a_pickup_out_of_a_fridge_is_complete_once_the_fridge_is_closed_while_it_is_held() {
        let mut grader = by_class(&[role("Potato")], &[closing(subtask(SkillKind::Pickup, 0))]);
        assert_eq!(play(&mut grader, &[(Open, "Fridge"), (Pickup, "Potato"), (Close, "Fridge")]), [2]);
    }

    #[test]
    fn a_door_need_not_be_closed_where_the_agent_took_the_thing_from_a_table() {
        let mut grader = by_class(&[role("Tomato")], &[closing(subtask(SkillKind::Pickup, 0))]);
        assert_eq!(play(&mut grader, &[(Pickup, "Tomato")]), [0]);
    }

    #[test]
    fn where_a_thing_came_from_is_known_at_the_first_step_too() {
        let (scene, mut world) = kitchen();
        // The apple lies on the counter, above the open drawer.
        let (drawer, apple) = (named(&scene, &world, "Drawer"), named(&scene, &world, "Tomato"));
        let Instance::Object(apple) = apple else { panic!("no tomato") };
        assert!(rules::apply(&scene, &mut world, Action::interact(Open, drawer)).is_done());
        let Instance::Fixture(number) = drawer else { panic!("no drawer") };
        let area = scene.fixtures[usize::from(number)].surfaces[0].areas[0];
        let at = &mut world.objects[usize::from(apple)].at;
        (at.x, at.z) = ((area.min[0] + area.max[0]) / 2, (area.min[1] + area.max[1]) / 2);
        let grader = |object: &str, world: &World| {
            let asked = [closing(subtask(SkillKind::Pickup, 0))];
            Grader::new(Grading::Class, &[role(object)], &asked, None, (&scene, world))
        };
        let pickup = |object| [(Pickup, object), (Close, "Drawer")];
        let mut from_counter = grader("Tomato", &world);
        assert_eq!(play_on(&mut from_counter, &scene, &mut world.clone(), &pickup("Tomato")), [0]);
        let mut from_drawer = grader("ButterKnife", &world);
        assert_eq!(play_on(&mut from_drawer, &scene, &mut world, &pickup("ButterKnife")), [1]);
    }

    #[test]
    fn what_is_put_down_at_the_first_step_is_what_was_in_the_hand() {
        let (scene, mut world) = kitchen();
        for (kind, name) in [(Open, "Cabinet"), (Pickup, "Mug2")] {
            let action = Action::interact(kind, named(&scene, &world, name));
            assert!(rules::apply(&scene, &mut world, action).is_done());
        }
        let roles = [role("Mug"), role("DiningTable")];
        let mut grader = Grader::new(Grading::Class, &roles, &[put_subtask(0, 1)], None, (&scene, &world));
        assert_eq!(play_on(&mut grader, &scene, &mut world, &[(Put, "DiningTable")]), [0]);
        assert_eq!(grader.binding(0), Some(named(&scene, &world, "Mug2")), "the other mug lay there before");
    }

    #[test]
    fn closing_another_door_does_not_complete_the_pickup() {
        let mut grader = by_class(&[role("Potato")], &[closing(subtask(SkillKind::Pickup, 0))]);
        let script = [(Open, "Safe"), (Open, "Fridge"), (Pickup, "Potato"), (Close, "Safe"), (Close, "Fridge")];
        let script = script.map(|(kind, name)| (kind, if name == "Safe" { "Cabinet" } else { name }));
        assert_eq!(play(&mut grader, &script), [4]);
    }

    #[test]
    fn the_mug_that_the_agent_chose_is_the_one_that_counts_afterwards() {
        let roles = [role("Mug"), role("SideTable")];
        let subtasks = [subtask(SkillKind::Pickup, 0), put_subtask(0, 1)];
        let mut grader = by_class(&roles, &subtasks);
        let script = [
            (Open, "Cabinet"),
            (Pickup, "Mug2"),
            (Put, "CounterTop"),
            (Pickup, "Mug"),
            (Put, "SideTable"),
            (Pickup, "Mug2"),
            (Put, "SideTable"),
        ];
        assert_eq!(play(&mut grader, &script), [1, 6]);
        let (scene, world) = kitchen();
        assert_eq!(grader.binding(0), Some(named(&scene, &world, "Mug2")));
    }

    #[test]
    fn two_roles_of_a_class_need_two_things() {
        let roles = [role("Mug"), role("SideTable"), role("Mug")];
        let subtasks =
            [subtask(SkillKind::Pickup, 0), put_subtask(0, 1), subtask(SkillKind::Pickup, 2), put_subtask(2, 1)];
        let mut grader = by_class(&roles, &subtasks);
        let script = [
            (Pickup, "Mug"),
            (Put, "SideTable"),
            (Pickup, "Mug"),
            (Put, "SideTable"),
            (Open, "Cabinet"),
            (Pickup, "Mug2"),
            (Put, "SideTable"),
        ];
        assert_eq!(play(&mut grader, &script), [0, 1, 5, 6]);
    }

    #[test]
    fn things_with_a_place_each_may_come_to_one_or_to_two_tables_and_those_with_one_place_only_to_one() {
        let (scene, world) = kitchen();
        let (mut scene, mut world) = ((*scene).clone(), world);
        let Instance::Fixture(table) = named(&scene, &world, "SideTable") else { panic!("no fixture") };
        let mut second = scene.fixtures[usize::from(table)].clone();
        second.pivot.x -= 3000;
        second.surfaces.iter_mut().flat_map(|surface| &mut surface.areas).for_each(|area| {
            (area.min[0], area.max[0]) = (area.min[0] - 3000, area.max[0] - 3000);
        });
        scene.fixtures.push(second);
        world.fixtures.push(world.fixtures[usize::from(table)]);
        let roles = [role("Mug"), role("SideTable"), role("Tomato"), role("SideTable")];
        let apart = [put_subtask(0, 1), put_subtask(2, 3)];
        let together = [put_subtask(0, 1), put_subtask(2, 1)];
        let script = |table| [(Pickup, "Mug"), (Put, "SideTable"), (Pickup, "Tomato"), (Put, table)];
        for (subtasks, table, done) in [
            (&apart, "SideTable", 2),
            (&apart, "SideTable2", 2),
            (&together, "SideTable", 2),
            (&together, "SideTable2", 1),
        ] {
            let mut grader = by_class(&roles, subtasks);
            assert_eq!(play_on(&mut grader, &scene, &mut world.clone(), &script(table)).len(), done, "{table}");
        }
    }

    #[test]
    fn a_slice_must_be_of_the_apple_that_was_sliced_for_the_task() {
        let roles = [role("Bread"), slice_role("Bread")];
        let mut grader = by_class(&roles, &[subtask(SkillKind::Slice, 0), subtask(SkillKind::Pickup, 1)]);
        let script = [(Pickup, "Knife"), (Slice, "Bread"), (Put, "CounterTop"), (Pickup, "Bread/3")];
        assert_eq!(play(&mut grader, &script), [1, 3]);
        let roles = [role("Apple"), slice_role("Apple")];
        let mut grader = by_class(&roles, &[subtask(SkillKind::Slice, 0), subtask(SkillKind::Pickup, 1)]);
        let script = [
            (Pickup, "Knife"),
            (Slice, "Apple2"),
            (Open, "Fridge"),
            (Slice, "Apple"),
            (Put, "CounterTop"),
            (Pickup, "Apple/1"),
            (Put, "CounterTop"),
            (Pickup, "Apple2/1"),
        ];
        assert_eq!(play(&mut grader, &script), [1, 7]);
    }

    #[test]
    fn heating_is_complete_with_the_close_and_the_hot_thing_in_the_hand() {
        let mut grader = by_class(&[role("Tomato")], &[closing(subtask(SkillKind::Heat, 0))]);
        let script = [
            (Pickup, "Tomato"),
            (Open, "Microwave"),
            (Put, "Microwave"),
            (Close, "Microwave"),
            (ToggleOn, "Microwave"),
            (ToggleOff, "Microwave"),
            (Open, "Microwave"),
            (Pickup, "Tomato"),
            (Close, "Microwave"),
        ];
        assert_eq!(play(&mut grader, &script), [8]);
    }

    #[test]
    fn rinsing_is_complete_with_the_clean_thing_back_in_the_hand() {
        let mut grader = by_class(&[role("Mug")], &[subtask(SkillKind::Clean, 0)]);
        let script = [
            (Pickup, "Mug"),
            (Put, "Sink"),
            (Pickup, "Mug"),
            (Put, "Sink"),
            (ToggleOn, "Faucet"),
            (ToggleOff, "Faucet"),
            (Pickup, "Mug"),
        ];
        assert_eq!(play(&mut grader, &script), [6]);
    }

    #[test]
    fn later_subtasks_are_not_looked_at_before_their_turn() {
        let roles = [role("FloorLamp"), role("Mug")];
        let subtasks = [subtask(SkillKind::Pickup, 1), subtask(SkillKind::Toggle, 0)];
        let mut grader = by_class(&roles, &subtasks);
        assert_eq!(play(&mut grader, &[(ToggleOn, "FloorLamp"), (Pickup, "Mug"), (Put, "SideTable")]), [1, 2]);
    }

    fn recorded(scene: &Scene, world: &World, subtask: Subtask, object: &str, last: Option<&str>) -> Subtask {
        let original = |name: &str| Original { instance: named(scene, world, name), slice: None };
        let literal =
            Literal { needs_close: last.is_some(), object: original(object), last_target: last.map(original) };
        Subtask { literal: Some(literal), ..subtask }
    }

    #[test]
    fn strict_grading_wants_the_experts_own_mug() {
        let (scene, world) = kitchen();
        let wanted = recorded(&scene, &world, subtask(SkillKind::Pickup, 0), "Mug2", None);
        let roles = [role("Mug")];
        let script = [(Pickup, "Mug"), (Put, "SideTable"), (Open, "Cabinet"), (Pickup, "Mug2")];
        let mut strict = Grader::new(Grading::Strict, &roles, std::slice::from_ref(&wanted), None, (&scene, &world));
        assert_eq!(play(&mut strict, &script), [3]);
        let mut class = Grader::new(Grading::Class, &roles, &[wanted], None, (&scene, &world));
        assert_eq!(play(&mut class, &script), [0]);
    }

    #[test]
    fn strict_grading_never_credits_the_close_after_a_put_that_meets_the_whole_goal() {
        let (scene, world) = kitchen();
        let expert = |name: &str| Some(Original { instance: named(&scene, &world, name), slice: None });
        let roles =
            [Role { expert: expert("Tomato"), ..role("Tomato") }, Role { expert: expert("Fridge"), ..role("Fridge") }];
        let put = recorded(&scene, &world, closing(put_subtask(0, 1)), "Tomato", Some("Fridge"));
        let goal = Goal {
            kind: GoalKind::PickAndPlaceSimple,
            object: roles[0].class,
            sliced: false,
            receptacle: Some(roles[1].class),
            movable: None,
            lamp: None,
        };
        let script = [(Pickup, "Tomato"), (Open, "Fridge"), (Put, "Fridge"), (Close, "Fridge")];
        let mut strict =
            Grader::new(Grading::Strict, &roles, std::slice::from_ref(&put), Some(&goal), (&scene, &world));
        assert!(play(&mut strict, &script).is_empty());
        assert!(strict.waits_for(&scene, &world).contains("whole goal is met"));
        let mut class = Grader::new(Grading::Class, &roles, &[put], Some(&goal), (&scene, &world));
        assert_eq!(play(&mut class, &script), [3]);
    }

    #[test]
    fn strict_grading_wants_a_close_after_the_pickup_even_where_the_expert_closed_before_it() {
        let (scene, world) = kitchen();
        let pickup = recorded(&scene, &world, subtask(SkillKind::Pickup, 0), "Laptop", Some("Laptop"));
        let script = [(Close, "Laptop"), (Pickup, "Laptop")];
        let mut strict =
            Grader::new(Grading::Strict, &[role("Laptop")], std::slice::from_ref(&pickup), None, (&scene, &world));
        assert!(play(&mut strict, &script).is_empty());
        let mut class = Grader::new(Grading::Class, &[role("Laptop")], &[pickup], None, (&scene, &world));
        assert_eq!(play(&mut class, &script), [1]);
    }

    #[test]
    fn a_grader_says_in_words_what_it_waits_for() {
        let (scene, mut world) = kitchen();
        let roles = [role("Tomato"), role("Fridge")];
        let mut grader = by_class(&roles, &[closing(put_subtask(0, 1))]);
        assert_eq!(describe(&roles, &grader.subtasks()[0]), "put the tomato in the fridge");
        assert_eq!(grader.waits_for(&scene, &world), "waits for: the tomato in the fridge, then the fridge closed");
        play_on(&mut grader, &scene, &mut world, &[(Pickup, "Tomato"), (Open, "Fridge"), (Put, "Fridge")]);
        assert_eq!(grader.waits_for(&scene, &world), "waits for: the fridge closed");
        play_on(&mut grader, &scene, &mut world, &[(Close, "Fridge")]);
        assert_eq!(grader.waits_for(&scene, &world), "");
    }
}
