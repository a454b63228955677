//! One task demonstrated: what the demonstrator would do in every state, while chance or a learner disturbs what is done.

use std::ops::ControlFlow;
use std::str::FromStr;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::agent::experts::scanning::ScanningExpert;
use crate::agent::policy::each_alone;
use crate::agent::{Decision, Decisions, ExpertPolicy, Observation, Policy};
use crate::domain::trajectory::Annotation;
use crate::domain::{Action, ActionType, Scene, Task, Trajectory, World};
use crate::env::HouseEnvironment;
use crate::episode::rollout::{AfterEach, End, Rollout, Tick};
use crate::episode::scenes::Setting;
use crate::house::House;
use crate::house::expert::TurnTiming;
use crate::house::grading::Grading;
use crate::house::view::Candidate;
use crate::language::phrases;
use crate::language::task_wording::TaskWording;

/// The longest run of random actions, in steps.
const LONGEST: u32 = 4;
/// More steps than this beyond three times the expert's give an episode up.
const SLACK: u32 = 40;

/// The expert that demonstrates, or says what a learner should have done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExpertKind {
    /// Turns around until the object it goes for is in view.
    #[default]
    Scanning,
    /// Goes straight for objects, in view or not, as ALFRED's planner did: it knows where they are.
    Privileged,
}

impl ExpertKind {
    /// The scanning expert's name on the command line.
    pub(crate) const SCANNING: &str = "scanning-expert";
    /// The privileged expert's name on the command line.
    pub(crate) const PRIVILEGED: &str = "expert";

    fn policy(self, turn_timing: TurnTiming) -> Box<dyn Policy> {
        match self {
            ExpertKind::Scanning => Box::new(ScanningExpert::new(turn_timing)),
            ExpertKind::Privileged => Box::new(ExpertPolicy::of(turn_timing)),
        }
    }
}

impl FromStr for ExpertKind {
    type Err = String;

    fn from_str(text: &str) -> Result<ExpertKind, String> {
        match text {
            ExpertKind::SCANNING => Ok(ExpertKind::Scanning),
            ExpertKind::PRIVILEGED => Ok(ExpertKind::Privileged),
            _ => Err(format!("{text:?} is neither {} nor {}", ExpertKind::SCANNING, ExpertKind::PRIVILEGED)),
        }
    }
}

/// Which expert demonstrates tasks, and what disturbs it.
#[derive(Clone, Copy, Debug)]
pub struct DemonstrationSettings {
    /// The expert whose choice is the label of every state.
    pub expert: ExpertKind,
    /// When it turns and acts, of the steps at which it may.
    pub turn_timing: TurnTiming,
    /// The fraction of steps at which random actions begin, for up to four steps.
    pub noise: f64,
}

/// A task's own words as an annotation. Of a single skill, the instruction is its sentence.
pub(crate) fn own_annotation(task: &Task) -> Annotation {
    let alone = task.subtasks.len() == 1 && task.sentences.is_empty();
    let steps = if alone { vec![task.instruction.clone()] } else { task.sentences.clone() };
    Annotation { goal: task.instruction.clone(), steps }
}

/// Annotations of a task by the grammar, `times` of them.
pub(crate) fn phrasings(
    scene: &Scene,
    start: &World,
    task: &Task,
    times: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Annotation> {
    let Task { roles, subtasks, .. } = task;
    let origins = phrases::origins(scene, start, roles);
    let story = TaskWording { roles, subtasks, origins: &origins };
    let annotate = |_| Annotation { goal: story.instruction(rng), steps: story.sentences(rng) };
    (0..times.max(1)).map(annotate).collect()
}

/// A task that is about to be demonstrated.
pub(crate) struct Demonstration<'a> {
    pub(crate) task: &'a Task,
    pub setting: Setting,
    /// The trajectory's id.
    pub(crate) id: String,
    /// The first is the instruction that a learner gets.
    pub(crate) annotations: Vec<Annotation>,
    pub(crate) settings: DemonstrationSettings,
}

impl Demonstration<'_> {
    /// Plays a task to its end; `None` when the demonstrator sees no way or takes too long.
    pub(crate) fn play(
        self,
        mut learner: Option<&mut Box<dyn Policy>>,
        rng: &mut ChaCha8Rng,
    ) -> anyhow::Result<Option<Trajectory>> {
        let Task { roles, subtasks, .. } = self.task;
        let instruction =
            self.annotations.first().map_or(self.task.instruction.clone(), |annotation| annotation.goal.clone());
        let house = House::new(self.setting.scene.clone(), self.setting.world.clone());
        let mut rollout = Rollout::new(HouseEnvironment::of_task(self.task, house, Grading::Class), instruction, None);
        rollout.horizon = Some(3 * self.task.expert_steps + SLACK + 1);
        if let Some(learner) = learner.as_mut() {
            learner.reset(0, rng.random());
            // Half of the episodes it acts as when it is measured.
            learner.set_sampling(rng.random());
        }
        // Some episodes are left undisturbed.
        let noise = if rng.random_bool(0.3) { 0.0 } else { self.settings.noise };
        let mut policy = DisturbedPolicy {
            demonstrator: self.settings.expert.policy(self.settings.turn_timing),
            learner,
            learner_until: self.task.horizon,
            noise,
            disturbed: 0,
            rng,
            choices: Vec::new(),
            sees_no_way: false,
        };
        let (mut actions, mut skill_starts) = (Vec::new(), vec![0]);
        let mut record = AfterEach(|rollout: &mut Rollout, tick: &Tick| {
            actions.push(tick.decision.action);
            if tick.completed_one && rollout.end().is_none() {
                skill_starts.push(tick.step);
            }
            Ok(ControlFlow::Continue(()))
        });
        let played = rollout.run(&mut policy, &mut record);
        if policy.sees_no_way {
            return Ok(None);
        }
        let mut choices = policy.choices;
        played?;
        if rollout.end() != Some(End::Success) {
            return Ok(None);
        }
        if choices == actions {
            choices.clear();
        }
        Ok(Some(Trajectory {
            id: self.id,
            split: "train".into(),
            scene: self.task.scene.clone(),
            start: self.setting.world,
            actions,
            roles: roles.clone(),
            skills: subtasks.clone(),
            skill_starts,
            goal: self.task.goal.clone(),
            annotations: self.annotations,
            boxes: Vec::new(),
            choices,
        }))
    }
}

/// Acts as a demonstrator, a learner or chance would, and notes what the demonstrator would have done.
struct DisturbedPolicy<'a> {
    demonstrator: Box<dyn Policy>,
    /// Acts in the demonstrator's stead, where there is one.
    learner: Option<&'a mut Box<dyn Policy>>,
    /// The step from which the learner acts no more.
    learner_until: u32,
    /// The share of steps at which chance takes over for a few steps.
    noise: f64,
    /// Steps for which chance goes on acting.
    disturbed: u32,
    rng: &'a mut ChaCha8Rng,
    choices: Vec<Action>,
    /// The demonstrator could not go on.
    sees_no_way: bool,
}

impl DisturbedPolicy<'_> {
    fn decide(&mut self, here: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let again = |here: &mut Observation<'_>, policy: &mut dyn Policy| {
            let Observation { environment, instruction, step, last } = here;
            policy.act_in(0, Observation { environment: &mut **environment, instruction, step: *step, last: *last })
        };
        let choice = again(here, self.demonstrator.as_mut()).inspect_err(|_| self.sees_no_way = true)?.action;
        if self.disturbed == 0 && self.rng.random_bool(self.noise) {
            self.disturbed = self.rng.random_range(1..=LONGEST);
        }
        // A learner that remembers looks at every step, whoever acts.
        let learned = match self.learner.as_mut() {
            Some(learner) => Some(again(here, learner.as_mut())?.action),
            None => None,
        };
        let action = match learned.filter(|_| here.step < self.learner_until) {
            _ if self.disturbed > 0 => {
                self.disturbed -= 1;
                disturbance(&here.environment.legal_actions()?, self.rng)
            }
            Some(learned) => learned,
            None => choice,
        };
        self.choices.push(choice);
        Ok(Decision::of(action))
    }
}

impl Policy for DisturbedPolicy<'_> {
    fn name(&self) -> &str {
        self.demonstrator.name()
    }

    fn slots(&self) -> usize {
        1
    }

    fn reset(&mut self, slot: usize, seed: u64) {
        self.demonstrator.reset(slot, seed);
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        each_alone(observations, |_, here| self.decide(here))
    }
}

/// Something that could happen by chance: mostly a step or a turn, at times an interaction.
fn disturbance(candidates: &[Candidate], rng: &mut ChaCha8Rng) -> Action {
    if !candidates.is_empty() && rng.random_bool(0.08) {
        return candidates[rng.random_range(0..candidates.len())].action();
    }
    Action::navigate(match rng.random_range(0..10) {
        0..4 => ActionType::MoveAhead,
        4..6 => ActionType::RotateLeft,
        6..8 => ActionType::RotateRight,
        8 => ActionType::LookUp,
        _ => ActionType::LookDown,
    })
}
