//! The kinds of rooms by the names that options take.

use clap::ValueEnum;

use crate::domain::scene::Room;

/// The kind of a generated house's room.
#[derive(Clone, Copy, ValueEnum)]
pub enum RoomName {
    Kitchen,
    LivingRoom,
    Bedroom,
    Bathroom,
}

impl From<RoomName> for Room {
    fn from(name: RoomName) -> Room {
        match name {
            RoomName::Kitchen => Room::Kitchen,
            RoomName::LivingRoom => Room::LivingRoom,
            RoomName::Bedroom => Room::Bedroom,
            RoomName::Bathroom => Room::Bathroom,
        }
    }
}
