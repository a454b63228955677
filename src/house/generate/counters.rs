//! Counters: a kitchen's run along one or two walls, and a bathroom's vanity. A counter is a slab on cabinets and drawers.

use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::builder::{Builder, INSET, inset, surface};
use super::floor::{RoomFloor, Wall, before, pick};
use super::piece_frame::PieceFrame;
use crate::domain::place::{Cuboid, Rect};
use crate::domain::scene::Surface;

const SLAB: i32 = 40;
const KICK: i32 = 90;
/// How far the fronts of drawers and doors stand before a carcass.
const FRONT: i32 = 15;
const BASIN: i32 = 170;

/// What a stretch of counter is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unit {
    Plain,
    Corner,
    Sink,
    Stove,
    Microwave,
    Coffee,
}

impl Unit {
    fn width(self, rng: &mut ChaCha8Rng) -> i32 {
        match self {
            Unit::Plain => pick(rng, [450, 750], 50),
            Unit::Corner => 620,
            Unit::Sink => 800,
            Unit::Stove => 640,
            Unit::Microwave => 650,
            Unit::Coffee => 450,
        }
    }
}

/// How a counter is built, in millimetres.
#[derive(Clone, Copy)]
struct CounterDimensions {
    height: i32,
    depth: i32,
    /// Where wall cabinets start; 0 for none.
    wall_cabinets: i32,
}

/// Builds a kitchen's counters, fridge, sink, stove, microwave and coffee machine; `false` when no wall is long enough.
pub(crate) fn kitchen(floor: &mut RoomFloor, out: &mut Builder, rng: &mut ChaCha8Rng) -> bool {
    let count = floor.walls.len();
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(rng);
    let build =
        CounterDimensions { height: pick(rng, [880, 960], 10), depth: 600, wall_cabinets: pick(rng, [1380, 1480], 20) };
    // Run A ends in the corner in which run B starts.
    order.into_iter().any(|a| {
        let (wall_a, wall_b) = (floor.walls[a], floor.walls[(a + 1) % count]);
        let is_corner = wall_a.site.facing.left() == wall_b.site.facing;
        is_corner && runs(floor, out, rng, build, wall_a, wall_b)
    })
}

fn runs(
    floor: &mut RoomFloor,
    out: &mut Builder,
    rng: &mut ChaCha8Rng,
    build: CounterDimensions,
    a: Wall,
    b: Wall,
) -> bool {
    let fridge = pick(rng, [680, 860], 20);
    let mut wanted = vec![Unit::Sink, Unit::Stove, Unit::Microwave, Unit::Coffee, Unit::Plain, Unit::Plain];
    wanted.extend(std::iter::repeat_n(Unit::Plain, rng.random_range(0..=3)));
    wanted.shuffle(rng);
    let (mut along_a, mut along_b) = (vec![(Unit::Corner, Unit::Corner.width(rng))], Vec::new());
    let (mut left_a, mut left_b) = (a.length - 620 - fridge - 60, b.length - 620 - 50);
    for unit in wanted {
        let width = unit.width(rng);
        let first = if rng.random_bool(0.5) { [true, false] } else { [false, true] };
        let target = first.into_iter().find(|&to_a| if to_a { left_a >= width } else { left_b >= width });
        match target {
            Some(true) => {
                left_a -= width;
                along_a.push((unit, width));
            }
            Some(false) => {
                left_b -= width;
                along_b.push((unit, width));
            }
            None if unit == Unit::Plain => {}
            None => return false,
        }
    }
    // A is laid out from its corner backwards, so its units are turned round.
    along_a.reverse();
    let length_a: i32 = along_a.iter().map(|(_, width)| width).sum();
    let length_b: i32 = along_b.iter().map(|(_, width)| width).sum();
    let site_a = a.site.moved(a.length - length_a, 0);
    let site_b = b.site.moved(620, 0);
    let site_fridge = a.site.moved(a.length - length_a - fridge - 20, 0);
    let mut trial = floor.clone();
    let depth = build.depth;
    let front_a = before(&site_a, length_a - 700, depth);
    let built = trial.build(&site_a.rect([0, length_a], [0, depth]), &[])
        && (length_b == 0 || trial.build(&site_b.rect([0, length_b], [0, depth]), &[]))
        && trial.build(&site_fridge.rect([0, fridge], [0, 680]), &[before(&site_fridge, fridge, 680)])
        && aprons(&mut trial, &site_a, &along_a, depth)
        && aprons(&mut trial, &site_b, &along_b, depth)
        && trial.is_free(&front_a);
    if built {
        *floor = trial;
        counter(out, rng, build, site_a, &along_a);
        counter(out, rng, build, site_b, &along_b);
        self::fridge(out, rng, site_fridge, fridge);
    }
    built
}

/// Reserves the floor before every unit that people use.
fn aprons(floor: &mut RoomFloor, site: &PieceFrame, units: &[(Unit, i32)], depth: i32) -> bool {
    let mut u = 0;
    units.iter().all(|&(unit, width)| {
        let front = before(&site.moved(u, 0), width, depth);
        u += width;
        unit == Unit::Corner || floor.reserve(front)
    })
}

fn fridge(out: &mut Builder, rng: &mut ChaCha8Rng, site: PieceFrame, width: i32) {
    let height = pick(rng, [1650, 1900], 25);
    let levels = rng.random_range(3..=4);
    let (low, high) = (pick(rng, [280, 420], 20), height - 420);
    let surfaces = (0..levels).map(|level| {
        let y = low + (high - low) * level / levels;
        surface(site.floor + y, site.rect([90, width - 90], [150, 560]))
    });
    let body = vec![site.cuboid([0, width], [0, height], [20, 680])];
    out.add("Fridge", site.point(width / 2, 0, 360), site.facing, body, surfaces.collect());
}

/// Builds one straight counter with what stands on it, under it and over it.
fn counter(out: &mut Builder, rng: &mut ChaCha8Rng, build: CounterDimensions, site: PieceFrame, units: &[(Unit, i32)]) {
    if units.is_empty() {
        return;
    }
    let CounterDimensions { height, depth, .. } = build;
    let place = out.fixtures.len();
    let (mut body, mut areas) = (Vec::new(), Vec::<[i32; 2]>::new());
    let mut u = 0;
    // The counter comes first in the list; its parts are known only after its units.
    out.add("CounterTop", site.point(0, height, depth / 2), site.facing, vec![], vec![]);
    for &(unit, width) in units {
        let here = site.moved(u, 0);
        if unit == Unit::Sink {
            body.extend(sink(out, here, width, height, depth));
        } else {
            body.push(here.cuboid([0, width], [height - SLAB, height], [0, depth + 20]));
        }
        let under = if unit == Unit::Sink { height - BASIN - 60 } else { height - SLAB };
        body.extend(below(out, rng, here, unit, width, under, build));
        appliance(out, rng, here, unit, width, height);
        if build.wall_cabinets > 0 && !matches!(unit, Unit::Stove | Unit::Corner) && rng.random_bool(0.75) {
            wall_cabinet(out, rng, here, width, build.wall_cabinets);
        }
        if matches!(unit, Unit::Plain | Unit::Corner) {
            match areas.last_mut() {
                Some(last) if last[1] == u => last[1] = u + width,
                _ => areas.push([u, u + width]),
            }
        }
        u += width;
    }
    let counter = &mut out.fixtures[place];
    let rects: Vec<Rect> = areas.iter().map(|&along| inset(site.rect(along, [40, depth + 20]), INSET)).collect();
    counter.body = body;
    counter.pivot = site.point(u / 2, height, depth / 2);
    counter.surfaces = vec![Surface { height: site.floor + height, areas: rects }];
}

/// A basin in a hole of the slab, and its faucet. Returns the slab around it.
fn sink(out: &mut Builder, site: PieceFrame, width: i32, height: i32, depth: i32) -> Vec<Cuboid> {
    let (u0, u1) = (width / 2 - 260, width / 2 + 260);
    let (v0, v1) = (130, depth - 70);
    let ground = height - BASIN;
    let basin = site.cuboid([u0, u1], [ground, height - 2], [v0, v1]);
    let inner = surface(site.floor + ground + 10, inset(site.rect([u0, u1], [v0, v1]), 110));
    out.add("Sink", site.point(width / 2, ground, (v0 + v1) / 2), site.facing, vec![basin], vec![inner]);
    let spout = site.cuboid([width / 2 - 60, width / 2 + 60], [height, height + 260], [40, 200]);
    out.add("Faucet", site.point(width / 2, height + 60, 70), site.facing, vec![spout], vec![]);
    let y = [height - SLAB, height];
    vec![
        site.cuboid([0, u0], y, [0, depth + 20]),
        site.cuboid([u1, width], y, [0, depth + 20]),
        site.cuboid([u0, u1], y, [0, v0]),
        site.cuboid([u0, u1], y, [v1, depth + 20]),
    ]
}

/// Cabinets and drawers under a slab. Returns the parts that are plain carcass.
fn below(
    out: &mut Builder,
    rng: &mut ChaCha8Rng,
    site: PieceFrame,
    unit: Unit,
    width: i32,
    top: i32,
    build: CounterDimensions,
) -> Vec<Cuboid> {
    let CounterDimensions { height, depth, .. } = build;
    let carcass = site.cuboid([0, width], [0, top], [0, depth - FRONT]);
    let inside = [10, width - 10];
    let all_drawers = matches!(unit, Unit::Plain | Unit::Coffee | Unit::Microwave) && rng.random_bool(0.3);
    match unit {
        Unit::Stove | Unit::Corner => vec![carcass],
        _ if all_drawers => {
            let count = rng.random_range(2..=4);
            let step = (top - KICK) / count;
            for index in 0..count {
                drawer(out, site, inside, [KICK + index * step + 5, KICK + (index + 1) * step - 5], depth);
            }
            vec![carcass]
        }
        _ => {
            let drawered = unit != Unit::Sink && rng.random_bool(0.4);
            let door_top = if drawered { top - 170 } else { top };
            cabinet(out, site, inside, [KICK, door_top - 5], [0, depth]);
            let mut rest = vec![site.cuboid([0, width], [0, KICK], [0, depth - 40])];
            if unit == Unit::Sink {
                // A panel before the basin.
                rest.push(site.cuboid([0, width], [top, height - SLAB], [depth - 50, depth - FRONT]));
            }
            if drawered {
                drawer(out, site, inside, [door_top + 5, top - 5], depth);
                rest.push(site.cuboid([0, width], [door_top, top], [0, depth - FRONT]));
            }
            rest
        }
    }
}

/// A drawer in the front of a carcass of that depth.
pub(crate) fn drawer(out: &mut Builder, site: PieceFrame, u: [i32; 2], y: [i32; 2], depth: i32) {
    let body = site.cuboid(u, y, [depth - 320, depth]);
    // Its contents lie in the part that comes out of the carcass when it opens.
    let ground = surface(site.floor + y[0] + 20, site.rect([u[0] + 60, u[1] - 60], [depth - 120, depth - 60]));
    let pivot = site.point((u[0] + u[1]) / 2, (y[0] + y[1]) / 2, depth - 90);
    out.add("Drawer", pivot, site.facing, vec![body], vec![ground]);
}

/// A cabinet with a door in front.
pub(crate) fn cabinet(out: &mut Builder, site: PieceFrame, u: [i32; 2], y: [i32; 2], v: [i32; 2]) {
    let body = site.cuboid(u, y, v);
    let (back, front) = (v[0] + 80.max((v[1] - v[0]) / 3), v[1] - 90);
    let ground = surface(site.floor + y[0] + 20, site.rect([u[0] + 80, u[1] - 80], [back.min(front), front]));
    let pivot = site.point((u[0] + u[1]) / 2, (y[0] + y[1]) / 2, v[1] - 60);
    out.add("Cabinet", pivot, site.facing, vec![body], vec![ground]);
}

fn wall_cabinet(out: &mut Builder, rng: &mut ChaCha8Rng, site: PieceFrame, width: i32, from: i32) {
    let top = from + pick(rng, [600, 700], 20);
    cabinet(out, site, [5, width - 5], [from, top], [0, 330]);
}

/// What stands on a unit of the counter.
fn appliance(out: &mut Builder, rng: &mut ChaCha8Rng, site: PieceFrame, unit: Unit, width: i32, height: i32) {
    let mid = width / 2;
    match unit {
        Unit::Microwave => {
            let (half, tall) = (pick(rng, [250, 290], 10), pick(rng, [300, 340], 10));
            let body = site.cuboid([mid - half, mid + half], [height, height + tall], [60, 460]);
            let inner = surface(site.floor + height + 45, site.rect([mid - 130, mid + 50], [230, 350]));
            out.add("Microwave", site.point(mid, height, 260), site.facing, vec![body], vec![inner]);
        }
        Unit::Coffee => {
            let body = site.cuboid([mid - 120, mid + 120], [height, height + 380], [80, 420]);
            let tray = surface(site.floor + height + 45, site.rect([mid - 30, mid + 30], [330, 350]));
            out.add("CoffeeMachine", site.point(mid, height, 300), site.facing, vec![body], vec![tray]);
        }
        Unit::Stove => {
            for (du, v) in [(-150, 180), (150, 180), (-150, 450), (150, 450)] {
                let u = mid + du;
                let body = site.cuboid([u - 105, u + 105], [height, height + 15], [v - 105, v + 105]);
                let ring = surface(site.floor + height + 15, site.rect([u, u], [v, v]));
                out.add("StoveBurner", site.point(u, height, v), site.facing, vec![body], vec![ring]);
            }
        }
        Unit::Plain | Unit::Corner | Unit::Sink => {}
    }
}

/// A bathroom's vanity: a counter with one or two basins.
pub(crate) fn vanity(out: &mut Builder, rng: &mut ChaCha8Rng, site: PieceFrame, width: i32, depth: i32, height: i32) {
    let mut units = Vec::new();
    let mut left = width;
    let basins = if width >= 1600 { 2 } else { 1 };
    for _ in 0..basins {
        units.push((Unit::Sink, 640));
        left -= 640;
    }
    while left >= 250 {
        let take = if left < 700 { left } else { 400 };
        units.push((Unit::Plain, take));
        left -= take;
    }
    units.shuffle(rng);
    counter(out, rng, CounterDimensions { height, depth: depth - 20, wall_cabinets: 0 }, site, &units);
}
