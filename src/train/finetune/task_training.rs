//! The training on one task: rollouts fill the replay, updates learn from it, in turns.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tch::Tensor;

use super::config::FinetuneConfig;
use super::origin::Origin;
use super::replay::{Replay, ReplayEpisode};
use super::rollouts::{Start, play};
use crate::agent::Policy;
use crate::agent::checkpoint::Networks;
use crate::agent::config::{CheckpointConfig, FinetunedOn};
use crate::agent::epsilon_greedy::EpsilonGreedy;
use crate::algo::batch::Batch;
use crate::algo::critic::CriticLearner;
use crate::algo::update::Update;
use crate::nets::visual::SIDE;
use crate::nets::weights::Tensors;
use crate::report::stats::mean;
use crate::train::metrics::{ProgressLogger, Scalars};
use crate::train::training_state::TrainingState;

/// The stage's name among scalars.
pub(super) const STAGE: &str = "finetuning";
/// Mixed into the seed: transitions are replayed by another random stream than rollouts are played.
const REPLAY: u64 = 0x4e91;
/// How many rollouts the saved state knows.
const ROLLOUTS: &str = "replay.rollouts";

/// One task to be finetuned on.
pub(super) struct TaskTraining<'a> {
    pub(super) origin: &'a Origin<'a>,
    pub(super) config: &'a FinetuneConfig,
    pub(super) start: Start,
    /// The checkpoint's folder.
    pub(super) folder: &'a Path,
    /// What the saved state belongs to.
    pub(super) identity: &'a BTreeMap<String, String>,
}

/// Everything that changes while a task is trained on.
struct Learning<'a> {
    networks: &'a Networks,
    update: Update<'a>,
    explorer: EpsilonGreedy,
    replay: Replay,
    conditioning: Tensor,
    /// The latest greedy rollout, with the number of updates before it.
    measured: Option<(u64, ReplayEpisode)>,
    /// The numbers of the latest update.
    numbers: BTreeMap<String, f64>,
}

impl Learning<'_> {
    /// The steps that followed the initial rollouts.
    fn steps(&self, config: &FinetuneConfig) -> u64 {
        self.replay.steps() - self.replay.steps_of_first(config.initial_rollouts)
    }
}

impl TaskTraining<'_> {
    /// Trains up to the last step, from where the state left off if it is there. Returns false when it was stopped: what was
    /// done since the last saved state is done again by the resumed training.
    ///
    /// # Errors
    /// When a file cannot be read or written, belongs to something else, or a loss is not a number.
    pub(super) fn run(&self, logger: &mut dyn ProgressLogger, stop: &AtomicBool) -> anyhow::Result<bool> {
        let path = self.folder.join("training/state.safetensors");
        let state = TrainingState { path: &path, identity: self.identity };
        let saved = state.read()?;
        let networks = self.origin.networks()?;
        let mut learning = self.begin(&networks, &path, saved)?;
        logger.log(&Scalars::new(STAGE, learning.steps(self.config).min(self.config.steps), self.config.steps))?;
        if learning.replay.steps() == 0 {
            self.measure(&mut learning, 0, &[0], logger)?;
            self.save(&learning, state)?;
        }
        let mut saved_at = learning.replay.steps();
        while learning.steps(self.config) < self.config.steps {
            if stop.load(Ordering::Relaxed) {
                self.save(&learning, state)?;
                return Ok(false);
            }
            let before = learning.steps(self.config);
            self.collect(&mut learning)?;
            if !self.learn(&mut learning, stop)? {
                return Ok(false);
            }
            let now = learning.steps(self.config);
            let marks = match learning.replay.episodes().len() as u64 {
                rollouts if rollouts < self.config.initial_rollouts => Vec::new(),
                // Now it is known what the agent comes to while it explores, before it learns.
                rollouts if rollouts == self.config.initial_rollouts => vec![0],
                _ => self.marks(before, now),
            };
            if marks.is_empty() {
                logger.log(&Scalars::new(STAGE, now.min(self.config.steps), self.config.steps))?;
            } else {
                self.measure(&mut learning, before, &marks, logger)?;
            }
            if learning.replay.steps() - saved_at >= self.config.save_every || now >= self.config.steps {
                self.save(&learning, state)?;
                saved_at = learning.replay.steps();
            }
        }
        Ok(true)
    }

    /// At the start, or where the saved state left off.
    fn begin<'n>(
        &self,
        networks: &'n Networks,
        path: &Path,
        saved: Option<(u64, Tensors)>,
    ) -> anyhow::Result<Learning<'n>> {
        let optimisation = self.config.optimisation();
        let critics = networks.critic.as_ref().context("there is no critic")?;
        let critic = CriticLearner::new(
            (&critics.online, &critics.online_store),
            (&critics.target, &critics.target_store),
            optimisation.clone(),
            self.config.iql.clone(),
            self.config.seed,
        );
        let policy = (&networks.policy, &networks.policy_store);
        let mut update = Update::new(policy, Some(critic), None, optimisation, self.config.seed);
        let mut rollouts = 0;
        if let Some((step, mut tensors)) = saved {
            let count =
                tensors.remove(ROLLOUTS).with_context(|| format!("{}: {ROLLOUTS} is missing", path.display()))?;
            rollouts = count.int64_value(&[0]) as u64;
            update.restore(path, step, &tensors)?;
        }
        let mut explorer = self.origin.explorer(self.config.epsilon[0])?;
        let conditioning = self.start.conditioning(&mut explorer)?;
        let numbers = self.origin.config.features() * SIDE * SIDE;
        let replay = Replay::open(&self.folder.join("training"), numbers as usize, rollouts)?;
        Ok(Learning { networks, update, explorer, replay, conditioning, measured: None, numbers: BTreeMap::new() })
    }

    /// Plays as many rollouts as there are samplers, and before the first update no more than the initial ones.
    fn collect(&self, learning: &mut Learning<'_>) -> anyhow::Result<()> {
        let FinetuneConfig { samplers, initial_rollouts, sampling, seed, .. } = *self.config;
        let first = learning.replay.episodes().len() as u64;
        let (initial, steps) = (initial_rollouts.saturating_sub(first), learning.steps(self.config));
        let count = if initial > 0 { samplers.min(initial) } else { samplers };
        let explorer = &mut learning.explorer;
        explorer.agent.take_weights(learning.networks)?;
        explorer.epsilon = self.config.epsilon_at(steps);
        explorer.set_sampling(sampling);
        for collected in play(explorer, &self.start, seed, first..first + count)? {
            learning.replay.append(collected.episode, &collected.maps)?;
        }
        Ok(())
    }

    /// Takes the updates that are due; false when it was stopped.
    fn learn(&self, learning: &mut Learning<'_>, stop: &AtomicBool) -> anyhow::Result<bool> {
        let due = self.config.updates_due(learning.steps(self.config));
        let Learning { update, replay, conditioning, numbers, .. } = learning;
        while update.step() < due {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let mut rng = ChaCha8Rng::seed_from_u64(self.config.seed ^ REPLAY);
            rng.set_stream(update.step() + 1);
            let history = self.origin.config.policy.history;
            let base = replay.draw(&mut rng, self.config.training.batch_size, history, conditioning)?;
            let last = update.step() + 1 == due;
            let found = update.update(&Batch { base, pairs: None }, last)?;
            if last {
                *numbers = found;
            }
        }
        Ok(true)
    }

    /// The steps after `before` and up to `now` at which the agent is measured: the same for every task.
    fn marks(&self, before: u64, now: u64) -> Vec<u64> {
        let FinetuneConfig { evaluate_every, steps, .. } = *self.config;
        let regular = (before / evaluate_every + 1..=now.min(steps) / evaluate_every).map(|mark| mark * evaluate_every);
        let last = (now >= steps && !steps.is_multiple_of(evaluate_every)).then_some(steps);
        regular.chain(last).collect()
    }

    /// Lets the agent play greedily, and logs what came of it at `marks`, with what came of the rollouts since the mark before
    /// `before`, or at the start of the initial ones.
    fn measure(
        &self,
        learning: &mut Learning<'_>,
        before: u64,
        marks: &[u64],
        logger: &mut dyn ProgressLogger,
    ) -> anyhow::Result<()> {
        let updates = learning.update.step();
        let episode = match &learning.measured {
            Some((at, episode)) if *at == updates => episode.clone(),
            _ => self.greedy(learning)?,
        };
        learning.measured = Some((updates, episode.clone()));
        let (replay, initial) = (&learning.replay, self.config.initial_rollouts);
        let since = before / self.config.evaluate_every * self.config.evaluate_every + replay.steps_of_first(initial);
        let is_recent = |number: u64| match marks {
            [0] => number <= initial,
            _ => number > initial && replay.steps_of_first(number) > since,
        };
        let recent: Vec<f64> = (1..)
            .zip(replay.episodes())
            .filter(|(number, _)| is_recent(*number))
            .map(|(_, episode)| episode.episode_return())
            .collect();
        for &mark in marks {
            let mut scalars = Scalars::new(STAGE, mark, self.config.steps);
            scalars.values = learning.numbers.clone();
            scalars.set("return", episode.episode_return());
            scalars.set("completed_subtasks", f64::from(episode.completed));
            scalars.set("success", f64::from(u8::from(episode.completed == episode.of)));
            scalars.set("rollouts", replay.episodes().len() as f64);
            scalars.set("updates", updates as f64);
            if !recent.is_empty() {
                scalars.set("rollout_return", mean(recent.iter().copied()));
                scalars.set("epsilon", learning.explorer.epsilon);
            }
            logger.log(&scalars)?;
        }
        Ok(())
    }

    /// One rollout of the agent as it is now, by its likeliest actions alone.
    fn greedy(&self, learning: &mut Learning<'_>) -> anyhow::Result<ReplayEpisode> {
        let explorer = &mut learning.explorer;
        explorer.agent.take_weights(learning.networks)?;
        let explores = std::mem::replace(&mut explorer.epsilon, 0.0);
        explorer.set_sampling(false);
        let played = play(explorer, &self.start, self.config.seed, std::iter::once(u64::MAX))?;
        explorer.epsilon = explores;
        Ok(played.into_iter().next().context("no rollout was played")?.episode)
    }

    /// Keeps the checkpoint, and after it the state that knows which rollouts there are.
    fn save(&self, learning: &Learning<'_>, state: TrainingState<'_>) -> anyhow::Result<()> {
        learning.replay.sync()?;
        learning.networks.save(self.folder, &self.checkpoint_config(learning))?;
        let mut tensors = learning.update.state();
        tensors.insert(ROLLOUTS.into(), Tensor::from_slice(&[learning.replay.episodes().len() as i64]));
        state.write(learning.update.step(), &tensors)
    }

    fn checkpoint_config(&self, learning: &Learning<'_>) -> CheckpointConfig {
        let mut config = self.origin.config.clone();
        config.provenance.finetuned_on = Some(FinetunedOn {
            task: self.start.task.id.clone(),
            steps: learning.replay.steps(),
            updates: learning.update.step(),
        });
        config
    }
}
