//! A picture to draw on.

use anyhow::Context;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::house::view::Frame;

/// A picture of three bytes a pixel, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green, blue.
    pub rgb: Vec<u8>,
}

impl Canvas {
    /// A picture of one colour.
    pub fn new(width: usize, height: usize, colour: [u8; 3]) -> Canvas {
        Canvas { width, height, rgb: colour.repeat(width * height) }
    }

    /// Sets a pixel; one outside is passed over.
    pub fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        if x < self.width && y < self.height {
            let at = 3 * (y * self.width + x);
            self.rgb[at..at + 3].copy_from_slice(&colour);
        }
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, x: usize, y: usize, width: usize, height: usize, colour: [u8; 3]) {
        for row in y..(y + height).min(self.height) {
            for column in x..(x + width).min(self.width) {
                self.set(column, row, colour);
            }
        }
    }

    /// Draws a frame, its upper left corner at (x, y), every `step`th pixel of it.
    pub fn place(&mut self, frame: &Frame, x: usize, y: usize, step: usize) {
        for row in 0..frame.height / step {
            for column in 0..frame.width / step {
                let at = 3 * (row * step * frame.width + column * step);
                self.set(x + column, y + row, [frame.rgb[at], frame.rgb[at + 1], frame.rgb[at + 2]]);
            }
        }
    }

    /// As a PNG file.
    ///
    /// # Errors
    /// Never in practice: it is written to memory.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        let mut data = Vec::new();
        let (width, height) = (self.width as u32, self.height as u32);
        PngEncoder::new(&mut data)
            .write_image(&self.rgb, width, height, ExtendedColorType::Rgb8)
            .context("the picture cannot be encoded")?;
        Ok(data)
    }
}
