//! Trainings through the program itself, from demonstrations to an agent that is evaluated.

use std::collections::BTreeMap;
use std::path::Path;

use sprint_explorer::nets::resnet18;
use sprint_explorer::nets::sentence::default_folder;
use sprint_explorer::nets::weights::{self, Tensors};
use tch::{Device, Tensor};

use crate::needed;
use crate::program::{Sprint, wait_for};

/// SPRINT in miniature: every part of it, in seconds.
pub(crate) const TINY: &str = r#"
extends = "sprint"
hold_out = 3
save_every = 2
report_every = 1

[visual_encoder]
channels = [4, 4, 4, 8]

[visual_encoder_training.optimisation]
steps = 2
batch_size = 4

[policy]
channels = [4, 4, 4, 4]
hidden = [8]

[critic]
channels = [4, 4, 4, 4]
hidden = [8]

[chaining]
pairs = { pool = 4 }
batch_size = 2

[training]
steps = 6
batch_size = 8

[validation]
tasks = 1
swaps = 0
"#;

/// Behaviour cloning in miniature, through ResNet-18.
const RESNET: &str = r#"
extends = "l-bc"
visual_backbone = "resnet18"
hold_out = 3

[policy]
channels = [4, 4, 4, 4]
hidden = [8]

[training]
steps = 2
batch_size = 8

[validation]
tasks = 1
swaps = 0
"#;

/// The agent with a memory in miniature.
const MEMORY: &str = r#"
extends = "sprint-memory"
hold_out = 3
save_every = 1
report_every = 1

[detector]
channels = [2, 2, 2, 2]
pyramid = 2

[detector_training.optimisation]
steps = 2
batch_size = 2

[chooser]
embedding = 2
hidden = [4]

[chooser_training]
trajectories = 4

[chooser_training.optimisation]
steps = 2
batch_size = 4

[validation]
tasks = 1
swaps = 0
"#;

/// A folder with a few labelled demonstrations; nothing where the sentence encoder is not there.
pub(crate) fn demonstrations() -> Option<Sprint> {
    let sprint = Sprint::new();
    let encoder = needed::sentence_encoder(&default_folder())?;
    std::fs::create_dir_all(sprint.path("home/encoders")).unwrap();
    std::os::unix::fs::symlink(&encoder, sprint.path("home/encoders/all-MiniLM-L6-v2")).unwrap();
    done(&sprint, "collect D --episodes 6 --seed 5 --lengths 2 --annotations 1");
    done(&sprint, "relabel D --with rules");
    std::fs::write(sprint.path("tiny.toml"), TINY).unwrap();
    std::fs::write(sprint.path("resnet.toml"), RESNET).unwrap();
    std::fs::write(sprint.path("memory.toml"), MEMORY).unwrap();
    Some(sprint)
}

pub(crate) fn done(sprint: &Sprint, line: &str) -> String {
    let ended = sprint.run(line);
    assert_eq!(ended.code, Some(0), "{line}: {}", ended.stderr);
    ended.stdout
}

#[test]
fn sprint_is_trained_from_demonstrations_tried_on_the_way_and_evaluated() {
    let Some(sprint) = demonstrations() else { return };
    sprint.sample("tasks.json", 1, 2);
    done(&sprint, "pretrain D --preset tiny.toml --out agent --trials tasks.json --trials-every 3");
    let progress = sprint.read("agent/training/progress.jsonl");
    let lines = || progress.lines().filter(|line| line.contains("\"policy\""));
    let tried: Vec<&str> = lines().filter(|line| line.contains("eval_success_rate")).collect();
    assert_eq!(tried.len(), 2, "{progress}");
    assert!(tried[0].contains("\"step\":4") && tried[1].contains("\"step\":6"), "{tried:?}");
    for scalar in ["chain_q_loss", "aggregate_b_action_loss", "weight_max", "held_out_action_loss"] {
        assert!(lines().any(|line| line.contains(scalar)), "{scalar} is not in {progress}");
    }
    assert!(sprint.read("agent/README.md").contains("implicit Q-learning with skills chained"));
    let config: serde_json::Value = serde_json::from_str(&sprint.read("agent/config.json")).unwrap();
    assert_eq!(config["logit_adjustment"]["strength"], 0.5, "as the preset has it");
    assert_eq!(config["advantage_scale"], 10.0, "likewise");
    let shares: f64 = config["logit_adjustment"]["action_frequencies"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|share| share.as_f64())
        .sum();
    assert!((shares - 1.0).abs() < 1e-3, "{config}");
    done(&sprint, "eval --tasks tasks.json --checkpoint agent --out run");
    assert_eq!(sprint.sorted("run/episodes.jsonl").len(), 2);
}

#[test]
fn an_agents_own_steps_in_given_tasks_are_corrected_and_learned_from() {
    let Some(sprint) = demonstrations() else { return };
    let corrected = TINY.replace("[visual_encoder]", "[data]\ncorrections = true\n\n[visual_encoder]");
    std::fs::write(sprint.path("corrected.toml"), corrected).unwrap();
    done(&sprint, "pretrain D --preset tiny.toml --out agent");
    done(&sprint, "collect E --episodes 6 --seed 5 --lengths 2 --annotations 1 --demonstrator expert");
    let steps = |dataset: &str| std::fs::read(sprint.path(dataset).join("trajectories.jsonl.zst")).unwrap();
    assert!(steps("E") != steps("D"), "who knows where things are demonstrates otherwise");
    done(&sprint, "collect F --episodes 6 --seed 5 --lengths 2 --annotations 1 --demonstrator expert --prompt");
    assert!(steps("F") != steps("E"), "who turns and acts as soon as it may does, too");
    sprint.sample("tasks.json", 1, 2);
    let both = sprint.run("collect C --tasks tasks.json --episodes 3");
    assert!(both.stderr.contains("'--tasks <TASKS>' cannot be used with '--episodes <EPISODES>'"), "{}", both.stderr);
    done(&sprint, "collect C --tasks tasks.json --learner agent");
    assert!(sprint.read("C/dataset.json").contains("\"source\":\"tasks\""), "{}", sprint.read("C/dataset.json"));
    done(&sprint, "relabel C --with rules");
    let from = "--visual-from agent --policy-from agent --critic-from agent";
    done(&sprint, &format!("pretrain D C --preset corrected.toml {from} --out better"));
    done(&sprint, "average agent better --out both --validate 1");
    assert!(sprint.read("both/README.md").contains("one-skill tasks solved"));
    assert!(sprint.read("both/README.md").contains("the mean of 2 checkpoints'"), "{}", sprint.read("both/README.md"));
    done(&sprint, "eval --tasks tasks.json --checkpoint both --out run");
    assert!(sprint.run("average agent better --out both").stderr.contains("holds a checkpoint already"));
    done(&sprint, "average agent --logit-adjustment 0.2 --out lighter --validate 1");
    assert!(sprint.read("lighter/config.json").contains("\"strength\": 0.2"), "{}", sprint.read("lighter/config.json"));
    assert!(sprint.read("lighter/README.md").contains("20 % of the log frequency"));
    let refused = sprint.run("average agent --logit-adjustment 2 --out none").stderr;
    assert!(
        refused.contains("--logit-adjustment 2 for agent: logit_adjustment.strength is 2, which is not a share"),
        "{refused}"
    );
    done(&sprint, "average agent --advantage-scale 2.5 --out wiser --validate 1");
    assert!(
        sprint.read("wiser/config.json").contains("\"advantage_scale\": 2.5"),
        "{}",
        sprint.read("wiser/config.json")
    );
    assert!(
        sprint.read("wiser/README.md").contains("exp(2.5 A) times as likely"),
        "{}",
        sprint.read("wiser/README.md")
    );
    let refused = sprint.run("average agent --advantage-scale=-1 --out none").stderr;
    assert!(refused.contains("--advantage-scale -1 for agent: advantage_scale is -1, which is no weight"), "{refused}");
    let first = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/agents/clone");
    let refused = sprint.run(&format!("average {first} --logit-adjustment 0.2 --out none")).stderr;
    assert!(refused.contains("how often each action was shown was not noted"), "{refused}");
    let refused = sprint.run(&format!("average {first} --advantage-scale 2 --out none")).stderr;
    assert!(refused.contains("advantage_scale needs a critic, and there is none"), "{refused}");
    let config = sprint.read("agent/config.json");
    let digest = config.split("\"digest\": \"").nth(1).unwrap()[..64].to_string();
    std::fs::write(sprint.path("agent/config.json"), config.replace(&digest, "strange")).unwrap();
    let refused = sprint.run("average agent agent --out strange");
    assert!(refused.stderr.contains("sentence_encoder.digest is strange"), "{}", refused.stderr);
    assert!(!sprint.path("strange").exists(), "nothing is left of what was refused");
    std::fs::write(sprint.path("agent/config.json"), config).unwrap();
    assert!(sprint.read("better/config.json") != sprint.read("agent/config.json"), "it says what it learned from");
}

#[test]
fn a_training_begins_with_the_networks_it_was_given() {
    let Some(sprint) = demonstrations() else { return };
    done(&sprint, "pretrain D --preset tiny.toml --out agent");
    let still = format!("{TINY}\n[training.schedule]\nlearning_rate = 1e-12\n");
    std::fs::write(sprint.path("still.toml"), still).unwrap();
    let from = "--visual-from agent --policy-from agent --critic-from agent";
    done(&sprint, &format!("pretrain D --preset still.toml --steps 1 {from} --out still"));
    let card = sprint.read("still/README.md");
    let told = [
        ": 1 steps of the policy, seed 1",
        "Its visual encoder is that of `agent` (2 steps)",
        "policy was initialised from that of `agent` (preset `sprint`, 6 steps of the policy)",
        "critic was initialised from that of `agent`",
    ];
    assert!(told.iter().all(|told| card.contains(told)), "{card}");
    let tensors = |folder: &str| weights::read(&sprint.path(folder).join("model.safetensors")).unwrap();
    let (begun, ended) = (tensors("agent"), tensors("still"));
    // Batch norm counts what it saw, even where nothing is learned.
    for name in begun.keys().filter(|name| !name.contains("running")) {
        // The slow critic begins where the other is.
        let given = &begun[&name.replace("target.", "critic.")];
        assert!((&ended[name] - given).abs().max().double_value(&[]) < 1e-6, "{name} is another");
    }
    let clone = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/agents/clone");
    let refused = sprint.run(&format!("pretrain D --preset tiny.toml --critic-from {clone} --out none"));
    assert!(refused.stderr.contains("there is no critic"), "{}", refused.stderr);
}

#[test]
fn an_agent_that_is_shown_its_goal_is_trained_and_evaluated() {
    let Some(sprint) = demonstrations() else { return };
    let tiny = TINY.replace("\"sprint\"", "\"am\"").replace("pairs = { pool = 4 }\n", "").replace("swaps = 0\n", "");
    let goal = tiny.replace("[critic]", "goal_channels = [4, 4, 4, 4]\n\n[critic]");
    std::fs::write(sprint.path("am.toml"), format!("precision = \"mixed\"\n{goal}")).unwrap();
    done(&sprint, "pretrain D --preset am.toml --out agent");
    assert!(sprint.read("agent/README.md").contains("6 steps of the policy in mixed precision, seed"));
    done(&sprint, "average agent agent --out mean --validate 1");
    for folder in ["agent", "mean"] {
        assert!(!sprint.read(&format!("{folder}/README.md")).contains("two objects in view"));
    }
    sprint.sample("tasks.json", 1, 2);
    done(&sprint, "eval --tasks tasks.json --checkpoint agent --out run");
    assert_eq!(sprint.sorted("run/episodes.jsonl").len(), 2);
}

#[test]
fn an_agent_with_a_memory_is_trained_evaluated_by_its_own_end_verified_and_corrected() {
    let Some(sprint) = demonstrations() else { return };
    sprint.sample("tasks.json", 1, 2);
    done(&sprint, "pretrain D --preset memory.toml --out agent");
    let trained = |folder: &str| sprint.read(&format!("{folder}/training/progress.jsonl"));
    for part in ["detector_loss", "held_out_recall_tiny", "reached_loss", "held_out_end_precision"] {
        assert!(trained("agent").contains(part), "{part} is not in {}", trained("agent"));
    }
    assert!(sprint.read("agent/README.md").contains("on a map of its own"));
    let refused = sprint.run("pretrain D --preset memory.toml --out agent");
    assert!(refused.code != Some(0) && refused.stderr.contains("holds a training already"), "{}", refused.stderr);
    let refused = sprint.run("eval --tasks tasks.json --checkpoint agent --decision paper --out ruled");
    assert!(refused.stderr.contains("--decision says nothing to it"), "{}", refused.stderr);
    let refused = sprint.run("pretrain D --preset memory.toml --steps 5 --out other");
    assert!(refused.code != Some(0) && refused.stderr.contains("--steps says nothing"), "{}", refused.stderr);
    done(&sprint, "pretrain D --preset memory.toml --visual-from agent --out second");
    assert!(!trained("second").contains("detector_loss") && trained("second").contains("reached_loss"));
    done(&sprint, "eval --tasks tasks.json --checkpoint agent --out run");
    let verified = done(&sprint, "verify run --checkpoint agent");
    assert!(verified.contains("equal"), "{verified}");
    done(&sprint, "eval --tasks tasks.json --checkpoint agent --end agent --out ended");
    assert_eq!(sprint.sorted("ended/episodes.jsonl").len(), 2);
    done(&sprint, "collect C --episodes 2 --seed 9 --learner agent");
}

#[test]
fn a_training_in_the_same_folder_or_with_another_preset_is_refused() {
    let Some(sprint) = demonstrations() else { return };
    done(&sprint, "pretrain D --preset tiny.toml --out agent --steps 2");
    let again = sprint.run("pretrain D --preset tiny.toml --out agent --steps 2");
    assert_eq!(again.code, Some(1));
    assert!(again.stderr.contains("holds a training already"), "{}", again.stderr);
    let other = sprint.run("pretrain D --preset tiny.toml --out agent --steps 4 --resume");
    assert_eq!(other.code, Some(1));
    let said = "begun with another preset: steps = 2 there, steps = 4 here";
    assert!(other.stderr.contains(said), "{}", other.stderr);
    let preset = sprint.read("agent/training/preset.toml").replace("format_version = 2", "format_version = 1");
    std::fs::write(sprint.path("agent/training/preset.toml"), preset).unwrap();
    let older = sprint.run("pretrain D --preset tiny.toml --out agent --steps 2 --resume");
    assert!(older.stderr.contains("another version of sprint began this training"), "{}", older.stderr);
    std::fs::remove_file(sprint.path("agent/training/state.safetensors")).unwrap();
    std::fs::remove_file(sprint.path("agent/training/visual.safetensors")).unwrap();
    let over = sprint.run("pretrain D --preset tiny.toml --out agent");
    assert!(over.stderr.contains("agent holds a checkpoint already"), "{}", over.stderr);
    std::fs::write(sprint.path("odd.toml"), TINY.replace("hold_out = 3", "hold_out = 1")).unwrap();
    let nothing = sprint.run("pretrain D --preset odd.toml --out again");
    assert!(nothing.stderr.contains("every trajectory is held out"), "{}", nothing.stderr);
    done(&sprint, "pretrain D --preset tiny.toml --out again --steps 2");
    let data = sprint.run("collect D --episodes 1");
    assert!(data.stderr.contains("D holds a dataset already"), "{}", data.stderr);
    let seeing = sprint.run("pretrain D --preset l-bc --out other --visual-from agent");
    assert_eq!(seeing.code, Some(1));
    assert!(seeing.stderr.contains("visual_encoder is") && seeing.stderr.contains("config.json"), "{}", seeing.stderr);
    assert!(!sprint.path("other").exists(), "a refused training left something behind");
    let judging = sprint.run("pretrain D --preset l-bc --out other --critic-from agent");
    assert!(judging.stderr.contains("has no critic") && !sprint.path("other").exists(), "{}", judging.stderr);
    let trying = sprint.run("pretrain D --preset tiny.toml --out other --trials nowhere.json");
    assert!(trying.stderr.contains("nowhere.json") && !sprint.path("other").exists(), "{}", trying.stderr);
}

#[test]
fn a_training_that_is_stopped_and_killed_on_the_way_ends_with_the_same_bytes() {
    let Some(sprint) = demonstrations() else { return };
    let longer = TINY.replace("steps = 2\n", "steps = 60\n").replace("steps = 6\n", "steps = 120\n");
    std::fs::write(sprint.path("longer.toml"), longer).unwrap();
    done(&sprint, "pretrain D --preset longer.toml --out whole");
    let begin = |line: &str| {
        let (out, err) = (std::process::Stdio::null(), std::process::Stdio::null());
        sprint.command(line).stdout(out).stderr(err).spawn().unwrap()
    };
    let reported = |stage: &str| {
        let progress = std::fs::read_to_string(sprint.path("parts/training/progress.jsonl")).unwrap_or_default();
        progress.lines().filter(|line| line.contains(&format!("\"{stage}\""))).count()
    };
    let mut stopped = begin("pretrain D --preset longer.toml --out parts");
    wait_for(|| reported("visual_encoder") > 5);
    assert!(std::process::Command::new("kill").args(["-TERM", &stopped.id().to_string()]).status().unwrap().success());
    assert_eq!(stopped.wait().unwrap().code(), Some(130));
    assert!(reported("visual_encoder") < 60 && reported("policy") == 0, "it was stopped while it learned to see");
    let mut killed = begin("pretrain D --preset longer.toml --out parts --resume");
    wait_for(|| reported("policy") > 5);
    killed.kill().unwrap();
    assert_eq!(killed.wait().unwrap().code(), None);
    let before = sprint.read("D/labels.jsonl");
    std::fs::write(sprint.path("D/labels.jsonl"), before.replacen("\"text\":\"", "\"text\":\"Please ", 1)).unwrap();
    let retold = sprint.run("pretrain D --preset longer.toml --out parts --resume");
    assert!(retold.stderr.contains("state.safetensors: items is"), "{}", retold.stderr);
    std::fs::write(sprint.path("D/labels.jsonl"), before).unwrap();
    done(&sprint, "pretrain D --preset longer.toml --out parts --resume");
    for file in ["model.safetensors", "config.json", "README.md"] {
        let [whole, parts] = ["whole", "parts"].map(|folder| std::fs::read(sprint.path(folder).join(file)).unwrap());
        let named = |bytes: Vec<u8>, folder| String::from_utf8_lossy(&bytes).replace(folder, "agent");
        assert!(named(whole, "whole") == named(parts, "parts"), "{file} is another");
    }
}

#[test]
fn an_agent_that_sees_through_resnet18_needs_the_weights_it_was_trained_on() {
    let Some(sprint) = demonstrations() else { return };
    let file = sprint.path("home/encoders/resnet18.safetensors");
    let without = sprint.run("pretrain D --preset resnet.toml --out agent");
    assert_eq!(without.code, Some(1));
    assert!(without.stderr.contains("convert_resnet18.py"), "{}", without.stderr);
    assert!(!sprint.path("agent").exists(), "a refused training left something behind");
    write_resnet18(&file, 0.01);
    let eyes = sprint.run("pretrain D --preset resnet.toml --out agent --visual-from other");
    assert_eq!(eyes.code, Some(1));
    assert!(eyes.stderr.contains("no visual encoder to take"), "{}", eyes.stderr);
    assert!(!sprint.path("agent").exists(), "a refused training left something behind");
    done(&sprint, "pretrain D --preset resnet.toml --out agent");
    let card = sprint.read("agent/README.md");
    assert!(card.contains("ResNet-18") && !card.contains("of the visual encoder"), "{card}");
    sprint.sample("tasks.json", 1, 1);
    done(&sprint, "eval --tasks tasks.json --checkpoint agent --out run");
    write_resnet18(&file, 0.02);
    let others = sprint.run("eval --tasks tasks.json --checkpoint agent --out again");
    assert_eq!(others.code, Some(1));
    assert!(others.stderr.contains("the agent was trained on"), "{}", others.stderr);
}

/// The paper's size in miniature: as it, but narrow, through a tiny MPNet.
const PAPER: &str = r#"
extends = "paper"
save_every = 1
report_every = 1

[policy]
embedding = 32
channels = [4, 4, 4, 4]
hidden = [8]
goal_channels = [4, 4, 4, 4]

[policy.attention]
vocabulary_size = 50
layers = 1
heads = 2
feedforward = 8

[critic]
channels = [4, 4, 4, 4]
hidden = [8]

[chaining]
batch_size = 6

[training]
steps = 2
batch_size = 6

[validation]
tasks = 1
swaps = 0
"#;

#[test]
fn the_papers_size_is_trained_evaluated_verified_explored_and_corrected_through_the_encoders_that_it_names() {
    let Some(mpnet) = needed::shared("fixtures/tiny-mpnet") else { return };
    let sprint = Sprint::new();
    done(&sprint, "collect D --episodes 4 --seed 5 --lengths 2 --annotations 1");
    done(&sprint, "relabel D --with rules");
    std::fs::write(sprint.path("paper.toml"), PAPER).unwrap();
    std::fs::create_dir_all(sprint.path("home/encoders")).unwrap();
    write_resnet18(&sprint.path("home/encoders/resnet18.safetensors"), 0.01);
    // No encoder that set-up fetches is there: one that lies elsewhere, and one that is found by its name.
    let remote = format!("pretrain D --preset sprint --size paper.toml --encoder {} --out agent", mpnet.display());
    let trained = sprint.run(&remote);
    assert_eq!(trained.code, Some(0), "{}", trained.stderr);
    assert!(trained.stderr.contains("an update takes about"), "{}", trained.stderr);
    let config: serde_json::Value = serde_json::from_str(&sprint.read("agent/config.json")).unwrap();
    assert_eq!((&config["decision"], &config["loop_guard"]), (&"paper".into(), &false.into()), "{config}");
    assert!(config["resnet18"].is_string() && config.get("advantage_scale").is_none(), "{config}");
    assert_eq!(config["logit_adjustment"]["strength"], 0.0, "{config}");
    assert!(sprint.read("agent/README.md").contains("takes the likeliest possible action, then its class"));
    assert!(sprint.read("agent/training/progress.jsonl").contains("aggregate_b_action_loss"));
    std::os::unix::fs::symlink(&mpnet, sprint.path("home/encoders/tiny-mpnet")).unwrap();
    done(&sprint, "pretrain D --preset sprint --size paper.toml --encoder tiny-mpnet --parts 2 --out parted");
    assert!(!sprint.read("parted/config.json").contains("folder"), "its name leads to it");
    assert!(sprint.read("parted/training/preset.toml").contains("parts = 2"));
    for method in ["am", "l-bc-transformer"] {
        done(&sprint, &format!("pretrain D --preset {method} --size paper.toml --out {method}"));
        assert!(!sprint.read(&format!("{method}/config.json")).contains("sentence_encoder"), "{method} reads none");
    }
    sprint.sample("tasks.json", 1, 1);
    for agent in ["agent", "parted", "l-bc-transformer"] {
        done(&sprint, &format!("eval --tasks tasks.json --checkpoint {agent} --out run-{agent}"));
    }
    assert!(done(&sprint, "verify run-agent --checkpoint agent").contains("equal"));
    done(&sprint, "collect C --episodes 1 --seed 9 --learner agent");
    let mut explore = assert_cmd::Command::cargo_bin("sprint").unwrap();
    let explore = explore.current_dir(sprint.path("")).env("SPRINT_HOME", sprint.path("home"));
    let explored = explore.args(["explore", "--plain", "--checkpoint", "agent"]).write_stdin("step 1\nquit\n").output();
    assert!(explored.unwrap().status.success());
    let refused = sprint.run("eval --tasks tasks.json --policy expert --decision mass --out none");
    assert!(refused.stderr.contains("--decision and --loop-guard are for trained agents"), "{}", refused.stderr);
    done(&sprint, "eval --tasks tasks.json --checkpoint agent --decision mass --loop-guard on --out other");
    let manifest: serde_json::Value = serde_json::from_str(&sprint.read("other/manifest.json")).unwrap();
    assert_eq!(manifest["deciding"], serde_json::json!({"decision": "mass", "loop_guard": true}), "{manifest}");
    assert!(done(&sprint, "verify other --checkpoint agent").contains("equal"));
    let continued = sprint.run("eval --tasks tasks.json --checkpoint agent --out other");
    assert!(continued.code != Some(0) && continued.stderr.contains("deciding"), "{}", continued.stderr);
}

/// Weights of torchvision's forms, all the same number.
fn write_resnet18(file: &Path, number: f64) {
    let tensors: Tensors = resnet18::forms()
        .into_iter()
        .map(|(name, form)| (name, Tensor::full(form.shape.as_slice(), number, (form.kind, Device::Cpu))))
        .collect();
    weights::write(file, &tensors, &BTreeMap::new()).unwrap();
}
