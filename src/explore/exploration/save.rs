//! Keeping what was explored: as a run, as a task, or as something to look at. Each says in a line what it wrote.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use super::Exploration;
use crate::domain::{Scene, Task};
use crate::episode::branches::{Branch, SavedState};
use crate::episode::frames::FrameSequence;
use crate::episode::record::Episode;
use crate::episode::scenes::Setting;
use crate::episode::wish::WishGrading;
use crate::explore::session_export;
use crate::explore::session_export::SessionExport;
use crate::language::count::counted;
use crate::report::export;
use crate::run_dir::default_path;

impl Exploration {
    /// Everything that was tried as a run's tasks and episodes, a branch each.
    pub(crate) fn explored(&self) -> SessionExport {
        let branches = || self.tree.branches().iter().enumerate();
        let tasks = branches().map(|(at, branch)| self.task_at(&self.tree.beginning(at), &branch.name)).collect();
        SessionExport {
            scene: self.rollout.env.house.scene().clone(),
            tasks,
            episodes: self.branch_episodes(),
            places: self.places.clone(),
        }
    }

    /// Every branch as an episode, under its name.
    pub(super) fn branch_episodes(&self) -> Vec<Episode> {
        let episode = |(at, branch): (usize, &Branch)| self.with_open_wishes(at, self.tree.episode(at, &branch.name));
        self.tree.branches().iter().enumerate().map(episode).collect()
    }

    /// The branch in hand as a recording.
    ///
    /// # Errors
    /// Never for what the simulator itself did.
    pub(crate) fn recording(&self) -> anyhow::Result<FrameSequence> {
        let start = &self.tree.beginning(self.tree.branch());
        let name = self.tree.branches().get(self.tree.branch()).map_or("", |branch| branch.name.as_str());
        let setting = Setting { scene: self.rollout.env.house.scene().clone(), world: (*start.world).clone() };
        FrameSequence::of(&setting, &self.task_at(start, name), &self.tree.episode(self.tree.branch(), name))
    }

    /// The present state and instruction as a task: what is left of the subtasks, with the expert's own number of steps.
    ///
    /// # Errors
    /// When nobody grades the instruction, nothing is left to do, or the expert sees no way.
    pub(crate) fn as_task(&self) -> anyhow::Result<(Task, Arc<Scene>)> {
        let name = self.tree.branches().get(self.tree.branch()).map_or("", |branch| branch.name.as_str());
        let id = format!("{}-{name}-{}", self.rollout.env.house.scene().name, self.tree.at());
        let base = self.task_at(self.tree.saved_state(), &id);
        Ok((session_export::rest_of(base, &self.rollout)?, self.rollout.env.house.scene().clone()))
    }

    /// The task that begins at a moment; without subtasks where nobody grades the instruction.
    fn task_at(&self, moment: &SavedState, id: &str) -> Task {
        let wish = moment.wishes.last();
        let is_task = wish.is_some_and(|wish| wish.grading == WishGrading::Task);
        let graded = self.episode.task.as_ref().filter(|_| moment.grader.is_some() && is_task);
        let mut task = graded.cloned().unwrap_or_else(|| session_export::ungraded(self.episode.reference.clone()));
        if let Some(wish) = wish.filter(|wish| wish.grading == WishGrading::Read) {
            task.roles.clone_from(&wish.roles);
            task.subtasks.clone_from(&wish.subtasks);
            task.expert_steps = wish.expert_steps.unwrap_or(0);
            task.horizon = wish.limit().unwrap_or(0);
        }
        task.id = id.into();
        task.start = Some((*moment.world).clone());
        task.instruction.clone_from(&moment.instruction);
        task
    }

    /// Writes every branch as an episode of a run, into `path` or a new folder.
    ///
    /// # Errors
    /// When the folder holds something else, or cannot be written to.
    pub(crate) fn keep(&mut self, path: Option<PathBuf>) -> anyhow::Result<String> {
        let path = path.unwrap_or_else(|| {
            let since = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
            default_path::default_path("explored", since, &|path| path.exists())
        });
        let explored = self.explored();
        session_export::write(&explored, &path)?;
        self.count_as_saved();
        let many = explored.episodes.len();
        let what = if many == 1 { "branch".to_string() } else { format!("{many} branches") };
        Ok(format!("wrote the {what} as {}; sprint open shows it again", path.display()))
    }

    /// Adds the present state, instruction and remaining subtasks as a task to a task file.
    ///
    /// # Errors
    /// When nobody grades the instruction, or the file cannot be written.
    pub(crate) fn keep_task(&self, path: &Path) -> anyhow::Result<String> {
        let (task, scene) = self.as_task()?;
        let steps = task.expert_steps;
        let (id, many) = session_export::add_task(path, task, &scene)?;
        Ok(format!("{id} is task {} of {} (expert: {})", many, path.display(), counted(steps, "step")))
    }

    /// Writes the branch in hand in the form that the file's ending asks for.
    ///
    /// # Errors
    /// When the ending is unknown, or the file cannot be written.
    pub(crate) fn export(&self, path: &Path) -> anyhow::Result<String> {
        let size = export::write(&self.recording()?, self.tree().at(), path)?;
        Ok(format!("wrote {}, {:.1} kB", path.display(), size as f64 / 1000.0))
    }
}

#[cfg(test)]
mod tests {
    use crate::agent::policy_source::PolicySource;
    use crate::agent::registry::PolicyKind;
    use crate::data::taskset;
    use crate::domain::{Action, ActionType};
    use crate::episode::record::Author;
    use crate::eval::verify::verify;
    use crate::explore::testing;
    use crate::run_dir::reader::RecordedRun;

    #[test]
    fn an_exploration_with_forks_is_kept_and_verified_and_its_state_becomes_a_task() {
        let folder = tempfile::tempdir().unwrap();
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Random).unwrap();
        for _ in 0..6 {
            exploration.step().unwrap();
        }
        exploration.seek(3);
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        exploration.instruct("dance").unwrap();
        exploration.step().unwrap();
        exploration.rename(1, "1").unwrap();
        assert_eq!([exploration.branch("1").unwrap(), exploration.branch("2").unwrap()], [0, 1], "a number is a place");
        let path = folder.path().join("run");
        assert!(exploration.keep(Some(path.clone())).unwrap().contains("2 branches"));
        assert!(exploration.keep(Some(path.clone())).unwrap_err().to_string().contains("holds a run already"));
        let run = RecordedRun::open(&path, None).unwrap();
        let mut find = |_: &Author| Ok(Some(PolicySource::random()));
        let verdict = verify(&run, &mut find, 1, &crate::env::remote::RemoteSettings::default(), &mut |_| ()).unwrap();
        assert!(verdict.differences.is_empty(), "{verdict:?}");
        assert_eq!((verdict.episodes, verdict.steps, verdict.choices), (2, 6 + 5, 6 + 4));

        let tasks = folder.path().join("tasks.json");
        assert!(exploration.keep_task(&tasks).unwrap_err().to_string().contains("is not graded"));
        exploration.switch(0).unwrap();
        exploration.seek(4);
        exploration.keep_task(&tasks).unwrap();
        assert!(exploration.keep_task(&tasks).unwrap().contains("is task 2"));
        let nowhere = folder.path().join("none/tasks.json");
        assert!(exploration.keep_task(&nowhere).unwrap_err().to_string().contains("make it first"));
        assert!(!folder.path().join("none").exists());
        let set = taskset::read(&tasks).unwrap().value;
        assert_eq!(set.tasks.len(), 2);
        assert!(set.tasks[0].expert_steps > 0 && set.tasks[0].start.is_some());
    }

    #[test]
    fn a_wish_that_follows_another_at_the_start_is_the_one_of_the_branch() {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Expert).unwrap();
        exploration.instruct("dance").unwrap();
        exploration.say(true).unwrap();
        exploration.instruct("pick up the mug").unwrap();
        while exploration.end().is_none() {
            exploration.step().unwrap();
        }
        let episode = exploration.explored().episodes.remove(0);
        assert_eq!(episode.wishes.iter().map(|wish| wish.began).collect::<Vec<_>>(), [0, 0]);
        assert_eq!((episode.success, episode.completed, episode.of), (true, 1, 1));
        assert_eq!(episode.own_steps().len(), episode.trace.len());
    }

    #[test]
    fn a_branch_is_exported_by_its_ending() {
        let folder = tempfile::tempdir().unwrap();
        let mut exploration = testing::exploration();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        for name in ["a.gif", "a.strip.png", "a.txt", "a.html", "a.png"] {
            assert!(exploration.export(&folder.path().join(name)).unwrap().contains(name));
        }
        let text = std::fs::read_to_string(folder.path().join("a.txt")).unwrap();
        assert!(text.contains("1  RotateLeft"), "{text}");
        assert!(exploration.export(&folder.path().join("a.mov")).is_err());
    }

    #[test]
    fn what_is_asked_after_a_reset_is_graded_in_its_own_branch() {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Expert).unwrap();
        let own = exploration.instruction().to_string();
        exploration.instruct("look around").unwrap();
        exploration.make_start();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        exploration.instruct(&own).unwrap();
        exploration.reset();
        while exploration.end().is_none() {
            exploration.step().unwrap();
        }
        let explored = exploration.explored();
        let graded: Vec<_> = explored.episodes.iter().map(|episode| (episode.of > 0, episode.success)).collect();
        assert_eq!(graded, [(false, false), (true, true)]);
        let subtasks: Vec<_> = explored.tasks.iter().map(|task| task.subtasks.is_empty()).collect();
        assert_eq!(subtasks, [true, false]);
    }
}
