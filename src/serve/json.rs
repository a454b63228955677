//! OpenEnv's messages: a request's text in, the answer's text out.

use serde::Deserialize;
use serde_json::{Value, json};

use super::observation::{FrameFormat, observe};
use super::refusal::{ErrorCode, Refusal};
use super::session::Session;
use crate::domain::{ActionType, Class};

/// The list that every interaction takes its argument from.
pub(super) const CLASSES: &str = "class";

/// A session as OpenEnv's messages drive it.
pub(super) struct Conversation {
    pub(super) session: Session,
    format: FrameFormat,
    /// Whether observations tell what is possible, which takes a look around.
    pub(super) tells_legal: bool,
}

/// A request, or what comes of it.
pub(super) enum Answer {
    /// This text.
    Text(String),
    /// The present observation, in whatever way the connection tells it.
    Observation,
    /// None: the conversation is over.
    Closed,
}

#[derive(Deserialize)]
struct Message {
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    data: serde_json::Map<String, Value>,
}

impl Conversation {
    /// Before the first request.
    pub(super) fn new(session: Session) -> Conversation {
        let format = FrameFormat::for_size(session.size())[0];
        Conversation { session, format, tells_legal: true }
    }

    /// The answer to a request; `None` ends the conversation.
    pub(super) fn answer(&mut self, text: &str) -> Option<String> {
        match self.carry_out(text) {
            Ok(Answer::Text(text)) => Some(text),
            Ok(Answer::Closed) => None,
            Ok(Answer::Observation) => Some(self.observation().unwrap_or_else(|refusal| error(&refusal))),
            Err(refusal) => Some(error(&refusal)),
        }
    }

    fn observation(&mut self) -> Result<String, Refusal> {
        let data = observe(&mut self.session, self.format, self.tells_legal)?;
        let text = serde_json::to_string(&json!({"type": "observation", "data": data}));
        text.map_err(|error| Refusal::failed(error.to_string()))
    }

    /// Carries a request out.
    ///
    /// # Errors
    /// When it is none, or cannot be carried out; then nothing has changed.
    pub(super) fn carry_out(&mut self, text: &str) -> Result<Answer, Refusal> {
        let value: Value = serde_json::from_str(text)
            .map_err(|error| Refusal { code: ErrorCode::InvalidJson, message: format!("Invalid JSON: {error}") })?;
        let Message { kind, data } =
            Message::deserialize(value).map_err(|error| Refusal::invalid(format!("a message: {error}")))?;
        match kind.as_str() {
            "reset" => self.reset(&data)?,
            "step" => {
                let (kind, class) = action(&data)?;
                self.session.step(kind, class)?;
            }
            "format" => self.format = format(&data)?,
            "restore" => {
                let id = data.get("id").and_then(Value::as_str).and_then(|id| id.parse().ok());
                self.session.restore(id.ok_or_else(|| Refusal::invalid("id: it is the name of a snapshot"))?)?;
            }
            "snapshot" => {
                let id = self.session.snapshot()?.to_string();
                return Ok(Answer::Text(json!({"type": "snapshot", "data": {"id": id}}).to_string()));
            }
            "state" => return Ok(Answer::Text(self.state())),
            "capabilities" => {
                let data = capabilities(self.session.size());
                return Ok(Answer::Text(json!({"type": "capabilities", "data": data}).to_string()));
            }
            "close" => return Ok(Answer::Closed),
            unknown => {
                let message = format!("Unknown message type: {unknown}");
                return Err(Refusal { code: ErrorCode::UnknownType, message });
            }
        }
        Ok(Answer::Observation)
    }

    /// `episode` names a task. OpenEnv's `episode_id` is any name; where it is a task's, that is meant.
    fn reset(&mut self, data: &serde_json::Map<String, Value>) -> Result<(), Refusal> {
        let seed = match data.get("seed").filter(|seed| !seed.is_null()) {
            Some(seed) => {
                let number = seed.as_u64();
                Some(number.ok_or_else(|| Refusal::invalid(format!("seed: {seed} is not a whole number from 0 on")))?)
            }
            None => None,
        };
        let text = |name: &str| match data.get(name) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.as_str())),
            Some(other) => Err(Refusal::invalid(format!("{name}: {other} is not a text"))),
        };
        let label = text("episode_id")?.filter(|id| self.session.has_task(id));
        let task = text("episode")?.or(label);
        match data.get("legal") {
            None | Some(Value::Null) => {}
            Some(Value::Bool(wanted)) => self.tells_legal = *wanted,
            Some(other) => return Err(Refusal::invalid(format!("legal: {other} is neither true nor false"))),
        }
        if let Some(size) = data.get("size").filter(|size| !size.is_null()) {
            let pixels = size.as_u64().filter(|pixels| FRAME_SIZES.contains(pixels));
            let refusal = || Refusal::invalid(format!("size: {size} is not a number of pixels, {FRAME_SIZES:?}"));
            self.session.resize(pixels.ok_or_else(refusal)? as usize);
        }
        self.session.reset(seed, task)
    }

    fn state(&self) -> String {
        let playing = self.session.playing().ok();
        let task = playing.map(|playing| playing.start.task.id.as_str());
        let steps = playing.map_or(0, |playing| playing.rollout.steps());
        json!({"type": "state", "data": {"episode_id": task, "step_count": steps}}).to_string()
    }
}

/// How many pixels a side a frame may have.
pub(super) const FRAME_SIZES: std::ops::RangeInclusive<u64> = 16..=600;

/// The message of an error.
pub(super) fn error(refusal: &Refusal) -> String {
    json!({"type": "error", "data": {"message": refusal.message, "code": refusal.code}}).to_string()
}

/// What House can do.
pub(super) fn capabilities(size: usize) -> Value {
    let action = |kind: ActionType| {
        let argument = if kind.is_interaction() { json!(CLASSES) } else { Value::Null };
        json!({"name": kind.name(), "argument": argument})
    };
    json!({
        "name": "House",
        "actions": ActionType::ALL.map(action),
        "arguments": {CLASSES: class_names()},
        "seeds": true,
        "snapshot": true,
        "deterministic": true,
        "frame": [size, size],
        "formats": FrameFormat::for_size(size),
    })
}

/// The classes that an action may name.
pub(super) fn class_names() -> Vec<&'static str> {
    Class::all().filter(|class| class.in_vocabulary()).map(Class::name).collect()
}

fn format(data: &serde_json::Map<String, Value>) -> Result<FrameFormat, Refusal> {
    let wanted = data.get("format").cloned().unwrap_or_default();
    serde_json::from_value(wanted.clone())
        .map_err(|_| Refusal::invalid(format!("format: there is no {wanted}, only png and raw")))
}

fn action(data: &serde_json::Map<String, Value>) -> Result<(ActionType, Option<Class>), Refusal> {
    let said = data.get("action").cloned().unwrap_or_default();
    let known = ActionType::ALL.into_iter().find(|kind| said.as_str() == Some(kind.name()));
    let kind = known.ok_or_else(|| {
        let names = ActionType::ALL.map(ActionType::name).join(", ");
        Refusal::invalid(format!("action: there is no {said}, only {names}"))
    })?;
    match data.get("argument").unwrap_or(&Value::Null) {
        Value::Null if kind.is_interaction() => Err(Refusal::invalid(format!("argument: {kind} takes a {CLASSES}"))),
        Value::Null => Ok((kind, None)),
        other if !kind.is_interaction() => {
            Err(Refusal::invalid(format!("argument: {kind} takes none, but there is {other}")))
        }
        other => {
            let class = other.as_str().and_then(Class::named).filter(|class| class.in_vocabulary());
            Ok((kind, Some(class.ok_or_else(|| Refusal::invalid(format!("argument: {other} is no {CLASSES}")))?)))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::agent::{ExpertPolicy, Policy};
    use crate::domain::Room;
    use crate::env::Environment;
    use crate::house::grading::Grading;
    use crate::serve::episodes::{EpisodeOrigin, Episodes};

    fn conversation() -> Conversation {
        let origin = EpisodeOrigin::Generated { rooms: vec![Room::Kitchen], length: 1, count: None };
        Conversation::new(Session::new(Arc::new(Episodes::new(origin, Grading::Class)), 64))
    }

    fn ask(conversation: &mut Conversation, request: &Value) -> Value {
        serde_json::from_str(&conversation.answer(&request.to_string()).unwrap()).unwrap()
    }

    fn told(conversation: &mut Conversation, request: &Value) -> Value {
        let answer = ask(conversation, request);
        assert_eq!(answer["type"], "observation", "{answer}");
        answer["data"].clone()
    }

    #[test]
    fn an_observation_tells_all_that_is_known_of_an_episode() {
        let mut conversation = conversation();
        let first = told(&mut conversation, &json!({"type": "reset", "data": {"seed": 4}}));
        let seen = &first["observation"];
        assert_eq!((&first["done"], &first["reward"], &seen["success"]), (&json!(false), &Value::Null, &json!(false)));
        assert_eq!((&seen["frame"]["encoding"], &seen["frame"]["width"]), (&json!("raw"), &json!(64)));
        assert_eq!(seen["frame"]["data"].as_str().unwrap().len(), 64 * 64 * 4);
        assert!(!seen["mission"].as_str().unwrap().is_empty());
        assert_eq!((seen["subtasks"].as_array().unwrap().len(), seen["legal"].as_array().unwrap().len()), (1, 12));
        for thing in seen["things"].as_array().unwrap() {
            let edges: Vec<u64> = thing["box"].as_array().unwrap().iter().map(|edge| edge.as_u64().unwrap()).collect();
            assert!(edges[0] < edges[2] && edges[1] < edges[3] && edges[2] <= 64 && edges[3] <= 64, "{thing}");
        }
        let turned = told(&mut conversation, &json!({"type": "step", "data": {"action": "RotateLeft"}}));
        assert_eq!((&turned["reward"], &turned["metadata"]["outcome"]), (&json!(0.0), &json!("ok")));
        assert_ne!(turned["observation"]["frame"], seen["frame"]);
        assert_eq!(told(&mut conversation, &json!({"type": "reset", "data": {"seed": 4}})), first);
        let other = told(&mut conversation, &json!({"type": "reset", "data": {"size": 32}}));
        assert_eq!((&other["observation"]["frame"]["width"], other == first), (&json!(32), false), "the next episode");
    }

    #[test]
    fn what_is_not_at_hand_is_an_impossible_action_that_takes_a_step() {
        let mut conversation = conversation();
        told(&mut conversation, &json!({"type": "reset", "data": {"seed": 4}}));
        let request = json!({"type": "step", "data": {"action": "Slice", "argument": "Bread"}});
        let after = told(&mut conversation, &request);
        assert_ne!(after["metadata"]["outcome"], "ok");
        assert_eq!(after["metadata"]["step"], 1);
    }

    #[test]
    fn each_subtask_is_rewarded_and_the_last_one_ends_the_episode() {
        let origin = EpisodeOrigin::Generated { rooms: vec![Room::Kitchen], length: 2, count: None };
        let session = Session::new(Arc::new(Episodes::new(origin, Grading::Class)), 16);
        let mut conversation = Conversation::new(session);
        let mut seen = told(&mut conversation, &json!({"type": "reset", "data": {"seed": 5}}));
        let mut expert = ExpertPolicy::new();
        expert.reset(0, 0);
        let mut rewards = Vec::new();
        while seen["done"] == false {
            let rollout = conversation.session.rollout();
            let action = rollout.decide(&mut expert).unwrap().action;
            let class = action.target.and_then(|target| rollout.env.class_of(target)).map(Class::name);
            let data = json!({"action": action.kind.name(), "argument": class});
            seen = told(&mut conversation, &json!({"type": "step", "data": data}));
            rewards.push(seen["reward"].as_f64().unwrap());
            let done = seen["observation"]["subtasks"].as_array().unwrap().iter().filter(|it| it["done"] == true);
            assert_eq!(done.count() as f64, rewards.iter().sum::<f64>());
        }
        assert_eq!((rewards.iter().sum::<f64>(), rewards.last()), (2.0, Some(&1.0)));
        assert_eq!((&seen["observation"]["success"], &seen["observation"]["truncated"]), (&json!(true), &json!(false)));
        let more = ask(&mut conversation, &json!({"type": "step", "data": {"action": "LookUp"}}));
        assert!(more["data"]["message"].as_str().unwrap().contains("is over"), "{more}");
    }

    #[test]
    fn a_snapshot_of_another_episode_is_gone_back_to() {
        let mut conversation = conversation();
        told(&mut conversation, &json!({"type": "reset", "data": {"seed": 1}}));
        let turned = told(&mut conversation, &json!({"type": "step", "data": {"action": "RotateRight"}}));
        let id = ask(&mut conversation, &json!({"type": "snapshot"}))["data"]["id"].clone();
        told(&mut conversation, &json!({"type": "reset", "data": {"seed": 2}}));
        let back = told(&mut conversation, &json!({"type": "restore", "data": {"id": id}}));
        assert_eq!(back["observation"], turned["observation"]);
        assert_eq!(ask(&mut conversation, &json!({"type": "state"}))["data"]["step_count"], 1);
    }

    #[test]
    fn requests_that_are_wrong_are_answered_by_what_is_wrong_with_them() {
        let mut conversation = conversation();
        let mut refused = |request: Value, code: &str, part: &str| {
            let answer = ask(&mut conversation, &request);
            assert_eq!((&answer["type"], &answer["data"]["code"]), (&json!("error"), &json!(code)), "{answer}");
            assert!(answer["data"]["message"].as_str().unwrap().contains(part), "{answer}");
        };
        refused(json!({"type": "step", "data": {"action": "LookUp"}}), "EXECUTION_ERROR", "send reset first");
        refused(json!({"type": "reset", "data": {"seed": -1}}), "VALIDATION_ERROR", "seed: -1");
        refused(json!({"type": "reset", "data": {"episode": "tea"}}), "VALIDATION_ERROR", "no task \"tea\"");
        refused(json!({"type": "reset", "data": {"size": 100_000}}), "VALIDATION_ERROR", "size: 100000");
        refused(json!({"type": "step", "data": {"action": "Fly"}}), "VALIDATION_ERROR", "MoveAhead");
        refused(json!({"type": "step", "data": {"action": "Open"}}), "VALIDATION_ERROR", "takes a class");
        refused(
            json!({"type": "step", "data": {"action": "Open", "argument": "Wall"}}),
            "VALIDATION_ERROR",
            "\"Wall\" is no class",
        );
        refused(json!({"type": "restore", "data": {"id": "7"}}), "VALIDATION_ERROR", "no snapshot 7");
        refused(json!({"type": "format", "data": {"format": "jpeg"}}), "VALIDATION_ERROR", "png and raw");
        refused(json!({"type": "fly"}), "UNKNOWN_TYPE", "fly");
        refused(json!([7]), "VALIDATION_ERROR", "a message");
        assert!(conversation.answer("{").unwrap().contains("INVALID_JSON"));
        assert!(conversation.answer(r#"{"type": "close"}"#).is_none());
    }
}
