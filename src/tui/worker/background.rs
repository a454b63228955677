//! Work that takes long, on a thread of its own: value maps and chains.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Report, Worker};
use crate::run::landscape::{Landscape, survey};
use crate::tui::chained::Chained;

/// Finished surveys by policy, instruction and world.
pub(super) type Surveys = Arc<Mutex<HashMap<(String, String, String), Arc<Landscape>>>>;

/// Work on a thread of its own, one at a time.
#[derive(Default)]
pub(super) struct Background {
    stop: Arc<AtomicBool>,
}

impl Background {
    /// Stops what is under way and starts something else.
    pub(super) fn start(&mut self, work: impl FnOnce(&AtomicBool) + Send + 'static) {
        self.stop();
        let stop = self.stop.clone();
        // Without a thread left nothing is computed; the screen stays as it is.
        let _ = std::thread::Builder::new().name("background".into()).spawn(move || work(&stop));
    }

    pub(super) fn stop(&mut self) {
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
    /// Surveys the cells in the background, unless that was done before.
    pub(super) fn survey(&mut self) -> bool {
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
    pub(super) fn follow(&mut self, times: Option<u32>) -> bool {
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
}
