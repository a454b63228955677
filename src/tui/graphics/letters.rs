//! A letter and a tint for each object class.

use std::collections::{BTreeMap, HashMap};

use ratatui::style::Color;

use crate::domain::{Class, Instance, Scene, World};
use crate::house::view::code;

/// A letter for every class of a scene: capitals for furniture, small letters for things. The same for a whole episode.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Letters(BTreeMap<Class, char>);

impl Letters {
    /// Deals out letters: a class gets its initial where that is free, else another letter of its name, else any.
    pub fn of(scene: &Scene, world: &World) -> Letters {
        let mut letters = BTreeMap::new();
        let furniture = scene.fixtures.iter().map(|fixture| fixture.class);
        deal(&mut letters, furniture, |c| c.to_ascii_uppercase(), 'A'..='Z');
        deal(&mut letters, world.objects.iter().map(|object| object.class), |c| c.to_ascii_lowercase(), 'a'..='z');
        Letters(letters)
    }

    /// The letter of a class.
    pub(crate) fn letter(&self, class: Class) -> char {
        self.0.get(&class).copied().unwrap_or('?')
    }
}

fn deal(
    letters: &mut BTreeMap<Class, char>,
    classes: impl Iterator<Item = Class>,
    case: impl Fn(char) -> char,
    alphabet: std::ops::RangeInclusive<char>,
) {
    let mut classes: Vec<Class> = classes.filter(|class| !letters.contains_key(class)).collect();
    classes.sort();
    classes.dedup();
    let mut free: Vec<char> = alphabet.chain("23456789%&$@+=".chars()).collect();
    let mut take = |wanted: &[char]| {
        let found = wanted.iter().find_map(|c| free.iter().position(|letter| letter == c));
        found.map(|at| free.remove(at))
    };
    // Initials first, for every class; only then the second choices.
    let mut left = Vec::new();
    for class in classes {
        match take(&class.name().chars().take(1).map(&case).collect::<Vec<char>>()) {
            Some(letter) => drop(letters.insert(class, letter)),
            None => left.push(class),
        }
    }
    for class in left {
        let any = "zyxwvutsrqponmlkjihgfedcba".chars().map(&case).chain("23456789%&$@+=".chars());
        let choices: Vec<char> = class.name().chars().map(&case).chain(any).collect();
        if let Some(letter) = take(&choices) {
            letters.insert(class, letter);
        }
    }
}

/// The class of every instance code that a frame may hold.
pub(crate) type Names = HashMap<u16, Class>;

/// The classes of all instances of a world.
pub fn names(scene: &Scene, world: &World) -> Names {
    let fixtures = (0u16..).zip(&scene.fixtures).map(|(i, fixture)| (code(Instance::Fixture(i)), fixture.class));
    let objects = (0u16..).zip(&world.objects).map(|(i, object)| (code(Instance::Object(i)), object.class));
    fixtures.chain(objects).collect()
}

/// A terminal colour for a class, so that neighbours differ; the letter alone says it too.
pub(crate) fn tint(class: Class) -> Color {
    const TINTS: [Color; 11] = [
        Color::Red,
        Color::Green,
        Color::Yellow,
        Color::Blue,
        Color::Magenta,
        Color::Cyan,
        Color::LightRed,
        Color::LightGreen,
        Color::LightYellow,
        Color::LightMagenta,
        Color::LightCyan,
    ];
    TINTS[class.index() * 7 % TINTS.len()]
}

/// The classes in a frame with their letters, the largest first.
pub(crate) fn legend(job_ids: &[u16], names: &Names, letters: &Letters) -> Vec<(char, Class)> {
    let mut counts: BTreeMap<Class, u32> = BTreeMap::new();
    for class in job_ids.iter().filter_map(|id| names.get(id)) {
        *counts.entry(*class).or_default() += 1;
    }
    let mut classes: Vec<(u32, Class)> = counts.into_iter().map(|(class, count)| (count, class)).collect();
    classes.sort_by_key(|&(count, class)| (std::cmp::Reverse(count), class));
    classes.into_iter().map(|(_, class)| (letters.letter(class), class)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Object;

    #[test]
    fn every_class_of_a_scene_has_a_letter_of_its_own() {
        let objects =
            Class::all().filter(|class| class.info().pickupable).map(|class| Object { class, ..Object::default() });
        let world = World { objects: objects.collect(), ..World::default() };
        let (scene, _) = crate::house::testing::kitchen();
        let letters = Letters::of(&scene, &world);
        let mut dealt: Vec<char> = letters.0.values().copied().filter(|c| c.is_ascii_alphanumeric()).collect();
        dealt.sort_unstable();
        let count = dealt.len();
        dealt.dedup();
        assert_eq!(dealt.len(), count);
        assert!(letters.letter(Class::named("Fridge").unwrap()).is_ascii_uppercase(), "furniture is in capitals");
        assert_eq!(letters.letter(Class::named("AlarmClock").unwrap()), 'a');
    }
}
