//! Movable objects as bodies.

use glam::{Mat3, Vec3};

use super::furniture::mix;
use super::looks::{FilledBox, Look, Variant};
use super::solid::{CYLINDER, Solid, SolidKind};
use crate::domain::Scene;
use crate::domain::class::Shape;
use crate::domain::world::Object;
use crate::house::doors;
use crate::house::extent::Extent;

/// The bodies of a movable object where it lies. `index` is its number in the world.
pub(crate) fn build(scene: &Scene, index: u16, object: &Object) -> Vec<Solid> {
    let mut out = Vec::new();
    let Some(look) = Look::of(object.class) else { return out };
    let extent = Extent::of_object(scene, object);
    // Slices look like what they were cut from.
    let seed = mix(u32::from(object.slice_of.map_or(index, |(whole, _)| whole)) ^ (object.class.index() as u32) << 16);
    if object.slice_of.is_some() {
        slice(look, &extent, seed, &mut out);
        return out;
    }
    let place = FilledBox { centre: extent.centre, axes: extent.axes, surface: None };
    look.fill(&place, Variant { seed, open: object.open, on: false }, &mut out);
    if let Some(lid) = doors::open_lid(scene, object) {
        let shell = Solid::filling(&lid, look.main(seed));
        let screen = Mat3::from_cols(lid.axes.x_axis * 0.92, lid.axes.y_axis * 0.88, lid.axes.z_axis);
        let centre = lid.centre - lid.axes.z_axis * 0.3;
        out.push(shell);
        out.push(Solid { centre, axes: screen, colour: [0.30, 0.55, 0.78], ..shell });
    }
    out
}

/// A disc of skin with flesh on its cut faces, which look along its own x axis.
fn slice(look: &Look, extent: &Extent, seed: u32, out: &mut Vec<Solid>) {
    let flesh = look.flesh.unwrap_or_else(|| look.main(seed).map(|part| (1.3 * part).min(1.0)));
    let (x, y, z) = (extent.axes.x_axis, extent.axes.y_axis, extent.axes.z_axis);
    let (kind, round) = match extent.shape {
        Shape::Box => (SolidKind::Box { missing: 0 }, 0.9),
        Shape::Cylinder | Shape::Ellipsoid => (SolidKind::Lathe(CYLINDER), 0.8),
    };
    let skin = Solid { kind, ..Solid::filling(extent, look.main(seed)) };
    // Round bodies turn about their second axis, which is therefore the slice's x.
    out.push(Solid { axes: Mat3::from_cols(z, x * 0.5, y), ..skin });
    out.push(Solid { axes: Mat3::from_cols(z * round, x, y * round), colour: flesh, ..skin });
}

/// The bodies of what is in the hand, in the camera's frame: small, in the lower right corner.
pub(crate) fn held(solids: &[Solid], size: f32) -> impl Iterator<Item = (Vec3, Mat3)> {
    const REACH: f32 = 0.6;
    const SIDE: f32 = 0.09;
    let middle = solids.iter().map(|solid| solid.centre).sum::<Vec3>() / solids.len().max(1) as f32;
    let scale = SIDE / size.max(0.01);
    // Turned so that one looks at it from above, as at things on a table.
    let tilt = Mat3::from_rotation_x(-0.5);
    let corner = Vec3::new(0.27, -0.27, REACH);
    solids.iter().map(move |solid| (corner + tilt * (solid.centre - middle) * scale, tilt * solid.axes * scale))
}
