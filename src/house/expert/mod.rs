//! The expert: shortest paths and interactions for any task in any scene, from any state.

pub(crate) mod demonstrate;
pub(crate) mod interaction_pose;
pub(crate) mod no_way;
pub(crate) mod paths;
pub(crate) mod plan;

use std::collections::VecDeque;
use std::sync::Arc;

use super::grading::{Grader, describe};
use super::rules;
use super::session::House;
use super::view;
use crate::domain::{Action, ActionType, Pose, Scene, World};
pub(crate) use demonstrate::demonstrate;
use interaction_pose::{InteractionPose, PoseSearch, WELL_SEEN};
use no_way::NoWay;
use paths::{Paths, Turning, WalkableCells};
use plan::Intent;

/// How far the expert goes out of its way to shut what stands open, in steps.
const TIDY_STEPS: u32 = 3;

/// How an expert goes about what can be done in several equally good ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TurnTiming {
    /// Turns as late as it may and acts where its target is seen best.
    Late,
    /// Turns as soon as it may and acts as soon as its target is at hand. Who learns from it and does not know exactly where
    /// it stands need not hit the last moment for either.
    Early,
}

/// Plans from the present state, keeps to the plan while the world goes as expected, and plans anew when it does not.
pub struct Expert {
    timing: TurnTiming,
    poses: PoseSearch,
    scene: Option<(Arc<Scene>, WalkableCells)>,
    plan: VecDeque<Action>,
    /// The world in which the next step of the plan is to be taken, and how far the task was.
    expected: Option<(World, usize)>,
    /// The last choice.
    last: Option<Action>,
}

/// What an expert is about to do, so that it can be restored.
#[derive(Clone, Debug, Default)]
pub struct ExpertState {
    steps: VecDeque<Action>,
    expected: Option<(World, usize)>,
    last: Option<Action>,
}

impl Default for Expert {
    fn default() -> Expert {
        Expert::new()
    }
}

impl Expert {
    /// An expert without a plan that turns late.
    pub fn new() -> Expert {
        Expert::of(TurnTiming::Late)
    }

    /// An expert without a plan.
    pub(crate) fn of(timing: TurnTiming) -> Expert {
        Expert { timing, poses: PoseSearch::new(), scene: None, plan: VecDeque::new(), expected: None, last: None }
    }

    /// Drops the plan: a new episode starts.
    pub(crate) fn reset(&mut self) {
        self.plan.clear();
        self.expected = None;
    }

    /// Its plan, to be restored later.
    pub(crate) fn state(&self) -> ExpertState {
        ExpertState { steps: self.plan.clone(), expected: self.expected.clone(), last: self.last }
    }

    /// Continues with a plan that it had at another time in this scene.
    pub(crate) fn restore(&mut self, state: ExpertState) {
        ExpertState { steps: self.plan, expected: self.expected, last: self.last } = state;
    }

    /// The next action for the grader's current subtask.
    ///
    /// # Errors
    /// When nothing brings the subtask forward, in words.
    pub fn next(&mut self, house: &mut House, grader: &Grader) -> Result<Action, NoWay> {
        let scene = Arc::clone(house.scene());
        let world = house.world();
        let as_expected = matches!(&self.expected, Some((expected, completed))
            if *completed == grader.completed() && expected == world);
        let same_scene = self.enter(&scene);
        if !(as_expected && same_scene) || self.plan.is_empty() {
            self.poses.set_world(world, same_scene);
            self.plan = self.plan_from(&scene, world, grader)?.into();
        }
        if self.timing == TurnTiming::Early
            && let Some(&aim) = self.plan.back()
            && is_at_hand(house, aim)
        {
            self.plan = [aim].into();
        }
        let world = house.world();
        let action = self.plan.pop_front().ok_or(NoWay::Finished)?;
        let mut after = world.clone();
        rules::apply(&scene, &mut after, action);
        self.expected = Some((after, grader.completed()));
        self.last = Some(action);
        Ok(action)
    }

    /// The interaction that the last choice was, or leads to.
    pub(crate) fn aim(&self) -> Option<Action> {
        self.plan.back().copied().or(self.last)
    }

    /// Turns to a scene; whether it is the one of the last step.
    fn enter(&mut self, scene: &Arc<Scene>) -> bool {
        let same = matches!(&self.scene, Some((known, _)) if Arc::ptr_eq(known, scene));
        if !same {
            self.scene = Some((Arc::clone(scene), WalkableCells::of(scene)));
            self.plan.clear();
        }
        same
    }

    /// The actions up to and with the next interaction.
    fn plan_from(&mut self, scene: &Scene, world: &World, grader: &Grader) -> Result<Vec<Action>, NoWay> {
        let intent = plan::intent(scene, world, grader)?;
        let Some((_, floor)) = &self.scene else { return Err(NoWay::Finished) };
        let turning = if self.timing == TurnTiming::Early { Turning::Early } else { Turning::Late };
        let paths = Paths::from(floor, world.agent, turning);
        let left = plan::left_open(scene, world, &intent);
        if !left.is_empty()
            && let Some(stand) = self.poses.find(scene, floor, &paths, &left, Some(TIDY_STEPS))
        {
            return Ok(actions(&paths, &left, stand));
        }
        let Intent { aims, .. } = intent;
        if aims.is_empty() {
            return Ok(vec![Action::navigate(any_look(world.agent))]);
        }
        let Some(stand) = self.poses.find(scene, floor, &paths, &aims, None) else {
            let subtask = grader.subtask().map(|subtask| describe(grader.roles(), subtask)).unwrap_or_default();
            return Err(NoWay::NoStand { subtask });
        };
        Ok(actions(&paths, &aims, stand))
    }
}

/// Whether an interaction would be carried out now, chosen by its class as agents choose it, with its target well in view.
fn is_at_hand(house: &mut House, aim: Action) -> bool {
    let Some(target) = aim.target else { return false };
    let Some(class) = house.world().class_of(house.scene(), target) else { return false };
    let seen = house.view().sighting(target).is_some_and(|sighting| sighting.pixels >= WELL_SEEN);
    let candidates = house.candidates();
    seen && view::nearest(&candidates, aim.kind, class).is_some_and(|chosen| chosen.instance == target)
}

/// A step that is always possible.
fn any_look(pose: Pose) -> ActionType {
    if pose.horizon < Pose::DOWN { ActionType::LookDown } else { ActionType::LookUp }
}

fn actions(paths: &Paths, aims: &[plan::Aim], stand: InteractionPose) -> Vec<Action> {
    let way = paths.to(stand.cell, stand.pose).into_iter().map(Action::navigate);
    let aim = &aims[stand.aim];
    way.chain([Action::interact(aim.kind, aim.target)]).collect()
}

#[cfg(test)]
mod tests {
    use super::super::grading::Grading;
    use super::super::testing::{
        closing, demonstrate, interactions, kitchen, kitchen_house, named, put_subtask, role, slice_role, subtask,
    };
    use super::*;
    use crate::domain::skill::{Role, SkillKind, Subtask};
    use crate::domain::world::Instance;
    use crate::house::Outcome;
    use ActionType::{Close, Open, Pickup, Put, Slice, ToggleOff, ToggleOn};

    fn solve(house: &mut House, roles: &[Role], subtasks: &[Subtask]) -> Vec<Action> {
        let mut grader = Grader::new(Grading::Class, roles, subtasks, None, (house.scene(), house.world()));
        demonstrate(house, &mut grader, 200).unwrap()
    }

    #[test]
    fn a_pickup_out_of_the_fridge_opens_and_closes_it() {
        let done = solve(&mut kitchen_house(), &[role("Potato")], &[closing(subtask(SkillKind::Pickup, 0))]);
        assert_eq!(interactions(&done), [Open, Pickup, Close]);
    }

    #[test]
    fn heating_follows_alfreds_order_of_interactions() {
        let roles = [role("Tomato")];
        let done =
            solve(&mut kitchen_house(), &roles, &[subtask(SkillKind::Pickup, 0), closing(subtask(SkillKind::Heat, 0))]);
        assert_eq!(interactions(&done), [Pickup, Open, Put, Close, ToggleOn, ToggleOff, Open, Pickup, Close]);
    }

    #[test]
    fn cooling_and_rinsing_follow_alfreds_order_of_interactions() {
        let roles = [role("Mug")];
        let cool = [subtask(SkillKind::Pickup, 0), closing(subtask(SkillKind::Cool, 0))];
        let done = solve(&mut kitchen_house(), &roles, &cool);
        assert_eq!(interactions(&done), [Pickup, Open, Put, Close, Open, Pickup, Close]);
        let rinse = [subtask(SkillKind::Pickup, 0), subtask(SkillKind::Clean, 0)];
        let done = solve(&mut kitchen_house(), &roles, &rinse);
        assert_eq!(interactions(&done), [Pickup, Put, ToggleOn, ToggleOff, Pickup]);
    }

    #[test]
    fn a_slice_of_bread_is_cut_and_put_into_the_cabinet() {
        let roles = [role("Knife"), role("Bread"), role("CounterTop"), slice_role("Bread"), role("Cabinet")];
        let subtasks = [
            subtask(SkillKind::Pickup, 0),
            subtask(SkillKind::Slice, 1),
            put_subtask(0, 2),
            subtask(SkillKind::Pickup, 3),
            closing(put_subtask(3, 4)),
        ];
        let done = solve(&mut kitchen_house(), &roles, &subtasks);
        assert_eq!(interactions(&done), [Pickup, Slice, Put, Pickup, Open, Put, Close]);
    }

    #[test]
    fn the_hand_is_emptied_before_something_else_is_fetched() {
        let mut house = kitchen_house();
        solve(&mut house, &[role("Tomato")], &[subtask(SkillKind::Pickup, 0)]);
        let done = solve(&mut house, &[role("Spoon")], &[subtask(SkillKind::Pickup, 0)]);
        assert_eq!(interactions(&done), [Put, Pickup]);
    }

    #[test]
    fn a_microwave_that_was_left_running_is_stopped_first() {
        let mut house = kitchen_house();
        let mut world = house.world().clone();
        let Instance::Fixture(oven) = named(house.scene(), &world, "Microwave") else { panic!("no microwave") };
        world.fixtures[usize::from(oven)].on = true;
        house.restore(world);
        let done = solve(&mut house, &[role("Tomato")], &[closing(subtask(SkillKind::Heat, 0))]);
        assert_eq!(
            interactions(&done),
            [Pickup, ToggleOff, Open, Put, Close, ToggleOn, ToggleOff, Open, Pickup, Close]
        );
    }

    #[test]
    fn from_wherever_chance_leads_the_task_is_still_done() {
        use rand::{Rng, SeedableRng};
        let roles = [role("Mug"), role("Fridge"), role("FloorLamp"), role("Apple")];
        let subtasks = [
            subtask(SkillKind::Clean, 0),
            closing(put_subtask(0, 1)),
            subtask(SkillKind::Toggle, 2),
            closing(subtask(SkillKind::Heat, 3)),
        ];
        for seed in 0..10 {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let mut house = kitchen_house();
            let mut grader = Grader::new(Grading::Class, &roles, &subtasks, None, (house.scene(), house.world()));
            let mut expert = Expert::new();
            for _ in 0..400 {
                if grader.is_done() {
                    break;
                }
                // The expert chooses three steps of four, chance the fourth.
                let candidates = house.candidates();
                let action = match rng.random_range(0..8) {
                    0 if !candidates.is_empty() => candidates[rng.random_range(0..candidates.len())].action(),
                    1 => Action::navigate(ActionType::ALL[rng.random_range(0..5)]),
                    _ => expert.next(&mut house, &grader).unwrap(),
                };
                let outcome = house.step(action);
                let (scene, world) = (house.scene().clone(), house.world().clone());
                grader.observe(&scene, &world, action, outcome);
            }
            let waits = grader.waits_for(house.scene(), house.world());
            assert!(grader.is_done(), "seed {seed}: {waits}");
        }
    }

    #[test]
    fn every_interaction_is_the_one_that_its_class_would_choose() {
        let mut house = kitchen_house();
        let roles = [role("Apple"), role("Fridge")];
        let mut grader = Grader::new(
            Grading::Class,
            &roles,
            &[closing(subtask(SkillKind::Heat, 0)), closing(put_subtask(0, 1))],
            None,
            (house.scene(), house.world()),
        );
        let mut expert = Expert::new();
        while !grader.is_done() {
            let action = expert.next(&mut house, &grader).unwrap();
            if let Some(target) = action.target {
                let class = house.world().class_of(house.scene(), target).unwrap();
                let candidates = house.candidates();
                let chosen = super::super::view::nearest(&candidates, action.kind, class).unwrap();
                assert_eq!(chosen.instance, target);
            }
            let outcome = house.step(action);
            assert_eq!(outcome, Outcome::Done, "{action:?}");
            let (scene, world) = (house.scene().clone(), house.world().clone());
            grader.observe(&scene, &world, action, outcome);
        }
    }

    #[test]
    fn a_path_is_as_long_as_the_walk_around_the_table() {
        let (scene, world) = kitchen();
        let floor = WalkableCells::of(&scene);
        let paths = Paths::from(&floor, world.agent, Turning::Late);
        let steps_to = |x, z| {
            let cell = floor.cells().binary_search(&crate::domain::Cell::new(x, z)).unwrap();
            crate::domain::Heading::ALL.iter().filter_map(|&heading| paths.steps(cell, heading)).min()
        };
        assert_eq!(steps_to(6, 2), Some(0));
        assert_eq!(steps_to(6, 8), Some(6));
        assert_eq!(steps_to(7, 8), Some(8), "six ahead, a turn, one ahead");
    }

    #[test]
    fn an_early_turning_expert_turns_at_the_first_of_equally_short_ways() {
        let (scene, world) = kitchen();
        let floor = WalkableCells::of(&scene);
        let end = Pose { cell: crate::domain::Cell::new(7, 8), ..world.agent };
        let cell = floor.cells().binary_search(&end.cell).unwrap();
        let ways =
            [Turning::Late, Turning::Early].map(|turning| Paths::from(&floor, world.agent, turning).to(cell, end));
        assert_eq!(ways[0].len(), ways[1].len());
        let ahead = ways.map(|way| way.iter().take_while(|&&kind| kind == ActionType::MoveAhead).count());
        assert!(ahead[0] > ahead[1], "{ahead:?}");
    }

    #[test]
    fn an_early_turning_expert_walks_less_far_before_its_first_turn() {
        use crate::domain::{Room, task::SceneRef};
        use crate::house::generate;
        use rand::SeedableRng;
        let walked = |timing: TurnTiming| {
            let ahead = |seed: u64| {
                let (scene, world) = generate::house(Room::LivingRoom, seed);
                let (scene, reference) = (Arc::new(scene), SceneRef::Generated { room: Room::LivingRoom, seed });
                let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
                let task = generate::task(&scene, &world, reference, 1, &mut rng).unwrap();
                let mut house = House::new(scene, task.start.clone().unwrap_or(world));
                let grader =
                    Grader::new(Grading::Class, &task.roles, &task.subtasks, None, (house.scene(), house.world()));
                let mut expert = Expert::of(timing);
                let first = expert.next(&mut house, &grader).unwrap();
                let way = std::iter::once(first).chain(expert.state().steps);
                way.take_while(|action| action.kind == ActionType::MoveAhead).count()
            };
            (0..8).map(ahead).sum::<usize>()
        };
        let (prompt, steady) = (walked(TurnTiming::Early), walked(TurnTiming::Late));
        assert!(prompt < steady, "{prompt} steps, {steady} of the steady one");
    }

    #[test]
    fn what_is_not_there_is_refused_in_words() {
        let mut house = kitchen_house();
        let grader = Grader::new(
            Grading::Class,
            &[role("Watch")],
            &[subtask(SkillKind::Pickup, 0)],
            None,
            (house.scene(), house.world()),
        );
        let no_way = Expert::new().next(&mut house, &grader).unwrap_err();
        assert_eq!(no_way.to_string(), "there is no way to pick up the watch: nothing here would serve for it");
    }
}
