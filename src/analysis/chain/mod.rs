//! Chains of instructions, link by link: where does an agent that can do each step fail to do them one after the other?

mod link_success;
mod play;
mod split;

pub(crate) use link_success::{Draws, LinkRate, LinkSuccess, trials};
pub(crate) use play::{ChainRun, Handover, LinkOutcome};
pub(crate) use split::split;

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::agent::{ExpertPolicy, Policy as _};
use crate::domain::{Role, Scene, Subtask, World};
use crate::episode::rollout::{AfterEach, End, Rollout, Tick};
use crate::house::House;
use crate::house::grading::{Grader, Grading};

/// A chain that can be followed from a state.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    pub(crate) scene: Arc<Scene>,
    /// The state in which it begins.
    pub(crate) start: World,
    /// The instructions, in order.
    pub(crate) links: Vec<String>,
    /// What grades each link, one subtask a link; without it links end after [`UNGRADED`] steps.
    pub(crate) graded: Option<(Vec<Role>, Vec<Subtask>)>,
}

/// The steps that a link has which nobody grades.
pub(crate) const UNGRADED: u32 = 20;
/// The most steps of a graded link: this many times the expert's, and some to turn around.
const PATIENCE: u32 = 2;
/// Steps that every link has beyond that.
const SLACK: u32 = 8;

impl Chain {
    /// Whether both are the same instructions from the same state.
    pub(crate) fn is_same(&self, other: &Chain) -> bool {
        self.links == other.links && self.start == other.start
    }

    fn house(&self, world: &World) -> House {
        House::new(self.scene.clone(), world.clone())
    }

    fn grader(&self) -> Option<Grader> {
        let (roles, subtasks) = self.graded.as_ref()?;
        Some(Grader::new(Grading::Class, roles, subtasks, None, (&self.scene, &self.start)))
    }

    /// All links as one instruction.
    pub(crate) fn whole(&self) -> String {
        self.links.join(" ")
    }

    /// The steps that the expert takes for each link, each from the expert's own end of the one before; with the state in which
    /// each begins. `None` where nobody grades the chain, or the expert fails.
    pub(crate) fn expert(&self) -> Option<Vec<(u32, World, Grader)>> {
        let mut rollout = Rollout::in_house(self.house(&self.start), self.whole(), Some(self.grader()?), Some(1000));
        let mut expert = ExpertPolicy::new();
        expert.reset(0, 0);
        let mut entries = vec![(0, self.start.clone(), rollout.env.grader.clone()?)];
        let mut since = 0;
        let mut note_entries = AfterEach(|rollout: &mut Rollout, tick: &Tick| {
            if tick.completed_one {
                if let Some(entry) = entries.last_mut() {
                    entry.0 = tick.step - since;
                }
                since = tick.step;
                if let Some(grader) = rollout.env.grader.clone().filter(|_| entries.len() < self.links.len()) {
                    entries.push((0, rollout.env.house.world().clone(), grader));
                }
            }
            Ok(ControlFlow::Continue(()))
        });
        rollout.run(&mut expert, &mut note_entries).ok()?;
        (entries.len() == self.links.len() && rollout.end() == Some(End::Success)).then_some(entries)
    }

    fn limits(&self) -> Vec<u32> {
        match self.expert() {
            Some(entries) => entries.iter().map(|(steps, ..)| PATIENCE * steps + SLACK).collect(),
            None => vec![UNGRADED; self.links.len()],
        }
    }
}

#[cfg(test)]
mod testing {
    use super::*;
    use crate::domain::{Class, SkillKind};
    use crate::house::testing::kitchen;

    /// To pick up the mug and put it in the sink.
    pub(crate) fn chain() -> Chain {
        let (scene, start) = kitchen();
        let role = |name: &str| Role { class: Class::named(name).unwrap(), slice: false, bound: None, expert: None };
        let subtask = |skill, receptacle| Subtask { skill, object: 0, receptacle, closes: false, literal: None };
        Chain {
            scene,
            start,
            links: vec!["Pick up the mug.".into(), "Put it in the sink.".into()],
            graded: Some((
                vec![role("Mug"), role("Sink")],
                vec![subtask(SkillKind::Pickup, None), subtask(SkillKind::Put, Some(1))],
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::testing::chain;

    #[test]
    fn the_expert_hands_over_at_every_link() {
        let entries = chain().expert().unwrap();
        assert_eq!(entries.len(), 2);
        assert!(entries.iter().all(|(steps, ..)| *steps > 0));
        assert!(entries[1].1.held.is_some(), "the second link begins with the mug in the hand");
    }
}
