//! Shortest paths over the floor: moves and quarter turns, each one step.

use std::collections::VecDeque;

use crate::domain::{ActionType, Cell, Heading, Pose, Scene};

const NONE: u32 = u32::MAX;

/// A scene's cells with their neighbours.
#[derive(Clone, Debug)]
pub(crate) struct WalkableCells {
    cells: Vec<Cell>,
    /// For each cell and heading, the number of the cell ahead.
    ahead: Vec<[u32; 4]>,
}

impl WalkableCells {
    /// The floor of a scene.
    pub(crate) fn of(scene: &Scene) -> WalkableCells {
        let number = |cell: Cell| scene.cells.binary_search(&cell).map_or(NONE, |index| index as u32);
        let ahead = scene.cells.iter().map(|cell| Heading::ALL.map(|heading| number(cell.ahead(heading)))).collect();
        WalkableCells { cells: scene.cells.clone(), ahead }
    }

    /// The cells, sorted.
    pub(crate) fn cells(&self) -> &[Cell] {
        &self.cells
    }
}

/// Which of several equally short ways is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turning {
    /// The one that walks ahead for longest before it turns.
    Late,
    /// The one that turns soonest.
    Early,
}

/// The shortest ways from one pose to every other.
#[derive(Clone, Debug)]
pub(crate) struct Paths {
    start: Pose,
    /// Steps to each state; a state is four times the cell's number plus the heading's quarters.
    steps: Vec<u32>,
    /// The state before it on the way, and what was done there.
    from: Vec<(u32, ActionType)>,
}

impl Paths {
    /// A shortest way from `start` to every state; none when it is not on the floor. What is explored first comes first on
    /// the way.
    pub(crate) fn from(floor: &WalkableCells, start: Pose, turning: Turning) -> Paths {
        let states = 4 * floor.cells.len();
        let mut paths = Paths { start, steps: vec![NONE; states], from: vec![(NONE, ActionType::MoveAhead); states] };
        let Ok(cell) = floor.cells.binary_search(&start.cell) else { return paths };
        let first = 4 * cell as u32 + start.heading.quarters() as u32;
        paths.steps[first as usize] = 0;
        let mut queue = VecDeque::from([first]);
        while let Some(state) = queue.pop_front() {
            let (cell, quarters) = (state / 4, state % 4);
            let ahead = floor.ahead[cell as usize][quarters as usize];
            let moved = if ahead == NONE { NONE } else { 4 * ahead + quarters };
            let mut ways = [
                (moved, ActionType::MoveAhead),
                (4 * cell + (quarters + 3) % 4, ActionType::RotateLeft),
                (4 * cell + (quarters + 1) % 4, ActionType::RotateRight),
            ];
            if turning == Turning::Early {
                ways.rotate_left(1);
            }
            for (next, kind) in ways {
                if next != NONE && paths.steps[next as usize] == NONE {
                    paths.steps[next as usize] = paths.steps[state as usize] + 1;
                    paths.from[next as usize] = (state, kind);
                    queue.push_back(next);
                }
            }
        }
        paths
    }

    /// Where they all begin.
    pub(crate) fn start(&self) -> Pose {
        self.start
    }

    /// Moves and turns to the cell of that number, facing so; `None` when there is no way.
    pub(crate) fn steps(&self, cell: usize, heading: Heading) -> Option<u32> {
        self.steps.get(4 * cell + heading.quarters() as usize).copied().filter(|&steps| steps != NONE)
    }

    /// The actions to a pose at the cell of that number: moves and turns, then looks.
    pub(crate) fn to(&self, cell: usize, pose: Pose) -> Vec<ActionType> {
        let mut actions = Vec::new();
        let mut state = 4 * cell + pose.heading.quarters() as usize;
        while let Some(&(before, kind)) = self.from.get(state).filter(|(before, _)| *before != NONE) {
            actions.push(kind);
            state = before as usize;
        }
        actions.reverse();
        let looks = (pose.horizon - self.start.horizon) / Pose::LOOK;
        let look = if looks > 0 { ActionType::LookDown } else { ActionType::LookUp };
        actions.extend(std::iter::repeat_n(look, usize::from(looks.unsigned_abs())));
        actions
    }
}
