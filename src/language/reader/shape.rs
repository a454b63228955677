//! Shapes: the few ways in which what one unit of text asks for is put together.

use crate::domain::Class;
use crate::domain::skill::SkillKind;

/// What a unit asks for: one skill, or one of the things that whole tasks come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One skill; a Put has a place.
    One(SkillKind),
    /// Pick a thing up and switch a lamp on.
    Look,
    /// Put a thing into another one, and that somewhere.
    Stack,
    /// Change a thing, and put it somewhere.
    Changed(SkillKind),
    /// Put two things of a kind somewhere.
    Two,
    /// Several of these: not one unit.
    Many,
}

impl Shape {
    /// The shape of that name in the model's file.
    pub fn named(name: &str) -> Option<Shape> {
        Some(match name {
            "Look" => Shape::Look,
            "Stack" => Shape::Stack,
            "CleanPut" => Shape::Changed(SkillKind::Clean),
            "HeatPut" => Shape::Changed(SkillKind::Heat),
            "CoolPut" => Shape::Changed(SkillKind::Cool),
            "Two" => Shape::Two,
            "Many" => Shape::Many,
            "Pickup" => Shape::One(SkillKind::Pickup),
            "Put" => Shape::One(SkillKind::Put),
            "Slice" => Shape::One(SkillKind::Slice),
            "Toggle" => Shape::One(SkillKind::Toggle),
            "Clean" => Shape::One(SkillKind::Clean),
            "Heat" => Shape::One(SkillKind::Heat),
            "Cool" => Shape::One(SkillKind::Cool),
            _ => return None,
        })
    }

    /// Whether something is put somewhere, or a lamp is asked for.
    pub fn has_place(self) -> bool {
        !matches!(self, Shape::One(kind) if kind != SkillKind::Put)
    }

    /// The skills in it that change a thing.
    pub fn kinds(self) -> impl Iterator<Item = SkillKind> {
        let kind = match self {
            Shape::One(kind) | Shape::Changed(kind) => Some(kind),
            _ => None,
        };
        kind.into_iter()
    }

    /// Whether its object may be of that class.
    pub fn takes_object(self, class: Class) -> bool {
        let info = class.info();
        match self {
            Shape::One(SkillKind::Toggle) => is_lamp(class),
            Shape::One(SkillKind::Slice) => info.slices > 0,
            _ => info.pickupable,
        }
    }

    /// Whether its place may be of that class.
    pub fn takes_place(self, class: Class) -> bool {
        if self == Shape::Look { is_lamp(class) } else { class.info().receptacle }
    }
}

/// What is switched on to look at things: it has a switch, holds nothing and changes nothing.
pub(super) fn is_lamp(class: Class) -> bool {
    let info = class.info();
    info.toggleable && !info.receptacle && info.effect.is_none()
}
