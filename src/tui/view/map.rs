//! The floor plan from above: where the agent is, where it has been, and what stands around it. North is up.

use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::floor_plan::{FloorPlan, extent, furniture_colour};
use super::panel::{fit, panel, unsigned_zero};
use super::target::Target;
use crate::analysis::value_map::ValueMap;
use crate::domain::{Cell, Heading, Instance, Point};
use crate::explore::exploration::SessionSnapshot;
use crate::explore::inspect::things;
use crate::explore::verb::ExplorerPage;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The panel with the floor plan.
pub(crate) struct MapPanel<'a>(pub(crate) &'a App);

/// The side of the smallest square that is drawn, in millimetres.
const FINEST: i32 = 50;

const AGENT: Color = Color::Rgb(80, 220, 255);
const TARGET: Color = Color::Rgb(255, 214, 0);
const INK: Color = Color::Rgb(16, 16, 18);
/// Names are cut to no fewer columns than this.
const SHORTEST: usize = 5;

impl Widget for MapPanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(now) = &app.session.now else {
            panel(buf, area, "Map", "");
            return;
        };
        let target = app
            .session
            .decision
            .as_ref()
            .and_then(|(decision, words)| Some((decision.action.target?, words)))
            .filter(|(target, _)| now.world.class_of(&now.scene, *target).is_some());
        let values = app.value_map.map.as_ref().filter(|_| app.value_map.is_painted);
        let right = match (values, target) {
            (Some((values, step)), _) => {
                let room = usize::from(area.width).saturating_sub("Map".width() + 4);
                legend(values, app.value_map.heading, (*step != now.step).then_some(*step), room)
            }
            (None, Some((_, words))) => words.clone(),
            (None, None) => String::new(),
        };
        let inner = panel(buf, area, "Map", &right);
        let inspected = match app.page {
            ExplorerPage::World => things(now).get(app.world.selected).map(|thing| thing.instance),
            _ => None,
        };
        let plan = FloorPlan::of(now, values.map(|(values, _)| &**values), app.value_map.heading);
        let Some(scale) = MapScale::fitting(&plan, inner) else { return };
        if app.terminal.ability.shades() {
            scale.shaded(&plan, buf)
        } else {
            scale.lettered(app, &plan, buf)
        }
        scale.marks(app, now, inspected.or(target.map(|(target, _)| target)), buf);
    }
}

/// What the painted values are, their range, and the step they are for where that is another: as much of it as there is room for.
fn legend(values: &ValueMap, heading: Option<Heading>, other_step: Option<u32>, room: usize) -> String {
    let facing = heading.map_or("best heading", Heading::name);
    let (low, high) = values.range(heading).unwrap_or((0.0, 0.0));
    let (low, high) = (unsigned_zero(low), unsigned_zero(high));
    let far = values.cells.len() < values.of;
    let far = if far { format!(", {}/{}", values.cells.len(), values.of) } else { String::new() };
    let step = other_step.map_or(String::new(), |step| format!(", as of step {step}"));
    let mark = other_step.map_or(String::new(), |step| format!(" @{step}"));
    let (words, letter, short) =
        (values.measure.words(), values.measure.letter(), heading.map_or("best", Heading::name));
    let brief = |x: f32| format!("{x:.2}").replacen("0.", ".", 1);
    let forms = [
        format!("{words}, {facing}: {low:.2} to {high:.2}{far}{step}"),
        format!("{words}, {short}: {low:.2} to {high:.2}{step}"),
        format!("{letter}, {facing}: {low:.2} to {high:.2}{step}"),
        format!("{letter} {short} {low:.2} to {high:.2}{mark}"),
        format!("{letter} {short} {} to {}{mark}", brief(low), brief(high)),
        format!("{letter} {} to {}{mark}", brief(low), brief(high)),
    ];
    let fits = forms.iter().find(|form| form.width() <= room);
    fits.unwrap_or(&forms[5]).clone()
}

/// What lies under a place of the panel: a thing that is in view, furniture, or a cell of the floor.
pub(super) fn under(app: &App, area: Rect, at: Position) -> Option<Target> {
    let now = app.session.now.as_ref()?;
    let inner = Rect { y: area.y + 1, height: area.height.saturating_sub(1), ..area };
    let plan = FloorPlan::of(now, None, None);
    let scale = MapScale::fitting(&plan, inner).filter(|_| inner.contains(at))?;
    let place = |instance: Instance| now.world.position(&now.scene, instance).and_then(|p| scale.position(p.x, p.z));
    let seen = now.view.sightings.iter().map(|seen| seen.instance).filter(|seen| matches!(seen, Instance::Object(_)));
    if let Some(object) = seen.into_iter().find(|&object| place(object) == Some((at.x, at.y))) {
        return Some(Target::Thing(object));
    }
    let (x, z) = scale.point(at.x - inner.x, 2 * (at.y - inner.y));
    let z = z - scale.side / 2;
    if let Some(fixture) = plan.fixture(x, z) {
        return Some(Target::Thing(Instance::Fixture(fixture)));
    }
    let cell = Cell::nearest(Point::new(x, 0, z));
    now.scene.has_cell(cell).then_some(Target::Cell(cell))
}

/// How millimetres become characters. A character is two squares high, one above the other.
struct MapScale {
    area: Rect,
    /// Millimetres of a square's side.
    side: i32,
    /// The west edge and the north edge, in millimetres.
    west: i32,
    north: i32,
}

impl MapScale {
    fn fitting(plan: &FloorPlan, area: Rect) -> Option<MapScale> {
        let bounds = plan.bounds?;
        let (width, depth) = (bounds.max[0] - bounds.min[0], bounds.max[1] - bounds.min[1]);
        let (columns, squares) = (i32::from(area.width), 2 * i32::from(area.height));
        if columns == 0 || squares == 0 {
            return None;
        }
        let needed = (width as u32).div_ceil(columns as u32).max((depth as u32).div_ceil(squares as u32)) as i32;
        let side = needed.max(FINEST);
        let spare = |have: i32, want: i32| (have * side - want).max(0) / 2;
        let west = bounds.min[0] - spare(columns, width);
        let north = bounds.max[1] + spare(squares, depth);
        Some(MapScale { area, side, west, north })
    }

    /// The middle of a square, in millimetres.
    fn point(&self, column: u16, square: u16) -> (i32, i32) {
        (
            self.west + i32::from(column) * self.side + self.side / 2,
            self.north - i32::from(square) * self.side - self.side / 2,
        )
    }

    /// The character that a point lies in.
    fn position(&self, x: i32, z: i32) -> Option<(u16, u16)> {
        let column = (x - self.west).div_euclid(self.side);
        let row = (self.north - z).div_euclid(2 * self.side);
        let inside =
            (0..i32::from(self.area.width)).contains(&column) && (0..i32::from(self.area.height)).contains(&row);
        inside.then(|| (self.area.x + column as u16, self.area.y + row as u16))
    }

    fn shaded(&self, plan: &FloorPlan, buf: &mut Buffer) {
        let shade = |column: u16, square: u16| {
            let (x, z) = self.point(column, square);
            plan.colour(x, z)
        };
        for row in 0..self.area.height {
            for column in 0..self.area.width {
                let (upper, lower) = (shade(column, 2 * row), shade(column, 2 * row + 1));
                let cell = &mut buf[(self.area.x + column, self.area.y + row)];
                match (upper, lower) {
                    (None, None) => continue,
                    (Some(upper), lower) if Some(upper) == lower => cell.set_char(' ').set_bg(upper),
                    (Some(upper), lower) => cell.set_char('▀').set_fg(upper).set_bg(lower.unwrap_or(Color::Reset)),
                    (None, Some(lower)) => cell.set_char('▄').set_fg(lower),
                };
            }
        }
        self.names(plan, buf);
    }

    /// Names furniture where its name fits and it is not under something else, the largest first.
    fn names(&self, plan: &FloorPlan, buf: &mut Buffer) {
        let mut pieces = plan.furniture.clone();
        pieces.sort_by_key(|piece| (std::cmp::Reverse(extent(&piece.floor)), piece.class, piece.fixture));
        let mut taken: Vec<Rect> = Vec::new();
        let mut named: Vec<u16> = Vec::new();
        for piece in pieces {
            let floor = piece.floor;
            let columns = ((floor.max[0] - floor.min[0]) / self.side) as usize;
            let (x, z) = ((floor.min[0] + floor.max[0]) / 2, (floor.min[1] + floor.max[1]) / 2);
            let name = fit(piece.class.spoken(), columns);
            let whole = name == piece.class.spoken();
            let Some((column, row)) = self.position(x, z) else { continue };
            if named.contains(&piece.fixture) || (!whole && columns < SHORTEST) || plan.class(x, z) != Some(piece.class)
            {
                continue;
            }
            let width = name.width() as u16;
            let left = column.saturating_sub(width / 2).max(self.area.x);
            let place = Rect { x: left, y: row, width, height: 1 }.intersection(self.area);
            if taken
                .iter()
                .any(|other| other.intersects(Rect { x: place.x.saturating_sub(1), width: width + 2, ..place }))
            {
                continue;
            }
            let style = Style::new().fg(INK).bg(furniture_colour(piece.class));
            buf.set_stringn(place.x, place.y, &name, usize::from(place.width), style);
            taken.push(place);
            named.push(piece.fixture);
        }
    }

    /// Without colours: a letter for furniture, dots to walk on.
    fn lettered(&self, app: &App, plan: &FloorPlan, buf: &mut Buffer) {
        let now = plan.now;
        for row in 0..self.area.height {
            for column in 0..self.area.width {
                let (x, upper) = self.point(column, 2 * row);
                let z = upper - self.side / 2;
                let cell = Cell::nearest(Point::new(x, 0, z));
                let symbol = if let Some(class) = plan.class(x, z) {
                    app.frame.letters.letter(class)
                } else if now.scene.walls.iter().any(|wall| wall.footprint().contains(x, z)) {
                    '#'
                } else if let Some(share) = plan.values.get(&cell) {
                    char::from_digit((share * 9.0).round() as u32, 10).unwrap_or('9')
                } else if now.path.contains(&cell) {
                    'o'
                } else if now.scene.has_cell(cell) {
                    '.'
                } else {
                    continue;
                };
                let style = if symbol == '.' || symbol == '#' { THEME.quiet } else { Style::new() };
                buf[(self.area.x + column, self.area.y + row)].set_char(symbol).set_style(style);
            }
        }
    }

    /// The agent, what it is about to act on, and the things it sees.
    fn marks(&self, app: &App, now: &SessionSnapshot, target: Option<Instance>, buf: &mut Buffer) {
        let shades = app.terminal.ability.shades();
        let mut mark = |x: i32, z: i32, symbol: char, style: Style| {
            if let Some((column, row)) = self.position(x, z) {
                let cell = &mut buf[(column, row)];
                // Names of furniture stay legible; what is acted on, and the agent, matter more.
                if symbol == '•' && cell.symbol().chars().any(char::is_alphabetic) {
                    return;
                }
                let under = if cell.symbol() == "▀" || cell.symbol() == "▄" { cell.fg } else { cell.bg };
                cell.set_char(symbol).set_bg(under).set_style(style);
            }
        };
        for sighting in &now.view.sightings {
            let Instance::Object(index) = sighting.instance else { continue };
            if let Some(object) = now.world.object(index).filter(|_| !now.world.in_hand(index)) {
                let symbol = if shades { '•' } else { app.frame.letters.letter(object.class) };
                mark(
                    object.at.x,
                    object.at.z,
                    symbol,
                    Style::new().fg(if shades { Color::White } else { Color::Reset }),
                );
            }
        }
        if let Some(at) = target.and_then(|target| now.world.position(&now.scene, target)) {
            mark(at.x, at.z, '◆', Style::new().fg(TARGET).add_modifier(Modifier::BOLD));
        }
        let pose = now.world.agent;
        let arrow = match pose.heading {
            Heading::North => '▲',
            Heading::East => '▶',
            Heading::South => '▼',
            Heading::West => '◀',
        };
        let at = pose.cell.centre(0);
        mark(at.x, at.z, arrow, Style::new().fg(AGENT).add_modifier(Modifier::BOLD));
    }
}
