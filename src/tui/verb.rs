//! Everything a person can do in the explorer: one list for keys, palette, help and the plain mode.

use std::path::PathBuf;

use super::breakpoints::Condition;
use super::policies::PolicyKind;
use crate::domain::ActionType;

/// One thing that a person can do.
#[derive(Clone, Debug, PartialEq)]
pub enum Verb {
    /// Go on: replay the recording, or at its end let the policy act; or pause.
    ToggleRun,
    /// Let the policy act from here, also where something else was recorded.
    Continue,
    /// So many steps, as the policy chooses.
    Step(u32),
    /// A faster pace.
    Faster,
    /// A slower pace.
    Slower,
    /// Back to the start, with the present instruction.
    Reset,
    /// The next episode.
    Next,
    /// The episode of that seed, or the task of that number.
    Seed(u64),
    /// Begin to type an instruction.
    Edit,
    /// Tell the agent something.
    Instruct(String),
    /// Take over, or give back.
    ToggleManual,
    /// Let that policy decide.
    Policy(PolicyKind),
    /// Let the next policy decide.
    NextPolicy,
    /// Another checkpoint becomes the agent.
    Checkpoint(String),
    /// Another seed of the policy's chance, and actions drawn by it.
    Sample(u64),
    /// The likeliest actions again.
    Greedy,
    /// One of the five navigation actions.
    Navigate(ActionType),
    /// The interaction of that number, from 1.
    Interact(u8),
    /// The next page of interactions.
    Page,
    /// That many steps back.
    Back(u32),
    /// That many steps forward along the recording; at its end as the policy chooses.
    Forward(u32),
    /// To that step.
    Seek(u32),
    /// To the end of the branch.
    Last,
    /// To the next event.
    NextEvent,
    /// To the event before.
    LastEvent,
    /// To the completion of that subtask, from 1.
    Subtask(u32),
    /// To the next branch.
    NextBranch,
    /// To the branch of that name or number.
    Branch(String),
    /// Another name for the branch in hand.
    Name(String),
    /// Side by side with the branch of that name or number.
    Diverge(String),
    /// Stop a run where that holds; without a condition, nowhere.
    Break(Option<Condition>),
    /// Run until that holds.
    Until(Condition),
    /// Show a page, or the main one again.
    Show(Page),
    /// In a list: down (or up).
    Select(i8),
    /// In a list: take what is selected.
    Take,
    /// Sort the table another way.
    Sort,
    /// Another view in the frame's panel.
    Overlay,
    /// Two instructions in one state.
    Compare(String),
    /// Adopt the second instruction.
    Swap,
    /// The value of every cell, painted on the map; or end that.
    ValueMap,
    /// Follow a chain of instructions.
    Chain(String),
    /// Which link of the chain breaks.
    WhichLink(u32),
    /// Stop work in the background.
    Stop,
    /// Write what was explored as a run.
    Save(Option<PathBuf>),
    /// Add the branch as a task to a task file.
    SaveTask(PathBuf),
    /// Write a picture or text of the branch; the file's ending says which.
    Export(PathBuf),
    /// Copy the instruction and the last step to the clipboard.
    Copy,
    /// Another way to show pictures.
    Graphics,
    /// The most that a step may cost on the wire, in kB; 0 for no limit.
    Bandwidth(u32),
    /// One frame at full quality.
    FullFrame,
    /// Numbers on or off.
    Labels,
    /// The list of verbs, with what is typed already.
    Palette(&'static str),
    /// The keys of this screen.
    Help,
    /// Leave.
    Quit,
    /// While typing: tell the agent.
    Apply,
    /// While typing or in help: leave it.
    Cancel,
    /// While typing: an earlier instruction.
    Earlier,
    /// While typing: a later instruction.
    Later,
    /// While typing: complete.
    Complete,
    /// Plain mode: what the agent sees.
    Look,
    /// Plain mode: the interactions that are possible now.
    Candidates,
    /// Plain mode: what the policy would do next.
    Think,
    /// Plain mode: the branches.
    Branches,
}

/// A page in place of the panels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Page {
    /// All panels.
    Main,
    /// Branches.
    Branches,
    /// What the policy thinks.
    Mind,
    /// The floor plan with an inspector.
    World,
    /// Two instructions.
    Compare,
    /// A chain of instructions.
    Chain,
}

/// A verb as it is typed.
pub struct Said {
    /// Its first word.
    pub name: &'static str,
    /// What may follow.
    pub arguments: &'static str,
    /// One line for palette and help.
    pub doc: &'static str,
}

const fn said(name: &'static str, arguments: &'static str, doc: &'static str) -> Said {
    Said { name, arguments, doc }
}

/// Every verb that can be typed, in the palette or in plain mode.
pub const SAID: &[Said] = &[
    said("run", "", "go on: replay the recording, at its end let the policy act; or pause"),
    said("continue", "", "let the policy act from here; where it chooses otherwise, a branch begins"),
    said("step", "[N]", "N steps as the policy chooses (1)"),
    said("do", "N|ACTION", "interaction N of the candidates; or MoveAhead, RotateLeft, RotateRight, LookUp, LookDown"),
    said("instruct", "TEXT", "tell the agent something else"),
    said("back", "[N]", "N steps back (1)"),
    said("forward", "[N]", "N steps forward along the recording (1)"),
    said("seek", "N", "to step N of the branch"),
    said("last", "", "to the end of the branch"),
    said("event", "next|before", "to the next or last event: subtask, failure, instruction, fork"),
    said("subtask", "N", "to the step that completed subtask N"),
    said("branch", "NAME|N", "to another branch"),
    said("branches", "", "list the branches"),
    said("name", "TEXT", "name the branch"),
    said("diverge", "NAME|N", "this branch and another, side by side from where they part"),
    said(
        "break",
        "[CONDITION]",
        "stop runs at: subtask, failed, drop X, gap X, entropy X, sees OBJECT, step N; without any, nowhere",
    ),
    said("until", "CONDITION", "run until that holds"),
    said("policy", "NAME", "who acts: agent, expert, random"),
    said("checkpoint", "NAME|N", "another checkpoint becomes the agent"),
    said("sample", "SEED", "draw the policy's actions by chance with this seed"),
    said("greedy", "", "the likeliest actions again"),
    said("compare", "TEXT", "this instruction and another in the same state"),
    said("swap", "", "adopt the other instruction of the comparison"),
    said("chain", "A; B; ...", "follow a chain of instructions, link by link and as one"),
    said("links", "[N]", "which link breaks: N draws of each, from the expert's and the agent's own entry (8)"),
    said("values", "", "paint the value of every cell on the map"),
    said("stop", "", "stop work in the background"),
    said("save", "[DIR]", "write every branch as a run folder"),
    said("task", "FILE", "add this state and instruction as a task to a task file"),
    said("export", "FILE", "the branch as .gif, .png (this frame), .strip.png, .txt, or .html"),
    said("reset", "", "back to the start, with the present instruction"),
    said("next", "", "the next house or task"),
    said("seed", "N", "the house of another seed, or task N"),
    said("look", "", "what the agent sees"),
    said("candidates", "", "the interactions that are possible now"),
    said("think", "", "what the policy would do next"),
    said("bandwidth", "KB", "the most that a picture may cost on the wire; 0 for no limit"),
    said("frame", "", "one frame at full quality"),
    said("copy", "", "the instruction and the step to the clipboard"),
    said("help", "", "these verbs"),
    said("quit", "", "end"),
];

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
        "links" => Ok(Verb::WhichLink(if rest.is_empty() { 8 } else { number(rest)? })),
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

fn act(rest: &str) -> Result<Verb, String> {
    match ActionType::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(rest)) {
        Some(kind) if kind.is_interaction() => Err(format!("do: {kind} needs a number from `candidates`")),
        Some(kind) => Ok(Verb::Navigate(kind)),
        None => rest.parse().map(Verb::Interact).map_err(|_| format!("do: {rest:?} is neither a number nor an action")),
    }
}

/// The typed verbs that fit what was typed so far, the best first: its letters in order, early and together.
pub fn matching(typed: &str) -> Vec<&'static Said> {
    let word = typed.split_whitespace().next().unwrap_or("").to_lowercase();
    let mut found: Vec<(usize, &Said)> = SAID
        .iter()
        .filter_map(|said| {
            let by_name = closeness(&word, said.name);
            let by_doc = closeness(&word, said.doc).filter(|_| word.len() > 2).map(|cost| cost + 100);
            by_name.or(by_doc).map(|cost| (cost, said))
        })
        .collect();
    found.sort_by_key(|&(cost, _)| cost);
    found.into_iter().map(|(_, said)| said).collect()
}

/// How far apart the letters of `word` lie in `text`; `None` where they are not all there in order.
fn closeness(word: &str, text: &str) -> Option<usize> {
    let text = text.to_lowercase();
    let mut cost = 0;
    let mut rest = text.as_str();
    for letter in word.chars() {
        let at = rest.find(letter)?;
        cost += at;
        rest = &rest[at + letter.len_utf8()..];
    }
    Some(cost)
}

impl Verb {
    /// One line for the help.
    pub fn doc(&self) -> &'static str {
        match self {
            Verb::ToggleRun => "go on (replay, then the policy), or pause",
            Verb::Continue => "let the policy act from here",
            Verb::Step(_) => "one step, as the policy chooses",
            Verb::Faster => "faster",
            Verb::Slower => "slower",
            Verb::Reset => "to the start, keeping the instruction",
            Verb::Next => "next house, or next task of the set",
            Verb::Edit => "type an instruction (it applies at once)",
            Verb::ToggleManual => "take over, or give back",
            Verb::Policy(PolicyKind::Agent) => "the trained agent decides",
            Verb::Policy(PolicyKind::Expert) => "the expert decides (it needs a task)",
            Verb::Policy(PolicyKind::Random) => "chance decides",
            Verb::NextPolicy => "next policy",
            Verb::Navigate(ActionType::MoveAhead) => "move ahead",
            Verb::Navigate(ActionType::RotateLeft) => "turn left",
            Verb::Navigate(ActionType::RotateRight) => "turn right",
            Verb::Navigate(ActionType::LookUp) => "look up",
            Verb::Navigate(_) => "look down",
            Verb::Interact(_) => "do that interaction of the list",
            Verb::Page => "more interactions",
            Verb::Back(_) => "one step back",
            Verb::Forward(_) => "one step forward; at the end, the policy's",
            Verb::Seek(_) => "to the start",
            Verb::Last => "to the end of the branch",
            Verb::NextEvent => "to the next event",
            Verb::LastEvent => "to the event before",
            Verb::NextBranch => "to the next branch",
            Verb::Show(Page::Main) => "all panels again",
            Verb::Show(Page::Branches) => "branches: switch, name, compare",
            Verb::Show(Page::Mind) => "everything the policy weighs",
            Verb::Show(Page::World) => "the floor plan, and why (not) each thing",
            Verb::Show(Page::Compare) => "two instructions in this state",
            Verb::Show(Page::Chain) => "a chain of instructions",
            Verb::Select(by) if *by < 0 => "up",
            Verb::Select(_) => "down",
            Verb::Take => "take what is selected",
            Verb::Sort => "sort another way",
            Verb::Overlay => "colours, depth, things, the frames it sees",
            Verb::Graphics => "show pictures another way",
            Verb::FullFrame => "one frame at full quality",
            Verb::Labels => "numbers in the picture on or off",
            Verb::Save(_) => "write what was explored as a run",
            Verb::Copy => "copy instruction and step",
            Verb::ValueMap => "the value of every cell on the map",
            Verb::Palette(_) => "all verbs",
            Verb::Help => "these keys",
            Verb::Quit => "quit",
            Verb::Apply => "tell the agent",
            Verb::Cancel => "leave without a change",
            Verb::Earlier => "an earlier instruction",
            Verb::Later => "a later instruction",
            Verb::Complete => "complete",
            Verb::Swap => "adopt the other instruction",
            Verb::WhichLink(_) => "which link breaks",
            Verb::Stop => "stop work in the background",
            Verb::Seed(_)
            | Verb::Instruct(_)
            | Verb::Checkpoint(_)
            | Verb::Sample(_)
            | Verb::Greedy
            | Verb::Subtask(_)
            | Verb::Branch(_)
            | Verb::Name(_)
            | Verb::Diverge(_)
            | Verb::Break(_)
            | Verb::Until(_)
            | Verb::Compare(_)
            | Verb::Chain(_)
            | Verb::SaveTask(_)
            | Verb::Export(_)
            | Verb::Bandwidth(_)
            | Verb::Look
            | Verb::Candidates
            | Verb::Think
            | Verb::Branches => "",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let argument = match said.arguments {
                "" => "",
                "N|ACTION" | "[N]" | "N" | "NAME|N" | "KB" | "SEED" => "1",
                "NAME" => "expert",
                "[CONDITION]" | "CONDITION" => "failed",
                _ => "next",
            };
            assert!(parse(&format!("{} {argument}", said.name)).is_ok(), "{}", said.name);
        }
    }

    #[test]
    fn typing_finds_verbs_by_their_letters() {
        assert_eq!(matching("exp")[0].name, "export");
        assert_eq!(matching("brk")[0].name, "break");
        assert_eq!(matching("seek 12")[0].name, "seek");
        assert_eq!(matching("clipboard")[0].name, "copy", "by what it does");
        assert_eq!(matching("").len(), SAID.len());
        assert!(matching("qqq").is_empty());
    }
}
