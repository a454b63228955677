//! What must not be done: "don't take the knife", "not the knife", "leave it alone", "instead of the fork".

use super::clauses::{is_plain_request, starts_verb};
use super::lexicon::lexicon;
use super::tokens::Token;

/// Leaves out what a text says is not to be done: "don't take the knife", "not the knife", "instead of the knife".
pub(super) fn without_the_forbidden(tokens: Vec<Token>) -> Vec<Token> {
    let text = |at: usize| tokens.get(at).map_or("", |token: &Token| token.text.as_str());
    let mut kept: Vec<Token> = Vec::with_capacity(tokens.len());
    // What was named only to say what not to do with it may still be meant by "it".
    let mut named: Option<Token> = None;
    let mut at = 0;
    while at < tokens.len() {
        if let Some(length) = asks_by_denying(&tokens[at..]) {
            at += length;
            continue;
        }
        let forbids = match (text(at), text(at + 1)) {
            ("do" | "must" | "should" | "can" | "will" | "does" | "need" | "would" | "could", "not") => true,
            ("not", next) => next != "only" && next != "far",
            ("instead", "of") | ("rather", "than") | ("without", _) | ("except", _) | ("ignore" | "skip", _) => true,
            ("no", _) if tokens[at + 1..].iter().take(3).any(Token::is_name) => true,
            ("no", "need") | ("refrain", "from") | ("forget", _) => true,
            ("leave", _) => is_let_alone(&tokens, at),
            _ => false,
        };
        if !forbids {
            if tokens[at].is_name() {
                named = None;
            }
            let stands_for = named.clone().filter(|_| matches!(text(at), "it" | "them"));
            kept.push(stands_for.unwrap_or_else(|| tokens[at].clone()));
            at += 1;
            continue;
        }
        let start = at;
        let anything_before = kept.iter().any(Token::is_name);
        at += 1;
        while at < tokens.len() {
            let new_verb = |from: usize| {
                (from..tokens.len().min(from + 3)).any(|i| lexicon().verb(text(i)).is_some() && starts_verb(&tokens, i))
            };
            let again = || {
                // "don't take the knife take the fork"
                is_plain_request(&tokens, at) && tokens[start..at].iter().any(Token::is_name)
            };
            let ends = tokens[at].ends_sentence()
                || again()
                || matches!(text(at), "but" | "just" | "only" | "instead") && at > start + 1 && text(at + 1) != "of"
                || text(at) == "," && at > start + 1
                || matches!(text(at), "and" | "then") && new_verb(at + 1);
            if ends {
                break;
            }
            at += 1;
        }
        let left_out = &tokens[start..at];
        if text(start) == "not" && !left_out.iter().any(|token| token.is_name() || token.lemma().is_some()) {
            // "the mug that is not red" says how a thing is, which nothing is made of.
            let words = &lexicon().words;
            let says = |token: &Token| !(token.is_mark() || words.determiners.contains(&token.text));
            let doubted = left_out.iter().skip(1).filter(|token| says(token));
            kept.extend(doubted.map(|token| Token { unknown: true, ..token.clone() }));
        }
        if !anything_before {
            named = tokens[start..at].iter().find(|token| token.is_name()).cloned();
        }
    }
    kept
}

/// How many tokens ask for something by denying its opposite: "do not forget to", "why do not you", "can not you".
fn asks_by_denying(tokens: &[Token]) -> Option<usize> {
    let text = |at: usize| tokens.get(at).map_or("", |token: &Token| token.text.as_str());
    let whom = |at: usize| usize::from(matches!(text(at), "you" | "we" | "i"));
    let not = match text(0) {
        "why" if text(1) == "not" => return Some(2 + whom(2)),
        "why" if text(2) == "not" => return Some(3 + whom(3)),
        "why" if matches!(text(2), "you" | "we") && text(3) == "not" => return Some(4),
        "do" | "must" | "should" | "can" | "will" | "does" | "would" | "could" if text(1) == "not" => 1,
        "not" => 0,
        _ => return None,
    };
    if matches!(text(not + 1), "you" | "we") && not == 1 && text(0) != "do" {
        return Some(3);
    }
    let omits = matches!(text(not + 1), "forget" | "hesitate" | "fail" | "neglect" | "omit");
    omits.then_some(not + 2 + usize::from(text(not + 2) == "to"))
}

/// "leave the lamp off", "leave it alone".
fn is_let_alone(tokens: &[Token], at: usize) -> bool {
    let words = &lexicon().words;
    let mut rest = tokens[at + 1..].iter();
    rest.find(|token| {
        token.is_mark()
            || words.prepositions.contains(&token.text)
            || words.breaks.contains(&token.text)
            || token.text == "alone"
    })
    .is_some_and(|token| {
        let then = rest.next();
        token.text == "alone"
            || token.text == "off" && then.is_none_or(|then| then.is_mark() || words.breaks.contains(&then.text))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::reader::tokens::tokens;
    use crate::language::reader::units::Reader;

    fn read(text: &str) -> String {
        let wanted = without_the_forbidden(tokens(text, Reader::shipped().unwrap().spelling()).tokens);
        wanted.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn what_must_not_be_done_is_left_out() {
        assert_eq!(read("don't take the knife, take the fork"), ", take the fork");
        assert_eq!(read("take the fork, not the knife"), "take the fork ,");
        assert_eq!(read("Do not touch the knife. Pick up the spoon instead of the fork"), ". pick up the spoon");
        assert_eq!(read("leave the mug alone and take the plate"), "and take the plate");
        assert_eq!(read("forget the mug, take the cup"), ", take the cup");
        assert_eq!(read("don't take the knife take the fork"), "take the fork");
    }

    #[test]
    fn what_must_not_be_left_undone_is_wanted() {
        for text in ["don't forget to wash the mug", "why don't you wash the mug", "why not wash the mug"] {
            assert_eq!(read(text), "wash the mug");
        }
        assert_eq!(read("can't you wash the mug"), "wash the mug");
    }
}
