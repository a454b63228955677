//! Charts of lines: axes, lines with their intervals, and their names.

use super::drawing::{Anchor, Drawing};
use crate::report::pixmap::RgbColour;
use crate::report::stats::Interval;

/// Lines in a plane with labelled axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LineChart {
    /// The heading above the plane.
    pub(crate) title: String,
    /// What the horizontal axis measures, below the plane.
    pub(crate) x_label: String,
    /// The lines, in the order of their colours.
    pub(crate) series: Vec<Series>,
    /// The ends of the vertical axis; where there are none, those of the points.
    pub(crate) y_range: Option<(f64, f64)>,
}

/// One line of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Series {
    /// What it is of; written into the chart where it is not empty.
    pub(crate) name: String,
    /// Its points, from left to right; those that are no numbers are passed over.
    pub(crate) points: Vec<(f64, f64)>,
    /// The interval of each point, where there are any; such points are marked.
    pub(crate) intervals: Vec<Interval>,
}

/// Told apart by people who see few colours, too (Okabe and Ito, 2008).
pub(crate) const COLOURS: [RgbColour; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233], [90, 90, 90]];
/// The colour of titles and labels.
pub(crate) const INK: RgbColour = [34, 34, 34];
const FAINT: RgbColour = [221, 221, 221];
/// What lies around the plane: left, above, right, below.
const MARGINS: [f64; 4] = [64.0, 34.0, 18.0, 40.0];
/// From the plane's sides to the first and the last point.
const INSET: f64 = 8.0;

impl LineChart {
    /// The chart as a drawing of its own.
    pub(crate) fn drawing(&self, width: f64, height: f64) -> Drawing {
        let mut drawing = Drawing::new(width, height, &self.title);
        self.draw(&mut drawing, (0.0, 0.0), (width, height));
        drawing
    }

    /// Draws the chart with its upper left corner at `corner`.
    pub(crate) fn draw(&self, drawing: &mut Drawing, corner: (f64, f64), size: (f64, f64)) {
        let [before, above, after, below] = MARGINS;
        let (left, top) = (corner.0 + before, corner.1 + above);
        let (right, bottom) = (corner.0 + size.0 - after, corner.1 + size.1 - below);
        let values = || self.series.iter().flat_map(Series::shown);
        let (first, last) = ends(values().map(|(x, _)| x));
        let (low, high) = self.y_range.unwrap_or_else(|| ends(values().map(|(_, y)| y)));
        let x = |value: f64| left + INSET + share(value, first, last) * (right - left - 2.0 * INSET);
        let y = |value: f64| bottom - share(value, low, high) * (bottom - top);
        let middle = f64::midpoint(left, right);
        drawing.text((middle, corner.1 + 20.0), &self.title, Anchor::Middle, INK);
        drawing.text((middle, corner.1 + size.1 - 8.0), &self.x_label, Anchor::Middle, INK);
        for part in 0..=4 {
            let value = low + (high - low) * f64::from(part) / 4.0;
            drawing.line(&[(left, y(value)), (right, y(value))], FAINT, 1.0);
            drawing.text((left - 6.0, y(value) + 4.0), &short(value), Anchor::End, INK);
        }
        for value in ticks(values().map(|(x, _)| x).collect(), (first, last)) {
            drawing.text((x(value), bottom + 16.0), &short(value), Anchor::Middle, INK);
        }
        for (number, line) in self.series.iter().enumerate() {
            let colour = COLOURS[number % COLOURS.len()];
            for ((at, _), &[from, to]) in line.points.iter().zip(&line.intervals) {
                drawing.line(&[(x(*at), y(from)), (x(*at), y(to))], colour, 1.0);
            }
            let points: Vec<(f64, f64)> = line.shown().map(|(across, up)| (x(across), y(up))).collect();
            drawing.line(&points, colour, 2.0);
            points.iter().take(line.intervals.len()).for_each(|&point| drawing.dot(point, colour));
            drawing.text((right - 4.0, top + 14.0 + 16.0 * number as f64), &line.name, Anchor::End, colour);
        }
    }
}

impl Series {
    fn shown(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite())
    }
}

/// Where a value lies between two others; what lies outside is at the nearer end.
fn share(value: f64, low: f64, high: f64) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

/// The lowest and highest of some numbers, kept apart.
fn ends(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = numbers.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), n| (low.min(n), high.max(n)));
    match high - low {
        span if !span.is_finite() => (0.0, 1.0),
        span if span < 1e-12 => (low - 0.5, high + 0.5),
        _ => (low, high),
    }
}

/// The values that are named below the plane: all, where they are few; else the ends and the middle.
fn ticks(mut values: Vec<f64>, (first, last): (f64, f64)) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    if values.len() <= 10 { values } else { vec![first, f64::midpoint(first, last), last] }
}

/// A number in few letters.
fn short(number: f64) -> String {
    let places = match number.abs() {
        size if size >= 10_000.0 => return format!("{:.0}k", number / 1000.0),
        size if size > 0.0 && size < 0.001 => return format!("{number:.1e}"),
        size if size >= 100.0 => 0,
        size if size >= 1.0 => 2,
        _ => 3,
    };
    let text = format!("{number:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> LineChart {
        let line = Series {
            name: "a<b".into(),
            points: vec![(1.0, 0.2), (2.0, 0.8)],
            intervals: vec![[0.1, 0.3], [0.7, 0.9]],
        };
        LineChart {
            title: "Progress".into(),
            x_label: "subtasks".into(),
            series: vec![line],
            y_range: Some((0.0, 1.0)),
        }
    }

    #[test]
    fn a_chart_is_drawn_in_both_forms() {
        let drawing = chart().drawing(640.0, 400.0);
        let svg = drawing.svg();
        assert!(svg.contains("a&lt;b") && svg.matches("<circle").count() == 2 && svg.ends_with("</svg>\n"), "{svg}");
        let image = image::load_from_memory(&drawing.png().unwrap()).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (1280, 800));
        let blue = image.pixels().filter(|pixel| pixel.0 == COLOURS[0]).count();
        assert!((1_000..60_000).contains(&blue), "{blue}");
    }

    #[test]
    fn a_chart_of_nothing_of_one_point_or_of_no_numbers_is_still_a_chart() {
        for points in
            [vec![], vec![(3.0, 0.5)], vec![(1.0, f64::NAN), (2.0, f64::INFINITY)], vec![(0.0, -1e308), (1e300, 1e308)]]
        {
            for y_range in [None, Some((0.0, 1.0))] {
                let line = Series { points: points.clone(), ..Series::default() };
                let drawing = LineChart { series: vec![line], y_range, ..chart() }.drawing(640.0, 400.0);
                assert!(!drawing.svg().contains("NaN") && !drawing.svg().contains("inf"), "{}", drawing.svg());
                assert!(drawing.png().is_ok());
            }
        }
    }

    #[test]
    fn numbers_are_written_in_few_letters() {
        let numbers = [0.0, 0.25, 1.0, 12.5, 240.0, 96_000.0, -0.5, 0.00012];
        assert_eq!(numbers.map(short), ["0", "0.25", "1", "12.5", "240", "96k", "-0.5", "1.2e-4"]);
    }
}
