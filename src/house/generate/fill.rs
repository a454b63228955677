//! Fills a furnished room with movable objects, where people keep such things.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::floor::{RoomFloor, overlap};
use super::rooms::{GeneratedShape, RoomPlan, rooms};
use crate::domain::class::Shape;
use crate::domain::place::Rect;
use crate::domain::scene::Mesh;
use crate::domain::world::{Instance, Object, Parent};
use crate::domain::{Class, Point, Scene};
use crate::house::placing::outline;

/// How often a place for an object is tried before it is left out.
const TRIES: usize = 40;
/// How far from somebody an object lies at most, in millimetres: well within reach.
const ARM: f32 = 1250.0;
/// Room between two things on one surface, in millimetres.
const GAP: i32 = 8;

/// What lies around already: where, between which heights, and in which fixture.
struct OccupiedVolume {
    holder: Option<usize>,
    ground: Rect,
    low: i32,
    high: i32,
}

/// The room that is left for objects.
struct Space {
    /// The height above which nothing may reach, for each fixture and each of its surfaces.
    ceilings: Vec<Vec<i32>>,
    taken: Vec<OccupiedVolume>,
}

/// Makes the room's objects; adds their shapes to the scene.
pub(crate) fn fill(plan: &RoomPlan, floor: &RoomFloor, scene: &mut Scene, rng: &mut ChaCha8Rng) -> Vec<Object> {
    let mut wanted: Vec<Class> = Vec::new();
    for (&class, &[chance, mean]) in &plan.objects {
        if rng.random_bool(chance) {
            let more = ((mean - 1.0) / 2.0).clamp(0.0, 1.0);
            let count = 1 + (0..2).filter(|_| rng.random_bool(more)).count();
            wanted.extend(std::iter::repeat_n(class, count));
        }
    }
    // Large things first: they find no room later.
    wanted.sort_by_key(|class| std::cmp::Reverse(class.info().size[0] * class.info().size[2]));
    let levels = |holder: usize| 0..scene.fixtures[holder].surfaces.len();
    let ceilings = (0..scene.fixtures.len())
        .map(|holder| levels(holder).map(|level| ceiling(scene, holder, level)).collect())
        .collect();
    let mut space = Space { ceilings, taken: Vec::new() };
    let mut objects = Vec::new();
    for class in wanted {
        let mesh = mesh(scene, class, rng);
        let object = Object { class, mesh: Some(mesh), open: class.info().openable, ..Object::default() };
        let placed = match stays_on_floor(class) {
            true => on_floor(floor, scene, &mut space, object, rng),
            false => in_receptacle(scene, &mut space, object, rng),
        };
        objects.extend(placed);
    }
    objects
}

/// A shape for a new object: one of at most two that its class has in this house.
fn mesh(scene: &mut Scene, class: Class, rng: &mut ChaCha8Rng) -> u16 {
    let known: Vec<usize> = (0..scene.meshes.len())
        .filter(|&index| scene.meshes[index].name.split('_').next() == Some(class.name()))
        .collect();
    if known.len() == 2 || (known.len() == 1 && rng.random_bool(0.5)) {
        return known[rng.random_range(0..known.len() as u32) as usize] as u16;
    }
    let info = class.info();
    let GeneratedShape { shape, size, hangs } = rooms().shapes.get(&class).copied().unwrap_or(GeneratedShape {
        shape: info.shape,
        size: info.size,
        hangs: false,
    });
    let scale = rng.random_range(90..=110);
    let size = size.map(|side| if side > 40 { side * scale / 100 * rng.random_range(95..=105) / 100 } else { side });
    // The lower end is on the support, the pivot the table's rest offset above it.
    let up = if hangs { -size[1] / 2 } else { size[1] / 2 - info.rest };
    let name = format!("{}_{}", class.name(), known.len() + 1);
    let shape = if shape == Shape::Cylinder && size[1] < 3 { Shape::Box } else { shape };
    scene.meshes.push(Mesh { name, shape, size, offset: [0, up, 0] });
    (scene.meshes.len() - 1) as u16
}

fn stays_on_floor(class: Class) -> bool {
    matches!(
        class.name(),
        "Plunger" | "ScrubBrush" | "Boots" | "Footstool" | "BasketBall" | "BaseballBat" | "TennisRacket"
    )
}

/// Things that only hang.
pub(crate) fn hangs(class: Class) -> bool {
    rooms().shapes.get(&class).is_some_and(|form| form.hangs)
}

/// How likely an object is to be in a receptacle of that class, next to the others that may hold it.
fn weight(receptacle: Class, content: Class) -> u32 {
    let usual = match receptacle.name() {
        "CounterTop" => 24,
        "DiningTable" | "Desk" | "Dresser" | "CoffeeTable" | "Bed" => 16,
        "SideTable" | "Sofa" | "TVStand" | "ArmChair" | "Ottoman" => 8,
        "Fridge" => 8,
        "Shelf" | "Toilet" | "Bathtub" | "Sink" => 5,
        "StoveBurner" | "ToiletPaperHanger" | "HandTowelHolder" | "TowelHolder" => 12,
        "Cart" | "Safe" | "Microwave" | "CoffeeMachine" => 3,
        "GarbageCan" => 2,
        _ => 1,
    };
    match (receptacle.name(), content.name()) {
        ("Bed", "Pillow") | ("Sofa", "Pillow") => 60,
        ("Fridge", "Lettuce" | "Egg" | "Tomato") => 30,
        // A cup of the wrong height does not go under the spout.
        ("CoffeeMachine", _) => 2,
        _ => usual,
    }
}

/// Puts an object into a receptacle that people would put it into.
fn in_receptacle(scene: &Scene, space: &mut Space, object: Object, rng: &mut ChaCha8Rng) -> Option<Object> {
    let holders: Vec<(usize, u32)> = scene
        .fixtures
        .iter()
        .enumerate()
        .filter(|(_, fixture)| fixture.class.holds(object.class) && !fixture.surfaces.is_empty())
        .filter(|(_, fixture)| !hangs(object.class) || fixture.class.name().ends_with("Holder"))
        .map(|(index, fixture)| (index, weight(fixture.class, object.class)))
        .collect();
    let total: u32 = holders.iter().map(|(_, weight)| weight).sum();
    if total == 0 {
        return None;
    }
    for _ in 0..TRIES {
        let mut draw = rng.random_range(0..total);
        let drawn = holders.iter().find(|(_, weight)| {
            let here = draw < *weight;
            draw = draw.saturating_sub(*weight);
            here
        });
        let Some(&(holder, _)) = drawn else { continue };
        if let Some(placed) = lay(scene, space, &object, holder, rng) {
            return Some(placed);
        }
    }
    None
}

/// Lays an object on a random free spot of one of a fixture's surfaces.
fn lay(scene: &Scene, space: &mut Space, object: &Object, holder: usize, rng: &mut ChaCha8Rng) -> Option<Object> {
    let fixture = &scene.fixtures[holder];
    let level = rng.random_range(0..fixture.surfaces.len() as u32) as usize;
    let surface = &fixture.surfaces[level];
    let area = surface.areas.get(rng.random_range(0..surface.areas.len().max(1) as u32) as usize)?;
    let at = Point::new(
        rng.random_range(area.min[0]..=area.max[0]),
        surface.height + object.class.info().rest,
        rng.random_range(area.min[1]..=area.max[1]),
    );
    let quarter =
        if fixture.class.name().ends_with("Holder") { fixture.facing.quarters() } else { rng.random_range(0..4) };
    let object = Object {
        at,
        turn: [0, (900 * quarter) as i16, 0],
        parent: Parent::In(Instance::Fixture(holder as u16)),
        ..object.clone()
    };
    let (_, size, offset) = object.shape_in(scene);
    let ground = outline(scene, &object, at);
    let (low, high) = (at.y + offset[1] - size[1] / 2, at.y + offset[1] + size[1] / 2);
    let ceiling = space.ceilings[holder][level];
    let edge = if is_open(fixture.class) { 90 } else { 60 };
    let stays = high < ceiling && covers(&area.grown(edge), &ground) || fixture.class.name().ends_with("Holder");
    // A spot to hang or to stand a single thing on is as large as a point.
    let is_point = area.min == area.max;
    let blocked = space.taken.iter().any(|other| {
        overlap(&ground.grown(GAP), &other.ground) && low < other.high && other.low < high
            || is_point && other.holder == Some(holder)
    });
    let near = || scene.cells.iter().any(|cell| cell.centre(at.y).floor_distance(at) <= ARM);
    if blocked || !(stays || is_point && high < ceiling) || !near() {
        return None;
    }
    space.taken.push(OccupiedVolume { holder: Some(holder), ground, low, high });
    Some(object)
}

fn covers(outer: &Rect, inner: &Rect) -> bool {
    (0..2).all(|axis| outer.min[axis] <= inner.min[axis] && inner.max[axis] <= outer.max[axis])
}

/// Whether things may stick out a little over a receptacle's edge.
fn is_open(class: Class) -> bool {
    !class.info().openable && !matches!(class.name(), "Sink" | "GarbageCan" | "Bathtub")
}

/// The height above which nothing may reach on a level of a fixture.
fn ceiling(scene: &Scene, holder: usize, level: usize) -> i32 {
    let fixture = &scene.fixtures[holder];
    let next = fixture.surfaces.get(level + 1).map(|surface| surface.height - 30);
    let lid = fixture.class.info().openable.then(|| fixture.body.first().map(|body| body.max.y - 5)).flatten();
    // Under a wall cabinet or a higher board.
    let above = scene.fixtures.iter().flat_map(|other| &other.body).filter(|body| {
        body.min.y > fixture.surfaces[level].height + 50
            && fixture.surfaces[level].areas.iter().any(|area| overlap(area, &body.footprint()))
    });
    above.map(|body| body.min.y - 10).chain(next).chain(lid).min().unwrap_or(i32::MAX)
}

/// Stands an object on the floor, by the wall where nobody walks.
fn on_floor(
    floor: &RoomFloor,
    scene: &Scene,
    space: &mut Space,
    object: Object,
    rng: &mut ChaCha8Rng,
) -> Option<Object> {
    for _ in 0..TRIES {
        let wall = floor.walls[rng.random_range(0..floor.walls.len() as u32) as usize];
        let turn = [0, (wall.site.facing.quarters() * 900 + 900 * rng.random_range(0..2)) as i16, 0];
        let object = Object { turn, ..object.clone() };
        let shape = outline(scene, &object, Point::default());
        let half = (0..2).map(|axis| (shape.max[axis] - shape.min[axis]) / 2 + 5).max().unwrap_or_default();
        if wall.length < 2 * half {
            continue;
        }
        let across = if wall.site.facing.quarters() % 2 == 0 { 1 } else { 0 };
        let deep = (shape.max[across] - shape.min[across]) / 2 + 5;
        let at = wall.site.point(rng.random_range(half..=wall.length - half), object.class.info().rest, deep);
        let ground = outline(scene, &object, at);
        let (_, size, offset) = object.shape_in(scene);
        let (low, high) = (at.y + offset[1] - size[1] / 2, at.y + offset[1] + size[1] / 2);
        let walked = floor.cells().iter().any(|cell| {
            let centre = cell.centre(0);
            ground.grown(90).contains(centre.x, centre.z)
        });
        let near = floor.cells().iter().any(|cell| cell.centre(at.y).floor_distance(at) < 900.0);
        let blocked =
            space.taken.iter().any(|other| overlap(&ground, &other.ground) && low < other.high && other.low < high);
        let hung = scene
            .fixtures
            .iter()
            .flat_map(|fixture| &fixture.body)
            .any(|body| overlap(&ground, &body.footprint()) && body.min.y < high + 300);
        if floor.is_free(&ground) && near && !walked && !blocked && !hung {
            space.taken.push(OccupiedVolume { holder: None, ground, low, high });
            return Some(Object { at, ..object });
        }
    }
    None
}
