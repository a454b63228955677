//! What is not understood: clauses that begin with an unknown word, and words that nothing is made of.

use super::clauses::Clause;
use super::lexicon::lexicon;
use super::tokens::Token;

/// Whether a clause begins with something that is not understood.
pub(super) fn is_foreign(clause: &Clause) -> bool {
    let mut before = clause.tokens.iter().take_while(|token| !token.is_name());
    let says = |words: &[&str]| clause.tokens.iter().any(|token| words.contains(&token.text.as_str()));
    let turned = clause.lemma == "turn"
        && !says(&["on", "off", "lamp", "light", "floor_lamp", "desk_lamp"])
        && !says_nothing(clause);
    turned || clause.lemma.is_empty() && before.any(is_strange)
}

/// Whether nothing is made of a word.
fn is_strange(token: &Token) -> bool {
    token.unknown.is_some() || lexicon().words.foreign.contains(&token.text) && !token.is_name()
}

/// Whether a clause is about nothing: "turn around".
pub(super) fn says_nothing(clause: &Clause) -> bool {
    let words = &lexicon().words;
    let mut rest = clause.tokens.iter().filter(|token| lexicon().verb(&token.text) != Some(clause.lemma));
    matches!(clause.lemma, "turn" | "look")
        && rest.all(|token| {
            let word = &token.text;
            token.is_mark()
                || words.prepositions.contains(word) && word != "on"
                || words.determiners.contains(word)
                || words.places.contains(word)
                || words.plain.contains(word)
                || words.particles.contains(word)
                || words.breaks.contains(word)
        })
}

/// The words that were not understood: those that nobody knows, and the rest of a clause that begins with one.
pub(super) fn unread(typed: &[Token], clauses: &[Clause]) -> Vec<String> {
    let plain = &lexicon().words;
    let mut words: Vec<String> = Vec::new();
    let foreign = clauses.iter().filter(|clause| is_foreign(clause)).flat_map(|clause| &clause.tokens);
    let foreign: Vec<&Token> = foreign.collect();
    for token in typed {
        let skipped = plain.plain.contains(&token.text)
            || plain.determiners.contains(&token.text)
            || plain.prepositions.contains(&token.text)
            || token.is_mark();
        if skipped {
            continue;
        }
        let word = match &token.unknown {
            Some(word) => word.clone(),
            None if foreign.contains(&token) || is_strange(token) => token.text.replace('_', " "),
            None => continue,
        };
        if !words.contains(&word) {
            words.push(word);
        }
    }
    words
}
