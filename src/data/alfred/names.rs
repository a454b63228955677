//! ALFRED's names of things: `Class|+x|+y|+z`, with a basin or a slice as an optional fifth field.

use crate::domain::{Class, Point};

/// A thing as ALFRED names it: its class and where it stood at first, to the centimetre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Name {
    /// The text before the first `|`: a sink's basin is a Sink, a slice of an apple an Apple.
    pub(crate) class: Class,
    /// Where the thing stood at first; for a basin, where its sink or bathtub stands.
    pub(crate) at: Point,
    /// Which part of it is meant.
    pub(crate) part: NamedPart,
}

/// Which part of a named thing is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum NamedPart {
    /// The thing itself.
    #[default]
    Whole,
    /// The basin of a sink or bathtub.
    Basin,
    /// The slice of that number, from 1.
    Slice(u8),
}

/// How far from the origin anything may be, in metres; beyond it a number is taken for a mistake.
pub(crate) const FARTHEST: f64 = 100.0;

impl Name {
    /// Reads an object id.
    ///
    /// # Errors
    /// What is wrong with it, in words that quote it.
    pub(crate) fn parse(text: &str) -> Result<Name, String> {
        let mut fields = text.split('|');
        let class = class_named(fields.next().unwrap_or_default())
            .ok_or_else(|| format!("{text:?} is of no known object class"))?;
        let mut coordinate = || {
            let value = fields.next().and_then(|field| field.parse::<f64>().ok());
            value.filter(|value| value.abs() <= FARTHEST).ok_or_else(|| format!("{text:?} is not an object id"))
        };
        let at = Point::from_metres(coordinate()?, coordinate()?, coordinate()?);
        let part = match fields.next() {
            None => NamedPart::Whole,
            Some("SinkBasin" | "BathtubBasin") => NamedPart::Basin,
            Some(part) => {
                let number = part.rsplit_once("Sliced_").and_then(|(_, number)| number.parse::<u8>().ok());
                NamedPart::Slice(number.ok_or_else(|| format!("{text:?} names no part that is known"))?)
            }
        };
        Ok(Name { class, at, part })
    }

    /// The thing itself, where a slice of it is named.
    pub(crate) fn whole(self) -> Name {
        match self.part {
            NamedPart::Slice(_) => Name { part: NamedPart::Whole, ..self },
            NamedPart::Whole | NamedPart::Basin => self,
        }
    }

    /// As ALFRED writes it.
    pub(crate) fn text(self) -> String {
        let metres = |mm: i32| format!("{:+06.2}", f64::from(mm) / 1000.0);
        let Point { x, y, z } = self.at;
        let part = match self.part {
            NamedPart::Whole => String::new(),
            NamedPart::Basin => format!("|{}Basin", self.class.name()),
            NamedPart::Slice(number) => format!("|{}Sliced_{number}", self.class.name()),
        };
        format!("{}|{}|{}|{}{part}", self.class.name(), metres(x), metres(y), metres(z))
    }
}

/// The class of a type name; a basin counts as what it belongs to, and sliced things as the whole.
pub(crate) fn class_named(name: &str) -> Option<Class> {
    let name = name.strip_suffix("Basin").or_else(|| name.strip_suffix("Sliced")).unwrap_or(name);
    Class::named(name).filter(|class| *class != Class::NONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_of_things_basins_and_slices_are_read_and_written_alike() {
        for text in ["Mug|-00.05|+01.10|-02.00", "Sink|+00.16|+00.82|-01.80|SinkBasin"] {
            assert_eq!(Name::parse(text).unwrap().text(), text);
        }
        let slice = Name::parse("Apple|-00.30|+00.14|+00.53|AppleSliced_12").unwrap();
        assert_eq!(slice.part, NamedPart::Slice(12));
        assert_eq!(slice.whole().text(), "Apple|-00.30|+00.14|+00.53");
    }

    #[test]
    fn what_is_no_id_is_an_error_that_quotes_it() {
        for text in ["", "Mug", "Mug|1|2", "Dragon|1|2|3", "Mug|1|2|x", "Mug|1|2|1e9", "Mug|1|2|NaN", "Mug|1|2|3|Half"]
        {
            assert!(Name::parse(text).unwrap_err().contains(&format!("{text:?}")), "{text}");
        }
    }
}
