//! A floor plan put together from everything that is recorded of it.

use super::cover::overlap;
use super::fixtures::Inventory;
use super::furniture::{self, BodyKind};
use super::layout::FloorPlanLayout;
use super::recording::{RecordedStart, Recording};
use super::support::{self, StandingObject};
use super::{bodies, facing, meshes, walls};
use crate::domain::place::{Cuboid, Rect};
use crate::domain::{Cell, Fixture, Room, Scene};

/// A floor plan and what is needed to resolve recordings against it.
#[derive(Clone, Debug)]
pub(crate) struct Built {
    pub(crate) scene: Scene,
    /// Names of its fixtures.
    pub(crate) inventory: Inventory,
    /// Points that recordings assign to fixtures.
    pub(crate) recorded: Vec<StandingObject>,
}

/// Builds one floor plan from its layout, its recordings, and further states of it.
///
/// # Errors
/// When there is no cell to stand on.
pub(crate) fn build(
    name: &str,
    room: Room,
    layout: &FloorPlanLayout,
    recordings: &[&Recording],
    settings: &[&RecordedStart],
) -> Result<Built, String> {
    let inventory = Inventory::gather(layout, recordings);
    let cells = cells(layout, recordings, settings);
    if cells.is_empty() {
        return Err(format!("{name}: no file says where the agent can stand"));
    }
    let agent_y = support::median(settings.iter().map(|setting| setting.agent_y));
    let floor = agent_y - 900;
    let recorded = support::recorded(recordings, &inventory);
    let assigned = support::assigned(settings, &recorded);
    let walked = support::walked(&cells);
    let fixture = |number: usize, basins: &[Rect]| {
        let found = &inventory.found[number];
        let facing = facing::facing(found, &cells);
        let blocked = match furniture::of(found.name.class).build {
            BodyKind::Block | BodyKind::Seat => walked.clone(),
            BodyKind::Slab => [&walked[..], basins].concat(),
            _ => Vec::new(),
        };
        let surfaces = support::surfaces(&inventory, number as u16, &assigned, &blocked, facing, floor);
        let mut fixture = Fixture {
            id: found.name.text(),
            class: found.name.class,
            pivot: found.pivot,
            facing,
            body: Vec::new(),
            surfaces,
            stand: found.vetted.or_else(|| found.walked_to.first().copied()),
        };
        bodies::furnish(&mut fixture, found, agent_y, &cells);
        fixture
    };
    let mut fixtures: Vec<Fixture> = (0..inventory.found.len()).map(|number| fixture(number, &[])).collect();
    // Basins are let into counters: where they are is known only now.
    let basins = fixtures.iter().filter(|fixture| matches!(fixture.class.name(), "Sink" | "Bathtub"));
    let basins: Vec<Rect> = basins.flat_map(|basin| &basin.body).map(Cuboid::footprint).collect();
    for (number, made) in fixtures.iter_mut().enumerate() {
        let slab = furniture::of(made.class).build == BodyKind::Slab;
        let shared = |basin: &Rect| made.body.iter().any(|part| overlap(&part.footprint(), basin));
        if slab && basins.iter().any(shared) {
            *made = fixture(number, &basins);
        }
    }
    let mut walls = walls::around(&cells, &fixtures, floor);
    walls.extend(walls::under_counters(&fixtures, floor));
    let scene = Scene {
        format_version: Scene::FORMAT,
        name: name.to_owned(),
        room,
        agent_y,
        cells,
        fixtures,
        walls,
        meshes: meshes::meshes(recordings, agent_y),
    };
    Ok(Built { scene, inventory, recorded })
}

/// The published cells and all that anybody stood on.
fn cells(layout: &FloorPlanLayout, recordings: &[&Recording], settings: &[&RecordedStart]) -> Vec<Cell> {
    let mut cells = layout.cells.clone();
    cells.extend(settings.iter().map(|setting| setting.agent.cell));
    for recording in recordings {
        let poses = recording.poses();
        cells.extend(poses.iter().map(|pose| pose.cell));
        if let (Some(last), Some(step)) = (poses.last(), recording.steps.last())
            && step.kind == crate::domain::ActionType::MoveAhead
        {
            cells.push(last.cell.ahead(last.heading));
        }
    }
    cells.sort_unstable();
    cells.dedup();
    cells
}
