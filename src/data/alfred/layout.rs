//! What `gen/layouts` says of a floor plan: cells that can be stood on, and where receptacles stand.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};

use super::names::{FARTHEST, Name};
use super::presence;
use crate::data::{plain_file, text_file};
use crate::domain::place::Pose;
use crate::domain::{Cell, Heading, Point};
use crate::language::count::counted;

/// The layout of one floor plan; empty where no file says anything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloorPlanLayout {
    /// Cells that the published list holds. The expert also walked on others.
    pub(crate) cells: Vec<Cell>,
    /// Fixtures with the vetted pose from which each is best seen.
    pub(crate) stands: BTreeMap<Name, Pose>,
}

impl FloorPlanLayout {
    /// Reads `<name>-layout.npy` and `<name>-openable.json` in `folder`; either may be absent.
    ///
    /// # Errors
    /// When a file is there but cannot be read.
    pub fn read(folder: &Path, name: &str) -> anyhow::Result<FloorPlanLayout> {
        let mut layout = FloorPlanLayout::default();
        let cells = folder.join(format!("{name}-layout.npy"));
        let is_there = |path: &Path| {
            presence::is_file(path).map_err(anyhow::Error::msg).with_context(|| path.display().to_string())
        };
        if is_there(&cells)? {
            layout.cells = read_cells(&cells).with_context(|| cells.display().to_string())?;
        }
        let stands = folder.join(format!("{name}-openable.json"));
        if is_there(&stands)? {
            layout.stands = read_stands(&stands).with_context(|| stands.display().to_string())?;
        }
        Ok(layout)
    }
}

fn read_cells(path: &Path) -> anyhow::Result<Vec<Cell>> {
    let bytes = plain_file::read(path)?;
    let mut data = &bytes[..];
    let header = npyz::NpyHeader::from_reader(&mut data)?;
    let shape = header.shape().to_vec();
    let &[rows, 2] = &shape[..] else { bail!("holds an array of shape {shape:?}; n x 2 was expected") };
    // Its numbers would be paired wrongly.
    ensure!(header.order() == npyz::Order::C, "is stored column by column: save numpy.ascontiguousarray of it");
    let values = npyz::NpyFile::with_header(header, data).data::<f64>()?;
    let (there, wanted) = (data.len() as u128, u128::from(rows) * 2 * size_of::<f64>() as u128);
    let (rows, bytes) = (|| counted(rows, "row"), |count| counted(count, "byte"));
    ensure!(there >= wanted, "is cut off: its header says {}, and it lacks {} of them", rows(), bytes(wanted - there));
    ensure!(there == wanted, "goes on for {} after the {} that its header says", bytes(there - wanted), rows());
    let values = values.collect::<std::io::Result<Vec<f64>>>()?;
    let mut cells = Vec::with_capacity(values.len() / 2);
    for pair in values.chunks_exact(2) {
        let Some(cell) = cell_at(pair[0], pair[1]) else { bail!("({}, {}) is no cell", pair[0], pair[1]) };
        cells.push(cell);
    }
    cells.sort_unstable();
    cells.dedup();
    Ok(cells)
}

fn read_stands(path: &Path) -> anyhow::Result<BTreeMap<Name, Pose>> {
    let Pairs(listed) = serde_json::from_str(&text_file::read(path)?)?;
    let mut stands = BTreeMap::new();
    for (id, [x, z, rotation, horizon]) in listed {
        let name = Name::parse(&id).map_err(anyhow::Error::msg)?;
        let (Some(cell), Some(heading)) = (cell_at(x, z), heading_at(rotation)) else {
            bail!("{id}: [{x}, {z}, {rotation}, {horizon}] is no pose");
        };
        let pose = Pose { cell, heading, horizon: horizon.clamp(-30.0, 60.0) as i16 };
        ensure!(stands.insert(name, pose).is_none(), "{id} is there twice");
    }
    Ok(stands)
}

/// The pairs of a JSON object, also those of one key; a map would keep the last of them.
struct Pairs(Vec<(String, [f64; 4])>);

impl<'de> Deserialize<'de> for Pairs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Pairs, D::Error> {
        struct All;
        impl<'de> Visitor<'de> for All {
            type Value = Pairs;

            fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                formatter.write_str("an object of poses")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Pairs, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }
        deserializer.deserialize_map(All)
    }
}

/// The cell at (x, z) in metres, if that is near the middle of one.
pub(crate) fn cell_at(x: f64, z: f64) -> Option<Cell> {
    if !(x.abs() <= FARTHEST && z.abs() <= FARTHEST) {
        return None;
    }
    let cell = Cell::nearest(Point::from_metres(x, 0.0, z));
    let middle = cell.centre(0);
    let near = |metres: f64, mm: i32| (metres * 1000.0 - f64::from(mm)).abs() <= 50.0;
    (near(x, middle.x) && near(z, middle.z)).then_some(cell)
}

/// The heading of that many degrees clockwise from north, if it is a multiple of 90.
pub(crate) fn heading_at(degrees: f64) -> Option<Heading> {
    let quarters = degrees / 90.0;
    let whole = quarters.round();
    ((quarters - whole).abs() < 0.02 && whole.abs() < 1000.0).then(|| Heading::from_quarters(whole as i32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_no_cell_or_heading_are_refused() {
        assert_eq!(cell_at(-2.75, 1.0), Some(Cell::new(-11, 4)));
        assert_eq!(cell_at(0.12, 0.0), None);
        assert_eq!(cell_at(f64::NAN, 0.0), None);
        assert_eq!(cell_at(1e12, 0.0), None);
        assert_eq!(heading_at(270.0), Some(Heading::West));
        assert_eq!(heading_at(45.0), None);
    }

    #[test]
    fn an_absent_layout_is_empty_and_a_broken_one_is_an_error_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(FloorPlanLayout::read(folder.path(), "FloorPlan1").unwrap(), FloorPlanLayout::default());
        std::fs::write(folder.path().join("FloorPlan1-layout.npy"), b"not an array").unwrap();
        let error = FloorPlanLayout::read(folder.path(), "FloorPlan1").unwrap_err();
        assert!(format!("{error:#}").contains("FloorPlan1-layout.npy"));
    }

    /// A file of numpy's of that shape and type, and these numbers.
    fn array(header: &str, numbers: &[f64]) -> Vec<u8> {
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        file
    }

    fn told(file: &str, bytes: &[u8]) -> Result<FloorPlanLayout, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(file), bytes).unwrap();
        FloorPlanLayout::read(folder.path(), "FloorPlan1").map_err(|error| {
            let error = format!("{error:#}");
            assert!(error.contains(file), "{error}");
            error
        })
    }

    #[test]
    fn an_array_that_is_longer_or_shorter_than_its_header_says_or_is_turned_round_is_refused() {
        let told = |bytes: &[u8]| told("FloorPlan1-layout.npy", bytes);
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }\n";
        let mut file = array(header, &[0.25, 0.5, 0.75, 0.5]);
        assert_eq!(told(&file).unwrap().cells.len(), 2);
        assert!(told(&file[..file.len() - 2]).unwrap_err().contains("says 2 rows, and it lacks 2 bytes of them"));
        file.extend(b"junk");
        assert!(told(&file).unwrap_err().contains("goes on for 4 bytes after the 2 rows"));
        let turned = array(&header.replace("False", "True"), &[0.25, 0.5, 0.75, 0.5]);
        assert!(told(&turned).unwrap_err().contains("column by column"));
        let single = array(&header.replace("<f8", "<f4"), &[0.25, 0.5]);
        assert!(told(&single).unwrap_err().contains("f4"));
    }

    #[test]
    fn a_stand_that_is_there_twice_or_of_an_unknown_class_is_named() {
        let told = |text: &str| told("FloorPlan1-openable.json", text.as_bytes());
        let pose = "[0.25, 0.5, 90, 30]";
        assert_eq!(told(&format!(r#"{{"Fridge|1|0|1": {pose}}}"#)).unwrap().stands.len(), 1);
        for second in ["Fridge|1|0|1", "Fridge|+01.00|+00.00|+01.00"] {
            let error = told(&format!(r#"{{"Fridge|1|0|1": {pose}, "{second}": {pose}}}"#)).unwrap_err();
            assert!(error.contains(second) && error.contains("twice"), "{error}");
        }
        assert!(told(&format!(r#"{{"Dragon|1|0|1": {pose}}}"#)).unwrap_err().contains("Dragon"));
        assert!(told(&format!(r#"{{"Fridge|1|0|1": {pose}}} more"#)).unwrap_err().contains("trailing"));
    }
}
