//! The whole import: read a checkout, build scenes, resolve trajectories, write the dataset.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::bail;
use rayon::prelude::*;

use super::checkout::{find, read};
use super::layout::FloorPlanLayout;
use super::recording::{RecordedStart, Recording};
use super::tasks::{self, OFFICIAL};
use super::{clearing, parents, scenes, trajectories};
use crate::data::dataset::{Counts, DatasetManifest, DatasetWriter, Skipped};
use crate::domain::{Scene, Trajectory};
use crate::house::validate;

/// What can be chosen about an import.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// A folder with the authors' lists of the official task sets.
    pub(crate) eval_lists: Option<PathBuf>,
}

/// How far an import has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImportProgress {
    /// Files read, of how many.
    Reading(u64, u64),
    /// Scenes built, of how many.
    Building(u64, u64),
    /// Trajectories written, of how many.
    Writing(u64, u64),
}

/// The result for one official task set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SetBuilt {
    /// As reports call it.
    pub(crate) name: &'static str,
    /// How many tasks it has, or why it was left out.
    pub(crate) tasks: Result<usize, String>,
}

/// The result of an import.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImportSummary {
    /// What was written.
    pub(crate) manifest: DatasetManifest,
    /// The official task sets.
    pub(crate) sets: Vec<SetBuilt>,
}

/// Imports the ALFRED checkout `source` into the dataset folder `out`.
///
/// # Errors
/// When `source` is no checkout, no file of it can be used, or `out` cannot be written. Single files that cannot be used are
/// listed in the summary instead.
pub fn import(
    source: &Path,
    out: &Path,
    options: &ImportOptions,
    progress: &(dyn Fn(ImportProgress) + Sync),
) -> anyhow::Result<ImportSummary> {
    if let Some(folder) = options.eval_lists.as_deref().filter(|folder| !folder.is_dir()) {
        bail!("{} is no folder with the authors' lists", folder.display());
    }
    let (files, absent) = find(source)?;
    let entries = tasks::entries(options.eval_lists.as_deref())?;
    let mut writer = DatasetWriter::new(out)?;
    let (recordings, settings, mut skipped) =
        read(&files, &|done| progress(ImportProgress::Reading(done, files.len() as u64)));
    skipped.extend(absent);
    if recordings.is_empty() {
        let why = skipped.first().map(|skip| format!("; {}: {}", skip.file, skip.reason)).unwrap_or_default();
        bail!("{}: none of {} files could be used{why}", source.display(), files.len());
    }
    let built = build_all(source, &recordings, &settings, progress);
    let mut plans = Vec::new();
    let mut found = Vec::new();
    for (scene, resolved, bad) in built {
        plans.extend(scene);
        found.extend(resolved);
        skipped.extend(bad);
    }
    skipped.sort_by(|a, b| a.file.cmp(&b.file));
    found.sort_by(|a, b| (split_rank(&a.split), &a.split, &a.id).cmp(&(split_rank(&b.split), &b.split, &b.id)));
    for scene in &plans {
        writer.scene(scene)?;
    }
    for (number, trajectory) in found.iter().enumerate() {
        writer.trajectory(trajectory)?;
        progress(ImportProgress::Writing(number as u64 + 1, found.len() as u64));
    }
    let by_id: BTreeMap<&str, &Trajectory> = found.iter().map(|trajectory| (&*trajectory.id, trajectory)).collect();
    let by_name: BTreeMap<&str, &Scene> = plans.iter().map(|scene| (&*scene.name, scene)).collect();
    let mut sets = Vec::new();
    for (set, entries) in OFFICIAL.into_iter().zip(&entries) {
        let tasks = tasks::build(set, entries, &by_id, &by_name);
        if let Ok(built) = &tasks {
            writer.tasks(set.file, built)?;
        }
        sets.push(SetBuilt { name: set.name, tasks: tasks.map(|set| set.tasks.len()) });
    }
    let chain = tasks::indexed(OFFICIAL[1]);
    let held_out = chain.iter().map(tasks::OfficialTask::trajectory).filter(|id| by_id.contains_key(id));
    let held_out: Vec<String> = held_out.map(str::to_owned).collect();
    let manifest = DatasetManifest {
        format_version: DatasetManifest::FORMAT,
        source: "alfred".to_owned(),
        counts: counts(&found, &held_out),
        scenes: plans.len() as u64,
        held_out,
        skipped,
    };
    writer.finish(&manifest)?;
    Ok(ImportSummary { manifest, sets })
}

/// Order of splits in the dataset.
fn split_rank(split: &str) -> usize {
    ["train", "valid_seen", "valid_unseen"].iter().position(|&known| known == split).unwrap_or(3)
}

type BuiltScene = (Option<Scene>, Vec<Trajectory>, Vec<Skipped>);

/// Builds every scene and resolves its recordings, on all cores.
fn build_all(
    source: &Path,
    recordings: &[Recording],
    settings: &[RecordedStart],
    progress: &(dyn Fn(ImportProgress) + Sync),
) -> Vec<BuiltScene> {
    let mut plans: BTreeMap<&str, (Vec<&Recording>, Vec<&RecordedStart>)> = BTreeMap::new();
    for recording in recordings {
        let plan = plans.entry(&recording.setting.floor_plan).or_default();
        plan.0.push(recording);
        plan.1.push(&recording.setting);
    }
    for setting in settings {
        plans.entry(&setting.floor_plan).or_default().1.push(setting);
    }
    let total = plans.len() as u64;
    let done = AtomicU64::new(0);
    let folder = source.join("gen/layouts");
    let plans: Vec<_> = plans.into_iter().collect();
    plans
        .par_iter()
        .map(|(name, (recordings, settings))| {
            let built = build_one(&folder, name, recordings, settings);
            progress(ImportProgress::Building(done.fetch_add(1, Ordering::Relaxed) + 1, total));
            built
        })
        .collect()
}

fn build_one(folder: &Path, name: &str, recordings: &[&Recording], settings: &[&RecordedStart]) -> BuiltScene {
    let mut skipped = Vec::new();
    let layout = FloorPlanLayout::read(folder, name).unwrap_or_else(|error| {
        skipped.push(Skipped { file: format!("gen/layouts/{name}"), reason: format!("{error:#}") });
        FloorPlanLayout::default()
    });
    let skip = |recording: &&Recording, reason: String| Skipped {
        file: format!("data/json_2.1.0/{}/{}/traj_data.json", recording.split, recording.id),
        reason,
    };
    let Some(room) = settings.first().map(|setting| setting.room) else { return (None, vec![], skipped) };
    let checked = scenes::build(name, room, &layout, recordings, settings).and_then(|built| {
        let fits = validate::scene(&built.scene).map_err(|misfit| format!("{name} cannot be built of it: {misfit}"));
        fits.map(|()| built)
    });
    let built = match checked {
        Ok(built) => built,
        Err(reason) => {
            skipped.extend(recordings.iter().map(|recording| skip(recording, reason.clone())));
            return (None, vec![], skipped);
        }
    };
    let mut resolved = Vec::new();
    for recording in recordings {
        let parents = parents::parents(recording, &built.inventory, &built.recorded, &built.scene.fixtures);
        let trajectory = trajectories::resolve(recording, &built.scene, &built.inventory, &parents);
        let checked = trajectory.and_then(|trajectory| {
            let fits = validate::world(&built.scene, &trajectory.start).map_err(|misfit| format!("scene.{misfit}"));
            fits.map(|()| trajectory)
        });
        match checked {
            Ok(trajectory) => resolved.push(trajectory),
            Err(reason) => skipped.push(skip(recording, reason)),
        }
    }
    let mut scene = built.scene;
    clearing::clear(&mut scene, &built.inventory, &resolved.iter().collect::<Vec<_>>());
    (Some(scene), resolved, skipped)
}

/// How much of each split there is.
fn counts(trajectories: &[Trajectory], held_out: &[String]) -> BTreeMap<String, Counts> {
    let mut counts: BTreeMap<String, Counts> = BTreeMap::new();
    for trajectory in trajectories {
        let count = counts.entry(trajectory.split.clone()).or_default();
        let skills = trajectory.skills.len() as u64;
        let spans = skills * (skills - 1) / 2;
        let whole = u64::from(skills > 1 && held_out.contains(&trajectory.id));
        count.trajectories += 1;
        for annotation in &trajectory.annotations {
            count.annotated_primitives += skills;
            count.spans += spans;
            if annotation.steps.len() as u64 == skills {
                count.aligned_primitives += skills;
                count.spans_after_holdout += spans - whole;
            }
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::{Value, json};

    use super::super::checkout::parse_recording;
    use super::*;
    use crate::domain::ActionType;
    use crate::domain::world::{Instance, Parent};

    /// A recording of our own in ALFRED's format: walk, take the mug from the counter, put it into the sink.
    fn recording() -> Value {
        serde_json::from_str(include_str!("../../../tests/fuzz/traj_data.json")).unwrap()
    }

    /// A checkout with these files in its train split.
    fn checkout(files: &[(&str, String)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (trial, text) in files {
            let trial = folder.path().join("data/json_2.1.0/train/task").join(trial);
            std::fs::create_dir_all(&trial).unwrap();
            std::fs::write(trial.join("traj_data.json"), text).unwrap();
        }
        folder
    }

    fn import_of(files: &[(&str, String)]) -> (ImportSummary, tempfile::TempDir) {
        let source = checkout(files);
        let out = tempfile::tempdir().unwrap();
        (import(source.path(), out.path(), &ImportOptions::default(), &|_| {}).unwrap(), out)
    }

    #[test]
    fn a_published_file_with_masks_and_images_becomes_a_scene_and_a_trajectory_that_replays() {
        let (summary, out) = import_of(&[("trial_1", recording().to_string())]);
        assert_eq!(summary.manifest.skipped, []);
        let counts = summary.manifest.counts["train"];
        assert_eq!((counts.trajectories, counts.annotated_primitives, counts.spans), (1, 2, 1));
        let dataset = crate::data::Dataset::open(out.path()).unwrap();
        let scene = dataset.scene("FloorPlan1").unwrap();
        let trajectory = dataset.trajectories().unwrap().next().unwrap().unwrap();
        assert_eq!(trajectory.skill_starts, [0, 3]);
        assert_eq!(trajectory.annotations[0].steps, ["Take the mug.", "Put it in the sink."]);
        assert_eq!(trajectory.boxes, [[100, 100, 141, 160], [150, 100, 300, 300]]);
        let counter = scene.fixtures.iter().position(|fixture| fixture.class.name() == "CounterTop").unwrap();
        let mut world = trajectory.start.clone();
        assert_eq!(world.objects.len(), 1, "things of unknown classes are left out");
        assert_eq!(world.objects[0].parent, Parent::In(Instance::Fixture(counter as u16)));
        for action in trajectory.actions {
            assert!(crate::house::rules::apply(&scene, &mut world, action).is_done(), "{action:?}");
        }
        let sink = scene.fixtures.iter().find(|fixture| fixture.class.name() == "Sink").unwrap();
        assert_eq!(<[i32; 3]>::from(sink.pivot), [500, 800, 1025], "the basin's own place, not its sink's");
    }

    #[test]
    fn a_file_that_cannot_be_used_is_named_with_its_field_and_the_rest_is_imported() {
        let good = recording();
        let change = |pointer: &str, value: Value| {
            let mut data = good.clone();
            *data.pointer_mut(pointer).unwrap() = value;
            data.to_string()
        };
        let mut without_plan = good.clone();
        without_plan.as_object_mut().unwrap().remove("plan");
        let text = good.to_string();
        let cases = [
            ("truncated", text[..text.len() / 2].to_owned(), "EOF"),
            ("without_plan", without_plan.to_string(), "plan"),
            ("far", change("/scene/object_poses/0/position/x", json!(1e30)), "object_poses[0].position"),
            ("off_grid", change("/scene/init_action/x", json!(0.1)), "init_action.x"),
            ("askew", change("/scene/init_action/rotation", json!(33)), "init_action.rotation"),
            ("plan_number", change("/scene/floor_plan", json!("FloorPlan9000")), "scene.floor_plan"),
            ("huge", change("/plan/high_pddl/0/high_idx", json!(18_446_744_073_709_551_615_u64)), "high_idx"),
            (
                "action",
                change("/plan/low_actions/0/api_action/action", json!("Fly")),
                "low_actions[0].api_action.action",
            ),
            ("thing", change("/plan/low_actions/2/api_action/objectId", json!("Dragon|1|2|3")), "low_actions[2]"),
            (
                "gone",
                change("/plan/low_actions/2/api_action/objectId", json!("Mug|+01.00|+01.00|+01.00")),
                "low_actions[2]",
            ),
            ("type", change("/task_type", json!("dance")), "task_type"),
        ];
        let mut files = vec![("good", text.clone())];
        files.extend(cases.iter().map(|(name, text, _)| (*name, text.clone())));
        let (summary, _) = import_of(&files);
        assert_eq!(summary.manifest.counts["train"].trajectories, 1);
        assert_eq!(summary.manifest.skipped.len(), cases.len());
        for (name, _, field) in cases {
            let file = format!("data/json_2.1.0/train/task/{name}/traj_data.json");
            let skip = summary.manifest.skipped.iter().find(|skip| skip.file == file).unwrap();
            assert!(skip.reason.contains(field), "{name}: {}", skip.reason);
        }
    }

    #[test]
    fn what_is_no_checkout_or_holds_nothing_of_use_is_one_clear_error_and_writes_no_dataset() {
        let out = tempfile::tempdir().unwrap();
        let empty = tempfile::tempdir().unwrap();
        let run =
            |source: &Path| import(source, out.path(), &ImportOptions::default(), &|_| {}).unwrap_err().to_string();
        assert!(run(empty.path()).contains("json_2.1.0"));
        let broken = checkout(&[("trial_1", "{".to_owned())]);
        assert!(run(broken.path()).contains("traj_data.json"));
        assert!(!out.path().join("dataset.json").exists());
    }

    #[test]
    fn what_stands_where_a_file_should_be_is_named_and_counted() {
        let source = checkout(&[("trial_1", recording().to_string())]);
        let task = source.path().join("data/json_2.1.0/train/task");
        for trial in ["trial_link", "trial_folder", "trial_pipe", "trial_empty"] {
            std::fs::create_dir_all(task.join(trial)).unwrap();
        }
        std::os::unix::fs::symlink("gone.json", task.join("trial_link/traj_data.json")).unwrap();
        std::os::unix::fs::symlink("gone", task.join("trial_gone")).unwrap();
        std::fs::create_dir(task.join("trial_folder/traj_data.json")).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(task.join("trial_pipe/traj_data.json")).unwrap();
        let layouts = source.path().join("gen/layouts");
        std::fs::create_dir_all(&layouts).unwrap();
        std::os::unix::fs::symlink("gone.npy", layouts.join("FloorPlan1-layout.npy")).unwrap();
        let out = tempfile::tempdir().unwrap();
        let summary = import(source.path(), out.path(), &ImportOptions::default(), &|_| {}).unwrap();
        assert_eq!(summary.manifest.counts["train"].trajectories, 1);
        let skipped: Vec<(&str, &str)> =
            summary.manifest.skipped.iter().map(|skip| (skip.file.as_str(), skip.reason.as_str())).collect();
        for (file, reason) in [
            ("task/trial_link/traj_data.json", "a link"),
            ("task/trial_folder/traj_data.json", "a folder"),
            ("task/trial_pipe/traj_data.json", "a pipe"),
            ("task/trial_gone", "a link"),
            ("task/trial_empty", "no traj_data.json"),
            ("gen/layouts/FloorPlan1", "a link"),
        ] {
            let is_it = |(found, why): &&(&str, &str)| found.ends_with(file) && why.contains(reason);
            assert!(skipped.iter().any(|skip| is_it(&skip)), "{file} in {skipped:?}");
        }
        assert_eq!(skipped.len(), 6, "{skipped:?}");
    }

    #[test]
    fn a_checkout_without_the_splits_folders_is_refused_and_a_file_outside_of_them_is_named() {
        let source = tempfile::tempdir().unwrap();
        let put = |trial: &str| {
            let trial = source.path().join("data/json_2.1.0").join(trial);
            std::fs::create_dir_all(&trial).unwrap();
            std::fs::write(trial.join("traj_data.json"), recording().to_string()).unwrap();
        };
        let out = tempfile::tempdir().unwrap();
        let run = || import(source.path(), out.path(), &ImportOptions::default(), &|_| {});
        put("task/trial_1");
        let error = run().unwrap_err().to_string();
        assert!(error.contains("valid_unseen") && error.contains("task/trial_1/traj_data.json"), "{error}");
        assert!(!out.path().join("dataset.json").exists());
        put("train/task/trial_1");
        put("own_split/task/trial_1");
        let manifest = run().unwrap().manifest;
        assert_eq!(manifest.counts.keys().collect::<Vec<_>>(), ["own_split", "train"]);
        assert_eq!(manifest.skipped.len(), 1, "{:?}", manifest.skipped);
    }

    #[test]
    fn what_follows_the_json_is_refused_and_a_byte_order_mark_before_it_is_passed_over() {
        let text = recording().to_string();
        let files = [
            ("trial_good", format!("\u{feff}{text}\n")),
            ("trial_junk", format!("{text} and more")),
            ("trial_nul", format!("{text}\0\0")),
            ("trial_twice", format!("{text}{text}")),
        ];
        let skipped = import_of(&files).0.manifest.skipped;
        assert_eq!(skipped.len(), 3, "{skipped:?}");
        assert!(skipped.iter().all(|skip| skip.reason.contains("something follows the JSON")), "{skipped:?}");
    }

    #[test]
    fn what_annotators_wrote_is_imported_as_text_that_a_task_may_say() {
        let mut data = recording();
        *data.pointer_mut("/turk_annotations/anns/0/task_desc").unwrap() =
            json!("\u{8}Put the m\u{ad}ug\u{200b} away.");
        for sentence in data.pointer_mut("/turk_annotations/anns/0/high_descs").unwrap().as_array_mut().unwrap() {
            *sentence = json!(format!("\u{1b}{}\t", sentence.as_str().unwrap()));
        }
        let mut long = recording();
        *long.pointer_mut("/turk_annotations/anns/0/task_desc").unwrap() = json!("so ".repeat(1000));
        let (summary, out) = import_of(&[("trial_1", data.to_string()), ("trial_long", long.to_string())]);
        assert!(summary.manifest.skipped[0].reason.contains("3000 characters"), "{:?}", summary.manifest.skipped);
        let dataset = crate::data::Dataset::open(out.path()).unwrap();
        let trajectory = dataset.trajectories().unwrap().next().unwrap().unwrap();
        let annotation = &trajectory.annotations[0];
        assert_eq!(annotation.goal, "Put the mug away.");
        assert_eq!(annotation.steps, ["Take the mug.", "Put it in the sink."]);
    }

    /// Every value of a document, by pointer.
    fn pointers(value: &Value, at: &str, all: &mut Vec<String>) {
        all.push(at.to_owned());
        match value {
            Value::Object(map) => map.iter().for_each(|(key, value)| pointers(value, &format!("{at}/{key}"), all)),
            Value::Array(items) => {
                items.iter().enumerate().for_each(|(i, value)| pointers(value, &format!("{at}/{i}"), all));
            }
            _ => {}
        }
    }

    fn oddity() -> impl Strategy<Value = Value> {
        prop_oneof![
            Just(Value::Null),
            any::<i64>().prop_map(|n| json!(n)),
            any::<f64>().prop_map(|n| json!(n)),
            (-400i32..400).prop_map(|n| json!(f64::from(n) / 4.0)),
            "[ -~]{0,12}".prop_map(|text| json!(text)),
            Just(json!("Mug|+00.10|+00.95|+00.90|MugSliced_255")),
            Just(json!("Apple|+00.10|+00.95|+00.90|AppleSliced_0")),
            Just(json!("SliceObject")),
            Just(json!([])),
            Just(json!({})),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_mutation_of_a_file_makes_the_importer_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), oddity()), 1..4),
            cut in prop::option::of(any::<prop::sample::Index>()),
        ) {
            let mut data = recording();
            for (index, value) in changes {
                let mut all = Vec::new();
                pointers(&data, "", &mut all);
                *data.pointer_mut(&all[index.index(all.len())]).unwrap() = value;
            }
            let mut text = data.to_string().into_bytes();
            if let Some(cut) = cut {
                text.truncate(cut.index(text.len() + 1));
            }
            if let Ok(recording) = parse_recording(&text, "task/trial", "train") {
                let (scene, resolved, _) = build_one(Path::new(""), "FloorPlan1", &[&recording], &[&recording.setting]);
                for trajectory in resolved {
                    let scene = scene.as_ref().unwrap();
                    let mut world = trajectory.start.clone();
                    for &action in &trajectory.actions {
                        crate::house::rules::apply(scene, &mut world, action);
                    }
                    prop_assert_eq!(validate::world(scene, &world), Ok(()));
                    prop_assert_eq!(trajectory.boxes.len(), trajectory.actions.iter()
                        .filter(|action| action.kind >= ActionType::Pickup).count());
                }
            }
        }
    }
}
