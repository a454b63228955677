//! Everything a person can do in the explorer: one list for keys, palette, help and the plain mode.

mod doc;
mod fuzzy_match;
mod parse;

pub use fuzzy_match::{SAID, Said, matching};
pub use parse::{TIMES, parse};

use std::path::PathBuf;

use super::breakpoints::Condition;
use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Draws;
use crate::domain::{ActionType, Heading};

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
    /// Which link breaks, for the link that is selected alone.
    ReplayLink,
    /// Paint the values of that heading; without one, of the best.
    Facing(Option<Heading>),
    /// Paint the values of the next heading.
    NextHeading,
    /// Hear the mouse, or no longer.
    Mouse,
    /// Follow a chain of instructions.
    Chain(String),
    /// The same chain by another policy, side by side.
    Against(String),
    /// Which link of the chain breaks.
    WhichLink(Draws),
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
