//! The one thread that owns house and policy. It takes commands and answers with reports; the screen never waits for it.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::breakpoints::{Condition, Facts};
use super::chained::Chained;
use super::engine::{Engine, Event, Snapshot};
use super::policies::PolicyKind;
use super::timeline::Divergence;
use crate::agent::{Decision, Values};
use crate::domain::Action;
use crate::run::chain::Chain;
use crate::run::contrast::Contrast;
use crate::run::landscape::{Landscape, survey};
use crate::run::rollout::End;

/// What the screen asks of the worker.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Go on by itself in that way, or stop.
    Go(Option<Going>),
    /// One step by the policy's choice.
    Step,
    /// One step that a person chose.
    Act(Action),
    /// Tell the agent something else.
    Instruct(String),
    /// Back to the start.
    Reset,
    /// The next house or task.
    Next,
    /// The house of that seed.
    Seed(u64),
    /// Another policy.
    Choose(PolicyKind),
    /// Another checkpoint.
    Checkpoint(String),
    /// Another chance for the policy; whether its actions are drawn.
    Reseed(u64, bool),
    /// How fast it runs.
    Pace(Pace),
    /// To a step of the branch in hand.
    Seek(u32),
    /// To the branch of that name or number.
    Switch(String),
    /// Another name for the branch in hand.
    Rename(String),
    /// How the branch of that name or number and the one in hand part.
    Diverge(String),
    /// Where runs stop.
    Break(Vec<Condition>),
    /// Run until that holds.
    Until(Condition),
    /// The instruction in force and another, in this state.
    Compare(String),
    /// The value of every cell for the instruction in force.
    Survey,
    /// Follow a chain; empty for the task's own.
    Chain(String),
    /// Which link of the last chain breaks, with so many draws.
    WhichLink(u32),
    /// Stop work in the background.
    Stop,
    /// Write what was explored as a run, into that folder or a new one.
    Save(Option<PathBuf>),
    /// Add the present state as a task to a file.
    SaveTask(PathBuf),
    /// Write the branch in hand in the form that the file's ending asks for.
    Export(PathBuf),
    /// Whether snapshots hold the frames before the present one.
    LookBack(bool),
}

/// How it goes on by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Going {
    /// Along what was recorded, to its end.
    Replay,
    /// As the policy chooses.
    Policy,
}

/// What the worker tells the screen.
#[derive(Clone, Debug)]
pub enum Report {
    /// The present state.
    Seen(Box<Snapshot>),
    /// A step was taken.
    Stepped(Event),
    /// What the policy would do next, with the action in words, and what its critics say.
    Thought(Decision, String, Option<Values>),
    /// It goes on by itself, or no longer.
    Going(Option<Going>),
    /// Something slow goes on (or nothing any more).
    Busy(Option<String>),
    /// The instruction changed, and what that means.
    Instructed {
        /// What the agent was told.
        old: String,
        /// What it is told now.
        new: String,
        /// What that means for the task.
        note: &'static str,
    },
    /// The episode is over.
    Ended(End),
    /// A condition stopped the run.
    Stopped(String),
    /// How two branches part.
    Diverged(Divergence),
    /// What two instructions come to.
    Compared(Box<Contrast>),
    /// The values of the cells so far.
    Surveyed(Arc<Landscape>),
    /// A chain so far.
    Chained(Box<Chained>),
    /// Work in the background, with how far it is; nothing when it is over.
    Working(Option<String>),
    /// Something went well and is worth a line.
    Noted(String),
    /// Something could not be done; the episode itself goes on.
    Refused(String),
    /// The policy cannot go on.
    Failed(String),
}

/// How fast the policy runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace(usize);

impl Pace {
    /// Steps a second; none for as fast as it can.
    const LEVELS: [(Option<f32>, &'static str); 8] = [
        (Some(0.5), "0.5/s"),
        (Some(1.0), "1/s"),
        (Some(2.0), "2/s"),
        (Some(4.0), "4/s"),
        (Some(8.0), "8/s"),
        (Some(15.0), "15/s"),
        (Some(30.0), "30/s"),
        (None, "full speed"),
    ];
    /// Slow enough to follow.
    pub const START: Pace = Pace(3);

    /// The next faster one.
    pub fn faster(self) -> Pace {
        Pace((self.0 + 1).min(Self::LEVELS.len() - 1))
    }

    /// The next slower one.
    pub fn slower(self) -> Pace {
        Pace(self.0.saturating_sub(1))
    }

    /// In words.
    pub fn name(self) -> &'static str {
        Self::LEVELS[self.0].1
    }

    fn between_steps(self) -> Duration {
        Self::LEVELS[self.0].0.map_or(Duration::ZERO, |rate| Duration::from_secs_f32(1.0 / rate))
    }
}

/// Starts the worker. `open` makes the engine on the worker's thread; reports go to `tell`, which says whether anybody still
/// listens.
///
/// # Errors
/// When the system has no thread left.
pub fn start(
    open: impl FnOnce() -> anyhow::Result<Engine> + Send + 'static,
    tell: impl Fn(Report) -> bool + Send + Sync + 'static,
) -> std::io::Result<Sender<Command>> {
    let (commands, inbox) = channel();
    std::thread::Builder::new().name("worker".into()).spawn(move || match open() {
        Ok(engine) => Worker {
            engine,
            tell: Arc::new(tell),
            going: None,
            pace: Pace::START,
            due: Instant::now(),
            breaks: Vec::new(),
            until: None,
            chain: None,
            surveys: Arc::default(),
            background: Background::default(),
        }
        .work(&inbox),
        Err(error) => super::terminal::say_last_words(format!("{error:#}")),
    })?;
    Ok(commands)
}

struct Worker<T> {
    engine: Engine,
    tell: Arc<T>,
    going: Option<Going>,
    pace: Pace,
    due: Instant,
    breaks: Vec<Condition>,
    /// A condition for this run alone.
    until: Option<Condition>,
    /// The chain that was followed last.
    chain: Option<Chain>,
    surveys: Surveys,
    background: Background,
}

/// Finished surveys by policy, instruction and world.
type Surveys = Arc<Mutex<HashMap<(String, String, String), Arc<Landscape>>>>;

/// Work on a thread of its own, one at a time.
#[derive(Default)]
struct Background {
    stop: Arc<AtomicBool>,
}

impl Background {
    /// Stops what is under way and starts something else.
    fn start(&mut self, work: impl FnOnce(&AtomicBool) + Send + 'static) {
        self.stop();
        let stop = self.stop.clone();
        // Without a thread left nothing is computed; the screen stays as it is.
        let _ = std::thread::Builder::new().name("background".into()).spawn(move || work(&stop));
    }

    fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.stop = Arc::default();
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.stop();
    }
}

impl<T: Fn(Report) -> bool + Send + Sync + 'static> Worker<T> {
    fn work(mut self, inbox: &Receiver<Command>) {
        self.show();
        if self.engine.has_policy() {
            (self.tell)(Report::Busy(None));
            self.think();
        } else {
            self.choose(self.engine.policy());
        }
        loop {
            let command = if self.going.is_some() {
                match inbox.recv_timeout(self.due.saturating_duration_since(Instant::now())) {
                    Ok(command) => Some(command),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => return,
                }
            } else {
                match inbox.recv() {
                    Ok(command) => Some(command),
                    Err(_) => return,
                }
            };
            let heard = match command {
                Some(command) => self.obey(command),
                None => {
                    self.due = Instant::now() + self.pace.between_steps();
                    self.go_on()
                }
            };
            if !heard {
                return;
            }
        }
    }

    /// Carries out a command; false when nobody listens any more.
    fn obey(&mut self, command: Command) -> bool {
        match command {
            Command::Go(going) => self.start_going(going),
            Command::Until(condition) => {
                self.until = Some(condition);
                self.start_going(Some(Going::Policy))
            }
            Command::Step => {
                self.go(None);
                if self.over() { true } else { self.step() }
            }
            Command::Act(action) => {
                self.go(None);
                if self.over() {
                    return true;
                }
                let event = self.engine.act(action);
                self.stepped(event)
            }
            Command::Instruct(text) => {
                let old = self.engine.instruction().to_string();
                match self.engine.instruct(&text) {
                    Ok(note) => {
                        let new = self.engine.instruction().to_string();
                        (self.tell)(Report::Instructed { old, new, note }) && self.show() && self.think()
                    }
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Reset => {
                self.engine.reset();
                self.go(None) && self.show() && self.think()
            }
            Command::Next | Command::Seed(_) => {
                self.due = Instant::now() + self.pace.between_steps();
                let opened = match command {
                    Command::Seed(seed) => self.engine.seed(seed),
                    _ => self.engine.next_episode(),
                };
                match opened {
                    Ok(()) => self.show() && self.think(),
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Choose(kind) => self.choose(kind),
            Command::Checkpoint(wanted) => {
                (self.tell)(Report::Busy(Some(format!("loading {wanted}"))));
                let chosen = self.engine.checkpoint(&wanted);
                self.chosen(chosen)
            }
            Command::Reseed(seed, samples) => {
                self.engine.reseed(seed, samples);
                self.show() && self.think()
            }
            Command::Pace(pace) => {
                self.pace = pace;
                self.due = self.due.min(Instant::now() + pace.between_steps());
                true
            }
            Command::Seek(step) => {
                self.engine.seek(step);
                self.go(None) && self.show() && self.think()
            }
            Command::Switch(wanted) => {
                let switched = self.engine.branch(&wanted).and_then(|branch| self.engine.switch(branch));
                match switched {
                    Ok(()) => self.go(None) && self.show() && self.think(),
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Rename(name) => match self.engine.rename(self.engine.tree().branch(), &name) {
                Ok(()) => self.show(),
                Err(error) => self.refuse(&error),
            },
            Command::Diverge(wanted) => match self.engine.branch(&wanted) {
                Ok(branch) => (self.tell)(Report::Diverged(self.engine.divergence(branch))),
                Err(error) => self.refuse(&error),
            },
            Command::Break(breaks) => {
                self.breaks = breaks;
                true
            }
            Command::Compare(other) => {
                let compared = self.engine.contrast(&other);
                match compared {
                    Ok(contrast) => (self.tell)(Report::Compared(Box::new(contrast))),
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Survey => self.survey(),
            Command::Chain(text) => {
                let chain = self.engine.chain(&text);
                match chain {
                    Ok(chain) => {
                        self.chain = Some(chain);
                        self.follow(None)
                    }
                    Err(error) => self.refuse(&error),
                }
            }
            Command::WhichLink(times) => self.follow(Some(times)),
            Command::Stop => {
                self.background.stop();
                (self.tell)(Report::Working(None))
            }
            Command::Save(path) => {
                let kept = self.engine.keep(path);
                self.kept(kept)
            }
            Command::SaveTask(path) => {
                let kept = self.engine.keep_task(&path);
                self.kept(kept)
            }
            Command::Export(path) => {
                (self.tell)(Report::Busy(Some(format!("writing {}", path.display()))));
                let kept = self.engine.export(&path);
                (self.tell)(Report::Busy(None));
                self.kept(kept)
            }
            Command::LookBack(looks_back) => {
                self.engine.set_looking_back(looks_back);
                self.show()
            }
        }
    }

    /// Surveys the cells in the background, unless that was done before.
    fn survey(&mut self) -> bool {
        let told = self.engine.instruction().to_string();
        let key = (self.engine.author().policy.clone(), told.clone(), self.engine.rollout().house.world().digest());
        if let Some(known) = self.surveys.lock().unwrap_or_else(PoisonError::into_inner).get(&key) {
            return (self.tell)(Report::Surveyed(known.clone()));
        }
        let policy = match self.engine.another_policy() {
            Ok(policy) => policy,
            Err(error) => return self.refuse(&error),
        };
        let house = &self.engine.rollout().house;
        let (scene, world) = (house.scene().clone(), house.world().clone());
        let (tell, surveys) = (self.tell.clone(), self.surveys.clone());
        self.background.start(move |stop| {
            let mut policy = policy;
            let mut visit = |found: &Landscape| {
                let far = format!("values {}/{}", found.heights.len(), found.of);
                tell(Report::Working(Some(far))) && tell(Report::Surveyed(Arc::new(found.clone())))
            };
            let found = survey(policy.as_mut(), &scene, &world, &told, stop, &mut visit);
            let over = match found {
                Ok(found) if found.heights.len() == found.of => {
                    surveys.lock().unwrap_or_else(PoisonError::into_inner).insert(key, Arc::new(found));
                    true
                }
                Ok(_) => true,
                Err(error) => tell(Report::Refused(format!("{error:#}"))),
            };
            let _ = over && tell(Report::Working(None));
        });
        true
    }

    /// Follows the chain in the background; with `times`, also which link breaks.
    fn follow(&mut self, times: Option<u32>) -> bool {
        let Some(chain) = self.chain.clone() else {
            return (self.tell)(Report::Refused(
                "there is no chain yet: type one (chain A; B; ...), or chain alone".into(),
            ));
        };
        let policy = match self.engine.another_policy() {
            Ok(policy) => policy,
            Err(error) => return self.refuse(&error),
        };
        let tell = self.tell.clone();
        self.background.start(move |stop| {
            let mut policy = policy;
            if let Err(error) = Chained::work(&chain, policy.as_mut(), times, stop, &|report| tell(report)) {
                tell(Report::Refused(format!("{error:#}")));
            }
            tell(Report::Working(None));
        });
        true
    }

    fn start_going(&mut self, going: Option<Going>) -> bool {
        self.due = Instant::now();
        match going {
            None => {
                self.until = None;
                self.go(None)
            }
            Some(Going::Replay) => {
                let is_there = self.engine.tree().next().is_some();
                self.go(is_there.then_some(Going::Replay))
            }
            // Without a policy there is nothing to run; that it is missing was told.
            Some(Going::Policy) if !self.engine.has_policy() => true,
            Some(Going::Policy) => {
                let over = self.over();
                self.go((!over).then_some(Going::Policy))
            }
        }
    }

    /// Whether the episode is over; says so again if it is.
    fn over(&mut self) -> bool {
        let end = self.engine.end();
        if let Some(end) = end {
            (self.tell)(Report::Ended(end));
        }
        end.is_some()
    }

    fn choose(&mut self, kind: PolicyKind) -> bool {
        (self.tell)(Report::Busy(Some(format!("loading the {} policy", kind.name()))));
        let chosen = self.engine.choose(kind);
        self.chosen(chosen)
    }

    fn chosen(&mut self, chosen: anyhow::Result<()>) -> bool {
        (self.tell)(Report::Busy(None));
        match chosen {
            Ok(()) => self.show() && self.think(),
            Err(error) => {
                self.go(None);
                let before = self.show() && (!self.engine.has_policy() || self.think());
                before && self.fail(&error)
            }
        }
    }

    /// The next step of what goes on by itself.
    fn go_on(&mut self) -> bool {
        match self.going {
            Some(Going::Replay) => {
                let before = self.engine.facts();
                self.engine.seek(self.engine.tree().at() + 1);
                let over = self.engine.tree().next().is_none();
                self.show() && self.think() && self.stop_at(&before) && (!over || self.go(None))
            }
            _ => self.step(),
        }
    }

    fn step(&mut self) -> bool {
        let before = self.engine.facts();
        match self.engine.step() {
            Ok(event) => self.stepped(event) && self.stop_at(&before),
            Err(error) => self.fail(&error) && self.go(None),
        }
    }

    fn stepped(&mut self, event: Event) -> bool {
        (self.tell)(Report::Stepped(event))
            && self.show()
            && match self.engine.end() {
                Some(end) => (self.tell)(Report::Ended(end)) && self.go(None),
                None => self.think(),
            }
    }

    /// Stops where a condition says so.
    fn stop_at(&mut self, before: &Facts) -> bool {
        if self.going.is_none() {
            return true;
        }
        let now = self.engine.facts();
        match self.breaks.iter().chain(&self.until).find_map(|condition| condition.hit(before, &now)) {
            Some(why) => self.go(None) && (self.tell)(Report::Stopped(why)),
            None => true,
        }
    }

    fn go(&mut self, going: Option<Going>) -> bool {
        let changed = going != self.going;
        self.going = going;
        if going.is_none() {
            self.until = None;
        }
        !changed || (self.tell)(Report::Going(going))
    }

    fn show(&mut self) -> bool {
        let snapshot = self.engine.snapshot();
        (self.tell)(Report::Seen(Box::new(snapshot)))
    }

    fn think(&mut self) -> bool {
        match self.engine.think().cloned() {
            Ok((decision, values)) => {
                let words = self.engine.words(decision.action);
                (self.tell)(Report::Thought(decision, words, values))
            }
            Err(error) => self.fail(&error),
        }
    }

    fn fail(&self, error: &anyhow::Error) -> bool {
        tracing::warn!("{error:#}");
        (self.tell)(Report::Failed(format!("{error:#}")))
    }

    fn kept(&self, kept: anyhow::Result<String>) -> bool {
        match kept {
            Ok(said) => (self.tell)(Report::Noted(said)),
            Err(error) => self.refuse(&error),
        }
    }

    fn refuse(&self, error: &anyhow::Error) -> bool {
        tracing::info!("{error:#}");
        (self.tell)(Report::Refused(format!("{error:#}")))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;
    use crate::domain::ActionType;
    use crate::tui::testing;

    /// A worker in the kitchen, and what it tells.
    fn start() -> (Sender<Command>, Receiver<Report>) {
        let (tell, reports) = channel();
        let commands = super::start(|| Ok(testing::engine()), move |report| tell.send(report).is_ok()).unwrap();
        (commands, reports)
    }

    fn wait(reports: &Receiver<Report>, mut wanted: impl FnMut(&Report) -> bool) -> Report {
        loop {
            let report = reports.recv_timeout(Duration::from_secs(60)).unwrap();
            if wanted(&report) {
                return report;
            }
        }
    }

    #[test]
    fn the_house_is_shown_before_the_policy_is_loaded() {
        let (_commands, reports) = start();
        assert!(matches!(reports.recv().unwrap(), Report::Seen(_)));
        assert!(matches!(reports.recv().unwrap(), Report::Busy(Some(_))));
        wait(&reports, |report| matches!(report, Report::Thought(..)));
    }

    #[test]
    fn it_runs_until_told_to_stop_and_steps_one_at_a_time() {
        let (commands, reports) = start();
        commands.send(Command::Pace((0..9).fold(Pace::START, |pace, _| pace.faster()))).unwrap();
        commands.send(Command::Go(Some(Going::Policy))).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(event) if event.step >= 5));
        commands.send(Command::Go(None)).unwrap();
        wait(&reports, |report| matches!(report, Report::Going(None)));
        commands.send(Command::Reset).unwrap();
        wait(&reports, |report| matches!(report, Report::Seen(now) if now.step == 0));
        commands.send(Command::Act(Action::navigate(ActionType::RotateLeft))).unwrap();
        let report = wait(&reports, |report| matches!(report, Report::Stepped(_)));
        assert!(matches!(report, Report::Stepped(event) if event.by_hand && event.step == 1));
    }

    #[test]
    fn a_policy_that_cannot_be_loaded_is_told_and_the_house_stays() {
        let (commands, reports) = start();
        commands.send(Command::Choose(PolicyKind::Agent)).unwrap();
        let report = wait(&reports, |report| matches!(report, Report::Failed(_)));
        assert!(matches!(report, Report::Failed(reason) if reason.contains("there is no checkpoint")));
        commands.send(Command::Step).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(_)));
    }

    #[test]
    fn it_ends_when_nobody_commands_any_more() {
        let (commands, reports) = start();
        wait(&reports, |report| matches!(report, Report::Thought(..)));
        drop(commands);
        while let Ok(report) = reports.recv_timeout(Duration::from_secs(60)) {
            assert!(!matches!(report, Report::Stepped(_)));
        }
    }
}
