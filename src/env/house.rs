//! House as an environment: the simulator, and the grader that follows it.

use anyhow::Context;

use super::environment::{Environment, HouseAccess, Snapshot, Transition};
use crate::domain::{Action, Class, Instance, Pose, Task, World};
use crate::house::House;
use crate::house::grading::{Grader, Grading};
use crate::house::view::{Candidate, Frame};

/// A house with what is asked in it.
pub(crate) struct HouseEnvironment {
    /// The simulator.
    pub(crate) house: House,
    /// Follows the subtasks, where there is a task.
    pub(crate) grader: Option<Grader>,
    start: HouseState,
}

/// A state of a house and of its grader.
#[derive(Clone)]
struct HouseState {
    world: World,
    grader: Option<Grader>,
}

impl HouseEnvironment {
    /// A house whose present state is the episode's start.
    pub(crate) fn new(house: House, grader: Option<Grader>) -> HouseEnvironment {
        let start = HouseState { world: house.world().clone(), grader: grader.clone() };
        HouseEnvironment { house, grader, start }
    }

    /// A task's start, graded.
    pub(crate) fn of_task(task: &Task, house: House, grading: Grading) -> HouseEnvironment {
        let grader =
            Grader::new(grading, &task.roles, &task.subtasks, task.goal.as_ref(), (house.scene(), house.world()));
        HouseEnvironment::new(house, Some(grader))
    }
}

impl Environment for HouseEnvironment {
    fn name(&self) -> &str {
        "House"
    }

    fn reset(&mut self) -> anyhow::Result<()> {
        self.house.restore(self.start.world.clone());
        self.grader.clone_from(&self.start.grader);
        Ok(())
    }

    fn frame(&mut self) -> anyhow::Result<&Frame> {
        Ok(self.house.frame())
    }

    fn legal_actions(&mut self) -> anyhow::Result<Vec<Candidate>> {
        Ok(self.house.candidates())
    }

    fn step(&mut self, action: Action) -> anyhow::Result<Transition> {
        let outcome = self.house.step(action);
        let completed_subtask = match &mut self.grader {
            Some(grader) => grader.observe(self.house.scene(), self.house.world(), action, outcome),
            None => false,
        };
        Ok(Transition { outcome, completed_subtask, reward: None })
    }

    fn class_of(&self, instance: Instance) -> Option<Class> {
        self.house.world().class_of(self.house.scene(), instance)
    }

    fn odometry(&self) -> Option<Pose> {
        Some(self.house.world().agent.relative_to(self.start.world.agent))
    }

    fn fingerprint(&self) -> Option<String> {
        Some(self.house.world().digest())
    }

    fn grading(&self) -> Option<(usize, usize)> {
        self.grader.as_ref().map(|grader| (grader.completed(), grader.total()))
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(Snapshot::of(HouseState { world: self.house.world().clone(), grader: self.grader.clone() }))
    }

    fn restore(&mut self, snapshot: &Snapshot) -> anyhow::Result<()> {
        let state: &HouseState = snapshot.get().context("this state is of another environment than House")?;
        self.house.restore(state.world.clone());
        self.grader.clone_from(&state.grader);
        Ok(())
    }

    fn house(&mut self) -> Option<HouseAccess<'_>> {
        Some(HouseAccess { house: &mut self.house, grader: self.grader.as_ref() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{ActionType, SkillKind};
    use crate::house::testing::{kitchen_house, role, subtask};

    fn environment() -> HouseEnvironment {
        let (house, roles, asked) = (kitchen_house(), [role("Mug")], [subtask(SkillKind::Pickup, 0)]);
        let grader = Grader::new(Grading::Class, &roles, &asked, None, (house.scene(), house.world()));
        HouseEnvironment::new(house, Some(grader))
    }

    #[test]
    fn a_snapshot_brings_back_world_and_grading_and_a_reset_the_start() {
        let mut environment = environment();
        let start = environment.fingerprint();
        let snapshot = environment.snapshot().unwrap();
        let mug = environment.legal_actions().unwrap().into_iter().find(|it| it.kind == ActionType::Pickup);
        if let Some(mug) = mug {
            environment.step(mug.action()).unwrap();
        }
        environment.step(Action::navigate(ActionType::RotateLeft)).unwrap();
        let turned = environment.fingerprint();
        assert_ne!(turned, start);
        environment.restore(&snapshot).unwrap();
        assert_eq!((environment.fingerprint(), environment.grading()), (start.clone(), Some((0, 1))));
        environment.step(Action::navigate(ActionType::RotateLeft)).unwrap();
        environment.reset().unwrap();
        assert_eq!(environment.fingerprint(), start);
    }

    #[test]
    fn odometry_is_what_reckoning_by_the_own_moves_gives_walls_and_all() {
        use rand::{Rng, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut environment = environment();
        environment.reset().unwrap();
        let mut reckoned = Pose { horizon: environment.house.world().agent.horizon, ..Pose::default() };
        let mut bumps = 0;
        for _ in 0..120 {
            // Two moves for each other action, so that it comes about.
            let kind = ActionType::from_index(rng.random_range(0..10usize).saturating_sub(5)).unwrap();
            let before = environment.frame().unwrap().rgb.clone();
            environment.step(Action::navigate(kind)).unwrap();
            let changed = environment.frame().unwrap().rgb != before;
            match kind {
                ActionType::MoveAhead if changed => reckoned.cell = reckoned.cell.ahead(reckoned.heading),
                ActionType::MoveAhead => bumps += 1,
                ActionType::RotateLeft => reckoned.heading = reckoned.heading.left(),
                ActionType::RotateRight => reckoned.heading = reckoned.heading.right(),
                _ => reckoned.horizon = environment.house.world().agent.horizon,
            }
            assert_eq!(environment.odometry(), Some(reckoned));
        }
        assert!(bumps > 5, "{bumps} moves failed");
    }

    #[test]
    fn a_state_of_another_environment_is_refused() {
        let error = environment().restore(&Snapshot::of(7_u32)).unwrap_err().to_string();
        assert!(error.contains("another environment"), "{error}");
    }
}
