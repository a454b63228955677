//! The episode under exploration: where the environment is, who acts, everything that was tried.

use std::sync::Arc;

use anyhow::Context;

use super::breakpoint::RemoteCondition;
use super::tree::{MOST, RemoteTree, State, Taken};
use crate::agent::DecisionOverride;
use crate::agent::policy_place::{self, PolicyPlace};
use crate::agent::policy_source::PolicySource;
use crate::agent::{Decision, Observation, Policy, PolicyState};
use crate::domain::{Action, EnvironmentName};
use crate::env::Environment;
use crate::env::remote::{RemoteEnvironment, RemoteSettings, Sessions};
use crate::env::remote_view::{Possible, RemoteView};
use crate::episode::record::{Author, TraceStep};
use crate::episode::rollout::{Rollout, Tick};
use crate::language::instruction;

/// An episode in an environment with actions of its own.
pub(crate) struct RemoteExploration {
    pub(super) sessions: Sessions,
    pub(super) name: EnvironmentName,
    pub(super) seed: u64,
    pub(super) rollout: Rollout<RemoteEnvironment>,
    pub(super) tree: RemoteTree,
    /// The state that the environment is in.
    pub(super) real: usize,
    /// Taking the same actions again showed something else from that step on.
    pub(super) differs_at: Option<u32>,
    /// Same actions were taken again, and showed the same.
    pub(super) was_retraced: bool,
    acting: Acting,
    /// Where policies are that acted and are none of the program's own.
    pub(super) places: Vec<PolicyPlace>,
    instruction: Arc<str>,
    /// Who acts or what is told was changed since the state in hand was reached.
    redirected: bool,
    /// How many states a run folder holds already.
    pub(super) saved: usize,
    /// When a run stops.
    pub(crate) conditions: Vec<RemoteCondition>,
}

/// Opens an exploration, on whichever thread it lives.
pub(crate) type OpenRemote = Box<dyn FnOnce() -> anyhow::Result<RemoteExploration> + Send>;

/// Who acts.
struct Acting {
    policy: Box<dyn Policy>,
    author: Author,
    /// What was decided, and in which state.
    decided: Option<(usize, Decision)>,
}

/// What came of a step.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RemoteStepTaken {
    /// Which step, from 1.
    pub(crate) step: u32,
    /// In words.
    pub(crate) action: String,
    /// What it came to, in words: "ok", or why it was impossible.
    pub(crate) outcome: String,
    /// What it earned.
    pub(crate) reward: Option<f64>,
    /// A part of what is asked was done by it.
    pub(crate) completed: bool,
    /// The branch that it began.
    pub(crate) forked: Option<String>,
}

impl RemoteStepTaken {
    /// The step in a line.
    pub(crate) fn in_words(&self) -> String {
        let reward =
            self.reward.filter(|reward| *reward != 0.0).map_or(String::new(), |reward| format!(", reward {reward}"));
        let done = if self.completed { ", part done" } else { "" };
        format!("step {}: {}: {}{reward}{done}", self.step, self.action, self.outcome)
    }
}

/// The chance of a policy begins anew with each episode's seed.
fn author_of(source: &PolicySource, seed: u64) -> Author {
    let checkpoint = source.checkpoint_hash.clone();
    Author { policy: source.name.clone(), checkpoint, seed, sampling: false, deciding: DecisionOverride::default() }
}

impl RemoteExploration {
    /// Begins the episode of that seed.
    ///
    /// # Errors
    /// When the environment cannot be reached, or the policy has no use for its actions.
    pub(crate) fn new(
        name: &EnvironmentName,
        remote: RemoteSettings,
        source: PolicySource,
        seed: u64,
        told: Option<&str>,
    ) -> anyhow::Result<RemoteExploration> {
        let mut sessions = Sessions::new(remote);
        let mut env = RemoteEnvironment::begin(sessions.get(0, name)?, seed)?;
        let places = source.place().into_iter().collect();
        let acting = Acting::new(source, seed, &mut env)?;
        let rollout = Rollout::new(env, String::new(), None);
        let tree = RemoteTree::new(start_state(&rollout, &acting)?);
        let mut exploration = RemoteExploration {
            sessions,
            name: name.clone(),
            seed,
            rollout,
            tree,
            real: 0,
            differs_at: None,
            was_retraced: false,
            acting,
            places,
            instruction: Arc::from(""),
            redirected: false,
            saved: 1,
            conditions: Vec::new(),
        };
        exploration.instruction = exploration.mission().into();
        if let Some(text) = told {
            exploration.instruct(text)?;
        }
        Ok(exploration)
    }

    /// What the environment itself asks.
    pub(crate) fn mission(&self) -> String {
        let mission = self.tree.start().observation.mission.as_deref().unwrap_or_default();
        mission.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Begins another episode; what was tried is forgotten.
    ///
    /// # Errors
    /// When the environment fails; the one in hand stays then.
    pub(crate) fn begin(&mut self, seed: u64) -> anyhow::Result<()> {
        let env = RemoteEnvironment::begin(self.sessions.get(0, &self.name)?, seed)?;
        let rollout = Rollout::new(env, String::new(), None);
        self.acting.author.seed = seed;
        self.acting.decided = None;
        self.acting.policy.reset(0, seed);
        self.tree = RemoteTree::new(start_state(&rollout, &self.acting)?);
        (self.rollout, self.seed, self.real, self.saved) = (rollout, seed, 0, 1);
        (self.differs_at, self.was_retraced, self.redirected) = (None, false, false);
        self.instruction = self.mission().into();
        Ok(())
    }

    /// Steps that no run folder holds: they would be lost.
    pub(crate) fn unsaved(&self) -> usize {
        self.tree.len().saturating_sub(self.saved)
    }

    /// The environment's name.
    pub(crate) fn name(&self) -> &EnvironmentName {
        &self.name
    }

    /// The episode's seed.
    pub(crate) fn seed(&self) -> u64 {
        self.seed
    }

    /// What was tried.
    pub(crate) fn tree(&self) -> &RemoteTree {
        &self.tree
    }

    /// What the agent is told.
    pub(crate) fn instruction(&self) -> &str {
        &self.instruction
    }

    /// Who acts.
    pub(crate) fn policy(&self) -> &str {
        &self.acting.author.policy
    }

    /// An action in words.
    pub(crate) fn words(&self, action: Action) -> String {
        self.rollout.env.own().map_or_else(String::new, |view| view.space.words(action))
    }

    /// Everything that can be done in the state in hand.
    pub(crate) fn possible(&self) -> Vec<Action> {
        let Some(view) = self.rollout.env.own() else { return Vec::new() };
        let shown = RemoteView { space: view.space, observation: &self.tree.present().observation };
        shown.possible().iter().flat_map(Possible::actions).collect()
    }

    /// The action of that name and argument, as a person writes it.
    ///
    /// # Errors
    /// When there is none; says which there are.
    pub(crate) fn action(&self, text: &str) -> anyhow::Result<Action> {
        let view = self.rollout.env.own().context("the environment has no actions")?;
        let (name, argument) = text.split_once(' ').map_or((text, None), |(name, rest)| (name, Some(rest.trim())));
        let plain = argument.map(serde_json::Value::from);
        // A number may be meant as one.
        let read = argument.and_then(|argument| serde_json::from_str(argument).ok());
        view.space.find(name, plain.as_ref()).or_else(|error| match &read {
            Some(value) => view.space.find(name, Some(value)).map_err(|_| error),
            None => Err(error),
        })
    }

    /// Whether the episode is over in the state in hand, and how.
    pub(crate) fn end(&self) -> Option<&'static str> {
        let seen = &self.tree.present().observation;
        match (seen.grading(), seen.done) {
            (Some((done, of)), _) if done == of => Some("done"),
            (_, true) if seen.truncated => Some("the environment's time is up"),
            (Some(_), true) => Some("over, not done"),
            (None, true) => Some("over"),
            (_, false) => None,
        }
    }

    /// Tells the agent something else from here on; nothing brings back what the environment asks.
    ///
    /// # Errors
    /// When it is too long or malformed.
    pub(crate) fn instruct(&mut self, text: &str) -> anyhow::Result<()> {
        let told = if text.trim().is_empty() { self.mission() } else { instruction::parse(text)? };
        self.instruction = told.into();
        self.acting.decided = None;
        self.redirected = true;
        Ok(())
    }

    /// Lets another policy act from here on.
    ///
    /// # Errors
    /// When it cannot be made, or has no use for the environment's actions.
    pub(crate) fn choose(&mut self, source: PolicySource) -> anyhow::Result<()> {
        let place = source.place();
        self.acting = Acting::new(source, self.seed, &mut self.rollout.env)?;
        self.know_places(place);
        self.redirected = true;
        Ok(())
    }

    /// Notes where policies are that are none of the program's own, for the run that this becomes.
    pub(crate) fn know_places(&mut self, places: impl IntoIterator<Item = PolicyPlace>) {
        policy_place::note(&mut self.places, places);
    }

    /// What the policy would do in the state in hand.
    ///
    /// # Errors
    /// When the environment or the policy fails.
    pub(crate) fn decide(&mut self) -> anyhow::Result<&Decision> {
        let here = self.tree.here();
        let is_known = self.acting.decided.as_ref().is_some_and(|(state, _)| *state == here);
        if !is_known {
            let decision = self.decision_when_told(&self.instruction.clone())?;
            self.acting.decided = Some((here, decision));
        }
        let (_, decision) = self.acting.decided.as_ref().context("nothing was decided")?;
        Ok(decision)
    }

    /// What the policy would do here if it were told that.
    ///
    /// # Errors
    /// When the environment or the policy fails.
    pub(crate) fn decision_when_told(&mut self, told: &str) -> anyhow::Result<Decision> {
        self.bring()?;
        let (author, carried) = &self.tree.present().carried;
        if *author == self.acting.author {
            self.acting.policy.restore(0, carried.clone());
        } else {
            // What another one carried is of no use: it begins here.
            self.acting.policy.reset(0, self.acting.author.seed);
        }
        self.rollout.instruction = told.to_owned();
        self.rollout.set_steps(self.tree.present().step);
        self.rollout.set_last(self.tree.present().taken.as_ref().map(|taken| taken.action));
        self.rollout.decide(self.acting.policy.as_mut())
    }

    /// Whether going on from here follows what was tried before.
    fn follows(&self) -> bool {
        !self.redirected && self.tree.next().is_some()
    }

    /// Goes on by a step: along what was tried, or by the policy's choice.
    ///
    /// # Errors
    /// When the episode is over, or something fails.
    pub(crate) fn step(&mut self) -> anyhow::Result<RemoteStepTaken> {
        if self.follows() {
            self.seek(self.tree.present().step + 1);
            return self.told_of_present().context("no step was taken yet");
        }
        let decision = self.decide()?.clone();
        let author = self.acting.author.clone();
        self.carry_out(decision, author)
    }

    /// Takes one step that a person chose.
    ///
    /// # Errors
    /// When the episode is over, or the environment fails.
    pub(crate) fn act(&mut self, action: Action) -> anyhow::Result<RemoteStepTaken> {
        // The policy sees this state too, so that it has seen every one; what it cannot decide is no reason not to act.
        let _ = self.decide();
        self.carry_out(Decision::of(action), Author::hand())
    }

    pub(super) fn carry_out(&mut self, decision: Decision, author: Author) -> anyhow::Result<RemoteStepTaken> {
        if let Some(end) = self.end() {
            anyhow::bail!("the episode is over ({end}): go back, or begin another");
        }
        anyhow::ensure!(self.tree.len() < MOST, "no more steps are remembered in this episode");
        self.bring()?;
        let action = decision.action;
        let words = self.words(action);
        let tick = self.rollout.carry_out(decision)?;
        let step = self.tree.present().step + 1;
        let record = TraceStep::of(&tick, &self.rollout);
        let Tick { outcome, completed_one, reward, .. } = tick;
        let why = if author.is_hand() { format!("{words} (you)") } else { format!("{words} ({})", author.policy) };
        let taken = Taken { action, record, words: words.clone(), instruction: self.instruction.clone(), author };
        let carried = (self.acting.author.clone(), self.acting.policy.state(0));
        let state = State {
            before: None,
            step,
            taken: Some(taken),
            observation: Arc::new(self.seen()?),
            snapshot: self.rollout.env.snapshot(),
            carried,
            earned: self.tree.present().earned + reward.unwrap_or(0.0),
        };
        let forked = self.tree.grow(state, || why);
        self.real = self.tree.here();
        self.redirected = false;
        Ok(RemoteStepTaken {
            step,
            action: words,
            outcome: outcome.to_string(),
            reward,
            completed: completed_one,
            forked,
        })
    }

    /// What the environment shows where it is.
    pub(super) fn seen(&self) -> anyhow::Result<crate::env::observation::RemoteObservation> {
        Ok(self.rollout.env.own().context("the environment shows nothing")?.observation.clone())
    }

    /// The step that led to the state in hand.
    pub(crate) fn told_of_present(&self) -> Option<RemoteStepTaken> {
        let state = self.tree.present();
        let taken = state.taken.as_ref()?;
        Some(RemoteStepTaken {
            step: state.step,
            action: taken.words.clone(),
            outcome: taken.record.outcome.to_string(),
            reward: state.observation.reward,
            completed: taken.record.subtask.is_some(),
            forked: None,
        })
    }

    /// Forgets that something was changed: another state was taken in hand.
    pub(super) fn settle(&mut self) {
        self.redirected = false;
        if let Some(taken) = &self.tree.present().taken {
            self.instruction = taken.instruction.clone();
        }
    }

    /// The condition that stops a run in the state in hand.
    pub(crate) fn stopped_by(&self) -> Option<&RemoteCondition> {
        self.conditions.iter().find(|condition| condition.holds(self.tree.present()))
    }
}

impl Acting {
    fn new(source: PolicySource, seed: u64, environment: &mut RemoteEnvironment) -> anyhow::Result<Acting> {
        let mut policy = (source.make)()?;
        policy.check_fits(&mut Observation::start(environment)).with_context(|| source.name.clone())?;
        policy.reset(0, seed);
        let author = author_of(&source, seed);
        Ok(Acting { policy, author, decided: None })
    }
}

fn start_state(rollout: &Rollout<RemoteEnvironment>, acting: &Acting) -> anyhow::Result<State> {
    let seen = rollout.env.own().context("the environment shows nothing")?.observation.clone();
    let carried: (Author, PolicyState) = (acting.author.clone(), acting.policy.state(0));
    let snapshot = rollout.env.snapshot();
    Ok(State { before: None, step: 0, taken: None, observation: Arc::new(seen), snapshot, carried, earned: 0.0 })
}
