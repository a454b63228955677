//! Whether boards or rims of a receptacle itself hide a point in it from an eye. Cheap: what Put asks of every point it tries.

use crate::domain::place::{Cuboid, Rect};
use crate::domain::{Fixture, Point};

/// How far a board stands back from the front of the body, and the thickness of a tub's wall, in millimetres.
const EDGE: i32 = 25;

/// Whether the eye sees past the receptacle's own boards (shelves, top) or over its own rim to the point.
pub(crate) fn in_sight(fixture: &Fixture, eye: Point, point: Point) -> bool {
    let Some(body) = fixture.body.first() else { return true };
    let class = fixture.class.info();
    if class.open_top {
        let opening = body.footprint().grown(-EDGE);
        return crossing(eye, point, body.max.y).is_none_or(|[x, z]| opening.contains(x, z));
    }
    if !class.openable || class.slides {
        return true;
    }
    let board = board(body, fixture);
    let heights = fixture.surfaces.iter().map(|surface| surface.height).chain([body.min.y, body.max.y]);
    let mut between = heights.filter_map(|height| crossing(eye, point, height));
    !between.any(|[x, z]| board.contains(x, z))
}

/// The outline of a body's shelves: set back from its front.
fn board(body: &Cuboid, fixture: &Fixture) -> Rect {
    let mut board = body.footprint();
    let (dx, dz) = fixture.facing.step();
    for (axis, step) in [i32::from(dx), i32::from(dz)].into_iter().enumerate() {
        match step {
            1 => board.max[axis] -= EDGE,
            -1 => board.min[axis] += EDGE,
            _ => {}
        }
    }
    board
}

/// Where the line from the eye to the point goes through that height; `None` when both are on one side of it.
fn crossing(eye: Point, point: Point, height: i32) -> Option<[i32; 2]> {
    let (above, below) = (i64::from(eye.y - height), i64::from(point.y - height));
    if above.signum() * below.signum() >= 0 {
        return None;
    }
    let part = |from: i32, to: i32| from + (i64::from(to - from) * above / (above - below)) as i32;
    Some([part(eye.x, point.x), part(eye.z, point.z)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::scene::Surface;
    use crate::domain::{Class, Heading};

    fn fixture(class: &str, body: Cuboid, heights: &[i32]) -> Fixture {
        let surface = |&height: &i32| Surface { height, areas: vec![body.footprint().grown(-50)] };
        Fixture {
            id: class.into(),
            class: Class::named(class).unwrap(),
            pivot: body.centre(),
            facing: Heading::South,
            body: vec![body],
            surfaces: heights.iter().map(surface).collect(),
            stand: None,
        }
    }

    #[test]
    fn a_shelf_hides_what_lies_deep_under_it_but_not_what_lies_on_it() {
        let body = Cuboid::between(Point::new(-300, 0, 0), Point::new(300, 1800, 600));
        let fridge = fixture("Fridge", body, &[400, 900]);
        let eye = Point::new(0, 1575, -500);
        assert!(!in_sight(&fridge, eye, Point::new(0, 410, 500)));
        assert!(in_sight(&fridge, eye, Point::new(0, 910, 300)));
        assert!(in_sight(&fridge, Point::new(0, 600, -500), Point::new(0, 410, 500)));
    }

    #[test]
    fn the_near_wall_of_a_basin_hides_what_lies_right_behind_it() {
        let body = Cuboid::between(Point::new(-300, 700, 0), Point::new(300, 900, 400));
        let sink = fixture("Sink", body, &[710]);
        let eye = Point::new(0, 1575, -500);
        assert!(!in_sight(&sink, eye, Point::new(0, 715, 60)));
        assert!(in_sight(&sink, eye, Point::new(0, 715, 300)));
    }
}
