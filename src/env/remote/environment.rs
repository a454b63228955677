//! An environment in another process, behind the seam.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::Context;

use super::session::{Patience, Session};
use crate::domain::{Action, Class, EnvironmentName, Instance};
use crate::env::environment::{Environment, Snapshot, Transition};
use crate::env::observation::RemoteObservation;
use crate::env::remote_view::RemoteView;
use crate::house::view::{Candidate, Frame};
use crate::house::{Outcome, Reason};

/// One episode in a session with an environment in another process.
pub(crate) struct RemoteEnvironment {
    session: Arc<Session>,
    label: String,
    seed: u64,
    present: RemoteObservation,
    frame: Option<Frame>,
}

impl RemoteEnvironment {
    /// The episode of that seed, at its start.
    ///
    /// # Errors
    /// When the environment fails.
    pub(crate) fn begin(session: Arc<Session>, seed: u64) -> anyhow::Result<RemoteEnvironment> {
        let label = session.name.to_string();
        let mut environment =
            RemoteEnvironment { session, label, seed, present: RemoteObservation::default(), frame: None };
        environment.reset()?;
        Ok(environment)
    }

    /// The session that it is an episode of.
    pub(crate) fn session(&self) -> &Arc<Session> {
        &self.session
    }

    fn show(&mut self, observation: RemoteObservation) {
        (self.present, self.frame) = (observation, None);
    }
}

impl Environment for RemoteEnvironment {
    fn name(&self) -> &str {
        &self.label
    }

    fn reset(&mut self) -> anyhow::Result<()> {
        let start = self.session.reset(self.seed)?;
        self.show(start);
        Ok(())
    }

    fn frame(&mut self) -> anyhow::Result<&Frame> {
        if self.frame.is_none() {
            let picture = self.present.picture.clone().with_context(|| format!("{} shows no pictures", self.label))?;
            let (width, height, rgb) = (picture.width, picture.height, picture.rgb);
            // How far away things are, and which, it does not tell.
            self.frame = Some(Frame { width, height, rgb, depth: Vec::new(), ids: Vec::new() });
        }
        self.frame.as_ref().context("no frame")
    }

    fn legal_actions(&mut self) -> anyhow::Result<Vec<Candidate>> {
        Ok(Vec::new())
    }

    fn step(&mut self, action: Action) -> anyhow::Result<Transition> {
        let before = self.present.grading().map_or(0, |(done, _)| done);
        let Some(observation) = self.session.step(action)? else {
            let outcome = Outcome::Impossible(Reason::Refused);
            return Ok(Transition { outcome, completed_subtask: false, reward: None });
        };
        let reward = observation.reward;
        self.show(observation);
        let completed_subtask = self.present.grading().map_or(0, |(done, _)| done) > before;
        Ok(Transition { outcome: Outcome::Done, completed_subtask, reward })
    }

    fn class_of(&self, _instance: Instance) -> Option<Class> {
        None
    }

    fn fingerprint(&self) -> Option<String> {
        Some(self.present.digest.clone())
    }

    fn seed(&self) -> Option<u64> {
        Some(self.seed).filter(|_| self.session.capabilities.seeds != Some(false))
    }

    fn grading(&self) -> Option<(usize, usize)> {
        self.present.grading()
    }

    fn own(&self) -> Option<RemoteView<'_>> {
        Some(RemoteView { space: &self.session.space, observation: &self.present })
    }

    fn snapshot(&self) -> Option<Snapshot> {
        if !self.session.capabilities.snapshot {
            return None;
        }
        self.session.snapshot().ok().map(|id| Snapshot::of((Arc::as_ptr(&self.session) as usize, id)))
    }

    fn restore(&mut self, snapshot: &Snapshot) -> anyhow::Result<()> {
        let own = Arc::as_ptr(&self.session) as usize;
        let (session, id): &(usize, String) =
            snapshot.get().with_context(|| format!("this state is of another environment than {}", self.label))?;
        anyhow::ensure!(*session == own, "this state is of an earlier session with {}", self.label);
        let state = self.session.restore(id)?;
        self.show(state);
        Ok(())
    }
}

/// How environments in other processes are reached.
#[derive(Clone, Debug)]
pub struct RemoteSettings {
    /// How long is waited for them.
    pub(crate) patience: Patience,
    /// Where the environment of every task is found now, if not under the name in the task: a server's address may change.
    pub(crate) found_at: Option<EnvironmentName>,
}

impl Default for RemoteSettings {
    fn default() -> RemoteSettings {
        RemoteSettings { patience: Patience::USUAL, found_at: None }
    }
}

/// Sessions that are used again for episode after episode; by whoever plays, in the slots of its policy.
pub(crate) struct Sessions {
    remote: RemoteSettings,
    open: BTreeMap<(usize, EnvironmentName), Arc<Session>>,
}

impl Sessions {
    /// None is open yet.
    pub(crate) fn new(remote: RemoteSettings) -> Sessions {
        Sessions { remote, open: BTreeMap::new() }
    }

    /// A session for a slot: the one that it had, unless that broke.
    ///
    /// # Errors
    /// When the environment cannot be reached.
    pub(crate) fn get(&mut self, slot: usize, name: &EnvironmentName) -> anyhow::Result<Arc<Session>> {
        let name = self.remote.found_at.as_ref().unwrap_or(name);
        let key = (slot, name.clone());
        self.open.retain(|_, session| !session.is_broken());
        if let Some(session) = self.open.get(&key) {
            return Ok(session.clone());
        }
        let session = Arc::new(Session::open(name, self.remote.patience)?);
        self.open.insert(key, session.clone());
        Ok(session)
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::super::testing::{Fault, serve};
    use super::*;
    use crate::env::remote_view::Possible;

    fn sessions(answer: Duration) -> Sessions {
        let patience = Patience { answer, ..Patience::USUAL };
        Sessions::new(RemoteSettings { patience, found_at: None })
    }

    fn begin(fault: Fault, answer: Duration) -> RemoteEnvironment {
        RemoteEnvironment::begin(sessions(answer).get(0, &serve(fault)).unwrap(), 2).unwrap()
    }

    fn right(environment: &RemoteEnvironment) -> Action {
        environment.own().unwrap().space.find("right", None).unwrap()
    }

    /// Goes right until that fails, at the most as often as the corridor is long.
    fn walk(environment: &mut RemoteEnvironment) -> anyhow::Result<Transition> {
        let right = right(environment);
        let mut last = environment.step(right)?;
        for _ in 0..4 {
            last = environment.step(right)?;
        }
        Ok(last)
    }

    #[test]
    fn an_episode_begins_where_its_seed_says_and_is_played_to_its_end() {
        let mut environment = begin(Fault::None, Duration::from_secs(5));
        assert_eq!(environment.own().unwrap().mission(), "go to the right end");
        let frame = environment.frame().unwrap();
        assert_eq!((frame.width, frame.height, frame.rgb[0]), (4, 3, 40));
        let start = environment.fingerprint();
        let last = walk(&mut environment).unwrap();
        assert_eq!((last.completed_subtask, last.reward), (true, Some(1.0)));
        assert_eq!(environment.grading(), Some((1, 1)));
        assert!(environment.own().unwrap().observation.done);
        environment.reset().unwrap();
        assert_eq!((environment.fingerprint(), environment.grading()), (start, Some((0, 1))));
    }

    #[test]
    fn what_is_not_legal_is_not_possible_and_a_picture_may_change_its_size() {
        let mut environment = begin(Fault::Resizes, Duration::from_secs(5));
        let left = environment.own().unwrap().space.find("left", None).unwrap();
        environment.step(left).unwrap();
        environment.step(left).unwrap();
        let possible = environment.own().unwrap().possible();
        assert_eq!(possible, [Possible { action: 1, with: None }]);
        environment.step(right(&environment)).unwrap();
        let frame = environment.frame().unwrap();
        assert_eq!((frame.width, frame.height), (2, 5));
    }

    #[test]
    fn a_state_is_gone_back_to_where_the_environment_can() {
        let mut environment = begin(Fault::None, Duration::from_secs(5));
        environment.step(right(&environment)).unwrap();
        let (snapshot, there) = (environment.snapshot().unwrap(), environment.fingerprint());
        environment.step(right(&environment)).unwrap();
        environment.restore(&snapshot).unwrap();
        assert_eq!(environment.fingerprint(), there);
        let mut other = begin(Fault::None, Duration::from_secs(5));
        assert!(other.restore(&snapshot).unwrap_err().to_string().contains("earlier session"));
    }

    #[test]
    fn a_foreign_server_is_known_by_its_schema_alone() {
        let mut environment = begin(Fault::Foreign, Duration::from_secs(5));
        assert_eq!(environment.own().unwrap().observation.text.as_deref(), Some("{\n  \"cell\": 2\n}"));
        walk(&mut environment).unwrap();
        assert_eq!((environment.grading(), environment.own().unwrap().observation.done), (None, true));
        assert!(environment.snapshot().is_none());
        assert!(environment.frame().unwrap_err().to_string().contains("shows no pictures"));
    }

    #[test]
    fn whatever_a_server_does_wrong_is_one_error_in_time_and_the_next_episode_begins_anew() {
        for (fault, told) in [
            (Fault::Rubbish, "no JSON"),
            (Fault::Leaves, "closed the connection"),
            (Fault::Hangs, "did not answer within 0.3 s"),
            (Fault::Drips, "did not answer within 0.3 s"),
            (Fault::Short, "4 x 3 pixels have 36 bytes, but 35 came"),
            (Fault::Huge, "more than 100 MiB"),
        ] {
            let (name, mut sessions) = (serve(fault), sessions(Duration::from_millis(300)));
            let session = sessions.get(0, &name).unwrap();
            let mut environment = RemoteEnvironment::begin(session.clone(), 2).unwrap();
            let began = Instant::now();
            let error = format!("{:#}", walk(&mut environment).unwrap_err());
            assert!(error.contains(told) && error.contains("openenv:ws://127.0.0.1"), "{fault:?}: {error}");
            assert!(began.elapsed() < Duration::from_secs(20), "{fault:?}");
            assert!(session.is_broken(), "{fault:?}");
            let again = sessions.get(0, &name).unwrap();
            RemoteEnvironment::begin(again, 2).unwrap();
        }
    }

    #[test]
    fn a_step_that_is_refused_is_an_outcome_and_changes_nothing() {
        let mut environment = begin(Fault::Refuses, Duration::from_secs(5));
        let right = right(&environment);
        environment.step(right).unwrap();
        environment.step(right).unwrap();
        let before = environment.fingerprint();
        let refused = environment.step(right).unwrap();
        assert_eq!((refused.outcome, environment.fingerprint()), (Outcome::Impossible(Reason::Refused), before));
    }

    #[test]
    fn a_server_that_is_not_there_is_named() {
        let nobody = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let name: EnvironmentName = format!("openenv:127.0.0.1:{nobody}").parse().unwrap();
        let error = format!("{:#}", sessions(Duration::from_secs(1)).get(0, &name).err().unwrap());
        assert!(error.contains(&name.to_string()) && error.contains("cannot connect"), "{error}");
    }
}
