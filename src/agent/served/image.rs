//! A frame as a message holds it: NumPy's array of height x width x 3 bytes, or a PNG where it goes over a network.

use anyhow::Context;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rmpv::Value;

use super::dialogue::Protocol;
use crate::house::view::Frame;

/// Packs a frame's colours.
///
/// # Errors
/// When it cannot be encoded.
pub(super) fn pack(frame: &Frame, protocol: Protocol, is_local: bool) -> anyhow::Result<Value> {
    let shape = Value::Array(vec![frame.height.into(), frame.width.into(), 3.into()]);
    // openpi knows no pictures but arrays.
    if is_local || protocol == Protocol::Openpi {
        let key = |name: &str| match protocol {
            Protocol::Openpi => Value::Binary(name.as_bytes().to_vec()),
            Protocol::VlaEval => name.into(),
        };
        let fields = [
            ("__ndarray__", true.into()),
            ("data", Value::Binary(frame.rgb.clone())),
            ("dtype", "|u1".into()),
            ("shape", shape),
        ];
        return Ok(Value::Map(fields.into_iter().map(|(name, value)| (key(name), value)).collect()));
    }
    let mut png = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Sub);
    let (width, height) = (frame.width as u32, frame.height as u32);
    encoder.write_image(&frame.rgb, width, height, ExtendedColorType::Rgb8).context("a frame could not be packed")?;
    Ok(Value::Map(vec![
        ("__image__".into(), true.into()),
        ("format".into(), "png".into()),
        ("data".into(), Value::Binary(png)),
        ("shape".into(), shape),
    ]))
}
