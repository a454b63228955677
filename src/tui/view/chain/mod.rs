//! The page of a chain: how each link came out, how warm each was over time, and what the selected one began and ended with.
//! Where two policies followed the same chain, they stand side by side.

mod link_values;
mod link;
mod links;
#[cfg(test)]
mod page_tests;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::Widget;

use crate::explore::chain_report::ChainReport;
use crate::tui::app::App;
use crate::tui::theme::THEME;
use crate::tui::view::panel::{panel, put, wrap};
use link::LinkPanel;
use link_values::LinkValueStrips;
use links::Links;

/// Rows that the selected link takes at least, where it is shown.
const LINK: u16 = 6;
/// Links that a strip shows at least, where there are so many.
const SHOWN: u16 = 4;

/// The page: links, their values over time, and the selected link.
pub(crate) struct ChainView<'a>(pub(crate) &'a App);

impl Widget for ChainView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(chain) = &app.chain.own else {
            let inner = panel(buf, area, "Chain", app.session.working.as_deref().unwrap_or(""));
            let text = "A chain is a list of instructions that are followed one after the other from this state. Press enter \
                        and type one (take the knife; slice the tomato), or nothing for the steps of the task. w then shows \
                        which link breaks, and A how another agent fares with it.";
            for (row, line) in (0..).zip(wrap(text, usize::from(inner.width), "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
            return;
        };
        let sides: Vec<&ChainReport> = std::iter::once(chain).chain(&app.chain.rival).collect();
        let [table, strips, link] = parts(area, chain.links.len() as u16, sides.len() as u16);
        Links { app, sides: &sides }.render(table, buf);
        LinkValueStrips { sides: &sides, selected: app.chain.selected }.render(strips, buf);
        if link.height > 0 {
            LinkPanel { app, sides: &sides }.render(link, buf);
        }
    }
}

/// The parts of the page for so many links and policies: the table, the strips, and the selected link where there is room.
fn parts(area: Rect, links: u16, sides: u16) -> [Rect; 3] {
    let table = (links + 2 + sides).min(area.height / 2);
    let wanted = sides * (links + 1) + 1;
    let left = area.height - table;
    // A small screen shows strips rather than what is selected.
    let strips = wanted.min(left.saturating_sub(LINK)).max((sides * (links.min(SHOWN) + 1) + 1).min(left));
    let link = if left - strips < 3 { 0 } else { left - strips };
    let strips = left - link;
    let from = |y: u16, height: u16| Rect { y: area.y + y, height, ..area };
    [from(0, table), from(table, strips), from(table + strips, link)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_fill_the_page_and_every_strip_shows_something() {
        for height in [20, 32, 56] {
            for links in [1, 3, 9, 30] {
                for sides in [1, 2] {
                    let area = Rect { x: 0, y: 1, width: 80, height };
                    let [table, strips, link] = parts(area, links, sides);
                    assert_eq!(table.height + strips.height + link.height, height, "{links} links");
                    let least = sides * (links.min(3) + 1);
                    assert!(table.height > 3 && strips.height > least, "{links} links in {height} rows: {strips:?}");
                }
            }
        }
    }
}
