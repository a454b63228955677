//! The one table of verbs. Key map, help, palette, the plain mode's lines, the manual and the list of keys come from it.

use super::entry::{KeyScope, VerbEntry, key, key_verb, opens, verb};
use super::line::VerbLine;
use super::{ExplorerPage, Verb};
use crate::domain::{Action, ActionType, Heading};
use crate::explore::session::SessionCommand as Command;

use KeyScope::{Common, Help, Lists, Manual, Typing, Watch, WishList};

/// Every verb, in the order in which palette and help list them.
#[rustfmt::skip]
pub(crate) const VERBS: &[VerbEntry] = &[
    verb("run", "", "go on (replay, then the policy), or pause", |_| Ok(Verb::ToggleRun))
        .on(&[key(Common, "space", &["space"], "go on, or pause", "")]),
    verb("continue", "", "let the policy act from here", |_| Ok(Verb::Continue)).or(&["c"])
        .on(&[key(Common, "c", &["c"], "the policy acts from here", "")]),
    verb("step", "[N]", "N steps as the policy chooses (1)", |line| Ok(Verb::Step(line.count()?))).or(&["s"])
        .on(&[key(Common, "n enter", &["enter", "n", "."], "one step of the policy", "")]),
    verb("do", "N|ACTION", "interaction N of the list, or MoveAhead, RotateLeft, ...", act)
        .on(&[
            key(Manual, "up w", &["up", "w"], "move ahead", "MoveAhead"),
            key(Manual, "left a", &["left", "a"], "turn left", "RotateLeft"),
            key(Manual, "right d", &["right", "d"], "turn right", "RotateRight"),
            key(Manual, "pgup u", &["pageup", "u"], "look up", "LookUp"),
            key(Manual, "pgdn s", &["pagedown", "down", "s"], "look down", "LookDown"),
            key(Common, "1-9", &["1"], "interaction of that number", "1"),
        ]),
    key_verb("more", "the next page of interactions", |_| Ok(Verb::NextInteractions), &[
        key(Common, "tab", &["tab"], "more interactions", ""),
    ]),
    key_verb("edit", "type an instruction", |_| Ok(Verb::Edit), &[
        key(Common, "i / z", &["i", "/"], "tell it; z: other reading", ""),
    ]),
    verb("instruct", "TEXT", "tell the agent something else", |line| ask(Command::Instruct(line.text()?))).or(&["i"]),
    verb("meant", "[N]", "the wish is meant as its reading N (the next one); it is graded anew",
        |line| ask(Command::Mean(line.optional_count()?)))
        .on(&[key(Common, "", &["z"], "the next reading", "")]),
    verb("done", "", "the wish is fulfilled, you say", |_| ask(Command::Say { fulfilled: true })),
    verb("failed", "", "the wish failed, you say", |_| ask(Command::Say { fulfilled: false })),
    verb("examples", "", "a few wishes that can be fulfilled in this house", |_| ask(Command::Examples))
        .on(&[key(Watch, "w", &["w"], "wishes for this house", "")]),
    verb("wishes", "", "the instructions so far, and what became of each", |_| Ok(Verb::Wishes)),
    verb("back", "[N]", "N steps back (1)", |line| Ok(Verb::Back(line.count()?)))
        .on(&[
            key(Common, "h l", &["h"], "a step back, forward", ""),
            key(Watch, "", &["left"], "a step back", ""),
        ]),
    verb("forward", "[N]", "N steps forward along the branch (1)", |line| Ok(Verb::Forward(line.count()?)))
        .on(&[
            key(Common, "", &["l"], "a step forward", ""),
            key(Watch, "", &["right"], "a step forward", ""),
        ]),
    verb("seek", "N", "to step N of the branch", |line| ask(Command::Seek(line.number()?)))
        .on(&[key(Common, "0 $", &["0", "home"], "to the start, to the end", "0")]),
    verb("last", "", "to the end of the branch", |_| ask(Command::Seek(u32::MAX)))
        .on(&[key(Common, "", &["$", "end"], "to the end", "")]),
    verb("event", "next|before", "to a subtask, failure, instruction or fork",
        |line| match line.rest {
            "" | "next" => ask(Command::SeekEvent { forward: true }),
            "before" => ask(Command::SeekEvent { forward: false }),
            other => Err(format!("event: {other:?} is neither next nor before")),
        })
        .on(&[
            key(Common, "[ ]", &["["], "to the event before, after", "before"),
            key(Common, "", &["]"], "to the next event", "next"),
        ]),
    verb("subtask", "N", "to the step that completed subtask N", |line| ask(Command::SeekSubtask(line.number()?))),
    verb("branch", "NAME|N", "to another branch", |line| ask(Command::Switch(line.text()?))),
    key_verb("next branch", "to the branch after this one, around", |_| ask(Command::NextBranch), &[
        key(Common, "}", &["}"], "to the next branch", ""),
    ]),
    verb("branches", "", "list the branches", |_| Ok(Verb::Branches)),
    key_verb("take", "to the branch that is selected", |_| Ok(Verb::Take), &[
        key(KeyScope::ExplorerPage(ExplorerPage::Branches), "enter", &["enter"], "take what is selected", ""),
        key(KeyScope::ExplorerPage(ExplorerPage::Actions), "enter", &["enter"], "to the selected step", ""),
    ]),
    verb("name", "TEXT", "name the branch", |line| ask(Command::Rename(line.text()?)))
        .on(&[opens(ExplorerPage::Branches, &["R"], "name the branch")]),
    verb("diverge", "NAME|N", "this branch and another, side by side", |line| ask(Command::Diverge(line.text()?))),
    verb("break", "[CONDITION]",
        "stop runs at: subtask, failed, drop X, gap X, entropy X, sees OBJECT, step N; clear: nowhere; alone: lists them",
        |line| ask(match line.rest {
            "" => Command::Breakpoints,
            "clear" => Command::Break(None),
            _ => Command::Break(Some(line.condition()?)),
        })),
    verb("until", "CONDITION", "run until that holds", |line| Ok(Verb::Until(line.condition()?))),
    verb("policy", "NAME", "who acts: agent, expert, random", |line| ask(Command::Choose(line.policy()?)))
        .on(&[
            key(Watch, "a e x", &["a"], "agent, expert, chance acts", "agent"),
            key(Watch, "", &["e"], "the expert acts", "expert"),
            key(Watch, "", &["x"], "chance acts", "random"),
        ]),
    key_verb("next policy", "agent, expert or random in turn", |_| Ok(Verb::NextPolicy), &[
        key(Common, "p", &["p"], "next policy", ""),
    ]),
    verb("checkpoint", "NAME|N", "another checkpoint becomes the agent", |line| ask(Command::Checkpoint(line.text()?))),
    verb("sample", "SEED", "draw the policy's actions by chance with this seed",
        |line| ask(Command::Sample(line.seed("a seed")?))),
    verb("greedy", "", "the likeliest actions again", |_| ask(Command::Greedy)),
    verb("compare", "TEXT", "this instruction and another in the same state",
        |line| ask(Command::Compare(line.text()?))).or(&["ab"])
        .on(&[opens(ExplorerPage::Compare, &["enter"], "another instruction")]),
    verb("swap", "", "adopt the other instruction of the comparison", |_| ask(Command::Swap))
        .on(&[key(KeyScope::ExplorerPage(ExplorerPage::Compare), "s", &["s"], "adopt the other instruction", "")]),
    verb("chain", "A; B; ...", "follow a chain of instructions, link by link and as one",
        |line| ask(Command::Chain(line.rest.to_string())))
        .on(&[opens(ExplorerPage::Chain, &["enter"], "a new chain")]),
    verb("against", "NAME|N", "the same chain by another checkpoint, the expert or random, side by side",
        |line| ask(Command::Against(line.text()?)))
        .on(&[opens(ExplorerPage::Chain, &["A"], "another agent beside it")]),
    verb("links", "[N]", "which link breaks: N draws of each (8), from both entries",
        |line| ask(Command::WhichLink(line.draws_of_all()?)))
        .on(&[key(KeyScope::ExplorerPage(ExplorerPage::Chain), "w", &["w"], "which link breaks", "")]),
    verb("link", "N [TIMES]", "the same for one link: from its recorded entry and the expert's",
        |line| ask(Command::WhichLink(line.draws_of_one()?))),
    verb("open", "LINK", "a link of the chain as a branch, at the state in which it began",
        |line| match line.number()? {
            0 => Err("open: links are numbered from 1".into()),
            link => ask(Command::OpenLink(link as usize - 1)),
        }),
    key_verb("open this link", "the selected link as a branch, at the state in which it began", |_| Ok(Verb::OpenLink), &[
        key(KeyScope::ExplorerPage(ExplorerPage::Chain), "O", &["O"], "open the link as a branch", ""),
    ]),
    key_verb("this link", "which link breaks, for the one that is selected", |_| Ok(Verb::ReplayLink), &[
        key(KeyScope::ExplorerPage(ExplorerPage::Chain), "x", &["x"], "replay the selected link", ""),
    ]),
    verb("values", "", "paint the value of every cell on the map; or end that", |_| Ok(Verb::ValueMap))
        .on(&[key(Common, "V", &["V"], "values on the map", "")]),
    verb("heading", "best|north|...", "the heading whose values are painted", heading),
    key_verb("next heading", "the values of the next heading", |_| Ok(Verb::NextHeading), &[
        key(Common, "v", &["v"], "values, next heading", ""),
    ]),
    verb("stop", "", "stop work in the background", |_| ask(Command::Stop))
        .on(&[key(KeyScope::ExplorerPage(ExplorerPage::Chain), "s", &["s"], "stop work in the background", "")]),
    verb("save", "[DIR]", "write every branch as a run folder",
        |line| ask(Command::Save((!line.rest.is_empty()).then(|| line.rest.into()))))
        .on(&[key(Common, "S", &["S"], "save branches as a run", "")]),
    verb("task", "FILE", "add this state and instruction as a task to a task file",
        |line| ask(Command::SaveTask(line.text()?.into())))
        .on(&[opens(ExplorerPage::Branches, &["T"], "save this state as a task")]),
    verb("export", "FILE", "the branch as .gif, .png (this frame), .strip.png, .txt, or .html",
        |line| ask(Command::Export(line.text()?.into())))
        .on(&[opens(ExplorerPage::Branches, &["E"], "write film, page, picture")]),
    verb("reset", "", "back to the start, with the present instruction", |_| ask(Command::Reset))
        .on(&[key(Common, "r", &["r"], "reset, same instruction", "")]),
    verb("next", "", "the next house or task", |_| ask(Command::Next))
        .on(&[key(Common, "N", &["N"], "next house, or next task", "")]),
    verb("seed", "N", "the house of another seed, or task N", |line| ask(Command::Seed(line.seed("a number")?))),
    verb("look", "", "what the agent sees", |_| Ok(Verb::Look)),
    verb("candidates", "", "the interactions that are possible now", |_| Ok(Verb::Candidates)),
    verb("think", "", "what the policy would do next", |_| Ok(Verb::Think)),
    verb("bandwidth", "KB", "the most that a picture may cost on the wire; 0 for no limit",
        |line| Ok(Verb::Bandwidth(line.number()?))),
    verb("frame", "", "one frame at full quality", |_| Ok(Verb::FullFrame))
        .on(&[key(Common, "F", &["F"], "one frame at full quality", "")]),
    verb("mouse", "", "clicks select, the wheel goes in time; or no longer", |_| Ok(Verb::Mouse)),
    verb("faster", "", "a faster pace", |_| Ok(Verb::Faster))
        .on(&[key(Common, "+ -", &["+", "="], "faster, slower", "")]),
    verb("slower", "", "a slower pace", |_| Ok(Verb::Slower))
        .on(&[key(Common, "", &["-"], "slower", "")]),
    verb("manual", "", "take over, or give back", |_| Ok(Verb::ToggleManual))
        .on(&[
            key(Common, "m", &["m"], "take over, or give back", ""),
            key(Manual, "esc", &["esc"], "take over, or give back", ""),
        ]),
    verb("page", "panels|mind|...", "panels, branches, mind, world, compare, chain, frame, or actions", page)
        .on(&[
            key(Common, "t", &["t"], "branches, side by side", "branches"),
            key(Common, "M", &["M"], "what the policy weighs", "mind"),
            key(Common, "W", &["W"], "floor plan, every thing", "world"),
            key(Common, "B", &["B"], "two instructions, A and B", "compare"),
            key(Common, "C", &["C"], "a chain of instructions", "chain"),
            key(Common, "L", &["L"], "list of every action", "actions"),
            key(Common, "f", &["f"], "the frame at full size", "frame"),
            key(Lists, "esc", &["esc"], "all panels again", "panels"),
        ]),
    key_verb("select", "another line of the list", |line| Ok(Verb::Select(line.rest.parse().unwrap_or(1))), &[
        key(Lists, "j k", &["j", "down"], "down, up", "1"),
        key(Lists, "", &["k", "up"], "up", "-1"),
        key(WishList, "j k", &["j", "down", "tab"], "down, up", "1"),
        key(WishList, "", &["k", "up"], "up", "-1"),
    ]),
    verb("graphics", "", "show pictures another way", |_| Ok(Verb::Graphics))
        .on(&[key(Common, "g", &["g"], "pictures another way", "")]),
    verb("overlay", "", "colours, depth, things, the five frames it sees", |_| Ok(Verb::Overlay))
        .on(&[key(Common, "o", &["o"], "depth, things, 5 frames", "")]),
    verb("numbers", "", "numbers in the picture, on or off", |_| Ok(Verb::Labels))
        .on(&[key(Common, "b", &["b"], "numbers in the picture", "")]),
    verb("sort", "", "sort the table of choices another way", |_| Ok(Verb::Sort))
        .on(&[key(KeyScope::ExplorerPage(ExplorerPage::Mind), "s", &["s"], "sort another way", "")]),
    verb("copy", "", "the instruction and the step to the clipboard", |_| Ok(Verb::Copy))
        .on(&[key(Common, "y", &["y"], "copy instruction and step", "")]),
    key_verb("palette", "type a verb", |_| Ok(Verb::Palette(String::new())), &[
        key(Common, ":", &[":"], "all verbs", ""),
    ]),
    verb("help", "", "these verbs", |_| Ok(Verb::Help)).or(&["?"])
        .on(&[key(Common, "?", &["?", "f1"], "these keys", "")]),
    verb("terms", "", "what the terms on the screen mean", |_| Ok(Verb::Terms))
        .on(&[key(Common, "G", &["G"], "what the terms mean", "")]),
    key_verb("turn help", "the next part of the help", |_| Ok(Verb::TurnHelp), &[
        key(Help, "tab", &["tab", "j", "down", "pagedown"], "more", ""),
    ]),
    verb("start", "", "the list of houses, tasks, agents and runs to start with", |_| Ok(Verb::List)).or(&["list"])
        .on(&[key(Common, "", &["H"], "the list to start with", "")]),
    verb("quit", "", "end", |_| Ok(Verb::Quit)).or(&["q", "exit"])
        .on(&[key(Common, "q H", &["q"], "quit; H: the list of houses", "")]),
    key_verb("apply", "tell the agent what was typed, or do it; put the wish that is selected on the line", |_| Ok(Verb::Apply), &[
        key(Typing, "enter", &["enter"], "tell the agent", ""),
        key(WishList, "enter", &["enter", "i"], "put it on the line", ""),
    ]),
    key_verb("cancel", "leave the line, the list or the help", |_| Ok(Verb::Cancel), &[
        key(Typing, "esc", &["esc"], "leave", ""),
        key(WishList, "esc", &["esc", "w", "q"], "leave", ""),
        key(Help, "esc ? q", &["esc", "?", "q", "f1", "enter", "backspace", "space"], "leave", ""),
    ]),
    key_verb("complete", "complete what was typed", |_| Ok(Verb::Complete), &[
        key(Typing, "tab", &["tab"], "complete", ""),
    ]),
    key_verb("earlier", "an earlier instruction, or the verb above", |_| Ok(Verb::Earlier), &[
        key(Typing, "up", &["up"], "an earlier instruction", ""),
    ]),
    key_verb("later", "a later instruction, or the verb below", |_| Ok(Verb::Later), &[
        key(Typing, "down", &["down"], "a later instruction", ""),
    ]),
];

/// The verbs that can be typed.
pub(crate) fn typed() -> impl Iterator<Item = &'static VerbEntry> {
    VERBS.iter().filter(|entry| entry.is_typed)
}

fn ask(command: Command) -> Result<Verb, String> {
    Ok(Verb::Ask(command))
}

const PAGES: [(&str, ExplorerPage); 8] = [
    ("panels", ExplorerPage::Main),
    ("branches", ExplorerPage::Branches),
    ("mind", ExplorerPage::Mind),
    ("world", ExplorerPage::World),
    ("compare", ExplorerPage::Compare),
    ("chain", ExplorerPage::Chain),
    ("frame", ExplorerPage::Frame),
    ("actions", ExplorerPage::Actions),
];

fn page(line: &VerbLine<'_>) -> Result<Verb, String> {
    let found = PAGES.iter().find(|(known, _)| *known == line.rest);
    found.map(|(_, page)| Verb::Show(*page)).ok_or_else(|| {
        let names: Vec<&str> = PAGES.iter().map(|(name, _)| *name).collect();
        format!("page: {:?} is none of {}", line.rest, names.join(", "))
    })
}

fn act(line: &VerbLine<'_>) -> Result<Verb, String> {
    let rest = line.rest;
    match ActionType::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(rest)) {
        Some(kind) if kind.is_interaction() => Err(format!("do: {kind} needs a number from `candidates`")),
        Some(kind) => Ok(Verb::Ask(Command::Act(Action::navigate(kind)))),
        None => rest.parse().map(Verb::Interact).map_err(|_| format!("do: {rest:?} is neither a number nor an action")),
    }
}

fn heading(line: &VerbLine<'_>) -> Result<Verb, String> {
    if line.rest == "best" {
        return Ok(Verb::Facing(None));
    }
    let found = Heading::ALL.into_iter().find(|heading| heading.name() == line.rest);
    found
        .map(|heading| Verb::Facing(Some(heading)))
        .ok_or_else(|| format!("heading: {:?} is none of best, north, east, south, west", line.rest))
}
