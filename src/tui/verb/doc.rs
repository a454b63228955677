//! What each verb does, in a line for the help.

use super::{Page, Verb};
use crate::domain::ActionType;
use crate::tui::policies::PolicyKind;

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
