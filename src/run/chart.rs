//! Line charts as SVG and as PNG, drawn from one list of shapes.

use std::io::Cursor;

use anyhow::Context;
use image::{ImageFormat, Rgb, RgbImage};

use super::stats::Interval;

/// A chart of lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// Below it.
    pub across: String,
    /// The lines.
    pub lines: Vec<Line>,
    /// Where the vertical axis ends.
    pub highest: f64,
}

/// One line of a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What it is of.
    pub name: String,
    /// Its points, from left to right.
    pub points: Vec<(f64, f64)>,
    /// The interval of each point, where there are any.
    pub intervals: Vec<Interval>,
}

enum Shape {
    Stroke { from: (f64, f64), to: (f64, f64), colour: [u8; 3], width: f64 },
    Dot { at: (f64, f64), colour: [u8; 3] },
    Text { at: (f64, f64), anchor: Anchor, text: String, colour: [u8; 3] },
}

#[derive(Clone, Copy)]
enum Anchor {
    Middle,
    End,
}

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 400.0;
/// Left, top, right and bottom edges of the plane.
const PLANE: [f64; 4] = [64.0, 40.0, 620.0, 340.0];
const INK: [u8; 3] = [34, 34, 34];
const FAINT: [u8; 3] = [221, 221, 221];
/// Told apart by people who see few colours, too (Okabe and Ito).
const COLOURS: [[u8; 3]; 6] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233]];

impl Chart {
    fn shapes(&self) -> Vec<Shape> {
        let points = || self.lines.iter().flat_map(|line| line.points.iter().map(|point| point.0));
        let (first, last) = points().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        let (first, last) = if first > last { (0.0, 1.0) } else { (first, last.max(first + 1e-9)) };
        let [left, top, right, bottom] = PLANE;
        let inset = 16.0;
        let x = |value: f64| match last - first < 1e-6 {
            true => f64::midpoint(left, right),
            false => left + inset + (value - first) / (last - first) * (right - left - 2.0 * inset),
        };
        let y = |value: f64| bottom - (value / self.highest.max(1e-9)).clamp(0.0, 1.0) * (bottom - top);
        let text = |at, anchor, text: String| Shape::Text { at, anchor, text, colour: INK };
        let mut shapes = vec![
            text((f64::midpoint(left, right), 24.0), Anchor::Middle, self.title.clone()),
            text((f64::midpoint(left, right), 376.0), Anchor::Middle, self.across.clone()),
        ];
        for part in 0..=5 {
            let value = self.highest * f64::from(part) / 5.0;
            shapes.push(Shape::Stroke { from: (left, y(value)), to: (right, y(value)), colour: FAINT, width: 1.0 });
            shapes.push(text((left - 8.0, y(value) + 4.0), Anchor::End, format!("{value:.2}")));
        }
        for value in ticks(&mut points().collect::<Vec<_>>()) {
            shapes.push(text((x(value), bottom + 18.0), Anchor::Middle, format!("{value}")));
        }
        for (number, line) in self.lines.iter().enumerate() {
            let colour = COLOURS[number % COLOURS.len()];
            for (&(at, _), [low, high]) in line.points.iter().zip(&line.intervals) {
                shapes.push(Shape::Stroke { from: (x(at), y(*low)), to: (x(at), y(*high)), colour, width: 1.0 });
            }
            for pair in line.points.windows(2) {
                let place = |(across, up): (f64, f64)| (x(across), y(up));
                shapes.push(Shape::Stroke { from: place(pair[0]), to: place(pair[1]), colour, width: 2.0 });
            }
            if line.points.len() <= 60 {
                shapes.extend(line.points.iter().map(|&(at, up)| Shape::Dot { at: (x(at), y(up)), colour }));
            }
            let at = (right - 4.0, top + 14.0 + 16.0 * number as f64);
            shapes.push(Shape::Text { at, anchor: Anchor::End, text: line.name.clone(), colour });
        }
        shapes
    }

    /// The chart as a file of its own, or as a part of a page.
    pub fn svg(&self) -> String {
        let colour = |[r, g, b]: [u8; 3]| format!("#{r:02x}{g:02x}{b:02x}");
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
             font-family=\"sans-serif\" font-size=\"13\" role=\"img\">\n<title>{}</title>\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
            escape(&self.title)
        );
        for shape in self.shapes() {
            svg += &match shape {
                Shape::Stroke { from, to, colour: c, width } => format!(
                    "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{}\" stroke-width=\"{width}\"/>\n",
                    from.0,
                    from.1,
                    to.0,
                    to.1,
                    colour(c)
                ),
                Shape::Dot { at, colour: c } => {
                    format!("<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.5\" fill=\"{}\"/>\n", at.0, at.1, colour(c))
                }
                Shape::Text { at, anchor, text, colour: c } => {
                    let anchor = match anchor {
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    format!(
                        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" fill=\"{}\">{}</text>\n",
                        at.0,
                        at.1,
                        colour(c),
                        escape(&text)
                    )
                }
            };
        }
        svg + "</svg>\n"
    }

    /// The chart as a PNG file, twice the size.
    ///
    /// # Errors
    /// Never in practice: it writes to memory.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        let mut image = RgbImage::from_pixel(2 * WIDTH as u32, 2 * HEIGHT as u32, Rgb([255; 3]));
        for shape in self.shapes() {
            match shape {
                Shape::Stroke { from, to, colour, width } => stroke(&mut image, from, to, colour, width),
                Shape::Dot { at, colour } => disc(&mut image, at, 3.5, colour),
                Shape::Text { at, anchor, text, colour } => write(&mut image, at, anchor, &text, colour),
            }
        }
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Png).context("a plot cannot be encoded")?;
        Ok(bytes.into_inner())
    }
}

/// At most ten of the values that occur, so that their labels do not overlap.
fn ticks(values: &mut Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    let step = values.len().div_ceil(10).max(1);
    values.iter().copied().step_by(step).collect()
}

/// Text as it stands in SVG and HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn put(image: &mut RgbImage, x: f64, y: f64, colour: [u8; 3]) {
    if x >= 0.0
        && y >= 0.0
        && let Some(pixel) = image.get_pixel_mut_checked(x as u32, y as u32)
    {
        *pixel = Rgb(colour);
    }
}

fn disc(image: &mut RgbImage, (x, y): (f64, f64), radius: f64, colour: [u8; 3]) {
    let reach = (2.0 * radius).ceil() as i32;
    for (dx, dy) in (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dy| (f64::from(dx), f64::from(dy)))) {
        if dx.hypot(dy) <= 2.0 * radius {
            put(image, 2.0 * x + dx, 2.0 * y + dy, colour);
        }
    }
}

fn stroke(image: &mut RgbImage, from: (f64, f64), to: (f64, f64), colour: [u8; 3], width: f64) {
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    let parts = (2.0 * length).ceil().max(1.0);
    for part in 0..=parts as u32 {
        let t = f64::from(part) / parts;
        disc(image, (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1)), width / 2.0, colour);
    }
}

/// Glyphs of 3 x 5 dots: a digit a row, its bits from left to right.
const GLYPHS: [(char, u32); 49] = [
    ('0', 0o75557),
    ('1', 0o26227),
    ('2', 0o71747),
    ('3', 0o71717),
    ('4', 0o55711),
    ('5', 0o74717),
    ('6', 0o74757),
    ('7', 0o71111),
    ('8', 0o75757),
    ('9', 0o75717),
    ('A', 0o25755),
    ('B', 0o65656),
    ('C', 0o34443),
    ('D', 0o65556),
    ('E', 0o74647),
    ('F', 0o74644),
    ('G', 0o34553),
    ('H', 0o55755),
    ('I', 0o72227),
    ('J', 0o11152),
    ('K', 0o55655),
    ('L', 0o44447),
    ('M', 0o57755),
    ('N', 0o65555),
    ('O', 0o25552),
    ('P', 0o65644),
    ('Q', 0o25563),
    ('R', 0o65655),
    ('S', 0o34216),
    ('T', 0o72222),
    ('U', 0o55557),
    ('V', 0o55552),
    ('W', 0o55775),
    ('X', 0o55255),
    ('Y', 0o55222),
    ('Z', 0o71247),
    ('.', 0o00002),
    ('-', 0o00700),
    ('%', 0o51245),
    ('/', 0o11244),
    (':', 0o02020),
    ('(', 0o12221),
    (')', 0o42224),
    ('_', 0o00007),
    (',', 0o00024),
    ('+', 0o02720),
    ('=', 0o07070),
    ('#', 0o57575),
    ('?', 0o71202),
];

fn write(image: &mut RgbImage, (x, y): (f64, f64), anchor: Anchor, text: &str, colour: [u8; 3]) {
    // A dot is three pixels; a letter takes four dots across.
    let dot = 3.0;
    let width = 4.0 * dot * text.chars().count() as f64;
    let left = 2.0 * x
        - match anchor {
            Anchor::Middle => width / 2.0,
            Anchor::End => width,
        };
    let top = 2.0 * y - 5.0 * dot;
    for (place, letter) in text.to_uppercase().chars().enumerate() {
        let known = GLYPHS.iter().find(|(glyph, _)| *glyph == letter);
        let rows = if letter == ' ' { 0 } else { known.map_or(0o71202, |(_, rows)| *rows) };
        for bit in (0..15u32).filter(|bit| rows >> (14 - bit) & 1 == 1) {
            let (across, down) = (f64::from(bit % 3), f64::from(bit / 3));
            for (dx, dy) in (0..3).flat_map(|dx| (0..3).map(move |dy| (f64::from(dx), f64::from(dy)))) {
                put(image, left + 4.0 * dot * place as f64 + dot * across + dx, top + dot * down + dy, colour);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let line =
            Line { name: "a<b".into(), points: vec![(1.0, 0.2), (2.0, 0.8)], intervals: vec![[0.1, 0.3], [0.7, 0.9]] };
        Chart { title: "Progress".into(), across: "subtasks".into(), lines: vec![line], highest: 1.0 }
    }

    #[test]
    fn a_chart_is_drawn_in_both_forms() {
        let svg = chart().svg();
        assert!(svg.contains("a&lt;b") && svg.matches("<circle").count() == 2 && svg.ends_with("</svg>\n"), "{svg}");
        let image = image::load_from_memory(&chart().png().unwrap()).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (1280, 800));
        let blue = image.pixels().filter(|pixel| pixel.0 == COLOURS[0]).count();
        assert!((1_000..60_000).contains(&blue), "{blue}");
    }

    #[test]
    fn a_chart_of_nothing_or_of_one_point_is_still_a_chart() {
        for points in [vec![], vec![(3.0, 0.5)]] {
            let line = Line { name: String::new(), points, intervals: vec![] };
            let chart = Chart { lines: vec![line], ..chart() };
            assert!(!chart.svg().contains("NaN") && !chart.svg().contains("inf"));
            assert!(chart.png().is_ok());
        }
    }
}
