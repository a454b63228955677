//! Work that takes long, on a thread of its own: value maps and chains.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Report, Worker};
use crate::agent::Policy;
use crate::agent::registry::{Loaded, PolicyIdentity};
use crate::analysis::chain::Draws;
use crate::analysis::value_map::{ValueMap, survey};
use crate::domain::{Heading, Scene, World};
use crate::explore::chained::Chained;

/// Finished surveys by who was asked, what it was told, and the house without the agent.
pub(crate) type Surveys = Arc<Mutex<HashMap<(PolicyIdentity, String, String), Arc<ValueMap>>>>;

/// The policy that worked in the background last: loading one takes a while.
pub(crate) type Spare = Arc<Mutex<Option<(PolicyIdentity, Box<dyn Policy>)>>>;

/// What is known of the chain, by each policy that followed it.
pub(crate) type Followed = Arc<Mutex<HashMap<PolicyIdentity, Chained>>>;

/// Work on a thread of its own, one at a time.
#[derive(Default)]
pub(crate) struct Background {
    turn: Turn,
    /// What was started last.
    work: Option<Work>,
}

/// What is worked on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// A value map.
    Survey,
    /// A chain.
    Chain,
}

/// The permission to go on working, and to be heard. What is stopped says nothing any more.
#[derive(Clone, Default)]
pub(crate) struct Turn {
    stop: Arc<AtomicBool>,
    speaking: Arc<Mutex<()>>,
}

impl Turn {
    fn stop(&self) {
        let _silence = self.speaking.lock().unwrap_or_else(PoisonError::into_inner);
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Says something, unless it was stopped; false when nobody listens.
    fn say(&self, say: impl FnOnce() -> bool) -> bool {
        let _speaking = self.speaking.lock().unwrap_or_else(PoisonError::into_inner);
        self.stop.load(Ordering::Relaxed) || say()
    }
}

impl Background {
    /// Stops what is under way and starts something else.
    pub(crate) fn start(&mut self, work: Work, run: impl FnOnce(&Turn) + Send + 'static) {
        self.stop();
        self.work = Some(work);
        let turn = self.turn.clone();
        // Without a thread left nothing is computed; the screen stays as it is.
        let _ = std::thread::Builder::new().name("background".into()).spawn(move || run(&turn));
    }

    pub(crate) fn stop(&mut self) {
        self.turn.stop();
        (self.turn, self.work) = (Turn::default(), None);
    }

    /// Stops what is under way if it is that; whether it was.
    pub(crate) fn stop_if(&mut self, work: Work) -> bool {
        let is = self.work == Some(work);
        if is {
            self.stop();
        }
        is
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.stop();
    }
}

impl<T: Fn(Report) -> bool + Send + Sync + 'static> Worker<T> {
    /// Surveys the cells in the background, unless that was done before.
    pub(crate) fn survey(&mut self) -> bool {
        let (told, step) = (self.engine.instruction().to_string(), self.engine.tree().at());
        let house = &self.engine.rollout().env.house;
        let (scene, world) = (house.scene().clone(), house.world().clone());
        let key = (self.engine.who(), told.clone(), without_agent(&scene, &world).digest());
        let known = self.surveys.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(known) = known {
            // One that is under way is of other words, or of another house.
            let stopped = self.background.stop_if(Work::Survey);
            return (!stopped || (self.tell)(Report::Working(None))) && (self.tell)(Report::Surveyed(known, step));
        }
        let policy = match self.spare_policy() {
            Ok(policy) => policy,
            Err(error) => return self.refuse(&error),
        };
        let (tell, surveys, spare) = (self.tell.clone(), self.surveys.clone(), self.spare.clone());
        self.background.start(Work::Survey, move |turn| {
            let mut policy = policy;
            let mut visit = |found: &ValueMap| {
                let far = format!("values {}/{}", found.heights.len(), found.of);
                let found = Arc::new(found.clone());
                turn.say(|| tell(Report::Working(Some(far))) && tell(Report::Surveyed(found, step)))
            };
            let found = survey(policy.as_mut(), &scene, &world, &told, &turn.stop, &mut visit);
            *spare.lock().unwrap_or_else(PoisonError::into_inner) = Some((key.0.clone(), policy));
            let over = match found {
                Ok(found) if found.heights.len() == found.of => {
                    surveys.lock().unwrap_or_else(PoisonError::into_inner).insert(key, Arc::new(found));
                    true
                }
                Ok(_) => true,
                Err(error) => turn.say(|| tell(Report::Refused(format!("{error:#}")))),
            };
            let _ = over && turn.say(|| tell(Report::Working(None)));
        });
        true
    }

    /// A policy like the one that acts, for work beside the episode: the one that worked before, or a new one.
    fn spare_policy(&mut self) -> anyhow::Result<Box<dyn Policy>> {
        let spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner).take();
        match spare {
            Some((who, mut policy)) if who == self.engine.who() => {
                policy.set_sampling(false);
                Ok(policy)
            }
            _ => {
                (self.tell)(Report::Busy(Some(format!("loading another {}", self.engine.author().policy))));
                let policy = self.engine.another_policy();
                (self.tell)(Report::Busy(None));
                policy
            }
        }
    }

    /// Follows the chain in the background, by the policy that acts or another; with `draws`, also which link breaks.
    pub(crate) fn follow(&mut self, rival: Option<Loaded>, draws: Option<Draws>) -> bool {
        let Some(chain) = self.chain.clone() else {
            return (self.tell)(Report::Refused(
                "there is no chain yet: type one (chain A; B; ...), or chain alone".into(),
            ));
        };
        let own = self.engine.who();
        let mut runs = Vec::new();
        if let Some(Loaded { policy, checkpoint }) = rival {
            let who = PolicyIdentity { name: policy.name().to_string(), checkpoint };
            if who == own {
                return (self.tell)(Report::Refused(format!("{} acts already: name another", who.name)));
            }
            runs.push((who, policy));
        }
        // The one that acts goes first, unless it has been through the chain already.
        if runs.is_empty() || !self.followed.lock().unwrap_or_else(PoisonError::into_inner).contains_key(&own) {
            match self.spare_policy() {
                Ok(policy) => runs.insert(0, (own.clone(), policy)),
                Err(error) => return self.refuse(&error),
            }
        }
        let (tell, spare, followed) = (self.tell.clone(), self.spare.clone(), self.followed.clone());
        self.background.start(Work::Chain, move |turn| {
            let say = |report: Report| turn.say(|| tell(report));
            for (who, mut policy) in runs {
                let known = followed.lock().unwrap_or_else(PoisonError::into_inner).get(&who).cloned();
                let known = known.unwrap_or_else(|| Chained::new(&chain, who.clone()));
                match known.work(&chain, policy.as_mut(), draws, &turn.stop, &say) {
                    Ok(known) if known.as_one.is_some() => {
                        followed.lock().unwrap_or_else(PoisonError::into_inner).insert(who.clone(), known);
                    }
                    Ok(_) => {}
                    Err(error) => drop(say(Report::Refused(format!("{error:#}")))),
                }
                if who == own {
                    *spare.lock().unwrap_or_else(PoisonError::into_inner) = Some((who, policy));
                }
            }
            say(Report::Working(None));
        });
        true
    }
}

/// The same world whatever the agent's cell and heading: surveys put it everywhere.
fn without_agent(scene: &Scene, world: &World) -> World {
    let mut world = world.clone();
    world.agent.cell = scene.cells.first().copied().unwrap_or_default();
    world.agent.heading = Heading::North;
    world
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_work_that_is_meant_is_stopped() {
        let mut background = Background::default();
        background.start(Work::Chain, |_| ());
        let turn = background.turn.clone();
        assert!(!background.stop_if(Work::Survey) && !turn.stop.load(Ordering::Relaxed));
        assert!(background.stop_if(Work::Chain) && turn.stop.load(Ordering::Relaxed));
        assert!(!background.stop_if(Work::Chain), "nothing is left to stop");
    }
}
