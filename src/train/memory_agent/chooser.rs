//! Trains the chooser on examples: cloning of the demonstrator's first actions, and when goals are reached.

use std::path::Path;

use anyhow::ensure;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tch::{Device, Kind, Reduction, Tensor, nn};

use super::examples::{Example, ExampleSets, marks};
use crate::agent::memory_agent::features::{Choice, side_by_side};
use crate::algo::learner::{Learner, Optimisation};
use crate::nets::chooser::{Choices, Chooser};
use crate::nets::weights::Tensors;
use crate::train::metrics::Scalars;
use crate::train::stage::Learning;

/// How a chooser is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChooserTraining {
    /// Steps, batch size, learning rate and optimiser.
    pub(crate) optimisation: Optimisation,
    /// The most trajectories that are replayed, of each dataset as many.
    pub(crate) trajectories: usize,
    /// How much it counts to name what the demonstrator had set out to, beside going on as it did.
    pub(crate) aim_weight: f64,
}

impl ChooserTraining {
    /// Whether a chooser can be trained so. `name` is the section of the preset.
    ///
    /// # Errors
    /// Names the field that is out of its bounds.
    pub(crate) fn check(&self, name: &str) -> anyhow::Result<()> {
        let weight = self.aim_weight;
        ensure!(weight.is_finite() && weight >= 0.0, "{name}.aim_weight is {weight}, which is no weight");
        self.optimisation.check(&format!("{name}.optimisation"))
    }
}

/// A chooser under training.
pub(super) struct ChooserLearning<'a> {
    learner: Learner<'a>,
    chooser: &'a Chooser,
    training: &'a ChooserTraining,
    seed: u64,
    sets: &'a ExampleSets,
}

impl<'a> ChooserLearning<'a> {
    /// A chooser at step 0.
    ///
    /// # Errors
    /// When there are no examples.
    pub(super) fn new(
        (store, chooser): (&'a nn::VarStore, &'a Chooser),
        sets: &'a ExampleSets,
        training: &'a ChooserTraining,
        seed: u64,
    ) -> anyhow::Result<ChooserLearning<'a>> {
        ensure!(!sets.training.is_empty(), "there is nothing to learn from: every trajectory is held out");
        let learner = Learner::new(store, training.optimisation.clone(), seed);
        Ok(ChooserLearning { learner, chooser, training, seed, sets })
    }
}

impl<'a> Learning<'a> for ChooserLearning<'a> {
    fn learner(&self) -> &Learner<'a> {
        &self.learner
    }

    fn step(&mut self) -> anyhow::Result<Vec<(&'static str, Tensor)>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0xc0ce);
        rng.set_stream(self.learner.step() + 1);
        let (examples, count) = (&self.sets.training, self.training.optimisation.batch_size);
        let drawn: Vec<&Example> = (0..count).map(|_| &examples[rng.random_range(0..examples.len())]).collect();
        let batch = Batch::of(&drawn, self.chooser.device());
        self.learner.begin_step();
        let losses = batch.losses(self.chooser);
        self.learner.minimise(&(&losses.right + &losses.aim * self.training.aim_weight + &losses.reached));
        Ok(vec![("right_loss", losses.right), ("aim_loss", losses.aim), ("reached_loss", losses.reached)])
    }

    fn measure(&self, scalars: &mut Scalars) -> anyhow::Result<()> {
        measure(self.chooser, &self.sets.held_out, scalars);
        Ok(())
    }

    fn restore(&mut self, path: &Path, step: u64, tensors: Tensors) -> anyhow::Result<()> {
        self.learner.restore_checked(path, step, &tensors)
    }
}

/// Examples side by side.
struct Batch {
    choices: Choices,
    /// [n, actions]: 1 where a macro action begins rightly.
    right: Tensor,
    /// [n, actions]: 1 at what was set out to.
    aim: Tensor,
    /// `[n]`: 1 where the goal is reached.
    reached: Tensor,
}

struct Losses {
    right: Tensor,
    aim: Tensor,
    reached: Tensor,
}

impl Batch {
    fn of(examples: &[&Example], device: Device) -> Batch {
        let choices: Vec<&Choice> = examples.iter().map(|example| &example.choice).collect();
        let reached: Vec<f32> = examples.iter().map(|example| f32::from(u8::from(example.reached))).collect();
        Batch {
            choices: side_by_side(&choices, device),
            right: marks(examples, device, |example, column| example.right.get(column) == Some(&true)),
            aim: marks(examples, device, |example, column| example.aim == Some(column)),
            reached: Tensor::from_slice(&reached).to_device(device),
        }
    }

    /// The negative logarithms of what each marks, added up over the macro actions that are marked: a mean over the examples that
    /// mark any.
    fn unlikeliness(log_probabilities: &Tensor, marks: &Tensor) -> Tensor {
        let marked = marks.sum_dim_intlist(1, false, Kind::Float).gt(0.0).to_kind(Kind::Float);
        let kept = log_probabilities.masked_fill(&marks.eq(0.0), -1e9).logsumexp(1, false);
        -(kept.clamp_min(-30.0) * &marked).sum(Kind::Float) / marked.sum(Kind::Float).clamp_min(1.0)
    }

    fn losses(&self, chooser: &Chooser) -> Losses {
        let (log_probabilities, done) = chooser.forward(&self.choices);
        Losses {
            right: Batch::unlikeliness(&log_probabilities, &self.right),
            aim: Batch::unlikeliness(&log_probabilities, &self.aim),
            reached: done.binary_cross_entropy_with_logits(
                &self.reached,
                None::<&Tensor>,
                None::<&Tensor>,
                Reduction::Mean,
            ),
        }
    }
}

fn measure(chooser: &Chooser, held_out: &[Example], scalars: &mut Scalars) {
    let (mut right, mut of) = (0.0, 0.0);
    let [mut hits, mut said, mut reached] = [0.0f64; 3];
    let sum = |tensor: &Tensor| tensor.to_kind(Kind::Float).sum(Kind::Float).double_value(&[]);
    for examples in held_out.chunks(256) {
        let batch = Batch::of(&examples.iter().collect::<Vec<_>>(), chooser.device());
        let (log_probabilities, done) = tch::no_grad(|| chooser.forward(&batch.choices));
        let mass = (log_probabilities.exp() * &batch.right).sum_dim_intlist(1, false, Kind::Float);
        let marked = batch.right.sum_dim_intlist(1, false, Kind::Float).gt(0.0);
        right += sum(&mass.ge(0.5).logical_and(&marked));
        of += sum(&marked);
        let (done, is_reached) = (done.ge(0.0), batch.reached.gt(0.5));
        hits += sum(&done.logical_and(&is_reached));
        said += sum(&done);
        reached += sum(&is_reached);
    }
    scalars.set("held_out_right", right / of.max(1.0));
    scalars.set("held_out_end_precision", hits / said.max(1.0));
    scalars.set("held_out_end_recall", hits / reached.max(1.0));
}

#[cfg(test)]
mod tests {
    use super::super::examples::{examples, tests::demonstrations};
    use super::super::preset::MemoryPreset;
    use super::*;
    use crate::agent::memory_agent::eyes::Eyes;
    use crate::train::stage::testing::whole_and_in_parts;

    #[test]
    fn it_learns_a_few_demonstrations_and_a_resumed_training_is_the_same_training() {
        let _chance = crate::nets::testing::chance();
        let (_folder, frame_store) = demonstrations(6);
        let all: Vec<usize> = (0..frame_store.trajectories.len()).collect();
        let training: Vec<Example> =
            examples(&frame_store, &Eyes::Simulator, 1, &all).unwrap().into_iter().flatten().collect();
        let sets = ExampleSets { training, held_out: Vec::new() };
        let mut preset = MemoryPreset::named("sprint-memory").unwrap().unwrap();
        preset.chooser.hidden = vec![32];
        let learning = &mut preset.chooser_training.optimisation;
        (learning.steps, learning.batch_size, learning.schedule.warmup_steps) = (150, 24, 5);
        learning.schedule.learning_rate = 1e-2;
        let fresh = || {
            let store = nn::VarStore::new(Device::Cpu);
            let chooser = Chooser::new(&store.root(), &preset.chooser.spec());
            (store, chooser)
        };
        // Other tests open agents, whose networks begin by chance: a seed would not make two beginnings alike.
        let (beginning, _) = fresh();
        let logged = whole_and_in_parts(&|stage, logger| {
            let (mut store, chooser) = fresh();
            store.copy(&beginning).unwrap();
            let learning = ChooserLearning::new((&store, &chooser), &sets, &preset.chooser_training, stage.rhythm.seed);
            stage.run(&mut learning.unwrap(), logger).unwrap();
            store.variables().into_iter().collect()
        });
        let [first, last] = [0, 149].map(|step| logged[step]["right_loss"]);
        assert!(last < 0.6 * first, "{first} then {last}");
    }
}
