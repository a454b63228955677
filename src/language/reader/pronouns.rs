//! Pronouns that stand for something that no subtask before them names.

use super::clause::Clause;
use super::tokens::Token;

/// What was last named only to walk to it, open or close it is meant by "it": "close the laptop and pick it up".
pub(super) fn say_what_it_means(all: &mut [Clause]) {
    let mut named: Option<Token> = None;
    for clause in all {
        if let Some(name) = &named {
            for token in clause.tokens.iter_mut().filter(|token| token.text == "it") {
                *token = name.clone();
            }
        }
        let movable = |token: &&Token| token.classes.iter().any(|class| class.info().pickupable);
        if matches!(clause.lemma, "open" | "close" | "go") {
            named = clause.tokens.iter().rfind(movable).cloned().or(named);
        } else if clause.tokens.iter().any(Token::is_name) {
            named = None;
        }
    }
}

/// Where several things were named together, a later "them" stands for each: "wash the mug and the plate and put them away".
pub(super) fn say_what_them_means(all: &mut [Clause]) {
    let mut named: Vec<Token> = Vec::new();
    for clause in all {
        let them = |token: &Token| matches!(token.text.as_str(), "them" | "both");
        let at = clause.tokens.iter().position(them).filter(|&at| {
            at > 0 && clause.tokens[..at].last().is_some_and(|token| token.lemma().is_some()) && !named.is_empty()
        });
        if let Some(at) = at {
            clause.tokens.splice(at..=at, named.iter().cloned());
            clause.is_of_each = true;
            continue;
        }
        match clause.apart() {
            Some(parts) => {
                named.clear();
                for part in &parts {
                    let name = part.tokens.iter().find(|token| token.is_name());
                    let and = Token::understood("and", clause.tokens[0].at);
                    named.extend((!named.is_empty()).then_some(and));
                    named.extend(name.cloned());
                }
            }
            None if clause.tokens.iter().any(Token::is_name) && clause.lemma != "go" => named.clear(),
            None => {}
        }
    }
}
