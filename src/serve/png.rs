//! Frames as PNG, compressed little: they travel between two processes, seldom further.

use anyhow::Context;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use crate::house::view::Frame;

/// A frame as a PNG file.
///
/// # Errors
/// Never for a frame that was drawn.
pub(super) fn png(frame: &Frame) -> anyhow::Result<Vec<u8>> {
    let mut file = Vec::with_capacity(frame.rgb.len() / 8);
    let encoder = PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Up);
    let (width, height) = (frame.width as u32, frame.height as u32);
    encoder.write_image(&frame.rgb, width, height, ExtendedColorType::Rgb8).context("a frame cannot be encoded")?;
    Ok(file)
}
