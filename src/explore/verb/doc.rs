//! What each verb does, in a line for the help.

use super::{Page, Verb};
use crate::agent::registry::PolicyKind;
use crate::domain::ActionType;

impl Verb {
    /// One line for the help.
    pub fn doc(&self) -> &'static str {
        match self {
            Verb::ToggleRun => "go on, or pause",
            Verb::Continue => "the policy acts from here",
            Verb::Step(_) => "one step of the policy",
            Verb::Faster => "faster, slower",
            Verb::Slower => "slower",
            Verb::Reset => "reset, same instruction",
            Verb::Next => "next house, or next task",
            Verb::Edit => "tell the agent something",
            Verb::ToggleManual => "take over, or give back",
            Verb::Policy(PolicyKind::Agent) => "agent, expert, chance acts",
            Verb::Policy(PolicyKind::Expert) => "the expert acts",
            Verb::Policy(PolicyKind::Random) => "chance acts",
            Verb::NextPolicy => "next policy",
            Verb::Navigate(ActionType::MoveAhead) => "move ahead",
            Verb::Navigate(ActionType::RotateLeft) => "turn left",
            Verb::Navigate(ActionType::RotateRight) => "turn right",
            Verb::Navigate(ActionType::LookUp) => "look up",
            Verb::Navigate(_) => "look down",
            Verb::Interact(_) => "interaction of that number",
            Verb::Page => "more interactions",
            Verb::Back(_) => "a step back, forward",
            Verb::Forward(_) => "a step forward",
            Verb::Seek(_) => "to the start, to the end",
            Verb::Last => "to the end",
            Verb::NextEvent => "to the next event",
            Verb::LastEvent => "to the event before, after",
            Verb::NextBranch => "to the next branch",
            Verb::Show(Page::Main) => "all panels again",
            Verb::Show(Page::Branches) => "branches, side by side",
            Verb::Show(Page::Mind) => "what the policy weighs",
            Verb::Show(Page::World) => "floor plan, every thing",
            Verb::Show(Page::Compare) => "two instructions, A and B",
            Verb::Show(Page::Chain) => "a chain of instructions",
            Verb::Select(by) if *by < 0 => "up",
            Verb::Select(_) => "down, up",
            Verb::Take => "take what is selected",
            Verb::Sort => "sort another way",
            Verb::Overlay => "depth, things, 5 frames",
            Verb::Graphics => "pictures another way",
            Verb::FullFrame => "one frame at full quality",
            Verb::Labels => "numbers in the picture",
            Verb::Save(_) => "save branches as a run",
            Verb::Copy => "copy instruction and step",
            Verb::ValueMap => "values on the map",
            Verb::NextHeading => "values, next heading",
            Verb::ReplayLink => "replay the selected link",
            Verb::Palette("name ") => "name the branch",
            Verb::Palette("task ") => "save this state as a task",
            Verb::Palette("export ") => "write film, page, picture",
            Verb::Palette("compare ") => "another instruction",
            Verb::Palette("chain ") => "a new chain",
            Verb::Palette("against ") => "another agent beside it",
            Verb::Palette(_) => "all verbs",
            Verb::Help => "these keys",
            Verb::Quit => "quit",
            Verb::Apply => "tell the agent",
            Verb::Cancel => "leave",
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
            | Verb::Against(_)
            | Verb::SaveTask(_)
            | Verb::Export(_)
            | Verb::Bandwidth(_)
            | Verb::Facing(_)
            | Verb::Mouse
            | Verb::Look
            | Verb::Candidates
            | Verb::Think
            | Verb::Branches => "",
        }
    }
}
