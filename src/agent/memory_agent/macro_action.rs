//! What the agent could set out to do: an interaction with a thing that it remembers, with the way to where that is possible; a
//! look from near at what may hold the thing that it is after; a walk to the edge of what it has seen; a turn or a look. Each
//! begins with one of the 12 actions.

use super::goal::Goal;
use super::progress::Progress;
use crate::agent::memory::Memory;
use crate::agent::memory::coverage::Novelty;
use crate::agent::memory::navigator::{Failed, Route, Routes};
use crate::agent::memory::semantic_map::Thing;
use crate::domain::{Action, ActionType, Cell, Class, Heading, Pose};
use crate::house::view::{Candidate, nearest};

/// Evidence of at least this score makes a thing.
pub(crate) const LEAST_SCORE: f32 = 0.3;
/// What a thing's score is multiplied by when it was looked for from every side in vain.
const NOT_THERE: f32 = 0.3;
/// So many ends of ways to one thing are tried at one step.
const ENDS: usize = 8;
/// Ways to the edge of what was seen, and how far their ends lie apart at least, in cells.
const EXPLORATIONS: usize = 2;
const APART: u16 = 4;
/// So many things are offered to be searched at one step, and those of a class are looked at from so many poses.
const SEARCHED: usize = 6;
const GLANCES: usize = 3;
/// How far the camera is tilted down, in degrees, by who walks.
const LEVEL: i16 = 30;
/// Turns after which one has looked all around.
const AROUND: u32 = 3;

/// What is set out to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Purpose {
    /// To act on a thing of this class.
    Interact(ActionType, Class),
    /// To look from near at a thing of this class, in or on which the goal's object may be.
    Search(Class),
    /// To see more of the house.
    Explore,
    /// To turn or look on the spot.
    Look(ActionType),
}

/// Something to set out to, and how it begins.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MacroAction {
    pub(crate) purpose: Purpose,
    /// Which of the remembered things is acted on, where one is remembered.
    pub(crate) thing: Option<usize>,
    /// Steps to where it can be done, with what speaks against the way in steps.
    pub(crate) steps: u32,
    pub(crate) cost: f32,
    /// What is done now.
    pub(crate) first: Action,
    /// Where it is acted, as far as is known.
    pub(crate) at: Option<Cell>,
    /// What the glance at its end would show; of a turn, and of another one in the same direction.
    pub(crate) novelty: [Novelty; 2],
}

impl MacroAction {
    /// Whether it is done by its first action.
    pub(crate) fn is_immediate(&self) -> bool {
        self.first.kind.is_interaction() || matches!(self.purpose, Purpose::Look(_))
    }

    /// Its first action, with the class that it acts on if that is an interaction.
    pub(crate) fn beginning(&self) -> (ActionType, Option<Class>) {
        let class = match self.purpose {
            Purpose::Interact(_, class) if self.first.kind.is_interaction() => Some(class),
            _ => None,
        };
        (self.first.kind, class)
    }

    fn along(purpose: Purpose, thing: Option<usize>, at: Cell, route: Route) -> Option<MacroAction> {
        let first = Action::navigate(route.first?);
        let novelty = Default::default();
        Some(MacroAction { purpose, thing, steps: route.steps, cost: route.cost, first, at: Some(at), novelty })
    }
}

/// Everything that could be set out to now. `legal` are the interactions that are possible at this moment. Poses from which a
/// remembered thing cannot be acted on are added to `failed`, and what cannot be acted on from anywhere loses its evidence.
/// Poses from which things have been searched are added to the progress.
pub(crate) fn available(
    memory: &mut Memory,
    progress: &mut Progress,
    legal: &[Candidate],
    failed: &mut Failed,
) -> (Vec<Thing>, Vec<MacroAction>) {
    let things = memory.map.things(LEAST_SCORE);
    let pose = memory.odometry.pose();
    let routes = Routes::from(&memory.occupancy, pose);
    let mut found = Vec::new();
    for candidate in legal {
        let (kind, class) = (candidate.kind, candidate.class);
        let is_nearest = nearest(legal, kind, class) == Some(candidate);
        if !is_nearest || progress.goal().is_none_or(|goal| !matters(goal, progress, kind, class)) {
            continue;
        }
        let thing = nearest_thing(&things, class, pose.cell);
        let ahead = pose.cell.ahead(pose.heading);
        let at = thing.map_or(ahead, |index| match kind {
            // Where in it the thing will come to lie is not known: most likely not at its edge.
            ActionType::Put => things[index].middle(),
            _ => things[index].best,
        });
        let purpose = Purpose::Interact(kind, class);
        let (first, novelty) = (candidate.action(), Default::default());
        found.push(MacroAction { purpose, thing, steps: 0, cost: 0.0, first, at: Some(at), novelty });
    }
    for (index, thing) in things.iter().enumerate() {
        let Some(goal) = progress.goal() else { break };
        let class = thing.class;
        let wanted: Vec<ActionType> = kinds(thing, progress)
            .filter(|&kind| matters(goal, progress, kind, class))
            .filter(|&kind| {
                let now = found.iter().find(|now| now.purpose == Purpose::Interact(kind, class));
                // What opens may better be faced first: from its side one does not see what lies in it.
                now.is_none_or(|now| {
                    class.info().openable || now.thing != Some(index) && tells_apart(goal, progress, class)
                })
            })
            .collect();
        // The way does not depend on what is done at its end.
        if wanted.is_empty() {
            continue;
        }
        let can_act = legal.iter().any(|candidate| candidate.class == class);
        match way_to(&routes, thing, failed, can_act) {
            Some(route) => found.extend(wanted.iter().filter_map(|&kind| {
                MacroAction::along(Purpose::Interact(kind, class), Some(index), thing.best, route)
            })),
            None if !can_act => memory.map.discredit(class, thing.best, 0.3, NOT_THERE),
            None => {}
        }
    }
    found.extend(searches(&things, progress, &routes));
    found.extend(explorations(memory, &routes));
    let all_known = found.is_empty();
    found.extend(looks(memory, progress, all_known));
    (things, found)
}

/// Whether it matters which thing of a class is taken: one in a named place, or the one that it put down itself. Any will do
/// otherwise, the nearest first.
fn tells_apart(goal: &Goal, progress: &Progress, class: Class) -> bool {
    goal.place.is_some() || progress.placed.iter().any(|(placed, _)| *placed == class)
}

/// A way that does not end here: what could be done here would be possible already. `can_act`: something else can be done here
/// with a thing of the class, so that it is no bad place.
fn way_to(routes: &Routes, thing: &Thing, failed: &mut Failed, can_act: bool) -> Option<Route> {
    let cells: Vec<(Cell, f32)> = thing.cells.iter().map(|(cell, known)| (*cell, known.height)).collect();
    for _ in 0..ENDS {
        let route = routes.plan(thing.class, &cells, failed)?;
        if route.first.is_some() {
            return Some(route);
        }
        if can_act {
            return None;
        }
        failed.insert((thing.class, route.end));
    }
    None
}

fn nearest_thing(things: &[Thing], class: Class, from: Cell) -> Option<usize> {
    let away = |thing: &Thing| {
        let (x, z) = (i32::from(thing.best.x - from.x), i32::from(thing.best.z - from.z));
        x * x + z * z
    };
    let of_class = things.iter().enumerate().filter(|(_, thing)| thing.class == class);
    of_class.min_by_key(|(_, thing)| away(thing)).map(|(index, _)| index)
}

/// What could be done with a thing as it is remembered.
fn kinds(thing: &Thing, progress: &Progress) -> impl Iterator<Item = ActionType> {
    let info = thing.class.info();
    let near = |cell: &Cell| cell.apart(thing.best) <= 2;
    let by_own_hand = progress.active.iter().any(|(class, cell)| *class == thing.class && near(cell));
    let (open, shut) = (by_own_hand || thing.open > 0.4, !by_own_hand && thing.open < 0.6);
    let empty = progress.held.is_none();
    let armed = progress.held.is_some_and(Class::is_knife);
    [
        (ActionType::Pickup, info.pickupable && empty),
        (ActionType::Put, info.receptacle && !empty && (!info.openable || open)),
        (ActionType::Open, info.openable && shut),
        (ActionType::Close, info.openable && open),
        (ActionType::ToggleOn, info.toggleable && (shut || info.openable)),
        (ActionType::ToggleOff, info.toggleable && open),
        (ActionType::Slice, info.slices > 0 && armed),
    ]
    .into_iter()
    .filter(|(_, possible)| *possible)
    .map(|(kind, _)| kind)
}

/// Whether an interaction can have anything to do with the goal.
fn matters(goal: &Goal, progress: &Progress, kind: ActionType, class: Class) -> bool {
    let named = goal.is_object(class) || goal.receptacle == Some(class);
    match kind {
        ActionType::Pickup => named || goal.is_tool(class),
        ActionType::Slice => goal.is_object(class),
        ActionType::ToggleOn | ActionType::ToggleOff => named || goal.is_tool(class),
        // Whatever is in the hand may have to be laid down anywhere, and a thing may be in anything that opens.
        ActionType::Put => progress.held.is_some(),
        _ => true,
    }
}

/// Ways to look from near at what may hold the goal's object, the nearest things first.
fn searches(things: &[Thing], progress: &mut Progress, routes: &Routes) -> Vec<MacroAction> {
    let Some(goal) = progress.goal().filter(|goal| progress.held != Some(goal.object)) else { return Vec::new() };
    let (object, place) = (goal.object, goal.place);
    let may_hold = |thing: &&(usize, &Thing)| {
        let class = thing.1.class;
        let looked = progress.searched.iter().filter(|(of, _)| *of == class).count();
        let shows = class.info().receptacle && !class.info().openable && !class.info().pickupable;
        shows && looked < GLANCES && (place == Some(class) || class.holds(object))
    };
    let mut candidates: Vec<(usize, &Thing)> = things.iter().enumerate().filter(|thing| may_hold(&thing)).collect();
    candidates
        .sort_by_key(|(index, thing)| (place != Some(thing.class), thing.best.apart(routes.start().cell), *index));
    let ways = candidates.into_iter().take(SEARCHED).filter_map(|(index, thing)| {
        let route = way_to(routes, thing, &mut progress.searched, false)?;
        MacroAction::along(Purpose::Search(thing.class), Some(index), thing.best, route)
    });
    ways.collect()
}

/// Turns to what was not looked at yet, or to anything when `all_known` leaves nothing else; looks up, and down to what is near
/// and was not looked at.
fn looks(memory: &Memory, progress: &Progress, all_known: bool) -> Vec<MacroAction> {
    use ActionType::{LookDown, LookUp, RotateLeft, RotateRight};
    let pose = memory.odometry.pose();
    let novelty = |pose: Pose| Novelty::of(&memory.occupancy, pose);
    let turned = [pose.heading.left(), pose.heading.left().left(), pose.heading.right()];
    let [left, behind, right] = turned.map(|heading| novelty(Pose { heading, ..pose }));
    let tilted = |by: i16| novelty(Pose { horizon: (pose.horizon + by).clamp(Pose::UP, Pose::DOWN), ..pose });
    // With what was in view at first, three turns show everything around.
    let turns = |novelty: [Novelty; 2]| {
        all_known || progress.turns < AROUND && novelty.into_iter().any(Novelty::is_worth_a_glance)
    };
    let below = [1, 2].map(|times| tilted(times * Pose::LOOK));
    let down = pose.horizon < LEVEL || pose.horizon < Pose::DOWN && below.into_iter().any(Novelty::is_worth_a_glance);
    let up = pose.horizon >= LEVEL || all_known && pose.horizon > Pose::UP;
    [
        (RotateLeft, turns([left, behind]), [left, behind]),
        (RotateRight, turns([right, behind]), [right, behind]),
        (LookUp, up, Default::default()),
        (LookDown, down, below),
    ]
    .into_iter()
    .filter(|(_, possible, _)| *possible)
    .map(|(kind, _, novelty)| {
        let (purpose, first) = (Purpose::Look(kind), Action::navigate(kind));
        MacroAction { purpose, thing: None, steps: 1, cost: 1.0, first, at: None, novelty }
    })
    .collect()
}

/// Ways to free cells next to what is not known, the nearest first.
fn explorations(memory: &Memory, routes: &Routes) -> Vec<MacroAction> {
    let mut ways: Vec<(Cell, Route)> =
        memory.occupancy.frontier().filter_map(|cell| Some((cell, routes.to_cell(cell)?))).collect();
    ways.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost).then(a.0.cmp(&b.0)));
    let mut chosen: Vec<Cell> = Vec::new();
    let mut found = Vec::new();
    for (cell, route) in ways {
        let apart = |other: &Cell| other.apart(cell) >= APART;
        if found.len() < EXPLORATIONS
            && chosen.iter().all(apart)
            && let Some(way) = MacroAction::along(Purpose::Explore, None, cell, route)
        {
            let glances =
                Heading::ALL.map(|heading| Novelty::of(&memory.occupancy, Pose { cell, heading, ..route.end }));
            let best = glances.into_iter().max_by(|a, b| a.unseen.total_cmp(&b.unseen)).unwrap_or_default();
            chosen.push(cell);
            found.push(MacroAction { novelty: [best, Novelty::default()], ..way });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::memory::semantic_map::Evidence;
    use crate::agent::memory_agent::eyes::Eyes;
    use crate::agent::memory_agent::mind::{Mind, Moment};
    use crate::domain::SkillKind;
    use crate::domain::world::{Object, Parent};
    use crate::house::House;
    use crate::house::testing::kitchen;

    fn class(name: &str) -> Class {
        Class::named(name).unwrap()
    }

    fn goal(skill: SkillKind, object: &str, receptacle: Option<&str>) -> Goal {
        let receptacle = receptacle.map(class);
        Goal { skill, object: class(object), others: Vec::new(), receptacle, place: None, slice: false }
    }

    fn possible(name: &str, open: f32, held: Option<&str>) -> Vec<ActionType> {
        let known = Evidence { score: 0.9, open, ..Evidence::default() };
        let thing = Thing {
            class: class(name),
            cells: vec![(Cell::new(0, 0), known)],
            best: Cell::new(0, 0),
            score: 0.9,
            height: 1.0,
            seen: 0,
            open,
        };
        kinds(&thing, &Progress { held: held.map(class), ..Progress::default() }).collect()
    }

    #[test]
    fn what_can_be_done_with_a_thing_follows_from_its_kind_its_state_and_the_hand() {
        use ActionType::{Close, Open, Pickup, Put, Slice, ToggleOff, ToggleOn};
        assert_eq!(possible("Mug", 0.0, None), [Pickup]);
        assert_eq!(possible("Mug", 0.0, Some("Spoon")), [Put]);
        assert_eq!(possible("Fridge", 0.1, Some("Apple")), [Open]);
        assert_eq!(possible("Fridge", 0.9, Some("Apple")), [Put, Close]);
        assert_eq!(possible("FloorLamp", 0.0, None), [ToggleOn]);
        assert_eq!(possible("Apple", 0.0, Some("Knife")), [Slice]);
        assert_eq!(possible("Microwave", 0.5, None), [Open, Close, ToggleOn, ToggleOff]);
    }

    #[test]
    fn only_what_can_have_to_do_with_the_goal_is_set_out_to() {
        let put = goal(SkillKind::Put, "Mug", Some("Sink"));
        let heat = goal(SkillKind::Heat, "Potato", None);
        let empty = Progress::default();
        let full = Progress { held: Some(class("Book")), ..Progress::default() };
        assert!(matters(&put, &empty, ActionType::Pickup, class("Mug")));
        assert!(!matters(&put, &empty, ActionType::Pickup, class("Spoon")));
        assert!(matters(&heat, &empty, ActionType::ToggleOn, class("Microwave")));
        assert!(!matters(&heat, &empty, ActionType::ToggleOn, class("FloorLamp")));
        assert!(matters(&heat, &empty, ActionType::Open, class("Drawer")), "the potato may be in it");
        assert!(matters(&heat, &full, ActionType::Put, class("CounterTop")), "the hand must be freed");
    }

    /// A mind in the kitchen that has looked around once, and the house.
    fn looked_around(goal: Goal) -> (Mind, House) {
        let (scene, world) = kitchen();
        let mut house = House::new(scene, world);
        let mut mind = Mind::default();
        mind.set_goals(vec![goal]);
        for _ in 0..4 {
            observe(&mut mind, &mut house);
            house.step(Action::navigate(ActionType::RotateRight));
        }
        (mind, house)
    }

    fn observe(mind: &mut Mind, house: &mut House) {
        let (scene, world) = (house.scene().clone(), house.world().clone());
        let frame = house.frame().clone();
        let seen = Eyes::Simulator.look_at(&scene, &world, &frame).unwrap();
        let legal = house.candidates();
        mind.observe(&Moment { pose: world.agent, frame: &frame, seen: &seen, legal: &legal });
    }

    #[test]
    fn what_is_not_seen_is_searched_where_it_may_lie_from_a_few_poses_and_then_no_more() {
        let (mut mind, mut house) = looked_around(goal(SkillKind::Pickup, "Vase", None));
        let searches = |mind: &mut Mind, house: &mut House| {
            let (actions, _) = mind.choice(&house.candidates());
            actions.into_iter().filter(|it| matches!(it.purpose, Purpose::Search(_))).collect::<Vec<_>>()
        };
        let first = searches(&mut mind, &mut house);
        assert!(!first.is_empty() && first.len() <= SEARCHED, "{first:?}");
        for search in &first {
            let Purpose::Search(class) = search.purpose else { panic!("{search:?}") };
            assert!(class.info().receptacle && !class.info().openable && !search.first.kind.is_interaction());
        }
        for step in 0..60 {
            let Some(next) = searches(&mut mind, &mut house).into_iter().next() else { return };
            house.step(next.first);
            observe(&mut mind, &mut house);
            assert!(step < 59, "it searches for ever: {next:?}");
        }
    }

    #[test]
    fn one_turns_to_what_was_not_looked_at_and_tilts_down_to_what_lies_below_the_frame() {
        let (mind, _) = looked_around(goal(SkillKind::Pickup, "Vase", None));
        let look = |mind: &Mind, kind| {
            let all = looks(&mind.memory, &mind.progress, false);
            all.into_iter().find(|it| it.first.kind == kind).map(|it| it.novelty[0].unseen)
        };
        let fresh = look(&Mind::default(), ActionType::RotateRight);
        assert!(fresh.is_some_and(|unseen| unseen > 0.4), "nothing is known yet: {fresh:?}");
        let known = look(&mind, ActionType::RotateRight);
        assert!(known.is_none_or(|unseen| unseen < 0.3), "it has looked there: {known:?}");
        let below = look(&mind, ActionType::LookDown);
        assert!(below.is_some_and(|unseen| unseen > 0.0), "what is near and low has not been seen: {below:?}");
    }

    #[test]
    fn whoever_starts_with_a_full_hand_can_put_down_what_is_in_it() {
        let (scene, mut world) = kitchen();
        world.objects.push(Object { class: class("Book"), parent: Parent::Hand, ..Object::default() });
        world.held = Some(world.objects.len() as u16 - 1);
        let mut house = House::new(scene, world);
        let mut mind = Mind::default();
        mind.set_goals(vec![goal(SkillKind::Put, "Book", Some("CounterTop"))]);
        for _ in 0..4 {
            let (scene, world) = (house.scene().clone(), house.world().clone());
            let frame = house.frame().clone();
            let seen = Eyes::Simulator.look_at(&scene, &world, &frame).unwrap();
            let legal = house.candidates();
            mind.observe(&Moment { pose: world.agent, frame: &frame, seen: &seen, legal: &legal });
            house.step(Action::navigate(ActionType::RotateRight));
        }
        assert_eq!(mind.progress.held, Some(class("Book")), "the goal says what it is");
        let (actions, choice) = mind.choice(&house.candidates());
        let puts = |it: &&MacroAction| it.purpose == Purpose::Interact(ActionType::Put, class("CounterTop"));
        assert!(actions.iter().any(|it| puts(&it)), "{actions:?}");
        assert!(!actions.iter().any(|it| matches!(it.purpose, Purpose::Interact(ActionType::Pickup, _))));
        assert_eq!(choice.len(), actions.len());
    }
}
