//! Draws what the agent sees: colour, depth and instances in one pass, on one core.

pub mod draw;
pub mod raster;
pub mod resolve;
pub mod solid;

use draw::Brush;
use raster::Raster;
use solid::Solid;

use super::bounds::Extent;
use super::camera::Camera;
use super::placing;
use super::view::{self, Frame};
use crate::domain::place::Cuboid;
use crate::domain::world::{Instance, World};
use crate::domain::{Point, Scene};

/// Draws frames of one size.
pub struct Renderer {
    frame: Frame,
    raster: Raster,
}

impl Renderer {
    /// A renderer of square frames with `size` pixels a side.
    pub fn new(size: usize) -> Renderer {
        let pixels = size * size;
        let frame = Frame {
            width: size,
            height: size,
            rgb: vec![0; 3 * pixels],
            depth: vec![f32::INFINITY; pixels],
            ids: vec![0; pixels],
        };
        Renderer { frame, raster: Raster::new(size) }
    }

    /// The frame that was drawn last.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Draws what the agent sees.
    pub fn draw(&mut self, scene: &Scene, world: &World) -> &Frame {
        let camera = Camera::of(scene, world.agent);
        let metres = |height: i32| Point::new(0, height, 0).metres().y;
        let ceiling = scene.walls.iter().map(|wall| wall.max.y).max().map(metres);
        self.raster.clear();
        resolve::backdrop(&mut self.raster, &camera, scene.room, metres(scene.floor()), ceiling);
        let mut brush = Brush::new(&mut self.raster, camera);
        for wall in &scene.walls {
            brush.solid(&Solid::filling(&Extent::of_cuboid(wall), [0.85, 0.83, 0.77]), 0);
        }
        for (index, fixture) in (0u16..).zip(&scene.fixtures) {
            let instance = Instance::Fixture(index);
            let shift = if world.is_open(instance) { placing::drawer_shift(scene, index) } else { Point::default() };
            let flat = fixture.surfaces.iter().flat_map(|surface| {
                let (y, areas) = (surface.height, &surface.areas);
                areas.iter().map(move |area| {
                    let (low, high) = (area.min, area.max);
                    Cuboid::between(Point::new(low[0], y - 10, low[1]), Point::new(high[0], y, high[1]))
                })
            });
            for part in fixture.body.iter().copied().chain(flat) {
                let mut extent = Extent::of_cuboid(&part);
                extent.centre += shift.metres();
                let hue = fixture.class.index() as f32;
                let colour = [0.0, 2.1, 4.2].map(|phase| 0.6 + 0.25 * (hue * 2.4 + phase).sin());
                brush.solid(&Solid::filling(&extent, colour), view::code(instance));
            }
        }
        for (index, object) in (0u16..).zip(&world.objects) {
            let instance = Instance::Object(index);
            if object.sliced || world.in_hand(index) || world.shut_in(scene, instance).is_some() {
                continue;
            }
            let hue = object.class.index() as f32;
            let colour = [0.0, 2.1, 4.2].map(|phase| 0.6 + 0.4 * (hue * 2.4 + phase).sin());
            brush.solid(&Solid::filling(&Extent::of_object(scene, object), colour), view::code(instance));
        }
        resolve::resolve(&self.raster, &mut self.frame);
        &self.frame
    }
}
