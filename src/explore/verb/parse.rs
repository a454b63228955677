//! Verbs as lines of text.

use super::Verb;
use super::line::VerbLine;
use super::table::typed;

/// Reads a line.
///
/// # Errors
/// Says what is wrong with it.
pub(crate) fn parse(line: &str) -> Result<Verb, String> {
    let line = line.trim();
    let (verb, rest) = line.split_once(char::is_whitespace).map_or((line, ""), |(verb, rest)| (verb, rest.trim()));
    let entry = typed().find(|entry| entry.name == verb || entry.aliases.contains(&verb));
    let entry = entry.ok_or_else(|| match nearest(verb) {
        Some(meant) => format!("unknown verb {verb:?}; is {meant} meant? `help` lists the verbs"),
        None => format!("unknown verb {verb:?}; `help` lists the verbs"),
    })?;
    // What is passed over in silence would be taken for understood.
    if entry.arguments.is_empty() && !rest.is_empty() {
        return Err(format!("{verb} stands alone: {rest:?} is nothing that it takes"));
    }
    (entry.read)(&VerbLine { verb, rest })
}

/// The verb that is one letter away from what was typed: one more, one less, another, or two exchanged.
fn nearest(typed_word: &str) -> Option<&'static str> {
    typed().map(|entry| entry.name).find(|name| is_one_letter_away(typed_word, name))
}

fn is_one_letter_away(a: &str, b: &str) -> bool {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let same = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    let (a, b) = (&a[same..], &b[same..]);
    match (a, b) {
        ([_, rest @ ..], _) if rest == b => true,
        (_, [_, rest @ ..]) if a == rest => true,
        ([_, a @ ..], [_, b @ ..]) if a == b => true,
        ([a, b, rest @ ..], [c, d, other @ ..]) => (a, b) == (d, c) && rest == other,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::chain::Draws;
    use crate::domain::{Action, ActionType};
    use crate::explore::breakpoints::Condition;
    use crate::explore::session::SessionCommand;

    /// Something that may follow a verb.
    fn example(arguments: &str) -> &'static str {
        match arguments {
            "" => "",
            "N|ACTION" | "[N]" | "N" | "NAME|N" | "KB" | "SEED" => "1",
            "NAME" => "expert",
            "N [TIMES]" => "2 4",
            "best|north|..." => "south",
            "panels|mind|..." => "world",
            "LINK" => "1",
            "[CONDITION]" | "CONDITION" => "failed",
            _ => "next",
        }
    }

    #[test]
    fn lines_are_read_as_verbs_and_mistakes_are_named() {
        let ask = |command| Ok(Verb::Ask(command));
        assert_eq!(parse("step"), Ok(Verb::Step(1)));
        assert_eq!(parse(" step 12 "), Ok(Verb::Step(12)));
        assert_eq!(parse("s"), Ok(Verb::Step(1)));
        assert_eq!(parse("do moveahead"), ask(SessionCommand::Act(Action::navigate(ActionType::MoveAhead))));
        assert_eq!(parse("do 3"), Ok(Verb::Interact(3)));
        assert_eq!(parse("instruct  put the mug away"), ask(SessionCommand::Instruct("put the mug away".into())));
        assert_eq!(parse("break entropy 1.5"), ask(SessionCommand::Break(Some(Condition::Entropy(1.5)))));
        assert_eq!(parse("break"), ask(SessionCommand::Breakpoints));
        assert_eq!(parse("break clear"), ask(SessionCommand::Break(None)));
        assert_eq!(parse("save"), ask(SessionCommand::Save(None)));
        assert_eq!(parse("link 2 4"), ask(SessionCommand::WhichLink(Draws { times: 4, only: Some(1) })));
        assert!(parse("do pickup").unwrap_err().contains("candidates"));
        assert!(parse("step many").unwrap_err().contains("many"));
        assert!(parse("dance").unwrap_err().contains("dance"));
        for (typed, meant) in [("brek", "break"), ("sekk", "seek"), ("branhc", "branch"), ("savee", "save")] {
            assert!(parse(typed).unwrap_err().contains(&format!("is {meant} meant?")), "{typed}");
        }
        assert!(!parse("zzz").unwrap_err().contains("meant"));
        assert!(parse("name").unwrap_err().contains("what?"));
        assert!(parse("select 1").is_err(), "keys alone do that");
        for alone in ["mouse on", "quit now", "done 3", "greedy 4", "values north"] {
            assert!(parse(alone).unwrap_err().contains("stands alone"), "{alone}");
        }
        for none in ["step 0", "back 0", "forward 0", "links 0", "link 2 0", "link 0", "open 0", "meant 0"] {
            assert!(parse(none).is_err(), "{none}");
        }
        assert!(parse("event later").unwrap_err().contains("neither next nor before"));
        assert!(parse("break gap -1").unwrap_err().contains("is below 0"));
    }

    #[test]
    fn every_listed_verb_can_be_read() {
        for entry in typed() {
            let argument = example(entry.arguments);
            for name in std::iter::once(&entry.name).chain(entry.aliases) {
                assert!(parse(&format!("{name} {argument}")).is_ok(), "{name}");
            }
        }
    }
}
