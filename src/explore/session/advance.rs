//! Going on by itself, step after step, until something stops it.

use std::time::Duration;

use super::{RunMode, Session, SessionEvent};
use crate::explore::breakpoints::{Condition, Facts};
use crate::explore::exploration::StepTaken;

impl Session {
    /// The time between two steps of the run that is under way; `None` where none is. A counted number of steps is taken as
    /// fast as can be.
    pub(crate) fn interval(&self) -> Option<Duration> {
        self.run.mode.map(|mode| match mode {
            RunMode::Steps(_) => Duration::ZERO,
            RunMode::Replay | RunMode::Policy => self.run.rate.between_steps(),
        })
    }

    /// Takes the next step of the run that is under way.
    pub(crate) fn advance(&mut self) {
        if matches!(self.run.mode, Some(RunMode::Policy | RunMode::Steps(_))) && self.agent_is_done() {
            return;
        }
        match self.run.mode {
            None => {}
            Some(RunMode::Policy) => self.step(),
            Some(RunMode::Steps(left)) => {
                self.step();
                if self.run.mode.is_some() {
                    self.set_mode(if left <= 1 { None } else { Some(RunMode::Steps(left - 1)) });
                }
            }
            Some(RunMode::Replay) => {
                let before = self.facts();
                self.exploration.seek(self.exploration.tree().at() + 1);
                self.changed();
                self.stop_where_asked(before.as_ref());
                if self.exploration.tree().next().is_none() {
                    self.set_mode(None);
                }
            }
        }
    }

    pub(super) fn start(&mut self, mode: RunMode, until: Option<Condition>) {
        // Whoever said or chose something else here wants that, not what was done before.
        let mode = match mode {
            RunMode::Replay if !self.exploration.follows_recording() => RunMode::Policy,
            mode => mode,
        };
        let can_run = match mode {
            RunMode::Replay => self.exploration.tree().next().is_some(),
            // That there is no policy was told to whoever looks on.
            RunMode::Policy | RunMode::Steps(_) if !self.exploration.has_policy() => {
                if !self.live {
                    self.decide();
                }
                return;
            }
            RunMode::Policy | RunMode::Steps(_) => !self.is_over(),
        };
        if can_run && until.is_some() {
            self.run.until = until;
        }
        self.set_mode(can_run.then_some(mode));
    }

    /// Whether the wish in force is over; says so if it is.
    pub(super) fn is_over(&self) -> bool {
        let over = self.exploration.wish().filter(|wish| wish.verdict.is_some());
        if let Some(wish) = over {
            self.emit(SessionEvent::AlreadyOver(wish.clone()));
        }
        over.is_some()
    }

    /// Whether the run pauses here because the agent says that it is done. Whoever goes on from there is not held up again.
    fn agent_is_done(&mut self) -> bool {
        let here = (self.exploration.tree().branch(), self.exploration.tree().at());
        // What fails here is told by the step.
        let is_done = self.run.heard != Some(here) && self.exploration.comes_to_its_end().unwrap_or(false);
        if is_done {
            self.run.heard = Some(here);
            let ran = self.run.mode == Some(RunMode::Policy);
            self.set_mode(None);
            self.run.resumes = ran;
            let likely = self.exploration.decide().ok().and_then(|(decision, _)| decision.done);
            if let (Some(wish), Some(likely)) = (self.exploration.wish().cloned(), likely) {
                self.emit(SessionEvent::AgentDone { wish, likely, graded: self.exploration.graded() });
            }
            if self.live {
                self.show();
            }
        }
        is_done
    }

    /// The wish in force is over: says so, with what the agent itself says of the state.
    pub(super) fn ended(&mut self) {
        self.exploration.ask_at_the_end();
        if self.live {
            self.show();
        }
        if let Some(wish) = self.exploration.wish() {
            self.emit(SessionEvent::Ended(wish.clone()));
        }
        let resumes = self.run.resumes || self.run.mode == Some(RunMode::Policy);
        self.set_mode(None);
        self.run.resumes = resumes;
    }

    pub(super) fn step(&mut self) {
        let before = self.facts();
        match self.exploration.step() {
            Ok(taken) => {
                self.stepped(taken);
                self.stop_where_asked(before.as_ref());
            }
            Err(error) => {
                self.fail(&error);
                self.set_mode(None);
            }
        }
    }

    pub(super) fn stepped(&mut self, taken: StepTaken) {
        self.emit(SessionEvent::Stepped(Box::new(taken)));
        match self.exploration.end() {
            Some(_) => self.ended(),
            None => self.changed(),
        }
    }

    pub(super) fn set_mode(&mut self, mode: Option<RunMode>) {
        let changed = mode != self.run.mode;
        self.run.mode = mode;
        self.run.resumes = false;
        if mode.is_none() {
            self.run.until = None;
        }
        if changed {
            self.emit(SessionEvent::Running(mode));
        }
    }

    /// What the run's conditions ask of the present state, where it has any. Some ask what the policy makes of it.
    fn facts(&mut self) -> Option<Facts> {
        self.run.has_conditions().then(|| {
            // What fails here is told by the next step.
            let _ = self.exploration.decide();
            self.exploration.facts()
        })
    }

    fn stop_where_asked(&mut self, before: Option<&Facts>) {
        let (Some(before), Some(now)) = (before, self.facts()) else { return };
        if let Some(why) = self.run.stops(before, &now) {
            self.set_mode(None);
            self.emit(SessionEvent::Stopped(why));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, channel};
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::agent::policy::each_alone;
    use crate::agent::{Decision, Decisions, Observation, Policy};
    use crate::domain::{Action, ActionType};
    use crate::episode::wish::WishVerdict;
    use crate::explore::exploration::Exploration;
    use crate::explore::session::SessionCommand;
    use crate::explore::testing;

    /// Turns around, and from a step on says that it is done.
    struct Turning(u32);

    impl Policy for Turning {
        fn name(&self) -> &str {
            "turning"
        }

        fn slots(&self) -> usize {
            1
        }

        fn reset(&mut self, _slot: usize, _seed: u64) {}

        fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
            each_alone(observations, |_, here| {
                let done = Some(if here.step >= self.0 { 0.9 } else { 0.2 });
                Ok(Decision { done, ..Decision::of(Action::navigate(ActionType::RotateLeft)) })
            })
        }
    }

    fn session(says_done_from: u32, told: &str) -> (Session, Receiver<SessionEvent>) {
        let mut exploration = testing::exploration();
        exploration.act_by(Box::new(Turning(says_done_from)));
        exploration.instruct(told).unwrap();
        listened(exploration)
    }

    fn listened(exploration: Exploration) -> (Session, Receiver<SessionEvent>) {
        let (tell, events) = channel();
        let tell = Mutex::new(tell);
        (Session::on_request(exploration, Arc::new(move |event| drop(tell.lock().unwrap().send(event)))), events)
    }

    fn run(session: &mut Session, steps: u32) {
        session.apply(SessionCommand::Run { mode: RunMode::Steps(steps), until: None });
        while session.interval().is_some() {
            session.advance();
        }
    }

    fn last_word(events: &Receiver<SessionEvent>) -> String {
        let words = events.try_iter().filter_map(|event| match event {
            SessionEvent::AgentDone { wish, likely, .. } => Some(format!("agent {likely}: {}", wish.instruction)),
            SessionEvent::Ended(wish) => Some(wish.verdict_in_words()),
            _ => None,
        });
        words.last().unwrap_or_default()
    }

    #[test]
    fn a_run_pauses_once_where_the_agent_says_that_it_is_done_and_a_person_has_the_last_word() {
        let (mut session, events) = session(3, "dance");
        run(&mut session, 10);
        assert_eq!((session.exploration.tree().at(), last_word(&events).as_str()), (3, "agent 0.9: Dance."));
        run(&mut session, 4);
        assert_eq!((session.exploration.tree().at(), last_word(&events).as_str()), (7, ""));
        session.apply(SessionCommand::Say { fulfilled: true });
        assert_eq!(last_word(&events), "done, you say; the agent: done at step 3");
        assert_eq!(session.exploration.end(), Some(WishVerdict::SaidDone));
    }

    #[test]
    fn after_a_run_has_come_to_the_end_of_its_wish_the_next_wish_runs_on() {
        let (mut session, _) = session(999, "pick up the mug");
        session.apply(SessionCommand::Run { mode: RunMode::Policy, until: None });
        while session.interval().is_some() {
            session.advance();
        }
        assert!(session.exploration.end().is_some());
        session.apply(SessionCommand::Instruct("dance".into()));
        assert_eq!(session.run.mode, Some(RunMode::Policy));
        session.apply(SessionCommand::Pause);
        session.apply(SessionCommand::Instruct("sing".into()));
        assert_eq!(session.run.mode, None, "whoever paused it wants it so");
    }

    #[test]
    fn a_link_opens_as_a_branch_where_it_began_and_space_follows_what_was_done() {
        let (mut session, events) = session(999, "dance");
        run(&mut session, 3);
        session.apply(SessionCommand::OpenLink(0));
        assert!(events.try_iter().any(|event| matches!(event, SessionEvent::Refused(why) if why.contains("no chain"))));
        session.exploration.choose(crate::agent::registry::PolicyKind::Random).unwrap();
        session.apply(SessionCommand::Chain("turn around; sing".into()));
        while session.is_working() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        session.apply(SessionCommand::OpenLink(1));
        let tree = session.exploration.tree();
        assert_eq!((tree.at(), tree.last()), (3 + 20, 3 + 40), "links that nobody grades have 20 steps");
        assert_eq!(session.exploration.instruction(), "Sing.");
        session.apply(SessionCommand::Run { mode: RunMode::Replay, until: None });
        assert_eq!(session.run.mode, Some(RunMode::Replay));
    }

    #[test]
    fn going_on_in_the_past_follows_what_was_done_until_something_else_is_told_or_chosen_there() {
        let goes_on = |change: Option<SessionCommand>| {
            let mut exploration = testing::exploration();
            exploration.choose(crate::agent::registry::PolicyKind::Random).unwrap();
            let (mut session, _) = listened(exploration);
            run(&mut session, 6);
            session.apply(SessionCommand::Seek(2));
            if let Some(change) = change {
                session.apply(change);
            }
            session.apply(SessionCommand::Run { mode: RunMode::Replay, until: None });
            for _ in 0..2 {
                session.advance();
            }
            let tree = session.exploration.tree();
            (tree.branches().len(), session.exploration.instruction().to_string(), tree.at())
        };
        let task = "put the mug in the sink".to_string();
        assert_eq!(goes_on(None), (1, task.clone(), 4));
        assert_eq!(
            goes_on(Some(SessionCommand::Instruct("pick up the mug".into()))),
            (2, "Pick up the mug.".into(), 4)
        );
        assert_eq!(goes_on(Some(SessionCommand::Instruct("dance".into()))), (2, "Dance.".into(), 4));
        assert_eq!(
            goes_on(Some(SessionCommand::Choose(crate::agent::registry::PolicyKind::Expert))),
            (2, task.clone(), 4)
        );
        assert_eq!(goes_on(Some(SessionCommand::Sample(77))), (2, task.clone(), 4));
        let same = SessionCommand::Choose(crate::agent::registry::PolicyKind::Random);
        assert_eq!(goes_on(Some(same)), (1, task, 4), "the same policy again is nothing else");
        assert_eq!(goes_on(Some(SessionCommand::Reset)).0, 1, "a reset alone follows what was done");
    }

    #[test]
    fn a_run_pauses_again_after_a_reset_time_travel_and_in_the_next_house() {
        let (mut session, events) = session(3, "dance");
        run(&mut session, 10);
        assert_eq!(last_word(&events), "agent 0.9: Dance.");
        for again in [SessionCommand::Seek(0), SessionCommand::Reset, SessionCommand::Next] {
            session.apply(again.clone());
            run(&mut session, 10);
            assert_eq!(session.exploration.tree().at(), 3, "{again:?}");
            assert!(last_word(&events).starts_with("agent 0.9: "), "{again:?}");
        }
    }

    #[test]
    fn a_single_task_or_recorded_episode_stays_and_says_that_there_is_no_other() {
        let (folder, mut set) = crate::eval::evaluation::tests::tasks();
        let scenes = || crate::episode::scenes::Scenes::of(&folder.path().join("tasks.json"), &set.value);
        let opened = |tasks: Vec<crate::domain::Task>, scenes| {
            use crate::agent::registry::{Policies, PolicyKind};
            use crate::explore::episode_source::{EpisodeOrigin, EpisodeSource};
            let source = EpisodeSource::new(EpisodeOrigin::Tasks { tasks, index: 0 }, 0, scenes);
            listened(Exploration::new(source, Policies::new(Vec::new()), PolicyKind::Random, None).unwrap())
        };
        let refused = |events: &Receiver<SessionEvent>| {
            events.try_iter().find_map(|event| match event {
                SessionEvent::Refused(why) => Some(why),
                _ => None,
            })
        };
        let (all, own) = (scenes(), scenes());
        let tasks = set.value.tasks.clone();
        let many = tasks.len() as u64;
        let (mut session, events) = opened(vec![set.value.tasks.remove(0)], own);
        session.apply(SessionCommand::Act(Action::navigate(ActionType::RotateLeft)));
        for command in [SessionCommand::Next, SessionCommand::Seed(3)] {
            session.apply(command);
            assert!(refused(&events).unwrap().contains("single task or recorded episode"));
        }
        assert_eq!(session.exploration.tree().at(), 1, "it is still there");
        let (mut session, events) = opened(tasks, all);
        session.apply(SessionCommand::Seed(many + 1));
        assert!(refused(&events).unwrap().contains(&format!("they are numbered 1 to {many}")));
        session.apply(SessionCommand::Seed(1));
        assert_eq!(refused(&events), None);
    }

    #[test]
    fn the_agents_word_stands_beside_what_the_grader_of_a_task_or_a_reading_has_done() {
        let graded = |exploration: crate::explore::exploration::Exploration| {
            let (mut session, events) = listened(exploration);
            run(&mut session, 10);
            let graded = events.try_iter().find_map(|event| match event {
                SessionEvent::AgentDone { graded, .. } => Some(graded),
                _ => None,
            });
            graded.unwrap()
        };
        let told = |text: Option<&str>| {
            let mut exploration = testing::exploration();
            exploration.act_by(Box::new(Turning(3)));
            if let Some(text) = text {
                exploration.instruct(text).unwrap();
            }
            exploration
        };
        assert_eq!(graded(told(None)), Some((0, 2)), "the task's own subtasks");
        assert_eq!(graded(told(Some("pick up the mug"))), Some((0, 1)));
        assert_eq!(graded(told(Some("dance"))), None);
    }

    #[test]
    fn where_the_wish_fails_the_agents_own_word_stands_beside_the_verdict() {
        let (mut session, events) = session(999, "pick up the mug");
        run(&mut session, 999);
        assert_eq!(session.exploration.end(), Some(WishVerdict::OutOfTime));
        let said = last_word(&events);
        assert!(said.starts_with("out of time (") && said.ends_with("; the agent: not done (0.20)"), "{said}");
    }
}
