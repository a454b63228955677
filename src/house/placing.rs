//! Where a Put leaves an object: the free point of the receptacle that is nearest to the agent.

use super::camera::Camera;
use super::occlusion::in_sight;
use crate::domain::place::Rect;
use crate::domain::world::{Instance, Object, Parent, World};
use crate::domain::{Fixture, Point, Scene};

/// The raster of points that are tried, in millimetres.
const RASTER: i32 = 50;
/// How far a drawer's contents slide out with it, in millimetres (the median of recorded pickups).
pub(crate) const DRAWER_TRAVEL: i32 = 170;

/// The outline that an object covers on the floor plan when its pivot is at `at`, turned by whole quarter turns.
pub(crate) fn outline(scene: &Scene, object: &Object, at: Point) -> Rect {
    let (_, size, offset) = object.shape_in(scene);
    let yaw = i32::from(object.turn[1]);
    let (width, depth) = if (yaw + 450).rem_euclid(1800) >= 900 { (size[2], size[0]) } else { (size[0], size[2]) };
    let (right, ahead) = match (yaw + 450).rem_euclid(3600) / 900 {
        0 => (offset[0], offset[2]),
        1 => (offset[2], -offset[0]),
        2 => (-offset[0], -offset[2]),
        _ => (-offset[2], offset[0]),
    };
    let centre = [at.x + right, at.z + ahead];
    Rect { min: [centre[0] - width / 2, centre[1] - depth / 2], max: [centre[0] + width / 2, centre[1] + depth / 2] }
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    (0..2).all(|axis| a.min[axis] < b.max[axis] && b.min[axis] < a.max[axis])
}

/// The pivot that `object` gets in `receptacle`, or `None` when there is no room. `object.turn` is already what it will be.
///
/// In a fixture: on its lowest surface with room, at the free raster point nearest to the agent. First a point where the whole
/// outline is free and on the surface, then one where only the pivot is; where walls stand around, before both a free point
/// away from them, and before all a point in the agent's frame that no shelf and no rim hides; in a garbage can at last on
/// top of the rest. In a movable receptacle: at its pivot, moved aside for each thing that already lies there.
pub(crate) fn spot(scene: &Scene, world: &World, object: &Object, receptacle: Instance) -> Option<Point> {
    match receptacle {
        Instance::Object(holder) => {
            let holder = world.object(holder)?;
            let already = world.objects.iter().filter(|other| other.parent == Parent::In(receptacle)).count() as i32;
            let radius = holder.class.info().content_radius;
            // Fixed small steps around the middle: first the middle, then four sides, then the middle again, higher.
            let (dx, dz) = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)][already as usize % 5];
            let lift = 20 * (already / 5);
            let floor = holder.at.y - holder.class.info().rest + 10;
            let rest = object.class.info().rest.min(object_height(scene, object));
            Some(Point::new(holder.at.x + dx * radius / 2, floor + rest + lift, holder.at.z + dz * radius / 2))
        }
        Instance::Fixture(index) => {
            let fixture = scene.fixture(index)?;
            let taken: Vec<(i32, Rect)> = world
                .objects
                .iter()
                .filter(|other| other.parent == Parent::In(receptacle) && !other.sliced)
                .map(|other| (other.at.y, outline(scene, other, other.at)))
                .collect();
            let shift = if world.is_open(receptacle) { drawer_shift(scene, index) } else { Point::default() };
            let agent = world.agent.cell.centre(0);
            let mut points: Vec<(usize, i64, Point)> = Vec::new();
            for (level, surface) in fixture.surfaces.iter().enumerate() {
                for area in &surface.areas {
                    for (x, z) in raster(area) {
                        let at = Point::new(x + shift.x, surface.height + object.class.info().rest, z + shift.z);
                        let (dx, dz) = (i64::from(at.x - agent.x), i64::from(at.z - agent.z));
                        points.push((level, dx * dx + dz * dz, at));
                    }
                }
            }
            points.sort_by_key(|&(level, distance, at)| (level, distance, at));
            let eye = world.agent.cell.centre(scene.camera_y());
            let middle = object_height(scene, object) / 2 - object.class.info().rest;
            let camera = Camera::of(scene, world.agent);
            let seen = |at: Point| {
                let middle = Point::new(at.x, at.y + middle, at.z);
                camera.frames(middle.metres())
                    && in_sight(fixture, eye, Point::new(middle.x - shift.x, middle.y, middle.z - shift.z))
            };
            let fits = |level: usize, at: Point, demand: Demand, wants_sight: bool| {
                let surface = &fixture.surfaces[level];
                let ground = outline(scene, object, at);
                let same_level = |y: i32| (y - surface.height).abs() < 250 || fixture.surfaces.len() == 1;
                let (x, z) = (at.x - shift.x, at.z - shift.z);
                let on = |area: &Rect| match demand {
                    Demand::Inside => away_from_walls(fixture, area).contains(x, z),
                    Demand::Whole => area.grown(RASTER).contains(x, z),
                    Demand::Pivot | Demand::Heap => true,
                };
                let free = |other: &Rect| match demand {
                    Demand::Heap => true,
                    Demand::Pivot => !other.contains(at.x, at.z),
                    Demand::Inside | Demand::Whole => !overlap(&ground, other),
                };
                surface.areas.iter().any(on)
                    && taken.iter().filter(|(y, _)| same_level(*y)).all(|(_, other)| free(other))
                    && (!wants_sight || seen(at))
            };
            let demands = [
                (Demand::Inside, true),
                (Demand::Whole, true),
                (Demand::Inside, false),
                (Demand::Whole, false),
                (Demand::Pivot, false),
                (Demand::Heap, false),
            ];
            let walled = has_walls(fixture);
            // Without walls no place is away from them.
            let demands = demands.into_iter().filter(|&(demand, _)| walled || demand != Demand::Inside);
            let heaps = fixture.class.info().heaps;
            let demands = demands.filter(|&(demand, _)| heaps || demand != Demand::Heap);
            let first = |(demand, sight)| points.iter().find(|&&(level, _, at)| fits(level, at, demand, sight));
            demands.filter_map(first).map(|&(_, _, at)| at).next()
        }
    }
}

/// What is asked of a free place, most first.
#[derive(Clone, Copy, PartialEq)]
enum Demand {
    /// Away from the walls, and all of the object free.
    Inside,
    /// All of the object free.
    Whole,
    /// Its pivot free.
    Pivot,
    /// On top of what lies there: how things lie in a garbage can.
    Heap,
}

/// Whether walls stand around what lies in it.
fn has_walls(fixture: &Fixture) -> bool {
    fixture.class.info().openable || fixture.class.info().open_top
}

/// The middle third of a surface; behind a door all of its depth.
fn away_from_walls(fixture: &Fixture, area: &Rect) -> Rect {
    let across_x = fixture.facing.step().0 == 0;
    let mut middle = *area;
    for (axis, across) in [(0, across_x), (1, !across_x)] {
        if across || fixture.class.info().open_top {
            let third = (area.max[axis] - area.min[axis]) / 3;
            middle.min[axis] += third;
            middle.max[axis] -= third;
        }
    }
    middle
}

fn object_height(scene: &Scene, object: &Object) -> i32 {
    object.shape_in(scene).1[1]
}

/// The points of the 5 cm raster in a rectangle; its middle when it is smaller than that.
fn raster(area: &Rect) -> impl Iterator<Item = (i32, i32)> + use<> {
    let axis = |min: i32, max: i32| -> Vec<i32> {
        let steps = (max - min) / RASTER;
        let first = (min + max - steps * RASTER) / 2;
        (0..=steps).map(|step| first + step * RASTER).collect()
    };
    let (xs, zs) = (axis(area.min[0], area.max[0]), axis(area.min[1], area.max[1]));
    xs.into_iter().flat_map(move |x| zs.clone().into_iter().map(move |z| (x, z)))
}

/// How far a fixture's contents move when it is opened: drawers slide, doors do not.
pub(crate) fn drawer_shift(scene: &Scene, fixture: u16) -> Point {
    match scene.fixture(fixture) {
        Some(fixture) if fixture.class.info().slides => {
            let (dx, dz) = fixture.facing.step();
            Point::new(i32::from(dx) * DRAWER_TRAVEL, 0, i32::from(dz) * DRAWER_TRAVEL)
        }
        _ => Point::default(),
    }
}

/// Moves an object's contents, at any depth, by `by`.
pub(crate) fn carry_contents(world: &mut World, carrier: Instance, by: Point) {
    let moved: Vec<u16> = world.contents(carrier).collect();
    for index in moved {
        let at = &mut world.objects[usize::from(index)].at;
        *at = Point::new(at.x + by.x, at.y + by.y, at.z + by.z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::place::Cuboid;
    use crate::domain::scene::Surface;
    use crate::domain::{Class, Heading, Pose, Room};
    use crate::house::testing::{kitchen, named};

    /// How many soap bars go into a receptacle of 16 cm a side, of sixty.
    fn held_by(class: &str) -> usize {
        let body = Cuboid::between(Point::new(-100, 0, 500), Point::new(100, 300, 700));
        let surface = Surface { height: 20, areas: vec![body.footprint().grown(-20)] };
        let class = Class::named(class).unwrap();
        let (id, pivot, facing) = (class.name().to_string(), body.centre(), Heading::South);
        let fixture = Fixture { id, class, pivot, facing, body: vec![body], surfaces: vec![surface], stand: None };
        let (name, format_version) = ("test".to_string(), Scene::FORMAT);
        let fixtures = vec![fixture];
        let (walls, cells, meshes) = (Vec::new(), Vec::new(), Vec::new());
        let scene = Scene { format_version, name, room: Room::Bathroom, agent_y: 900, cells, fixtures, walls, meshes };
        let soap = Object { class: Class::named("SoapBar").unwrap(), ..Object::default() };
        let mut world = World::new(&scene, Pose::default(), Vec::new());
        let receptacle = Instance::Fixture(0);
        while world.objects.len() < 60
            && let Some(at) = spot(&scene, &world, &soap, receptacle)
        {
            world.objects.push(Object { at, parent: Parent::In(receptacle), ..soap.clone() });
        }
        world.objects.len()
    }

    #[test]
    fn things_heap_up_in_a_garbage_can_but_not_in_a_sink() {
        assert_eq!(held_by("GarbageCan"), 60);
        assert!((1..60).contains(&held_by("Sink")));
    }

    #[test]
    fn what_is_put_on_a_table_lies_in_the_frame_although_a_free_place_is_nearer() {
        let (scene, mut world) = kitchen();
        let table = named(&scene, &world, "CounterTop");
        let mug = Object { class: Class::named("Mug").unwrap(), ..Object::default() };
        let Instance::Fixture(index) = table else { panic!("{table:?} is no furniture") };
        world.objects.clear();
        let mut drawn_into_view = 0;
        for (&cell, quarter) in scene.cells.iter().flat_map(|cell| (0..4).map(move |quarter| (cell, quarter))) {
            world.agent = Pose { cell, heading: Heading::from_quarters(quarter), horizon: 30 };
            let Some(at) = spot(&scene, &world, &mug, table) else { continue };
            let away =
                |(x, z): &(i32, i32)| (x - 250 * i32::from(cell.x)).pow(2) + (z - 250 * i32::from(cell.z)).pow(2);
            let surface = &scene.fixtures[usize::from(index)].surfaces[0];
            let nearest = surface.areas.iter().flat_map(raster).min_by_key(away).unwrap();
            let camera = Camera::of(&scene, world.agent);
            let frames = |(x, z)| camera.frames(Point::new(x, at.y, z).metres());
            drawn_into_view += usize::from(!frames(nearest) && frames((at.x, at.z)));
        }
        assert!(drawn_into_view > 0, "whatever the agent sees, the nearest place is taken");
    }
}
