//! The thread that owns the environment: commands in, what is to be shown out.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use crate::agent::policy_source::PolicySource;
use crate::explore::remote::command::RemoteCommand;
use crate::explore::remote::view::{RemoteChoice, RemotePicture};
use crate::explore::remote::{OpenRemote, RemoteExploration};

/// Steps of a run follow each other no quicker.
const PACE: Duration = Duration::from_millis(120);

/// What the worker tells.
#[derive(Clone, Debug)]
pub struct RemoteEvent(pub(super) Told);

/// The same, for the screen alone.
#[derive(Clone, Debug)]
pub(super) enum Told {
    /// What is to be shown now, whether it goes on by itself, and what there is to say: whether it is a complaint, and the words.
    Shown(Box<RemotePicture>, bool, Option<(bool, String)>),
    /// What the policy would do told one thing and another.
    Compared(Vec<(String, Vec<RemoteChoice>)>),
    /// It could not be opened.
    Failed(String),
}

/// Starts the worker.
pub(super) fn start(
    open: OpenRemote,
    agent: PolicySource,
    tell: impl Fn(RemoteEvent) -> bool + Send + 'static,
) -> std::io::Result<Sender<RemoteCommand>> {
    let (commands, inbox) = channel();
    let work = move || match open() {
        Ok(exploration) => {
            let mut worker = Worker { exploration, agent, is_running: false, tell: Box::new(tell) };
            worker.show(None);
            worker.serve(&inbox);
        }
        Err(error) => drop(tell(RemoteEvent(Told::Failed(format!("{error:#}"))))),
    };
    std::thread::Builder::new().name("worker".into()).spawn(work)?;
    Ok(commands)
}

struct Worker {
    exploration: RemoteExploration,
    agent: PolicySource,
    is_running: bool,
    tell: Box<dyn Fn(RemoteEvent) -> bool + Send>,
}

impl Worker {
    fn show(&mut self, said: Option<(bool, String)>) {
        let picture = Box::new(self.exploration.picture());
        (self.tell)(RemoteEvent(Told::Shown(picture, self.is_running, said)));
    }

    /// Obeys, and goes on by itself between commands while it runs, until nobody commands any more.
    fn serve(&mut self, inbox: &Receiver<RemoteCommand>) {
        let mut due = Instant::now();
        loop {
            let command = match self.is_running {
                true => inbox.recv_timeout(due.saturating_duration_since(Instant::now())),
                false => inbox.recv().map_err(|_| RecvTimeoutError::Disconnected),
            };
            match command {
                Ok(RemoteCommand::Compare(text)) => match self.exploration.compared(&text) {
                    Ok(both) => drop((self.tell)(RemoteEvent(Told::Compared(both.into())))),
                    Err(error) => self.show(Some((true, format!("{error:#}")))),
                },
                Ok(command) => {
                    let said = match self.obey(command) {
                        Ok(said) => said.map(|words| (false, words)),
                        Err(error) => Some((true, format!("{error:#}"))),
                    };
                    self.show(said);
                }
                Err(RecvTimeoutError::Timeout) => {
                    due = Instant::now() + PACE;
                    let said = self.advance();
                    self.show(said);
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// One step of a run; what stops it is said.
    fn advance(&mut self) -> Option<(bool, String)> {
        if let Err(error) = self.exploration.step() {
            self.is_running = false;
            return Some((true, format!("{error:#}")));
        }
        if let Some(end) = self.exploration.end() {
            self.is_running = false;
            return Some((false, format!("over: {end}")));
        }
        let stopped = self.exploration.stopped_by()?.to_string();
        self.is_running = false;
        Some((false, format!("stopped at: {stopped}")))
    }

    fn obey(&mut self, command: RemoteCommand) -> anyhow::Result<Option<String>> {
        let exploration = &mut self.exploration;
        let runs_on = matches!(command, RemoteCommand::Break(_) | RemoteCommand::Instruct(_) | RemoteCommand::Save(_));
        self.is_running &= runs_on;
        match command {
            RemoteCommand::Run => {
                anyhow::ensure!(
                    exploration.end().is_none(),
                    "the episode is over: h goes back, r to the start, N to the next one"
                );
                self.is_running = true;
            }
            RemoteCommand::Pause | RemoteCommand::Quit | RemoteCommand::Look | RemoteCommand::Compare(_) => {}
            RemoteCommand::Step(count) => {
                for _ in 0..count {
                    let taken = exploration.step()?;
                    if exploration.end().is_some() {
                        break;
                    }
                    if let Some(branch) = taken.forked {
                        return Ok(Some(format!("branch {branch} begins")));
                    }
                }
            }
            RemoteCommand::Move(by) => {
                let step = i64::from(exploration.tree().present().step) + by;
                exploration.seek(step.clamp(0, i64::from(u32::MAX)) as u32);
            }
            RemoteCommand::Goto(step) => {
                let last = exploration.tree().length();
                anyhow::ensure!(step <= last || step == u32::MAX, "there is no step {step}: the branch ends at {last}");
                exploration.seek(step);
            }
            RemoteCommand::Act(text) => {
                let action = exploration.action(&text)?;
                let taken = exploration.act(action)?;
                return Ok(taken.forked.map(|branch| format!("branch {branch} begins")));
            }
            RemoteCommand::Instruct(text) => exploration.instruct(&text)?,
            RemoteCommand::Chance => exploration.choose(PolicySource::random())?,
            RemoteCommand::Agent => exploration.choose(self.agent.clone())?,
            RemoteCommand::Begin(seed) => exploration.begin(seed)?,
            RemoteCommand::Next => exploration.begin(exploration.seed().wrapping_add(1))?,
            RemoteCommand::Reset => exploration.seek(0),
            RemoteCommand::Branch(number) => exploration.switch(number.wrapping_sub(1))?,
            RemoteCommand::Branches => {
                let tree = exploration.tree();
                let named = |branch: &crate::explore::remote::tree::Branch| format!("{}: {}", branch.name, branch.why);
                let names: Vec<String> = tree.branches().iter().map(named).collect();
                return Ok(Some(names.join("; ")));
            }
            RemoteCommand::Break(condition) => {
                let known = exploration.conditions.iter().position(|known| *known == condition);
                match known {
                    Some(at) => drop(exploration.conditions.remove(at)),
                    None => exploration.conditions.push(condition),
                }
            }
            RemoteCommand::Save(path) => return exploration.save(path).map(Some),
        }
        Ok(None)
    }
}
