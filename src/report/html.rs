//! A run as one HTML page that needs nothing else: figures, the plot, and every episode with frames from its way.

use std::io::Cursor;
use std::ops::ControlFlow;

use anyhow::Context;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ImageFormat, RgbImage, imageops};
use rayon::prelude::*;
use serde_json::json;

use super::charts::drawing::escape;
use super::charts::progress_by_length;
use super::shell_word::shell_word;
use super::summary::RunSummary;
use crate::domain::Task;
use crate::episode::record::{Episode, TraceStep};
use crate::episode::rollout::{AfterEach, Rollout, Tick};
use crate::episode::wish::{Wish, WishGrading, WishVerdict};
use crate::house::House;
use crate::house::grading::describe;
use crate::run_dir::reader::RecordedRun;

/// The side of a frame on the page, in pixels.
const SIDE: u32 = 112;
/// The page around the data.
const TEMPLATE: &str = include_str!("../../assets/report.html");

/// The page of a run; `frames` is the most of an episode, 0 for none. Episodes are taken again on all cores.
///
/// # Errors
/// When a scene is missing, or a frame cannot be encoded.
pub(crate) fn run_page(run: &RecordedRun, summary: &RunSummary, frames: usize) -> anyhow::Result<String> {
    let row = |(number, episode): (usize, &Episode)| -> anyhow::Result<serde_json::Value> {
        let task = run.set.tasks.iter().find(|task| task.id == episode.task).context("an episode of no task")?;
        let outcome = match (&episode.error, episode.failure) {
            (Some(_), _) => "error",
            (None, _) if episode.success => "success",
            (None, Some(failure)) => failure.words(),
            (None, None) if episode.of == 0 => "not graded",
            (None, None) => "failure",
        };
        Ok(json!({
            "number": number + 1,
            "task": episode.task,
            "seed": episode.seed,
            "instruction": episode.instruction,
            "variant": episode.variant.name(),
            "start_subtask": episode.start_subtask,
            "completed": episode.completed,
            "of": episode.of,
            "steps": episode.steps,
            "expert_steps": task.expert_steps,
            "outcome": outcome,
            "error": episode.error,
            "wishes": episode.wishes.iter().map(wish_row).collect::<Vec<_>>(),
            "subtasks": task.subtasks.iter().map(|subtask| describe(&task.roles, subtask)).collect::<Vec<_>>(),
            "open": format!("sprint open {}", shell_word(&format!("{}#{}", run.path.display(), number + 1))),
            "frames": frames_of(run, task, episode, frames)?,
        }))
    };
    let rows: Vec<serde_json::Value> = run.episodes.par_iter().enumerate().map(row).collect::<anyhow::Result<_>>()?;
    let data = in_script(&rows)?;
    let wishes = match run.manifest.policy.as_str() {
        "explored" => {
            fulfilled(&run.episodes).map_or(String::new(), |[k, n]| format!("\nWishes fulfilled: {k} of {n}.\n"))
        }
        _ => String::new(),
    };
    let title = format!("{} on {}", summary.policy, summary.task_set);
    Ok(TEMPLATE
        .replace("{{title}}", &escape(&title))
        .replace("{{plot}}", &progress_by_length::draw(&[summary]).svg())
        .replace("{{summary}}", &escape(&(summary.markdown() + &wishes)))
        .replace("{{episodes}}", &data))
}

/// How many wishes were fulfilled, and of how many, where any was told. Branches that part only later share theirs.
fn fulfilled(episodes: &[Episode]) -> Option<[usize; 2]> {
    let mut known: Vec<(&Wish, &[TraceStep])> = Vec::new();
    for episode in episodes {
        for wish in episode.wishes.iter().filter(|wish| wish.grading == WishGrading::Task || wish.is_told()) {
            let until = ((wish.began + wish.steps) as usize).min(episode.trace.len());
            let one = (wish, &episode.trace[..until]);
            if !known.contains(&one) {
                known.push(one);
            }
        }
    }
    let done = known.iter().filter(|(wish, _)| wish.verdict.is_some_and(WishVerdict::is_fulfilled)).count();
    (!known.is_empty()).then_some([done, known.len()])
}

/// What was told, and what came of it.
fn wish_row(wish: &Wish) -> serde_json::Value {
    let graded = match wish.grading {
        WishGrading::Task => "the task".to_string(),
        WishGrading::Read => format!("understood: {}", wish.understood),
        WishGrading::Nobody => format!("not graded: {}", wish.ungraded.as_deref().unwrap_or_default()),
    };
    json!({
        "instruction": wish.instruction,
        "graded": graded,
        "verdict": wish.verdict_in_words(),
        "fulfilled": wish.verdict.is_some_and(WishVerdict::is_fulfilled),
        "began": wish.began,
        "steps": wish.steps,
        "expert_steps": wish.expert_steps,
        "advice": wish.advice,
    })
}

/// A value as JSON that stands inside a script element: without a `<` nothing can end it, or begin a comment.
///
/// # Errors
/// Never for values that JSON has.
pub(crate) fn in_script(value: &impl serde::Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string(value)?.replace('<', "\\u003c"))
}

/// Frames of an episode: the start, what each completed subtask left, the end; each with the step it follows, as a PNG.
fn frames_of(run: &RecordedRun, task: &Task, episode: &Episode, most: usize) -> anyhow::Result<Vec<serde_json::Value>> {
    // An environment in another process would have to be there; a page is of what lies on the disk.
    if most == 0 || episode.start_hash.is_empty() || task.env.is_some() {
        return Ok(Vec::new());
    }
    let done = episode.trace.iter().enumerate().filter(|(_, step)| step.subtask.is_some()).map(|(i, _)| i + 1);
    let mut steps: Vec<usize> = std::iter::once(0).chain(done).chain([episode.trace.len()]).collect();
    steps.dedup();
    while steps.len() > most.max(2) {
        steps.remove(steps.len() / 2);
    }
    let setting = run.scenes.setting(task)?;
    let mut rollout = Rollout::in_house(House::new(setting.scene, setting.world), String::new(), None, None);
    let mut shown = Vec::new();
    let mut show = |rollout: &mut Rollout, step: usize| -> anyhow::Result<()> {
        if steps.contains(&step) {
            shown.push(json!({"step": step, "png": frame_png(rollout)?}));
        }
        Ok(())
    };
    show(&mut rollout, 0)?;
    let mut after_each = AfterEach(|rollout: &mut Rollout, tick: &Tick| {
        show(rollout, tick.step as usize)?;
        Ok(ControlFlow::Continue(()))
    });
    rollout.replay(episode.trace.iter().map(TraceStep::action), &mut after_each)?;
    Ok(shown)
}

fn frame_png(rollout: &mut Rollout) -> anyhow::Result<String> {
    let frame = rollout.env.house.frame();
    let (width, height) = (frame.width as u32, frame.height as u32);
    let image = RgbImage::from_raw(width, height, frame.rgb.clone()).context("a frame has another size")?;
    let small = imageops::thumbnail(&image, SIDE, SIDE);
    let mut bytes = Cursor::new(Vec::new());
    small.write_to(&mut bytes, ImageFormat::Png).context("a frame cannot be encoded")?;
    Ok(STANDARD.encode(bytes.into_inner()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::ActionType;
    use crate::house::Outcome;

    #[test]
    fn a_wish_that_two_branches_share_counts_once() {
        let step = |kind| TraceStep {
            own: None,
            kind,
            target: None,
            class: None,
            outcome: Outcome::Done,
            subtask: None,
            instruction: None,
            author: None,
        };
        let wish = |began, steps, verdict| Wish { steps, verdict, ..Wish::ungraded("Dance.", began, "no thing") };
        let done = Some(WishVerdict::SaidDone);
        let branch = |last: ActionType, wishes: Vec<Wish>| Episode {
            wishes,
            trace: vec![step(ActionType::LookUp), step(last)],
            ..Episode::default()
        };
        let main = branch(ActionType::RotateLeft, vec![wish(0, 1, done), wish(1, 1, None)]);
        let other = branch(ActionType::RotateRight, vec![wish(0, 1, done), wish(1, 1, None)]);
        assert_eq!(fulfilled(&[main, other]), Some([1, 3]));
        assert_eq!(fulfilled(&[branch(ActionType::LookUp, Vec::new())]), None);
    }

    #[test]
    fn nothing_in_a_script_ends_it_or_begins_a_comment() {
        let said = "put it </script> <!-- <script> there";
        let text = in_script(&said).unwrap();
        assert!(!text.contains('<'), "{text}");
        assert_eq!(serde_json::from_str::<String>(&text).unwrap(), said);
    }
}
