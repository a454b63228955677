//! What each page remembers of itself.

use std::sync::Arc;

use crate::analysis::instruction_ab::Contrast;
use crate::analysis::value_map::ValueMap;
use crate::domain::Heading;
use crate::explore::chain_report::ChainReport;
use crate::explore::choices::Sort;
use crate::explore::timeline::{ActionLine, Divergence};
use crate::tui::graphics::overlay::Overlay;

/// The main page: all panels.
pub(crate) struct MainPageState {
    /// What the frame's panel shows.
    pub(crate) overlay: Overlay,
    /// Numbers are drawn into the picture.
    pub(crate) numbers: bool,
    /// Which page of the interactions is shown, from 0.
    pub(crate) interactions: usize,
}

#[derive(Default)]
pub(crate) struct BranchesPageState {
    /// The branch that is selected.
    pub(crate) selected: usize,
    /// How it and the one in hand part, where that was asked for.
    pub(crate) divergence: Option<Divergence>,
}

/// The page of the policy's choices.
pub(crate) struct MindPageState {
    /// The first choice that is wanted in sight.
    pub(crate) selected: usize,
    /// How they are sorted.
    pub(crate) sort: Sort,
}

/// The page of the house.
#[derive(Default)]
pub(crate) struct WorldPageState {
    /// The thing that is selected.
    pub(crate) selected: usize,
}

/// The page of two instructions.
#[derive(Default)]
pub(crate) struct ComparePageState {
    /// The first choice that is wanted in sight.
    pub(crate) selected: usize,
    /// Two instructions in one state.
    pub(crate) contrast: Option<Contrast>,
    /// In which state that was: the branch and the step.
    pub(crate) state: Option<(usize, u32)>,
}

/// The page of every action.
#[derive(Default)]
pub(crate) struct ActionsPageState {
    /// The step that is selected, from 0.
    pub(crate) selected: usize,
    /// The steps of the branch in hand.
    pub(crate) lines: Vec<ActionLine>,
}

#[derive(Default)]
pub(crate) struct ChainPageState {
    /// The link that is selected.
    pub(crate) selected: usize,
    /// The chain that is followed.
    pub(crate) own: Option<ChainReport>,
    /// The same chain followed by another policy.
    pub(crate) rival: Option<ChainReport>,
}

/// The values of the cells, on the maps of two pages.
#[derive(Default)]
pub(crate) struct ValueMapState {
    /// They are painted.
    pub(crate) is_painted: bool,
    /// The values, and the step of the house that they are for.
    pub(crate) map: Option<(Arc<ValueMap>, u32)>,
    /// The heading whose values are painted; the best without one.
    pub(crate) heading: Option<Heading>,
}

impl Default for MainPageState {
    fn default() -> MainPageState {
        MainPageState { overlay: Overlay::Colour, numbers: true, interactions: 0 }
    }
}

impl Default for MindPageState {
    fn default() -> MindPageState {
        MindPageState { selected: 0, sort: Sort::Probability }
    }
}

impl ChainPageState {
    /// Takes in a chain: in the place of what the same policy made of it, or beside what another one did.
    pub(crate) fn take_in(&mut self, report: ChainReport) {
        match &self.own {
            Some(known) if known.is_same_chain(&report) && known.who != report.who => self.rival = Some(report),
            _ => {
                self.rival = self.rival.take().filter(|rival| rival.is_same_chain(&report));
                self.own = Some(report);
            }
        }
    }
}

impl ValueMapState {
    /// Paints values, or ends that; what was painted is of another time.
    pub(crate) fn toggle(&mut self) {
        self.is_painted = !self.is_painted;
        self.map = None;
    }

    /// The map, where it is painted.
    pub(crate) fn painted(&self) -> Option<&(Arc<ValueMap>, u32)> {
        self.map.as_ref().filter(|_| self.is_painted)
    }

    /// The heading after this one: the best, then north and around.
    pub(crate) fn next_heading(&self) -> Option<Heading> {
        match self.heading {
            None => Some(Heading::North),
            Some(Heading::West) => None,
            Some(heading) => Some(heading.right()),
        }
    }
}
