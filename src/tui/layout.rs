//! Where everything is on the screen. Nothing moves unless the terminal's size does.

use ratatui::layout::Rect;

use super::graphics::Protocol;

/// The smallest screen with all panels; a smaller one shows the frame alone.
pub(crate) const SMALLEST: (u16, u16) = (60, 20);
/// The smallest screen that is drawn.
pub(crate) const TINIEST: (u16, u16) = (24, 9);
/// Rows under the picture for the letters' meaning, where letters are the picture.
pub(crate) const LEGEND: u16 = 3;

/// The panels of the screen; each has its title in its first row.
///
/// ```text
/// header: scene, step, seed, who acts
/// +- Sees -----------------+- Mind -------------------+
/// |                        |                          |
/// |        picture         +- Task ------+- Map ------+
/// |                        |             |            |
/// +- In reach -------------+- Log -------+            |
/// |                        |             |            |
/// time: the steps of the branch in hand
/// instruction
/// meaning: how it is understood
/// status: keys, graphics
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ScreenLayout {
    /// The first row.
    pub(crate) header: Rect,
    /// What the agent sees.
    pub(crate) sees: Rect,
    /// Hand and interactions.
    pub(crate) reach: Rect,
    /// What the policy thinks.
    pub(crate) distribution: Rect,
    /// The subtasks, and what the current one waits for.
    pub(crate) task: Rect,
    /// The newest lines of the log.
    pub(crate) log: Rect,
    /// The floor plan.
    pub(crate) map: Rect,
    /// The steps of the branch in hand.
    pub(crate) time: Rect,
    /// What a page fills: everything between the header and the timeline.
    pub(crate) page: Rect,
    /// The instruction, or the line that is typed.
    pub(crate) instruction: Rect,
    /// How the instruction is understood.
    pub(crate) meaning: Rect,
    /// The last row.
    pub(crate) status: Rect,
    /// The frame has all the room; panels and pages have none.
    pub(crate) is_frame_alone: bool,
}

/// The parts of the page of branches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BranchesLayout {
    /// The tree of branches.
    pub(crate) list: Rect,
    /// What was told on the branch in hand.
    pub(crate) wishes: Rect,
    /// Everything under it.
    pub(crate) below: Rect,
    /// The steps of two branches.
    pub(crate) steps: Rect,
    /// Two pictures side by side.
    pub(crate) frames: Rect,
}

/// What the panels on the right need: the map, a gap, and words; and on a narrow screen.
const NARROWEST_RIGHT: (u16, u16) = (46, 38);

impl ScreenLayout {
    /// The layout of a screen; `None` when it is too small for anything.
    pub(crate) fn of(screen: Rect) -> Option<ScreenLayout> {
        if screen.width < SMALLEST.0 || screen.height < SMALLEST.1 {
            return ScreenLayout::frame_alone(screen);
        }
        let rect = |x: u16, y: u16, width: u16, height: u16| Rect { x: screen.x + x, y: screen.y + y, width, height };
        let (width, height) = (screen.width, screen.height);
        let body = height - 5;
        // The picture is square, two columns to a row; what remains of its column lists the interactions.
        let listed = match body {
            ..18 => 4,
            18..30 => 5,
            30.. => 8,
        };
        let narrowest = if width < 80 { NARROWEST_RIGHT.1 } else { NARROWEST_RIGHT.0 };
        let left = (2 * (body - 2 - listed)).min(width * 45 / 100).min(width - 2 - narrowest).min(140);
        let sees = 1 + left / 2;
        let right = width - left - 2;
        let distribution = match body {
            ..19 => 8,
            19..30 => 9,
            30.. => 13,
        };
        let below = body - distribution;
        let map = (right * 45 / 100).max(22).min(right - 20).min(2 * below + 2).min(80);
        let words = right - map - 2;
        let task = if below < 10 { below.div_ceil(2) } else { (below / 2).clamp(6, 12) };
        let x = left + 2;
        Some(ScreenLayout {
            header: rect(0, 0, width, 1),
            sees: rect(0, 1, left, sees),
            reach: rect(0, 1 + sees, left, body - sees),
            distribution: rect(x, 1, right, distribution),
            task: rect(x, 1 + distribution, words, task),
            log: rect(x, 1 + distribution + task, words, below - task),
            map: rect(x + words + 2, 1 + distribution, map, below),
            time: rect(0, height - 4, width, 1),
            page: rect(0, 1, width, body),
            instruction: rect(0, height - 3, width, 1),
            meaning: rect(0, height - 2, width, 1),
            status: rect(0, height - 1, width, 1),
            is_frame_alone: false,
        })
    }

    /// The frame at the largest size, with what is said and told; `None` when the screen is too small for anything.
    pub(crate) fn frame_alone(screen: Rect) -> Option<ScreenLayout> {
        if screen.width < TINIEST.0 || screen.height < TINIEST.1 {
            return None;
        }
        let rect = |y: u16, height: u16| Rect { y: screen.y + y, height, ..screen };
        let height = screen.height;
        let time = u16::from(height >= 12);
        let (page, none) = (rect(1, height - 4 - time), Rect { width: 0, height: 0, ..screen });
        Some(ScreenLayout {
            header: rect(0, 1),
            sees: page,
            reach: none,
            distribution: none,
            task: none,
            log: none,
            map: none,
            time: rect(height - 3 - time, time),
            page,
            instruction: rect(height - 3, 1),
            meaning: rect(height - 2, 1),
            status: rect(height - 1, 1),
            is_frame_alone: true,
        })
    }

    /// The cells that a square picture fills, in the middle of its panel.
    pub(crate) fn picture(&self, protocol: Protocol, cell_pixels: (u16, u16)) -> Rect {
        let legend = if protocol == Protocol::Ascii && self.sees.height > 2 * LEGEND { LEGEND } else { 0 };
        let inner = Rect { y: self.sees.y + 1, height: self.sees.height.saturating_sub(1 + legend), ..self.sees };
        pictured(inner, 1, cell_pixels)
    }

    /// The parts of the page of branches: the list of so many branches, so many wishes, the steps side by side, and two square
    /// pictures.
    pub(crate) fn branches(&self, many: usize, wishes: usize, cell_pixels: (u16, u16)) -> BranchesLayout {
        let page = self.page;
        let told = (wishes as u16).saturating_add(1).clamp(2, page.height / 4);
        let tall = (many as u16).saturating_add(1).clamp(2, page.height / 2 - told);
        let list = Rect { height: tall, ..page };
        let wishes = Rect { y: page.y + tall, height: told, ..page };
        let below = Rect { y: page.y + tall + told, height: page.height - tall - told, ..page };
        let (across, down) = (u32::from(cell_pixels.0.max(1)), u32::from(cell_pixels.1.max(1)));
        // Twice a square and a gap; the title and the names take two rows.
        let widest = u32::from(page.width) * if page.width < 110 { 4 } else { 5 } / 10;
        let rows = (widest * across / (2 * down)).min(u32::from(below.height.saturating_sub(2)));
        let columns = (2 * rows * down / across).min(widest);
        let (rows, columns) = (rows as u16, columns as u16);
        let frames = Rect { x: below.right() - columns, y: below.y + 2, width: columns, height: rows };
        BranchesLayout { list, wishes, below, steps: Rect { width: below.width - columns - 2, ..below }, frames }
    }

    /// How many interactions the list shows at a time.
    pub(crate) fn interactions(&self) -> usize {
        if self.is_frame_alone {
            return 9;
        }
        let rows = usize::from(self.reach.height.saturating_sub(1));
        let columns = if self.reach.width >= 60 { 2 } else { 1 };
        (rows * columns).min(9)
    }
}

/// The cells in the middle of an area's top that so many square pictures in a row fill.
pub(crate) fn pictured(area: Rect, many: u32, cell_pixels: (u16, u16)) -> Rect {
    let (across, down) = (u32::from(cell_pixels.0.max(1)), u32::from(cell_pixels.1.max(1)));
    let many = many.max(1);
    let width = (many * u32::from(area.height) * down / across).min(u32::from(area.width));
    let height = (width * across).div_ceil(down * many).min(u32::from(area.height));
    let (width, height) = (width as u16, height as u16);
    Rect { x: area.x + (area.width - width) / 2, y: area.y, width, height }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_fill_the_screen_without_overlap_at_every_size() {
        let large = [(80, 24), (81, 25), (100, 30), (120, 36), (200, 60), (250, 24), (80, 100), (400, 120)];
        let small = [(60, 20), (80, 23), (79, 24), (60, 60), (61, 21), (200, 20)];
        for (width, height) in large.into_iter().chain(small) {
            let narrowest = if width < 80 || height < 24 { 16 } else { 22 };
            let layout = ScreenLayout::of(Rect::new(0, 0, width, height)).unwrap();
            let panels = [
                layout.header,
                layout.sees,
                layout.reach,
                layout.distribution,
                layout.task,
                layout.log,
                layout.map,
                layout.time,
                layout.instruction,
                layout.meaning,
                layout.status,
            ];
            for (at, panel) in panels.iter().enumerate() {
                assert!(panel.right() <= width && panel.bottom() <= height, "{width}x{height}: {panel:?}");
                assert!(panel.width >= narrowest && panel.height >= 1, "{width}x{height}: {panel:?}");
                for other in &panels[at + 1..] {
                    assert!(!panel.intersects(*other), "{width}x{height}: {panel:?} {other:?}");
                }
            }
            for (many, pixels) in [(1, (8, 16)), (7, (10, 20)), (90, (9, 20)), (3, (20, 20))] {
                let parts = layout.branches(many, many, pixels);
                assert!(!parts.list.intersects(parts.below) && !parts.steps.intersects(parts.frames), "{parts:?}");
                assert!(!parts.wishes.intersects(parts.below) && !parts.wishes.intersects(parts.list), "{parts:?}");
                assert!(parts.below.union(parts.frames) == parts.below && parts.frames.height >= 4, "{parts:?}");
            }
            assert!(layout.interactions() >= 4);
            for protocol in Protocol::ALL {
                let picture = layout.picture(protocol, (8, 16));
                let least = if narrowest < 22 { 12 } else { 18 };
                assert!(layout.sees.union(picture) == layout.sees && picture.width >= least, "{picture:?}");
            }
        }
    }

    #[test]
    fn a_smaller_screen_shows_the_frame_alone_and_only_a_tiny_one_nothing() {
        for (width, height) in [(59, 20), (60, 19), (40, 23), (24, 9), (300, 9), (24, 90)] {
            let layout = ScreenLayout::of(Rect::new(0, 0, width, height)).unwrap();
            assert!(layout.is_frame_alone && layout.interactions() == 9);
            for protocol in Protocol::ALL {
                let picture = layout.picture(protocol, (8, 16));
                assert!(
                    layout.sees.union(picture) == layout.sees && picture.width >= 2,
                    "{width}x{height} {picture:?}"
                );
            }
            let rows = [layout.header, layout.sees, layout.time, layout.instruction, layout.meaning, layout.status];
            assert_eq!(rows.iter().map(|row| row.height).sum::<u16>(), height);
        }
        assert!(ScreenLayout::of(Rect::new(0, 0, 23, 24)).is_none());
        assert!(ScreenLayout::of(Rect::new(0, 0, 80, 8)).is_none());
    }
}
