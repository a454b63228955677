//! Which way furniture looks: towards where the expert stood to use it.

use super::fixtures::FoundFixture;
use crate::domain::{Cell, Heading, Point};

/// The front of a fixture: opposite to how most users faced it; where nobody used it, towards the nearest cells.
pub(crate) fn facing(found: &FoundFixture, cells: &[Cell]) -> Heading {
    let mut votes = [0usize; 4];
    let users = found.uses.iter().map(|used| used.pose);
    // The vetted pose looks straight at it; a walk that ended elsewhere says less.
    for pose in users.chain(found.walked_to.iter().copied()).chain(found.vetted).chain(found.vetted) {
        votes[Heading::from_quarters(pose.heading.quarters() + 2) as usize] += 1;
    }
    let most = Heading::ALL.into_iter().max_by_key(|heading| (votes[*heading as usize], 3 - heading.quarters()));
    match most {
        Some(heading) if votes[heading as usize] > 0 => heading,
        _ => towards(found.pivot, cells),
    }
}

/// The direction in which most of the nearest cells lie.
fn towards(from: Point, cells: &[Cell]) -> Heading {
    let mut near: Vec<(f32, Cell)> = cells.iter().map(|&cell| (cell.centre(0).floor_distance(from), cell)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (mut dx, mut dz) = (0i64, 0i64);
    for (_, cell) in near.iter().take(6) {
        let middle = cell.centre(0);
        dx += i64::from(middle.x - from.x);
        dz += i64::from(middle.z - from.z);
    }
    match (dx.abs() > dz.abs(), dx > 0, dz > 0) {
        (true, true, _) => Heading::East,
        (true, false, _) => Heading::West,
        (false, _, true) => Heading::North,
        (false, _, false) => Heading::South,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unused_furniture_looks_at_the_room() {
        let cells: Vec<Cell> = (0..4).flat_map(|x| (0..4).map(move |z| Cell::new(x, z))).collect();
        assert_eq!(towards(Point::new(-600, 0, 400), &cells), Heading::East);
        assert_eq!(towards(Point::new(400, 0, 1500), &cells), Heading::South);
    }
}
