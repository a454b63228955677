//! The seam between an environment and whatever acts in it.

use anyhow::Context;
use rand_chacha::ChaCha8Rng;

use super::decision::Decision;
use super::decision_rule::DecisionOverride;
use super::exported::FrameStack;
use super::frame_history::FrameHistory;
use super::memory_agent::Recollection;
use super::served::ServedState;
use super::value_estimates::Values;
use crate::domain::Action;
use crate::env::Environment;
use crate::house::expert::ExpertState;

/// What a policy decides from.
pub struct Observation<'a> {
    /// Where it acts. Its frame is drawn when it is asked for.
    pub(crate) environment: &'a mut dyn Environment,
    /// What the agent is told.
    pub(crate) instruction: &'a str,
    /// How many steps the episode has taken; deciding twice at one step looks once.
    pub(crate) step: u32,
    /// The action that was taken last, whoever chose it; `None` at the start, and where the episode was entered anew.
    pub(crate) last: Option<Action>,
}

impl Observation<'_> {
    /// Where an episode begins, with nothing told yet.
    pub(crate) fn start(environment: &mut dyn Environment) -> Observation<'_> {
        Observation { environment, instruction: "", step: 0, last: None }
    }
}

/// A decision for each slot, `None` where there was no observation. A slot's own failure is in its place.
pub(crate) type Decisions = Vec<Option<anyhow::Result<Decision>>>;

/// Decisions of a policy that looks at each slot by itself.
///
/// # Errors
/// Never; a slot's failure is in its place.
pub(crate) fn each_alone(
    observations: &mut [Option<Observation<'_>>],
    mut decide: impl FnMut(usize, &mut Observation<'_>) -> anyhow::Result<Decision>,
) -> anyhow::Result<Decisions> {
    let slots = observations.iter_mut().enumerate();
    Ok(slots.map(|(slot, observation)| observation.as_mut().map(|here| decide(slot, here))).collect())
}

/// How much of an instruction an agent reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Tokens that are read.
    pub(crate) tokens: usize,
    /// Tokens at the end that are left out because the text is too long.
    pub(crate) cut: usize,
}

/// What a policy carries from one step of an episode to the next. Restored, it decides as it did then, bit for bit.
#[derive(Clone, Debug, Default)]
pub enum PolicyState {
    #[default]
    Nothing,
    /// Its random numbers.
    Random(Box<ChaCha8Rng>),
    /// What it is about to do.
    Plan(Box<ExpertState>),
    /// The last frames, and its random numbers.
    Frames(Box<FrameHistory>),
    /// All that it remembers.
    Recollection(Box<Recollection>),
    /// The last frames of an exported policy, and its random numbers.
    Exported(Box<FrameStack>),
    /// What a policy server carries, as far as it says.
    Served(Box<ServedState>),
}

/// Something that acts: a trained agent, the expert, chance. It acts in several episodes at once, each in a slot of its own;
/// what it decides in one slot never depends on the others, so that results do not change with what is played beside it.
pub trait Policy: Send {
    /// A short name for reports.
    fn name(&self) -> &str;

    /// In how many episodes it can act at once.
    fn slots(&self) -> usize;

    /// Forgets a slot's past: a new episode starts there. `seed` drives whatever is drawn by chance.
    fn reset(&mut self, slot: usize, seed: u64);

    /// Decides for every slot that has an observation; there is a place for each of [`slots`](Policy::slots).
    ///
    /// # Errors
    /// When all fail together (a forward pass, a server that is gone). The expert that sees no way fails in its own slot.
    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions>;

    /// What a slot carries now.
    fn state(&self, _slot: usize) -> PolicyState {
        PolicyState::Nothing
    }

    /// Takes back what a slot carried at another step.
    fn restore(&mut self, _slot: usize, _state: PolicyState) {}

    /// Whether it draws its actions by chance instead of taking the likeliest, where it can do either.
    fn set_sampling(&mut self, _samples: bool) {}

    /// Checks that it has a use for an environment's actions and frames, where an episode begins.
    ///
    /// # Errors
    /// Says what it has no use for.
    fn check_fits(&self, start: &mut Observation<'_>) -> anyhow::Result<()> {
        let (environment, name) = (&start.environment, start.environment.name());
        anyhow::ensure!(environment.own().is_none(), "it acts in House only, and has no use for the actions of {name}");
        Ok(())
    }

    /// Decides from now on as asked, and where nothing is asked as its checkpoint says, where it is one of a checkpoint.
    fn set_deciding(&mut self, _asked: DecisionOverride) {}

    /// How much it reads of an instruction, where it has a limit.
    fn reading(&self, _instruction: &str) -> Option<Reading> {
        None
    }

    /// What its critics make of a slot's observation; `None` without critics. It changes nothing about what is decided next under
    /// the same instruction; whoever asks under another one restores the slot's state.
    ///
    /// # Errors
    /// When a forward pass fails.
    fn values(&mut self, _slot: usize, _observation: &mut Observation<'_>) -> anyhow::Result<Option<Values>> {
        Ok(None)
    }
}

impl dyn Policy + '_ {
    /// Decides in one slot, with the others empty.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub(crate) fn act_in(&mut self, slot: usize, observation: Observation<'_>) -> anyhow::Result<Decision> {
        let mut observations: Vec<Option<Observation<'_>>> = (0..self.slots()).map(|_| None).collect();
        let slots = observations.len();
        *observations.get_mut(slot).with_context(|| format!("{} has {slots} slots, not {slot}", self.name()))? =
            Some(observation);
        let decision = self.act(&mut observations)?.into_iter().nth(slot).flatten();
        decision.with_context(|| format!("{} decided nothing in slot {slot}", self.name()))?
    }
}
