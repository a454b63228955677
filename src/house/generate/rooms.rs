//! What rooms are made of: `assets/rooms.toml`, after ALFRED's statistics.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use serde::Deserialize;

use crate::domain::class::Shape;
use crate::domain::{Class, Room};

/// A range of millimetres or of counts, ends included.
pub(crate) type Range = [i32; 2];

/// What a kind of room holds. Lengths in millimetres.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RoomPlan {
    /// The room's extent along x.
    pub(crate) width: Range,
    /// The room's extent along z.
    pub(crate) depth: Range,
    /// The chance that a corner is cut out of it.
    pub(crate) notch: f64,
    /// Its furniture, in the order in which it is placed.
    pub(crate) pieces: Vec<FurniturePiece>,
    /// For each movable class: the chance that the room holds any, and the mean count when it does.
    pub(crate) objects: BTreeMap<Class, [f64; 2]>,
}

/// A kind of furniture. Lengths in millimetres.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct FurniturePiece {
    /// A class, or a built-in group (`Run`, `Vanity`, `Shelves`, `Wardrobe`).
    pub(crate) kind: String,
    /// The chance that the room has any.
    pub(crate) chance: f64,
    /// How many, when it has any.
    pub(crate) count: Range,
    /// Along the wall.
    pub(crate) width: Range,
    /// Out of the wall.
    pub(crate) depth: Range,
    /// Of its top, or of its seat.
    pub(crate) height: Range,
    /// How many drawers its front has.
    pub(crate) drawers: Range,
    /// The chance of a desk lamp on it.
    pub(crate) lamp: f64,
    /// It stands in the middle of the room.
    pub(crate) middle: bool,
}

impl Default for FurniturePiece {
    fn default() -> FurniturePiece {
        let none = [0, 0];
        FurniturePiece {
            kind: String::new(),
            chance: 1.0,
            count: [1, 1],
            width: none,
            depth: none,
            height: none,
            drawers: none,
            lamp: 0.0,
            middle: false,
        }
    }
}

/// The shape of a generated object. Lengths in millimetres.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GeneratedShape {
    /// Which primitive.
    pub shape: Shape,
    /// Width, height, depth.
    pub(crate) size: [i32; 3],
    /// Its pivot is at its upper edge.
    #[serde(default)]
    pub(crate) hangs: bool,
}

/// The whole file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Rooms {
    kitchen: RoomPlan,
    living_room: RoomPlan,
    bedroom: RoomPlan,
    bathroom: RoomPlan,
    /// Shapes that differ from the object table's.
    pub(crate) shapes: BTreeMap<Class, GeneratedShape>,
}

impl Rooms {
    /// The plan of a kind of room.
    pub(crate) fn plan(&self, room: Room) -> &RoomPlan {
        match room {
            Room::Kitchen => &self.kitchen,
            Room::LivingRoom => &self.living_room,
            Room::Bedroom => &self.bedroom,
            Room::Bathroom => &self.bathroom,
        }
    }
}

/// The table that is part of the program.
pub(crate) fn rooms() -> &'static Rooms {
    static ROOMS: OnceLock<Rooms> = OnceLock::new();
    // A test parses the table, so the default cannot be reached in a build that passed.
    ROOMS.get_or_init(|| toml::from_str(include_str!("../../../assets/rooms.toml")).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_rooms_parses_and_names_only_movable_classes_as_objects() {
        let rooms: Rooms = toml::from_str(include_str!("../../../assets/rooms.toml")).unwrap();
        for room in Room::ALL {
            let plan = rooms.plan(room);
            assert!(!plan.pieces.is_empty());
            assert!(plan.objects.keys().all(|class| class.info().pickupable), "{room:?}");
        }
        assert!(rooms.shapes.keys().all(|class| class.info().pickupable));
    }
}
