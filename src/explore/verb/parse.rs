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
    let entry = entry.ok_or_else(|| format!("unknown verb {verb:?}; `help` lists the verbs"))?;
    (entry.read)(&VerbLine { verb, rest })
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
        assert_eq!(parse("break"), ask(SessionCommand::Break(None)));
        assert_eq!(parse("save"), ask(SessionCommand::Save(None)));
        assert_eq!(parse("link 2 4"), ask(SessionCommand::WhichLink(Draws { times: 4, only: Some(1) })));
        assert!(parse("do pickup").unwrap_err().contains("candidates"));
        assert!(parse("step many").unwrap_err().contains("many"));
        assert!(parse("dance").unwrap_err().contains("dance"));
        assert!(parse("name").unwrap_err().contains("what?"));
        assert!(parse("select 1").is_err(), "keys alone do that");
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
