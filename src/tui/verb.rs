//! Everything a person can do on the explorer's screen: one list for keys, help and update.

use super::policies::PolicyKind;
use crate::domain::ActionType;

/// One thing that a person can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// Run or pause.
    ToggleRun,
    /// One step.
    Step,
    /// A faster pace.
    Faster,
    /// A slower pace.
    Slower,
    /// Back to the start.
    Reset,
    /// The next episode.
    Next,
    /// Begin to type an instruction.
    Edit,
    /// Take over, or give back.
    ToggleManual,
    /// Let that policy decide.
    Policy(PolicyKind),
    /// Let the next policy decide.
    NextPolicy,
    /// One of the five navigation actions.
    Navigate(ActionType),
    /// The interaction of that number, from 1.
    Interact(u8),
    /// The next page of interactions.
    Page,
    /// Another way to show pictures.
    Graphics,
    /// Numbers on or off.
    Labels,
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
}

impl Verb {
    /// One line for the help.
    pub fn doc(self) -> &'static str {
        match self {
            Verb::ToggleRun => "run or pause",
            Verb::Step => "one step, as the policy chooses",
            Verb::Faster => "faster",
            Verb::Slower => "slower",
            Verb::Reset => "reset to the start of the episode",
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
            Verb::Graphics => "show pictures another way",
            Verb::Labels => "numbers in the picture on or off",
            Verb::Help => "these keys",
            Verb::Quit => "quit",
            Verb::Apply => "tell the agent",
            Verb::Cancel => "leave without a change",
            Verb::Earlier => "an earlier instruction",
            Verb::Later => "a later instruction",
        }
    }
}
