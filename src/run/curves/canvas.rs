//! A drawing of lines and texts, as vectors or as pixels.

use std::fmt::Write;
use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};

use super::glyphs;

/// Where a text's point lies.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

type Colour = (u8, u8, u8);

enum Mark {
    Line { points: Vec<(f64, f64)>, colour: Colour, width: f64 },
    Text { at: (f64, f64), text: String, anchor: Anchor, colour: Colour },
}

/// Lines and texts on white.
pub(super) struct Drawing {
    size: (f64, f64),
    marks: Vec<Mark>,
}

impl Drawing {
    pub(super) fn new(width: f64, height: f64) -> Drawing {
        Drawing { size: (width, height), marks: Vec::new() }
    }

    pub(super) fn line(&mut self, points: &[(f64, f64)], colour: Colour, width: f64) {
        self.marks.push(Mark::Line { points: points.to_vec(), colour, width });
    }

    /// A text in one line, its baseline at `at`.
    pub(super) fn text(&mut self, at: (f64, f64), text: &str, anchor: Anchor, colour: Colour) {
        self.marks.push(Mark::Text { at, text: text.to_string(), anchor, colour });
    }

    pub(super) fn svg(&self) -> String {
        let (width, height) = self.size;
        let mut svg = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" font-family="sans-serif" font-size="11">"#
        );
        let _ = writeln!(svg, r##"<rect width="100%" height="100%" fill="#fff"/>"##);
        for mark in &self.marks {
            let _ = match mark {
                Mark::Line { points, colour: (r, g, b), width } => {
                    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                    let points = points.join(" ");
                    writeln!(
                        svg,
                        r#"<polyline points="{points}" fill="none" stroke="rgb({r},{g},{b})" stroke-width="{width}"/>"#
                    )
                }
                Mark::Text { at: (x, y), text, anchor, colour: (r, g, b) } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
                    writeln!(
                        svg,
                        r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" fill="rgb({r},{g},{b})">{text}</text>"#
                    )
                }
            };
        }
        svg.push_str("</svg>\n");
        svg
    }

    pub(super) fn png(&self) -> anyhow::Result<Vec<u8>> {
        let mut picture = RgbImage::from_pixel(self.size.0.ceil() as u32, self.size.1.ceil() as u32, Rgb([255; 3]));
        for mark in &self.marks {
            match mark {
                Mark::Line { points, colour, width } => {
                    for pair in points.windows(2) {
                        stroke(&mut picture, pair[0], pair[1], *colour, *width);
                    }
                }
                Mark::Text { at, text, anchor, colour } => write(&mut picture, *at, text, *anchor, *colour),
            }
        }
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Png)?;
        Ok(bytes.into_inner())
    }
}

fn dot(picture: &mut RgbImage, x: f64, y: f64, (r, g, b): Colour) {
    if x >= 0.0
        && y >= 0.0
        && let Some(pixel) = picture.get_pixel_mut_checked(x as u32, y as u32)
    {
        *pixel = Rgb([r, g, b]);
    }
}

fn stroke(picture: &mut RgbImage, from: (f64, f64), to: (f64, f64), colour: Colour, width: f64) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let steps = dx.abs().max(dy.abs()).ceil().max(1.0);
    for i in 0..=steps as u32 {
        let share = f64::from(i) / steps;
        let (x, y) = (from.0 + share * dx, from.1 + share * dy);
        dot(picture, x, y, colour);
        if width > 1.0 {
            // Steep lines grow sideways, flat ones downwards.
            let (right, down) = if dy.abs() > dx.abs() { (1.0, 0.0) } else { (0.0, 1.0) };
            dot(picture, x + right, y + down, colour);
        }
    }
}

fn write(picture: &mut RgbImage, at: (f64, f64), text: &str, anchor: Anchor, colour: Colour) {
    let length = text.chars().count() as f64 * glyphs::ADVANCE;
    let left = match anchor {
        Anchor::Start => at.0,
        Anchor::Middle => at.0 - length / 2.0,
        Anchor::End => at.0 - length,
    };
    for (i, letter) in text.chars().enumerate() {
        for (column, bits) in glyphs::columns(letter).into_iter().enumerate() {
            for row in (0..8).filter(|row| (bits >> row) & 1 == 1) {
                let x = left.round() + i as f64 * glyphs::ADVANCE + column as f64;
                dot(picture, x, at.1.round() - 7.0 + f64::from(row), colour);
            }
        }
    }
}
