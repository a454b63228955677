//! ALFRED's published files give the numbers that are known of them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use sprint_explorer::data::alfred::checkout::parse_recording;
use sprint_explorer::data::alfred::tasks;
use sprint_explorer::data::items::{ActionLabel, ItemSource, Items, Span};
use sprint_explorer::data::selection::{Composites, DataSelection};
use sprint_explorer::data::summaries::Summaries;
use sprint_explorer::domain::task::SceneRef;
use sprint_explorer::domain::{Action, ActionType, SkillKind, Subtask, Trajectory, World};

use super::needed;

/// The train split as published.
fn train() -> Option<PathBuf> {
    needed::alfred().map(|folder| folder.join("data/json_2.1.0/train"))
}

fn folders(folder: &Path) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    folders
}

/// A trial's skills and sentences; what it is about does not matter here.
fn trajectory(folder: &Path) -> Trajectory {
    let id: Vec<_> = folder.iter().rev().take(2).map(|part| part.to_string_lossy()).collect();
    let text = std::fs::read(folder.join("traj_data.json")).unwrap();
    let recording = parse_recording(&text, &format!("{}/{}", id[1], id[0]), "train").unwrap();
    let skill = Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None };
    let start = |skill| recording.steps.iter().position(|step| step.skill >= skill).unwrap() as u32;
    Trajectory {
        skill_starts: (0..recording.skills.len()).map(start).collect(),
        id: recording.id,
        split: recording.split,
        scene: SceneRef::Named(recording.setting.floor_plan),
        start: World::default(),
        actions: vec![Action::navigate(ActionType::MoveAhead); recording.steps.len()],
        roles: Vec::new(),
        skills: vec![skill; recording.skills.len()],
        goal: None,
        annotations: recording.annotations,
        boxes: Vec::new(),
        choices: Vec::new(),
    }
}

#[test]
fn the_train_split_has_as_many_spans_as_are_known_of_it() {
    let Some(train) = train() else { return };
    let trials: Vec<PathBuf> = folders(&train).iter().flat_map(|task| folders(task)).collect();
    let trajectories: Vec<Trajectory> = trials.par_iter().map(|trial| trajectory(trial)).collect();
    assert_eq!(trajectories.len(), 6574);
    let chain = tasks::indexed(tasks::OFFICIAL[1]);
    let held_out: Vec<String> = chain.iter().map(|entry| entry.trajectory().to_owned()).collect();
    assert_eq!(held_out.len(), 20);
    let summaries = Summaries::default();
    let label = Some(ActionLabel { action: 0, object: 0, executed: true });
    let of_one = |one: &Trajectory| std::iter::repeat_n(label, one.actions.len()).chain([None]).collect::<Vec<_>>();
    let labels: Vec<Option<ActionLabel>> = trajectories.iter().flat_map(of_one).collect();
    let items = |held_out: &[String]| {
        let source = ItemSource { trajectories: &trajectories, apart: &[], held_out, summaries: &summaries };
        Items::of(&source, labels.clone(), &DataSelection::of(Composites::Concat)).unwrap()
    };
    let (all, without) = (items(&[]), items(&held_out));
    let count = |items: &Items, primitive| items.training.iter().filter(|s| s.is_primitive() == primitive).count();

    // Aligned annotations alone, then without the 70 wholes of the 20 held-out trajectories.
    assert_eq!(count(&all, true), 73_248);
    assert_eq!(count(&without, true), 73_248);
    assert_eq!(count(&without, false), 110_828);
    assert_eq!(count(&all, false) - count(&without, false), 70);
    let whole = |span: &&Span| span.skills.len() == trajectories[span.trajectory as usize].skills.len();
    let is_held_out = |span: &&Span| held_out.contains(&trajectories[span.trajectory as usize].id);
    assert_eq!(all.training.iter().filter(whole).filter(is_held_out).count(), 70);
    assert_eq!(without.training.iter().filter(whole).filter(is_held_out).count(), 0);
    let mut histogram: BTreeMap<usize, usize> = BTreeMap::new();
    for span in without.training.iter().filter(|span| !span.is_primitive()) {
        *histogram.entry(span.skills.len()).or_default() += 1;
    }
    let known = [(2, 52_244), (3, 31_240), (4, 15_746), (5, 6676), (6, 3769), (7, 851), (8, 193), (9, 79), (10, 30)];
    assert_eq!(histogram, BTreeMap::from(known));

    // Every annotation, aligned or not.
    let times = |of: fn(usize) -> usize| -> usize {
        trajectories.iter().map(|trajectory| of(trajectory.skills.len()) * trajectory.annotations.len()).sum()
    };
    assert_eq!(times(|skills| skills), 73_395);
    assert_eq!(times(|skills| skills * (skills - 1) / 2), 111_339);

    // Drawn uniformly, two fifths are primitives.
    let drawn = without.draw(&without.training, 3, 0, 1000);
    assert!(drawn.iter().all(|item| item.first <= item.frame && item.frame < item.end));
    let share = count(&without, true) as f64 / without.training.len() as f64;
    assert!((0.39..0.41).contains(&share), "{share}");
}
