//! Who decides: which policy, which checkpoint, which chance.

use anyhow::Context;

use super::Exploration;
use crate::agent::policy_place::{self, PolicyPlace};
use crate::agent::registry::{Loaded, PolicyIdentity, PolicyKind};
use crate::agent::{DecisionOverride, Observation, Policy};
use crate::episode::record::Author;

impl Exploration {
    /// Loads the chosen policy; slow the first time for the agent. It decides from here on, having seen the last frames.
    ///
    /// # Errors
    /// When it cannot be loaded; the one before stays.
    pub fn choose(&mut self, kind: PolicyKind) -> anyhow::Result<()> {
        let Loaded { policy, checkpoint, place } = self.policies.make(kind)?;
        policy.check_fits(&mut Observation::start(&mut self.rollout.env)).with_context(|| policy.name().to_owned())?;
        let before = self.acting.policy.as_ref().map(|_| self.acting.author.clone());
        self.acting.author.policy = policy.name().to_string();
        self.acting.author.checkpoint = checkpoint;
        // The one that is loaded first is no other.
        self.acting.redirected |= before.is_some_and(|before| before != self.acting.author);
        self.acting.policy = Some(policy);
        self.acting.kind = kind;
        self.know_places(place);
        self.look_back();
        self.make_start();
        Ok(())
    }

    /// Lets a policy of a test's own decide from here on.
    #[cfg(test)]
    pub(crate) fn act_by(&mut self, policy: Box<dyn Policy>) {
        self.acting.policy = Some(policy);
        self.look_back();
        self.make_start();
    }

    /// Lets another checkpoint be the agent, by name or number, and loads it.
    ///
    /// # Errors
    /// When there is none such, or it cannot be loaded; the one before stays.
    pub(crate) fn checkpoint(&mut self, wanted: &str) -> anyhow::Result<()> {
        let before = self.policies.chosen();
        self.policies.choose(wanted)?;
        let chosen = self.choose(PolicyKind::Agent);
        if chosen.is_err() {
            self.policies.choose(&(before + 1).to_string())?;
        }
        chosen
    }

    /// Notes where policies are that are none of the program's own, for the run that this becomes.
    pub(crate) fn know_places(&mut self, places: impl IntoIterator<Item = PolicyPlace>) {
        policy_place::note(&mut self.places, places);
    }

    /// The names of the checkpoints that may act.
    pub(crate) fn checkpoints(&self) -> &[String] {
        &self.checkpoints
    }

    /// Another policy of the present kind, for work beside the episode.
    ///
    /// # Errors
    /// When it cannot be loaded.
    pub(crate) fn another_policy(&self) -> anyhow::Result<Box<dyn Policy>> {
        Ok(self.policies.make(self.acting.kind)?.policy)
    }

    /// A policy to be set beside the one that acts: the expert, chance, or a checkpoint by name or number.
    ///
    /// # Errors
    /// When there is none, or it cannot be loaded.
    pub(crate) fn rival(&self, wanted: &str) -> anyhow::Result<Loaded> {
        self.policies.named(wanted)
    }

    /// Gives the policy another chance from here on; with `samples` it draws its actions instead of taking the likeliest.
    pub(crate) fn reseed(&mut self, seed: u64, samples: bool) {
        self.acting.redirected |= (self.acting.author.seed, self.acting.author.sampling) != (seed, samples);
        self.acting.author.seed = seed;
        self.acting.author.sampling = samples;
        self.look_back();
        self.make_start();
    }

    /// The same, but its agents decide as asked; before anything was done.
    pub(crate) fn deciding(mut self, asked: DecisionOverride) -> Exploration {
        self.acting.author.deciding = asked;
        self.make_start();
        self
    }

    /// Lets that author's policy begin here: its chance, and whether it draws.
    pub(crate) fn begin_as(&mut self, author: Author) {
        self.acting.author = author;
        self.look_back();
        self.make_start();
    }

    /// What tells the policy that decides from others.
    pub(crate) fn who(&self) -> PolicyIdentity {
        PolicyIdentity { name: self.acting.author.policy.clone(), checkpoint: self.acting.author.checkpoint.clone() }
    }

    /// Who decides, and by which chance.
    pub(crate) fn author(&self) -> &Author {
        &self.acting.author
    }

    /// The seed of the episode, by which it began.
    pub(crate) fn episode_seed(&self) -> u64 {
        self.episode.seed
    }

    /// Which policy decides.
    pub(crate) fn policy(&self) -> PolicyKind {
        self.acting.kind
    }

    /// Whether a policy is loaded.
    pub(crate) fn has_policy(&self) -> bool {
        self.acting.policy.is_some()
    }
}
