//! Options that take a value by its name: help texts list the names, and the library's own enum reads them.

use std::error::Error;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::domain::Room;
use crate::eval::tasks::sample::Phrasing;
use crate::train::collect::ExpertKind;

/// The kind of a room.
pub(crate) fn room() -> impl TypedValueParser<Value = Room> {
    named(Room::ALL.map(|room| PossibleValue::new(room.option_name())))
}

/// Where the instructions of sampled tasks come from.
pub(crate) fn phrasing() -> impl TypedValueParser<Value = Phrasing> {
    named([
        PossibleValue::new(Phrasing::GRAMMAR).help("The program's own grammar"),
        PossibleValue::new(Phrasing::ANNOTATORS).help("What people wrote of the demonstrations"),
    ])
}

/// The expert that demonstrates.
pub(crate) fn expert() -> impl TypedValueParser<Value = ExpertKind> {
    named([
        PossibleValue::new(ExpertKind::SCANNING).help("Turns around until the object it goes for is in view"),
        PossibleValue::new(ExpertKind::PRIVILEGED)
            .help("Goes straight for objects, in view or not, as ALFRED's planner did"),
    ])
}

/// One of `names`, read as the library reads it.
fn named<T>(names: impl IntoIterator<Item = PossibleValue>) -> impl TypedValueParser<Value = T>
where
    T: FromStr + Clone + Send + Sync + 'static,
    T::Err: Into<Box<dyn Error + Send + Sync>>,
{
    PossibleValuesParser::new(names).try_map(|name| name.parse::<T>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_that_help_lists_is_read() {
        for room in Room::ALL {
            assert_eq!(room.option_name().parse(), Ok(room));
        }
        assert_eq!(
            [Phrasing::GRAMMAR.parse(), Phrasing::ANNOTATORS.parse()],
            [Ok(Phrasing::Grammar), Ok(Phrasing::Annotators)]
        );
        assert_eq!(
            [ExpertKind::SCANNING.parse(), ExpertKind::PRIVILEGED.parse()],
            [Ok(ExpertKind::Scanning), Ok(ExpertKind::Privileged)]
        );
        assert!("attic".parse::<Room>().is_err() && "poems".parse::<Phrasing>().is_err());
    }
}
