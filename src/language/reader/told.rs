//! What a unit says besides its skill and classes: looks, and where a thing is.

use super::clauses::{Chunk, Clause, chunks};
use super::features::direct;
use super::lexicon::lexicon;
use crate::domain::Class;

/// What a unit says besides its skill and classes.
pub(super) struct Told {
    /// Words before the noun.
    pub looks: Vec<String>,
    /// Where it is said to be.
    pub place: Option<Class>,
    /// It is picked up before something else is done.
    pub takes_first: bool,
}

impl Told {
    pub(super) fn of(clauses: &[Clause]) -> Told {
        let doing: Vec<&Clause> =
            clauses.iter().filter(|clause| !matches!(clause.lemma, "" | "go" | "wait" | "open" | "close")).collect();
        let takes_first = doing.len() > 1 && doing[0].lemma == "take";
        let Some(clause) = doing.first().copied().or(clauses.first()) else {
            return Told { looks: Vec::new(), place: None, takes_first };
        };
        let pieces = chunks(clause);
        let thing = direct(clause.lemma, &pieces).or(pieces.first());
        let head = thing.and_then(|thing| thing.head());
        let before_head = |chunk: &Chunk| {
            let words = chunk.words.iter().take_while(|word| Some(*word) != head);
            words
                .filter(|word| !word.is_name() && !lexicon().words.plain.contains(&word.text) && word.unknown.is_none())
                .map(|word| word.text.clone())
                .collect()
        };
        let looks = thing.map(before_head).unwrap_or_default();
        let leads = |lead: &str| matches!(lead, "in" | "on" | "from" | "off" | "out" | "inside" | "at" | "under");
        let places = pieces.iter().skip(1).filter(|chunk| leads(&chunk.lead));
        let mut classes = places.filter_map(|chunk| chunk.head()?.classes.first().copied());
        Told { looks, place: classes.find(|class| class.info().receptacle), takes_first }
    }
}
