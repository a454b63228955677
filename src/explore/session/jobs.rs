//! Value maps and chains, computed in the background.

use std::sync::Arc;

use super::background::Work;
use super::{Session, SessionEvent};
use crate::agent::Policy;
use crate::agent::registry::{Loaded, PolicyIdentity};
use crate::analysis::chain::Draws;
use crate::analysis::value_map::{ValueMap, compute};
use crate::domain::{Heading, Scene, World};
use crate::explore::chain_report::ChainReport;

impl Session {
    /// Computes the value of every cell, unless that was done before.
    pub(super) fn map_values(&mut self) {
        let (instruction, step) = (self.exploration.instruction().to_string(), self.exploration.tree().at());
        let house = &self.exploration.rollout().env.house;
        let (scene, world) = (house.scene().clone(), house.world().clone());
        let key = (self.exploration.who(), instruction.clone(), without_agent(&scene, &world).digest());
        let known = self.jobs.results.maps.lock().get(&key).cloned();
        if let Some(known) = known {
            // One that is under way is of other words, or of another house.
            if self.jobs.background.stop_if(Work::ValueMap) {
                self.emit(SessionEvent::Working(None));
            }
            self.emit(SessionEvent::ValueMap(known, step));
            return;
        }
        let policy = match self.spare_policy() {
            Ok(policy) => policy,
            Err(error) => return self.refuse(&error),
        };
        let results = self.jobs.results.clone();
        self.jobs.background.start(Work::ValueMap, move |permit| {
            let mut policy = policy;
            let mut visit = |map: &ValueMap| {
                permit.emit(SessionEvent::Working(Some(format!("values {}/{}", map.cells.len(), map.of))));
                permit.emit(SessionEvent::ValueMap(Arc::new(map.clone()), step));
                true
            };
            let map = compute(policy.as_mut(), &scene, &world, &instruction, &permit.stop, &mut visit);
            *results.spare.lock() = Some((key.0.clone(), policy));
            match map {
                Ok(map) if map.cells.len() == map.of => drop(results.maps.lock().insert(key, Arc::new(map))),
                Ok(_) => {}
                Err(error) => permit.emit(SessionEvent::Refused(format!("{error:#}"))),
            }
            permit.emit(SessionEvent::Working(None));
        });
    }

    /// A policy like the one that acts, for work beside the episode: the one that worked before, or a new one.
    fn spare_policy(&mut self) -> anyhow::Result<Box<dyn Policy>> {
        let spare = self.jobs.results.spare.lock().take();
        match spare {
            Some((who, mut policy)) if who == self.exploration.who() => {
                policy.set_sampling(false);
                Ok(policy)
            }
            _ => {
                let name = &self.exploration.author().policy;
                self.emit(SessionEvent::Busy(Some(format!("loading another {name}"))));
                let policy = self.exploration.another_policy();
                self.emit(SessionEvent::Busy(None));
                policy
            }
        }
    }

    /// Follows another chain, or the same one again.
    pub(super) fn follow_chain(&mut self, text: &str) {
        match self.exploration.chain(text) {
            Ok(chain) => {
                // The same one again is another policy's turn, and what the others made of it stays.
                if !self.jobs.chain.as_ref().is_some_and(|known| known.is_same(&chain)) {
                    self.jobs.results.chains = Default::default();
                }
                self.jobs.chain = Some(chain);
                self.jobs.begun_at = (self.exploration.tree().branch(), self.exploration.tree().at());
                self.follow(None, None);
            }
            Err(error) => self.refuse(&error),
        }
    }

    /// Follows the chain by the policy that acts or another; with `draws`, also finds which link breaks.
    pub(super) fn follow(&mut self, rival: Option<Loaded>, draws: Option<Draws>) {
        let Some(chain) = self.jobs.chain.clone() else {
            self.emit(SessionEvent::Refused(
                "there is no chain yet: type one (chain A; B; ...), or chain alone".into(),
            ));
            return;
        };
        let own = self.exploration.who();
        let mut runs = Vec::new();
        if let Some(Loaded { policy, checkpoint, .. }) = rival {
            let who = PolicyIdentity { name: policy.name().to_string(), checkpoint };
            if who == own {
                self.emit(SessionEvent::Refused(format!("{} acts already: name another", who.name)));
                return;
            }
            runs.push((who, policy));
        }
        // The one that acts goes first, unless it has been through the chain already.
        if runs.is_empty() || !self.jobs.results.chains.lock().contains_key(&own) {
            match self.spare_policy() {
                Ok(policy) => runs.insert(0, (own.clone(), policy)),
                Err(error) => return self.refuse(&error),
            }
        }
        let results = self.jobs.results.clone();
        self.jobs.background.start(Work::Chain, move |permit| {
            let tell = |report: &ChainReport, what: String| {
                permit.emit(SessionEvent::Chain(Box::new(report.clone())));
                permit.emit(SessionEvent::Working(Some(format!("{}: {what}", report.who.name))));
            };
            for (who, mut policy) in runs {
                let known = results.chains.lock().get(&who).cloned();
                let known = known.unwrap_or_else(|| ChainReport::new(&chain, who.clone()));
                match known.fill_in(&chain, policy.as_mut(), draws, &permit.stop, &tell) {
                    Ok(known) if known.as_one.is_some() => drop(results.chains.lock().insert(who.clone(), known)),
                    Ok(_) => {}
                    Err(error) => permit.emit(SessionEvent::Refused(format!("{error:#}"))),
                }
                if who == own {
                    *results.spare.lock() = Some((who, policy));
                }
            }
            permit.emit(SessionEvent::Working(None));
        });
    }
}

/// The same world whatever the agent's cell and heading: value maps put it everywhere.
fn without_agent(scene: &Scene, world: &World) -> World {
    let mut world = world.clone();
    world.agent.cell = scene.cells.first().copied().unwrap_or_default();
    world.agent.heading = Heading::North;
    world
}
