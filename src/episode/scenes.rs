//! Where tasks play: from a task's words for a scene to the scene itself and the world it starts in.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, anyhow, bail};
use sha2::{Digest, Sha256};

use crate::data::{dataset, json};
use crate::domain::task::SceneRef;
use crate::domain::{Instance, Scene, Task, TaskSet, World};
use crate::house::validate;
use crate::house::validate::Misfit;

/// The scenes that a task set may name. Those from files are read once and shared, by copies too; generated houses are made anew.
#[derive(Clone)]
pub struct Scenes {
    folder: Option<PathBuf>,
    read: Arc<Mutex<BTreeMap<String, Arc<Scene>>>>,
}

/// Where an episode starts.
#[derive(Clone, Debug)]
pub struct Setting {
    /// The floor plan.
    pub scene: Arc<Scene>,
    /// The state at the start.
    pub world: World,
}

impl Scenes {
    /// The scenes of the tasks in `file`: the set names their folder relative to that.
    pub fn of(file: &Path, set: &TaskSet) -> Scenes {
        let folder = set.scenes.as_ref().map(|scenes| file.parent().unwrap_or(Path::new("")).join(scenes));
        Scenes { folder, read: Arc::default() }
    }

    /// The scenes in a folder of scene files; `None` where only generated houses are known.
    pub fn in_folder(folder: Option<PathBuf>) -> Scenes {
        Scenes { folder, read: Arc::default() }
    }

    /// The scene, with the world that a generated one starts in.
    ///
    /// # Errors
    /// When its file is missing or not a sound scene.
    pub fn scene(&self, reference: &SceneRef) -> anyhow::Result<(Arc<Scene>, Option<World>)> {
        match reference {
            SceneRef::Generated { room, seed } => {
                let (scene, world) = crate::house::generate::house(*room, *seed);
                Ok((Arc::new(scene), Some(world)))
            }
            SceneRef::Named(name) => Ok((self.named(name)?, None)),
            SceneRef::Remote => bail!("the task plays in another environment than House"),
        }
    }

    fn named(&self, name: &str) -> anyhow::Result<Arc<Scene>> {
        // A poisoned cache is still a cache: scenes are only ever added whole.
        if let Some(scene) = self.read.lock().unwrap_or_else(PoisonError::into_inner).get(name) {
            return Ok(scene.clone());
        }
        let Some(folder) = &self.folder else { bail!("no folder of scenes is known, so there is no scene {name:?}") };
        let scene = dataset::read_scene(folder, name).with_context(|| format!("there is no scene {name:?}"))?;
        let scene = Arc::new(scene);
        self.read.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned(), scene.clone());
        Ok(scene)
    }

    /// Where a task starts, checked against its scene.
    ///
    /// # Errors
    /// Begins with the task's field that is wrong.
    pub fn setting(&self, task: &Task) -> anyhow::Result<Setting> {
        let (scene, first) = self.scene(&task.scene).context("scene")?;
        let world = match (&task.start, first) {
            (Some(start), _) => {
                validate::world(&scene, start).map_err(|misfit| misfit.under("start"))?;
                start.clone()
            }
            (None, Some(first)) => first,
            (None, None) => bail!("start: missing; only a generated house has one of its own"),
        };
        instances(task, &scene, &world)?;
        Ok(Setting { scene, world })
    }

    /// Checks where every task starts; returns the SHA-256 over the scenes that they use.
    ///
    /// # Errors
    /// Names the first task and field that is wrong.
    pub fn check(&self, tasks: &[Task]) -> anyhow::Result<String> {
        let mut digest = Sha256::new();
        let mut seen = BTreeSet::new();
        for (i, task) in tasks.iter().enumerate() {
            if let Some((env, _)) = task.remote_episode() {
                if seen.insert(env.to_string()) {
                    digest.update(env.to_string());
                }
                continue;
            }
            let setting = self.setting(task).map_err(|error| anyhow!("tasks[{i}].{error:#} (task {:?})", task.id))?;
            if seen.insert(setting.scene.name.clone()) {
                digest.update(serde_json::to_vec(&*setting.scene)?);
            }
        }
        Ok(json::hex(&digest.finalize()))
    }
}

/// Every instance that a task's roles and subtasks name is there, and of the class that it is named for.
fn instances(task: &Task, scene: &Scene, world: &World) -> Result<(), Misfit> {
    let there = |instance: Instance, field: String| validate::instance(scene, world, instance, &field);
    for (i, role) in task.roles.iter().enumerate() {
        if let Some(bound) = role.bound {
            let field = format!("roles[{i}].bound");
            there(bound, field.clone())?;
            if let Some(class) = world.class_of(scene, bound).filter(|&class| class != role.class) {
                return Err(Misfit::new(field, format!("a {class}, but the role asks for a {}", role.class)));
            }
        }
        if let Some(expert) = role.expert {
            there(expert.instance, format!("roles[{i}].expert.instance"))?;
        }
    }
    for (i, literal) in task.subtasks.iter().enumerate().filter_map(|(i, subtask)| Some((i, subtask.literal?))) {
        there(literal.object.instance, format!("subtasks[{i}].literal.object.instance"))?;
        if let Some(target) = literal.last_target {
            there(target.instance, format!("subtasks[{i}].literal.last_target.instance"))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::house::validate::tests::small_scene;

    /// A folder with one scene file, and a task that starts in it.
    fn in_small_scene() -> (tempfile::TempDir, Task) {
        let folder = tempfile::tempdir().unwrap();
        let (scene, world) = small_scene();
        json::write(&folder.path().join("small.json"), &scene).unwrap();
        let task = Task { scene: SceneRef::Named("small".into()), start: Some(world), ..sample_set().tasks.remove(0) };
        (folder, task)
    }

    fn complaint(change: impl FnOnce(&mut Task)) -> String {
        let (folder, mut task) = in_small_scene();
        change(&mut task);
        let scenes = Scenes::in_folder(Some(folder.path().to_owned()));
        scenes.check(&[task]).err().map_or_else(String::new, |error| format!("{error:#}"))
    }

    #[test]
    fn a_task_starts_in_the_scene_that_it_names() {
        let (folder, task) = in_small_scene();
        let setting = Scenes::in_folder(Some(folder.path().to_owned())).setting(&task).unwrap();
        assert_eq!((setting.scene.name.as_str(), Some(setting.world)), ("small", task.start));
    }

    #[test]
    fn what_does_not_fit_the_scene_is_named_by_task_and_field() {
        assert_eq!(complaint(|_| ()), "");
        let unknown = complaint(|task| task.scene = SceneRef::Named("FloorPlan99".into()));
        assert!(unknown.starts_with("tasks[0].scene: there is no scene \"FloorPlan99\""), "{unknown}");
        assert!(complaint(|task| task.start = None).contains("tasks[0].start: missing"));
        let misfit = complaint(|task| task.start.as_mut().unwrap().agent.horizon = 7);
        assert!(misfit.starts_with("tasks[0].start.agent.horizon"), "{misfit}");
        assert!(complaint(|task| task.roles[0].bound = Some(Instance::Object(77))).contains("roles[0].bound"));
        assert!(complaint(|task| task.roles[0].bound = Some(Instance::Object(1))).contains("a bowl, but"));
    }

    #[test]
    fn a_scene_file_that_is_no_scene_is_named() {
        let (folder, task) = in_small_scene();
        let (mut scene, _) = small_scene();
        scene.cells.clear();
        json::write(&folder.path().join("small.json"), &scene).unwrap();
        let error = Scenes::in_folder(Some(folder.path().to_owned())).check(&[task]).unwrap_err().to_string();
        assert!(error.contains("small.json: cells: there is no cell"), "{error}");
    }

    #[test]
    fn the_fingerprint_of_the_scenes_changes_with_them() {
        let (folder, task) = in_small_scene();
        let digest = || Scenes::in_folder(Some(folder.path().to_owned())).check(std::slice::from_ref(&task)).unwrap();
        let before = digest();
        assert_eq!(before, digest());
        let (mut scene, _) = small_scene();
        scene.fixtures[0].pivot.x += 1;
        json::write(&folder.path().join("small.json"), &scene).unwrap();
        assert_ne!(before, digest());
    }
}
