//! Wishes that can be fulfilled in this very house from where things are: each was read, and done by the expert.

use std::sync::Arc;

use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::domain::{Class, Role, Scene, SkillKind, Subtask, World};
use crate::episode::wish::{Wish, read};
use crate::language::{instruction, phrases};

/// The most wishes that are offered.
const MOST: usize = 8;
/// Kinds of wishes, in the order in which they are offered; those that most houses can fulfil come again.
const KINDS: [SkillKind; 10] = {
    use SkillKind::{Clean, Cool, Heat, Pickup, Put, Slice, Toggle};
    [Pickup, Put, Heat, Cool, Clean, Slice, Toggle, Put, Pickup, Put]
};
/// How many things are tried for a wish.
const TRIES: usize = 4;

/// A few wishes, the same for the same house and seed.
pub(crate) fn example_wishes(scene: &Arc<Scene>, world: &World, seed: u64) -> Vec<String> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut found: Vec<(String, Vec<(SkillKind, Class)>)> = Vec::new();
    for kind in KINDS {
        if found.len() == MOST {
            break;
        }
        let mut chances = chances(kind, scene, world);
        chances.shuffle(&mut rng);
        let fit = chances.into_iter().take(TRIES).find_map(|(object, place)| {
            let text = sentence(kind, object, place, &mut rng);
            let wish = read(&text, 0, std::iter::empty(), scene, world);
            let asks = asks(&wish);
            let is_new = found.iter().all(|(known, others)| *known != text && *others != asks);
            (is_new && is_about(&wish, kind, object)).then_some((text, asks))
        });
        found.extend(fit);
    }
    found.into_iter().map(|(text, _)| text).collect()
}

/// What such a wish may be about: an object, and where it is to be put.
fn chances(kind: SkillKind, scene: &Scene, world: &World) -> Vec<(Class, Option<Class>)> {
    let unique = |mut classes: Vec<Class>| {
        classes.sort_unstable();
        classes.dedup();
        classes.retain(|class| class.in_vocabulary());
        classes
    };
    let movable = unique(world.objects.iter().map(|object| object.class).filter(|c| c.info().pickupable).collect());
    let fixed = unique(scene.fixtures.iter().map(|fixture| fixture.class).collect());
    let has = |name: &str| fixed.iter().any(|class| class.name() == name);
    let held_by = |name: &str| Class::named(name).filter(|_| has(name));
    let into = |holder: Option<Class>| {
        let fits = move |class: &Class| holder.is_some_and(|holder| holder.holds(*class));
        movable.iter().copied().filter(fits).map(|class| (class, None)).collect()
    };
    match kind {
        SkillKind::Pickup => movable.into_iter().map(|class| (class, None)).collect(),
        SkillKind::Put => {
            let places = |class: Class| fixed.iter().copied().filter(move |place| place.holds(class));
            movable.iter().flat_map(|&class| places(class).map(move |place| (class, Some(place)))).collect()
        }
        SkillKind::Heat => into(held_by("Microwave")),
        SkillKind::Cool => into(held_by("Fridge")),
        SkillKind::Clean => into(held_by("Sink").filter(|_| has("Faucet"))),
        SkillKind::Slice => {
            let has_knife = movable.iter().any(|class| class.name().ends_with("Knife"));
            let slices = |class: &Class| has_knife && class.info().slices > 1;
            movable.into_iter().filter(slices).map(|class| (class, None)).collect()
        }
        SkillKind::Toggle => {
            let lamps = fixed.iter().chain(&movable).copied().filter(|class| class.name().ends_with("Lamp"));
            lamps.map(|class| (class, None)).collect()
        }
    }
}

fn sentence(kind: SkillKind, object: Class, place: Option<Class>, rng: &mut ChaCha8Rng) -> String {
    let role = |class: Class| Role { class, slice: false, bound: None, expert: None };
    let roles: Vec<Role> = std::iter::once(object).chain(place).map(role).collect();
    let receptacle = place.map(|_| 1);
    let subtask = Subtask { skill: kind, object: 0, receptacle, closes: false, literal: None };
    instruction::normalise(&phrases::sentence(&roles, &subtask, rng))
}

/// Whether a wish was understood as what it was meant as, and can be fulfilled but is not yet.
fn is_about(wish: &Wish, kind: SkillKind, object: Class) -> bool {
    let asks = asks(wish).contains(&(kind, object));
    let is_open = wish.verdict.is_none() && (wish.already as usize) < wish.subtasks.len();
    asks && is_open && wish.ungraded.is_none() && wish.unread.is_empty() && wish.expert_steps.is_some()
}

/// What is done to what, by a wish.
fn asks(wish: &Wish) -> Vec<(SkillKind, Class)> {
    let class = |subtask: &Subtask| wish.roles.get(usize::from(subtask.object)).map(|role| role.class);
    wish.subtasks.iter().filter_map(|subtask| Some((subtask.skill, class(subtask)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Room;
    use crate::house::generate;

    #[test]
    fn every_room_offers_wishes_that_the_expert_fulfils_and_always_the_same() {
        for (room, seed, least) in [
            (Room::Kitchen, 0, 6),
            (Room::Kitchen, 7, 6),
            (Room::Bedroom, 3, 4),
            (Room::LivingRoom, 1, 4),
            (Room::Bathroom, 2, 4),
        ] {
            let (scene, world) = generate::house(room, seed);
            let scene = Arc::new(scene);
            let found = example_wishes(&scene, &world, seed);
            assert!((least..=MOST).contains(&found.len()), "{room:?} {seed}: {found:?}");
            assert_eq!(found, example_wishes(&scene, &world, seed));
            for text in &found {
                let wish = read(text, 0, std::iter::empty(), &scene, &world);
                assert!(wish.expert_steps.is_some_and(|steps| steps > 0), "{text}");
            }
        }
    }

    #[test]
    fn a_kitchen_offers_more_than_picking_things_up() {
        let (scene, world) = generate::house(Room::Kitchen, 0);
        let scene = Arc::new(scene);
        let wishes = example_wishes(&scene, &world, 0);
        let last =
            |text: &String| read(text, 0, std::iter::empty(), &scene, &world).subtasks.last().map(|one| one.skill);
        let kinds: Vec<_> = wishes.iter().filter_map(last).collect();
        assert!(kinds.iter().any(|kind| matches!(kind, SkillKind::Heat | SkillKind::Cool)), "{wishes:?}");
        assert!(kinds.contains(&SkillKind::Pickup) && kinds.contains(&SkillKind::Put), "{wishes:?}");
    }
}
