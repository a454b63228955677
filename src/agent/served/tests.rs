use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use rmpv::Value;

use super::array::field;
use super::dialogue::map;
use super::testing::{Answer, serve, vla_eval};
use super::{PolicyAddress, ServedPolicy, ServerGone};
use crate::agent::{Decision, Observation, Policy};
use crate::domain::{Action, ActionType};
use crate::env::{Environment, HouseEnvironment};
use crate::house::testing::kitchen_house;

const LIMIT: Duration = Duration::from_millis(1500);

fn policy(address: &PolicyAddress) -> Box<dyn Policy> {
    (ServedPolicy::source(address, LIMIT).unwrap().make)().unwrap()
}

fn decide(policy: &mut dyn Policy, step: u32, instruction: &str) -> anyhow::Result<Decision> {
    let mut environment = HouseEnvironment::new(kitchen_house(), None);
    policy.act_in(0, Observation { environment: &mut environment, instruction, step, last: None })
}

/// What a server that answers with this payload, or does this, makes of the first step.
fn answered(answer: impl FnMut(&Value) -> Answer + Send + 'static) -> anyhow::Result<Decision> {
    let (address, _) = vla_eval(answer, |_, _| {});
    let mut policy = policy(&address);
    policy.reset(0, 1);
    decide(&mut *policy, 0, "Take the mug.")
}

fn said<const N: usize>(fields: [(&'static str, Value); N]) -> anyhow::Result<Decision> {
    answered(move |message| Answer::to(message, "action", map(fields.clone())))
}

#[test]
fn a_server_hears_of_episode_frame_instruction_and_what_is_possible_and_its_word_is_done() {
    let (tell, heard) = channel();
    let act = |message: &Value| Answer::to(message, "action", map([("action", "RotateLeft".into())]));
    let (address, _) = vla_eval(act, move |kind, payload| drop(tell.send((kind.to_owned(), payload.clone()))));
    let source = ServedPolicy::source(&address, LIMIT).unwrap();
    assert_eq!(source.name, "ws:Tester");
    let mut policy = (source.make)().unwrap();
    for (seed, steps) in [(7, 2), (8, 1)] {
        policy.reset(0, seed);
        for step in 0..steps {
            let decision = decide(&mut *policy, step, "Take the mug.").unwrap();
            assert_eq!(decision, Decision::of(Action::navigate(ActionType::RotateLeft)));
        }
    }
    drop(policy);
    let kinds = |heard: &Receiver<(String, Value)>| heard.try_iter().collect::<Vec<_>>();
    let messages = kinds(&heard);
    let order: Vec<&str> = messages.iter().map(|(kind, _)| kind.as_str()).filter(|kind| *kind != "hello").collect();
    let episode = ["episode_start", "observation"];
    assert_eq!(order, [&episode[..], &["observation", "episode_end"], &episode].concat());
    let told = |kind: &str| &messages.iter().find(|(known, _)| known == kind).unwrap().1;
    let task = field(told("episode_start"), "task").unwrap();
    assert_eq!(field(task, "seed").and_then(Value::as_u64), Some(7));
    let seen = told("observation");
    assert_eq!(field(seen, "task_description").and_then(|text| text.as_str()), Some("Take the mug."));
    let picture = field(field(seen, "images").unwrap(), "camera").unwrap();
    assert_eq!(field(picture, "data").unwrap().as_slice().unwrap().len(), 300 * 300 * 3);
    let actions = field(seen, "actions").unwrap().as_array().unwrap();
    let legal = field(seen, "legal").unwrap().as_array().unwrap();
    assert_eq!((actions.len(), legal.len()), (12, 12));
    assert_eq!(legal[ActionType::MoveAhead.index()], true.into());
}

#[test]
fn a_distribution_a_value_and_an_end_are_shown_as_an_agents_own_are() {
    let weights = map([("MoveAhead", 0.5.into()), ("RotateLeft", 1.5.into())]);
    let decision = said([("probabilities", weights), ("value", 0.25.into()), ("done", 0.75.into())]).unwrap();
    assert_eq!(decision.action, Action::navigate(ActionType::RotateLeft));
    let distribution = decision.distribution.as_ref().unwrap();
    assert_eq!(distribution.actions[ActionType::RotateLeft.index()], Some(0.75));
    assert_eq!(distribution.actions[ActionType::LookUp.index()], None);
    assert_eq!((decision.values.as_ref().unwrap().state, decision.says_done()), (0.25, Some(true)));
}

#[test]
fn actions_are_named_numbered_or_the_first_of_a_chunk() {
    let look_down = Action::navigate(ActionType::LookDown);
    assert_eq!(said([("action", "LookDown".into())]).unwrap().action, look_down);
    assert_eq!(said([("action", 4.into())]).unwrap().action, look_down);
    let row = |value: i64| Value::Array(vec![value.into()]);
    assert_eq!(said([("actions", Value::Array(vec![row(4), row(1)]))]).unwrap().action, look_down);
}

#[test]
fn an_interaction_takes_the_nearest_thing_of_the_class_and_none_that_is_not_at_hand() {
    let nearest = answered(|message| {
        let legal = field(field(message, "payload").unwrap(), "legal").unwrap().as_array().unwrap();
        let class = legal[ActionType::Pickup.index()].as_array().unwrap()[0].clone();
        Answer::to(message, "action", map([("action", "Pickup".into()), ("argument", class)]))
    });
    let candidates = HouseEnvironment::new(kitchen_house(), None).legal_actions().unwrap();
    let first = candidates.iter().find(|candidate| candidate.kind == ActionType::Pickup).unwrap();
    assert_eq!(nearest.unwrap().action, first.action());
    let missing = said([("action", "Pickup".into()), ("argument", "Bed".into())]).unwrap();
    assert_eq!(missing.action, Action::navigate(ActionType::Pickup), "it comes out as impossible");
}

#[test]
fn what_cannot_be_understood_is_one_sentence_that_names_the_field() {
    let refusal = |outcome: anyhow::Result<Decision>| {
        let text = format!("{:#}", outcome.unwrap_err());
        assert!(text.starts_with("the policy server at ws://127.0.0.1:") && !text.contains('\n'), "{text}");
        text
    };
    for (fields, words) in [
        ([("action", Value::from("Fly"))], "action: \"Fly\" is none of MoveAhead, "),
        ([("action", 12.into())], "action: 12 is no place from 0 to 11"),
        ([("action", (-1).into())], "-1 is no place"),
        ([("actions", Value::Array(vec![0.1.into(); 7]))], "actions: 7 numbers are no action here"),
        ([("probabilities", Value::Array(vec![f64::NAN.into(); 12]))], "NaN of MoveAhead is no probability"),
        ([("probabilities", Value::Array(vec![0.5.into(); 3]))], "3 numbers, but there are 12 actions"),
        ([("probabilities", Value::Array(vec![0.0.into(); 12]))], "nothing that is possible now has any weight"),
        ([("logits", Value::Array(vec![f64::INFINITY.into(); 12]))], "is no logit"),
        ([("mood", "good".into())], "it names no action"),
    ] {
        let text = refusal(said(fields));
        assert!(text.contains(words) && text.contains("at step 0"), "{text}");
    }
    let value = refusal(said([("action", 0.into()), ("value", f64::NAN.into())]));
    assert!(value.contains("value: NaN is no finite number"), "{value}");
    let rubbish = refusal(answered(|_| Answer::Bytes(b"\xdcnot".to_vec())));
    assert!(rubbish.contains("is no MessagePack"), "{rubbish}");
    let endless = refusal(answered(|_| Answer::Bytes([0xdd, 0xff, 0xff, 0xff, 0xff].to_vec())));
    assert!(endless.contains("is no MessagePack"), "{endless}");
    let other = refusal(answered(|message| Answer::to(message, "hello", map([]))));
    assert!(other.contains("instead of \"action\""), "{other}");
    let failed = refusal(answered(|message| Answer::to(message, "error", map([("error", "no\nmemory".into())]))));
    assert!(failed.ends_with("failed at step 0: \"no memory\""), "{failed}");
}

#[test]
fn a_message_of_two_gigabytes_is_refused_by_its_header() {
    use std::io::Write;
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("ws:127.0.0.1:{}", listener.local_addr().unwrap().port()).parse().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut socket = tungstenite::accept(stream.unwrap()).unwrap();
            let header = [&[0x82, 127][..], &(2_u64 << 30).to_be_bytes()].concat();
            socket.get_mut().write_all(&header).unwrap();
            let _ = socket.read();
        }
    });
    let error = format!("{:#}", ServedPolicy::source(&address, LIMIT).err().unwrap());
    assert!(error.contains("larger than 64 MB"), "{error}");
}

#[test]
fn a_late_answer_is_an_error_and_answers_nothing_else() {
    let mut asked = 0;
    let act = move |message: &Value| {
        asked += 1;
        if asked == 1 {
            // Past the limit, then what was asked before.
            std::thread::sleep(LIMIT + Duration::from_millis(200));
        }
        Answer::to(message, "action", map([("action", if asked == 1 { "LookUp" } else { "LookDown" }.into())]))
    };
    let (address, _) = vla_eval(act, |_, _| {});
    let mut policy = policy(&address);
    policy.reset(0, 1);
    let late = decide(&mut *policy, 0, "Go.").unwrap_err().to_string();
    assert!(late.contains("did not answer within 1.5 s at step 0") && late.contains("--policy-timeout"), "{late}");
    policy.reset(0, 2);
    assert_eq!(decide(&mut *policy, 0, "Go.").unwrap().action, Action::navigate(ActionType::LookDown));
}

#[test]
fn a_broken_conversation_is_an_episodes_error_and_a_dead_server_the_runs() {
    let broken = answered(|_| Answer::Close).unwrap_err();
    assert!(broken.to_string().contains("broke off at step 0") && !broken.is::<ServerGone>(), "{broken}");
    let dead = answered(|_| Answer::Die).unwrap_err();
    assert!(dead.is::<ServerGone>() && dead.to_string().contains("start it again"), "{dead}");
}

#[test]
fn deciding_twice_asks_once_and_what_a_server_carries_is_given_back() {
    let mut count = 0;
    let act = move |message: &Value| {
        count += 1;
        let given = field(field(message, "payload").unwrap(), "state").and_then(Value::as_u64).unwrap_or(0);
        let place = given.min(4);
        Answer::to(
            message,
            "action",
            map([("action", place.into()), ("state", (given + 1).into()), ("value", count.into())]),
        )
    };
    let (address, _) = vla_eval(act, |_, _| {});
    let mut policy = policy(&address);
    policy.reset(0, 3);
    let index = |decision: &Decision| decision.action.kind.index();
    let first = decide(&mut *policy, 0, "Go.").unwrap();
    let again = decide(&mut *policy, 0, "Go.").unwrap();
    assert_eq!(first, again);
    let carried = policy.state(0);
    let second = decide(&mut *policy, 1, "Go.").unwrap();
    assert_eq!((index(&first), index(&second)), (0, 1));
    policy.restore(0, carried);
    assert_eq!(index(&decide(&mut *policy, 1, "Go.").unwrap()), 1, "as at that step before");
}

#[test]
fn openpis_words_are_known_by_what_its_server_says_first() {
    let about = map([("name", "pi".into())]);
    let (address, _) = serve(Some(about), |observation| {
        let prompt = field(observation, "prompt").and_then(|text| text.as_str());
        assert_eq!(prompt, Some("Go."));
        let picture = field(observation, "observation/image").unwrap();
        assert_eq!(field(picture, "dtype").and_then(|dtype| dtype.as_str()), Some("|u1"));
        Answer::of(&map([("actions", Value::Array(vec![2.into()]))]))
    });
    let source = ServedPolicy::source(&address, LIMIT).unwrap();
    assert_eq!(source.name, "ws:pi");
    let mut policy = (source.make)().unwrap();
    policy.reset(0, 1);
    assert_eq!(decide(&mut *policy, 0, "Go.").unwrap().action, Action::navigate(ActionType::RotateRight));
}

#[test]
fn where_no_server_listens_that_is_said_with_what_to_do() {
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let address: PolicyAddress = format!("ws:127.0.0.1:{port}").parse().unwrap();
    let error = format!("{:#}", ServedPolicy::source(&address, LIMIT).err().unwrap());
    assert!(error.starts_with(&format!("no policy server answers at ws://127.0.0.1:{port}: start it")), "{error}");
}
