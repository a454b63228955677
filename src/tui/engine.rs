//! The episode under exploration, without any screen: house, task, policy, everything that was tried, and the verbs that act
//! on them. The worker thread and the plain mode both drive it.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::breakpoints::{Facts, gap};
use super::openings::{Opening, Openings};
use super::policies::{Loaded, Policies, PolicyKind};
use super::timeline::{Divergence, Timeline};
use crate::agent::{Carried, Decision, Policy, Reading, Values};
use crate::domain::task::SceneRef;
use crate::domain::{Action, Cell, Scene, Task, World};
use crate::house::grading::{Grader, Grading, describe};
use crate::house::view::{Candidate, Frame, View};
use crate::house::{House, Outcome};
use crate::language::{instruction, phrases};
use crate::run::branches::{self, FRAMES, Growth, Moment, Taken, Tree};
use crate::run::chain::{self, Chain};
use crate::run::contrast::{self, Contrast};
use crate::run::episode::{Author, Episode, Step};
use crate::run::explored::{self, Explored};
use crate::run::recording::Recording;
use crate::run::rollout::{End, Rollout, Tick};
use crate::run::scenes::Setting;

/// Everything that a screen shows of the present state.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Counts the episodes of this session, from 1.
    pub episode: u32,
    /// The floor plan.
    pub scene: Arc<Scene>,
    /// The seed of the house, or of the episode's chance.
    pub seed: u64,
    /// The state.
    pub world: World,
    /// What the agent sees.
    pub frame: Arc<Frame>,
    /// Which instances it sees.
    pub view: View,
    /// What could be done now, by action and distance.
    pub candidates: Vec<Candidate>,
    /// What the agent is told.
    pub instruction: String,
    /// How many steps were taken.
    pub step: u32,
    /// After how many it ends.
    pub horizon: Option<u32>,
    /// How many the expert takes for the task.
    pub expert_steps: Option<u32>,
    /// The task, where one applies.
    pub progress: Option<Progress>,
    /// Why the episode is over, if it is.
    pub end: Option<End>,
    /// Where the agent has been.
    pub path: Vec<Cell>,
    /// Which policy decides.
    pub policy: PolicyKind,
    /// The policy's own name; a checkpoint's.
    pub acts: String,
    /// What was tried.
    pub time: Arc<Timeline>,
    /// The frames before this one that the agent sees too, newest first; only where they are asked for.
    pub recent: Vec<Arc<Frame>>,
    /// What the sentence encoder makes of the instruction.
    pub reading: Option<Reading>,
    /// Instructions that make sense in this house.
    pub examples: Arc<Vec<String>>,
    /// The checkpoints that may act.
    pub checkpoints: Arc<Vec<String>>,
}

/// How far a task has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What each subtask asks, in words.
    pub subtasks: Vec<String>,
    /// The step at which each completed subtask was.
    pub completed_at: Vec<u32>,
    /// What the current one waits for, in words.
    pub waits_for: String,
}

/// A step that was taken, for the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Which step, from 1.
    pub step: u32,
    /// What was done.
    pub action: String,
    /// What it came to.
    pub outcome: Outcome,
    /// A person chose it.
    pub by_hand: bool,
    /// The subtask that it completed.
    pub completed: Option<String>,
    /// The branch that it began, by name and why.
    pub forked: Option<String>,
}

/// The episode under exploration.
pub struct Engine {
    openings: Openings,
    policies: Policies,
    checkpoints: Arc<Vec<String>>,
    kind: PolicyKind,
    policy: Option<Box<dyn Policy>>,
    author: Author,
    rollout: Rollout,
    task: Option<Task>,
    reference: SceneRef,
    limited: bool,
    seed: u64,
    episode: u32,
    tree: Tree,
    decision: Option<(Decision, Option<Values>)>,
    frame: Option<Arc<Frame>>,
    examples: Arc<Vec<String>>,
    /// The screen shows the frames before the present one.
    looks_back: bool,
}

impl Engine {
    /// Opens the first house. `instruction` replaces the task's own.
    ///
    /// # Errors
    /// When the house cannot be opened or the instruction is unfit.
    pub fn new(
        openings: Openings,
        policies: Policies,
        kind: PolicyKind,
        instruction: Option<&str>,
    ) -> anyhow::Result<Engine> {
        let opening = openings.open()?;
        let rollout = rollout_of(&opening);
        let author = Author { policy: kind.name().into(), checkpoint: None, seed: openings.seed(), samples: false };
        let mut engine = Engine {
            checkpoints: Arc::new(policies.agents()),
            policies,
            kind,
            policy: None,
            tree: Tree::new(Moment::of(&rollout, &author, Carried::Nothing)),
            author,
            rollout,
            seed: openings.seed(),
            openings,
            task: opening.task,
            reference: opening.reference,
            limited: opening.limited,
            episode: 1,
            decision: None,
            frame: None,
            examples: Arc::default(),
            looks_back: false,
        };
        engine.examples = Arc::new(engine.suggest());
        if let Some(text) = instruction {
            engine.instruct(text)?;
            engine.plant();
        }
        Ok(engine)
    }

    /// The present state becomes the start, while nothing was tried.
    fn plant(&mut self) {
        self.tree.begin_with(self.moment());
    }

    fn moment(&self) -> Moment {
        let carried = self.policy.as_ref().map_or(Carried::Nothing, |policy| policy.carried());
        Moment::of(&self.rollout, &self.author, carried)
    }

    /// Loads the chosen policy; slow the first time for the agent. It decides from here on, having seen the last frames.
    ///
    /// # Errors
    /// When it cannot be loaded; the one before stays.
    pub fn choose(&mut self, kind: PolicyKind) -> anyhow::Result<()> {
        let Loaded { policy, checkpoint } = self.policies.make(kind)?;
        self.author.policy = policy.name().to_string();
        self.author.checkpoint = checkpoint;
        self.policy = Some(policy);
        self.kind = kind;
        self.look_back();
        self.plant();
        Ok(())
    }

    /// Lets another checkpoint be the agent, by name or number, and loads it.
    ///
    /// # Errors
    /// When there is none such, or it cannot be loaded; the one before stays.
    pub fn checkpoint(&mut self, wanted: &str) -> anyhow::Result<()> {
        let before = self.policies.chosen();
        self.policies.choose(wanted)?;
        let chosen = self.choose(PolicyKind::Agent);
        if chosen.is_err() {
            self.policies.choose(&(before + 1).to_string())?;
        }
        chosen
    }

    /// The names of the checkpoints that may act.
    pub fn checkpoints(&self) -> &[String] {
        &self.checkpoints
    }

    /// Another policy of the present kind, for work beside the episode.
    ///
    /// # Errors
    /// When it cannot be loaded.
    pub fn another_policy(&self) -> anyhow::Result<Box<dyn Policy>> {
        Ok(self.policies.make(self.kind)?.policy)
    }

    /// Gives the policy another chance from here on; with `samples` it draws its actions instead of taking the likeliest.
    pub fn reseed(&mut self, seed: u64, samples: bool) {
        self.author.seed = seed;
        self.author.samples = samples;
        self.look_back();
        self.plant();
    }

    /// Who decides, and by which chance.
    pub fn author(&self) -> &Author {
        &self.author
    }

    /// The policy begins anew here, having seen the frames before this one.
    fn look_back(&mut self) {
        self.decision = None;
        let Some(policy) = self.policy.as_deref_mut() else { return };
        let before: Vec<Moment> = self.tree.past().rev().skip(1).take(FRAMES - 1).cloned().collect();
        branches::look_back(policy, &self.author, &mut self.rollout, &before, self.tree.at());
    }

    /// Which policy decides.
    pub fn policy(&self) -> PolicyKind {
        self.kind
    }

    /// Whether a policy is loaded.
    pub fn has_policy(&self) -> bool {
        self.policy.is_some()
    }

    /// What the policy would do now. Decided once a state, and again when the instruction or the policy changes.
    ///
    /// # Errors
    /// When the policy cannot go on, or none is loaded.
    pub fn think(&mut self) -> anyhow::Result<&(Decision, Option<Values>)> {
        let thought = match self.decision.take() {
            Some(thought) => thought,
            None => {
                let policy = self.policy.as_deref_mut().ok_or_else(|| anyhow::anyhow!("no policy is loaded"))?;
                if self.kind == PolicyKind::Expert && self.rollout.grader.is_none() {
                    anyhow::bail!("the expert needs a task: it reads the subtasks, not the instruction");
                }
                let decision = self.rollout.decide(policy)?;
                let values = policy.values(&mut self.rollout.situation())?;
                (decision, values)
            }
        };
        Ok(self.decision.insert(thought))
    }

    /// Takes one step by the policy's choice.
    ///
    /// # Errors
    /// When the policy cannot go on; nothing was done then.
    pub fn step(&mut self) -> anyhow::Result<Event> {
        anyhow::ensure!(!self.tree.is_full(), "no more steps are remembered in this episode: N opens the next one");
        let decision = self.think()?.0.clone();
        Ok(self.carry_out(decision, self.author.clone()))
    }

    /// Takes one step that a person chose. The policy sees that state too, so that it has seen every frame.
    pub fn act(&mut self, action: Action) -> Event {
        let _ = self.think();
        self.carry_out(Decision { action, mind: None }, Author::hand())
    }

    fn carry_out(&mut self, decision: Decision, author: Author) -> Event {
        let words = self.words(decision.action);
        let current = self.current_subtask();
        let (mind, values) = self.decision.take().map_or((None, None), |(thought, values)| (thought.mind, values));
        let tick = self.rollout.carry_out(decision.clone());
        let taken = Taken {
            decision: Decision { action: decision.action, mind: decision.mind.or(mind) },
            step: Step::of(&tick, &self.rollout),
            instruction: self.rollout.instruction.as_str().into(),
            author,
            values,
        };
        let Tick { step, outcome, completed_one, .. } = tick;
        self.frame = None;
        let by_hand = taken.author.is_hand();
        let why = self.why(&taken, &words);
        let moment = self.moment();
        let growth = self.tree.grow(taken, || moment, || why);
        if growth == Growth::Known {
            self.tree.moment().restore(&mut self.rollout, step);
        }
        let forked = match growth {
            Growth::Forked(branch) => self.tree.branches().get(branch).map(|b| format!("{}: {}", b.name, b.why)),
            Growth::Longer | Growth::Known => None,
        };
        Event { step, action: words, outcome, by_hand, completed: current.filter(|_| completed_one), forked }
    }

    /// What is new about a step that is not the one which is there already.
    fn why(&self, taken: &Taken, words: &str) -> String {
        let Some(next) = self.tree.next() else { return "went on".into() };
        if next.instruction != taken.instruction {
            format!("told: {}", taken.instruction)
        } else if next.decision.action != taken.decision.action {
            format!("{words} ({})", who(&taken.author))
        } else {
            format!("{} acts", who(&taken.author))
        }
    }

    fn current_subtask(&self) -> Option<String> {
        let grader = self.rollout.grader.as_ref()?;
        let subtask = grader.subtasks().get(grader.completed())?;
        Some(describe(grader.roles(), subtask))
    }

    /// An action with the name of its target.
    pub fn words(&self, action: Action) -> String {
        let house = &self.rollout.house;
        let class = action.target.and_then(|target| house.world().class_of(house.scene(), target));
        match class {
            Some(class) => format!("{} {}", action.kind, class.name()),
            None => action.kind.to_string(),
        }
    }

    /// Whether the episode is over, and why.
    pub fn end(&self) -> Option<End> {
        self.rollout.end()
    }

    /// Tells the agent something else, from the next step on; says what that means for the task.
    ///
    /// # Errors
    /// When the text is empty, too long, or holds control characters.
    pub fn instruct(&mut self, text: &str) -> anyhow::Result<&'static str> {
        let text = instruction::parse(text)?;
        self.rollout.instruction = text;
        self.decision = None;
        let asked = self.task.as_ref().is_some_and(|task| {
            instruction::normalise(&task.instruction) == instruction::normalise(&self.rollout.instruction)
        });
        Ok(match (self.rollout.grader.is_some(), asked) {
            (true, true) => "the task's own words",
            (true, false) => {
                self.rollout.grader = None;
                self.rollout.horizon = None;
                "the task no longer applies"
            }
            (false, true) => "the task's words again: reset to be graded",
            (false, false) => "applies from the next step",
        })
    }

    /// What the agent is told.
    pub fn instruction(&self) -> &str {
        &self.rollout.instruction
    }

    /// The task of this episode, whether it still applies or not.
    pub fn task(&self) -> Option<&Task> {
        self.task.as_ref()
    }

    /// The present state of the house.
    pub fn rollout(&self) -> &Rollout {
        &self.rollout
    }

    /// Back to the start, with the present instruction. What was tried stays.
    pub fn reset(&mut self) {
        let instruction = self.rollout.instruction.clone();
        self.seek(0);
        let fresh = rollout_of(&Opening {
            scene: self.rollout.house.scene().clone(),
            world: self.rollout.house.world().clone(),
            task: self.task.clone(),
            reference: self.reference.clone(),
            limited: self.limited,
        });
        self.rollout.grader = fresh.grader;
        self.rollout.horizon = fresh.horizon;
        // The text was checked when it came in.
        let _ = self.instruct(&instruction);
        self.plant();
    }

    /// Goes to a step of the branch in hand, or to its end.
    pub fn seek(&mut self, step: u32) {
        self.tree.seek(step);
        self.settle();
    }

    /// Takes another branch in hand.
    ///
    /// # Errors
    /// When there is none of that number.
    pub fn switch(&mut self, branch: usize) -> anyhow::Result<()> {
        anyhow::ensure!(self.tree.switch(branch), "there is no branch {}", branch + 1);
        self.settle();
        Ok(())
    }

    /// The branch of that name, or of that number from 1.
    ///
    /// # Errors
    /// When there is none; says which there are.
    pub fn branch(&self, wanted: &str) -> anyhow::Result<usize> {
        let branches = self.tree.branches();
        let numbered = || wanted.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let found = branches.iter().position(|branch| branch.name == wanted).or_else(numbered);
        found.filter(|&at| at < branches.len()).ok_or_else(|| {
            let names: Vec<&str> = branches.iter().map(|branch| branch.name.as_str()).collect();
            anyhow::anyhow!("there is no branch {wanted:?}; there are: {}", names.join(", "))
        })
    }

    /// What conditions ask of the present state.
    pub fn facts(&mut self) -> Facts {
        let classes = |engine: &mut Engine| {
            let seen = engine.rollout.house.view().sightings.clone();
            let house = &engine.rollout.house;
            seen.iter().filter_map(|seen| house.world().class_of(house.scene(), seen.instance)).collect()
        };
        let (mind, values) = match &self.decision {
            Some((decision, values)) => (decision.mind.as_ref(), values.as_ref()),
            None => (None, None),
        };
        Facts {
            step: self.tree.at(),
            completed: self.rollout.grader.as_ref().map_or(0, |grader| grader.completed() as u32),
            failed: self.tree.last_taken().is_some_and(|taken| !taken.step.outcome.is_done()),
            value: values.map(|values| values.state),
            gap: gap(mind, values),
            entropy: mind.map(|mind| mind.entropy),
            seen: classes(self),
        }
    }

    /// The instruction in force and another, in the present state.
    ///
    /// # Errors
    /// When the other text is no instruction, or the policy has no distribution.
    pub fn contrast(&mut self, other: &str) -> anyhow::Result<Contrast> {
        // The policy has looked at this state once, as always.
        self.think()?;
        let policy = self.policy.as_deref_mut().ok_or_else(|| anyhow::anyhow!("no policy is loaded"))?;
        contrast::contrast(policy, &mut self.rollout, other)
    }

    /// A chain from the present state: the links of `text`, or without any the task's own sentences. Subtasks grade it where
    /// there is one for each link.
    ///
    /// # Errors
    /// When there is neither text nor task.
    pub fn chain(&self, text: &str) -> anyhow::Result<Chain> {
        let house = &self.rollout.house;
        let left = self.rollout.grader.as_ref().map(|grader| {
            let mut roles = grader.roles().to_vec();
            for (at, role) in (0u8..).zip(&mut roles) {
                role.bound = grader.binding(at);
            }
            (roles, grader.subtasks().get(grader.completed()..).unwrap_or_default().to_vec())
        });
        let mut links = chain::split(text);
        if links.is_empty() {
            let (roles, subtasks) = left.as_ref().filter(|(_, subtasks)| !subtasks.is_empty()).ok_or_else(|| {
                anyhow::anyhow!("there is no task whose steps would be a chain: type one, with ; between the links")
            })?;
            let task = self.task.as_ref().filter(|task| !task.sentences.is_empty());
            let mut rng = ChaCha8Rng::seed_from_u64(0);
            links = match task {
                Some(task) => task.sentences.iter().rev().take(subtasks.len()).rev().cloned().collect(),
                None => subtasks.iter().map(|subtask| phrases::sentence(roles, subtask, &mut rng)).collect(),
            };
            links = links.iter().map(|link| instruction::normalise(link)).collect();
        }
        let graded = left.filter(|(_, subtasks)| subtasks.len() == links.len());
        Ok(Chain { scene: house.scene().clone(), start: house.world().clone(), links, graded })
    }

    /// Everything that was tried.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Gives a branch another name.
    ///
    /// # Errors
    /// When the name is empty or taken.
    pub fn rename(&mut self, branch: usize, name: &str) -> anyhow::Result<()> {
        anyhow::ensure!(self.tree.rename(branch, name), "{name:?} is empty, or another branch's name");
        Ok(())
    }

    /// Where another branch and the one in hand part, and what they do from there.
    pub fn divergence(&self, other: usize) -> Divergence {
        Divergence::of(&self.tree, self.tree.branch(), other)
    }

    /// Brings house and policy to the state in hand.
    fn settle(&mut self) {
        let moment = self.tree.moment().clone();
        moment.restore(&mut self.rollout, self.tree.at());
        self.frame = None;
        self.decision = None;
        if moment.author == self.author && !matches!(moment.carried, Carried::Nothing) {
            if let Some(policy) = self.policy.as_deref_mut() {
                policy.put_back(moment.carried);
            }
        } else {
            self.look_back();
        }
    }

    /// Takes the steps of a recorded episode again, and stays at its end. The policy looks at every state where `thinks`;
    /// returns the first step at which it would not choose what was recorded.
    ///
    /// # Errors
    /// When a step does not come to what was recorded.
    pub fn retrace(&mut self, episode: &Episode, author: &Author, thinks: bool) -> anyhow::Result<Option<u32>> {
        self.instruct(&episode.instruction)?;
        self.plant();
        let mut author = author.clone();
        let mut parted = None;
        for (number, recorded) in (1..).zip(&episode.trace) {
            if let Some(told) = &recorded.told {
                self.instruct(told)?;
            }
            if let Some(by) = &recorded.by {
                author = by.clone();
            }
            let action = Action { kind: recorded.kind, target: recorded.target };
            if thinks {
                let would = self.think().map(|(decision, _)| decision.action);
                if !author.is_hand() && author == self.author && would.ok() != Some(action) {
                    parted = parted.or(Some(number));
                }
            }
            self.carry_out(Decision { action, mind: None }, author.clone());
            let found = self.tree.steps().nth(number as usize - 1).map(|taken| taken.step.outcome);
            anyhow::ensure!(
                found == Some(recorded.outcome),
                "step {number} ({}) came to {:?}; recorded is {:?}: the simulator or the scene is another one",
                recorded.kind,
                found.map(|outcome| outcome.to_string()).unwrap_or_default(),
                recorded.outcome.to_string()
            );
        }
        Ok(parted)
    }

    /// Everything that was tried as a run's tasks and episodes, a branch each.
    pub fn explored(&self) -> Explored {
        let tasks = self.tree.branches().iter().map(|branch| self.task_at(self.tree.start(), &branch.name)).collect();
        let episodes = self.tree.branches().iter().enumerate();
        Explored {
            scene: self.rollout.house.scene().clone(),
            tasks,
            episodes: episodes.map(|(at, branch)| self.tree.episode(at, &branch.name)).collect(),
        }
    }

    /// The branch in hand as a recording.
    ///
    /// # Errors
    /// Never for what the simulator itself did.
    pub fn recording(&self) -> anyhow::Result<Recording> {
        let start = self.tree.start();
        let name = self.tree.branches().get(self.tree.branch()).map_or("", |branch| branch.name.as_str());
        let setting = Setting { scene: self.rollout.house.scene().clone(), world: (*start.world).clone() };
        Recording::of(&setting, &self.task_at(start, name), &self.tree.episode(self.tree.branch(), name))
    }

    /// The present state and instruction as a task: what is left of the subtasks, with the expert's own number of steps.
    ///
    /// # Errors
    /// When nobody grades the instruction, nothing is left to do, or the expert sees no way.
    pub fn as_task(&self) -> anyhow::Result<(Task, Arc<Scene>)> {
        let name = self.tree.branches().get(self.tree.branch()).map_or("", |branch| branch.name.as_str());
        let id = format!("{}-{name}-{}", self.rollout.house.scene().name, self.tree.at());
        let base = self.task_at(self.tree.moment(), &id);
        Ok((explored::rest_of(base, &self.rollout)?, self.rollout.house.scene().clone()))
    }

    /// The task that begins at a moment; without subtasks where nobody grades the instruction.
    fn task_at(&self, moment: &Moment, id: &str) -> Task {
        let graded = self.task.as_ref().filter(|_| moment.grader.is_some());
        let mut task = graded.cloned().unwrap_or_else(|| explored::ungraded(self.reference.clone()));
        task.id = id.into();
        task.start = Some((*moment.world).clone());
        task.instruction.clone_from(&moment.instruction);
        task
    }

    /// The episode has no end but success.
    pub fn unlimited(&mut self) {
        self.limited = false;
        self.rollout.horizon = None;
        self.plant();
    }

    /// Lets that author's policy begin here: its chance, and whether it draws.
    pub fn begin_as(&mut self, author: Author) {
        self.author = author;
        self.look_back();
        self.plant();
    }

    /// Opens the next house, or the next task of the set.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn next_episode(&mut self) -> anyhow::Result<()> {
        self.openings.advance();
        self.enter_opened()
    }

    /// Opens the house of another seed.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn seed(&mut self, seed: u64) -> anyhow::Result<()> {
        self.openings.seek(seed);
        self.enter_opened()
    }

    fn enter_opened(&mut self) -> anyhow::Result<()> {
        let opening = self.openings.open()?;
        self.seed = self.openings.seed();
        self.author.seed = self.seed;
        self.rollout = rollout_of(&opening);
        self.task = opening.task;
        self.reference = opening.reference;
        self.limited = opening.limited;
        self.episode += 1;
        self.decision = None;
        self.frame = None;
        if let Some(policy) = &mut self.policy {
            policy.begin(self.seed);
        }
        self.tree = Tree::new(self.moment());
        self.examples = Arc::new(self.suggest());
        Ok(())
    }

    /// Instructions that make sense in this house: the task's own, its steps in training's words, and a pickup of each thing.
    fn suggest(&self) -> Vec<String> {
        let mut found: Vec<String> = Vec::new();
        if let Some(task) = &self.task {
            found.push(instruction::normalise(&task.instruction));
            found.extend(task.sentences.iter().map(|sentence| instruction::normalise(sentence)));
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            for subtask in &task.subtasks {
                found.push(instruction::normalise(&phrases::sentence(&task.roles, subtask, &mut rng)));
            }
        }
        let objects = &self.rollout.house.world().objects;
        let mut names: Vec<&str> =
            objects.iter().filter(|o| o.class.info().pickupable).map(|object| object.class.spoken()).collect();
        names.sort_unstable();
        names.dedup();
        found.extend(names.into_iter().map(|name| format!("Pick up the {name}.")));
        found.dedup();
        found
    }

    /// How far the task has come, where one applies.
    pub fn progress(&self) -> Option<Progress> {
        let (grader, house) = (self.rollout.grader.as_ref()?, &self.rollout.house);
        let steps = (1..=self.tree.at()).zip(self.tree.steps());
        Some(Progress {
            subtasks: grader.subtasks().iter().map(|subtask| describe(grader.roles(), subtask)).collect(),
            completed_at: steps.filter(|(_, taken)| taken.step.subtask.is_some()).map(|(step, _)| step).collect(),
            waits_for: grader.waits_for(house.scene(), house.world()),
        })
    }

    /// Whether snapshots hold the frames before the present one.
    pub fn set_looking_back(&mut self, looks_back: bool) {
        self.looks_back = looks_back;
    }

    /// The frames before the present one that a trained agent sees too, newest first.
    fn recent(&mut self) -> Vec<Arc<Frame>> {
        if !self.looks_back {
            return Vec::new();
        }
        let scene = self.rollout.house.scene().clone();
        let mut worlds: Vec<Arc<World>> =
            self.tree.past().rev().skip(1).take(FRAMES - 1).map(|m| m.world.clone()).collect();
        // Before the first frame there was the first one.
        let first = self.tree.past().next().map(|moment| moment.world.clone());
        worlds.extend(std::iter::repeat_n(first, FRAMES).flatten());
        worlds.truncate(FRAMES - 1);
        let Some(start) = worlds.first() else { return Vec::new() };
        let mut house = House::new(scene, (**start).clone());
        let mut draw = |world: Arc<World>| {
            house.restore((*world).clone());
            Arc::new(house.frame().clone())
        };
        worlds.into_iter().map(&mut draw).collect()
    }

    /// The present state for a screen; draws the frame when it changed.
    pub fn snapshot(&mut self) -> Snapshot {
        let candidates = self.rollout.house.candidates();
        let frame = match &self.frame {
            Some(frame) => frame.clone(),
            None => self.frame.insert(Arc::new(self.rollout.house.frame().clone())).clone(),
        };
        let view = self.rollout.house.view().clone();
        let progress = self.progress();
        let recent = self.recent();
        let house = &self.rollout.house;
        let mut path: Vec<Cell> = self.tree.past().map(|moment| moment.world.agent.cell).collect();
        path.dedup();
        Snapshot {
            episode: self.episode,
            scene: house.scene().clone(),
            seed: self.seed,
            world: house.world().clone(),
            frame,
            view,
            candidates,
            instruction: self.rollout.instruction.clone(),
            step: self.rollout.steps(),
            horizon: self.rollout.horizon,
            expert_steps: self.task.as_ref().filter(|_| self.rollout.grader.is_some()).map(|task| task.expert_steps),
            progress,
            end: self.rollout.end(),
            path,
            policy: self.kind,
            acts: self.author.policy.clone(),
            time: Arc::new(Timeline::of(&self.tree)),
            recent,
            reading: self.policy.as_ref().and_then(|policy| policy.reading(&self.rollout.instruction)),
            examples: self.examples.clone(),
            checkpoints: self.checkpoints.clone(),
        }
    }
}

/// Who chose, in a few words.
fn who(author: &Author) -> String {
    match (author.is_hand(), author.samples) {
        (true, _) => "you".into(),
        (false, true) => format!("{}, drawn with seed {}", author.policy, author.seed),
        (false, false) => author.policy.clone(),
    }
}

fn rollout_of(opening: &Opening) -> Rollout {
    let house = House::new(opening.scene.clone(), opening.world.clone());
    match &opening.task {
        // What a person made up is not graded.
        Some(task) if task.subtasks.is_empty() => Rollout::new(house, task.instruction.clone(), None, None),
        Some(task) => {
            let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, task.goal.as_ref());
            Rollout::new(house, task.instruction.clone(), Some(grader), opening.limited.then_some(task.horizon))
        }
        None => Rollout::new(house, "look around".into(), None, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::ActionType;
    use crate::tui::testing;

    #[test]
    fn another_instruction_ends_the_task_and_its_own_words_bring_it_back_at_a_reset() {
        let mut engine = testing::engine();
        let words = engine.instruction().to_string();
        assert_eq!(engine.instruct("open the fridge").unwrap(), "the task no longer applies");
        assert!(engine.progress().is_none());
        engine.reset();
        assert_eq!(engine.instruction(), "Open the fridge.", "a reset keeps what was typed");
        assert!(engine.progress().is_none());
        assert!(engine.instruct(&words.to_uppercase()).unwrap().contains("reset"));
        engine.reset();
        assert_eq!(engine.progress().unwrap().subtasks.len(), 2);
    }

    #[test]
    fn the_expert_without_a_task_says_so_and_solves_one() {
        let mut engine = testing::engine();
        engine.choose(PolicyKind::Expert).unwrap();
        for _ in 0..48 {
            engine.step().unwrap();
            if engine.end().is_some() {
                break;
            }
        }
        assert_eq!(engine.end(), Some(End::Success));
        assert_eq!(engine.progress().unwrap().completed_at.len(), 2);
        engine.reset();
        engine.instruct("dance").unwrap();
        assert!(engine.think().unwrap_err().to_string().contains("the expert needs a task"));
    }

    #[test]
    fn unfit_instructions_change_nothing() {
        let mut engine = testing::engine();
        let words = engine.instruction().to_string();
        for text in ["", "   ", "open\x1b[2J the door", &"word ".repeat(2_000)] {
            assert!(engine.instruct(text).is_err(), "{text:.20}");
        }
        assert_eq!(engine.instruction(), words);
        assert!(engine.progress().is_some());
    }

    #[test]
    fn a_state_is_decided_once_and_the_decision_is_what_happens() {
        let mut engine = testing::engine();
        engine.choose(PolicyKind::Random).unwrap();
        let first = engine.think().unwrap().0.action;
        assert_eq!(engine.think().unwrap().0.action, first);
        let words = engine.words(first);
        assert_eq!(engine.step().unwrap().action, words);
    }

    #[test]
    fn a_reset_brings_back_the_world_and_the_path_begins_anew() {
        let mut engine = testing::engine();
        let start = engine.snapshot();
        engine.act(Action::navigate(ActionType::MoveAhead));
        engine.act(Action::navigate(ActionType::RotateLeft));
        assert_eq!(engine.snapshot().step, 2);
        engine.reset();
        let again = engine.snapshot();
        assert_eq!((again.world, again.step, again.path.len()), (start.world, 0, 1));
        assert_eq!((again.episode, again.time.beats.len()), (1, 2), "what was tried stays");
    }

    /// Everything that decides what comes next, as text.
    fn state(engine: &mut Engine) -> String {
        let frame = engine.snapshot().frame;
        let thought = engine.think().map(|(decision, _)| format!("{decision:?}")).unwrap_or_default();
        let moment = engine.moment();
        let (world, told) = (moment.world.digest(), &moment.instruction);
        let sum: u64 = frame.rgb.iter().zip(1u64..).map(|(&value, at)| u64::from(value) * at).sum();
        format!(
            "{world} {told} {:?} {:?} {thought} {sum} {:?}",
            moment.grader,
            moment.horizon,
            engine.policy.as_ref().unwrap().carried()
        )
    }

    #[test]
    fn going_back_and_forth_restores_everything_bit_for_bit() {
        for kind in [PolicyKind::Random, PolicyKind::Expert] {
            let mut engine = testing::engine();
            engine.choose(kind).unwrap();
            let mut states = vec![state(&mut engine)];
            while states.len() < 10 && engine.end().is_none() {
                engine.step().unwrap();
                states.push(state(&mut engine));
            }
            let last = states.len() - 1;
            for step in [last - 1, last / 3, last, 0, last / 2, 1, last - 1] {
                engine.seek(step as u32);
                assert_eq!(state(&mut engine), states[step], "{kind:?}, step {step}");
            }
            engine.seek(1);
            for wanted in &states[2..] {
                engine.step().unwrap();
                assert_eq!(&state(&mut engine), wanted, "the policy goes the same way again");
            }
            assert_eq!(engine.tree().branches().len(), 1, "and no branch began");
        }
    }

    #[test]
    fn another_action_instruction_seed_or_policy_forks() {
        let mut engine = testing::engine();
        engine.choose(PolicyKind::Random).unwrap();
        for _ in 0..4 {
            engine.step().unwrap();
        }
        engine.seek(1);
        let event = engine.act(Action::navigate(ActionType::LookDown));
        assert!(event.forked.unwrap().starts_with("b1: "));
        engine.switch(0).unwrap();
        engine.seek(2);
        engine.instruct("dance").unwrap();
        assert!(engine.step().unwrap().forked.unwrap().contains("told: Dance."));
        engine.switch(0).unwrap();
        engine.seek(1);
        assert!(engine.rollout.grader.is_some(), "the task is back where it applied");
        engine.reseed(77, false);
        assert!(engine.step().unwrap().forked.unwrap().starts_with("b3: "));
        engine.switch(0).unwrap();
        engine.seek(0);
        engine.choose(PolicyKind::Expert).unwrap();
        assert!(engine.step().unwrap().forked.is_some());
        assert_eq!(engine.tree().branches().len(), 5);
        let divergence = engine.divergence(0);
        assert_eq!(divergence.shared, 0);
    }
}
