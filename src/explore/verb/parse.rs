//! Verbs as lines of text.

use std::path::PathBuf;

use super::{Page, Verb};
use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Draws;
use crate::domain::{ActionType, Heading};
use crate::explore::breakpoints::Condition;

/// Draws of a link where nobody says how many.
pub const TIMES: u32 = 8;

/// Reads a line.
///
/// # Errors
/// Says what is wrong with it.
pub fn parse(line: &str) -> Result<Verb, String> {
    let line = line.trim();
    let (verb, rest) = line.split_once(char::is_whitespace).map_or((line, ""), |(verb, rest)| (verb, rest.trim()));
    let number = |text: &str| text.parse::<u32>().map_err(|_| format!("{verb}: {text:?} is not a number"));
    let count = || if rest.is_empty() { Ok(1) } else { number(rest) };
    let text = || match rest {
        "" => Err(format!("{verb}: what? say it after the verb")),
        text => Ok(text.to_string()),
    };
    match verb {
        "run" => Ok(Verb::ToggleRun),
        "continue" | "c" => Ok(Verb::Continue),
        "step" | "s" => Ok(Verb::Step(count()?)),
        "do" => act(rest),
        "instruct" | "i" => Ok(Verb::Instruct(text()?)),
        "back" => Ok(Verb::Back(count()?)),
        "forward" => Ok(Verb::Forward(count()?)),
        "seek" => Ok(Verb::Seek(number(rest)?)),
        "last" => Ok(Verb::Last),
        "event" if rest == "before" => Ok(Verb::LastEvent),
        "event" => Ok(Verb::NextEvent),
        "subtask" => Ok(Verb::Subtask(number(rest)?)),
        "branch" => Ok(Verb::Branch(text()?)),
        "branches" => Ok(Verb::Branches),
        "name" => Ok(Verb::Name(text()?)),
        "diverge" => Ok(Verb::Diverge(text()?)),
        "break" if rest.is_empty() => Ok(Verb::Break(None)),
        "break" => Ok(Verb::Break(Some(Condition::parse(rest)?))),
        "until" => Ok(Verb::Until(Condition::parse(rest)?)),
        "policy" => PolicyKind::ALL
            .into_iter()
            .find(|kind| kind.name() == rest)
            .map(Verb::Policy)
            .ok_or_else(|| format!("policy: {rest:?} is none of agent, expert, random")),
        "checkpoint" => Ok(Verb::Checkpoint(text()?)),
        "sample" => rest.parse().map(Verb::Sample).map_err(|_| format!("sample: {rest:?} is not a seed")),
        "greedy" => Ok(Verb::Greedy),
        "compare" | "ab" => Ok(Verb::Compare(text()?)),
        "swap" => Ok(Verb::Swap),
        "chain" => Ok(Verb::Chain(rest.to_string())),
        "against" => Ok(Verb::Against(text()?)),
        "links" => {
            Ok(Verb::WhichLink(Draws { times: if rest.is_empty() { TIMES } else { number(rest)? }, only: None }))
        }
        "link" => {
            let (link, times) = rest.split_once(' ').unwrap_or((rest, ""));
            let only = number(link)?.checked_sub(1).ok_or("link: links are numbered from 1")?;
            let times = if times.is_empty() { TIMES } else { number(times.trim())? };
            Ok(Verb::WhichLink(Draws { times, only: Some(only as usize) }))
        }
        "heading" if rest == "best" => Ok(Verb::Facing(None)),
        "heading" => match Heading::ALL.into_iter().find(|heading| heading.name() == rest) {
            Some(heading) => Ok(Verb::Facing(Some(heading))),
            None => Err(format!("heading: {rest:?} is none of best, north, east, south, west")),
        },
        "mouse" => Ok(Verb::Mouse),
        "faster" => Ok(Verb::Faster),
        "slower" => Ok(Verb::Slower),
        "manual" => Ok(Verb::ToggleManual),
        "page" => page(rest),
        "graphics" => Ok(Verb::Graphics),
        "overlay" => Ok(Verb::Overlay),
        "numbers" => Ok(Verb::Labels),
        "sort" => Ok(Verb::Sort),
        "values" => Ok(Verb::ValueMap),
        "stop" => Ok(Verb::Stop),
        "save" => Ok(Verb::Save((!rest.is_empty()).then(|| PathBuf::from(rest)))),
        "task" => Ok(Verb::SaveTask(text()?.into())),
        "export" => Ok(Verb::Export(text()?.into())),
        "reset" => Ok(Verb::Reset),
        "next" => Ok(Verb::Next),
        "seed" => rest.parse().map(Verb::Seed).map_err(|_| format!("seed: {rest:?} is not a number")),
        "look" => Ok(Verb::Look),
        "candidates" => Ok(Verb::Candidates),
        "think" => Ok(Verb::Think),
        "bandwidth" => Ok(Verb::Bandwidth(number(rest)?)),
        "frame" => Ok(Verb::FullFrame),
        "copy" => Ok(Verb::Copy),
        "help" | "?" => Ok(Verb::Help),
        "quit" | "q" | "exit" => Ok(Verb::Quit),
        _ => Err(format!("unknown verb {verb:?}; `help` lists the verbs")),
    }
}

fn page(name: &str) -> Result<Verb, String> {
    const PAGES: [(&str, Page); 6] = [
        ("panels", Page::Main),
        ("branches", Page::Branches),
        ("mind", Page::Mind),
        ("world", Page::World),
        ("compare", Page::Compare),
        ("chain", Page::Chain),
    ];
    let found = PAGES.iter().find(|(known, _)| *known == name);
    found.map(|(_, page)| Verb::Show(*page)).ok_or_else(|| {
        let names: Vec<&str> = PAGES.iter().map(|(name, _)| *name).collect();
        format!("page: {name:?} is none of {}", names.join(", "))
    })
}

fn act(rest: &str) -> Result<Verb, String> {
    match ActionType::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(rest)) {
        Some(kind) if kind.is_interaction() => Err(format!("do: {kind} needs a number from `candidates`")),
        Some(kind) => Ok(Verb::Navigate(kind)),
        None => rest.parse().map(Verb::Interact).map_err(|_| format!("do: {rest:?} is neither a number nor an action")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explore::verb::SAID;

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
        assert_eq!(parse("step"), Ok(Verb::Step(1)));
        assert_eq!(parse(" step 12 "), Ok(Verb::Step(12)));
        assert_eq!(parse("do moveahead"), Ok(Verb::Navigate(ActionType::MoveAhead)));
        assert_eq!(parse("do 3"), Ok(Verb::Interact(3)));
        assert_eq!(parse("instruct  put the mug away"), Ok(Verb::Instruct("put the mug away".into())));
        assert_eq!(parse("break entropy 1.5"), Ok(Verb::Break(Some(Condition::Entropy(1.5)))));
        assert_eq!(parse("break"), Ok(Verb::Break(None)));
        assert_eq!(parse("save"), Ok(Verb::Save(None)));
        assert!(parse("do pickup").unwrap_err().contains("candidates"));
        assert!(parse("step many").unwrap_err().contains("many"));
        assert!(parse("dance").unwrap_err().contains("dance"));
        assert!(parse("name").unwrap_err().contains("what?"));
    }

    #[test]
    fn every_listed_verb_can_be_read() {
        for said in SAID {
            let argument = example(said.arguments);
            assert!(parse(&format!("{} {argument}", said.name)).is_ok(), "{}", said.name);
        }
    }
}
