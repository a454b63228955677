//! Trains the critic on examples by implicit Q-learning: the reward is 1 where the goal is reached, and what was done may be
//! anybody's, good or bad.

use std::path::Path;

use anyhow::ensure;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tch::{Device, Kind, Tensor, nn};

use super::examples::{Example, ExampleSets, marks};
use crate::agent::memory_agent::features::{Choice, side_by_side};
use crate::algo::iql::{PolyakTarget, q_loss, q_target, value_loss};
use crate::algo::learner::{Learner, Optimisation};
use crate::nets::chooser::Choices;
use crate::nets::macro_critic::MacroCritic;
use crate::nets::weights::{self, Tensors};
use crate::train::metrics::Scalars;
use crate::train::stage::Learning;

/// How a critic is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CriticTraining {
    /// Steps, batch size, learning rate and optimiser.
    pub(crate) optimisation: Optimisation,
    /// What a step costs: the reward is worth so much less for each.
    pub(crate) discount: f64,
    /// Which expectile of Q over what was done V is.
    pub(crate) expectile: f64,
    /// The share by which the target Q follows Q after each step.
    pub(crate) target_update_rate: f64,
}

impl CriticTraining {
    /// Whether a critic can be trained so. `name` is the section of the preset.
    ///
    /// # Errors
    /// Names the field that is out of its bounds.
    pub(crate) fn check(&self, name: &str) -> anyhow::Result<()> {
        let CriticTraining { discount, expectile, target_update_rate: rate, .. } = *self;
        for (field, share) in [("discount", discount), ("target_update_rate", rate)] {
            ensure!((0.0..=1.0).contains(&share), "{name}.{field} is {share}, which is not a share");
        }
        ensure!(0.0 < expectile && expectile < 1.0, "{name}.expectile is {expectile}, not between 0 and 1");
        self.optimisation.check(&format!("{name}.optimisation"))
    }
}

/// A critic under training, with the target that follows it.
pub(super) struct CriticLearning<'a> {
    learner: Learner<'a>,
    critic: &'a MacroCritic,
    target_store: &'a nn::VarStore,
    target: &'a MacroCritic,
    polyak: PolyakTarget,
    training: &'a CriticTraining,
    seed: u64,
    sets: &'a ExampleSets,
    known: Known,
}

impl<'a> CriticLearning<'a> {
    /// A critic at step 0; the target begins as its copy.
    ///
    /// # Errors
    /// When it is known of no step what came of it.
    pub(super) fn new(
        (store, critic): (&'a nn::VarStore, &'a MacroCritic),
        (target_store, target): (&'a nn::VarStore, &'a MacroCritic),
        sets: &'a ExampleSets,
        training: &'a CriticTraining,
        seed: u64,
    ) -> anyhow::Result<CriticLearning<'a>> {
        let learner = Learner::new(store, training.optimisation.clone(), seed);
        let mut polyak = PolyakTarget::new(store, target_store);
        polyak.update(1.0);
        let known = Known::of(&sets.training);
        ensure!(!known.transitions.is_empty(), "there is nothing to learn values from: no step is followed by another");
        Ok(CriticLearning { learner, critic, target_store, target, polyak, training, seed, sets, known })
    }
}

impl<'a> Learning<'a> for CriticLearning<'a> {
    fn learner(&self) -> &Learner<'a> {
        &self.learner
    }

    fn step(&mut self) -> anyhow::Result<Vec<(&'static str, Tensor)>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0xc417);
        rng.set_stream(self.learner.step() + 1);
        let count = self.training.optimisation.batch_size;
        let batch = self.known.draw(&self.sets.training, count, &mut rng, self.target_store.device());
        self.learner.begin_step();
        let [of_value, of_q] = batch.losses(self.critic, self.target, self.training);
        self.learner.minimise(&(&of_value + &of_q));
        self.polyak.update(self.training.target_update_rate);
        Ok(vec![("value_loss", of_value), ("q_loss", of_q)])
    }

    fn measure(&self, scalars: &mut Scalars) -> anyhow::Result<()> {
        measure(self.critic, self.target_store.device(), &self.sets.held_out, self.training.discount, scalars)
    }

    fn state(&self) -> Tensors {
        let mut tensors = self.learner.state();
        tensors.extend(weights::prefixed(TARGET, self.target_store.variables().into_iter().collect()));
        tensors
    }

    fn restore(&mut self, path: &Path, step: u64, tensors: Tensors) -> anyhow::Result<()> {
        let (of_target, own): (Tensors, Tensors) = tensors.into_iter().partition(|(name, _)| name.starts_with(TARGET));
        self.learner.restore_checked(path, step, &own)?;
        weights::copy(&of_target, TARGET, self.target_store)
    }
}

/// The prefix of the target's tensors in a state.
const TARGET: &str = "target.";

/// One state in that many of a batch is one in which the goal is reached.
const REACHED_SHARE: usize = 16;

/// Where in a set of examples something is known of values.
struct Known {
    /// Examples in which something was done whose outcome is the next example.
    transitions: Vec<usize>,
    /// Examples in which the goal is reached.
    reached: Vec<usize>,
}

impl Known {
    fn of(examples: &[Example]) -> Known {
        let which = |holds: &dyn Fn(usize, &Example) -> bool| -> Vec<usize> {
            examples.iter().enumerate().filter(|(at, example)| holds(*at, example)).map(|(at, _)| at).collect()
        };
        Known {
            transitions: which(&|at, example| example.taken.contains(&true) && at + 1 < examples.len()),
            reached: which(&|_, example| example.reached),
        }
    }

    fn draw(&self, examples: &[Example], count: usize, rng: &mut impl Rng, device: Device) -> Batch {
        let mut some = |of: &[usize], count: usize| -> Vec<usize> {
            (0..count).filter_map(|_| of.get(rng.random_range(0..of.len().max(1))).copied()).collect()
        };
        let (transitions, reached) =
            (some(&self.transitions, count), some(&self.reached, count.div_ceil(REACHED_SHARE)));
        Batch::of(examples, &transitions, &reached, device)
    }
}

/// Transitions side by side, and states in which goals are reached.
struct Batch {
    here: Choices,
    /// [n, actions]: 1 at macro actions that begin with what was done.
    taken: Tensor,
    /// `[n]`: 1 where the goal is reached by it.
    reward: Tensor,
    next: Choices,
    reached: Option<Choices>,
}

impl Batch {
    fn of(examples: &[Example], transitions: &[usize], reached: &[usize], device: Device) -> Batch {
        let choices = |at: &mut dyn Iterator<Item = usize>| {
            let choices: Vec<&Choice> = at.map(|at| &examples[at].choice).collect();
            side_by_side(&choices, device)
        };
        let here: Vec<&Example> = transitions.iter().map(|&at| &examples[at]).collect();
        let reward: Vec<f32> = transitions.iter().map(|&at| f32::from(u8::from(examples[at + 1].reached))).collect();
        Batch {
            here: choices(&mut transitions.iter().copied()),
            taken: marks(&here, device, |example, column| example.taken.get(column) == Some(&true)),
            reward: Tensor::from_slice(&reward).to_device(device),
            next: choices(&mut transitions.iter().map(|at| at + 1)),
            reached: (!reached.is_empty()).then(|| choices(&mut reached.iter().copied())),
        }
    }

    /// The losses of V and of both Q. All macro actions that begin with what was done have led to what came of it; V of a reached
    /// goal is 1.
    fn losses(&self, critic: &MacroCritic, target: &MacroCritic, training: &CriticTraining) -> [Tensor; 2] {
        let share = &self.taken / self.taken.sum_dim_intlist(1, true, Kind::Float);
        let mean = |of_each: &Tensor| (of_each * &share).sum(Kind::Float) / self.taken.size()[0];
        let (target_q, next_value) = tch::no_grad(|| (target.q(&self.here), critic.value(&self.next)));
        let value = critic.value(&self.here).unsqueeze(1);
        let mut of_value = mean(&value_loss(&value, &target_q, training.expectile));
        if let Some(reached) = &self.reached {
            of_value += (critic.value(reached) - 1.0).square().mean(Kind::Float) / REACHED_SHARE as f64;
        }
        let wanted = q_target(&self.reward, &self.reward, &next_value, training.discount).unsqueeze(1);
        let [first, second] = critic.twin_q(&self.here);
        [of_value, mean(&q_loss(&first, &wanted)) + mean(&q_loss(&second, &wanted))]
    }
}

/// How far V is from what was won in held-out episodes, discounted by the steps until then, and how it goes with that.
fn measure(
    critic: &MacroCritic,
    device: Device,
    held_out: &[Example],
    discount: f64,
    scalars: &mut Scalars,
) -> anyhow::Result<()> {
    let mut won = vec![None; held_out.len()];
    for at in (0..held_out.len().saturating_sub(1)).rev().filter(|&at| held_out[at].taken.contains(&true)) {
        won[at] = if held_out[at + 1].reached { Some(1.0) } else { won[at + 1].map(|next: f64| next * discount) };
    }
    let known: Vec<(&Choice, f64)> =
        held_out.iter().zip(won).filter_map(|(example, won)| Some((&example.choice, won?))).collect();
    let mut pairs: Vec<[f64; 2]> = Vec::new();
    for known in known.chunks(256) {
        let choices: Vec<&Choice> = known.iter().map(|(choice, _)| *choice).collect();
        let value = tch::no_grad(|| critic.value(&side_by_side(&choices, device)));
        let value = Vec::<f32>::try_from(value.to_device(Device::Cpu))?;
        pairs.extend(value.iter().zip(known).map(|(&value, (_, won))| [f64::from(value), *won]));
    }
    let count = pairs.len().max(1) as f64;
    let mean = |of: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let means = [0, 1].map(|side| mean(&|pair| pair[side]));
    let moment = |a: usize, b: usize| mean(&|pair| (pair[a] - means[a]) * (pair[b] - means[b]));
    let spread = (moment(0, 0) * moment(1, 1)).sqrt();
    scalars.set("held_out_value_error", mean(&|[value, won]| (value - won).abs()));
    scalars.set("held_out_value_bias", means[0] - means[1]);
    scalars.set("held_out_value_correlation", if spread > 0.0 { moment(0, 1) / spread } else { 0.0 });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::examples::{examples, tests::demonstrations};
    use super::super::preset::MemoryPreset;
    use super::*;
    use crate::agent::memory_agent::eyes::Eyes;
    use crate::train::stage::testing::whole_and_in_parts;

    #[test]
    fn values_grow_towards_the_goal_and_a_resumed_training_is_the_same_training() {
        let _chance = crate::nets::testing::chance();
        let (_folder, frame_store) = demonstrations(8);
        let all: Vec<usize> = (0..frame_store.trajectories.len()).collect();
        let made = || examples(&frame_store, &Eyes::Simulator, 1, &all).unwrap().into_iter().flatten().collect();
        let sets = ExampleSets { training: made(), held_out: made() };
        let mut preset = MemoryPreset::named("sprint-memory").unwrap().unwrap();
        preset.critic.hidden = vec![32];
        (preset.critic_training.expectile, preset.critic_training.target_update_rate) = (0.7, 0.2);
        let learning = &mut preset.critic_training.optimisation;
        (learning.steps, learning.batch_size, learning.schedule.warmup_steps) = (300, 24, 5);
        learning.schedule.learning_rate = 1e-2;
        let fresh = || {
            let store = nn::VarStore::new(Device::Cpu);
            let critic = MacroCritic::new(&store.root(), &preset.critic.spec());
            (store, critic)
        };
        let (beginning, _) = fresh();
        let logged = whole_and_in_parts(&|stage, logger| {
            let ((mut store, critic), (target_store, target)) = (fresh(), fresh());
            store.copy(&beginning).unwrap();
            let (online, target) = ((&store, &critic), (&target_store, &target));
            let learning = CriticLearning::new(online, target, &sets, &preset.critic_training, stage.rhythm.seed);
            stage.run(&mut learning.unwrap(), logger).unwrap();
            store.variables().into_iter().collect()
        });
        let last = logged.last().unwrap();
        assert!(last["held_out_value_correlation"] > 0.3, "{last:?}");
        assert!(last["held_out_value_error"] < 0.25, "{last:?}");
    }

    #[test]
    fn what_a_step_led_to_is_the_example_after_it() {
        let _chance = crate::nets::testing::chance();
        let (_folder, frame_store) = demonstrations(4);
        let all: Vec<usize> = (0..frame_store.trajectories.len()).collect();
        let mut goals = 0;
        for examples in examples(&frame_store, &Eyes::Simulator, 1, &all).unwrap() {
            let known = Known::of(&examples);
            assert_eq!(
                known.transitions.last().map(|at| at + 2),
                Some(examples.len()),
                "the last step reaches the goal"
            );
            let rewarded = known.transitions.iter().filter(|&&at| examples[at + 1].reached);
            let (rewarded, all) = (rewarded.count(), known.reached.len());
            assert_eq!(rewarded, all);
            goals += rewarded;
            let batch = Batch::of(&examples, &known.transitions, &known.reached, Device::Cpu);
            assert_eq!(batch.reward.sum(Kind::Float).double_value(&[]), all as f64);
        }
        assert!(goals >= 4);
    }
}
