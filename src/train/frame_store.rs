//! The trajectories of datasets as simulator states: any frame can be drawn at random, none is stored as an image.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use anyhow::Context;
use rayon::prelude::*;

use crate::data::dataset::Dataset;
use crate::data::items::ActionLabel;
use crate::domain::task::SceneRef;
use crate::domain::{Class, Scene, Trajectory, World};
use crate::house::{Replay, generate, validate};

/// The trajectories of datasets with the scenes they play in.
pub(crate) struct FrameStore {
    /// The trajectories, in the datasets' order.
    pub(crate) trajectories: Vec<Trajectory>,
    scenes: HashMap<SceneRef, Arc<Scene>>,
    /// The trajectories of each dataset.
    pub(crate) parts: Vec<Range<usize>>,
    /// The number of each trajectory's first frame, and at the end the number of frames.
    firsts: Vec<usize>,
    /// Trajectories of which the whole must not be trained on as one span.
    pub(crate) held_out: Vec<String>,
}

impl FrameStore {
    /// Reads the trajectories of datasets, one after the other, and makes their scenes.
    ///
    /// # Errors
    /// When a trajectory or a scene cannot be read, or a trajectory does not fit its scene; it is named with the field.
    pub(crate) fn open(datasets: &[Dataset]) -> anyhow::Result<FrameStore> {
        let mut trajectories: Vec<Trajectory> = Vec::new();
        let mut parts = Vec::new();
        for dataset in datasets {
            let before = trajectories.len();
            for trajectory in dataset.trajectories()? {
                trajectories.push(trajectory?);
            }
            anyhow::ensure!(trajectories.len() > before, "{} holds no trajectories", dataset.folder().display());
            parts.push(before..trajectories.len());
        }
        let mut wanted: Vec<SceneRef> = trajectories.iter().map(|trajectory| trajectory.scene.clone()).collect();
        wanted.sort_by_key(|scene| format!("{scene:?}"));
        wanted.dedup();
        let made = wanted.into_par_iter().map(|reference| {
            let scene = match &reference {
                SceneRef::Generated { room, seed } => Arc::new(generate::house(*room, *seed).0),
                SceneRef::Named(name) => named(datasets, name)?,
                SceneRef::Remote => anyhow::bail!("agents are trained in House only"),
            };
            Ok((reference, scene))
        });
        let scenes: HashMap<SceneRef, Arc<Scene>> = made.collect::<anyhow::Result<_>>()?;
        trajectories.par_iter().try_for_each(|trajectory| {
            let Trajectory { id, scene, start, .. } = trajectory;
            let scene = scenes.get(scene).with_context(|| format!("{id}: its scene is missing"))?;
            validate::world(scene, start).map_err(|misfit| misfit.under("start")).with_context(|| id.clone())
        })?;
        let mut firsts = vec![0];
        for trajectory in &trajectories {
            firsts.push(firsts[firsts.len() - 1] + trajectory.actions.len() + 1);
        }
        let held_out = datasets.iter().flat_map(|dataset| dataset.manifest().held_out.clone()).collect();
        Ok(FrameStore { trajectories, scenes, parts, firsts, held_out })
    }

    /// How many frames there are: each trajectory has one more than it has actions.
    pub(crate) fn frames(&self) -> usize {
        self.firsts[self.firsts.len() - 1]
    }

    /// How many frames some trajectories have.
    pub(crate) fn frames_of(&self, trajectories: &Range<usize>) -> usize {
        self.firsts[trajectories.end] - self.firsts[trajectories.start]
    }

    /// Which trajectories are kept apart from all training, to measure on: those of splits other than `train`, and every
    /// `hold_out`th of a dataset (0: none), the same ones each time that a dataset is named.
    pub(crate) fn kept_apart(&self, hold_out: usize) -> Vec<bool> {
        let places = self.parts.iter().flat_map(|part| 0..part.len());
        let kept = |(trajectory, place): (&Trajectory, usize)| {
            trajectory.split != "train" || hold_out > 0 && place % hold_out == hold_out - 1
        };
        self.trajectories.iter().zip(places).map(kept).collect()
    }

    /// The same, and besides every trajectory that plays in one of these scenes.
    ///
    /// # Errors
    /// When no trajectory plays in one of them.
    pub(crate) fn kept_apart_with(&self, hold_out: usize, withheld_scenes: &[String]) -> anyhow::Result<Vec<bool>> {
        let plays_in = |trajectory: &Trajectory, name: &String| matches!(&trajectory.scene, SceneRef::Named(scene) if scene == name);
        for name in withheld_scenes {
            let is_there = self.trajectories.iter().any(|trajectory| plays_in(trajectory, name));
            anyhow::ensure!(is_there, "withheld_scenes names {name:?}, and no trajectory plays there");
        }
        let withheld = |trajectory: &Trajectory| withheld_scenes.iter().any(|name| plays_in(trajectory, name));
        let kept = self.kept_apart(hold_out).into_iter().zip(&self.trajectories);
        Ok(kept.map(|(apart, trajectory)| apart || withheld(trajectory)).collect())
    }

    /// The trajectory that a frame belongs to.
    pub(crate) fn trajectory_of(&self, frame: usize) -> usize {
        self.firsts.partition_point(|&first| first <= frame) - 1
    }

    /// The scene that a trajectory, by its number, plays in.
    ///
    /// # Errors
    /// Never for a trajectory of this store.
    pub(crate) fn scene(&self, trajectory: usize) -> anyhow::Result<&Arc<Scene>> {
        self.scenes.get(&self.trajectories[trajectory].scene).context("a trajectory's scene is missing")
    }

    /// Visits the states of a trajectory in order: the scene, the state, and the step that follows it.
    ///
    /// # Errors
    /// Whatever `visit` reports.
    pub(crate) fn replay(
        &self,
        trajectory: usize,
        mut visit: impl FnMut(&Scene, &World, usize) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let scene = self.scene(trajectory)?;
        let recorded = &self.trajectories[trajectory];
        let mut replay = Replay::new(scene, recorded.start.clone(), &recorded.actions);
        for step in 0.. {
            visit(scene, replay.world(), step)?;
            if replay.step().is_none() {
                break;
            }
        }
        Ok(())
    }

    /// One frame's scene and state, by the frame's number.
    ///
    /// # Errors
    /// When there is no such frame.
    pub(crate) fn state(&self, frame: usize) -> anyhow::Result<(&Arc<Scene>, World)> {
        anyhow::ensure!(frame < self.frames(), "there is no frame {frame}");
        let trajectory = self.trajectory_of(frame);
        let (scene, recorded) = (self.scene(trajectory)?, &self.trajectories[trajectory]);
        let before = &recorded.actions[..frame - self.firsts[trajectory]];
        Ok((scene, Replay::new(scene, recorded.start.clone(), before).finish()))
    }

    /// The class of what is held in every frame.
    ///
    /// # Errors
    /// Never for a store that was opened.
    pub(crate) fn held(&self) -> anyhow::Result<Vec<Option<Class>>> {
        let of = |trajectory: usize| -> anyhow::Result<Vec<Option<Class>>> {
            let mut held = Vec::new();
            self.replay(trajectory, |_, world, _| {
                held.push(world.held.and_then(|held| world.object(held)).map(|object| object.class));
                Ok(())
            })?;
            Ok(held)
        };
        let all: Vec<Vec<Option<Class>>> =
            (0..self.trajectories.len()).into_par_iter().map(of).collect::<anyhow::Result<_>>()?;
        Ok(all.concat())
    }

    /// What a learner should do in every frame, which is what the expert would do; nothing in the last of a trajectory. Where
    /// chance or a learner acted otherwise, it was not taken.
    ///
    /// # Errors
    /// Never for a store that was opened.
    pub(crate) fn labels(&self) -> anyhow::Result<Vec<Option<ActionLabel>>> {
        let of = |trajectory: usize| -> anyhow::Result<Vec<Option<ActionLabel>>> {
            let recorded = &self.trajectories[trajectory];
            let mut labels = Vec::with_capacity(recorded.actions.len() + 1);
            self.replay(trajectory, |scene, world, step| {
                let taken = recorded.actions.get(step).copied();
                labels.push(taken.and(recorded.choice(step)).map(|action| {
                    let class = action.target.and_then(|target| world.class_of(scene, target)).unwrap_or_default();
                    let object = if class.in_vocabulary() { class.index() as u8 } else { 0 };
                    ActionLabel { action: action.kind.index() as u8, object, executed: taken == Some(action) }
                }));
                Ok(())
            })?;
            Ok(labels)
        };
        let labels: Vec<Vec<Option<ActionLabel>>> =
            (0..self.trajectories.len()).into_par_iter().map(of).collect::<anyhow::Result<_>>()?;
        Ok(labels.concat())
    }
}

/// The scene of that name in the first dataset that has it.
fn named(datasets: &[Dataset], name: &str) -> anyhow::Result<Arc<Scene>> {
    let mut found = datasets.iter().map(|dataset| dataset.scene(name));
    let first = found.next().context("there is no dataset")?;
    first.or_else(|error| found.find_map(Result::ok).ok_or(error))
}

#[cfg(test)]
mod tests {
    use super::{FrameStore, SceneRef};
    use crate::data::dataset;
    use crate::data::dataset::Dataset;
    use crate::domain::{Action, ActionType, Cell, Trajectory, trajectory};
    use crate::house::testing::kitchen;
    use crate::train::visual::testing::frame_store;

    #[test]
    fn trajectories_of_other_splits_and_every_so_manieth_of_each_dataset_are_kept_apart() {
        let mut frame_store = frame_store();
        assert_eq!(frame_store.kept_apart(0), [false, false]);
        assert_eq!(frame_store.kept_apart(2), [false, true]);
        frame_store.parts = vec![0..1, 1..2];
        assert_eq!(frame_store.kept_apart(2), [false, false], "each dataset is counted for itself");
        frame_store.trajectories[0].split = "valid_seen".into();
        assert_eq!(frame_store.kept_apart(0), [true, false]);
    }

    #[test]
    fn what_plays_in_a_withheld_scene_is_kept_apart_and_a_scene_that_nothing_plays_in_is_refused() {
        let mut frame_store = frame_store();
        let own = frame_store.trajectories[1].scene.clone();
        frame_store.trajectories[0].scene = SceneRef::Named("elsewhere".into());
        assert_eq!(frame_store.kept_apart_with(0, &["elsewhere".into()]).unwrap(), [true, false]);
        assert_eq!(frame_store.kept_apart_with(0, &[]).unwrap(), [false, false]);
        assert!(own != frame_store.trajectories[0].scene);
        let error = frame_store.kept_apart_with(0, &["nowhere".into()]).unwrap_err().to_string();
        assert!(error.contains("withheld_scenes names \"nowhere\""), "{error}");
    }

    #[test]
    fn a_trajectory_that_does_not_fit_its_scene_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let (scene, mut start) = kitchen();
        start.agent.cell = Cell::new(900, 900);
        let mut writer = dataset::DatasetWriter::new(folder.path()).unwrap();
        writer.scene(&scene).unwrap();
        writer.trajectory(&Trajectory { start, ..trajectory::testing::empty("lost", &scene.name) }).unwrap();
        writer.finish(&dataset::testing::manifest(1, &[])).unwrap();
        let error = FrameStore::open(&[Dataset::open(folder.path()).unwrap()]).err().unwrap();
        let error = format!("{error:#}");
        assert!(error.starts_with("lost: start.agent.cell: (900, 900) is no cell"), "{error}");
    }

    #[test]
    fn what_the_expert_only_would_have_done_is_a_label_that_was_not_taken() {
        let mut frame_store = frame_store();
        let mut choices = frame_store.trajectories[0].actions.clone();
        choices[1..3].fill(Action::navigate(ActionType::MoveAhead));
        frame_store.trajectories[0].choices = choices;
        let labels = frame_store.labels().unwrap();
        let found: Vec<_> = labels[..5].iter().map(|l| l.map(|l| (usize::from(l.action), l.executed))).collect();
        let [left, ahead] = [ActionType::RotateLeft, ActionType::MoveAhead].map(ActionType::index);
        let right = [Some((left, true)), Some((ahead, false)), Some((ahead, false)), Some((left, true)), None];
        assert_eq!(found, right);
    }
}
