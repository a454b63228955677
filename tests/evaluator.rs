//! `sprint eval` past one undisturbed process: killed, shared out, compared, drawn.

use std::os::unix::process::ExitStatusExt;
use std::time::Duration;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use sprint_explorer::data::schema;
use sprint_explorer::eval::schemas;

use crate::program::Sprint;

/// What a run came to, as far as it must not depend on how it was played.
fn result(sprint: &Sprint, run: &str) -> (Vec<String>, String, String) {
    let read = |file: &str| sprint.read(&format!("{run}/{file}"));
    (sprint.sorted(&format!("{run}/episodes.jsonl")), read("summary.json"), read("manifest.json"))
}

#[test]
fn a_run_that_is_killed_at_twenty_moments_ends_like_one_that_was_not() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 10);
    let line = "eval --tasks tasks.json --policy random --seeds 4 --out";
    assert_eq!(sprint.run(&format!("{line} whole --jobs 1")).code, Some(0));
    let whole = result(&sprint, "whole");
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut killed = 0;
    for attempt in 0..400 {
        let jobs = 1 + attempt % 3;
        let mut child = sprint
            .command(&format!("{line} torn --jobs {jobs}"))
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(rng.random_range(1..120)));
        child.kill().unwrap();
        killed += usize::from(child.wait().unwrap().signal() == Some(9));
        if killed == 20 {
            break;
        }
        // What was not killed in time is begun anew, so that there is something to kill again.
        if sprint.path("torn/summary.json").exists() {
            std::fs::remove_dir_all(sprint.path("torn")).unwrap();
        }
    }
    assert_eq!(killed, 20);
    assert_eq!(sprint.run(&format!("{line} torn")).code, Some(0));
    assert_eq!(result(&sprint, "torn"), whole);
    let left = std::fs::read_dir(sprint.path("torn")).unwrap().filter_map(Result::ok);
    assert!(left.into_iter().all(|entry| !entry.file_name().to_string_lossy().starts_with(".sprint-")));
}

#[test]
fn shares_merge_into_what_one_process_writes() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 7);
    let line = "eval --tasks tasks.json --policy random --seeds 3 --out";
    assert_eq!(sprint.run(&format!("{line} whole")).code, Some(0));
    for shard in ["2/3", "1/3"] {
        assert_eq!(sprint.run(&format!("{line} shared --shard {shard}")).code, Some(0));
    }
    let early = sprint.run("merge shared");
    assert_eq!(early.code, Some(1));
    assert!(early.stderr.contains("missing shares: 3/3"), "{}", early.stderr);
    let slurm = sprint
        .command(&format!("{line} shared --shard slurm"))
        .env("SLURM_ARRAY_TASK_ID", "3")
        .env("SLURM_ARRAY_TASK_COUNT", "3")
        .output()
        .unwrap();
    assert!(slurm.status.success());
    assert_eq!(sprint.run("merge shared").code, Some(0));
    for file in ["manifest.json", "episodes.jsonl", "summary.json", "summary.md", "progress_by_length.svg"] {
        assert_eq!(sprint.read(&format!("shared/{file}")), sprint.read(&format!("whole/{file}")), "{file}");
    }
    assert_eq!(sprint.run("merge shared").code, Some(0), "merging again changes nothing");
    let other = sprint.run("eval --tasks tasks.json --policy random --seeds 2 --out other --shard 3/3");
    assert_eq!(other.code, Some(0));
    let mixed = sprint.run("merge new shared/shards/1-of-3 shared/shards/2-of-3 other/shards/3-of-3");
    assert!(mixed.stderr.contains("seeds: 3, not 2"), "{}", mixed.stderr);
}

#[test]
fn every_file_satisfies_its_schema() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 2, 4);
    let ended = sprint.run(
        "eval --tasks tasks.json --policy random --out a --json --language --from-subtask all --seeds 2 --retries 1",
    );
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(
        sprint.run("eval --tasks tasks.json --policy expert --out b --language --from-subtask all --seeds 2").code,
        Some(0)
    );
    assert_eq!(sprint.run("compare a b b,b --out comparison.json").code, Some(0));
    assert_eq!(sprint.run("eval --tasks tasks.json --policy expert --out c --shard 1/2").code, Some(0));
    let satisfies = |name: &str, text: &str| {
        let document: Value = serde_json::from_str(text).unwrap();
        assert_eq!(schema::faults(&schemas::schema(name).unwrap().to_value(), &document).unwrap(), [], "{name}");
    };
    satisfies("tasks", &sprint.read("tasks.json"));
    satisfies("comparison", &sprint.read("comparison.json"));
    satisfies("manifest", &sprint.read("c/shards/1-of-2/manifest.json"));
    for run in ["a", "b"] {
        satisfies("manifest", &sprint.read(&format!("{run}/manifest.json")));
        satisfies("summary", &sprint.read(&format!("{run}/summary.json")));
        satisfies("tasks", &sprint.read(&format!("{run}/tasks.json")));
        sprint.read(&format!("{run}/episodes.jsonl")).lines().for_each(|line| satisfies("episode", line));
    }
    satisfies("summary", ended.stdout.lines().last().unwrap());
    let progress: Vec<&str> = ended.stderr.lines().filter(|line| line.starts_with('{')).collect();
    assert!(progress.len() > 10);
    progress.into_iter().for_each(|line| satisfies("progress", line));
    let summary: Value = serde_json::from_str(&sprint.read("b/summary.json")).unwrap();
    // 4 tasks, 2 seeds: 5 instruction variants and one later start each; the expert, who reads no words, solves them all.
    assert_eq!(sprint.read("b/episodes.jsonl").lines().count(), 4 * 2 * 6);
    assert_eq!((&summary["episodes"], &summary["success"]), (&Value::from(8), &Value::from(1.0)));
    assert_eq!(summary["instruction_variants"]["empty"]["successes"], 8);
    assert_eq!(summary["start_subtasks"]["1"]["first_subtask"]["completed"], 8);
    let page = sprint.read("b/summary.md");
    assert!(page.contains("| instruction variant") && page.contains("| start subtask"), "{page}");
    assert!(page.contains("Wilson") && page.contains("bootstrap over tasks"), "both methods are named");
    for line in sprint.read("b/episodes.jsonl").lines().filter(|line| line.contains("\"start_subtask\":1")) {
        let episode: Value = serde_json::from_str(line).unwrap();
        let (prefix, steps) = (episode["prefix_steps"].as_u64().unwrap(), episode["steps"].as_u64().unwrap());
        assert_eq!((prefix + steps) as usize, episode["trace"].as_array().unwrap().len());
        assert_eq!(episode["of"], 1);
    }
}

#[test]
fn runs_are_compared_and_gated() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 6);
    assert_eq!(sprint.run("eval --tasks tasks.json --policy expert --out a").code, Some(0));
    assert_eq!(sprint.run("eval --tasks tasks.json --policy random --out b").code, Some(0));
    let same = sprint.run("compare a a --max-regressions 0 --fail-below success=1");
    assert_eq!(same.code, Some(0), "{}", same.stderr);
    let worse = sprint.run("compare a b --max-regressions 0");
    assert_eq!(worse.code, Some(2), "{}", worse.stdout);
    assert!(worse.stdout.contains("sprint open b#1") && worse.stdout.contains("McNemar: p = "), "{}", worse.stdout);
    assert_eq!(sprint.run("compare a b --fail-below success=0.9").code, Some(2));
    assert!(sprint.run("compare a b b").stdout.contains("against a"));
    let joined = sprint.run("compare a,a b,b");
    assert!(joined.stdout.contains("## b and 1 more against a and 1 more\n\n12 pairs"), "{}", joined.stdout);
    assert_eq!(sprint.run("compare a,nothing b").code, Some(1));
    assert_eq!(sprint.run("compare a nothing").code, Some(1));
    assert_eq!(sprint.run("report b --frames 3").code, Some(0));
    let page = sprint.read("b/report.html");
    assert!(page.contains("data:image/png") && !page.contains("{{") && !page.contains("src=\"http"), "self-contained");
    assert!(page.contains("\"png\":\"iVBOR"), "with frames");
}

#[test]
fn a_slurm_array_plays_and_merges_a_run() {
    let root = env!("CARGO_MANIFEST_DIR");
    let program = assert_cmd::cargo::cargo_bin("sprint");
    let ended = std::process::Command::new(format!("{root}/tests/slurm.sh"))
        .arg(program)
        .arg(format!("{root}/assets/slurm/eval.sbatch"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ended.stdout).into_owned() + &String::from_utf8_lossy(&ended.stderr);
    eprintln!("{said}");
    if ended.status.code() == Some(77) {
        super::needed::missing(super::needed::Need::Slurm, "a part of Slurm");
        return;
    }
    assert!(ended.status.success(), "{said}");
}
