//! Object classes: ALFRED's 81 named ones (plus `None`), then classes that scenes hold but no action can name.

use std::sync::OnceLock;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// An object class; 0 is `None`, 1 to 81 are the policy's object head, higher ones are scenery.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Class(u8);

/// The shape that stands for a movable object's mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Shape {
    /// An axis-aligned box in the object's own frame.
    #[default]
    Box,
    /// An ellipsoid inscribed in that box.
    Ellipsoid,
    /// An upright elliptic cylinder inscribed in that box.
    Cylinder,
}

/// What a fixture does to things.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum FixtureEffect {
    /// Its contents are hot once it is switched on.
    Heat,
    /// Its contents are cold once it is closed.
    Cool,
    /// What lies in the basin nearest to it is clean once it is switched on.
    Rinse,
}

/// What `assets/objects.toml` says of a class. Lengths in millimetres.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClassInfo {
    /// The name in ALFRED's data, e.g. `CellPhone`.
    pub(crate) name: String,
    /// The name in a sentence, e.g. `cell phone`.
    pub(crate) spoken: String,
    /// Fits into the hand.
    pub(crate) pickupable: bool,
    /// May hold other objects.
    pub receptacle: bool,
    /// Has a door, drawer or lid.
    pub openable: bool,
    /// Has a switch.
    pub toggleable: bool,
    /// What it does to things: a toggled machine or tap when it is switched on, a fridge when it is closed.
    pub(crate) effect: Option<FixtureEffect>,
    /// Has a door that swings out when it is opened.
    pub(crate) door: bool,
    /// Slides out when it is opened, and its contents with it.
    pub(crate) slides: bool,
    /// Has a lid that stands at its back edge when it is opened.
    pub(crate) lid: bool,
    /// Is open above, and its contents lie inside.
    pub(crate) open_top: bool,
    /// Is what the nearest tap runs into.
    pub(crate) basin: bool,
    /// Takes things on top of those that already lie in it.
    pub(crate) heaps: bool,
    /// Slices what can be sliced while it is held.
    pub(crate) cuts: bool,
    /// How many slices it falls into; 0 when it cannot be sliced.
    pub slices: u8,
    /// The shape of a movable object.
    pub(crate) shape: Shape,
    /// Width, height, depth of the shape in the object's own frame.
    pub(crate) size: [i32; 3],
    /// The centre of the shape from the pivot, in the object's own frame.
    pub(crate) offset: [i32; 3],
    /// The pivot's height above the support when the object stands.
    pub(crate) rest: i32,
    /// How far from a movable receptacle's pivot its contents lie; 0 for fixed ones.
    pub(crate) content_radius: i32,
    /// The groups that a movable object belongs to (`food`, `desk`, ...).
    pub(crate) tags: Vec<String>,
    /// The groups and classes that a receptacle is used for.
    pub(crate) holds: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectTable {
    class: Vec<ClassInfo>,
}

fn table() -> &'static [ClassInfo] {
    static TABLE: OnceLock<Vec<ClassInfo>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let none = ClassInfo { name: "None".into(), spoken: "nothing".into(), ..ClassInfo::default() };
        let parsed = toml::from_str::<ObjectTable>(include_str!("../../assets/objects.toml"));
        // The table is part of the program: a test parses it, so this arm cannot be reached in a build that passed.
        let classes = parsed.map(|table| table.class).unwrap_or_default();
        std::iter::once(none).chain(classes).collect()
    })
}

impl Class {
    /// No object: the target of navigation actions.
    pub(crate) const NONE: Class = Class(0);
    /// Entries of the policy's object head, `None` included.
    pub(crate) const VOCABULARY: usize = 82;

    /// The class of that index, if there is one.
    pub(crate) fn from_index(index: usize) -> Option<Class> {
        (index < table().len()).then_some(Class(index as u8))
    }

    /// The class of that name as ALFRED spells it.
    pub fn named(name: &str) -> Option<Class> {
        table().iter().position(|info| info.name == name).map(|index| Class(index as u8))
    }

    /// All classes except `None`, in the order of their indices.
    pub(crate) fn all() -> impl Iterator<Item = Class> {
        (1..table().len()).map(|index| Class(index as u8))
    }

    /// Position in the object head; at or above [`Class::VOCABULARY`] for scenery.
    pub(crate) fn index(self) -> usize {
        usize::from(self.0)
    }

    /// Whether an action may name it.
    pub(crate) fn in_vocabulary(self) -> bool {
        self.index() > 0 && self.index() < Class::VOCABULARY
    }

    /// Its row of the object table.
    pub fn info(self) -> &'static ClassInfo {
        &table()[self.index().min(table().len() - 1)]
    }

    /// The name in ALFRED's data.
    pub fn name(self) -> &'static str {
        &self.info().name
    }

    /// The name in a sentence.
    pub(crate) fn spoken(self) -> &'static str {
        &self.info().spoken
    }

    /// Whether slicing can be done with it in the hand.
    pub fn is_knife(self) -> bool {
        self.info().cuts
    }

    /// "in" or "on", as one says it of a receptacle.
    pub(crate) fn preposition(self) -> &'static str {
        let inside = matches!(
            self.name(),
            "Sink"
                | "Bathtub"
                | "Bowl"
                | "Cup"
                | "Mug"
                | "Pot"
                | "Pan"
                | "GarbageCan"
                | "Box"
                | "Safe"
                | "CoffeeMachine"
        );
        if inside || self.info().openable && self.info().receptacle { "in" } else { "on" }
    }

    /// Whether `self` is a receptacle in which people keep `content`.
    pub(crate) fn holds(self, content: Class) -> bool {
        let wanted = &self.info().holds;
        wanted.iter().any(|word| word == content.name() || content.info().tags.contains(word))
    }
}

impl std::fmt::Display for Class {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.spoken())
    }
}

impl schemars::JsonSchema for Class {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Class".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "An object class, or one that scenes hold",
            "type": "string",
            "enum": Class::all().map(Class::name).collect::<Vec<_>>(),
        })
    }
}

impl Class {
    /// The JSON Schema of a class that an action can name.
    pub(crate) fn vocabulary_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let names: Vec<&str> = Class::all().filter(|class| class.in_vocabulary()).map(Class::name).collect();
        schemars::json_schema!({"description": "An object class", "type": "string", "enum": names})
    }
}

impl Serialize for Class {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Class {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Class, D::Error> {
        let name = std::borrow::Cow::<str>::deserialize(deserializer)?;
        Class::named(&name).ok_or_else(|| de::Error::custom(format!("unknown object class {name:?}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_object_table_holds_alfreds_81_classes_in_the_order_of_the_object_head() {
        let parsed: ObjectTable = toml::from_str(include_str!("../../assets/objects.toml")).unwrap();
        assert!(parsed.class.len() >= 81);
        let named: Vec<_> = parsed.class[..81].iter().map(|info| info.name.as_str()).collect();
        assert!(named.is_sorted(), "the vocabulary is in ASCII order");
        for (name, index) in [("AlarmClock", 1), ("CD", 13), ("Fridge", 34), ("Tomato", 77), ("WineBottle", 81)] {
            assert_eq!(Class::named(name).map(Class::index), Some(index), "{name}");
        }
    }

    #[test]
    fn every_movable_class_has_a_size_and_every_receptacle_something_to_hold() {
        for class in Class::all() {
            let info = class.info();
            assert_eq!(info.pickupable, info.size != [0; 3], "{}", info.name);
            if info.receptacle {
                assert!(Class::all().any(|content| class.holds(content)), "{}", info.name);
            }
        }
    }

    #[test]
    fn an_unknown_class_name_is_an_error_that_names_it() {
        let error = serde_json::from_str::<Class>("\"Dragon\"").unwrap_err();
        assert!(error.to_string().contains("Dragon"));
    }
}
