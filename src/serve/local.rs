//! The protocol of the local socket: the requests of OpenEnv's messages, but steps and observations as bytes.
//!
//! Every message is its length (4 bytes, little-endian, as all numbers are), its kind (1 byte, which the length counts), and
//! what it says:
//!
//! | kind | request | answer |
//! |---|---|---|
//! | 0 | one of OpenEnv's messages, as JSON | one of OpenEnv's messages that is no observation, as JSON |
//! | 1 | a step: the action's place, and the class's in the object head, 0 for none (1 byte each) | an observation |
//!
//! An observation is a header of 24 bytes: reward (a float of 32 bits), steps (4 bytes), width, height, subtasks done
//! and of how many (2 bytes each), [flags](flag) (4 bytes), and the length of the words (4 bytes). Then come, where there are
//! any, the episode's words as JSON, a byte for each action and class that tells whether it is possible, and the frame's rows
//! of RGB.

use std::io::{BufReader, Read, Write};
use std::os::unix::net::UnixStream;

use serde_json::json;

use super::json::{Answer, Conversation, error};
use super::refusal::{ErrorCode, Refusal};
use super::session::{Playing, Session};
use crate::domain::{ActionType, Class};
use crate::episode::rollout::End;
use crate::house::grading::describe;

const JSON: u8 = 0;
const STEP: u8 = 1;
/// No request is longer.
const LONGEST: usize = 1 << 20;

/// What holds of an observation.
mod flag {
    /// Every subtask is done.
    pub(super) const SUCCESS: u32 = 1;
    /// The horizon is reached.
    pub(super) const TIMEOUT: u32 = 2;
    /// The last action was possible.
    pub(super) const POSSIBLE: u32 = 4;
    /// It is told what is possible.
    pub(super) const LEGAL: u32 = 8;
}

/// A connection of the local socket.
struct Local {
    conversation: Conversation,
    /// The answer that is put together.
    answer: Vec<u8>,
}

/// Answers until the other side leaves.
///
/// # Errors
/// When it breaks off within a message.
pub(super) fn serve(mut stream: UnixStream, session: Session) -> std::io::Result<()> {
    let mut local = Local { conversation: Conversation::new(session), answer: Vec::new() };
    let mut requests = BufReader::new(stream.try_clone()?);
    let mut request = Vec::new();
    let mut length = [0; 4];
    while requests.read_exact(&mut length).is_ok() {
        let length = u32::from_le_bytes(length) as usize;
        if !(1..=LONGEST).contains(&length) {
            return Ok(());
        }
        request.resize(length, 0);
        requests.read_exact(&mut request)?;
        if !local.take(&request) {
            return Ok(());
        }
        stream.write_all(&local.answer)?;
    }
    Ok(())
}

impl Local {
    /// Puts together the answer to a request; `false` ends the conversation.
    fn take(&mut self, request: &[u8]) -> bool {
        let answered = match self.carry_out(request) {
            Ok(Answer::Closed) => return false,
            Ok(Answer::Text(text)) => {
                self.say(&text);
                Ok(())
            }
            Ok(Answer::Observation) => self.tell(request[0] == JSON),
            Err(refusal) => Err(refusal),
        };
        if let Err(refusal) = answered {
            self.say(&error(&refusal));
        }
        true
    }

    fn carry_out(&mut self, request: &[u8]) -> Result<Answer, Refusal> {
        match request {
            [STEP, action, class] => {
                let kind = ActionType::from_index(usize::from(*action));
                let kind = kind.ok_or_else(|| Refusal::invalid(format!("action: there is no number {action}")))?;
                let class = Class::from_index(usize::from(*class)).filter(|class| class.in_vocabulary());
                self.conversation.session.step(kind, class)?;
                Ok(Answer::Observation)
            }
            [JSON, text @ ..] => match std::str::from_utf8(text) {
                Ok(text) => self.conversation.carry_out(text),
                Err(error) => Err(Refusal { code: ErrorCode::InvalidJson, message: format!("Invalid JSON: {error}") }),
            },
            _ => Err(Refusal::invalid("there is no such kind of message")),
        }
    }

    fn say(&mut self, text: &str) {
        self.begin(JSON);
        self.answer.extend_from_slice(text.as_bytes());
        self.end();
    }

    /// Tells the present observation, at an episode's start or another state with its words.
    fn tell(&mut self, with_words: bool) -> Result<(), Refusal> {
        self.begin(STEP);
        let tells_legal = self.conversation.tells_legal;
        let session = &mut self.conversation.session;
        let (size, playing) = (session.size() as u16, session.playing()?);
        let words = if with_words { words(playing) } else { String::new() };
        let mut flags = match playing.end() {
            Some(End::Success) => flag::SUCCESS,
            Some(End::Timeout) => flag::TIMEOUT,
            Some(End::Environment) | None => 0,
        };
        flags |= if playing.last.is_none_or(|last| last.outcome.is_done()) { flag::POSSIBLE } else { 0 };
        flags |= if tells_legal { flag::LEGAL } else { 0 };
        let reward = playing.last.map_or(0.0, |last| last.reward);
        let (completed, of) = playing.grading();
        let answer = &mut self.answer;
        answer.extend_from_slice(&reward.to_le_bytes());
        answer.extend_from_slice(&playing.rollout.steps().to_le_bytes());
        for number in [size, size, completed as u16, of as u16] {
            answer.extend_from_slice(&number.to_le_bytes());
        }
        answer.extend_from_slice(&flags.to_le_bytes());
        answer.extend_from_slice(&(words.len() as u32).to_le_bytes());
        answer.extend_from_slice(words.as_bytes());
        if tells_legal {
            legal(session, answer)?;
        }
        answer.extend_from_slice(&session.frame()?.rgb);
        self.end();
        Ok(())
    }

    fn begin(&mut self, kind: u8) {
        self.answer.clear();
        self.answer.extend_from_slice(&[0, 0, 0, 0, kind]);
    }

    fn end(&mut self) {
        let length = (self.answer.len() - 4) as u32;
        self.answer[..4].copy_from_slice(&length.to_le_bytes());
    }
}

/// What is asked, as JSON.
fn words(playing: &Playing) -> String {
    let task = &playing.start.task;
    let subtasks: Vec<String> = task.subtasks.iter().map(|subtask| describe(&task.roles, subtask)).collect();
    json!({"task": task.id, "mission": playing.rollout.instruction, "subtasks": subtasks}).to_string()
}

/// A byte for each action and class; an action without a class stands at the class none.
fn legal(session: &mut Session, answer: &mut Vec<u8>) -> Result<(), Refusal> {
    let first = answer.len();
    answer.resize(first + ActionType::COUNT * Class::VOCABULARY, 0);
    let table = &mut answer[first..];
    for kind in ActionType::ALL.into_iter().filter(|kind| !kind.is_interaction()) {
        table[kind.index() * Class::VOCABULARY] = 1;
    }
    for candidate in session.candidates()? {
        table[candidate.kind.index() * Class::VOCABULARY + candidate.class.index()] = 1;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::domain::Room;
    use crate::house::grading::Grading;
    use crate::serve::episodes::{EpisodeOrigin, Episodes};

    /// Bytes of an observation's header.
    const HEADER: usize = 24;

    fn local() -> Local {
        let origin = EpisodeOrigin::Generated { rooms: vec![Room::Kitchen], length: 1, count: None };
        let session = Session::new(Arc::new(Episodes::new(origin, Grading::Class)), 32);
        Local { conversation: Conversation::new(session), answer: Vec::new() }
    }

    fn ask(local: &mut Local, text: &str) -> Vec<u8> {
        assert!(local.take(&[&[JSON], text.as_bytes()].concat()));
        answered(local)
    }

    fn answered(local: &Local) -> Vec<u8> {
        let (length, rest) = local.answer.split_at(4);
        assert_eq!(u32::from_le_bytes(length.try_into().unwrap()) as usize, rest.len());
        rest.to_vec()
    }

    fn number(bytes: &[u8], at: usize) -> usize {
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
    }

    #[test]
    fn a_reset_tells_words_and_frame_and_a_step_the_frame_alone() {
        let mut local = local();
        let start = ask(&mut local, r#"{"type": "reset", "data": {"seed": 4, "legal": false}}"#);
        let words = number(&start, 1 + 20);
        let told: serde_json::Value = serde_json::from_slice(&start[1 + HEADER..][..words]).unwrap();
        assert_eq!(told["subtasks"].as_array().unwrap().len(), 1);
        assert_eq!((start[0], start.len()), (STEP, 1 + HEADER + words + 3 * 32 * 32));
        assert!(local.take(&[STEP, ActionType::RotateLeft.index() as u8, 0]));
        let turned = answered(&local);
        assert_eq!((turned.len(), number(&turned, 1 + 4)), (1 + HEADER + 3 * 32 * 32, 1), "one step");
        assert_eq!(number(&turned, 1 + 16), flag::POSSIBLE as usize);
        assert_ne!(turned[1 + HEADER..], start[1 + HEADER + words..]);
    }

    #[test]
    fn the_table_of_what_is_possible_is_what_the_house_says() {
        let mut local = local();
        let start = ask(&mut local, r#"{"type": "reset", "data": {"seed": 4}}"#);
        let table = &start[1 + HEADER + number(&start, 1 + 20)..][..ActionType::COUNT * Class::VOCABULARY];
        let mut expected = vec![0; table.len()];
        (0..5).for_each(|action| expected[action * Class::VOCABULARY] = 1);
        for candidate in local.conversation.session.candidates().unwrap() {
            expected[candidate.kind.index() * Class::VOCABULARY + candidate.class.index()] = 1;
        }
        assert_eq!(table, expected);
    }

    #[test]
    fn what_is_refused_is_answered_as_json() {
        let mut local = local();
        for request in [&[STEP, 0, 0][..], &[STEP, 99, 0], &[STEP], &[7], &[JSON, 0xff], b"\0{"] {
            assert!(local.take(request));
            let answer = answered(&local);
            assert_eq!(answer[0], JSON);
            assert_eq!(serde_json::from_slice::<serde_json::Value>(&answer[1..]).unwrap()["type"], "error");
        }
        assert!(!local.take(b"\0{\"type\": \"close\"}"));
    }
}
