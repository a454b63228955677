//! Switching: lamps go on, and nothing else that is switched is a subtask.

use super::clause::Clause;
use super::lexicon::lexicon;
use super::shape::is_lamp;
use super::tokens::Token;
use crate::domain::class::FixtureEffect;

/// Tells switching off from switching on, and machines and water from lamps: the subtasks know only lamps that go on. "it" is what
/// was last named that has a switch.
pub(super) fn tell_switching(all: &mut [Clause]) {
    let words = &lexicon().words;
    let mut named: Option<bool> = None;
    for clause in all {
        let tokens = &clause.tokens;
        let lamp = |token: &Token| token.classes.iter().any(|class| is_lamp(*class));
        let machine =
            |token: &Token| token.classes.iter().any(|class| class.info().effect.is_some() || class.info().basin);
        let own = tokens.iter().rev().find(|token| lamp(token) || machine(token)).map(lamp);
        named = own.or(named);
        let is = |token: &Token, texts: &[&str]| texts.contains(&token.text.as_str());
        let ends = |token: Option<&Token>| token.is_none_or(|then| then.is_mark() || words.breaks.contains(&then.text));
        // "the lamp off", not "the book off the lamp"
        let lamp_off = tokens.iter().rposition(lamp).is_some_and(|at| {
            let then = at + 1 + usize::from(tokens.get(at + 1).is_some_and(|token| is(token, &["is"])));
            tokens.get(then).is_some_and(|token| is(token, &["off", "out"])) && ends(tokens.get(then + 1))
        });
        let verb = tokens.iter().position(|token| token.lemma().is_some());
        let says_off = tokens.iter().any(|token| is(token, &["off"]))
            || own == Some(true)
                && verb.is_some_and(|at| tokens.get(at + 1).is_some_and(|token| is(token, &["out", "down"])));
        let nothing_else = tokens.iter().all(|token| {
            token.is_mark()
                || token.lemma().is_some()
                || is(token, &["off", "water", "it", "them"])
                || words.determiners.contains(&token.text)
                || words.plain.contains(&token.text)
                || words.breaks.contains(&token.text)
        });
        let water = tokens.iter().any(|token| is(token, &["water"]));
        let of_machine = own == Some(false) || own.is_none() && nothing_else && (water || named == Some(false));
        match clause.lemma {
            "turn" if says_off && of_machine => clause.lemma = "close",
            "turn" if says_off => clause.lemma = "off",
            _ if lamp_off || own == Some(true) && says_off && matches!(clause.lemma, "" | "close") => {
                clause.lemma = "off";
            }
            // "run the mug under the tap"
            "go" if own == Some(false) || water => {
                let rinses = tokens.iter().any(|token| {
                    is(token, &["water"])
                        || token.classes.iter().any(|class| class.info().effect == Some(FixtureEffect::Rinse))
                });
                let runs = verb.filter(|&at| is(&tokens[at], &["run"]));
                let thing =
                    runs.and_then(|at| tokens[at + 1..].iter().find(|token| !words.determiners.contains(&token.text)));
                let moved = thing.is_some_and(|token| {
                    is(token, &["it", "them"]) || token.classes.iter().any(|class| class.info().pickupable)
                });
                if rinses && moved {
                    clause.lemma = "wash";
                }
            }
            _ => {}
        }
    }
}
