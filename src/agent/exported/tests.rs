use std::path::PathBuf;

use serde_json::json;

use super::testing::{always, onnx};
use super::{ExportedPolicy, Format};
use crate::agent::{Decision, Observation, Policy};
use crate::domain::{Action, ActionType};
use crate::env::HouseEnvironment;
use crate::env::remote::testing::{Fault, serve};
use crate::env::remote::{RemoteEnvironment, RemoteSettings, Sessions};
use crate::episode::rollout::{End, Rollout};
use crate::house::testing::kitchen_house;

fn described(model: &[u8], spec: &serde_json::Value) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("policy.onnx");
    std::fs::write(&path, model).unwrap();
    std::fs::write(path.with_extension("json"), spec.to_string()).unwrap();
    (folder, path)
}

fn spec() -> serde_json::Value {
    let actions = ["LookDown", "RotateLeft", "MoveAhead"];
    json!({"format_version": 1, "frames": {"height": 2, "width": 2}, "actions": actions})
}

fn refusal(model: &[u8], spec: &serde_json::Value) -> String {
    let (_folder, path) = described(model, spec);
    let error = format!("{:#}", ExportedPolicy::source(&path, Format::Onnx, false).err().unwrap());
    assert!(!error.contains('\n'), "{error}");
    error
}

fn decide(policy: &mut dyn Policy) -> anyhow::Result<Decision> {
    let mut environment = HouseEnvironment::new(kitchen_house(), None);
    policy.act_in(0, Observation { environment: &mut environment, instruction: "Go.", step: 0, last: None })
}

#[test]
fn a_model_decides_among_its_own_actions_by_its_logits() {
    for (place, kind) in [ActionType::LookDown, ActionType::RotateLeft, ActionType::MoveAhead].into_iter().enumerate() {
        let (_folder, path) = described(&onnx(&always(place), "frames", &[1, 3, 2, 2]), &spec());
        let mut policy = (ExportedPolicy::source(&path, Format::Onnx, false).unwrap().make)().unwrap();
        policy.reset(0, 1);
        let decision = decide(&mut *policy).unwrap();
        assert_eq!(decision.action, Action::navigate(kind));
        let distribution = decision.distribution.unwrap();
        assert!(distribution.actions[kind.index()].unwrap() > 0.5);
        assert_eq!(distribution.actions[ActionType::LookUp.index()], None, "it does not know it");
        assert!(distribution.actions[ActionType::Pickup.index()].is_none());
    }
}

#[test]
fn a_model_that_does_not_fit_its_description_is_refused_in_a_sentence() {
    let sound = onnx(&always(0), "frames", &[1, 3, 2, 2]);
    let changed = |field: &str, value: serde_json::Value| {
        let mut spec = spec();
        spec[field] = value;
        spec
    };
    for (model, spec, words) in [
        (
            sound.clone(),
            changed("actions", json!(["LookUp"])),
            "the output \"actions\" has the shape [1, 3], and its description asks for [1, 1]",
        ),
        (
            sound.clone(),
            changed("frames", json!({"height": 4, "width": 4})),
            "the input \"frames\" has the shape [1, 3, 2, 2]",
        ),
        (sound.clone(), changed("value", json!(true)), "the output \"value\" is missing"),
        (sound.clone(), changed("arguments", json!(["Mug"])), "the output \"arguments\" is missing"),
        (
            sound.clone(),
            changed("instruction", json!({"tokens": {"vocabulary": ["go"], "length": 4}})),
            "the input \"tokens\" is missing",
        ),
        (onnx(&always(0), "pixels", &[1, 3, 2, 2]), spec(), "the input \"frames\" is missing: it has pixels"),
        (sound.clone(), changed("mood", json!(1)), "mood"),
        (sound.clone(), changed("format_version", json!(2)), "format_version"),
        (b"no onnx".to_vec(), spec(), "it is no ONNX that can be computed here"),
    ] {
        let said = refusal(&model, &spec);
        assert!(said.contains(words) && said.contains("policy."), "{said}");
    }
    let (_folder, path) = described(&sound, &spec());
    std::fs::remove_file(path.with_extension("json")).unwrap();
    let said = ExportedPolicy::source(&path, Format::Onnx, false).err().unwrap().to_string();
    assert!(said.contains("policy.json: missing") && said.contains("sprint schema policy"), "{said}");
}

#[test]
fn logits_that_are_no_numbers_are_an_error_of_the_step_and_nothing_else_is() {
    let (_folder, path) = described(&onnx(&[f32::NAN; 36], "frames", &[1, 3, 2, 2]), &spec());
    let mut policy = (ExportedPolicy::source(&path, Format::Onnx, false).unwrap().make)().unwrap();
    policy.reset(0, 1);
    let error = format!("{:#}", decide(&mut *policy).unwrap_err());
    assert_eq!(error, "onnx:policy at step 0: its output \"actions\" has NaN");
}

#[test]
fn actions_and_classes_that_house_has_not_are_named() {
    let fits = |change: serde_json::Value| {
        let mut spec = spec();
        for (field, value) in change.as_object().unwrap() {
            spec[field] = value.clone();
        }
        let (_folder, path) = described(&onnx(&always(0), "frames", &[1, 3, 2, 2]), &spec);
        let policy = (ExportedPolicy::source(&path, Format::Onnx, false).unwrap().make)().unwrap();
        policy
            .check_fits(&mut Observation::start(&mut HouseEnvironment::new(kitchen_house(), None)))
            .map_err(|error| error.to_string())
    };
    assert_eq!(fits(json!({})), Ok(()));
    let told = fits(json!({"actions": ["LookDown", "left", "MoveAhead"]})).unwrap_err();
    assert!(told.contains("its action \"left\" is none of House's: MoveAhead"), "{told}");
}

#[test]
fn a_model_acts_in_an_environment_with_actions_of_its_own_and_is_refused_where_it_does_not_fit() {
    let env = || {
        let session = Sessions::new(RemoteSettings::default()).get(0, &serve(Fault::None)).unwrap();
        RemoteEnvironment::begin(session, 2).unwrap()
    };
    let policy = |(width, height): (u64, u64), actions: [&str; 2]| {
        let spec = json!({"format_version": 1, "frames": {"height": height, "width": width}, "actions": actions});
        let weights = [1.0, 0.5].repeat((3 * width * height) as usize);
        let (_folder, path) = described(&onnx(&weights, "frames", &[1, 3, height, width]), &spec);
        (ExportedPolicy::source(&path, Format::Onnx, false).unwrap().make)().unwrap()
    };
    let refusal =
        |policy: Box<dyn Policy>| policy.check_fits(&mut Observation::start(&mut env())).unwrap_err().to_string();
    assert_eq!(refusal(policy((4, 3), ["right", "up"])), "its action \"up\" is none of the environment's: left, right");
    assert!(refusal(policy((2, 2), ["right", "left"])).contains("the frames are 4 x 3, and the policy takes 2 x 2"));
    let mut policy = policy((4, 3), ["right", "left"]);
    policy.check_fits(&mut Observation::start(&mut env())).unwrap();
    let mut rollout = Rollout::new(env(), "go to the right end".into(), Some(9));
    rollout.run(&mut *policy, &mut ()).unwrap();
    assert_eq!((rollout.end(), rollout.steps()), (Some(End::Success), 5));
}

#[test]
fn with_a_seed_actions_are_drawn_the_same_way_again_and_what_is_carried_can_be_restored() {
    let (_folder, path) = described(&onnx(&[0.0; 36], "frames", &[1, 3, 2, 2]), &spec());
    let mut policy = (ExportedPolicy::source(&path, Format::Onnx, true).unwrap().make)().unwrap();
    let mut drawn = |seed: u64| {
        policy.reset(0, seed);
        (0..20).map(|_| decide(&mut *policy).unwrap().action.kind).collect::<Vec<ActionType>>()
    };
    let first = drawn(1);
    assert_eq!(drawn(1), first);
    assert_ne!(drawn(2), first);
    policy.reset(0, 1);
    let start = policy.state(0);
    let action = decide(&mut *policy).unwrap().action;
    policy.restore(0, start);
    assert_eq!(decide(&mut *policy).unwrap().action, action);
}
