//! Draws what the agent sees: colour, depth and instances in one pass, on one core.

pub mod cast;
pub mod draw;
pub mod furniture;
pub mod looks;
pub mod objects;
pub mod raster;
pub mod resolve;
pub mod solid;

use cast::{Cast, Figure};
use draw::Brush;
use raster::Raster;

use super::camera::Camera;
use super::view::{self, Frame, View};
use crate::domain::world::{Instance, World};
use crate::domain::{Point, Scene};

/// Draws frames of one size. What it keeps between frames only saves work: a frame depends on the scene and the world alone.
pub struct Renderer {
    frame: Frame,
    raster: Raster,
    cast: Cast,
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
        Renderer { frame, raster: Raster::new(size), cast: Cast::default() }
    }

    /// The frame that was drawn last.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Draws what the agent sees. What is shut in, sliced up or in the hand is not in the scene; the held object is shown
    /// small in the lower right corner, as no instance.
    pub fn draw(&mut self, scene: &Scene, world: &World) -> &Frame {
        self.cover(scene, world);
        resolve::resolve(&self.raster, &mut self.frame);
        &self.frame
    }

    /// What would be seen in the drawn frame, without colouring it.
    pub fn look(&mut self, scene: &Scene, world: &World) -> View {
        self.cover(scene, world);
        let (size, materials) = (self.raster.size(), self.raster.materials());
        let row = |row: usize| self.raster.row(row).1[..size].iter().map(|&number| materials[usize::from(number)].id);
        View::of_rows(size, (0..size).map(row))
    }

    /// Decides for every pixel what is in front.
    fn cover(&mut self, scene: &Scene, world: &World) {
        let camera = Camera::of(scene, world.agent);
        let metres = |height: i32| Point::new(0, height, 0).metres().y;
        let ceiling = scene.walls.iter().map(|wall| wall.max.y).max().map(metres);
        self.cast.follow(scene, world);
        self.raster.clear();
        resolve::backdrop(&mut self.raster, &camera, scene.room, metres(scene.floor()), ceiling);
        let mut brush = Brush::new(&mut self.raster, camera);
        for wall in &self.cast.walls.solids {
            brush.solid(wall, 0);
        }
        for (index, figure) in (0u16..).zip(&self.cast.fixtures) {
            figure.draw(&mut brush, view::code(Instance::Fixture(index)));
        }
        for ((index, object), figure) in (0u16..).zip(&world.objects).zip(&self.cast.things) {
            let instance = Instance::Object(index);
            let gone = object.sliced || !figure.is_in_view(&brush);
            if !gone && !world.in_hand(index) && world.shut_in(scene, instance).is_none() {
                figure.draw(&mut brush, view::code(instance));
            }
        }
        if let Some(held) = world.held.and_then(|held| self.cast.things.get(usize::from(held))) {
            brush.bring_forward(camera.eye(), 0.0);
            for (solid, (centre, axes)) in held.solids.iter().zip(objects::held(&held.solids, held.radius)) {
                brush.local(solid, centre, axes, 0);
            }
        }
    }
}

impl Figure {
    fn is_in_view(&self, brush: &Brush) -> bool {
        !self.solids.is_empty() && brush.sees(self.centre, self.radius)
    }

    fn draw(&self, brush: &mut Brush, id: u16) {
        if self.is_in_view(brush) {
            brush.bring_forward(self.centre, self.forward());
            for solid in &self.solids {
                brush.solid(solid, id);
            }
        }
    }
}
