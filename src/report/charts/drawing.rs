//! A drawing of lines, dots and texts on white, as vectors or as pixels.

use std::fmt::Write;
use std::path::Path;

use embedded_graphics::mono_font::iso_8859_1::FONT_10X20;
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::prelude::{Point, Primitive};
use embedded_graphics::primitives::{Circle, Polyline, PrimitiveStyle};
use embedded_graphics::text::{Alignment, Text};

use crate::data::atomic_file;
use crate::language::instruction::is_control;
use crate::report::pixmap::{Pixmap, RgbColour, rgb888};

/// How a text lies about its point.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Anchor {
    /// The text begins at the point.
    Start,
    /// The text is centred on the point.
    Middle,
    /// The text ends at the point.
    End,
}

#[derive(Clone, Debug)]
enum Element {
    Line { points: Vec<(f64, f64)>, colour: RgbColour, width: f64 },
    Dot { at: (f64, f64), colour: RgbColour },
    Text { at: (f64, f64), text: String, anchor: Anchor, colour: RgbColour },
}

/// Pixels of the picture to a unit of the drawing.
const SCALE: f64 = 2.0;
/// The font of the picture; the SVG leaves it to whoever shows it.
const FONT: MonoFont<'_> = FONT_10X20;
/// The radius of a dot, in units of the drawing.
const RADIUS: f64 = 3.5;

/// Lines, dots and texts, in the order in which they cover each other.
#[derive(Clone, Debug)]
pub struct Drawing {
    size: (f64, f64),
    title: String,
    elements: Vec<Element>,
}

impl Drawing {
    /// An empty drawing; the title is for those who cannot see it.
    pub(crate) fn new(width: f64, height: f64, title: &str) -> Drawing {
        Drawing { size: (width, height), title: title.to_owned(), elements: Vec::new() }
    }

    /// Adds a line through points.
    pub(crate) fn line(&mut self, points: &[(f64, f64)], colour: RgbColour, width: f64) {
        self.elements.push(Element::Line { points: points.to_vec(), colour, width });
    }

    /// Adds a dot, which marks a point of a line.
    pub(crate) fn dot(&mut self, at: (f64, f64), colour: RgbColour) {
        self.elements.push(Element::Dot { at, colour });
    }

    /// Adds a text in one line, its baseline at `at`.
    pub(crate) fn text(&mut self, at: (f64, f64), text: &str, anchor: Anchor, colour: RgbColour) {
        self.elements.push(Element::Text { at, text: text.to_owned(), anchor, colour });
    }

    /// The drawing as an SVG document, or as a part of a page.
    pub fn svg(&self) -> String {
        let (width, height) = self.size;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"12\" role=\"img\">\n<title>{}</title>\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
            escape(&self.title)
        );
        let hex = |[r, g, b]: &RgbColour| format!("#{r:02x}{g:02x}{b:02x}");
        for element in &self.elements {
            // Writing to a string cannot fail.
            let _ = match element {
                Element::Line { points, colour, width } => {
                    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                    let (points, colour) = (points.join(" "), hex(colour));
                    writeln!(
                        svg,
                        r#"<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}"/>"#
                    )
                }
                Element::Dot { at: (x, y), colour } => {
                    writeln!(svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{RADIUS}" fill="{}"/>"#, hex(colour))
                }
                Element::Text { at: (x, y), text, anchor, colour } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    let (text, colour) = (escape(text), hex(colour));
                    writeln!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" fill="{colour}">{text}</text>"#)
                }
            };
        }
        svg + "</svg>\n"
    }

    /// Writes the drawing as SVG and PNG, each atomically.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub(crate) fn write(&self, folder: &Path, file_stem: &str) -> anyhow::Result<()> {
        atomic_file::write(&folder.join(format!("{file_stem}.svg")), self.svg().as_bytes())?;
        atomic_file::write(&folder.join(format!("{file_stem}.png")), &self.png()?)
    }

    /// The drawing as a PNG file, at two pixels a unit.
    ///
    /// # Errors
    /// Never in practice: it is written to memory.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        let pixel = |(x, y): (f64, f64)| Point::new((SCALE * x).round() as i32, (SCALE * y).round() as i32);
        let (width, height) = (SCALE * self.size.0, SCALE * self.size.1);
        let mut pixmap = Pixmap::new(width.ceil() as usize, height.ceil() as usize, [255; 3]);
        for element in &self.elements {
            match element {
                Element::Line { points, colour, width } => {
                    let points: Vec<Point> = points.iter().copied().map(pixel).collect();
                    let style = PrimitiveStyle::with_stroke(rgb888(*colour), (SCALE * width).round() as u32);
                    pixmap.draw(&Polyline::new(&points).into_styled(style));
                }
                Element::Dot { at, colour } => {
                    let circle = Circle::with_center(pixel(*at), (2.0 * SCALE * RADIUS).round() as u32);
                    pixmap.draw(&circle.into_styled(PrimitiveStyle::with_fill(rgb888(*colour))));
                }
                Element::Text { at, text, anchor, colour } => {
                    let style = MonoTextStyle::new(&FONT, rgb888(*colour));
                    pixmap.draw(&Text::with_alignment(text, pixel(*at), style, (*anchor).into()));
                }
            }
        }
        pixmap.png()
    }
}

impl From<Anchor> for Alignment {
    fn from(anchor: Anchor) -> Alignment {
        match anchor {
            Anchor::Start => Alignment::Left,
            Anchor::Middle => Alignment::Center,
            Anchor::End => Alignment::Right,
        }
    }
}

/// Text as it stands in SVG and HTML.
pub(crate) fn escape(text: &str) -> String {
    // XML has no way to write a control character.
    let plain: String = text.chars().filter(|&c| matches!(c, '\n' | '\t') || !is_control(c)).collect();
    plain.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_steers_a_terminal_or_is_no_xml_does_not_come_into_a_drawing() {
        assert_eq!(escape("a\u{1b}[31m\u{7}\u{202e}\n<b>"), "a[31m\n&lt;b&gt;");
    }

    #[test]
    fn a_drawing_shows_the_same_in_both_forms() {
        let mut drawing = Drawing::new(60.0, 40.0, "a<b");
        drawing.line(&[(10.0, 20.0), (50.0, 20.0)], [0, 0, 255], 2.0);
        drawing.dot((10.0, 20.0), [255, 0, 0]);
        drawing.text((30.0, 10.0), "x & y", Anchor::Middle, [0, 0, 0]);
        // What lies outside is cut.
        drawing.dot((-100.0, 900.0), [1, 2, 3]);
        let svg = drawing.svg();
        for part in ["<title>a&lt;b", "x &amp; y", "points=\"10.0,20.0 50.0,20.0\"", "<circle cx=\"10.0\""] {
            assert!(svg.contains(part), "{part} in {svg}");
        }
        let image = image::load_from_memory(&drawing.png().unwrap()).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (120, 80));
        assert_eq!(image.get_pixel(60, 40).0, [0, 0, 255]);
        assert_eq!(image.get_pixel(20, 40).0, [255, 0, 0]);
        assert!(image.pixels().any(|pixel| pixel.0 == [0, 0, 0]), "the text is there");
        assert!(!image.pixels().any(|pixel| pixel.0 == [1, 2, 3]));
    }
}
