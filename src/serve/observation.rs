//! What a session shows, as the protocol's JSON has it.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use super::png::png;
use super::refusal::Refusal;
use super::session::Session;
use crate::domain::{ActionType, Class};
use crate::episode::rollout::End;
use crate::house::House;
use crate::house::grading::describe;
use crate::house::view::{Candidate, Sighting};

/// How frames travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum FrameFormat {
    Png,
    Raw,
}

impl FrameFormat {
    /// Base64 of so many bytes is read faster than they are compressed.
    const RAW_UP_TO: usize = 64 * 1024;

    /// Both, the one first that suits frames of that size.
    pub(super) fn for_size(size: usize) -> [FrameFormat; 2] {
        match 3 * size * size <= FrameFormat::RAW_UP_TO {
            true => [FrameFormat::Raw, FrameFormat::Png],
            false => [FrameFormat::Png, FrameFormat::Raw],
        }
    }
}

/// The data of an observation.
#[derive(Serialize)]
pub(super) struct Observed {
    observation: Seen,
    reward: Option<f32>,
    done: bool,
    metadata: Metadata,
}

#[derive(Serialize)]
struct Seen {
    frame: EncodedFrame,
    mission: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    legal: Option<Vec<Legal>>,
    success: bool,
    terminated: bool,
    truncated: bool,
    subtasks: Vec<SubtaskTold>,
    things: Vec<ThingTold>,
}

#[derive(Serialize)]
struct EncodedFrame {
    encoding: FrameFormat,
    width: usize,
    height: usize,
    data: String,
}

/// Whether an action is possible now: navigation may always be tried, an interaction with things of these classes.
#[derive(Serialize)]
#[serde(untagged)]
enum Legal {
    Navigation(bool),
    Classes(Vec<&'static str>),
}

/// A subtask in words, and whether it is done.
#[derive(Serialize)]
struct SubtaskTold {
    text: String,
    done: bool,
}

#[derive(Serialize)]
struct ThingTold {
    name: &'static str,
    #[serde(rename = "box")]
    edges: [usize; 4],
}

#[derive(Serialize)]
struct Metadata {
    task: String,
    step: u32,
    /// What the last action came to, in words.
    outcome: Option<String>,
}

/// The present observation.
///
/// # Errors
/// Before the first reset.
pub(super) fn observe(session: &mut Session, format: FrameFormat, tells_legal: bool) -> Result<Observed, Refusal> {
    let frame = encode(session, format)?;
    let legal = if tells_legal { Some(legal(&session.candidates()?)) } else { None };
    let size = session.size();
    let things = session.sightings()?.into_iter().map(|(class, sighting)| thing(class, sighting, size)).collect();
    let subtasks = subtasks(session)?;
    let playing = session.playing()?;
    let end = playing.end();
    let metadata = Metadata {
        task: playing.start.task.id.clone(),
        step: playing.rollout.steps(),
        outcome: playing.last.map(|last| last.outcome.to_string()),
    };
    let observation = Seen {
        frame,
        mission: playing.rollout.instruction.clone(),
        legal,
        success: end == Some(End::Success),
        terminated: end == Some(End::Success),
        truncated: end == Some(End::Timeout),
        subtasks,
        things,
    };
    Ok(Observed { observation, reward: playing.last.map(|last| last.reward), done: end.is_some(), metadata })
}

/// Every subtask in words, the done ones first.
///
/// # Errors
/// Before the first reset.
fn subtasks(session: &Session) -> Result<Vec<SubtaskTold>, Refusal> {
    let playing = session.playing()?;
    let (task, (completed, _)) = (&playing.start.task, playing.grading());
    let told = |(at, subtask)| SubtaskTold { text: describe(&task.roles, subtask), done: at < completed };
    Ok(task.subtasks.iter().enumerate().map(told).collect())
}

fn encode(session: &mut Session, format: FrameFormat) -> Result<EncodedFrame, Refusal> {
    let frame = session.frame()?;
    let data = match format {
        FrameFormat::Raw => STANDARD.encode(&frame.rgb),
        FrameFormat::Png => STANDARD.encode(png(frame)?),
    };
    Ok(EncodedFrame { encoding: format, width: frame.width, height: frame.height, data })
}

fn legal(candidates: &[Candidate]) -> Vec<Legal> {
    let of = |kind: ActionType| {
        if !kind.is_interaction() {
            return Legal::Navigation(true);
        }
        let mut classes = Vec::new();
        for candidate in candidates.iter().filter(|candidate| candidate.kind == kind) {
            if !classes.contains(&candidate.class.name()) {
                classes.push(candidate.class.name());
            }
        }
        Legal::Classes(classes)
    };
    ActionType::ALL.into_iter().map(of).collect()
}

/// A thing in pixels of a frame of that size; its edges are those of House's own frame.
fn thing(class: Class, sighting: Sighting, size: usize) -> ThingTold {
    let [left, top, right, bottom] = sighting.bounds.map(usize::from);
    let (first, end) = (|edge: usize| edge * size / House::FRAME, |edge: usize| (edge * size).div_ceil(House::FRAME));
    ThingTold { name: class.name(), edges: [first(left), first(top), end(right + 1), end(bottom + 1)] }
}
