//! A recorded episode in another environment as a sequence of pictures: its actions are taken again from the same seed.

use std::sync::Arc;

use anyhow::{Context, ensure};

use super::frames::{FrameSequence, Seen, Shot};
use super::record::{Episode, TraceStep};
use super::rollout::Rollout;
use crate::agent::Decision;
use crate::domain::Task;
use crate::env::Environment;
use crate::env::observation::Picture;
use crate::env::remote::{RemoteEnvironment, RemoteSettings, Sessions};
use crate::house::House;
use crate::house::view::Frame;
use crate::language::count::counted;

impl FrameSequence {
    /// Takes the steps of an episode again where it was played.
    ///
    /// # Errors
    /// When the environment cannot be reached, or shows something else than was recorded.
    pub(crate) fn remote(task: &Task, episode: &Episode, remote: RemoteSettings) -> anyhow::Result<FrameSequence> {
        let (name, seed) = task.remote_episode().context("the task names no environment")?;
        let env = RemoteEnvironment::begin(Sessions::new(remote).get(0, name)?, seed)?;
        let is_same = env.fingerprint().as_ref() == Some(&episode.start_hash);
        ensure!(is_same, "task {:?}: {name} begins otherwise than was recorded", episode.task);
        let mut rollout = Rollout::new(env, episode.instruction.clone(), None);
        let mut told = episode.instruction.clone();
        let start = Shot::start(seen(&rollout), told.clone());
        let mut shots = vec![start];
        for (number, recorded) in (1..).zip(&episode.trace) {
            let action = recorded.action_in(&rollout.env).with_context(|| format!("step {number}"))?;
            let parts: Vec<String> = rollout.env.own().map_or(Vec::new(), |view| subtasks(&view));
            let tick = rollout.carry_out(Decision::of(action))?;
            ensure!(
                TraceStep::of(&tick, &rollout).own == recorded.own,
                "task {:?}, step {number}: {name} shows something else than was recorded",
                episode.task
            );
            if let Some(text) = &recorded.instruction {
                told.clone_from(text);
            }
            let words = rollout.env.own().map(|view| view.space.words(action));
            let part = |at: u32| parts.get(at as usize).cloned().unwrap_or_else(|| told.clone());
            shots.push(Shot {
                step: number,
                seen: seen(&rollout),
                told: told.clone(),
                did: words,
                outcome: tick.outcome,
                possible: tick.outcome.is_done(),
                done: recorded.subtask.map(part),
            });
        }
        let result = if episode.success { "success" } else { "no success" };
        let title = format!("{} in {name}, {}: {result}", episode.task, counted(episode.steps, "step"));
        let subtasks = rollout.env.own().map_or(Vec::new(), |view| subtasks(&view));
        Ok(FrameSequence { title, scene: None, subtasks, wishes: Vec::new(), shots })
    }
}

fn subtasks(view: &crate::env::remote_view::RemoteView<'_>) -> Vec<String> {
    view.observation.subtasks.iter().map(|subtask| subtask.text.clone()).collect()
}

fn seen(rollout: &Rollout<RemoteEnvironment>) -> Seen {
    let picture = rollout.env.own().and_then(|view| view.observation.picture.as_ref().map(square));
    picture.map_or(Seen::Nothing, |frame| Seen::Picture(Arc::new(frame)))
}

/// A picture in the middle of a frame of House's size, as large as it fits.
fn square(picture: &Picture) -> Frame {
    let (side, longest) = (House::FRAME, picture.width.max(picture.height));
    let (left, top) = (longest - picture.width, longest - picture.height);
    let mut rgb = vec![0; 3 * side * side];
    for (at, pixel) in rgb.chunks_exact_mut(3).enumerate() {
        let (x, y) = (at % side * longest / side, at / side * longest / side);
        let (x, y) = (x.wrapping_sub(left / 2), y.wrapping_sub(top / 2));
        if x < picture.width && y < picture.height {
            let from = 3 * (y * picture.width + x);
            pixel.copy_from_slice(&picture.rgb[from..from + 3]);
        }
    }
    Frame { width: side, height: side, rgb, depth: Vec::new(), ids: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_drawn_large_in_the_middle_of_a_square() {
        let rgb = vec![255, 0, 0, 0, 255, 0];
        let frame = square(&Picture { width: 2, height: 1, rgb });
        let pixel = |x: usize, y: usize| &frame.rgb[3 * (y * 300 + x)..][..3];
        assert_eq!((frame.width, frame.height), (300, 300));
        assert_eq!((pixel(0, 0), pixel(299, 149)), (&[255, 0, 0][..], &[0, 255, 0][..]));
        assert_eq!(pixel(0, 299), [0, 0, 0], "where there is no picture");
    }
}
