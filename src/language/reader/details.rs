//! What a unit says besides its skill and classes: looks, and where a thing is.

use std::collections::BTreeSet;

use super::clauses::{Chunk, Clause, chunks};
use super::features::direct;
use super::lexicon::lexicon;
use crate::domain::Class;

/// What a unit says besides its skill and classes.
pub(super) struct Details {
    /// Words before the noun.
    pub looks: Vec<String>,
    /// Where it is said to be.
    pub place: Option<Class>,
    /// Every class that may be meant by where it is said to be.
    pub places: Vec<Class>,
    /// It is picked up before something else is done.
    pub takes_first: bool,
}

impl Details {
    pub(super) fn of(clauses: &[Clause], house: Option<&BTreeSet<Class>>) -> Details {
        let doing: Vec<&Clause> =
            clauses.iter().filter(|clause| !matches!(clause.lemma, "" | "go" | "wait" | "open" | "close")).collect();
        let takes_first = doing.len() > 1 && doing[0].lemma == "take";
        let Some(clause) = doing.first().copied().or(clauses.first()) else {
            return Details { looks: Vec::new(), place: None, places: Vec::new(), takes_first };
        };
        let pieces = chunks(clause);
        let thing = direct(clause.lemma, &pieces).or(pieces.first());
        let looks = thing.map(looks).unwrap_or_default();
        let from = |lead: &str| matches!(lead, "from" | "off" | "out");
        let at = |lead: &str| matches!(lead, "in" | "on" | "inside" | "at" | "under") && clause.lemma != "put";
        let places = pieces.iter().skip(1).filter(|chunk| from(&chunk.lead) || at(&chunk.lead));
        let heads: Vec<_> = places.filter_map(Chunk::head).filter(|head| head.is_name()).collect();
        let place = heads.iter().find_map(|head| one_meant(&head.text, head.classes, house));
        let places = heads.first().map_or_else(Vec::new, |head| head.classes.to_vec());
        Details { looks, place, places, takes_first }
    }
}

fn looks(thing: &Chunk) -> Vec<String> {
    let head = thing.head();
    let before = thing.words.iter().take_while(|word| Some(*word) != head);
    let says = before.filter(|word| {
        let plain = lexicon().words.plain.contains(&word.text);
        !(word.is_name() || word.unknown || plain || lexicon().count(&word.text).is_some())
    });
    says.map(|word| word.text.clone()).collect()
}

/// Which receptacle a name means: the one whose usual name it is, or the only one that bears it; of the house's, where that is
/// known.
fn one_meant(name: &str, classes: &[Class], house: Option<&BTreeSet<Class>>) -> Option<Class> {
    let mut all: Vec<Class> = classes.iter().copied().filter(|class| class.info().receptacle).collect();
    if let Some(house) = house
        && all.iter().any(|class| house.contains(class))
    {
        all.retain(|class| house.contains(class));
    }
    match all.as_slice() {
        [one] => Some(*one),
        _ => all.into_iter().find(|class| lexicon().usual(*class) == Some(name)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_the_one_that_is_called_so_or_the_only_one() {
        let class = |name: &str| Class::named(name).unwrap();
        let some: Vec<Class> = ["CoffeeTable", "DiningTable"].map(class).to_vec();
        assert_eq!(one_meant("table", &some, None), None);
        assert_eq!(one_meant("coffee_table", &some, None), Some(some[0]));
        let house: BTreeSet<Class> = [some[1]].into();
        assert_eq!(one_meant("table", &some, Some(&house)), Some(some[1]));
    }
}
