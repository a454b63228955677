//! The table of looks: which bodies make up each class, inside the box that was measured of it.

use std::sync::OnceLock;

use glam::{Mat3, Vec3};
use serde::Deserialize;

use super::solid::{CYLINDER, Lathe, RgbF32, Solid, SolidKind};
use crate::domain::Class;

/// When a part is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum When {
    Open,
    Closed,
    On,
    Off,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PartShape {
    #[default]
    Box,
    Tub,
    Case,
    Ball,
    Rod,
    Turned,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LookRow {
    class: Class,
    piece: Option<usize>,
    #[serde(default)]
    each: bool,
    palette: Vec<String>,
    inner: Option<String>,
    flesh: Option<String>,
    slab: Option<String>,
    parts: Vec<PartRow>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct PartRow {
    shape: PartShape,
    x: String,
    y: String,
    z: String,
    rings: Vec<[f32; 2]>,
    hollow: bool,
    colour: String,
    lit: Option<String>,
    glow: bool,
    when: Option<When>,
}

impl Default for PartRow {
    fn default() -> PartRow {
        let (all, main) = (|| "0 1".to_string(), "main".to_string());
        let (x, y, z) = (all(), all(), all());
        let (shape, rings, hollow) = (PartShape::Box, Vec::new(), false);
        PartRow { shape, x, y, z, rings, hollow, colour: main, lit: None, glow: false, when: None }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LookTable {
    look: Vec<LookRow>,
}

/// A place along a side of the box: a fraction of the side, or the lowest surface, plus metres.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SidePosition {
    Fraction(f32, f32),
    Surface(f32),
}

/// Where a part's colour comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum PartColour {
    Main(f32),
    Own(RgbF32),
}

#[derive(Debug)]
struct LookPart {
    kind: SolidKind,
    spans: [[SidePosition; 2]; 3],
    paint: PartColour,
    lit: Option<RgbF32>,
    glow: bool,
    when: Option<When>,
}

/// The look of a class, or of one box of its body.
#[derive(Debug)]
pub(crate) struct Look {
    class: Class,
    piece: Option<usize>,
    /// Every box of a body of several looks like this.
    pub(crate) each: bool,
    palette: Vec<RgbF32>,
    inner: Option<RgbF32>,
    /// The colour inside, where it was cut.
    pub(crate) flesh: Option<RgbF32>,
    /// The colour of flat pieces of a body of many boxes: counter tops.
    pub(crate) slab: Option<RgbF32>,
    parts: Vec<LookPart>,
}

/// What a look depends on besides the class.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Variant {
    /// Tells instances apart: the same number gives the same shade.
    pub(crate) seed: u32,
    /// Its door, drawer or lid stands open.
    pub(crate) open: bool,
    /// It is switched on.
    pub(crate) on: bool,
}

/// A box of space to be filled: its middle, its half axes (columns), and the height of the lowest surface in metres of the
/// scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilledBox {
    /// The middle.
    pub(crate) centre: Vec3,
    /// The half axes.
    pub(crate) axes: Mat3,
    /// Where the lowest surface is, for furniture that has one.
    pub(crate) surface: Option<f32>,
}

/// A colour written as `#rrggbb`, or `None`.
fn hex(text: &str) -> Option<RgbF32> {
    let number = u32::from_str_radix(text.strip_prefix('#').filter(|digits| digits.len() == 6)?, 16).ok()?;
    Some([16, 8, 0].map(|shift| (number >> shift & 255) as f32 / 255.0))
}

fn mark(text: &str) -> Option<SidePosition> {
    let split = text.find(['+', '-']).unwrap_or(text.len());
    let (base, offset) = text.split_at(split);
    let metres = if offset.is_empty() { 0.0 } else { offset.parse::<f32>().ok()? / 1000.0 };
    if base == "s" {
        Some(SidePosition::Surface(metres))
    } else {
        Some(SidePosition::Fraction(base.parse().ok()?, metres))
    }
}

fn span(text: &str) -> Option<[SidePosition; 2]> {
    let (from, to) = text.split_once(' ')?;
    Some([mark(from)?, mark(to)?])
}

fn part(row: PartRow) -> Option<LookPart> {
    let kind = match row.shape {
        PartShape::Box => SolidKind::Box { missing: 0 },
        PartShape::Tub => SolidKind::Box { missing: 1 << 3 },
        PartShape::Case => SolidKind::Box { missing: 1 << 4 },
        PartShape::Ball => SolidKind::Ellipsoid,
        PartShape::Rod => SolidKind::Lathe(CYLINDER),
        // Heights in the table run from 0 to 1, those of a lathe from -1 to 1. The table lives as long as the program.
        PartShape::Turned => {
            let rings = row.rings.iter().map(|&[height, radius]| [2.0 * height - 1.0, radius]).collect::<Vec<_>>();
            SolidKind::Lathe(Lathe { rings: rings.leak(), hollow: row.hollow })
        }
    };
    let paint = match row.colour.as_str() {
        "main" => PartColour::Main(1.0),
        "dark" => PartColour::Main(0.72),
        "light" => PartColour::Main(1.22),
        own => PartColour::Own(hex(own)?),
    };
    let lit = match row.lit {
        Some(text) => Some(hex(&text)?),
        None => None,
    };
    let spans = [span(&row.x)?, span(&row.y)?, span(&row.z)?];
    Some(LookPart { kind, spans, paint, lit, glow: row.glow, when: row.when })
}

fn look(row: LookRow) -> Option<Look> {
    let optional = |text: Option<String>| text.map(|text| hex(&text));
    let LookRow { class, piece, each, palette, inner, flesh, slab, parts } = row;
    Some(Look {
        class,
        piece,
        each,
        palette: palette.iter().map(|text| hex(text)).collect::<Option<Vec<_>>>().filter(|all| !all.is_empty())?,
        inner: optional(inner).unwrap_or_default(),
        flesh: optional(flesh).unwrap_or_default(),
        slab: optional(slab).unwrap_or_default(),
        parts: parts.into_iter().map(part).collect::<Option<_>>()?,
    })
}

fn table() -> &'static [Look] {
    static TABLE: OnceLock<Vec<Look>> = OnceLock::new();
    TABLE.get_or_init(|| {
        // The table is part of the program: a test reads it strictly, so nothing is left out in a build that passed.
        let rows = toml::from_str::<LookTable>(include_str!("../../../assets/looks.toml")).map(|table| table.look);
        rows.unwrap_or_default().into_iter().filter_map(look).collect()
    })
}

impl Look {
    /// The look of a class as a whole.
    pub(crate) fn of(class: Class) -> Option<&'static Look> {
        table().iter().find(|look| look.class == class && look.piece.is_none())
    }

    /// The look of one box of a body of several.
    pub(crate) fn of_piece(class: Class, piece: usize) -> Option<&'static Look> {
        table().iter().find(|look| look.class == class && look.piece == Some(piece))
    }

    /// The main colour of an instance: one of the palette, a little lighter or darker.
    pub(crate) fn main(&self, seed: u32) -> RgbF32 {
        let colour = self.palette[seed as usize % self.palette.len()];
        let shift = |bits: u32, span: f32| 1.0 + span * ((seed >> bits & 15) as f32 / 7.5 - 1.0);
        let bright = shift(8, 0.06);
        let tint = [shift(12, 0.03), shift(16, 0.03), shift(20, 0.03)];
        std::array::from_fn(|i| (colour[i] * bright * tint[i]).min(1.0))
    }

    /// The colour of insides.
    pub(crate) fn inner(&self, seed: u32) -> RgbF32 {
        self.inner.unwrap_or_else(|| self.main(seed).map(|part| 0.6 * part))
    }

    /// Fills a box with the bodies of this look.
    pub(crate) fn fill(&self, place: &FilledBox, variant: Variant, out: &mut Vec<Solid>) {
        let (main, inner) = (self.main(variant.seed), self.inner(variant.seed));
        for part in &self.parts {
            let shown = match part.when {
                None => true,
                Some(When::Open) => variant.open,
                Some(When::Closed) => !variant.open,
                Some(When::On) => variant.on,
                Some(When::Off) => !variant.on,
            };
            if !shown {
                continue;
            }
            let (low, high) = part.corners(place);
            let half = ((high - low) / 2.0).max(Vec3::splat(0.0005));
            let (at, sides) = ((low + high) / 2.0, place.unit_axes());
            let lit = part.lit.filter(|_| variant.on);
            let colour = match part.paint {
                PartColour::Main(factor) => main.map(|c| (c * factor).min(1.0)),
                PartColour::Own(colour) => colour,
            };
            out.push(Solid {
                kind: part.kind,
                centre: place.centre + sides * at,
                axes: Mat3::from_cols(sides.x_axis * half.x, sides.y_axis * half.y, sides.z_axis * half.z),
                colour: lit.unwrap_or(colour),
                inner,
                glows: part.glow || lit.is_some(),
            });
        }
    }
}

impl FilledBox {
    /// The directions of the axes.
    fn unit_axes(&self) -> Mat3 {
        let unit = |axis: Vec3| axis.normalize_or_zero();
        Mat3::from_cols(unit(self.axes.x_axis), unit(self.axes.y_axis), unit(self.axes.z_axis))
    }
}

impl LookPart {
    /// Two opposite corners in metres from the middle of the box.
    fn corners(&self, place: &FilledBox) -> (Vec3, Vec3) {
        let half = [place.axes.x_axis, place.axes.y_axis, place.axes.z_axis].map(Vec3::length);
        let at = |axis: usize, mark: SidePosition| match mark {
            SidePosition::Fraction(fraction, metres) => half[axis] * (2.0 * fraction - 1.0) + metres,
            SidePosition::Surface(metres) => {
                let height = place.surface.map(|height| height - place.centre.y);
                height.unwrap_or(0.0).clamp(-half[axis], half[axis]) + metres
            }
        };
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let [from, to] = self.spans[axis];
            let (from, to) = (at(axis, from), at(axis, to));
            // Millimetres may cross over in a box that is very small.
            (low[axis], high[axis]) = (from.min(to), from.max(to));
        }
        (Vec3::from(low), Vec3::from(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_the_table_is_understood_and_every_class_has_a_look() {
        let rows: LookTable = toml::from_str(include_str!("../../../assets/looks.toml")).unwrap();
        for row in rows.look {
            let class = row.class;
            assert!(look(row).is_some(), "{}", class.name());
        }
        for class in Class::all() {
            assert!(Look::of(class).is_some(), "{}", class.name());
        }
    }

    #[test]
    fn a_mark_is_a_fraction_and_millimetres() {
        assert_eq!(mark("0.5-20"), Some(SidePosition::Fraction(0.5, -0.02)));
        assert_eq!(mark("s+3"), Some(SidePosition::Surface(0.003)));
        assert_eq!(mark("left"), None);
    }
}
