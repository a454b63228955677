//! Curves of trainings: every scalar of `progress.jsonl` as a panel, drawn to SVG or PNG.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;

use super::drawing::{Anchor, Drawing};
use super::line_chart::{COLOURS, INK, LineChart, Series};
use crate::data::text_file;
use crate::report::stats::Interval;

/// The size of a panel.
const PANEL: (f64, f64) = (380.0, 230.0);
/// Panels in a row.
const COLUMNS: usize = 3;
/// The height of a line of the legend.
const LINE: f64 = 16.0;

/// The scalars of a training by stage and name, each a number at some steps.
pub(crate) type Curves = BTreeMap<String, BTreeMap<u64, f64>>;

/// Reads a checkpoint folder's `training/progress.jsonl`. Of a step that was taken twice, by a training that was resumed, the
/// later one counts. A last line that was cut short is passed over.
///
/// # Errors
/// When the file cannot be read, or another line of it is malformed.
pub fn read(folder: &Path) -> anyhow::Result<Curves> {
    let path = folder.join("training/progress.jsonl");
    anyhow::ensure!(
        path.exists(),
        "{} keeps no training's curves (training/progress.jsonl is missing); `sprint pretrain` writes them",
        folder.display()
    );
    let text = text_file::read(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    let mut curves = Curves::new();
    let lines: Vec<&str> = text.lines().collect();
    for (number, line) in lines.iter().enumerate() {
        let place = || format!("{}: line {}", path.display(), number + 1);
        let value: serde_json::Map<String, serde_json::Value> = match serde_json::from_str(line) {
            Ok(value) => value,
            Err(_) if number + 1 == lines.len() && !text.ends_with('\n') => break,
            Err(error) => return Err(error).with_context(place),
        };
        let stage = value.get("stage").and_then(serde_json::Value::as_str).unwrap_or("training").to_string();
        let step = value.get("step").and_then(serde_json::Value::as_u64);
        let step = step.context("step: missing, or no whole number").with_context(place)?;
        for (name, number) in value.into_iter().filter(|(name, _)| !["stage", "step", "of"].contains(&name.as_str())) {
            // A number that is none is kept as null.
            if !number.is_null() {
                let number = number.as_f64().with_context(|| format!("{name}: {number} is no number"));
                curves.entry(format!("{stage}/{name}")).or_default().insert(step, number.with_context(place)?);
            }
        }
    }
    Ok(curves)
}

/// Draws named trainings into shared panels, a panel a scalar; with `only`, those whose names contain one of these words.
///
/// # Errors
/// When no scalar is left to draw.
pub fn draw(trainings: &[(String, Curves)], only: &[String]) -> anyhow::Result<Drawing> {
    let wanted = |name: &str| only.is_empty() || only.iter().any(|word| name.contains(word.as_str()));
    let mut names: Vec<&str> = trainings
        .iter()
        .flat_map(|(_, curves)| curves.keys())
        .map(String::as_str)
        .filter(|name| wanted(name))
        .collect();
    names.sort_unstable();
    names.dedup();
    // The ends of an interval are drawn with what they are an interval of.
    let all = names.clone();
    names.retain(|name| interval_of(name).is_none_or(|whole| !all.contains(&whole)));
    anyhow::ensure!(!names.is_empty(), "there is nothing to draw: no training has such numbers");
    let columns = names.len().min(COLUMNS);
    let legend = LINE * (trainings.len() as f64 + 1.0);
    let rows = names.len().div_ceil(columns);
    let mut drawing = Drawing::new(PANEL.0 * columns as f64, legend + PANEL.1 * rows as f64, "Curves of trainings");
    for (i, (name, _)) in trainings.iter().enumerate() {
        let (y, colour) = (LINE * (i as f64 + 1.0), COLOURS[i % COLOURS.len()]);
        drawing.line(&[(12.0, y), (36.0, y)], colour, 2.0);
        drawing.text((44.0, y + 4.0), name, Anchor::Start, INK);
    }
    for (i, name) in names.into_iter().enumerate() {
        let corner = (PANEL.0 * (i % columns) as f64, legend + PANEL.1 * (i / columns) as f64);
        let line = |(_, curves): &(String, Curves)| {
            let points = curves.get(name).into_iter().flatten().map(|(&step, &value)| (step as f64, value));
            Series { points: points.collect(), intervals: intervals(curves, name), ..Series::default() }
        };
        let series = trainings.iter().map(line).collect();
        let x_label = if name.starts_with("finetuning/") { "environment steps".into() } else { String::new() };
        LineChart { title: name.to_owned(), x_label, series, y_range: None }.draw(&mut drawing, corner, PANEL);
    }
    Ok(drawing)
}

/// What a scalar is the end of an interval of, by its name.
fn interval_of(name: &str) -> Option<&str> {
    name.strip_suffix("_low").or_else(|| name.strip_suffix("_high"))
}

/// The interval at each step of a scalar; none where a step has none.
fn intervals(curves: &Curves, name: &str) -> Vec<Interval> {
    let [low, high] = ["low", "high"].map(|end| curves.get(&format!("{name}_{end}")));
    let (Some(points), Some(low), Some(high)) = (curves.get(name), low, high) else { return Vec::new() };
    let at = |step: &u64| Some([*low.get(step)?, *high.get(step)?]);
    points.keys().map(at).collect::<Option<Vec<Interval>>>().unwrap_or_default()
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
    fn the_ends_of_an_interval_are_drawn_at_its_mean_and_not_by_themselves() {
        let curve = |values: [f64; 2]| [(0, values[0]), (100, values[1])].into();
        let curves: Curves = [("", [0.2, 0.6]), ("_low", [0.1, 0.5]), ("_high", [0.3, 0.9])]
            .map(|(end, values)| (format!("finetuning/return{end}"), curve(values)))
            .into();
        assert_eq!(intervals(&curves, "finetuning/return"), [[0.1, 0.3], [0.5, 0.9]]);
        let svg = draw(&[("sprint".into(), curves)], &[]).unwrap().svg();
        assert!(svg.contains("environment steps") && !svg.contains("return_low"), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 2, "{svg}");
    }

    #[test]
    fn a_step_taken_twice_counts_once_and_a_cut_line_not_at_all() {
        let curves = training().1;
        assert_eq!(curves["policy/q_loss"], [(50, 0.5), (100, 0.3)].into());
        assert_eq!(curves.len(), 2);
    }

    #[test]
    fn a_whole_line_that_tells_no_step_or_no_numbers_is_named() {
        let (folder, _) = training();
        let path = folder.path().join("training/progress.jsonl");
        let good = r#"{"stage":"policy","step":50,"of":200,"q_loss":null,"v_mean":0.1}"#;
        for (line, told) in [
            (r#"{"stage":"policy","step":-1,"q_loss":0.5}"#, "step"),
            (r#"{"stage":"policy","q_loss":0.5}"#, "step"),
            (r#"{"stage":"policy","step":1,"q_loss":"0.5"}"#, "q_loss"),
            (r#"{"stage":"policy","st"#, "EOF"),
        ] {
            std::fs::write(&path, format!("{good}\n{line}\n")).unwrap();
            let error = format!("{:#}", read(folder.path()).unwrap_err());
            assert!(error.contains("progress.jsonl: line 2") && error.contains(told), "{error}");
        }
        std::fs::write(&path, format!("{good}\n")).unwrap();
        assert_eq!(read(folder.path()).unwrap().len(), 1, "a number that is none is left out");
    }

    #[test]
    fn curves_become_both_kinds_of_picture() {
        let curves = training().1;
        let both = [("one".to_string(), curves.clone()), ("<two>".to_string(), curves)];
        let plot = draw(&both, &[]).unwrap();
        let svg = plot.svg();
        assert!(svg.contains("policy/v_mean") && svg.contains("&lt;two&gt;") && svg.ends_with("</svg>\n"));
        let picture = image::load_from_memory(&plot.png().unwrap()).unwrap().to_rgb8();
        assert!(picture.pixels().any(|pixel| pixel.0 == COLOURS[1]), "the second training's curve is there");
        assert!(draw(&both, &["nothing".into()]).is_err());
        let one = draw(&both, &["q_loss".into()]).unwrap().svg();
        assert!(one.contains("q_loss") && !one.contains("v_mean"));
    }
}
