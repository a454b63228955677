//! The screen: one widget a panel, drawn from the state alone.

mod actions;
pub(crate) mod annotate;
pub(crate) mod annotate_layout;
mod branches;
mod chain;
mod compare;
mod frame;
mod floor_plan;
pub(crate) mod hit;
pub(crate) mod help;
mod instruction;
mod log;
mod map;
mod meaning;
mod mind;
mod palette;
pub(crate) mod panel;
mod picture;
mod reach;
pub(super) mod start;
mod status;
mod suggestions;
pub(crate) mod target;
mod task;
mod choices;
mod timeline;
mod value_colour;
mod wish_list;
mod world;
#[cfg(test)]
mod tests;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Paragraph, Widget, Wrap};

use super::app::App;
use super::keys::Mode;
use super::layout::TINIEST;
use crate::explore::verb::ExplorerPage;

impl Widget for &App {
    fn render(self, area: Rect, buf: &mut Buffer) {
        // The terminal has another size already, and its message is under way.
        if area.as_size() != self.terminal.size {
            return;
        }
        let Some(layout) = self.layout() else {
            too_small(area, buf);
            return;
        };
        status::HeaderRow(self).render(layout.header, buf);
        match self.page {
            _ if layout.is_frame_alone => frame::FramePanel(self).render(layout.sees, buf),
            ExplorerPage::Branches => branches::BranchesView(self).render(layout.page, buf),
            ExplorerPage::Mind => choices::ChoicesView(self).render(layout.page, buf),
            ExplorerPage::World => world::WorldView(self).render(layout.page, buf),
            ExplorerPage::Compare => compare::CompareView(self).render(layout.page, buf),
            ExplorerPage::Chain => chain::ChainView(self).render(layout.page, buf),
            ExplorerPage::Actions => actions::ActionsView(self).render(layout.page, buf),
            ExplorerPage::Main | ExplorerPage::Frame => {
                frame::FramePanel(self).render(layout.sees, buf);
                reach::ReachPanel(self).render(layout.reach, buf);
                mind::MindPanel(self).render(layout.distribution, buf);
                task::TaskPanel(self).render(layout.task, buf);
                log::LogPanel(self).render(layout.log, buf);
                map::MapPanel(self).render(layout.map, buf);
            }
        }
        timeline::TimelineRow(self).render(layout.time, buf);
        instruction::InstructionRow(self).render(layout.instruction, buf);
        meaning::MeaningRow(self).render(layout.meaning, buf);
        status::StatusRow(self).render(layout.status, buf);
        match self.input.mode {
            Mode::Help => help::HelpOverlay(self).render(area, buf),
            Mode::Palette => palette::PaletteOverlay(self).render(layout.page, buf),
            Mode::Typing => suggestions::SuggestionsOverlay(self).render(layout.page, buf),
            Mode::WishList => wish_list::WishListOverlay(self).render(layout.page, buf),
            Mode::Watch | Mode::Manual => {}
        }
        self.config.scheme.paint(buf);
        self.terminal.ability.adapt(buf);
    }
}

fn too_small(area: Rect, buf: &mut Buffer) {
    let (width, height) = TINIEST;
    let text = format!(
        "This terminal is too small: {} x {}. The explorer needs {width} x {height}, and waits. Make it larger, or press q to quit.",
        area.width, area.height
    );
    Paragraph::new(text).wrap(Wrap { trim: true }).render(area, buf);
}
