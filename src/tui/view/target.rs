//! What can be picked with the mouse.

use crate::domain::{Cell, Instance};

/// Something on the screen that can be picked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// The interaction of that number, from 1.
    Candidate(u8),
    /// A step, on the timeline or in the log.
    Step(u32),
    /// A thing in the frame or on the map.
    Thing(Instance),
    /// A cell of the floor.
    Cell(Cell),
    /// A row of the page's list.
    Row(usize),
}
