//! Furnishes a room: finds a place for each piece along the walls or in the middle.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::builder::Builder;
use super::counters;
use super::floor::{RoomFloor, Wall, before, overlap, pick};
use super::piece_frame::PieceFrame;
use super::pieces::{self, PieceDimensions};
use super::rooms::{FurniturePiece, RoomPlan};
use crate::domain::place::Rect;
use crate::domain::{Cell, Heading, Point};

/// How often a place for a piece is tried before it is left out.
const TRIES: usize = 24;

/// Puts the room's furniture on the floor; `false` when a piece that every such room has found no place.
pub(crate) fn furnish(plan: &RoomPlan, floor: &mut RoomFloor, out: &mut Builder, rng: &mut ChaCha8Rng) -> bool {
    for piece in &plan.pieces {
        if !rng.random_bool(piece.chance) {
            continue;
        }
        let placed = match piece.kind.as_str() {
            "Run" => counters::kitchen(floor, out, rng),
            // A rack's count is that of its boards.
            "Shelves" => one(piece, floor, out, rng),
            "ToiletPaperHanger" | "HandTowelHolder" | "TowelHolder" => {
                (0..pick(rng, piece.count, 1)).filter(|_| hang(piece, floor, out, rng)).count() > 0
            }
            _ => (0..pick(rng, piece.count, 1)).filter(|_| one(piece, floor, out, rng)).count() > 0,
        };
        if !placed && piece.chance >= 1.0 {
            return false;
        }
    }
    true
}

/// Places one piece that stands on the floor.
fn one(piece: &FurniturePiece, floor: &mut RoomFloor, out: &mut Builder, rng: &mut ChaCha8Rng) -> bool {
    let drawers = if piece.kind == "Shelves" { piece.count } else { piece.drawers };
    for _ in 0..TRIES {
        let build = PieceDimensions {
            width: pick(rng, piece.width, 10),
            depth: pick(rng, piece.depth, 10),
            height: pick(rng, piece.height, 10),
            drawers: pick(rng, drawers, 1),
            lamp: rng.random_bool(piece.lamp),
        };
        let site = if piece.middle { middle(floor, rng, build) } else { along(floor, rng, build) };
        let footprint = site.rect([0, build.width], [0, build.depth]);
        let front = before(&site, build.width, build.depth);
        if floor.build(&footprint, &[front]) {
            pieces::stand(&piece.kind, out, rng, site, build);
            return true;
        }
    }
    false
}

/// A place along a wall, often in a corner or next to what stands there.
fn along(floor: &RoomFloor, rng: &mut ChaCha8Rng, build: PieceDimensions) -> PieceFrame {
    let wall = floor.walls[rng.random_range(0..floor.walls.len() as u32) as usize];
    let room = (wall.length - build.width).max(0);
    let u = match rng.random_range(0..4) {
        0 => 20.min(room),
        1 => (room - 20).max(0),
        _ => pick(rng, [0, room], 20),
    };
    wall.site.moved(u, 10)
}

/// A place away from the walls.
fn middle(floor: &RoomFloor, rng: &mut ChaCha8Rng, build: PieceDimensions) -> PieceFrame {
    let bounds = floor.bounds();
    let facing = Heading::ALL[rng.random_range(0..4u32) as usize];
    let origin = [0, 1].map(|axis| pick(rng, [bounds.min[axis] + 300, bounds.max[axis] - 300], 25));
    let site = PieceFrame { origin, facing, floor: super::floor::FLOOR };
    site.moved(-build.width / 2, -build.depth / 2)
}

/// Hangs a holder on a free stretch of wall that somebody can stand before.
fn hang(piece: &FurniturePiece, floor: &mut RoomFloor, out: &mut Builder, rng: &mut ChaCha8Rng) -> bool {
    let half = if piece.kind == "TowelHolder" { 300 } else { 180 };
    for _ in 0..2 * TRIES {
        let wall: Wall = floor.walls[rng.random_range(0..floor.walls.len() as u32) as usize];
        if wall.length < 2 * half {
            continue;
        }
        let site = wall.site.moved(pick(rng, [half, wall.length - half], 20), 0);
        let on_wall = site.rect([-half, half], [0, 120]);
        let near = site.rect([-400, 400], [200, 900]);
        let taken =
            out.fixtures.iter().flat_map(|fixture| &fixture.body).any(|body| overlap(&on_wall, &body.footprint()));
        if floor.is_free(&on_wall) && !taken && stands_in(floor.cells(), &near) {
            pieces::hang(&piece.kind, out, rng, site);
            return true;
        }
    }
    false
}

fn stands_in(cells: &[Cell], area: &Rect) -> bool {
    cells.iter().map(|cell| cell.centre(0)).any(|Point { x, z, .. }| area.contains(x, z))
}
