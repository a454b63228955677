//! Making way: furniture gives up what stands in lines of sight that recordings prove free.

use std::collections::BTreeSet;

use glam::Vec3;

use super::bodies;
use super::carving::{RIM, SPARE, crossed, let_look_in, notch, sink, trimmed, without};
use super::fit::{Subject, contains, within};
use super::fixtures::Inventory;
use super::furniture::{self, BodyKind};
use super::sightlines::{Hider, Line, SeenTarget, seen_targets};
use crate::domain::place::Cuboid;
use crate::domain::world::{Instance, Parent};
use crate::domain::{Fixture, Heading, Point, Scene, Trajectory};
use crate::house::House;
use crate::house::render::Renderer;

/// So often are the hiders of one target looked for: behind one there may be another.
const ROUNDS: usize = 4;
/// Lines that pass a box within this count when it is fitted once more, in millimetres.
const NEAR: i32 = 300;
/// What is left of a cut counter is a strip when narrower than this, in millimetres.
const STRIP: i32 = 300;
/// What it costs to hide a target that was seen, in units of overlap.
const HIDES: f32 = 0.3;
/// A target counts as seen when more than this share of its lines is free.
const GLIMPSE: f32 = 0.4;

/// Clears the lines of sight of all interactions of recordings.
pub(crate) fn clear(scene: &mut Scene, inventory: &Inventory, trajectories: &[&Trajectory]) {
    let mut renderer = Renderer::new(House::FRAME);
    let mut targets: Vec<SeenTarget> = Vec::new();
    for trajectory in trajectories {
        for target in seen_targets(scene, trajectory) {
            if !targets.iter().any(|known| known.same(&target)) {
                targets.push(target);
            }
        }
    }
    targets.retain(|target| target.is_hidden(scene, &mut renderer));
    let before = scene.fixtures.clone();
    let mut refitted = BTreeSet::new();
    for round in 0..ROUNDS {
        for target in &targets {
            for hider in target.hiders(scene, &mut renderer) {
                let fixture = hider.fixture().and_then(|index| scene.fixture(index));
                match (hider, fixture.is_some_and(is_refitted)) {
                    // What is put away may lie elsewhere than it was recorded: that says nothing of what it lies in.
                    (Hider::Fixture(_), true) if !target.as_recorded => {}
                    (Hider::Fixture(index), true) if round == 0 => {
                        if refitted.insert(index) {
                            refit(scene, inventory, index, &targets);
                        }
                    }
                    _ => make_way(scene, hider, target),
                }
            }
        }
    }
    drop_bare_strips(scene, &before, trajectories);
}

/// Takes away what cutting left of counters as mere strips on which nothing ever lay.
fn drop_bare_strips(scene: &mut Scene, before: &[Fixture], trajectories: &[&Trajectory]) {
    for (index, (fixture, before)) in (0u16..).zip(scene.fixtures.iter_mut().zip(before)) {
        if fixture.body.len() <= before.body.len() {
            continue;
        }
        let holder = Parent::In(Instance::Fixture(index));
        let objects = trajectories.iter().flat_map(|trajectory| &trajectory.start.objects);
        let contents: Vec<Point> = objects.filter(|object| object.parent == holder).map(|object| object.at).collect();
        let kept: Vec<Cuboid> = fixture
            .body
            .iter()
            .copied()
            .filter(|part| {
                let area = part.footprint();
                let narrow = (0..2).any(|axis| area.max[axis] - area.min[axis] < STRIP);
                let cut = !before.body.contains(part);
                !(cut && narrow) || contents.iter().any(|at| area.grown(SPARE).contains(at.x, at.z))
            })
            .collect();
        if !kept.is_empty() {
            fixture.body = kept;
        }
    }
}

/// Whether it can be fitted once more.
fn is_refitted(fixture: &Fixture) -> bool {
    let build = furniture::of(fixture.class).build;
    let one_box = matches!(build, BodyKind::Shell | BodyKind::Board | BodyKind::Thing | BodyKind::Tub);
    one_box && fixture.body.len() == 1
}

/// Fits furniture that hides something once more: to the boxes in which it was seen and to all lines of sight near it.
fn refit(scene: &mut Scene, inventory: &Inventory, index: u16, targets: &[SeenTarget]) {
    let fixture = scene.fixtures[usize::from(index)].clone();
    let Some(found) = inventory.found.get(usize::from(index)) else { return };
    let Some(first) = fixture.body.first().copied() else { return };
    let row = furniture::of(fixture.class);
    let me = Instance::Fixture(index);
    let near: Vec<(&[Line], bool)> = targets
        .iter()
        .filter(|target| target.target != me && target.as_recorded)
        .map(|target| (&*target.lines, target.holders.contains(&me)))
        .filter(|(lines, own)| *own || lines.iter().any(|line| line.through(&grown(&first, NEAR)).is_some()))
        .collect();
    let blocks = |outer: &Cuboid| {
        let blocked = |lines: &[Line], own: bool| {
            let blocked = lines.iter().filter(|line| match (row.build, own) {
                (BodyKind::Tub, true) => !over_rim(line, outer),
                (BodyKind::Shell, true) if !fixture.class.info().slides => !through_front(line, outer, fixture.facing),
                _ => line.through(outer).is_some(),
            });
            let share = blocked.count() as f32 / lines.len().max(1) as f32;
            ((share - 1.0 + GLIMPSE) / GLIMPSE).max(0.0)
        };
        HIDES * near.iter().map(|(lines, own)| blocked(lines, *own)).sum::<f32>()
    };
    let parts = |outer: Cuboid| vec![outer];
    let mut subject = Subject::new(fixture.clone(), row.build, &found.uses, scene.agent_y, &scene.cells, &parts);
    subject.blocks = &blocks;
    subject.together = row.build == BodyKind::Tub;
    subject.contents = bodies::contents(&fixture, row).filter(|inner| contains(&first, inner));
    let (outer, _) = subject.fit(first);
    let fixture = &mut scene.fixtures[usize::from(index)];
    fixture.body = vec![outer];
    if matches!(row.build, BodyKind::Tub | BodyKind::Shell | BodyKind::Board) {
        within(&mut fixture.surfaces, &outer, if row.build == BodyKind::Board { 0 } else { bodies::WALL });
    }
}

/// Whether a line comes into a tub through its opening.
fn over_rim(line: &Line, tub: &Cuboid) -> bool {
    let inner = tub.footprint().grown(-RIM);
    let opening = |at: Vec3| inner.contains((at.x * 1000.0) as i32, (at.z * 1000.0) as i32);
    line.crossing(1, tub.max.metres().y).is_none_or(opening)
}

/// Whether a line comes into a cupboard through its front.
fn through_front(line: &Line, shell: &Cuboid, facing: Heading) -> bool {
    let (axis, plane) = match facing {
        Heading::North => (2, shell.max.z),
        Heading::East => (0, shell.max.x),
        Heading::South => (2, shell.min.z),
        Heading::West => (0, shell.min.x),
    };
    let Some(at) = line.crossing(axis, plane as f32 / 1000.0) else { return true };
    let (min, max) = (shell.min.metres(), shell.max.metres());
    let wall = RIM as f32 / 1000.0;
    (0..3).filter(|&other| other != axis).all(|other| min[other] + wall < at[other] && at[other] < max[other] - wall)
}

fn grown(cuboid: &Cuboid, by: i32) -> Cuboid {
    let (min, max) = (cuboid.min, cuboid.max);
    Cuboid { min: Point::new(min.x - by, min.y - by, min.z - by), max: Point::new(max.x + by, max.y + by, max.z + by) }
}

fn make_way(scene: &mut Scene, hider: Hider, target: &SeenTarget) {
    let lines = &target.lines;
    match hider {
        Hider::Structure => {
            scene.walls = scene
                .walls
                .iter()
                .flat_map(|wall| match crossed(wall, lines) {
                    Some(hole) => without(*wall, &hole),
                    None => vec![*wall],
                })
                .collect();
        }
        Hider::Fixture(index) => {
            let Some(fixture) = scene.fixtures.get_mut(usize::from(index)) else { return };
            let build = furniture::of(fixture.class).build;
            let own = target.holders.contains(&Instance::Fixture(index));
            match build {
                BodyKind::Slab => notch(fixture, lines),
                BodyKind::Block if fixture.body.len() > 1 => notch(fixture, lines),
                BodyKind::Tub if own => {}
                BodyKind::Shell if own && !fixture.class.info().slides => let_look_in(fixture, lines),
                _ => {
                    let before = fixture.body.clone();
                    fixture.body = before.iter().map(|part| trimmed(part, lines)).collect();
                    if own && fixture.body == before {
                        sink(fixture);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::task::SceneRef;
    use crate::domain::world::Object;
    use crate::domain::{Action, ActionType, Cell, Class, Pose, Room, World};
    use crate::house::bounds::projected_bounds;
    use crate::house::view::{View, reachable};

    fn fixture(class: &str, min: [i32; 3], max: [i32; 3]) -> Fixture {
        let body = Cuboid { min: min.into(), max: max.into() };
        let class = Class::named(class).unwrap();
        let (id, pivot, facing) = (class.name().to_owned(), body.centre(), Heading::South);
        let surfaces = vec![crate::domain::scene::Surface { height: max[1], areas: vec![body.footprint()] }];
        Fixture { id, class, pivot, facing, body: vec![body], surfaces, stand: None }
    }

    /// A mug on a shelf a metre ahead, and what stands before it; the agent took the mug.
    fn taken_from_behind(hider: Fixture) -> (Scene, Trajectory) {
        let shelf = fixture("Shelf", [-300, 470, 1000], [300, 500, 1300]);
        let scene = Scene {
            format_version: Scene::FORMAT,
            name: "test".into(),
            room: Room::Kitchen,
            agent_y: 900,
            cells: vec![Cell::new(0, 0)],
            fixtures: vec![shelf, hider],
            walls: vec![],
            meshes: vec![],
        };
        let class = Class::named("Mug").unwrap();
        let at = Point::new(0, 500 + class.info().rest, 1100);
        let mug = Object { class, at, parent: Parent::In(Instance::Fixture(0)), ..Object::default() };
        let start = World::new(&scene, Pose { horizon: 45, ..Pose::default() }, vec![mug]);
        let target = Instance::Object(0);
        let seen = projected_bounds(&scene, &start, start.agent, target).unwrap().map(|edge| edge.round() as u16);
        let trajectory = Trajectory {
            id: "taken".into(),
            split: "train".into(),
            scene: SceneRef::Named("test".into()),
            skill_starts: vec![0],
            start,
            actions: vec![Action::interact(ActionType::Pickup, target)],
            roles: vec![],
            skills: vec![],
            goal: None,
            annotations: vec![],
            boxes: vec![seen],
            choices: vec![],
        };
        (scene, trajectory)
    }

    fn is_seen(scene: &Scene, trajectory: &Trajectory) -> bool {
        let view = View::of(Renderer::new(House::FRAME).draw(scene, &trajectory.start));
        reachable(scene, &trajectory.start, &view, Instance::Object(0)).is_ok()
    }

    #[test]
    fn furniture_gives_up_what_stands_between_the_expert_and_what_it_took_and_keeps_the_rest() {
        for (class, min, max) in [
            ("CounterTop", [-1000, 850, 500], [1000, 900, 1200]),
            ("SideTable", [-300, 0, 500], [300, 900, 900]),
            ("Cabinet", [-300, 700, 500], [300, 1300, 900]),
        ] {
            let (mut scene, trajectory) = taken_from_behind(fixture(class, min, max));
            assert!(!is_seen(&scene, &trajectory), "{class}");
            let before = scene.fixtures.clone();
            clear(&mut scene, &Inventory::default(), &[&trajectory]);
            assert!(is_seen(&scene, &trajectory), "{class}: {:?}", scene.fixtures[1].body);
            let volume = |fixture: &Fixture| -> i64 {
                let volume = |part: &Cuboid| {
                    let (min, max): ([i32; 3], [i32; 3]) = (part.min.into(), part.max.into());
                    (0..3).map(|axis| i64::from(max[axis] - min[axis])).product::<i64>()
                };
                fixture.body.iter().map(volume).sum()
            };
            assert!(3 * volume(&scene.fixtures[1]) > volume(&before[1]), "{class}: {:?}", scene.fixtures[1].body);
            assert_eq!(scene.fixtures[0], before[0], "the shelf hid nothing");
        }
    }

    #[test]
    fn strips_that_a_cut_leaves_go_unless_something_lay_on_them() {
        let (mut scene, mut trajectory) = taken_from_behind(fixture("CounterTop", [-150, 850, 500], [1000, 900, 1200]));
        let mug = trajectory.start.objects[0].clone();
        let wide = Point::new(800, 905, 800);
        trajectory.start.objects.push(Object { at: wide, parent: Parent::In(Instance::Fixture(1)), ..mug });
        clear(&mut scene, &Inventory::default(), &[&trajectory]);
        let holds = |x: i32, z: i32| scene.fixtures[1].body.iter().any(|part| part.footprint().contains(x, z));
        assert!(holds(800, 800), "what something lay on stays");
        assert!(!holds(-130, 700), "a bare strip beside the cut");
    }

    #[test]
    fn a_wall_gets_a_hole_where_the_expert_looked_through_it() {
        let (mut scene, trajectory) = taken_from_behind(fixture("CounterTop", [2000, 0, 0], [2100, 50, 100]));
        let wall = Cuboid::between(Point::new(-500, 0, 600), Point::new(500, 2000, 700));
        scene.walls = vec![wall];
        assert!(!is_seen(&scene, &trajectory));
        clear(&mut scene, &Inventory::default(), &[&trajectory]);
        assert!(is_seen(&scene, &trajectory) && !scene.walls.is_empty(), "{:?}", scene.walls);
    }

    #[test]
    fn where_nothing_hides_what_was_taken_nothing_changes() {
        let (mut scene, trajectory) = taken_from_behind(fixture("CounterTop", [-1000, 0, 1500], [1000, 900, 1600]));
        let before = scene.clone();
        clear(&mut scene, &Inventory::default(), &[&trajectory]);
        assert_eq!(scene, before);
    }

    #[test]
    fn a_tub_is_seen_into_over_its_rim_and_a_cupboard_through_its_front() {
        let line = |eye: [f32; 3], end: [f32; 3]| Line { eye: eye.into(), end: end.into() };
        let tub = Cuboid::between(Point::new(-200, 0, 500), Point::new(200, 400, 900));
        assert!(over_rim(&line([0.0, 1.6, 0.0], [0.0, 0.05, 0.8]), &tub));
        assert!(!over_rim(&line([0.0, 1.6, 0.0], [0.0, 0.05, 0.55]), &tub), "its near wall is before that");
        let shell = Cuboid::between(Point::new(-200, 0, 500), Point::new(200, 700, 900));
        assert!(through_front(&line([0.0, 1.6, -1.0], [0.0, 0.05, 0.6]), &shell, Heading::South));
        assert!(!through_front(&line([0.0, 1.6, 0.3], [0.0, 0.05, 0.85]), &shell, Heading::South), "through its top");
    }
}
