//! Draws what the agent sees.

use super::view::Frame;
use crate::domain::{Scene, World};

/// Draws frames of one size.
pub struct Renderer {
    frame: Frame,
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
        Renderer { frame }
    }

    /// Draws what the agent sees.
    pub fn draw(&mut self, _scene: &Scene, _world: &World) -> &Frame {
        &self.frame
    }
}
