//! The slots of a phrase that speak of a place: where a thing is, and where it goes.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::grammar::{grammar, with_article};
use crate::domain::Class;

/// "the counter" and what goes with it, for where a thing is.
pub(super) fn origin_slots(origin: Class, rng: &mut ChaCha8Rng) -> Vec<(&'static str, String)> {
    let place = format!("the {}", grammar().name(origin, rng));
    let at = origin.preposition();
    let from = match (at, rng.random_bool(0.5)) {
        ("in", true) => "out of",
        ("on", true) => "off",
        _ => "from",
    };
    let mut slots = vec![("from", format!("{from} {place}")), ("at", format!("{at} {place}"))];
    if origin.info().openable {
        slots.push(("shut", place.clone()));
    }
    slots.push(("place", place));
    slots
}

/// "the counter" and what goes with it, for where a thing goes.
pub(super) fn destination_slots(class: Class, rng: &mut ChaCha8Rng) -> Vec<(&'static str, String)> {
    let name = grammar().name(class, rng);
    let dest = if class.info().pickupable && rng.random_bool(0.3) { with_article(name) } else { format!("the {name}") };
    let mut slots = vec![("to", format!("{} {dest}", class.preposition()))];
    if class.info().openable && !class.info().pickupable {
        slots.push(("inside", dest.clone()));
    }
    slots.push(("dest", dest));
    slots
}
