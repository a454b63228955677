//! The formats, each with sound files made by the program itself and with what reads it.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use sprint_explorer::agent::checkpoint::Networks;
use sprint_explorer::agent::config::CheckpointConfig;
use sprint_explorer::agent::policy_source::PolicySource;
use sprint_explorer::data::alfred::{self, tasks as lists};
use sprint_explorer::data::annotations;
use sprint_explorer::data::features::{self, Features};
use sprint_explorer::data::summaries::{Ledger, SpanSummary, Summaries};
use sprint_explorer::data::{Dataset, alfred::layout::FloorPlanLayout, dataset, json, taskset};
use sprint_explorer::domain::task::SceneRef;
use sprint_explorer::domain::{Room, TaskSet};
use sprint_explorer::episode::scenes::Scenes;
use sprint_explorer::eval::evaluation::Evaluation;
use sprint_explorer::eval::evaluation::evaluate;
use sprint_explorer::eval::options::Options;
use sprint_explorer::eval::tasks::check;
use sprint_explorer::eval::tasks::sample;
use sprint_explorer::eval::tasks::sample::SampleSpec;
use sprint_explorer::eval::verify::verify;
use sprint_explorer::house::expert::TurnTiming;
use sprint_explorer::house::grading::Grading;
use sprint_explorer::house::{House, validate};
use sprint_explorer::nets::embedding_cache::EmbeddingCache;
use sprint_explorer::nets::weights;
use sprint_explorer::report::charts::training_curves;
use sprint_explorer::report::compare::Comparison;
use sprint_explorer::run_dir::reader::RecordedRun;
use sprint_explorer::run_dir::writer::RunWriter;
use sprint_explorer::train::collect::{Collection, DemonstrationSettings, ExpertKind, TaskSource};
use sprint_explorer::train::metrics::{ProgressLogger, Scalars};
use sprint_explorer::train::preset::Preset;
use sprint_explorer::tui::config;
use tch::Device;

use super::Target;
use crate::scenarios::kitchen;

/// Every format that the program reads.
pub(crate) const ALL: &[Target] = &[
    Target {
        name: "tasks",
        file: "tasks.json",
        prepare: |_| vec![bytes(&sampled()), bytes(&by_hand())],
        read: task_set,
    },
    Target { name: "scene", file: "scenes/kitchen.json", prepare: scenes, read: scene },
    Target { name: "start", file: "tasks.json", prepare: starts, read: task_set },
    Target { name: "manifest", file: "run/manifest.json", prepare: manifests, read: finished },
    Target { name: "episodes", file: "run/episodes.jsonl", prepare: |at| run(at, "episodes.jsonl"), read: finished },
    Target { name: "dataset", file: "dataset.json", prepare: |at| collected(at, "dataset.json"), read: trajectories },
    Target { name: "trajectories", file: "lines.jsonl", prepare: lines, read: packed },
    Target {
        name: "zstd",
        file: "trajectories.jsonl.zst",
        prepare: |at| collected(at, "trajectories.jsonl.zst"),
        read: trajectories,
    },
    Target { name: "labels", file: "labels.jsonl", prepare: labels, read: label },
    Target { name: "annotations", file: "annotations/ann.jsonl", prepare: annotated, read: annotation },
    Target { name: "features", file: "cache.bin", prepare: maps, read: map },
    Target { name: "embeddings", file: "encoder.embeddings", prepare: embeddings, read: embedding },
    Target { name: "config", file: "config.json", prepare: |_| vec![shipped("config.json")], read: checkpoint },
    Target { name: "weights", file: "model.safetensors", prepare: tensors, read: loaded },
    Target { name: "preset", file: "preset.toml", prepare: presets, read: preset },
    Target { name: "settings", file: "explorer.toml", prepare: settings, read: setting },
    Target { name: "progress", file: "training/progress.jsonl", prepare: progress, read: curve },
    Target { name: "recording", file: RECORDING, prepare: |_| vec![recording()], read: imported },
    Target { name: "layout", file: "gen/layouts/FloorPlan1-layout.npy", prepare: layouts, read: layout },
    Target { name: "openable", file: "gen/layouts/FloorPlan1-openable.json", prepare: stands, read: layout },
    Target { name: "lists", file: "eval_instruct_ann_human.json", prepare: listed, read: list },
];

const RECORDING: &str = "data/json_2.1.0/train/task/trial_1/traj_data.json";

fn bytes<T: serde::Serialize>(value: &T) -> Vec<u8> {
    serde_json::to_vec(value).unwrap()
}

fn shipped(file: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents/clone").join(file)).unwrap()
}

fn sampled() -> TaskSet {
    let wish = SampleSpec {
        name: "sampled".into(),
        length: 2,
        count: 2,
        seed: 5,
        rooms: vec![Room::Bathroom],
        only_scenes: Vec::new(),
        wholes: false,
    };
    sample::sample_generated(&wish, &|| ()).unwrap()
}

fn by_hand() -> serde_json::Value {
    serde_json::json!({"format_version": 1, "name": "mine", "tasks": [{
        "id": "mug", "scene": {"generated": {"room": "kitchen", "seed": 7}},
        "instruction": "put the mug in the sink", "horizon": 80,
        "roles": [{"class": "Mug"}, {"class": "Sink"}],
        "subtasks": [{"skill": "Pickup", "object": 0}, {"skill": "Put", "object": 0, "receptacle": 1}]}]})
}

fn task_set(at: &Path) -> anyhow::Result<()> {
    let path = at.join("tasks.json");
    let mistakes = check::mistakes(&path)?;
    let set = taskset::read(&path)?;
    let scenes = Scenes::of(&path, &set.value);
    let found = scenes.check(&set.value.tasks);
    assert!(mistakes.is_empty() == found.is_ok(), "one sees what the other does not: {mistakes:?}, {found:?}");
    let evaluation = Evaluation::prepare(&set, scenes, Options::plain(Grading::Class), "nobody", None)?;
    for task in evaluation.tasks().iter().take(3) {
        let setting = evaluation.scenes().setting(task)?;
        House::new(setting.scene, setting.world).candidates();
    }
    Ok(())
}

fn scenes(at: &Path) -> Vec<Vec<u8>> {
    let (mut scene, world) = kitchen();
    let scene = Arc::make_mut(&mut scene);
    scene.name = "kitchen".into();
    json::write(&at.join("world.json"), &world).unwrap();
    vec![bytes(scene)]
}

fn scene(at: &Path) -> anyhow::Result<()> {
    let scene = dataset::read_scene(&at.join("scenes"), "kitchen")?;
    let world = serde_json::from_slice(&std::fs::read(at.join("world.json"))?)?;
    if validate::world(&scene, &world).is_ok() {
        let mut house = House::new(Arc::new(scene), world);
        house.frame();
        house.candidates();
    }
    Ok(())
}

/// A task in a scene from a file, with a start of its own.
fn starts(at: &Path) -> Vec<Vec<u8>> {
    std::fs::create_dir_all(at.join("scenes")).unwrap();
    let scene = scenes(at).remove(0);
    std::fs::write(at.join("scenes/kitchen.json"), scene).unwrap();
    let mut set = sampled();
    set.scenes = Some("scenes".into());
    set.tasks.truncate(1);
    set.tasks[0].scene = SceneRef::Named("kitchen".into());
    set.tasks[0].start = Some(kitchen().1);
    set.tasks[0].roles.iter_mut().for_each(|role| role.bound = None);
    vec![bytes(&set)]
}

/// A run of two tasks by chance; one of its files.
fn run(at: &Path, file: &str) -> Vec<Vec<u8>> {
    let path = at.join("tasks.json");
    taskset::write(&path, &sampled()).unwrap();
    let set = taskset::read(&path).unwrap();
    let options = Options { seeds: 2, ..Options::plain(Grading::Class) };
    let evaluation = Evaluation::prepare(&set, Scenes::of(&path, &set.value), options, "random", None).unwrap();
    let mut folder = RunWriter::open(&at.join("run"), evaluation.manifest()).unwrap();
    folder.write_tasks(&set.value).unwrap();
    evaluate(&evaluation, &PolicySource::random().make, &mut folder, &Arc::new(AtomicBool::new(false)), &mut |_| ())
        .unwrap();
    vec![std::fs::read(at.join("run").join(file)).unwrap()]
}

/// That of the whole run, and one of a share.
fn manifests(at: &Path) -> Vec<Vec<u8>> {
    let whole = run(at, "manifest.json").remove(0);
    let mut share: serde_json::Value = serde_json::from_slice(&whole).unwrap();
    share["shard"] = serde_json::json!({"index": 1, "of": 1});
    vec![whole, bytes(&share)]
}

/// Everything that looks at a run afterwards.
fn finished(at: &Path) -> anyhow::Result<()> {
    let path = at.join("run");
    let run = RecordedRun::open_evaluated(&path)?;
    run.episode_specs();
    Comparison::of(&[RecordedRun::open_evaluated(&path)?, run])?.0.markdown();
    let recorded = RecordedRun::open(&path, None)?;
    verify(&recorded, &mut |_| Ok(None), 1, &Default::default(), &mut |_| ())?;
    RunWriter::open(&path, &recorded.manifest).map(drop)
}

struct Silent;

impl ProgressLogger for Silent {
    fn log(&mut self, _: &Scalars) -> anyhow::Result<()> {
        Ok(())
    }
}

/// A dataset of three demonstrations; one of its files.
fn collected(at: &Path, file: &str) -> Vec<Vec<u8>> {
    let collection = Collection {
        out: at.to_owned(),
        tasks: TaskSource::Generated { episodes: 3, lengths: vec![1, 2], annotations: 1 },
        seed: 3,
        settings: DemonstrationSettings { expert: ExpertKind::Scanning, turn_timing: TurnTiming::Late, noise: 0.0 },
        learner: None,
    };
    collection.run(&mut Silent, &AtomicBool::new(false)).unwrap();
    vec![std::fs::read(at.join(file)).unwrap()]
}

fn trajectories(at: &Path) -> anyhow::Result<()> {
    let dataset = Dataset::open(at)?;
    let all = dataset.trajectories()?.take(1000).collect::<anyhow::Result<Vec<_>>>()?;
    for trajectory in &all {
        let mut world = trajectory.start.clone();
        let (scene, _) = Scenes::in_folder(None).scene(&trajectory.scene)?;
        validate::world(&scene, &world)?;
        for &action in trajectory.actions.iter().take(1000) {
            sprint_explorer::house::rules::apply(&scene, &mut world, action);
        }
    }
    Ok(())
}

fn lines(at: &Path) -> Vec<Vec<u8>> {
    let packed = collected(at, "trajectories.jsonl.zst").remove(0);
    vec![zstd::decode_all(&packed[..]).unwrap()]
}

fn packed(at: &Path) -> anyhow::Result<()> {
    let lines = std::fs::read(at.join("lines.jsonl"))?;
    std::fs::write(at.join("trajectories.jsonl.zst"), zstd::encode_all(&lines[..], 1)?)?;
    trajectories(at)
}

fn labels(at: &Path) -> Vec<Vec<u8>> {
    let label = |trajectory: &str| SpanSummary {
        trajectory: trajectory.into(),
        annotator: 0,
        skills: [0, 2],
        text: "Take it and put it down.".into(),
        source: "rules".into(),
        version: 1,
        input: "00ff".into(),
        maker: None,
        person: None,
        malformed: None,
    };
    Ledger::open(at).unwrap().0.append(&[label("a"), label("b"), label("c")]).unwrap();
    vec![std::fs::read(at.join("labels.jsonl")).unwrap()]
}

fn label(at: &Path) -> anyhow::Result<()> {
    Summaries::read(&[at], None)?;
    Ledger::open(at).map(drop)
}

/// What two sittings wrote: the second takes back a sentence of the first.
fn annotated(_: &Path) -> Vec<Vec<u8>> {
    let line = |trajectory: &str, text: Option<&str>| {
        let span = serde_json::json!({"trajectory": trajectory, "annotator": 0, "skills": [0, 2], "input": "00ff"});
        serde_json::json!({"span": span, "text": text}).to_string() + "\n"
    };
    let header = "{\"format_version\":1}\n".to_owned();
    let first = header.clone() + &line("a", Some("Set the table.")) + &line("b", Some("Café crème."));
    vec![(first + &line("a", None)).into_bytes(), header.into_bytes()]
}

fn annotation(at: &Path) -> anyhow::Result<()> {
    annotations::read_all(at)?;
    annotations::open(at, "ann").map(drop)
}

fn header() -> features::FeatureHeader {
    features::FeatureHeader { format_version: 1, encoder: "e".into(), dataset: "d".into(), maps: 3, numbers: 4 }
}

fn maps(at: &Path) -> Vec<Vec<u8>> {
    let mut writer = features::FeatureWriter::open(at, header()).unwrap();
    writer.add(&[7; 24]).unwrap();
    writer.finish().unwrap();
    vec![std::fs::read(at.join(header().file_name())).unwrap()]
}

fn map(at: &Path) -> anyhow::Result<()> {
    std::fs::copy(at.join("cache.bin"), at.join(header().file_name()))?;
    let features = Features::read(at, &header())?.context("another file")?;
    features.gather_run(0..features.len(), &mut Vec::new())
}

fn embeddings(at: &Path) -> Vec<Vec<u8>> {
    let mut cache = EmbeddingCache::open(at, "encoder", 3).unwrap();
    cache.add([("a", &[1.0f32, 2.0, 3.0][..]), ("b", &[0.0; 3])]).unwrap();
    vec![std::fs::read(at.join("encoder.embeddings")).unwrap()]
}

fn embedding(at: &Path) -> anyhow::Result<()> {
    EmbeddingCache::open(at, "encoder", 3)?.get("a").map(drop)
}

fn checkpoint(at: &Path) -> anyhow::Result<()> {
    CheckpointConfig::read(at).map(drop)
}

/// Small networks, and their configuration beside them.
fn tensors(at: &Path) -> Vec<Vec<u8>> {
    let mut config: serde_json::Value = serde_json::from_slice(&shipped("config.json")).unwrap();
    config["visual_encoder"]["channels"] = serde_json::json!([1, 1, 1, 1]);
    config["policy"]["channels"] = serde_json::json!([1, 1, 1, 1]);
    config["policy"]["hidden"] = serde_json::json!([2]);
    config["policy"]["embedding"] = 2.into();
    std::fs::write(at.join("config.json"), config.to_string()).unwrap();
    let config = CheckpointConfig::read(at).unwrap();
    Networks::new(config.build_visual_encoder(Device::Cpu).unwrap(), &config.policy, None, Device::Cpu)
        .save(at, &config)
        .unwrap();
    vec![std::fs::read(at.join("model.safetensors")).unwrap()]
}

fn loaded(at: &Path) -> anyhow::Result<()> {
    weights::read_with_metadata(&at.join("model.safetensors"))?;
    Networks::load(at, &CheckpointConfig::read(at)?, Device::Cpu).map(drop)
}

fn presets(_: &Path) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/presets");
    ["sprint.toml", "l-bc.toml", "am.toml"].map(|file| std::fs::read(folder.join(file)).unwrap()).to_vec()
}

fn preset(at: &Path) -> anyhow::Result<()> {
    Preset::named(&at.join("preset.toml").display().to_string()).map(drop)
}

fn settings(_: &Path) -> Vec<Vec<u8>> {
    let whole = "format_version = 1\ntheme = \"dark\"\n[keys]\nctrl-r = \"policy random\"\nf5 = \"run\"\nx = \"run\"\n";
    vec![whole.into(), "format_version = 1\n".into()]
}

fn setting(at: &Path) -> anyhow::Result<()> {
    config::ExplorerConfig::parse(&std::fs::read_to_string(at.join("explorer.toml"))?).map(drop)
}

fn progress(_: &Path) -> Vec<Vec<u8>> {
    let line = |step: u64| {
        let mut scalars = Scalars::new("policy", step, 100);
        scalars.set("loss", 1.0 / step as f64);
        serde_json::to_string(&scalars).unwrap() + "\n"
    };
    vec![(1..5).map(line).collect::<String>().into_bytes()]
}

fn curve(at: &Path) -> anyhow::Result<()> {
    let drawing = training_curves::draw(&[("one".into(), training_curves::read(at)?)], &[])?;
    drawing.svg();
    drawing.png().map(drop)
}

/// A recording of our own in ALFRED's format: walk, take the mug from the counter, put it into the sink.
fn recording() -> Vec<u8> {
    include_bytes!("traj_data.json").to_vec()
}

fn imported(at: &Path) -> anyhow::Result<()> {
    alfred::import(at, &at.join("out"), &alfred::ImportOptions::default(), &|_| {}).map(drop)
}

fn layouts(at: &Path) -> Vec<Vec<u8>> {
    let path = at.join(RECORDING);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, recording()).unwrap();
    let mut header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }".to_vec();
    header.resize(127 - 10, b' ');
    header.push(b'\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header);
    file.extend([-0.25f64, 0.25, 0.0, 0.25, 0.0, 0.5].iter().flat_map(|value| value.to_le_bytes()));
    vec![file]
}

fn stands(at: &Path) -> Vec<Vec<u8>> {
    layouts(at);
    vec![bytes(
        &serde_json::json!({"Cabinet|+00.10|+00.95|+00.90": [0.0, 0.25, 90, 30], "Fridge|+01.00|+00.00|+01.00": [0.25, 0.25, 0, 0]}),
    )]
}

fn layout(at: &Path) -> anyhow::Result<()> {
    FloorPlanLayout::read(&at.join("gen/layouts"), "FloorPlan1")?;
    imported(at)
}

fn listed(_: &Path) -> Vec<Vec<u8>> {
    let item = |first: usize| serde_json::json!({"task": "a/b", "repeat_id": 0, "subgoal_ids": [first, first + 1], "annotation": "Put it down."});
    vec![bytes(&[item(0), item(3)])]
}

fn list(at: &Path) -> anyhow::Result<()> {
    lists::listed(lists::OFFICIAL[0], at)?.context("absent")?;
    Ok(())
}
