//! What `sprint eval` does when the disk, the clock or the files fail it.

use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::program::{Sprint, encoder_home, wait_for};

#[test]
fn a_full_disk_is_one_clear_error_and_the_run_goes_on_when_there_is_room() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 6);
    let line = "eval --tasks tasks.json --policy random --seeds 7 --jobs 1 --out";
    assert_eq!(sprint.run(&format!("{line} whole")).code, Some(0));
    // A limit on the size of files stands in for the disk: it needs no root, and a write ends in the middle as well.
    let size = std::fs::metadata(sprint.path("whole/episodes.jsonl")).unwrap().len();
    let blocks = size / 2 / 1024 + 1;
    let program = assert_cmd::cargo::cargo_bin("sprint");
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec {} {line} full", program.display());
    let mut command = std::process::Command::new("bash");
    command.args(["-c", &script]).current_dir(sprint.path(".")).env("SPRINT_HOME", sprint.path("home"));
    let full = command.output().unwrap();
    let said = String::from_utf8_lossy(&full.stderr).into_owned();
    assert_eq!(full.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot write full/") && !said.contains("panicked"), "{said}");
    assert_eq!(sprint.run(&format!("{line} full")).code, Some(0));
    assert_eq!(sprint.read("full/episodes.jsonl"), sprint.read("whole/episodes.jsonl"));
    assert_eq!(sprint.read("full/summary.json"), sprint.read("whole/summary.json"));
}

#[test]
fn a_disk_without_any_room_is_named() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 2);
    let disk = sprint.path("disk");
    std::fs::create_dir(&disk).unwrap();
    let mounted = std::process::Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=8k,nr_inodes=40", "tmpfs"])
        .arg(&disk)
        .output();
    if !mounted.is_ok_and(|mounted| mounted.status.success()) {
        eprintln!("skipped: mounting a small disk needs root");
        return;
    }
    let ended = sprint.run("eval --tasks tasks.json --policy random --out disk/run");
    let unmounted = std::process::Command::new("umount").arg(&disk).status().unwrap();
    assert!(unmounted.success());
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("disk/run") && ended.stderr.contains("No space left"), "{}", ended.stderr);
}

#[test]
fn a_folder_that_cannot_be_written_to_is_named() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 1);
    // Not even root writes here.
    let ended = sprint.run("eval --tasks tasks.json --policy random --out /proc/sprint-run");
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr.contains("/proc/sprint-run"), "{}", ended.stderr);
}

#[test]
fn a_run_in_a_folder_that_became_read_only_is_refused_and_stays_as_it_is() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 2);
    let disk = sprint.path("disk");
    std::fs::create_dir(&disk).unwrap();
    let mount = |options: &str| {
        let mut mount = std::process::Command::new("mount");
        mount
            .args(["-t", "tmpfs", "-o", options, "tmpfs"])
            .arg(&disk)
            .output()
            .is_ok_and(|ended| ended.status.success())
    };
    if !mount("size=4m") {
        eprintln!("skipped: only a file system is read-only to root, and mounting one needs root");
        return;
    }
    let line = "eval --tasks tasks.json --policy random --out disk/run";
    let first = sprint.run(line).code;
    let whole = sprint.read("disk/run/episodes.jsonl");
    let remounted = mount("remount,ro");
    let ended = sprint.run(&format!("{line} --json"));
    let after = sprint.read("disk/run/episodes.jsonl");
    assert!(std::process::Command::new("umount").arg(&disk).status().unwrap().success());
    assert_eq!((first, remounted, ended.code), (Some(0), true, Some(1)), "{}", ended.stderr);
    assert!(ended.stderr.contains("disk/run") && ended.stderr.contains("Read-only"), "{}", ended.stderr);
    assert_eq!(after, whole);
}

#[test]
fn no_result_depends_on_the_clock() {
    // The wall clock may jump: it names folders, stamps the events of trainings and messages to policy servers, and tells which
    // run or session is the newest; nothing else.
    let mut found = Vec::new();
    let mut open = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
        } else if std::fs::read_to_string(&path).is_ok_and(|text| text.contains("SystemTime")) {
            found.push(path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display().to_string());
        }
    }
    found.sort();
    let known = [
        "src/agent/served/dialogue.rs",
        "src/cli/eval.rs",
        "src/explore/exploration/save.rs",
        "src/explore/remote/save.rs",
        "src/explore/session_file.rs",
        "src/explore/start_list.rs",
        "src/train/tensorboard.rs",
    ];
    assert_eq!(found, known);
}

#[test]
fn every_file_is_opened_for_reading_in_the_one_place_that_does_not_wait_for_a_pipe() {
    let mut strays = Vec::new();
    let mut open = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        // A file of tests, and the tests below the code.
        let code = if path.ends_with("tests.rs") { "" } else { text.split(" tests {").next().unwrap() };
        let opens = ["fs::read(", "fs::read_to_string(", "File::open(", "OpenOptions::new()"];
        if opens.iter().any(|call| code.contains(call)) {
            strays.push(path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display().to_string());
        }
    }
    strays.sort();
    // A folder, a log of the program's own, and what the system says of itself; else tests.
    let known = ["src/cli/logging.rs", "src/data/folder_lock.rs", "src/data/plain_file.rs", "src/nets/device.rs"];
    assert_eq!(strays, known);
}

#[test]
fn a_pipe_or_a_folder_in_place_of_a_file_is_named_and_not_waited_for() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 1);
    assert_eq!(sprint.run("eval --tasks tasks.json --policy random --out run").code, Some(0));
    assert_eq!(sprint.run("collect data --episodes 2").code, Some(0));
    let cases = [
        ("tasks.json", "tasks check tasks.json"),
        ("run/episodes.jsonl", "eval --tasks run/tasks.json --policy random --out run"),
        ("run/manifest.json", "compare run run"),
        ("run/tasks.json", "verify run"),
        ("data/trajectories.jsonl.zst", "replay data"),
        ("data/dataset.json", "replay data"),
        ("data/labels.jsonl", "relabel data --with rules"),
        ("data/annotations/ann.jsonl", "annotate data --agreement"),
        ("data/annotations/ann.jsonl", "annotate data --plain --as ann --length 2"),
    ];
    for (file, line) in cases {
        let (path, kept) = (sprint.path(file), sprint.path("kept"));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let was_there = std::fs::rename(&path, &kept).is_ok();
        for (make, told) in [("mkfifo", "it is a pipe"), ("mkdir", "it is a folder")] {
            assert!(std::process::Command::new(make).arg(&path).status().unwrap().success());
            let mut child = sprint.command(line);
            let child = child.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
            let ended = child.wait_with_output().unwrap();
            let said = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(1), "{line}: {said}");
            assert!(said.contains(told) && said.contains(file), "{line}: {said}");
            std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir(&path)).unwrap();
        }
        if was_there {
            std::fs::rename(&kept, &path).unwrap();
        }
    }
}

#[test]
fn a_run_folder_with_a_link_out_of_it_is_refused() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 1);
    let line = "eval --tasks tasks.json --policy random --out run";
    assert_eq!(sprint.run(line).code, Some(0));
    std::fs::write(sprint.path("diary.txt"), "mine").unwrap();
    std::fs::remove_file(sprint.path("run/episodes.jsonl")).unwrap();
    std::os::unix::fs::symlink(sprint.path("diary.txt"), sprint.path("run/episodes.jsonl")).unwrap();
    let ended = sprint.run(line);
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr.contains("run/episodes.jsonl: a symbolic link"), "{}", ended.stderr);
    std::fs::remove_file(sprint.path("run/episodes.jsonl")).unwrap();
    std::os::unix::fs::symlink(sprint.path("."), sprint.path("run/shards")).unwrap();
    let ended = sprint.run(line);
    assert!(ended.code == Some(1) && ended.stderr.contains("run/shards: a symbolic link"), "{}", ended.stderr);
    assert_eq!(sprint.read("diary.txt"), "mine");
}

#[test]
fn a_task_file_of_a_hundred_megabytes_is_read_or_refused_in_words() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 2);
    let small = sprint.read("tasks.json");
    let padded = small.replacen('{', &format!("{{{}", " ".repeat(100 << 20)), 1);
    std::fs::write(sprint.path("padded.json"), padded).unwrap();
    assert_eq!(sprint.run("eval --tasks padded.json --policy random --out padded").code, Some(0));
    let mut set: Value = serde_json::from_str(&small).unwrap();
    set["tasks"][1]["instruction"] = "take it ".repeat(13 << 20).into();
    std::fs::write(sprint.path("long.json"), set.to_string()).unwrap();
    let said = sprint.refused("long.json");
    assert!(said.contains("tasks[1].instruction") && said.len() < 500, "{said}");
    let hole = std::fs::File::create(sprint.path("hole.json")).unwrap();
    hole.set_len(20 << 30).unwrap();
    assert!(sprint.refused("hole.json").contains("larger than"));
}

#[test]
fn two_processes_do_not_write_one_run() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 4);
    let line = "eval --tasks tasks.json --policy random --seeds 2000 --out run";
    let mut first = sprint.command(line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for(|| sprint.path("run/manifest.json").exists());
    let second = sprint.run(line);
    first.kill().unwrap();
    first.wait().unwrap();
    assert_eq!(second.code, Some(1));
    assert!(second.stderr.contains("another process is writing this run"), "{}", second.stderr);
}

#[test]
fn sigterm_ends_with_130_and_a_valid_partial_result_that_is_continued() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 4);
    let line = "eval --tasks tasks.json --policy random --seeds 2000 --out run";
    let mut child = sprint.command(line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let lines = || std::fs::read_to_string(sprint.path("run/episodes.jsonl")).unwrap_or_default().lines().count();
    wait_for(|| lines() > 2);
    assert!(std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let asked = Instant::now();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(asked.elapsed() < Duration::from_secs(20), "it stops soon");
    let summary: Value = serde_json::from_str(&sprint.read("run/summary.json")).unwrap();
    assert_eq!((&summary["partial"], &summary["episodes"]), (&Value::Bool(true), &Value::from(lines())));
}

#[test]
fn a_checkpoint_that_is_replaced_during_a_run_is_noticed() {
    let sprint = Sprint::new();
    let shipped = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents/clone");
    let Some(home) = encoder_home() else { return };
    sprint.sample("tasks.json", 1, 4);
    std::fs::create_dir(sprint.path("agent")).unwrap();
    for file in ["config.json", "model.safetensors"] {
        std::fs::copy(shipped.join(file), sprint.path("agent").join(file)).unwrap();
    }
    let line = "eval --tasks tasks.json --checkpoint agent --out run --jobs 1";
    let child =
        sprint.command(line).env("SPRINT_HOME", &home).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    // The manifest is written once the agent is loaded.
    wait_for(|| sprint.path("run/tasks.json").exists());
    let config = sprint.read("agent/config.json");
    std::fs::write(sprint.path("agent/config.json"), config + "\n").unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("the checkpoint was replaced while the run was under way"), "{said}");
    let again = sprint.command(line).env("SPRINT_HOME", &home).output().unwrap();
    assert!(String::from_utf8_lossy(&again.stderr).contains("checkpoint_hash"), "the other one does not continue it");
}
