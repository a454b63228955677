//! What a person can ask of an exploration in an environment with actions of its own: typed, or by a key.

use std::path::PathBuf;

use super::breakpoint::RemoteCondition;

/// Something that is asked.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RemoteCommand {
    /// Take so many steps, or follow what was tried.
    Step(u32),
    /// Go on until something stops it.
    Run,
    /// Stop going on.
    Pause,
    /// Go so many steps back or forth on the branch in hand.
    Move(i64),
    /// Go to that step of the branch in hand.
    Goto(u32),
    /// Do that.
    Act(String),
    /// Tell the agent that; nothing brings back what the environment asks.
    Instruct(String),
    /// Compare what is told with that.
    Compare(String),
    /// Let chance act.
    Chance,
    /// Let the policy of the command line act.
    Agent,
    /// Begin the episode of that seed.
    Begin(u64),
    /// Begin the episode of the next seed.
    Next,
    /// Go to the start.
    Reset,
    /// Take that branch in hand, from 1.
    Branch(usize),
    /// Stop there, or where it is set already, no longer.
    Break(RemoteCondition),
    /// Write a run.
    Save(Option<PathBuf>),
    /// Show what is seen, what can be done, and how likely each is.
    Look,
    /// List the branches.
    Branches,
    /// End.
    Quit,
}

/// What there is, for whoever asks.
pub(crate) const HELP: &str = "step [N], run, back [N], forward [N], goto N, act NAME [ARGUMENT], instruct [TEXT], \
    compare TEXT, chance, agent, begin SEED, next, reset, branch N, branches, break CONDITION, save [FOLDER], look, quit";

impl RemoteCommand {
    /// Reads a line.
    ///
    /// # Errors
    /// Says what there is.
    pub(crate) fn parse(line: &str) -> Result<RemoteCommand, String> {
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).map_or((line, ""), |(word, rest)| (word, rest.trim()));
        let number = |missing: u32| match rest {
            "" => Ok(missing),
            text => text.parse::<u32>().map_err(|_| format!("{word}: {text:?} is not a number")),
        };
        let needed = || rest.parse::<u64>().map_err(|_| format!("{word}: {rest:?} is not a number"));
        let text = || if rest.is_empty() { Err(format!("{word} needs words after it")) } else { Ok(rest.to_owned()) };
        // What is passed over in silence would be taken for understood.
        let stands_alone =
            matches!(word, "run" | "chance" | "agent" | "next" | "reset" | "branches" | "look" | "quit" | "q");
        if stands_alone && !rest.is_empty() {
            return Err(format!("{word} stands alone: {rest:?} is nothing that it takes"));
        }
        if matches!(word, "step" | "n" | "back" | "h" | "forward" | "l") && number(1)? == 0 {
            return Err(format!("{word}: 0 times is nothing to do"));
        }
        match word {
            "step" | "n" => Ok(RemoteCommand::Step(number(1)?)),
            "run" => Ok(RemoteCommand::Run),
            "back" | "h" => Ok(RemoteCommand::Move(-i64::from(number(1)?))),
            "forward" | "l" => Ok(RemoteCommand::Move(i64::from(number(1)?))),
            "goto" => Ok(RemoteCommand::Goto(needed()?.min(u64::from(u32::MAX)) as u32)),
            "act" => Ok(RemoteCommand::Act(text()?)),
            "instruct" | "i" => Ok(RemoteCommand::Instruct(rest.to_owned())),
            "compare" => Ok(RemoteCommand::Compare(text()?)),
            "chance" => Ok(RemoteCommand::Chance),
            "agent" => Ok(RemoteCommand::Agent),
            "begin" => Ok(RemoteCommand::Begin(needed()?)),
            "next" => Ok(RemoteCommand::Next),
            "reset" => Ok(RemoteCommand::Reset),
            "branch" => Ok(RemoteCommand::Branch(needed()? as usize)),
            "branches" => Ok(RemoteCommand::Branches),
            "break" => Ok(RemoteCommand::Break(RemoteCondition::parse(rest)?)),
            "save" => Ok(RemoteCommand::Save((!rest.is_empty()).then(|| rest.into()))),
            "look" => Ok(RemoteCommand::Look),
            "quit" | "q" => Ok(RemoteCommand::Quit),
            _ => Err(format!("{word:?} is none of: {HELP}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_reads_as_what_is_asked_and_others_say_what_there_is() {
        assert_eq!(RemoteCommand::parse(" step 3 "), Ok(RemoteCommand::Step(3)));
        assert_eq!(RemoteCommand::parse("back"), Ok(RemoteCommand::Move(-1)));
        assert_eq!(RemoteCommand::parse("act open red door"), Ok(RemoteCommand::Act("open red door".into())));
        assert_eq!(RemoteCommand::parse("instruct"), Ok(RemoteCommand::Instruct(String::new())));
        assert_eq!(RemoteCommand::parse("break reward"), Ok(RemoteCommand::Break(RemoteCondition::Reward)));
        for (line, told) in [
            ("dance", "none of: step"),
            ("goto x", "not a number"),
            ("act", "needs words"),
            ("run on", "stands alone"),
            ("step 0", "nothing to do"),
            ("break it", "sees NAME"),
        ] {
            assert!(RemoteCommand::parse(line).unwrap_err().contains(told), "{line}");
        }
    }
}
