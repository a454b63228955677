//! What to assume of furniture that no recording shows in use: medians over ALFRED's floor plans.

use crate::domain::Class;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MeasuredHeight {
    /// Above the fixture's pivot, in millimetres.
    Pivot(i32),
    /// Above the floor, in millimetres.
    Floor(i32),
}

/// How a fixture's body is constructed from its surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BodyKind {
    /// From the floor to the surface: tables, counters, beds.
    Block,
    /// The top of a counter; what is below is not part of it.
    Slab,
    /// A block with a back that rises behind it: sofas.
    Seat,
    /// A bowl before a tank that things stand on.
    Toilet,
    /// A thin board under the surface: shelves.
    Board,
    /// A tub open at the top, whose contents lie inside: sinks, garbage cans.
    Tub,
    /// A cupboard whose contents lie inside.
    Shell,
    /// Something of its own size that the contents do not tell: lamps, faucets.
    Thing,
}

/// Assumptions about a class of furniture. Lengths in millimetres; widths run along the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Furniture {
    /// ALFRED's name of the class.
    pub(crate) class: &'static str,
    /// The construction of its body.
    pub(crate) build: BodyKind,
    /// The heights of its surfaces.
    pub(crate) supports: &'static [MeasuredHeight],
    /// Width and depth of a surface.
    pub(crate) area: [i32; 2],
    /// Width, height, depth of the body.
    pub(crate) body: [i32; 3],
    /// The body's bottom.
    pub(crate) bottom: MeasuredHeight,
    /// How far the body's middle lies behind the pivot.
    pub(crate) behind: i32,
}

use BodyKind::{Block, Board, Seat, Shell, Slab, Thing, Toilet, Tub};
use MeasuredHeight::{Floor, Pivot};

const fn row(
    class: &'static str,
    build: BodyKind,
    supports: &'static [MeasuredHeight],
    area: [i32; 2],
    body: [i32; 3],
    bottom: MeasuredHeight,
    behind: i32,
) -> Furniture {
    Furniture { class, build, supports, area, body, bottom, behind }
}

const TABLE: &[Furniture] = &[
    row("ArmChair", Seat, &[Floor(430)], [570, 470], [800, 900, 760], Floor(0), 0),
    row("Bathtub", Tub, &[Pivot(10)], [1190, 530], [1400, 500, 700], Floor(0), 0),
    row("Bed", Block, &[Floor(620)], [1560, 1000], [1560, 620, 1900], Floor(0), 0),
    row("Cabinet", Shell, &[Pivot(-340)], [480, 310], [520, 700, 400], Pivot(-350), 200),
    row("Cart", Block, &[Floor(310), Floor(800)], [570, 440], [640, 800, 450], Floor(0), 0),
    row("CoffeeMachine", Thing, &[Pivot(56)], [100, 100], [300, 400, 300], Pivot(0), 40),
    row("CoffeeTable", Block, &[Floor(450)], [900, 590], [1000, 450, 650], Floor(0), 0),
    row("CounterTop", Slab, &[Pivot(-40)], [1520, 600], [1520, 50, 600], Pivot(-90), 0),
    row("Desk", Block, &[Floor(790)], [1320, 600], [1320, 790, 600], Floor(0), 0),
    row("DeskLamp", Thing, &[], [0, 0], [230, 420, 160], Pivot(0), 0),
    row("DiningTable", Block, &[Floor(787)], [1210, 720], [1210, 787, 720], Floor(0), 0),
    row("Drawer", Shell, &[Pivot(-40)], [400, 220], [500, 150, 420], Pivot(-85), 20),
    row("Dresser", Block, &[Floor(850)], [970, 470], [1000, 850, 480], Floor(0), 0),
    row("Faucet", Thing, &[], [0, 0], [200, 280, 80], Pivot(-140), 0),
    row("FloorLamp", Thing, &[], [0, 0], [430, 1540, 390], Floor(0), 0),
    row(
        "Fridge",
        Shell,
        &[Floor(380), Floor(800), Floor(1200), Floor(1520)],
        [600, 360],
        [700, 1800, 600],
        Floor(0),
        0,
    ),
    row("GarbageCan", Tub, &[Floor(70)], [250, 220], [380, 430, 350], Floor(0), 0),
    row("HandTowelHolder", Thing, &[Pivot(-680)], [100, 100], [200, 60, 80], Pivot(-30), 0),
    row("Microwave", Shell, &[Pivot(111)], [350, 260], [560, 340, 360], Pivot(0), 0),
    row("Ottoman", Block, &[Floor(427)], [710, 470], [750, 427, 500], Floor(0), 0),
    row("Safe", Shell, &[Pivot(50)], [360, 300], [420, 500, 400], Pivot(0), 0),
    row("Shelf", Board, &[Pivot(10)], [620, 260], [650, 30, 280], Pivot(-20), 0),
    row("SideTable", Block, &[Floor(676)], [540, 370], [540, 676, 400], Floor(0), 0),
    row("Sink", Tub, &[Pivot(10)], [510, 320], [560, 200, 400], Pivot(-20), 0),
    row("Sofa", Seat, &[Floor(480)], [1330, 520], [1900, 850, 860], Floor(0), 0),
    row("StoveBurner", Thing, &[Pivot(10)], [100, 100], [210, 20, 210], Pivot(-10), 0),
    row("TVStand", Block, &[Floor(600)], [1000, 400], [1100, 600, 450], Floor(0), 0),
    row("Toilet", Toilet, &[Floor(1050)], [480, 200], [480, 1050, 300], Floor(0), 0),
    row("ToiletPaperHanger", Thing, &[Pivot(0)], [60, 60], [160, 100, 100], Pivot(-50), 0),
    row("TowelHolder", Thing, &[Pivot(-600)], [100, 100], [500, 60, 80], Pivot(-30), 0),
];

/// What to assume of a class; of one that the table does not list, a small block.
pub(crate) fn of(class: Class) -> &'static Furniture {
    const UNKNOWN: Furniture = row("", Block, &[Pivot(0)], [300, 300], [400, 500, 400], Floor(0), 0);
    TABLE.iter().find(|row| row.class == class.name()).unwrap_or(&UNKNOWN)
}

impl MeasuredHeight {
    /// In the world's frame.
    pub(crate) fn above(self, pivot: i32, floor: i32) -> i32 {
        match self {
            MeasuredHeight::Pivot(mm) => pivot + mm,
            MeasuredHeight::Floor(mm) => floor + mm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fixed_class_of_the_object_table_has_a_row_and_every_receptacle_a_surface() {
        for class in Class::all().filter(|class| !class.info().pickupable) {
            let row = of(class);
            assert_eq!(row.class, class.name());
            assert_eq!(class.info().receptacle, !row.supports.is_empty(), "{}", class.name());
            assert!(row.body.iter().all(|&side| side > 0));
        }
    }
}
