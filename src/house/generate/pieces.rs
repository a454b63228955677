//! One builder for each kind of furniture; counters have a file of their own.

use rand_chacha::ChaCha8Rng;

use super::builder::{Builder, INSET, inset, surface, top};
use super::counters::{cabinet, drawer, vanity};
use super::floor::pick;
use super::piece_frame::PieceFrame;
use crate::domain::scene::Surface;

/// How large a piece is, in millimetres, and what its front and top have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PieceDimensions {
    /// Along the wall.
    pub(crate) width: i32,
    /// Out of the wall.
    pub(crate) depth: i32,
    /// Of its top, or of its seat.
    pub(crate) height: i32,
    /// How many drawers its front has.
    pub(crate) drawers: i32,
    /// A desk lamp stands on it.
    pub(crate) lamp: bool,
}

/// Builds a piece that stands on the floor.
pub(crate) fn stand(kind: &str, out: &mut Builder, rng: &mut ChaCha8Rng, site: PieceFrame, build: PieceDimensions) {
    match kind {
        "Vanity" => vanity(out, rng, site, build.width, build.depth, build.height),
        "Bed" => bed(out, site, build),
        "Sofa" | "ArmChair" => seat(kind, out, site, build),
        "Toilet" => toilet(out, site, build),
        "Bathtub" => tub(out, site, build),
        "GarbageCan" => bin(out, site, build),
        "Safe" => shell(kind, out, site, build),
        "FloorLamp" => lamp(kind, out, site, build.width, build.height),
        "Shelves" => shelves(out, rng, site, build),
        "Wardrobe" => wardrobe(out, site, build),
        "Cart" => cart(out, site, build),
        _ => table(kind, out, site, build),
    }
}

/// A box with a top to put things on: tables, desks, dressers, stands.
fn table(kind: &str, out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, drawers, lamp: lit } = build;
    let body = site.cuboid([0, width], [0, height], [0, depth]);
    let mut surface = top(&body);
    if lit {
        // The lamp stands at the back of the left end, and nothing else does.
        surface.areas = vec![inset(site.rect([270, width], [0, depth]), INSET)];
        if width < 520 {
            surface.areas = vec![inset(site.rect([0, width], [200, depth]), INSET)];
        }
    }
    out.add(kind, site.point(width / 2, height, depth / 2), site.facing, vec![body], vec![surface]);
    if lit {
        lamp_at(out, site, "DeskLamp", [120.min(width / 2), 110], height, 230, 420);
    }
    let columns = if drawers > 3 { 2 } else { 1 };
    // A desk's drawers are at one side and leave room for the knees.
    let span = if kind == "Desk" { 420.min(width / 2) } else { width };
    let rows = drawers / columns;
    if rows == 0 {
        return;
    }
    let (low, high) = (height - 40 - (rows * 200).min(height - 100), height - 40);
    for column in 0..columns {
        for row in 0..rows {
            let u = [span * column / columns + 15, span * (column + 1) / columns - 15];
            let y = [low + (high - low) * row / rows + 6, low + (high - low) * (row + 1) / rows - 6];
            drawer(out, site, u, y, depth + 15);
        }
    }
}

/// A seat with a back, and with arms.
fn seat(kind: &str, out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let back = 200;
    let arm = 130;
    let body = vec![
        site.cuboid([arm, width - arm], [0, height], [back, depth]),
        site.cuboid([0, width], [0, height + 380], [0, back]),
        site.cuboid([0, arm], [0, height + 180], [back, depth]),
        site.cuboid([width - arm, width], [0, height + 180], [back, depth]),
    ];
    let ground = site.rect([arm, width - arm], [back, depth]);
    let seat = surface(site.floor + height, inset(ground, 90));
    out.add(kind, site.point(width / 2, 0, depth / 2), site.facing, body, vec![seat]);
}

fn bed(out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let body =
        vec![site.cuboid([0, width], [0, height], [60, depth]), site.cuboid([0, width], [0, height + 400], [0, 60])];
    let lying = surface(site.floor + height, inset(site.rect([0, width], [60, depth]), 130));
    out.add("Bed", site.point(width / 2, 0, depth / 2), site.facing, body, vec![lying]);
}

fn toilet(out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let body =
        vec![site.cuboid([30, width - 30], [0, 420], [180, depth]), site.cuboid([0, width], [0, height], [0, 190])];
    let tank = surface(site.floor + height, site.rect([90, width - 90], [80, 110]));
    out.add("Toilet", site.point(width / 2, 0, depth / 2), site.facing, body, vec![tank]);
}

fn tub(out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let body = site.cuboid([0, width], [0, height], [0, depth]);
    let ground = surface(site.floor + 130, inset(site.rect([0, width], [0, depth]), 200));
    out.add("Bathtub", site.point(width / 2, 140, depth / 2), site.facing, vec![body], vec![ground]);
}

fn bin(out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let body = site.cuboid([0, width], [0, height], [0, depth]);
    let ground = surface(site.floor + 60, inset(site.rect([0, width], [0, depth]), 80));
    out.add("GarbageCan", site.point(width / 2, 0, depth / 2), site.facing, vec![body], vec![ground]);
}

/// A box with a door: a safe.
fn shell(kind: &str, out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let body = site.cuboid([0, width], [0, height], [0, depth]);
    let ground = surface(site.floor + 50, site.rect([110, width - 110], [depth / 2, depth - 100]));
    out.add(kind, site.point(width / 2, height / 2, depth / 2), site.facing, vec![body], vec![ground]);
}

fn lamp(kind: &str, out: &mut Builder, site: PieceFrame, width: i32, height: i32) {
    lamp_at(out, site, kind, [width / 2, width / 2], 0, width, height);
}

/// A lamp of that width and height around (u, v), standing at height `y`.
fn lamp_at(out: &mut Builder, site: PieceFrame, kind: &str, [u, v]: [i32; 2], y: i32, width: i32, height: i32) {
    let half = width / 2;
    let body = site.cuboid([u - half, u + half], [y, y + height], [(v - half).max(0), v + half]);
    out.add(kind, site.point(u, y, v), site.facing, vec![body], vec![]);
}

/// A rack: one Shelf for each board.
fn shelves(out: &mut Builder, rng: &mut ChaCha8Rng, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let boards = (build.drawers.max(1)).min(height / 250 + 1);
    let low = if boards == 1 { height } else { pick(rng, [150, 300], 25).min(height) };
    for board in 0..boards {
        let y = low + (height - low) * board / (boards - 1).max(1);
        let body = site.cuboid([0, width], [y - 30, y], [0, depth]);
        let ground = inset(body.footprint(), INSET);
        let pivot = site.point(width / 2, y, depth / 2);
        out.add("Shelf", pivot, site.facing, vec![body], vec![surface(body.max.y, ground)]);
    }
}

/// A tall cupboard with two doors.
fn wardrobe(out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    for half in 0..2 {
        let u = [width * half / 2 + 5, width * (half + 1) / 2 - 5];
        cabinet(out, site, u, [60, height / 2], [0, depth]);
        cabinet(out, site, u, [height / 2 + 10, height], [0, depth]);
    }
}

fn cart(out: &mut Builder, site: PieceFrame, build: PieceDimensions) {
    let PieceDimensions { width, depth, height, .. } = build;
    let boards = [230, height];
    let body = boards.map(|y| site.cuboid([0, width], [y - 30, y], [0, depth]));
    let levels = boards
        .map(|y| Surface { height: site.floor + y, areas: vec![inset(site.rect([0, width], [0, depth]), INSET)] });
    out.add("Cart", site.point(width / 2, 0, depth / 2), site.facing, body.to_vec(), levels.to_vec());
}

/// Something that hangs on the wall around u = 0: a holder of towels or of paper.
pub(crate) fn hang(kind: &str, out: &mut Builder, rng: &mut ChaCha8Rng, site: PieceFrame) {
    let (half, y, deep) = match kind {
        "ToiletPaperHanger" => (70, pick(rng, [650, 900], 25), 90),
        "HandTowelHolder" => (140, pick(rng, [1450, 1600], 25), 70),
        _ => (270, pick(rng, [1250, 1400], 25), 80),
    };
    let body = site.cuboid([-half, half], [y - 25, y + 15], [0, deep]);
    // A towel's pivot is at its upper edge, the rest offset above its "support"; paper is held around its middle.
    let support = match kind {
        "ToiletPaperHanger" => y - 50,
        "HandTowelHolder" => y - 579,
        _ => y - 580,
    };
    let spot = surface(site.floor + support, site.rect([0, 0], [deep, deep]));
    out.add(kind, site.point(0, y, deep / 2), site.facing, vec![body], vec![spot]);
}
