//! The session is kept in a file at every step, and taken up again from there.

use super::Exploration;
use super::state::{Autosave, Progress, Unsaved};
use crate::agent::registry::Policies;
use crate::domain::task::SceneRef;
use crate::episode::record::{Author, Episode};
use crate::explore::episode_source::{EpisodeOrigin, EpisodeSource};
use crate::explore::kept_session::KeptSession;
use crate::explore::session_file::SessionFile;

/// States up to which a run writes the file at every step; it is written less often in larger trees.
const EVERY_STEP: usize = 2000;

impl Exploration {
    /// Something changed that neither a step nor a word tells.
    pub(super) fn write_again(&mut self) {
        self.autosave.written = None;
    }

    /// The session was taken up from that file.
    pub(crate) fn taken_from(mut self, file: SessionFile) -> Exploration {
        self.autosave.file = Some(file);
        self
    }

    /// Keeps the session in that file from now on.
    pub(crate) fn kept_in(mut self, file: SessionFile) -> Exploration {
        if let Some(taken) = self.autosave.file.take() {
            file.go_on_with(&taken);
        }
        self.autosave = Autosave { file: Some(file), written: Some(self.reached()) };
        self
    }

    /// What was tried or told since it was last saved as a run.
    pub(crate) fn unsaved(&self) -> Unsaved {
        Unsaved {
            branches: self.tree.branches().len().saturating_sub(self.saved.branches.max(1)),
            wishes: self.told.saturating_sub(self.saved.wishes),
        }
    }

    /// All of it is in a run folder, or belongs to the start.
    pub(super) fn count_as_saved(&mut self) {
        self.saved = Unsaved { branches: self.tree.branches().len(), wishes: self.told };
    }

    fn reached(&self) -> Progress {
        Progress {
            episode: self.episode.number,
            states: self.tree.states(),
            branches: self.tree.branches().len(),
            told: self.told,
            branch: self.tree.branch(),
            step: self.tree.at(),
            is_over: self.end().is_some(),
        }
    }

    /// Writes the session to its file where it has changed; nothing while nothing was tried. What cannot be written is told to the
    /// log alone: the session goes on.
    pub(crate) fn autosave(&mut self, is_running: bool) {
        let Some(file) = self.autosave.file.clone() else { return };
        let now = self.reached();
        let is_known = self.autosave.written == Some(now);
        let is_untouched = now.states == 1 && self.unsaved().is_empty();
        if is_known || is_untouched {
            return;
        }
        let fresh = self.autosave.written.map_or(usize::MAX, |before| now.states.saturating_sub(before.states));
        let soon = is_running && fresh > 0 && fresh < now.states / EVERY_STEP;
        if soon {
            return;
        }
        if let Err(error) = file.write(&self.as_kept()) {
            tracing::warn!("{error:#}");
        }
        self.autosave.written = Some(now);
    }

    /// Everything that was tried, and what is in hand.
    pub(crate) fn as_kept(&self) -> KeptSession {
        let scene = self.rollout.env.house.scene();
        let chosen = self.checkpoints.get(self.policies.chosen());
        KeptSession {
            format_version: KeptSession::FORMAT,
            scene: matches!(self.episode.reference, SceneRef::Named(_)).then(|| (**scene).clone()),
            reference: self.episode.reference.clone(),
            start: (*self.tree.start().world).clone(),
            task: self.episode.task.clone(),
            limited: self.episode.limited,
            episodes: self.branch_episodes(),
            branch: self.tree.branch(),
            step: self.tree.at(),
            policy: self.acting.kind.name().into(),
            checkpoint: chosen.cloned(),
            author: self.acting.author.clone(),
            is_unsaved: !self.unsaved().is_empty(),
        }
    }

    /// Takes up a session where it was left: every branch is taken again, without asking a policy.
    ///
    /// # Errors
    /// When it is broken, or a step does not come to what was recorded.
    pub(crate) fn take_up(kept: &KeptSession, mut policies: Policies) -> anyhow::Result<Exploration> {
        // A checkpoint that is gone is no reason to lose what was tried.
        if let Some(name) = &kept.checkpoint {
            drop(policies.choose(name));
        }
        let origin = EpisodeOrigin::Kept(Box::new(kept.episode_start()?));
        let source = EpisodeSource::kept(origin, kept.author.seed);
        let mut exploration = Exploration::new(source, policies, kept.kind(), None)?;
        for episode in &kept.episodes {
            exploration.take_branch_again(episode)?;
        }
        exploration.acting.author = kept.author.clone();
        let branch = kept.branch.min(exploration.tree.branches().len() - 1);
        exploration.switch(branch)?;
        exploration.seek(kept.step);
        exploration.count_as_saved();
        if kept.is_unsaved {
            exploration.saved = Unsaved { branches: 1, wishes: 0 };
            exploration.told = exploration.wishes.iter().filter(|wish| wish.is_told()).count() as u32;
        }
        Ok(exploration)
    }

    fn take_branch_again(&mut self, episode: &Episode) -> anyhow::Result<()> {
        self.back_to_task();
        let author = Author::of("", 0);
        self.retrace(episode, &author, false)?;
        // It has that name already where it is the first, or was numbered alike.
        self.tree.rename(self.tree.branch(), &episode.task);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::registry::PolicyKind;
    use crate::domain::{Action, ActionType};
    use crate::explore::{session_file, testing};

    /// A session with two branches, a wish that was told on the way, and a name.
    fn explored() -> Exploration {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Random).unwrap();
        for _ in 0..6 {
            exploration.step().unwrap();
        }
        exploration.seek(3);
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        exploration.instruct("pick up the mug").unwrap();
        exploration.step().unwrap();
        exploration.rename(1, "left turn").unwrap();
        exploration
    }

    fn branches(exploration: &Exploration) -> Vec<(String, u32)> {
        let tree = exploration.tree();
        let names = tree.branches().iter().map(|branch| branch.name.clone());
        names.enumerate().map(|(at, name)| (name, tree.length(at))).collect()
    }

    #[test]
    fn a_session_is_kept_at_every_step_and_taken_up_where_it_was_left() {
        let folder = tempfile::tempdir().unwrap();
        let file = SessionFile::beside(&folder.path().join("session.json"));
        let path = folder.path().join("session-1.json");
        let mut before = testing::exploration().kept_in(file.clone());
        before.autosave(true);
        assert!(!path.exists(), "nothing was tried yet");
        before.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        before.autosave(true);
        assert_eq!(KeptSession::read(&path).unwrap().step, 1);
        let mut before = explored().kept_in(file);
        before.seek(4);
        before.autosave(false);
        let kept = KeptSession::read(&path).unwrap();
        let mut after = Exploration::take_up(&kept, Policies::new(Vec::new())).unwrap();
        assert_eq!(branches(&after), branches(&before));
        assert_eq!((after.tree().branch(), after.tree().at()), (1, 4));
        assert_eq!(after.rollout().env.house.world().digest(), before.rollout().env.house.world().digest());
        assert_eq!(after.instruction(), before.instruction());
        assert_eq!(
            serde_json::to_value(after.as_kept().episodes).unwrap(),
            serde_json::to_value(kept.episodes).unwrap()
        );
        for (branch, step) in [(0, 6), (1, 5)] {
            for one in [&mut before, &mut after] {
                one.switch(branch).unwrap();
                one.seek(step);
            }
            assert_eq!(after.rollout().env.house.world().digest(), before.rollout().env.house.world().digest());
        }
    }

    #[test]
    fn a_session_that_nobody_saved_is_put_aside_when_another_one_ends() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("session.json");
        let file = SessionFile::beside(&last);
        let mut first = explored().kept_in(file.clone());
        first.write_again();
        first.autosave(false);
        file.end();
        // Taken up again it is the same session.
        let taken = SessionFile::take(&last, &last).unwrap();
        let read = KeptSession::read(&last).unwrap();
        let again = Exploration::take_up(&read, Policies::new(Vec::new())).unwrap();
        let file = SessionFile::beside(&last);
        let mut again = again.taken_from(taken).kept_in(file.clone());
        again.seek(1);
        again.autosave(false);
        file.end();
        let before = session_file::before(&last);
        assert!(!before.exists());
        assert_eq!(KeptSession::read(&last).unwrap().step, 1);
        let file = SessionFile::beside(&last);
        let mut other = testing::exploration().kept_in(file.clone());
        other.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        other.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        other.autosave(false);
        assert_eq!(KeptSession::read(&last).unwrap().step, 1, "it is not over yet");
        file.end();
        assert_eq!(KeptSession::read(&before).unwrap().episodes.len(), 2, "in the same house, too");
        assert_eq!(KeptSession::read(&last).unwrap().step, 2);
    }

    #[test]
    fn branches_and_wishes_are_unsaved_until_they_are_kept_as_a_run() {
        let folder = tempfile::tempdir().unwrap();
        let mut exploration = testing::exploration();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        assert!(exploration.unsaved().is_empty(), "a step alone is nothing to ask about");
        let mut exploration = explored();
        assert_eq!(exploration.unsaved().words(), "1 branch, 1 wish");
        let again = Exploration::take_up(&exploration.as_kept(), Policies::new(Vec::new())).unwrap();
        assert!(!again.unsaved().is_empty());
        exploration.keep(Some(folder.path().join("run"))).unwrap();
        assert!(exploration.unsaved().is_empty());
        exploration.instruct("dance").unwrap();
        assert_eq!(exploration.unsaved().words(), "1 wish");
        exploration.next_episode().unwrap();
        assert!(exploration.unsaved().is_empty());
    }

    #[test]
    fn a_kept_session_that_is_broken_is_refused_and_a_generated_house_goes_on_to_the_next() {
        let mut kept = explored().as_kept();
        kept.scene = None;
        assert!(Exploration::take_up(&kept, Policies::new(Vec::new())).is_err());
        let source = EpisodeSource::new(
            EpisodeOrigin::Generated(crate::domain::Room::Kitchen),
            4,
            crate::episode::scenes::Scenes::in_folder(None),
        );
        let mut exploration = Exploration::new(source, Policies::new(Vec::new()), PolicyKind::Random, None).unwrap();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        let mut again = Exploration::take_up(&exploration.as_kept(), Policies::new(Vec::new())).unwrap();
        assert_eq!(again.snapshot().scene.name, exploration.snapshot().scene.name);
        again.next_episode().unwrap();
        exploration.next_episode().unwrap();
        assert_eq!(again.snapshot().scene.name, exploration.snapshot().scene.name);
    }
}
