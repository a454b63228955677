//! A scene: the floor plan. Cells to stand on, fixed furniture, and where things may stand.

use serde::{Deserialize, Serialize};

use super::class::{Class, Shape};
use super::place::{Cell, Cuboid, Heading, Point, Pose, Rect};

/// The kind of a room; ALFRED numbers its floor plans by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Room {
    Kitchen,
    LivingRoom,
    Bedroom,
    Bathroom,
}

impl Room {
    /// In ALFRED's order.
    pub const ALL: [Room; 4] = [Room::Kitchen, Room::LivingRoom, Room::Bedroom, Room::Bathroom];

    /// The room of ALFRED's floor plan of that number: 1 to 30 kitchens, 201 to 230 living rooms, and so on.
    pub(crate) fn of_floor_plan(number: u32) -> Option<Room> {
        match number {
            1..=30 => Some(Room::Kitchen),
            201..=230 => Some(Room::LivingRoom),
            301..=330 => Some(Room::Bedroom),
            401..=430 => Some(Room::Bathroom),
            _ => None,
        }
    }

    /// The name in options.
    pub(crate) fn option_name(self) -> &'static str {
        match self {
            Room::Kitchen => "kitchen",
            Room::LivingRoom => "living-room",
            Room::Bedroom => "bedroom",
            Room::Bathroom => "bathroom",
        }
    }

    /// The name in a sentence.
    pub(crate) fn spoken(self) -> &'static str {
        match self {
            Room::Kitchen => "kitchen",
            Room::LivingRoom => "living room",
            Room::Bedroom => "bedroom",
            Room::Bathroom => "bathroom",
        }
    }
}

impl std::str::FromStr for Room {
    type Err = String;

    fn from_str(text: &str) -> Result<Room, String> {
        let known = Room::ALL.into_iter().find(|room| room.option_name() == text);
        known.ok_or_else(|| format!("{text:?} is not one of {}", Room::ALL.map(Room::option_name).join(", ")))
    }
}

/// A height at which things may stand, and where.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Surface {
    /// World height of the support in millimetres.
    pub(crate) height: i32,
    /// The rectangles that things may stand on, pivots included.
    pub(crate) areas: Vec<Rect>,
}

/// A piece of fixed furniture.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fixture {
    /// A name that is unique in the scene: ALFRED's object id, or the generator's.
    pub(crate) id: String,
    /// A class that cannot be picked up.
    pub class: Class,
    /// The pivot, from which distances are measured.
    pub(crate) pivot: Point,
    /// Where its front looks: out of the furniture, into the room.
    pub(crate) facing: Heading,
    /// What it fills: one box, or several for an L-shaped counter. An openable one's first box is its shell.
    pub(crate) body: Vec<Cuboid>,
    /// Where its contents stand, lowest first. Empty when it holds nothing.
    pub(crate) surfaces: Vec<Surface>,
    /// The recorded best place to stand for using it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) stand: Option<Pose>,
}

/// The measured shape of one mesh of the scene. Lengths in millimetres, in the object's own frame.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Mesh {
    /// ALFRED's `objectName`.
    pub name: String,
    /// The body that stands for the mesh.
    pub(crate) shape: Shape,
    /// Width, height, depth.
    pub(crate) size: [i32; 3],
    /// The centre from the pivot.
    pub(crate) offset: [i32; 3],
}

/// A floor plan.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Version of this format.
    pub(crate) format_version: u32,
    /// `FloorPlan7`, or `kitchen-42` for a generated one.
    pub name: String,
    /// Decides floor pattern, and which tasks are asked.
    pub(crate) room: Room,
    /// The agent's y in millimetres: 900 above the floor, 675 below the camera.
    pub(crate) agent_y: i32,
    /// Where the agent may stand, sorted.
    pub cells: Vec<Cell>,
    /// The fixed furniture.
    pub fixtures: Vec<Fixture>,
    /// The walls' bodies, floor to ceiling.
    pub(crate) walls: Vec<Cuboid>,
    /// Shapes of meshes that were measured in this scene.
    #[serde(default)]
    pub(crate) meshes: Vec<Mesh>,
}

impl Scene {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 1;

    /// World height of the floor in millimetres.
    pub(crate) fn floor(&self) -> i32 {
        self.agent_y - 900
    }

    /// World height of the camera in millimetres.
    pub(crate) fn camera_y(&self) -> i32 {
        self.agent_y + 675
    }

    /// Whether the agent may stand there.
    pub(crate) fn has_cell(&self, cell: Cell) -> bool {
        self.cells.binary_search(&cell).is_ok()
    }

    /// The fixture of that number.
    pub(crate) fn fixture(&self, index: u16) -> Option<&Fixture> {
        self.fixtures.get(usize::from(index))
    }
}
