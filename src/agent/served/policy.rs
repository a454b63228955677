//! A policy that acts from another process.

use std::sync::Arc;
use std::time::Duration;

use super::address::PolicyAddress;
use super::array::field;
use super::dialogue::{Dialogue, Protocol};
use super::server_gone::ServerGone;
use super::state::ServedState;
use super::{observation, remote, reply};
use crate::agent::decision::Decision;
use crate::agent::policy::{Decisions, Observation, Policy, PolicyState};
use crate::agent::policy_source::PolicySource;
use anyhow::anyhow;

/// A policy server that acts in one episode.
pub(crate) struct ServedPolicy {
    name: String,
    address: PolicyAddress,
    limit: Duration,
    protocol: Protocol,
    /// None until it is needed, and after something went wrong: an answer that comes too late must answer nothing else.
    dialogue: Option<Dialogue>,
    state: ServedState,
    /// Versions that were given out.
    versions: u64,
    /// What it was asked last, and said.
    last: Option<(Question, Decision)>,
}

/// What a decision was made from.
#[derive(PartialEq)]
struct Question {
    step: u32,
    instruction: String,
    /// The frame, or what stands for it.
    seen: Vec<u8>,
}

/// Connects to a server that was there before.
fn reach(address: &PolicyAddress, limit: Duration, protocol: Protocol) -> Result<Dialogue, ServerGone> {
    Dialogue::open(address, limit, Some(protocol))
        .map_err(|error| ServerGone { address: address.to_string(), why: error.root_cause().to_string() })
}

impl ServedPolicy {
    /// The policy of a server, which is asked who it is. Each that is made has a connection of its own.
    ///
    /// # Errors
    /// When nobody answers there, or not in a known protocol.
    pub(crate) fn source(address: &PolicyAddress, limit: Duration) -> anyhow::Result<PolicySource> {
        let first = Dialogue::open(address, limit, None)?;
        let protocol = first.protocol;
        let name = match first.policy_name() {
            Some(said) => format!("ws:{said}"),
            None => format!("ws:{}", address.to_string().trim_start_matches("ws://")),
        };
        let checkpoint_hash = first.checkpoint_hash().map(str::to_owned);
        drop(first);
        let (address, called) = (address.clone(), name.clone());
        let make = move || -> anyhow::Result<Box<dyn Policy>> {
            let dialogue = Some(reach(&address, limit, protocol)?);
            let (name, address) = (called.clone(), address.clone());
            let (state, versions, last) = (ServedState::default(), 0, None);
            Ok(Box::new(ServedPolicy { name, address, limit, protocol, dialogue, state, versions, last }))
        };
        Ok(PolicySource::of(&name, Arc::new(make)).with_hash(checkpoint_hash))
    }

    fn decide(&mut self, here: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let seen = match here.environment.own() {
            Some(view) => view.observation.digest.clone().into_bytes(),
            None => here.environment.frame()?.rgb.clone(),
        };
        let question = Question { step: here.step, instruction: here.instruction.into(), seen };
        if let Some((asked, said)) = &self.last
            && *asked == question
        {
            return Ok(said.clone());
        }
        // Nothing of a conversation that failed is carried on.
        let dialogue = self.dialogue.take();
        let (dialogue, decision) = self.ask(dialogue, here)?;
        self.dialogue = Some(dialogue);
        self.last = Some((question, decision.clone()));
        Ok(decision)
    }

    fn ask(&mut self, dialogue: Option<Dialogue>, here: &mut Observation<'_>) -> anyhow::Result<(Dialogue, Decision)> {
        let is_new = dialogue.is_none();
        let mut dialogue = match dialogue {
            Some(dialogue) => dialogue,
            None => reach(&self.address, self.limit, self.protocol)?,
        };
        let begins = is_new || self.state.version == 0;
        if begins {
            dialogue.begin(observation::episode(here, self.state.seed))?;
        }
        let (protocol, is_local) = (self.protocol, self.address.is_local());
        let candidates = here.environment.legal_actions()?;
        let carried = self.state.carried.as_ref();
        let mut told = observation::observation(here, &candidates, protocol, is_local, carried)?;
        if begins && protocol == Protocol::Openpi {
            observation::add(&mut told, "episode_start", observation::episode(here, self.state.seed));
        }
        let answer = dialogue.ask(told, here.step)?;
        let decision = match here.environment.own() {
            Some(view) => remote::decision(&answer, &view),
            None => reply::decision(&answer, &candidates),
        };
        let decision =
            decision.map_err(|problem| anyhow!(dialogue.strange(&format!("at step {} {problem}", here.step))))?;
        self.versions += 1;
        (self.state.version, self.state.carried) = (self.versions, field(&answer, "state").cloned());
        Ok((dialogue, decision))
    }
}

impl Policy for ServedPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn slots(&self) -> usize {
        1
    }

    fn check_fits(&self, _start: &mut Observation<'_>) -> anyhow::Result<()> {
        Ok(())
    }

    fn reset(&mut self, _slot: usize, seed: u64) {
        if let Some(dialogue) = self.dialogue.as_mut().filter(|_| self.state.version > 0) {
            dialogue.end();
        }
        (self.state, self.last) = (ServedState { seed, ..ServedState::default() }, None);
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        let mut decisions = Vec::with_capacity(observations.len());
        for here in observations {
            decisions.push(match here.as_mut().map(|here| self.decide(here)) {
                Some(Err(error)) if error.is::<ServerGone>() => return Err(error),
                decided => decided,
            });
        }
        Ok(decisions)
    }

    fn state(&self, _slot: usize) -> PolicyState {
        PolicyState::Served(Box::new(self.state.clone()))
    }

    /// A server that gives what it carries gets it back; to another, an episode begins anew at that step.
    fn restore(&mut self, _slot: usize, state: PolicyState) {
        let PolicyState::Served(state) = state else { return };
        if state.version == self.state.version && state.seed == self.state.seed {
            return;
        }
        let version = if state.carried.is_some() { state.version } else { 0 };
        (self.state, self.last) = (ServedState { version, ..*state }, None);
    }
}
