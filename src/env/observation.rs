//! What an environment in another process shows: read from its answer, checked, and told apart from any other by a digest.

use std::fmt::Write as _;

use anyhow::{Context, ensure};
use base64::Engine;
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::action_space::ActionSpace;

/// The widest and highest picture that is taken.
const LARGEST: u64 = 8192;
/// The longest text that is taken, in bytes.
const LONGEST_TEXT: usize = 1 << 20;

/// What can be told of one state.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct RemoteObservation {
    /// The picture, where there is one.
    pub(crate) picture: Option<Picture>,
    /// What the agent reads, where there is something.
    pub(crate) text: Option<String>,
    /// What is asked in this episode.
    pub(crate) mission: Option<String>,
    /// What is possible, an entry an action; nothing where that is not told.
    pub(crate) legal: Option<Vec<Legal>>,
    /// Whether what is asked is done, where that is known.
    pub(crate) success: Option<bool>,
    /// The episode is over.
    pub(crate) done: bool,
    /// It is over because a time limit of the environment's own is reached.
    pub(crate) truncated: bool,
    /// The parts of what is asked.
    pub(crate) subtasks: Vec<RemoteSubtask>,
    /// What is in view.
    pub(crate) things: Vec<Thing>,
    /// What the last step earned, where that is told.
    pub(crate) reward: Option<f64>,
    /// Tells what is seen from anything else, whatever the step before earned.
    pub(crate) digest: String,
}

/// Rows of red, green and blue, a byte each, from the top.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rgb: Vec<u8>,
}

/// Whether an action is possible.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Legal {
    /// It is, or is not, whatever its argument.
    Whole(bool),
    /// With these arguments.
    With(Vec<Value>),
}

/// A part of what is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RemoteSubtask {
    pub(crate) text: String,
    pub(crate) is_done: bool,
}

/// A thing in view: where in the picture, left, top, right, bottom.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Thing {
    pub(crate) name: String,
    pub(crate) corners: [f64; 4],
}

/// Fields of an observation that are read; all others are a foreign environment's own.
const KNOWN: [&str; 12] = [
    "frame",
    "text",
    "mission",
    "legal",
    "success",
    "terminated",
    "truncated",
    "subtasks",
    "things",
    "metadata",
    "done",
    "reward",
];

impl RemoteObservation {
    /// Reads the data of an answer.
    ///
    /// # Errors
    /// Names the field that is wrong.
    pub(crate) fn read(data: Value, space: &ActionSpace) -> anyhow::Result<RemoteObservation> {
        let Value::Object(mut data) = data else { anyhow::bail!("data: not an object") };
        let fields = match data.remove("observation") {
            Some(Value::Object(fields)) => fields,
            _ => anyhow::bail!("data.observation: missing, or not an object"),
        };
        let reward = match data.get("reward") {
            None | Some(Value::Null) => None,
            // OpenEnv takes a yes or no for a reward, too.
            Some(Value::Bool(earned)) => Some(f64::from(u8::from(*earned))),
            Some(reward) => Some(reward.as_f64().filter(|it| it.is_finite()).context("data.reward: not a number")?),
        };
        let truth = |name: &str| match fields.get(name) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::Bool(value)) => Ok(Some(*value)),
            Some(_) => Err(anyhow::anyhow!("observation.{name}: neither true nor false")),
        };
        let words = |name: &str| match fields.get(name) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(text)) if text.len() <= LONGEST_TEXT => Ok(Some(plain(text))),
            Some(Value::String(_)) => Err(anyhow::anyhow!("observation.{name}: longer than {LONGEST_TEXT} bytes")),
            Some(_) => Err(anyhow::anyhow!("observation.{name}: not a text")),
        };
        let picture = match fields.get("frame") {
            None | Some(Value::Null) => None,
            Some(frame) => Some(picture(frame).context("observation.frame")?),
        };
        let done = match data.get("done") {
            None | Some(Value::Null) => false,
            Some(Value::Bool(done)) => *done,
            Some(_) => anyhow::bail!("data.done: neither true nor false"),
        };
        let truncated = truth("truncated")?.unwrap_or(false) && !truth("terminated")?.unwrap_or(false);
        let (text, mission, success) = (words("text")?, words("mission")?, truth("success")?);
        let text = text.or_else(|| if picture.is_none() { others_in_words(&fields) } else { None });
        let mut observation = RemoteObservation {
            text,
            mission,
            legal: legal(fields.get("legal"), space)?,
            success,
            done: done || truth("terminated")?.unwrap_or(false) || truncated,
            truncated,
            subtasks: subtasks(fields.get("subtasks"))?,
            things: things(fields.get("things"))?,
            reward,
            digest: String::new(),
            picture,
        };
        observation.digest = observation.fingerprint(fields);
        Ok(observation)
    }

    /// How many parts are done and of how many: success is one where no parts are told; nothing where neither is.
    pub(crate) fn grading(&self) -> Option<(usize, usize)> {
        let (done, of) = (self.subtasks.iter().filter(|subtask| subtask.is_done).count(), self.subtasks.len());
        match (self.success, of) {
            (None, 0) => None,
            (Some(success), 0) => Some((usize::from(success), 1)),
            (None, of) => Some((done, of)),
            (Some(true), of) => Some((of, of)),
            // All parts may be done before the episode itself says so.
            (Some(false), of) => Some((done.min(of - 1), of)),
        }
    }

    fn fingerprint(&self, mut fields: Map<String, Value>) -> String {
        let mut digest = Sha256::new();
        if let Some(picture) = &self.picture {
            digest.update((picture.width as u64).to_le_bytes());
            digest.update(&picture.rgb);
        }
        for name in ["frame", "metadata"] {
            fields.remove(name);
        }
        digest.update(serde_json::to_vec(&(&fields, self.done)).unwrap_or_default());
        let mut text = String::new();
        for byte in &digest.finalize()[..8] {
            let _ = write!(text, "{byte:02x}");
        }
        text
    }
}

/// Without what could move a cursor or change a terminal's state; lines stay lines.
fn plain(text: &str) -> String {
    let kept = |c: char| c == '\n' || !c.is_control();
    text.replace('\t', "    ").chars().filter(|&c| kept(c)).collect()
}

/// A foreign environment's own fields, for a person to read.
fn others_in_words(fields: &Map<String, Value>) -> Option<String> {
    let others: Map<String, Value> = fields
        .iter()
        .filter(|(name, _)| !KNOWN.contains(&name.as_str()))
        .map(|(n, v)| (n.clone(), v.clone()))
        .collect();
    if others.is_empty() {
        return None;
    }
    let mut text = serde_json::to_string_pretty(&others).ok()?;
    if text.len() > LONGEST_TEXT {
        let end = (0..=LONGEST_TEXT).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0);
        text.truncate(end);
    }
    Some(plain(&text))
}

fn picture(frame: &Value) -> anyhow::Result<Picture> {
    let side = |name: &str| {
        let side = frame.get(name).and_then(Value::as_u64).filter(|side| (1..=LARGEST).contains(side));
        side.map(|side| side as usize).with_context(|| format!("{name}: not 1 to {LARGEST}"))
    };
    let (width, height) = (side("width")?, side("height")?);
    let data = frame.get("data").and_then(Value::as_str).context("data: missing")?;
    let bytes = base64::engine::general_purpose::STANDARD.decode(data).context("data: not base64")?;
    let rgb = match frame.get("encoding").and_then(Value::as_str) {
        Some("raw") => bytes,
        Some("png") => {
            let image = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png).context("data: no PNG")?;
            let found = (image.width() as usize, image.height() as usize);
            ensure!(found == (width, height), "it says {width} x {height}, but its PNG has {} x {}", found.0, found.1);
            image.into_rgb8().into_raw()
        }
        _ => anyhow::bail!("encoding: neither \"png\" nor \"raw\""),
    };
    let wanted = width * height * 3;
    ensure!(rgb.len() == wanted, "{width} x {height} pixels have {wanted} bytes, but {} came", rgb.len());
    Ok(Picture { width, height, rgb })
}

fn legal(value: Option<&Value>, space: &ActionSpace) -> anyhow::Result<Option<Vec<Legal>>> {
    let Some(value) = value.filter(|value| !value.is_null()) else { return Ok(None) };
    let entries = value.as_array().context("observation.legal: not a list")?;
    let many = space.actions().len();
    ensure!(entries.len() == many, "observation.legal: {} entries for {many} actions", entries.len());
    let read = |(i, entry): (usize, &Value)| match entry {
        Value::Bool(legal) => Ok(Legal::Whole(*legal)),
        Value::Array(values) if space.list(i).is_some() => Ok(Legal::With(values.clone())),
        _ => Err(anyhow::anyhow!("observation.legal[{i}]: neither true, false nor a list of arguments")),
    };
    entries.iter().enumerate().map(read).collect::<anyhow::Result<_>>().map(Some)
}

fn subtasks(value: Option<&Value>) -> anyhow::Result<Vec<RemoteSubtask>> {
    let Some(value) = value.filter(|value| !value.is_null()) else { return Ok(Vec::new()) };
    let entries =
        value.as_array().filter(|entries| entries.len() <= 1000).context("observation.subtasks: not a list")?;
    let read = |(i, entry): (usize, &Value)| {
        let text = entry.get("text").and_then(Value::as_str).map(plain);
        let done = entry.get("done").and_then(Value::as_bool);
        let (Some(text), Some(is_done)) = (text, done) else {
            anyhow::bail!("observation.subtasks[{i}]: not a text and whether it is done");
        };
        Ok(RemoteSubtask { text, is_done })
    };
    entries.iter().enumerate().map(read).collect()
}

fn things(value: Option<&Value>) -> anyhow::Result<Vec<Thing>> {
    let Some(value) = value.filter(|value| !value.is_null()) else { return Ok(Vec::new()) };
    let entries =
        value.as_array().filter(|entries| entries.len() <= 10_000).context("observation.things: not a list")?;
    let read = |(i, entry): (usize, &Value)| {
        let name = entry.get("name").and_then(Value::as_str).map(plain);
        let corners = entry.get("box").and_then(Value::as_array);
        let corners: Option<Vec<f64>> = corners.and_then(|four| four.iter().map(Value::as_f64).collect());
        let corners: Option<[f64; 4]> = corners.and_then(|four| four.try_into().ok());
        let (Some(name), Some(corners)) = (name, corners) else {
            anyhow::bail!("observation.things[{i}]: not a name and a box of four numbers");
        };
        Ok(Thing { name, corners })
    };
    entries.iter().enumerate().map(read).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::env::action_space::tests::space;

    fn read(observation: Value) -> anyhow::Result<RemoteObservation> {
        RemoteObservation::read(json!({"observation": observation, "reward": 0.5, "done": false}), &space())
    }

    fn encoded(bytes: &[u8]) -> String {
        base64::engine::general_purpose::STANDARD.encode(bytes)
    }

    #[test]
    fn a_picture_is_the_same_however_it_travels_and_so_is_its_digest() {
        let rgb: Vec<u8> = (0..2 * 3 * 3).map(|i| i * 9).collect();
        let mut png = Vec::new();
        let image = image::RgbImage::from_raw(2, 3, rgb.clone()).unwrap();
        image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
        let frame = |encoding: &str, bytes: &[u8]| json!({"frame": {"encoding": encoding, "width": 2, "height": 3, "data": encoded(bytes)}});
        let (raw, png) = (read(frame("raw", &rgb)).unwrap(), read(frame("png", &png)).unwrap());
        assert_eq!(raw, png);
        assert_eq!(raw.picture.unwrap().rgb, rgb);
        let other = read(frame("raw", &[7; 18])).unwrap();
        assert_ne!(other.digest, raw.digest);
    }

    #[test]
    fn what_is_malformed_is_named_by_its_field() {
        let frame =
            |width: u64, data: &str| json!({"frame": {"encoding": "raw", "width": width, "height": 1, "data": data}});
        for (observation, told) in [
            (frame(2, &encoded(&[1, 2, 3])), "2 x 1 pixels have 6 bytes, but 3 came"),
            (frame(0, ""), "width: not 1 to 8192"),
            (frame(1, "?"), "data: not base64"),
            (json!({"frame": {"encoding": "jpeg", "width": 1, "height": 1, "data": ""}}), "encoding"),
            (json!({"legal": [true]}), "legal: 1 entries for 4 actions"),
            (json!({"legal": [["x"], true, true, true]}), "legal[0]"),
            (json!({"success": "yes"}), "success: neither"),
            (json!({"subtasks": [{"text": "go"}]}), "subtasks[0]"),
            (json!({"things": [{"name": "door", "box": [1, 2]}]}), "things[0]"),
            (json!({"text": 7}), "text: not a text"),
        ] {
            let error = format!("{:#}", read(observation).unwrap_err());
            assert!(error.contains(told), "{told}: {error}");
        }
        let unanswered = RemoteObservation::read(json!({"reward": 1}), &space()).unwrap_err().to_string();
        assert!(unanswered.contains("data.observation"), "{unanswered}");
    }

    #[test]
    fn success_and_parts_are_graded_together() {
        let parts = |done: [bool; 2]| json!(done.map(|done| json!({"text": "x", "done": done})));
        let graded = |observation: Value| read(observation).unwrap().grading();
        assert_eq!(graded(json!({})), None);
        assert_eq!(graded(json!({"success": false})), Some((0, 1)));
        assert_eq!(graded(json!({"success": true})), Some((1, 1)));
        assert_eq!(graded(json!({"subtasks": parts([true, false])})), Some((1, 2)));
        assert_eq!(graded(json!({"success": false, "subtasks": parts([true, true])})), Some((1, 2)));
        assert_eq!(graded(json!({"success": true, "subtasks": parts([true, false])})), Some((2, 2)));
    }

    #[test]
    fn a_foreign_environments_own_words_are_shown_and_nothing_moves_the_cursor() {
        let seen = read(json!({"echoed": "hi", "metadata": {"t": 1}})).unwrap();
        assert!(seen.text.as_deref().unwrap().contains("\"echoed\": \"hi\""), "{seen:?}");
        let later = read(json!({"echoed": "hi", "metadata": {"t": 2}})).unwrap();
        assert_eq!(seen.digest, later.digest);
        assert_eq!(read(json!({"mission": "go\u{1b}[2J\nnow"})).unwrap().mission.as_deref(), Some("go[2J\nnow"));
    }
}
