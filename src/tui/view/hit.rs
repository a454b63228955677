//! What lies at a place of the screen, for the mouse. It asks the panels that draw it.

use ratatui::layout::{Position, Rect};

use super::log;
use super::map;
use super::reach;
use super::target::Target;
use super::timeline;
use super::world;
use crate::explore::verb::ExplorerPage;
use crate::house::view::decode;
use crate::tui::app::App;
use crate::tui::layout::ScreenLayout;

/// What lies there.
pub(crate) fn target_at(app: &App, at: Position) -> Option<Target> {
    let layout = app.layout()?;
    if layout.time.contains(at) {
        return timeline::step_at(app, layout.time, at.x).map(Target::Step);
    }
    match app.page {
        _ if layout.is_frame_alone => panels(app, &layout, at),
        ExplorerPage::Main | ExplorerPage::Frame => panels(app, &layout, at),
        ExplorerPage::World => {
            let [plan, list] = world::parts(layout.page);
            if plan.contains(at) { map::under(app, plan, at) } else { row(app, list, at) }
        }
        ExplorerPage::Branches => {
            row(app, layout.branches(app.rows(), app.wishes(), app.terminal.graphics.cell_pixels).list, at)
        }
        ExplorerPage::Actions => row(app, layout.page, at),
        ExplorerPage::Mind | ExplorerPage::Compare | ExplorerPage::Chain => None,
    }
}

fn panels(app: &App, layout: &ScreenLayout, at: Position) -> Option<Target> {
    if layout.reach.contains(at) {
        let many = app.page_of_candidates().len();
        let found = reach::places(inside(layout.reach)).take(many).position(|place| place.contains(at))?;
        return Some(Target::Candidate(found as u8 + 1));
    }
    if layout.log.contains(at) {
        return log::step_at(app, inside(layout.log), at.y).map(Target::Step);
    }
    if layout.map.contains(at) {
        return map::under(app, layout.map, at);
    }
    let picture = app.picture_area().filter(|area| area.contains(at))?;
    let frame = &app.session.now.as_ref()?.frame;
    let scaled = |from: u16, length: u16, size: usize| (2 * usize::from(from) + 1) * size / (2 * usize::from(length));
    let (x, y) =
        (scaled(at.x - picture.x, picture.width, frame.width), scaled(at.y - picture.y, picture.height, frame.height));
    decode(*frame.ids.get(y * frame.width + x)?).map(Target::Thing)
}

/// The rows of a list that begins right under its title and keeps what is selected in sight.
fn row(app: &App, list: Rect, at: Position) -> Option<Target> {
    let inner = inside(list);
    if !inner.contains(at) {
        return None;
    }
    let first = (app.selected() + 1).saturating_sub(usize::from(inner.height));
    let row = first + usize::from(at.y - inner.y);
    (row < app.rows()).then_some(Target::Row(row))
}

/// A panel without its title.
fn inside(panel: Rect) -> Rect {
    Rect { y: panel.y + 1, height: panel.height.saturating_sub(1), ..panel }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::graphics::Protocol;
    use crate::tui::testing;
    use crate::tui::theme::Ability;

    #[test]
    fn what_is_drawn_can_be_picked() {
        let app = testing::app(120, 36, Protocol::HalfBlocks, Ability::FULL);
        let layout = app.layout().unwrap();
        let at = |area: Rect, x: u16, y: u16| target_at(&app, Position { x: area.x + x, y: area.y + y });
        assert_eq!(at(layout.reach, 3, 1), Some(Target::Candidate(1)));
        assert_eq!(at(layout.reach, 3, 3), Some(Target::Candidate(3)));
        assert_eq!(at(layout.reach, 3, 0), None, "a title is nothing to pick");
        assert_eq!(at(layout.log, 6, 1), Some(Target::Step(0)));
        let mug = testing::instance(&app, "Mug");
        let picture = app.picture_area().unwrap();
        let middle = |low: u16, high: u16, length: u16| (low + high) / 2 * length / 300;
        assert_eq!(
            at(picture, middle(80, 110, picture.width), middle(130, 165, picture.height)),
            Some(Target::Thing(mug))
        );
        let found: Vec<Target> = layout.map.positions().filter_map(|at| target_at(&app, at)).collect();
        assert!(
            found.iter().any(|hit| matches!(hit, Target::Cell(_)))
                && found.iter().any(|hit| matches!(hit, Target::Thing(_)))
        );
        assert_eq!(target_at(&app, Position { x: 0, y: 0 }), None);
    }
}
