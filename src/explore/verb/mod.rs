//! Everything a person can do in the explorer. [`table::VERBS`] is the one list of it.

mod documents;
pub(crate) mod entry;
mod fuzzy_match;
mod line;
mod parse;
pub(crate) mod table;

pub(crate) use documents::man_section;
pub(crate) use fuzzy_match::matching;
pub(crate) use line::DRAWS;
pub(crate) use parse::parse;

use super::breakpoints::Condition;
use super::session::SessionCommand;
use crate::domain::Heading;

/// One thing that a person can do.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Verb {
    /// What the session does as it is asked.
    Ask(SessionCommand),
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
    /// Begin to type an instruction.
    Edit,
    /// Take over, or give back.
    ToggleManual,
    /// Let the next policy decide.
    NextPolicy,
    /// The interaction of that number, from 1.
    Interact(u8),
    /// The next page of interactions.
    NextInteractions,
    /// That many steps back.
    Back(u32),
    /// That many steps forward along the recording; at its end as the policy chooses.
    Forward(u32),
    /// Run until that holds.
    Until(Condition),
    /// Show a page, or the main one again.
    Show(ExplorerPage),
    /// In a list: down (or up).
    Select(i8),
    /// In a list: take what is selected.
    Take,
    /// Sort the table another way.
    Sort,
    /// Another view in the frame's panel.
    Overlay,
    /// The value of every cell, painted on the map; or end that.
    ValueMap,
    /// Which link breaks, for the link that is selected alone.
    ReplayLink,
    /// Paint the values of that heading; without one, of the best.
    Facing(Option<Heading>),
    /// Paint the values of the next heading.
    NextHeading,
    /// Hear the mouse, or no longer.
    Mouse,
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
    Palette(String),
    /// The keys of this screen.
    Help,
    /// What the terms on the screen mean.
    Terms,
    /// In the help: the next part of it.
    TurnHelp,
    /// The selected link as a branch.
    OpenLink,
    /// Stop, and go on when the shell says so.
    Suspend,
    /// Back to the list of what there is to start with.
    List,
    /// End the session.
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
    /// What was told, and what came of it.
    Wishes,
}

#[cfg(test)]
impl ExplorerPage {
    /// Every page.
    pub(crate) const ALL: [ExplorerPage; 8] = [
        ExplorerPage::Main,
        ExplorerPage::Branches,
        ExplorerPage::Mind,
        ExplorerPage::World,
        ExplorerPage::Compare,
        ExplorerPage::Chain,
        ExplorerPage::Frame,
        ExplorerPage::Actions,
    ];
}

/// A page in place of the panels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExplorerPage {
    /// The frame, interactions, distribution, task, log and map at once.
    Main,
    /// Everything that was tried, as a tree of branches.
    Branches,
    /// Every choice with its probability and values.
    Mind,
    /// The floor plan with an inspector.
    World,
    /// Two instructions in one state.
    Compare,
    /// Instructions that are followed one after the other.
    Chain,
    /// The frame alone, as large as can be.
    Frame,
    /// Every action of the branch in hand.
    Actions,
}
