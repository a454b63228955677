//! A picture of pixels to draw on.

use std::convert::Infallible;

use anyhow::Context;
use embedded_graphics::Pixel;
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::{DrawTarget, Drawable, OriginDimensions, Point, RgbColor, Size};
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::house::view::Frame;

/// A colour: red, green, blue.
pub(crate) type RgbColour = [u8; 3];

/// A picture of three bytes a pixel, row by row. Whatever `embedded-graphics` has can be drawn on it; what lies outside is cut.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Pixmap {
    /// Pixels in a row.
    pub(crate) width: usize,
    /// Rows of pixels.
    pub(crate) height: usize,
    /// Red, green and blue of every pixel, row by row.
    pub(crate) rgb: Vec<u8>,
}

/// A colour as `embedded-graphics` names it.
pub(crate) fn rgb888([red, green, blue]: RgbColour) -> Rgb888 {
    Rgb888::new(red, green, blue)
}

impl Pixmap {
    /// A picture of one colour.
    pub(crate) fn new(width: usize, height: usize, colour: RgbColour) -> Pixmap {
        Pixmap { width, height, rgb: colour.repeat(width * height) }
    }

    /// Draws a shape or a text of `embedded-graphics`.
    pub(crate) fn draw(&mut self, drawable: &impl Drawable<Color = Rgb888>) {
        let Ok(_) = drawable.draw(self);
    }

    /// Writes a line of text with its upper left corner at (x, y).
    pub(crate) fn text(&mut self, x: usize, y: usize, text: &str, font: &MonoFont<'_>, colour: RgbColour) {
        let style = TextStyleBuilder::new().alignment(Alignment::Left).baseline(Baseline::Top).build();
        let at = Point::new(x as i32, y as i32);
        self.draw(&Text::with_text_style(text, at, MonoTextStyle::new(font, rgb888(colour)), style));
    }

    /// Draws a frame with its upper left corner at (x, y), every `step`th pixel of it.
    pub(crate) fn frame(&mut self, frame: &Frame, x: usize, y: usize, step: usize) {
        for row in 0..frame.height / step {
            for column in 0..frame.width / step {
                let at = 3 * (row * step * frame.width + column * step);
                self.set(x + column, y + row, [frame.rgb[at], frame.rgb[at + 1], frame.rgb[at + 2]]);
            }
        }
    }

    fn set(&mut self, x: usize, y: usize, colour: RgbColour) {
        if x < self.width && y < self.height {
            let at = 3 * (y * self.width + x);
            self.rgb[at..at + 3].copy_from_slice(&colour);
        }
    }

    /// The picture encoded as a PNG file.
    ///
    /// # Errors
    /// Never in practice: it is written to memory.
    pub(crate) fn png(&self) -> anyhow::Result<Vec<u8>> {
        let mut data = Vec::new();
        let (width, height) = (self.width as u32, self.height as u32);
        PngEncoder::new(&mut data)
            .write_image(&self.rgb, width, height, ExtendedColorType::Rgb8)
            .context("the picture cannot be encoded")?;
        Ok(data)
    }
}

impl OriginDimensions for Pixmap {
    fn size(&self) -> Size {
        Size::new(self.width as u32, self.height as u32)
    }
}

impl DrawTarget for Pixmap {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            if let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) {
                self.set(x, y, [colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}
