//! Curves of trainings: every scalar of `progress.jsonl` as a panel, drawn to SVG or PNG.

mod canvas;
mod glyphs;

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;

use canvas::{Anchor, Drawing};

/// The size of a panel, and of the margins around its curves, in pixels.
const PANEL: (f64, f64) = (380.0, 230.0);
const MARGIN: (f64, f64) = (62.0, 34.0);
/// Panels in a row.
const COLUMNS: usize = 3;
/// A line of the legend.
const LINE: f64 = 16.0;
/// Colours that differ for most eyes (Okabe and Ito, 2008).
const COLOURS: [(u8, u8, u8); 7] =
    [(0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (90, 90, 90)];
const INK: (u8, u8, u8) = (60, 60, 60);
const GRID: (u8, u8, u8) = (225, 225, 225);

/// The scalars of a training by stage and name, each a number at some steps.
pub type Curves = BTreeMap<String, BTreeMap<u64, f64>>;

/// Reads a checkpoint folder's `training/progress.jsonl`. Of a step that was taken twice, by a training that was resumed, the
/// later one counts. A last line that was cut short is passed over.
///
/// # Errors
/// When the file cannot be read, or another line of it is malformed.
pub fn read(folder: &Path) -> anyhow::Result<Curves> {
    let path = folder.join("training/progress.jsonl");
    let text = std::fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    let mut curves = Curves::new();
    let lines: Vec<&str> = text.lines().collect();
    for (number, line) in lines.iter().enumerate() {
        let value: serde_json::Map<String, serde_json::Value> = match serde_json::from_str(line) {
            Ok(value) => value,
            Err(_) if number + 1 == lines.len() => break,
            Err(error) => return Err(error).with_context(|| format!("{}: line {}", path.display(), number + 1)),
        };
        let stage = value.get("stage").and_then(serde_json::Value::as_str).unwrap_or("training").to_string();
        let Some(step) = value.get("step").and_then(serde_json::Value::as_u64) else { continue };
        for (name, number) in value {
            if let (false, Some(number)) = (["stage", "step", "of"].contains(&name.as_str()), number.as_f64()) {
                curves.entry(format!("{stage}/{name}")).or_default().insert(step, number);
            }
        }
    }
    Ok(curves)
}

/// Curves of some trainings, drawn.
pub struct Plot {
    drawing: Drawing,
}

impl Plot {
    /// Draws named trainings into shared panels, a panel a scalar; with `only`, those whose names contain one of these words.
    ///
    /// # Errors
    /// When no scalar is left to draw.
    pub fn of(trainings: &[(String, Curves)], only: &[String]) -> anyhow::Result<Plot> {
        let wanted = |name: &str| only.is_empty() || only.iter().any(|word| name.contains(word.as_str()));
        let mut names: Vec<&str> = trainings
            .iter()
            .flat_map(|(_, curves)| curves.keys())
            .map(String::as_str)
            .filter(|name| wanted(name))
            .collect();
        names.sort_unstable();
        names.dedup();
        anyhow::ensure!(!names.is_empty(), "there is nothing to draw: no training has such numbers");
        let columns = names.len().min(COLUMNS);
        let legend = LINE * (trainings.len() as f64 + 1.0);
        let rows = names.len().div_ceil(columns);
        let mut drawing = Drawing::new(PANEL.0 * columns as f64 + 10.0, legend + PANEL.1 * rows as f64);
        for (i, (name, _)) in trainings.iter().enumerate() {
            let (y, colour) = (LINE * (i as f64 + 1.0), COLOURS[i % COLOURS.len()]);
            drawing.line(&[(12.0, y), (36.0, y)], colour, 2.0);
            drawing.text((44.0, y + 4.0), name, Anchor::Start, INK);
        }
        for (i, name) in names.into_iter().enumerate() {
            let corner = (PANEL.0 * (i % columns) as f64, legend + PANEL.1 * (i / columns) as f64);
            let curves = trainings.iter().map(|(_, curves)| curves.get(name));
            panel(&mut drawing, corner, name, &curves.collect::<Vec<_>>());
        }
        Ok(Plot { drawing })
    }

    /// As an SVG document.
    pub fn svg(&self) -> String {
        self.drawing.svg()
    }

    /// As a PNG file.
    ///
    /// # Errors
    /// When the picture cannot be encoded.
    pub fn png(&self) -> anyhow::Result<Vec<u8>> {
        self.drawing.png()
    }
}

/// One scalar's curves.
fn panel(drawing: &mut Drawing, corner: (f64, f64), name: &str, curves: &[Option<&BTreeMap<u64, f64>>]) {
    let (left, top) = (corner.0 + MARGIN.0, corner.1 + MARGIN.1);
    let (width, height) = (PANEL.0 - MARGIN.0 - 14.0, PANEL.1 - 2.0 * MARGIN.1);
    let points = || curves.iter().flatten().flat_map(|curve| curve.iter()).filter(|(_, value)| value.is_finite());
    let (low, high) = range(points().map(|(_, &value)| value));
    let (first, last) = range(points().map(|(&step, _)| step as f64));
    let place = |step: f64, value: f64| {
        (left + (step - first) / (last - first) * width, top + (high - value) / (high - low) * height)
    };
    drawing.text((left + width / 2.0, top - 10.0), name, Anchor::Middle, INK);
    for i in 0..=4 {
        let share = f64::from(i) / 4.0;
        let (value, step) = (low + share * (high - low), first + share * (last - first));
        let (_, y) = place(first, value);
        drawing.line(&[(left, y), (left + width, y)], GRID, 1.0);
        drawing.text((left - 5.0, y + 4.0), &short(value), Anchor::End, INK);
        if i % 2 == 0 {
            drawing.text((place(step, low).0, top + height + 15.0), &short(step), Anchor::Middle, INK);
        }
    }
    for (i, curve) in curves.iter().enumerate() {
        let shown = curve.iter().flat_map(|curve| curve.iter()).filter(|(_, value)| value.is_finite());
        let line: Vec<(f64, f64)> = shown.map(|(&step, &value)| place(step as f64, value)).collect();
        drawing.line(&line, COLOURS[i % COLOURS.len()], 1.5);
    }
}

/// The lowest and highest of some numbers, kept apart.
fn range(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = numbers.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), n| (low.min(n), high.max(n)));
    let span = high - low;
    if !span.is_finite() {
        (0.0, 1.0)
    } else if span < 1e-12 {
        (low - 0.5, high + 0.5)
    } else {
        (low, high)
    }
}

/// A number in few letters.
fn short(number: f64) -> String {
    match number.abs() {
        size if size >= 10_000.0 => format!("{:.0}k", number / 1000.0),
        size if size >= 100.0 || size == 0.0 => format!("{number:.0}"),
        size if size >= 1.0 => format!("{number:.2}"),
        size if size >= 0.001 => format!("{number:.3}"),
        _ => format!("{number:.1e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn training() -> (tempfile::TempDir, Curves) {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("training")).unwrap();
        let lines = [
            r#"{"stage":"policy","step":50,"of":200,"q_loss":0.5,"v_mean":0.1}"#,
            r#"{"stage":"policy","step":100,"of":200,"q_loss":0.4,"v_mean":0.2}"#,
            r#"{"stage":"policy","step":100,"of":200,"q_loss":0.3,"v_mean":0.3}"#,
            r#"{"stage":"policy","step":150,"of":2"#,
        ];
        std::fs::write(folder.path().join("training/progress.jsonl"), lines.join("\n")).unwrap();
        let curves = read(folder.path()).unwrap();
        (folder, curves)
    }

    #[test]
    fn a_step_taken_twice_counts_once_and_a_cut_line_not_at_all() {
        let curves = training().1;
        assert_eq!(curves["policy/q_loss"], [(50, 0.5), (100, 0.3)].into());
        assert_eq!(curves.len(), 2);
    }

    #[test]
    fn curves_become_both_kinds_of_picture() {
        let curves = training().1;
        let both = [("one".to_string(), curves.clone()), ("<two>".to_string(), curves)];
        let plot = Plot::of(&both, &[]).unwrap();
        let svg = plot.svg();
        assert!(svg.contains("policy/v_mean") && svg.contains("&lt;two&gt;") && svg.ends_with("</svg>\n"));
        let picture = image::load_from_memory(&plot.png().unwrap()).unwrap().to_rgb8();
        let (r, g, b) = COLOURS[1];
        assert!(picture.pixels().any(|pixel| pixel.0 == [r, g, b]), "the second training's curve is there");
        assert!(Plot::of(&both, &["nothing".into()]).is_err());
        let one = Plot::of(&both, &["q_loss".into()]).unwrap().svg();
        assert!(one.contains("q_loss") && !one.contains("v_mean"));
    }
}
