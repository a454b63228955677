//! Whether an agent there would have seen and reached what was acted on.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::agent::{Decision, Policy};
use crate::domain::{Scene, Trajectory};
use crate::env::HouseEnvironment;
use crate::episode::rollout::{Observer, Rollout, Tick};
use crate::house::{House, Outcome, Replay};

/// The first action that an agent could not have taken because its target was out of view or reach, if there is one.
pub(super) fn unseen(scene: &Arc<Scene>, trajectory: &Trajectory) -> Option<String> {
    /// Knows which action the rules alone would have allowed.
    #[derive(Default)]
    struct Sight {
        possible: bool,
        unseen: Option<String>,
    }
    impl Observer<HouseEnvironment> for Sight {
        fn before(
            &mut self,
            rollout: &mut Rollout,
            _policy: Option<&mut dyn Policy>,
            decision: &Decision,
        ) -> anyhow::Result<ControlFlow<()>> {
            let house = &rollout.env.house;
            let mut by_rules =
                Replay::new(house.scene(), house.world().clone(), std::slice::from_ref(&decision.action));
            self.possible = by_rules.step().is_some_and(|(_, outcome)| outcome.is_done());
            Ok(ControlFlow::Continue(()))
        }

        fn after(&mut self, _rollout: &mut Rollout, tick: &Tick) -> anyhow::Result<ControlFlow<()>> {
            let Tick { step, decision, outcome, .. } = tick;
            if let (true, Outcome::Impossible(reason)) = (self.possible, outcome) {
                self.unseen = Some(format!("action {}, {}: {reason}", step - 1, decision.action.kind));
                return Ok(ControlFlow::Break(()));
            }
            Ok(ControlFlow::Continue(()))
        }
    }
    let house = House::new(scene.clone(), trajectory.start.clone());
    let mut rollout = Rollout::in_house(house, String::new(), None, None);
    let mut sight = Sight::default();
    rollout.replay(trajectory.actions.iter().copied(), &mut sight).ok()?;
    sight.unseen
}
