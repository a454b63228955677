//! For tests: a dataset of demonstrations in the hand-made kitchen.

use std::path::Path;

use super::spans::{self, AnnotationSpan, SpanSelection};
use crate::data::dataset::{Counts, DatasetWriter};
use crate::data::{Dataset, dataset};
use crate::domain::trajectory::{self, Annotation};
use crate::domain::{Action, ActionType, SkillKind, Trajectory};
use crate::house::testing::{kitchen, put_subtask, role, subtask};

/// Trajectories of three skills of two turns each, told by two people; some of their wholes are held out.
pub(crate) fn dataset(ids: &[&str], held_out: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (scene, start) = kitchen();
    let mut writer = DatasetWriter::new(folder.path()).unwrap();
    writer.scene(&scene).unwrap();
    let annotation = |steps: [&str; 3]| Annotation { goal: "all".into(), steps: steps.map(str::to_owned).to_vec() };
    for id in ids {
        let trajectory = Trajectory {
            start: start.clone(),
            actions: vec![Action::navigate(ActionType::RotateLeft); 6],
            roles: vec![role("Mug"), role("Sink")],
            skills: vec![subtask(SkillKind::Pickup, 0), subtask(SkillKind::Clean, 0), put_subtask(0, 1)],
            skill_starts: vec![0, 2, 4],
            annotations: vec![
                annotation(["Take the mug.", "Wash it.", "Put it in the sink."]),
                annotation(["Grab the cup.", "Rinse it.", "Leave it in the sink."]),
            ],
            ..trajectory::testing::empty(id, &scene.name)
        };
        writer.trajectory(&trajectory).unwrap();
    }
    let counts = Counts { trajectories: ids.len() as u64, ..Counts::default() };
    let counts = [("train".to_owned(), counts)].into();
    writer.finish(&dataset::DatasetManifest { counts, ..dataset::testing::manifest(1, held_out) }).unwrap();
    folder
}

/// All spans of two and three skills.
pub(crate) fn selection() -> SpanSelection {
    SpanSelection { lengths: vec![2, 3], count: 99, split: "train".into(), seed: 1 }
}

/// The spans of [`selection`].
pub(crate) fn spans(folder: &Path) -> Vec<AnnotationSpan> {
    spans::draw(&Dataset::open(folder).unwrap(), &selection()).unwrap()
}
