//! The floor plan from above: where the agent is, where it has been, and what stands around it. North is up.

use std::collections::HashMap;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::chain::warmth;
use super::{fit, panel};
use crate::domain::place::{Cuboid, Rect as Floor};
use crate::domain::{Cell, Class, Heading, Instance, Pose};
use crate::run::landscape::Landscape;
use crate::tui::app::App;
use crate::tui::engine::Snapshot;
use crate::tui::inspect::things;
use crate::tui::theme::THEME;
use crate::tui::verb::Page;

/// The panel with the floor plan.
pub struct Map<'a>(pub &'a App);

/// Furniture that begins higher above the floor than this hangs over other furniture and is left out, in millimetres.
const OVERHEAD: i32 = 1200;
/// The side of the smallest square that is drawn, in millimetres.
const FINEST: i32 = 50;
/// How far the shade of what the agent looks at reaches, in millimetres.
const GAZE: f32 = 3000.0;

const GROUND: Color = Color::Rgb(38, 41, 46);
const WALKABLE: Color = Color::Rgb(58, 63, 71);
const SEEN: Color = Color::Rgb(82, 90, 101);
const WALL: Color = Color::Rgb(120, 124, 130);
const PATH: Color = Color::Rgb(86, 140, 190);
const AGENT: Color = Color::Rgb(80, 220, 255);
const TARGET: Color = Color::Rgb(255, 214, 0);
const INK: Color = Color::Rgb(16, 16, 18);
/// Names are cut to no fewer columns than this.
const SHORTEST: usize = 5;

impl Widget for Map<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(now) = &app.now else {
            panel(buf, area, "Map", "");
            return;
        };
        let target = app
            .thought
            .as_ref()
            .and_then(|(decision, words)| Some((decision.action.target?, words)))
            .filter(|(target, _)| now.world.class_of(&now.scene, *target).is_some());
        let right = match (&app.landscape, target) {
            (Some(values), _) => legend(values),
            (None, Some((_, words))) => words.clone(),
            (None, None) => String::new(),
        };
        let inner = panel(buf, area, "Map", &right);
        let inspected = match app.page {
            Page::World => things(now).get(app.selected).map(|thing| thing.instance),
            _ => None,
        };
        let ground = Ground::of(now, app.landscape.as_deref());
        let Some(plan) = Plan::fitting(&ground, inner) else { return };
        if app.ability.shades() {
            plan.shaded(&ground, buf)
        } else {
            plan.lettered(app, &ground, buf)
        }
        plan.marks(app, now, inspected.or(target.map(|(target, _)| target)), buf);
    }
}

/// What the painted values are, and their range.
fn legend(values: &Landscape) -> String {
    let far = if values.heights.len() < values.of {
        format!(" {}/{}", values.heights.len(), values.of)
    } else {
        String::new()
    };
    let range = values.range().map_or(String::new(), |(low, high)| format!(" {low:.2} to {high:.2}"));
    format!("{}{range}{far}", values.measure.words())
}

/// How millimetres become characters. A character is two squares high, one above the other.
struct Plan {
    area: Rect,
    /// Millimetres of a square's side.
    side: i32,
    /// The west edge and the north edge, in millimetres.
    west: i32,
    north: i32,
}

impl Plan {
    fn fitting(ground: &Ground, area: Rect) -> Option<Plan> {
        let bounds = ground.bounds?;
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
        Some(Plan { area, side, west, north })
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

    fn shaded(&self, ground: &Ground, buf: &mut Buffer) {
        let shade = |column: u16, square: u16| {
            let (x, z) = self.point(column, square);
            ground.colour(x, z)
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
        self.names(ground, buf);
    }

    /// Names furniture where its name fits and it is not under something else, the largest first.
    fn names(&self, ground: &Ground, buf: &mut Buffer) {
        let mut pieces = ground.furniture.clone();
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
            if named.contains(&piece.fixture)
                || (!whole && columns < SHORTEST)
                || ground.class(x, z) != Some(piece.class)
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
    fn lettered(&self, app: &App, ground: &Ground, buf: &mut Buffer) {
        let now = ground.now;
        for row in 0..self.area.height {
            for column in 0..self.area.width {
                let (x, upper) = self.point(column, 2 * row);
                let z = upper - self.side / 2;
                let cell = Cell::nearest(crate::domain::Point::new(x, 0, z));
                let symbol = if let Some(class) = ground.class(x, z) {
                    app.letters.letter(class)
                } else if now.scene.walls.iter().any(|wall| wall.footprint().contains(x, z)) {
                    '#'
                } else if let Some(share) = ground.values.get(&cell) {
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
    fn marks(&self, app: &App, now: &Snapshot, target: Option<Instance>, buf: &mut Buffer) {
        let shades = app.ability.shades();
        let mut mark = |x: i32, z: i32, symbol: char, style: Style| {
            if let Some((column, row)) = self.position(x, z) {
                let cell = &mut buf[(column, row)];
                let under = if cell.symbol() == "▀" || cell.symbol() == "▄" { cell.fg } else { cell.bg };
                cell.set_char(symbol).set_bg(under).set_style(style);
            }
        };
        for sighting in &now.view.sightings {
            let Instance::Object(index) = sighting.instance else { continue };
            if let Some(object) = now.world.object(index).filter(|_| !now.world.in_hand(index)) {
                let symbol = if shades { '•' } else { app.letters.letter(object.class) };
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

/// A box of a piece of furniture, from above.
#[derive(Clone, Copy)]
struct Piece {
    floor: Floor,
    class: Class,
    fixture: u16,
}

/// What is where on the floor.
struct Ground<'a> {
    now: &'a Snapshot,
    /// The share of each cell's value, where values are painted.
    values: HashMap<Cell, f32>,
    /// The furniture that stands on the floor or on other furniture, box by box, lowest first.
    furniture: Vec<Piece>,
    /// What the whole plan covers.
    bounds: Option<Floor>,
}

impl<'a> Ground<'a> {
    fn of(now: &'a Snapshot, values: Option<&Landscape>) -> Ground<'a> {
        let values = values.map_or_else(HashMap::new, Landscape::shares);
        let floor = now.scene.floor();
        let fixtures = (0u16..).zip(&now.scene.fixtures);
        let mut parts: Vec<_> = fixtures
            .flat_map(|(i, fixture)| fixture.body.iter().map(move |part| (part, fixture.class, i)))
            .filter(|(part, ..)| part.min.y - floor < OVERHEAD)
            .collect();
        parts.sort_by_key(|(part, ..)| part.max.y);
        let piece = |(part, class, fixture): (&Cuboid, Class, u16)| Piece { floor: part.footprint(), class, fixture };
        let furniture: Vec<Piece> = parts.into_iter().map(piece).collect();
        let cells = now.scene.cells.iter().map(|cell| {
            let at = cell.centre(0);
            Floor { min: [at.x, at.z], max: [at.x, at.z] }.grown(Cell::SIDE / 2)
        });
        let walls = now.scene.walls.iter().map(|wall| wall.footprint());
        let bounds = cells.chain(walls).chain(furniture.iter().map(|piece| piece.floor)).reduce(|a, b| Floor {
            min: [a.min[0].min(b.min[0]), a.min[1].min(b.min[1])],
            max: [a.max[0].max(b.max[0]), a.max[1].max(b.max[1])],
        });
        Ground { now, values, furniture, bounds }
    }

    /// The furniture at a point, the highest of it.
    fn class(&self, x: i32, z: i32) -> Option<Class> {
        self.furniture.iter().rev().find(|piece| piece.floor.contains(x, z)).map(|piece| piece.class)
    }

    fn colour(&self, x: i32, z: i32) -> Option<Color> {
        if !self.bounds?.contains(x, z) {
            return None;
        }
        if let Some(class) = self.class(x, z) {
            return Some(furniture_colour(class));
        }
        let now = self.now;
        if now.scene.walls.iter().any(|wall| wall.footprint().contains(x, z)) {
            return Some(WALL);
        }
        let cell = Cell::nearest(crate::domain::Point::new(x, 0, z));
        if !now.scene.has_cell(cell) {
            return Some(GROUND);
        }
        if let Some(&share) = self.values.get(&cell) {
            return Some(warmth(share));
        }
        if now.path.contains(&cell) {
            return Some(PATH);
        }
        Some(if gazed_at(now.world.agent, x, z) { SEEN } else { WALKABLE })
    }
}

fn extent(floor: &Floor) -> i64 {
    i64::from(floor.max[0] - floor.min[0]) * i64::from(floor.max[1] - floor.min[1])
}

/// Whether a point lies in the 60 degrees that the agent looks into.
fn gazed_at(pose: Pose, x: i32, z: i32) -> bool {
    let at = pose.cell.centre(0);
    let (dx, dz) = pose.heading.step();
    let (east, north) = ((x - at.x) as f32, (z - at.z) as f32);
    let ahead = east * f32::from(dx) + north * f32::from(dz);
    let aside = east * f32::from(dz) - north * f32::from(dx);
    ahead > 0.0 && ahead < GAZE && aside.abs() < ahead * 0.577
}

/// A muted colour for a class of furniture, the same everywhere.
fn furniture_colour(class: Class) -> Color {
    const COLOURS: [(u8, u8, u8); 12] = [
        (134, 104, 74),
        (108, 122, 137),
        (146, 126, 92),
        (96, 118, 100),
        (150, 110, 100),
        (120, 110, 140),
        (104, 128, 128),
        (140, 120, 120),
        (112, 100, 84),
        (128, 134, 104),
        (100, 108, 124),
        (148, 132, 112),
    ];
    let (r, g, b) = COLOURS[class.index() * 5 % COLOURS.len()];
    Color::Rgb(r, g, b)
}
