//! `sprint tasks` and `sprint eval` from the command line: what they write, and how they end.

use serde_json::Value;

use crate::needed;
use crate::program::{Sprint, encoder_home};

#[test]
fn the_expert_completes_every_sampled_task() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 2, 20);
    let ended = sprint.run("eval --tasks tasks.json --policy expert --out run --json --fail-below success=1 --jobs 2");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let summary: Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
    assert_eq!(summary["episodes"], 20);
    assert_eq!(summary["success"], 1.0);
    assert_eq!(summary["errors"], 0);
    assert_eq!(summary["completed_subtasks"]["mean"], 2.0);
    assert_eq!(summary["progress_by_length"]["2"], 1.0);
    let on_disk: Value = serde_json::from_str(&sprint.read("run/summary.json")).unwrap();
    assert_eq!(on_disk, summary);
    let manifest: Value = serde_json::from_str(&sprint.read("run/manifest.json")).unwrap();
    assert_eq!(manifest["format_version"], 2);
    assert!(sprint.read("run/summary.md").contains("| success "));
    assert!(sprint.read("run/summary.csv").starts_with("group,measure,"));
    for line in sprint.read("run/episodes.jsonl").lines() {
        let episode: Value = serde_json::from_str(line).unwrap();
        let trace = episode["trace"].as_array().unwrap();
        assert_eq!(episode["steps"], trace.len());
        assert_eq!(trace.last().unwrap()["subtask"], 1, "the last action completes the last subtask");
        assert!(episode["start_hash"].as_str().unwrap().len() == 16 && episode["error"].is_null());
    }
    let check = sprint.run("tasks check tasks.json");
    assert_eq!((check.code, check.stdout.contains("20 solved")), (Some(0), true), "{}", check.stdout);
}

#[test]
fn the_result_is_the_same_for_any_number_of_jobs() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 6);
    for jobs in [1, 2] {
        let ended =
            sprint.run(&format!("eval --tasks tasks.json --policy random --seeds 2 --out run{jobs} --jobs {jobs}"));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    }
    for file in ["manifest.json", "episodes.jsonl", "summary.json", "summary.md", "summary.csv"] {
        assert_eq!(sprint.read(&format!("run1/{file}")), sprint.read(&format!("run2/{file}")), "{file}");
    }
    assert_eq!(sprint.read("run1/episodes.jsonl").lines().count(), 12);
}

#[test]
fn sampling_is_the_same_for_the_same_seed() {
    let sprint = Sprint::new();
    sprint.sample("a.json", 1, 5);
    sprint.sample("b.json", 1, 5);
    assert_eq!(sprint.read("a.json").replace("\"a\"", "\"b\""), sprint.read("b.json"));
    let ended = sprint.run("tasks sample a.json --scenes generated");
    assert_eq!(ended.code, Some(1), "a file that is there is not replaced");
    assert!(ended.stderr.contains("a.json") && ended.stderr.contains("--force"), "{}", ended.stderr);
    let shown = sprint.run("tasks show a.json#2");
    assert!(
        shown.stdout.contains("instruction")
            && shown.stdout.contains("subtask 1")
            && !shown.stdout.contains("subtask 0"),
        "{}",
        shown.stdout
    );
    let listed = sprint.run("tasks show a.json").stdout;
    assert_eq!(listed.lines().count(), 5);
    assert!(listed.lines().nth(1).unwrap().trim_start().starts_with("2 "), "counted as #2 counts: {listed}");
    assert_eq!(sprint.run("tasks show a.json#99").code, Some(1));
}

#[test]
fn a_missed_threshold_ends_with_2() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 3, 2);
    let ended = sprint.run("eval --tasks tasks.json --policy random --out run --fail-below success=0.99");
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("success=0.99 was missed"), "{}", ended.stderr);
    let ended = sprint.run("eval --tasks tasks.json --policy random --fail-below succes=1");
    assert_eq!(ended.code, Some(2), "bad usage");
    assert!(ended.stderr.contains("succes"), "{}", ended.stderr);
}

#[test]
fn every_kind_of_run_is_verified_opened_by_its_number_and_exported() {
    let sprint = Sprint::new();
    sprint.sample("sampled.json", 2, 3);
    let set: Value = serde_json::from_str(&sprint.read("sampled.json")).unwrap();
    std::fs::write(sprint.path("typed.json"), serde_json::to_string(&set).unwrap()).unwrap();
    for (number, options) in [
        "--policy expert",
        "--policy random --limit 2",
        "--policy random --seeds 2 --language",
        "--policy random --from-subtask all",
        "--policy expert --step-by-step",
    ]
    .into_iter()
    .enumerate()
    {
        let run = format!("run{number}");
        assert_eq!(sprint.run(&format!("eval --tasks typed.json --out {run} {options}")).code, Some(0), "{options}");
        let verified = sprint.run(&format!("verify {run}"));
        assert_eq!(verified.code, Some(0), "{options}: {}{}", verified.stdout, verified.stderr);
        let last = sprint.read(&format!("{run}/episodes.jsonl")).lines().count();
        let exported = sprint.run(&format!("export {run}#{last} {run}.txt"));
        assert_eq!(exported.code, Some(0), "{options}: {}", exported.stderr);
    }
    if let Some(home) = encoder_home() {
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/agents/clone");
        for line in [
            format!("eval --tasks typed.json --checkpoint {shipped} --sample --limit 1 --out drawn"),
            format!("verify drawn --checkpoint {shipped}"),
        ] {
            let ended = sprint.command(&line).env("SPRINT_HOME", &home).output().unwrap();
            assert_eq!(ended.status.code(), Some(0), "{line}: {ended:?}");
        }
    }
    let other = sprint.run("verify run0 --tasks sampled.json");
    assert!(other.stderr.contains("is not what run0 was made from"), "{}", other.stderr);
}

#[test]
fn whoever_reads_may_leave_and_the_verdict_is_the_same() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 3, 2);
    let unread = |line: &str| {
        let (out, err) = (std::process::Stdio::piped(), std::process::Stdio::piped());
        let mut child = sprint.command(line).stdout(out).stderr(err).spawn().unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        child.wait().unwrap().code()
    };
    let line = "eval --tasks tasks.json --policy random --fail-below success=0.99 --out";
    assert_eq!(unread(&format!("{line} run")), Some(2));
    assert_eq!(unread("compare run run --fail-below success=0.99"), Some(2));
    assert_eq!(unread("verify run"), Some(0));
    assert_eq!(unread("collect D --episodes 40 --lengths 1 --annotations 1"), Some(0));
    assert!(sprint.path("D/dataset.json").exists());
    let episodes = sprint.read("run/episodes.jsonl");
    std::fs::write(sprint.path("run/episodes.jsonl"), episodes.lines().next().unwrap().to_owned() + "\n").unwrap();
    assert_eq!(unread("verify run"), Some(3));
    let said = sprint.run("verify run").stdout;
    assert!(said.contains("the summary counts 2, there are 1") && said.ends_with("different\n"), "{said}");
}

#[test]
fn an_interrupted_run_ends_with_130_and_a_partial_summary() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 3);
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("sprint"));
    command.current_dir(sprint.path(".")).env("SPRINT_HOME", sprint.path("home"));
    command.args("eval --tasks tasks.json --policy random --seeds 100000 --out run".split_whitespace());
    let mut child = command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn().unwrap();
    let begun = || std::fs::metadata(sprint.path("run/episodes.jsonl")).is_ok_and(|file| file.len() > 0);
    let patience = std::time::Instant::now();
    while !begun() && patience.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let told = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let summary: Value = serde_json::from_str(&sprint.read("run/summary.json")).unwrap();
    let lines = sprint.read("run/episodes.jsonl").lines().count();
    assert_eq!((&summary["partial"], &summary["episodes"]), (&Value::Bool(true), &Value::from(lines)));
    assert!(lines > 0);
}

#[test]
fn a_run_is_continued_and_another_is_refused() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 4);
    let line = "eval --tasks tasks.json --policy random --out run --seeds 2";
    assert_eq!(sprint.run(line).code, Some(0));
    let whole = sprint.read("run/episodes.jsonl");
    let (summary, lines) = (sprint.read("run/summary.json"), whole.split_inclusive('\n').collect::<Vec<_>>());
    std::fs::write(sprint.path("run/episodes.jsonl"), lines[..3].concat() + &lines[3][..20]).unwrap();
    assert_eq!(sprint.run(line).code, Some(0));
    assert_eq!(sprint.read("run/episodes.jsonl"), whole);
    assert_eq!(sprint.read("run/summary.json"), summary);
    let other = sprint.run("eval --tasks tasks.json --policy random --out run --seeds 3");
    assert_eq!(other.code, Some(1));
    assert!(other.stderr.contains("seeds: 2, not 3"), "{}", other.stderr);
}

#[test]
fn without_a_folder_one_is_made_under_runs() {
    let sprint = Sprint::new();
    sprint.sample("my-tasks.json", 1, 1);
    assert_eq!(sprint.run("eval --tasks my-tasks.json --policy random").code, Some(0));
    let mut runs = std::fs::read_dir(sprint.path("runs")).unwrap();
    let name = runs.next().unwrap().unwrap().file_name().into_string().unwrap();
    assert!(name.starts_with("my-tasks-random-2"), "{name}");
}

#[test]
fn a_bad_task_file_is_one_clear_error() {
    let sprint = Sprint::new();
    sprint.sample("good.json", 1, 2);
    let good = sprint.read("good.json");
    std::fs::write(sprint.path("torn.json"), &good[..good.len() / 2]).unwrap();
    assert!(sprint.refused("torn.json").contains("cut off"));
    std::fs::write(sprint.path("binary.json"), b"\x7fELF\0\0").unwrap();
    assert!(sprint.refused("binary.json").contains("not JSON"));
    std::fs::write(sprint.path("other.json"), r#"{"name": "package", "version": "1.0"}"#).unwrap();
    assert!(sprint.refused("other.json").contains("format_version"));
    assert!(sprint.refused("absent.json").contains("cannot read"));
    let task = |value: &mut Value, field: &str, new: Value| value["tasks"][1][field] = new;
    let said = sprint.complaint("good.json", |set| set["tasks"][1]["roles"][0]["class"] = "Dragon".into());
    assert!(said.contains("tasks[1].roles[0].class") && said.contains("Dragon"), "{said}");
    let said = sprint.complaint("good.json", |set| task(set, "scene", serde_json::json!({"named": "FloorPlan999"})));
    assert!(said.contains("scenes"), "{said}");
    let said = sprint.complaint("good.json", |set| {
        set["scenes"] = "plans".into();
        task(set, "scene", serde_json::json!({"named": "FloorPlan999"}));
    });
    assert!(said.contains("tasks[1].scene") && said.contains("FloorPlan999"), "{said}");
    let said = sprint.complaint("good.json", |set| set["format_version"] = 9.into());
    assert!(said.contains("format_version: 9"), "{said}");
    let said = sprint.complaint("good.json", |set| task(set, "instruction", "a".repeat(10_000).into()));
    assert!(said.contains("tasks[1].instruction") && said.len() < 500, "{said}");
    let said = sprint.complaint("good.json", |set| task(set, "instruction", "take\u{7} it".into()));
    assert!(said.contains("tasks[1].instruction") && said.contains("control"), "{said}");
    let said = sprint.complaint("good.json", |set| set["tasks"] = serde_json::json!([]));
    assert!(said.contains("empty"), "{said}");
    let said = sprint.complaint("good.json", |set| set["tasks"][1]["subtasks"][0]["object"] = 200.into());
    assert!(said.contains("tasks[1].subtasks[0].object"), "{said}");
    let world =
        serde_json::json!({"agent": {"cell": [0, 0], "heading": "north", "horizon": 0}, "objects": [], "fixtures": []});
    let said = sprint.complaint("good.json", |set| task(set, "start", world));
    assert!(said.contains("tasks[1].start.fixtures"), "{said}");
}

#[test]
fn the_pages_task_by_hand_is_sound_and_the_expert_solves_it() {
    let page = include_str!("../assets/docs/evaluation.md");
    let (_, after) = page.split_once("by number, from 0:\n\n  ```json\n").expect("the page has a task by hand");
    let (task, _) = after.split_once("```").unwrap();
    let sprint = Sprint::new();
    std::fs::write(sprint.path("mine.json"), task).unwrap();
    let check = sprint.run("tasks check mine.json");
    assert_eq!((check.code, check.stdout.as_str()), (Some(0), "mine.json: 1 task, 1 solved by the expert\n"));
    let ended = sprint.run("eval --tasks mine.json --policy expert --out run --json --fail-below success=1");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let summary: Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
    assert_eq!((&summary["task_set"], &summary["completed_subtasks"]["mean"]), (&"mine".into(), &2.0.into()));
}

#[test]
fn the_expert_completes_alfreds_official_sets() {
    let Some(source) = needed::alfred() else { return };
    let sprint = Sprint::new();
    let imported = sprint.run(&format!("import alfred {} D", source.display()));
    assert_eq!(imported.code, Some(0), "{}", imported.stderr);
    for set in ["eval_100", "eval_chain"] {
        let ended = sprint.run(&format!("eval --tasks D/tasks/{set}.json --policy expert --out {set} --json"));
        let summary: Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
        assert!(summary["success"].as_f64().unwrap() >= 0.95, "{set}: {summary}");
    }
}
