//! Trains the chooser on examples: cloning of the demonstrator's first actions, and when goals are reached.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::ensure;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tch::{Device, Kind, Reduction, Tensor, nn};

use super::examples::{Example, ExampleSets, marks};
use crate::agent::memory_agent::features::{Choice, side_by_side};
use crate::algo::learner::{Learner, Optimisation};
use crate::nets::chooser::{Choices, Chooser};
use crate::train::detection::Rhythm;
use crate::train::metrics::{ProgressLogger, Scalars};
use crate::train::training_state::TrainingState;

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

/// Trains a chooser up to the last step, from where `state` left off if it is there; `save` keeps a checkpoint. Returns false when
/// it was stopped; its state is saved then.
///
/// # Errors
/// When a state or a checkpoint cannot be read or written.
pub(crate) fn train(
    (store, chooser): (&nn::VarStore, &Chooser),
    sets: &ExampleSets,
    (training, rhythm): (&ChooserTraining, Rhythm),
    state: TrainingState<'_>,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
    save: &dyn Fn(u64) -> anyhow::Result<()>,
) -> anyhow::Result<bool> {
    let mut learner = Learner::new(store, training.optimisation.clone(), rhythm.seed);
    if let Some((step, tensors)) = state.read()? {
        learner.restore_checked(state.path, step, &tensors)?;
    }
    ensure!(!sets.training.is_empty(), "there is nothing to learn from: every trajectory is held out");
    while !learner.is_done() {
        if stop.load(Ordering::Relaxed) {
            state.write(learner.step(), &learner.state())?;
            return Ok(false);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(rhythm.seed ^ 0xc0ce);
        rng.set_stream(learner.step() + 1);
        let count = sets.training.len();
        let drawn = (0..training.optimisation.batch_size).map(|_| &sets.training[rng.random_range(0..count)]);
        let batch = Batch::of(&drawn.collect::<Vec<_>>(), chooser.device());
        learner.begin_step();
        let losses = batch.losses(chooser);
        learner.minimise(&(&losses.right + &losses.aim * training.aim_weight + &losses.reached));
        let mut scalars = Scalars::new("chooser", learner.step(), training.optimisation.steps);
        if learner.step().is_multiple_of(rhythm.report_every) || learner.is_done() {
            scalars.add("right_loss", &losses.right);
            scalars.add("aim_loss", &losses.aim);
            scalars.add("reached_loss", &losses.reached);
        }
        if learner.step().is_multiple_of(rhythm.report_every * 10) || learner.is_done() {
            measure(chooser, &sets.held_out, &mut scalars);
        }
        logger.log(&scalars)?;
        if learner.step().is_multiple_of(rhythm.save_every) || learner.is_done() {
            state.write(learner.step(), &learner.state())?;
            save(learner.step())?;
        }
    }
    Ok(true)
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
    use std::collections::BTreeMap;

    use super::super::examples::{examples, tests::demonstrations};
    use super::super::preset::MemoryPreset;
    use super::*;
    use crate::agent::memory_agent::eyes::Eyes;
    use crate::train::visual::testing::RecordedScalars;

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
        let rhythm = Rhythm { seed: 1, hold_out: 0, save_every: 50, report_every: 1 };
        let folder = tempfile::tempdir().unwrap();
        let fresh = || {
            let store = nn::VarStore::new(Device::Cpu);
            let chooser = Chooser::new(&store.root(), &preset.chooser.spec());
            (store, chooser)
        };
        // Other tests open agents, whose networks begin by chance: a seed would not make two beginnings alike.
        let (beginning, _) = fresh();
        let run = |name: &str, stop_at: Option<u64>| {
            let (mut store, chooser) = fresh();
            store.copy(&beginning).unwrap();
            let path = folder.path().join(name);
            let state = TrainingState { path: &path, identity: &BTreeMap::new() };
            let mut recorded = RecordedScalars(Vec::new());
            let stop = AtomicBool::new(false);
            let save = |step: u64| {
                stop.store(Some(step) == stop_at, Ordering::Relaxed);
                Ok(())
            };
            let how = (&preset.chooser_training, rhythm);
            train((&store, &chooser), &sets, how, state, &mut recorded, &stop, &save).unwrap();
            let losses: Vec<f64> = recorded.0.iter().map(|scalars| scalars.values["right_loss"]).collect();
            let weights = store.variables().into_iter().collect::<BTreeMap<_, _>>();
            (losses, weights)
        };
        let (losses, whole) = run("whole", None);
        assert!(losses[149] < 0.6 * losses[0], "{} then {}", losses[0], losses[149]);
        assert_eq!(run("parts", Some(50)).0.len(), 50);
        let (_, resumed) = run("parts", None);
        assert!(whole.iter().all(|(name, tensor)| *tensor == resumed[name]));
    }
}
