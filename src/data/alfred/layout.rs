//! What `gen/layouts` says of a floor plan: cells that can be stood on, and where receptacles stand.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};

use super::names::{FARTHEST, Name};
use super::presence;
use crate::data::text_file;
use crate::domain::place::Pose;
use crate::domain::{Cell, Heading, Point};

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
    let bytes = std::fs::read(path)?;
    let file = npyz::NpyFile::new(&bytes[..])?;
    let shape = file.shape().to_vec();
    if shape.len() != 2 || shape[1] != 2 {
        bail!("holds an array of shape {shape:?}; n x 2 was expected");
    }
    // Memory is taken for what the header says, so that has to be there.
    if shape[0] > bytes.len() as u64 {
        bail!("is cut off: its header says {} rows", shape[0]);
    }
    let values: Vec<f64> = file.into_vec()?;
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
    let listed: BTreeMap<String, [f64; 4]> = serde_json::from_str(&text_file::read(path)?)?;
    let mut stands = BTreeMap::new();
    for (id, [x, z, rotation, horizon]) in listed {
        // A type that House has no class for cannot be acted on: it is left out.
        let Ok(name) = Name::parse(&id) else { continue };
        let (Some(cell), Some(heading)) = (cell_at(x, z), heading_at(rotation)) else {
            bail!("{id}: [{x}, {z}, {rotation}, {horizon}] is no pose");
        };
        stands.insert(name, Pose { cell, heading, horizon: horizon.clamp(-30.0, 60.0) as i16 });
    }
    Ok(stands)
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
}
