//! The trainer of every method: batches are gathered ahead, an update a batch, scalars reported, states and checkpoints saved.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use anyhow::Context;
use tch::{Kind, Tensor};

use super::batch_sampler::BatchSampler;
use super::metrics::{ProgressLogger, Scalars};
use super::preset::Preset;
use super::training_state::TrainingState;
use crate::agent::checkpoint::Networks;
use crate::algo::batch::{Batch, Transitions, network_input};
use crate::algo::bc;
use crate::algo::critic::CriticLearner;
use crate::algo::update::Update;
use crate::data::items::Span;
use crate::nets::precision::Precision;

/// Held-out items on which the policy is measured while it trains.
const MEASURED: usize = 2048;
/// Of those, how many are computed at once.
const CHUNK: usize = 256;
/// Batches that wait for their update.
const AHEAD: usize = 2;

/// A training's networks, hyper-parameters and state.
pub struct Trainer<'a> {
    /// Policy and critic, which learn; the visual encoder is frozen.
    pub networks: &'a Networks,
    /// The hyper-parameters.
    pub preset: &'a Preset,
    /// Where the optimisers' state is saved.
    pub state: TrainingState<'a>,
}

/// Keeps the networks of a saved step, and may add to what is reported of it.
pub(crate) type SaveCheckpoint<'a> = dyn FnMut(u64, &mut Scalars) -> anyhow::Result<()> + 'a;

impl Trainer<'_> {
    /// Trains up to the preset's last step, from where the state left off if it is there. `save_checkpoint` is called right before the
    /// state is saved: what could not be kept is taken again by the resumed training. Returns false when it was stopped; its
    /// state is saved then.
    ///
    /// # Errors
    /// When a state cannot be read or written, belongs to other data or encoders, or a loss is not a number.
    pub(crate) fn train(
        &self,
        batches: BatchSampler<'_>,
        held_out: &[Span],
        logger: &mut dyn ProgressLogger,
        stop: &AtomicBool,
        save_checkpoint: &mut SaveCheckpoint<'_>,
    ) -> anyhow::Result<bool> {
        let mut update = self.update()?;
        if let Some((step, tensors)) = self.state.read()? {
            update.restore(self.state.path, step, &tensors)?;
        }
        let measured = batches.held_out(held_out, MEASURED, CHUNK)?;
        let (first, steps) = (update.step(), self.preset.training.steps);
        let (sender, gathered) = mpsc::sync_channel(AHEAD);
        let parts = self.preset.parts;
        std::thread::scope(|scope| {
            // It ends with the last step, or when nobody waits for its batches any more.
            scope.spawn(move || {
                (first..steps).map(|step| batches.in_parts(step, parts)).all(|batch| sender.send(batch).is_ok());
            });
            let finished = self.steps(&mut update, &gathered, &measured, logger, stop, save_checkpoint);
            drop(gathered);
            finished
        })
    }

    fn steps(
        &self,
        update: &mut Update<'_>,
        gathered: &mpsc::Receiver<anyhow::Result<Vec<Batch>>>,
        measured: &[Transitions],
        logger: &mut dyn ProgressLogger,
        stop: &AtomicBool,
        save_checkpoint: &mut SaveCheckpoint<'_>,
    ) -> anyhow::Result<bool> {
        let (mut throughput, first) = (Throughput::new(), update.step());
        while !update.is_done() {
            if stop.load(Ordering::Relaxed) {
                save_checkpoint(update.step(), &mut Scalars::new("policy", update.step(), self.preset.training.steps))?;
                self.state.write(update.step(), &update.state())?;
                return Ok(false);
            }
            let begun = Instant::now();
            let batch = gathered.recv().context("the batches ended early")??;
            throughput.data_wait += begun.elapsed().as_secs_f64();
            let (step, last) = (update.step() + 1, update.step() + 1 == self.preset.training.steps);
            let due = |every: u64| step.is_multiple_of(every) || last;
            let mut scalars = Scalars::new("policy", step, self.preset.training.steps);
            let numbers = update.update_in_parts(&batch, due(self.preset.report_every))?;
            if due(self.preset.report_every) {
                scalars.values = numbers;
                throughput.describe(step - first, self.preset.training.batch_size, &mut scalars);
                scalars.set("learning_rate", self.preset.training.schedule.at(step - 1, self.preset.training.steps));
            }
            if due(self.preset.report_every * 5) {
                self.measure(measured, &mut scalars);
            }
            if due(self.preset.save_every) {
                save_checkpoint(step, &mut scalars)?;
                self.state.write(step, &update.state())?;
            }
            logger.log(&scalars)?;
        }
        Ok(true)
    }

    /// The update that every step is, at step 0.
    ///
    /// # Errors
    /// When the preset has a critic without IQL, or IQL without a critic.
    pub fn update(&self) -> anyhow::Result<Update<'_>> {
        let Preset { training, chaining, seed, precision, .. } = self.preset;
        let critic = match (&self.networks.critic, &self.preset.iql) {
            (Some(critics), Some(iql)) => Some(CriticLearner::new(
                (&critics.online, &critics.online_store),
                (&critics.target, &critics.target_store),
                training.clone(),
                iql.clone(),
                *seed,
            )),
            (None, None) => None,
            _ => anyhow::bail!("the preset has one of critic and iql: it needs both, or none"),
        };
        let policy = (&self.networks.policy, &self.networks.policy_store);
        Ok(Update::new(policy, critic, chaining.clone(), training.clone(), *seed).with_precision(*precision))
    }

    /// Loss and accuracy on held-out items: the same every time.
    fn measure(&self, measured: &[Transitions], scalars: &mut Scalars) {
        let mut sums = [0.0; 6];
        for items in measured {
            let observation = network_input(&items.observation, Precision::Full);
            let (logits, nll) = tch::no_grad(|| {
                let logits = self.networks.policy.forward_shared(&observation.into(), &items.conditioning, false);
                let nll = bc::neg_log_likelihood(&logits, &items.actions, &items.objects);
                (logits, nll)
            });
            let (actions, objects) = bc::accuracy(&logits, &items.actions, &items.objects);
            let sum = |tensor: &Tensor| tensor.sum(Kind::Double).double_value(&[]);
            let (count, with_object) = (items.actions.size()[0] as f64, sum(&bc::object_mask(&items.objects)));
            let found =
                [count, sum(&nll.action), actions * count, with_object, sum(&nll.object), objects * with_object];
            sums.iter_mut().zip(found).for_each(|(sum, value)| *sum += value);
        }
        for (head, [count, loss, right]) in
            [("action", [sums[0], sums[1], sums[2]]), ("object", [sums[3], sums[4], sums[5]])]
        {
            if count > 0.0 {
                scalars.set(&format!("held_out_{head}_loss"), loss / count);
                scalars.set(&format!("held_out_{head}_accuracy"), right / count);
            }
        }
    }
}

/// Items a second since the training began or was resumed, and how long it waited for them.
struct Throughput {
    begun: Instant,
    data_wait: f64,
}

impl Throughput {
    fn new() -> Throughput {
        Throughput { begun: Instant::now(), data_wait: 0.0 }
    }

    /// After so many steps: base items a second, and the share of the time in which a batch was waited for.
    fn describe(&self, steps: u64, batch: usize, scalars: &mut Scalars) {
        let elapsed = self.begun.elapsed().as_secs_f64().max(1e-9);
        scalars.set("samples_per_second", steps as f64 * batch as f64 / elapsed);
        scalars.set("data_wait_fraction", self.data_wait / elapsed);
    }
}

#[cfg(test)]
mod tests {
    use tch::Device;

    use super::*;
    use crate::algo::chain::PairSource;
    use crate::data::features::{FeatureHeader, FeatureWriter, Features};
    use crate::data::items::{ActionLabel, Items};
    use crate::data::selection::{HistoryStart, ObjectTarget};
    use crate::nets::critic::CriticSpec;
    use crate::nets::episodic::AttentionSpec;
    use crate::nets::policy::PolicySpec;
    use crate::nets::visual_encoder::VisualEncoder;
    use crate::nets::weights;
    use crate::train::chaining_pool::ChainingPool;
    use crate::train::embedding_table::EmbeddingTable;
    use crate::train::training_data::{ConditioningTable, FeatureMaps, TrainingData};

    const FRAMES: u64 = 24;

    fn preset(name: &str, steps: u64) -> Preset {
        let mut preset = Preset::named(name).unwrap();
        let goal = preset.policy.goal_channels.map(|_| [2; 4]);
        let small = |_| AttentionSpec { vocabulary_size: 10, layers: 1, heads: 1, feedforward: 4 };
        let attention = preset.policy.attention.map(small);
        let embedding = if attention.is_some() { 4 } else { 3 };
        let channels = [4; 4];
        preset.policy = PolicySpec {
            history: 2,
            embedding,
            channels,
            downsample: false,
            hidden: vec![32],
            dropout: 0.1,
            goal_channels: goal,
            attention,
        };
        preset.critic = preset.critic.map(|critic| CriticSpec { channels: [4; 4], hidden: vec![16], ..critic });
        if let Some(chaining) = &mut preset.chaining {
            chaining.batch_size = 8;
            if chaining.pairs != PairSource::InBatch {
                chaining.pairs = PairSource::Pool(5);
            }
        }
        preset.visual_encoder.channels = vec![2; 4];
        (preset.training.steps, preset.training.batch_size) = (steps, 16);
        (preset.training.schedule.warmup_steps, preset.training.schedule.learning_rate) = (2, 0.01);
        (preset.save_every, preset.report_every) = (1000, 1000);
        preset
    }

    /// Frames of noise, each with an action of its own; half of them with an object.
    fn features(preset: &Preset) -> Features {
        let folder = tempfile::tempdir().unwrap();
        let numbers = preset.visual_encoder.map() as u64;
        let header =
            FeatureHeader { format_version: 1, encoder: "e".into(), dataset: "d".into(), maps: FRAMES, numbers };
        tch::manual_seed(4);
        let maps = Tensor::rand([FRAMES as i64, numbers as i64], (Kind::Half, Device::Cpu));
        let mut bytes = vec![0; maps.numel() * 2];
        maps.copy_data_u8(&mut bytes, maps.numel());
        let mut writer = FeatureWriter::open(folder.path(), header.clone()).unwrap();
        writer.add(&bytes).unwrap();
        writer.finish().unwrap();
        Features::read(folder.path(), &header).unwrap().unwrap()
    }

    fn items() -> Items {
        let label = |frame: u64| ActionLabel {
            action: (frame % 12) as u8,
            object: (frame % 2 * (frame % 12)) as u8,
            executed: !frame.is_multiple_of(5),
        };
        let span = |text, first: u32| Span { trajectory: 0, skills: 0..1, first, start: first, end: first + 5, text };
        Items {
            labels: (0..FRAMES).map(|frame| Some(label(frame))).collect(),
            texts: vec!["one".into(), "two".into()],
            training: (0..8).map(|i| span(i % 2, i / 2 * 6)).collect(),
            held_out: vec![span(0, 0), span(1, 0)],
            firsts: vec![0, 6, 12, 18, FRAMES as u32],
            withheld: Default::default(),
            history_start: HistoryStart::Trajectory,
            object_target: ObjectTarget::Current,
        }
    }

    /// Notes the last numbers, and pulls the brake after a step.
    struct Watch<'a> {
        stop: &'a AtomicBool,
        stop_after: u64,
        last: Scalars,
    }

    impl ProgressLogger for Watch<'_> {
        fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
            self.last = scalars.clone();
            self.stop.store(scalars.step == self.stop_after, Ordering::Relaxed);
            Ok(())
        }
    }

    /// Embeds a text by its length.
    fn embed(texts: &[&str]) -> anyhow::Result<Tensor> {
        let rows: Vec<f32> = texts.iter().flat_map(|text| [0.0, 0.0, text.len() as f32 / 10.0]).collect();
        Ok(Tensor::from_slice(&rows).view([-1, 3]))
    }

    /// What says that a checkpoint could not be kept.
    const FULL: &str = "no space left";

    /// Trains, stopping once and going on when `stop_after` says so; the final state and numbers.
    fn trained(preset: &Preset, stop_after: u64) -> (weights::Tensors, Scalars) {
        trained_keeping(preset, stop_after, &mut |_| Ok(()))
    }

    /// The same with what keeps checkpoints; goes on after it was [`FULL`], too.
    fn trained_keeping(
        preset: &Preset,
        stop_after: u64,
        save_checkpoint: &mut dyn FnMut(u64) -> anyhow::Result<()>,
    ) -> (weights::Tensors, Scalars) {
        let (features, items) = (features(preset), Items { object_target: preset.data.object_target, ..items() });
        let sentences = Tensor::from_slice2(&[[1.0f32, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state.safetensors");
        let stop = AtomicBool::new(false);
        let identity = [("dataset".to_string(), "d".to_string())].into();
        loop {
            tch::manual_seed(1);
            let networks = {
                let encoder = VisualEncoder::house(&preset.visual_encoder, Device::Cpu);
                Networks::new(encoder, &preset.policy, preset.critic.as_ref(), Device::Cpu)
            };
            let conditioning = match preset.policy.goal_channels {
                Some(_) => ConditioningTable::Goals,
                None if preset.policy.attention.is_some() => ConditioningTable::TokenIds(vec![vec![2, 3], vec![4]]),
                None => ConditioningTable::SentenceEmbeddings(EmbeddingTable::new(&sentences, Device::Cpu).unwrap()),
            };
            let pool = preset.chaining.as_ref().and_then(|chaining| match chaining.pairs {
                PairSource::InBatch => None,
                PairSource::Pool(count) => {
                    let pairs = ChainingPool::draw(&items, preset.seed, count, None);
                    let texts: Vec<String> = pairs.iter().map(|&pair| ChainingPool::joint_text(&items, pair)).collect();
                    let joint = embed(&texts.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
                    Some(ChainingPool::new(&items, pairs, &joint, Device::Cpu).unwrap())
                }
            });
            let data = TrainingData {
                items: &items,
                feature_maps: FeatureMaps::on(&features, Device::Cpu),
                conditioning,
                pool,
                embed: &embed,
            };
            let (with_next, size) = (networks.critic.is_some(), (preset.seed, preset.training.batch_size));
            let batches = BatchSampler::new(data, 2, with_next, preset.chaining.as_ref(), size, Device::Cpu);
            let trainer =
                Trainer { networks: &networks, preset, state: TrainingState { path: &state, identity: &identity } };
            let mut watch = Watch { stop: &stop, stop_after, last: Scalars::new("", 0, 0) };
            stop.store(false, Ordering::Relaxed);
            let mut save_checkpoint = |step, _: &mut Scalars| save_checkpoint(step);
            match trainer.train(batches, &items.held_out, &mut watch, &stop, &mut save_checkpoint) {
                Ok(true) => return (weights::read(&state).unwrap(), watch.last),
                Ok(false) => (),
                Err(error) => assert_eq!(error.to_string(), FULL),
            }
        }
    }

    #[test]
    fn a_few_frames_are_learned_by_heart() {
        let _chance = crate::nets::testing::chance();
        let (_, last) = trained(&preset("l-bc", 250), u64::MAX);
        assert!(last.values["held_out_action_accuracy"] > 0.95, "{last:?}");
        assert!(last.values["held_out_object_accuracy"] > 0.95, "{last:?}");
    }

    #[test]
    fn the_object_head_is_taught_what_the_preset_says() {
        let _chance = crate::nets::testing::chance();
        let losses = [ObjectTarget::Current, ObjectTarget::Next].map(|target| {
            let mut preset = preset("l-bc", 1);
            preset.data.object_target = target;
            trained(&preset, u64::MAX).1.values
        });
        assert_eq!(losses[0]["action_loss"], losses[1]["action_loss"]);
        assert!(losses[0]["object_loss"] != losses[1]["object_loss"], "{losses:?}");
    }

    #[test]
    fn mixed_precision_learns_nearly_the_same_and_keeps_32_bits() {
        let _chance = crate::nets::testing::chance();
        for name in ["sprint", "am", "l-bc-transformer"] {
            // What is dropped by chance differs with the width of what it is dropped from.
            let mut preset = preset(name, 1);
            preset.policy.dropout = 0.0;
            preset.critic = preset.critic.map(|critic| CriticSpec { dropout: 0.0, ..critic });
            let of = |precision| trained(&Preset { precision, ..preset.clone() }, u64::MAX);
            let ((_, full), (state, mixed)) = (of(Precision::Full), of(Precision::Mixed));
            assert!(
                state.values().all(|tensor| tensor.kind() == Kind::Float || tensor.kind() == Kind::Int64),
                "{name}"
            );
            assert!(full.values["action_loss"] != mixed.values["action_loss"], "{name}");
            for loss in ["action_loss", "object_loss", "held_out_action_loss", "q_loss"] {
                let Some((full, mixed)) = full.values.get(loss).zip(mixed.values.get(loss)) else { continue };
                assert!((full - mixed).abs() < 0.03 * full.abs().max(0.1), "{name}: {loss} is {full} and {mixed}");
            }
        }
    }

    #[test]
    fn a_training_that_was_stopped_and_resumed_equals_the_uninterrupted_one_to_the_bit() {
        let _chance = crate::nets::testing::chance();
        let full = ["l-bc", "sprint", "am", "l-bc-transformer"].map(|name| preset(name, 8));
        let mixed = Preset { precision: Precision::Mixed, ..preset("l-bc", 8) };
        for preset in full.into_iter().chain([mixed]) {
            let name = preset.name.as_str();
            let (whole, resumed) = (trained(&preset, u64::MAX).0, trained(&preset, 3).0);
            assert_eq!(whole.len(), resumed.len());
            assert_eq!(whole.keys().any(|key| key.starts_with("critic.square.")), preset.critic.is_some());
            for (tensor, other) in &whole {
                assert_eq!(*other, resumed[tensor], "{name}: {tensor}");
            }
        }
    }

    #[test]
    fn a_checkpoint_that_could_not_be_kept_is_kept_by_the_resumed_training() {
        let _chance = crate::nets::testing::chance();
        let preset = Preset { save_every: 4, ..preset("l-bc", 8) };
        let mut kept = Vec::new();
        let (state, _) = trained_keeping(&preset, u64::MAX, &mut |step| {
            kept.push(step);
            anyhow::ensure!(kept.len() != 2, FULL);
            Ok(())
        });
        assert_eq!(kept, [4, 8, 8]);
        assert_eq!(state, trained(&preset, u64::MAX).0);
    }

    #[test]
    fn every_method_reports_what_it_is_made_of() {
        let _chance = crate::nets::testing::chance();
        for (name, present, absent) in [
            ("l-bc", "held_out_action_loss", "q_loss"),
            ("iql-primitive", "v_mean", "chain_q_loss"),
            ("sprint", "aggregate_b_q_loss", "none"),
            ("am", "chain_q_loss", "aggregate_a_q_loss"),
            ("l-bc-transformer", "action_loss", "q_loss"),
        ] {
            let (_, last) = trained(&preset(name, 2), u64::MAX);
            assert!(last.values.contains_key(present) && !last.values.contains_key(absent), "{name}: {last:?}");
        }
    }

    #[test]
    fn pairs_are_embedded_live_when_they_come_from_the_batch() {
        let _chance = crate::nets::testing::chance();
        let mut preset = preset("sprint", 2);
        preset.chaining.as_mut().unwrap().pairs = PairSource::InBatch;
        assert!(trained(&preset, u64::MAX).1.values["aggregate_a_q_loss"].is_finite());
    }
}
