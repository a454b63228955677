//! Why a thing can be acted on now, or cannot: what the inspector says of everything in a house.

use super::exploration::SessionSnapshot;
use crate::domain::world::Parent;
use crate::domain::{Action, ActionType, Class, Instance, Scene, World};
use crate::house::{rules, view};

/// A thing, as the inspector shows it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Thing {
    /// Which fixture or object of the house.
    pub(crate) instance: Instance,
    /// The class that the agent knows it by.
    pub(crate) class: Class,
    /// Its state in words: open, on, clean, ...
    pub(crate) state: String,
    /// What holds it.
    pub(crate) place: String,
    /// How far away it is, in metres, horizontally.
    pub(crate) metres: f32,
    /// It is in view.
    pub(crate) seen: bool,
    /// What could be done to it now.
    pub(crate) possible: Vec<ActionType>,
    /// For every other interaction that its class knows, why not.
    pub(crate) impossible: Vec<(ActionType, String)>,
}

impl Thing {
    /// The verdict in a few words.
    pub(crate) fn verdict(&self) -> String {
        if !self.possible.is_empty() {
            return self.possible.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
        }
        match self.impossible.first() {
            Some((kind, reason)) => format!("no {kind}: {reason}"),
            None => "nothing is ever done to it".into(),
        }
    }
}

/// Everything in the house: what can be acted on first, then what is in view, the nearest first.
pub(crate) fn things(now: &SessionSnapshot) -> Vec<Thing> {
    let fixtures = (0..now.scene.fixtures.len() as u16).map(Instance::Fixture);
    let objects = (0..now.world.objects.len() as u16).map(Instance::Object);
    let mut found: Vec<Thing> = fixtures.chain(objects).filter_map(|instance| thing(now, instance)).collect();
    found.sort_by(|a, b| {
        let rank = |thing: &Thing| (thing.possible.is_empty(), !thing.seen);
        rank(a).cmp(&rank(b)).then(a.metres.total_cmp(&b.metres))
    });
    found
}

fn thing(now: &SessionSnapshot, instance: Instance) -> Option<Thing> {
    let (scene, world) = (&now.scene, &now.world);
    let class = world.class_of(scene, instance)?;
    let reachable = view::reachable(scene, world, &now.view, instance);
    let (mut possible, mut impossible) = (Vec::new(), Vec::new());
    for kind in ActionType::ALL.into_iter().filter(|kind| applies(*kind, class, now)) {
        let may = rules::check(scene, world, Action::interact(kind, instance));
        match may.and(reachable) {
            Ok(()) if class.in_vocabulary() => possible.push(kind),
            Ok(()) => impossible.push((kind, "the agent has no word for it".into())),
            Err(reason) => impossible.push((kind, reason.to_string())),
        }
    }
    if class.info().receptacle && world.held.is_none() {
        impossible.push((ActionType::Put, "the hand is empty".into()));
    }
    Some(Thing {
        instance,
        class,
        state: state(now, instance),
        place: place(scene, world, instance),
        metres: view::distance(scene, world, instance).unwrap_or(0.0) / 1000.0,
        seen: now.view.sighting(instance).is_some(),
        possible,
        impossible,
    })
}

/// Whether an interaction makes sense for a class, whatever its state. The likeliest reason to ask comes first in the order of
/// actions.
fn applies(kind: ActionType, class: Class, now: &SessionSnapshot) -> bool {
    let info = class.info();
    match kind {
        ActionType::Pickup => info.pickupable,
        ActionType::Put => info.receptacle && now.world.held.is_some(),
        ActionType::Open | ActionType::Close => info.openable,
        ActionType::ToggleOn | ActionType::ToggleOff => info.toggleable,
        ActionType::Slice => info.slices > 0,
        _ => false,
    }
}

/// The state of a thing in words, where it differs from the usual.
pub(crate) fn state(now: &SessionSnapshot, instance: Instance) -> String {
    let mut words = Vec::new();
    if now.world.is_open(instance) {
        words.push("open");
    }
    if now.world.is_on(instance) {
        words.push("on");
    }
    if let Instance::Object(index) = instance
        && let Some(object) = now.world.object(index)
    {
        for (is, word) in [
            (object.slice_of.is_some(), "a slice"),
            (object.sliced, "cut up"),
            (object.clean, "clean"),
            (object.hot, "hot"),
            (object.cold, "cold"),
        ] {
            if is {
                words.push(word);
            }
        }
    }
    words.join(", ")
}

fn place(scene: &Scene, world: &World, instance: Instance) -> String {
    let Instance::Object(index) = instance else { return String::new() };
    match world.object(index).map(|object| object.parent) {
        Some(Parent::Hand) => "in the hand".into(),
        Some(Parent::In(container)) => {
            let class = world.class_of(scene, container);
            class.map_or_else(String::new, |class| format!("on/in {}", class.spoken()))
        }
        Some(Parent::Floor) => "on the floor".into(),
        None => String::new(),
    }
}

/// Where the agent stands and looks, and what it holds.
pub(crate) fn stands(scene: &Scene, world: &World) -> String {
    let pose = world.agent;
    let held = world.held.and_then(|held| world.class_of(scene, Instance::Object(held)));
    let hand = held.map_or("the hand is empty".to_string(), |class| format!("holds the {}", class.spoken()));
    format!("cell {},{} facing {}, {hand}", pose.cell.x, pose.cell.z, pose.heading.name())
}

/// What is different in another state of the same house, the agent's place aside.
pub(crate) fn changes(scene: &Scene, before: &World, after: &World) -> Vec<String> {
    let fixtures = (0..scene.fixtures.len() as u16).map(Instance::Fixture);
    let objects = (0..after.objects.len() as u16).map(Instance::Object);
    let mut found = Vec::new();
    for instance in fixtures.chain(objects) {
        let Some(class) = after.class_of(scene, instance) else { continue };
        let mut add = |was: bool, is: bool, [off, on]: [&str; 2]| {
            if was != is {
                found.push(format!("{} {}", class.spoken(), if is { on } else { off }));
            }
        };
        add(before.is_open(instance), after.is_open(instance), ["shut", "open"]);
        add(before.is_on(instance), after.is_on(instance), ["off", "on"]);
        let Instance::Object(index) = instance else { continue };
        let (Some(was), Some(is)) = (before.object(index), after.object(index)) else {
            found.push(format!("{} there", class.spoken()));
            continue;
        };
        add(was.sliced, is.sliced, ["whole", "cut up"]);
        add(was.clean, is.clean, ["dirty", "clean"]);
        add(was.hot, is.hot, ["no longer hot", "hot"]);
        add(was.cold, is.cold, ["no longer cold", "cold"]);
        if was.parent != is.parent {
            found.push(format!("{} {}", class.spoken(), place(scene, after, instance)));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explore::testing;

    #[test]
    fn another_state_is_told_by_what_changed() {
        let mut exploration = testing::exploration();
        exploration.choose(crate::agent::registry::PolicyKind::Expert).unwrap();
        let start = exploration.snapshot();
        while exploration.progress().unwrap().completed_at.is_empty() {
            exploration.step().unwrap();
        }
        let now = exploration.snapshot();
        assert!(stands(&now.scene, &start.world).ends_with("the hand is empty"));
        assert!(stands(&now.scene, &now.world).ends_with("holds the mug"));
        assert!(changes(&now.scene, &start.world, &now.world).contains(&"mug in the hand".to_string()));
        assert!(changes(&now.scene, &now.world, &now.world).is_empty());
    }

    #[test]
    fn every_thing_says_what_can_be_done_or_why_not() {
        let mut exploration = testing::exploration();
        let now = exploration.snapshot();
        let things = things(&now);
        assert_eq!(things.len(), now.scene.fixtures.len() + now.world.objects.len());
        let could: usize = things.iter().map(|thing| thing.possible.len()).sum();
        assert_eq!(could, now.candidates.len(), "what is possible here is what is a candidate there");
        let table = things.iter().find(|thing| thing.class.name() == "DiningTable").unwrap();
        assert_eq!(table.verdict(), "no Put: the hand is empty", "a place for things is of use, if not now");
        let first_without = things.iter().position(|thing| thing.possible.is_empty()).unwrap();
        assert!(things[first_without..].iter().all(|thing| thing.possible.is_empty()), "candidates come first");
        let far = things.iter().find(|thing| !thing.seen && !thing.impossible.is_empty()).unwrap();
        assert!(far.verdict().contains("not in view") || far.verdict().contains("no "), "{}", far.verdict());
    }
}
