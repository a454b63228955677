//! Finetuning through the program itself, with agents in miniature.

use std::path::PathBuf;
use std::process::Child;
use std::time::Duration;

use serde_json::Value;

use crate::program::Sprint;
use crate::training::{TINY, demonstrations, done};

/// A finetuning of a few steps.
const QUICK: &str = "steps = 60\ninitial_rollouts = 3\nsamplers = 2\nevaluate_every = 20\nsave_every = 20\n\
                     [training]\nbatch_size = 8\n";

/// A pretrained agent in miniature, two tasks, and a finetuning's hyper-parameters.
fn pretrained() -> Option<Sprint> {
    let sprint = demonstrations()?;
    sprint.sample("tasks.json", 2, 2);
    std::fs::write(sprint.path("quick.toml"), QUICK).unwrap();
    done(&sprint, "pretrain D --preset tiny.toml --out agent");
    Some(sprint)
}

/// The folders of the tasks' checkpoints.
fn of_tasks(sprint: &Sprint, out: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(sprint.path(out).join("tasks")).unwrap();
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    folders
}

fn bytes(folder: &std::path::Path, file: &str) -> Vec<u8> {
    std::fs::read(folder.join(file)).unwrap()
}

/// Waits until it happened, for as long as the program runs: a busy machine takes its time.
fn wait_while_it_runs(program: &mut Child, happened: &dyn Fn() -> bool) {
    while !happened() {
        assert!(program.try_wait().unwrap().is_none(), "it ended before that");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn an_agent_is_finetuned_on_each_task_and_its_curves_and_checkpoints_can_be_used() {
    let Some(sprint) = pretrained() else { return };
    let json = done(&sprint, "finetune --checkpoint agent --tasks tasks.json --out out --config quick.toml --json");
    let summary: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(summary, serde_json::from_str::<Value>(&sprint.read("out/summary.json")).unwrap());
    assert_eq!((summary["method"].as_str(), summary["tasks"].as_array().unwrap().len()), (Some("sprint"), 2));
    for task in summary["tasks"].as_array().unwrap() {
        let (rollouts, updates) = (task["rollouts"].as_u64().unwrap(), task["updates"].as_u64().unwrap());
        assert!(rollouts >= 3, "{task}");
        let folder = sprint.path("out").join(task["folder"].as_str().unwrap());
        let lines = String::from_utf8(bytes(&folder, "training/replay.jsonl")).unwrap();
        let episodes: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let steps = |of: &[Value]| of.iter().map(|it| it["steps"].as_array().unwrap().len() as u64).sum::<u64>();
        assert!(steps(&episodes[3..]) >= 60 && episodes.len() as u64 == rollouts, "{task}");
        assert_eq!(updates, steps(&episodes[3..]) / 2, "half an update a step after the initial rollouts");
        let config: Value = serde_json::from_slice(&bytes(&folder, "config.json")).unwrap();
        let finetuned = &config["provenance"]["finetuned_on"];
        assert_eq!(finetuned["task"], task["id"]);
        assert_eq!(finetuned["updates"].as_u64(), Some(updates));
    }
    let means = sprint.read("out/training/progress.jsonl");
    let steps: Vec<u64> =
        means.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["step"].as_u64().unwrap()).collect();
    assert_eq!(steps, [0, 20, 40, 60], "{means}");
    assert!(means.contains("\"return_low\"") && means.contains("\"rollout_return\""), "{means}");
    assert!(sprint.read("out/summary.md").contains("mean of 2"));
    done(&sprint, "plot out --out curves --only return");
    assert!(sprint.read("curves.svg").contains("finetuning/return"));
    let first = of_tasks(&sprint, "out").remove(0);
    done(&sprint, &format!("eval --tasks tasks.json --checkpoint {} --out run", first.display()));
    // Neither the number of tasks nor that of threads changes what becomes of one.
    done(&sprint, "finetune --checkpoint agent --tasks tasks.json --out both --config quick.toml --jobs 2");
    done(&sprint, "finetune --checkpoint agent --tasks tasks.json#2 --out second --config quick.toml");
    let [one, both] = ["out", "both"].map(|out| of_tasks(&sprint, out));
    for (one, both) in one.iter().zip(&both) {
        assert!(bytes(one, "model.safetensors") == bytes(both, "model.safetensors"));
    }
    let second = of_tasks(&sprint, "second");
    assert_eq!(second.len(), 1);
    assert!(bytes(&one[1], "model.safetensors") == bytes(&second[0], "model.safetensors"));
    assert!(bytes(&one[0], "model.safetensors") != bytes(&sprint.path("agent"), "model.safetensors"));
}

#[test]
fn a_clone_is_finetuned_with_the_critic_of_another_training_and_an_agent_that_is_shown_its_goal_as_it_is() {
    let Some(sprint) = pretrained() else { return };
    let clone = "extends = \"l-bc\"\nhold_out = 3\n[visual_encoder]\nchannels = [4, 4, 4, 8]\n\
                 [policy]\nchannels = [4, 4, 4, 4]\nhidden = [8]\n\
                 [training]\nsteps = 4\nbatch_size = 8\n[validation]\ntasks = 1\nswaps = 0\n";
    let critic = TINY.replace("extends = \"sprint\"", "extends = \"iql-primitive\"");
    let critic = critic.replace("[chaining]\npairs = { pool = 4 }\nbatch_size = 2\n", "");
    let goals = TINY.replace("extends = \"sprint\"", "extends = \"am\"").replace("pairs = { pool = 4 }\n", "");
    let goals = goals.replace("hidden = [8]\n\n[critic]", "hidden = [8]\ngoal_channels = [4, 4, 4, 4]\n\n[critic]");
    for (name, preset) in [("clone", clone), ("critic", &critic), ("goals", &goals)] {
        std::fs::write(sprint.path(&format!("{name}.toml")), preset).unwrap();
        done(&sprint, &format!("pretrain D --preset {name}.toml --visual-from agent --out {name}"));
    }
    let finetune = |checkpoint: &str, more: &str| {
        let line = format!("finetune --checkpoint {checkpoint} --tasks tasks.json#1 --config quick.toml {more}");
        sprint.run(&line)
    };
    let refused = finetune("clone", "--out none");
    assert!(
        refused.stderr.contains("clone has no critic") && refused.stderr.contains("--critic-from"),
        "{}",
        refused.stderr
    );
    let refused = finetune("clone", "--critic-from clone --out none");
    assert!(refused.stderr.contains("clone has no critic either"), "{}", refused.stderr);
    let refused = finetune("clone", "--critic-from goals --out none");
    assert!(refused.stderr.contains("reads or sees otherwise"), "{}", refused.stderr);
    assert!(!sprint.path("none").exists(), "a refused finetuning left something behind");
    for (checkpoint, more) in [("clone", "--critic-from critic --out a"), ("goals", "--out b")] {
        let ended = finetune(checkpoint, more);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    }
    assert!(sprint.read("a/summary.md").contains("(bc)") && sprint.read("b/summary.md").contains("(am)"));
}

#[test]
fn a_finetuning_that_is_killed_and_resumed_ends_with_the_same_bytes_and_opens_while_it_trains() {
    let Some(sprint) = pretrained() else { return };
    let longer = QUICK.replace("steps = 60", "steps = 600").replace("samplers = 2", "samplers = 1");
    std::fs::write(sprint.path("longer.toml"), longer).unwrap();
    let line = |out: &str| format!("finetune --checkpoint agent --tasks tasks.json#1 --config longer.toml --out {out}");
    done(&sprint, &line("whole"));
    let begin = |line: &str| {
        let (out, err) = (std::process::Stdio::null(), std::process::Stdio::null());
        sprint.command(line).stdout(out).stderr(err).spawn().unwrap()
    };
    let reported = || {
        let folder = sprint.path("parts/tasks");
        let folders = std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
        let progress = folders.map(|folder| std::fs::read_to_string(folder.join("training/progress.jsonl")));
        progress.map(|text| text.unwrap_or_default().lines().count()).sum::<usize>()
    };
    let mut killed = begin(&line("parts"));
    wait_while_it_runs(&mut killed, &|| reported() > 6);
    killed.kill().unwrap();
    assert_eq!(killed.wait().unwrap().code(), None);
    let at_kill = reported();
    assert!(at_kill < 30, "it was killed on the way: {at_kill}");
    let again = sprint.run(&line("parts"));
    assert!(again.stderr.contains("holds a finetuning already: use --resume"), "{}", again.stderr);
    let other = sprint.run(&(line("parts") + " --resume --seed 7"));
    assert!(other.stderr.contains("seed = 1 there, seed = 7 here"), "{}", other.stderr);
    let mut resumed = begin(&(line("parts") + " --resume"));
    let folder = of_tasks(&sprint, "parts").remove(0);
    wait_while_it_runs(&mut resumed, &|| reported() > at_kill + 2);
    for _ in 0..3 {
        let line = format!("explore --plain --room kitchen --seed 3 --checkpoint {}", folder.display());
        let opened = sprint.command(&line).stdin(std::process::Stdio::null()).output().unwrap();
        assert!(opened.status.success(), "{}", String::from_utf8_lossy(&opened.stderr));
    }
    assert!(resumed.wait().unwrap().success());
    let whole = of_tasks(&sprint, "whole").remove(0);
    for file in [
        "model.safetensors",
        "config.json",
        "training/replay_maps.bin",
        "training/replay.jsonl",
        "training/state.safetensors",
    ] {
        assert!(bytes(&whole, file) == bytes(&folder, file), "{file} is another");
    }
    for file in ["summary.json", "training/progress.jsonl"] {
        assert_eq!(sprint.read(&format!("whole/{file}")), sprint.read(&format!("parts/{file}")));
    }
}

#[test]
fn what_cannot_be_finetuned_is_refused_before_anything_is_written() {
    let Some(sprint) = pretrained() else { return };
    let refused = |line: &str, what: &str| {
        let ended = sprint.run(&format!("finetune {line} --out none"));
        assert_eq!(ended.code, Some(1), "{line}: {}", ended.stderr);
        assert!(ended.stderr.contains(what), "{line}: {}", ended.stderr);
        assert!(!sprint.path("none").exists(), "{line} left something behind");
    };
    let memory = concat!(env!("CARGO_MANIFEST_DIR"), "/checkpoints/sprint-memory");
    refused(&format!("--checkpoint {memory} --tasks tasks.json"), "is an agent with a memory: finetuning needs");
    refused("--checkpoint D --tasks tasks.json", "holds no checkpoint");
    refused("--checkpoint agent --tasks tasks.json#3", "there is no task \"3\"");
    refused("--checkpoint agent --tasks nowhere.json", "nowhere.json");
    std::fs::write(sprint.path("odd.toml"), "rollouts = 5\n").unwrap();
    refused("--checkpoint agent --tasks tasks.json --config odd.toml", "odd.toml: unknown field `rollouts`");
    let held = sprint.run("finetune --checkpoint agent --tasks tasks.json --out agent");
    assert!(held.stderr.contains("agent holds a checkpoint already"), "{}", held.stderr);
}
