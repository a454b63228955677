//! Behaviour cloning over stored feature maps.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use tch::{Device, Kind, Tensor, nn};

use super::presets::Preset;
use super::progress::{Report, Scalars};
use crate::algo::bc;
use crate::algo::learner::Learner;
use crate::data::features::Features;
use crate::data::items::{Item, Items, Span};
use crate::nets::policy::PolicyNet;
use crate::nets::visual::SIDE;

/// Held-out items on which the policy is measured while it trains.
const MEASURED: usize = 2048;
/// Of those, how many are computed at once.
const CHUNK: usize = 256;

/// Everything that items are made of.
pub struct Material<'a> {
    /// Spans and labels.
    pub items: &'a Items,
    /// A map a frame.
    pub features: &'a Features,
    /// [texts, width], a row a text.
    pub sentences: &'a Tensor,
}

struct Batch {
    observation: Tensor,
    sentence: Tensor,
    actions: Tensor,
    objects: Tensor,
}

impl Material<'_> {
    fn batch(&self, items: &[Item], history: i64, device: Device) -> anyhow::Result<Batch> {
        let n = items.len() as i64;
        let mut bytes = Vec::new();
        let (mut actions, mut objects) = (Vec::new(), Vec::new());
        for item in items {
            self.features.gather_all(item.stack(history as u32), &mut bytes)?;
            let label = self.items.labels.get(item.frame as usize).copied().flatten();
            let label = label.ok_or_else(|| anyhow::anyhow!("frame {} has no label", item.frame))?;
            actions.push(i64::from(label.action));
            objects.push(i64::from(label.object));
        }
        let channels = bytes.len() as i64 / (2 * n.max(1) * SIDE * SIDE);
        let rows: Vec<i64> = items.iter().map(|item| i64::from(item.text)).collect();
        Ok(Batch {
            observation: Tensor::f_from_data_size(&bytes, &[n, channels, SIDE, SIDE], Kind::Half)?
                .to_device(device)
                .to_kind(Kind::Float),
            sentence: self.sentences.index_select(0, &Tensor::from_slice(&rows)).to_device(device),
            actions: Tensor::from_slice(&actions).to_device(device),
            objects: Tensor::from_slice(&objects).to_device(device),
        })
    }
}

/// Trains a policy up to the preset's last step, from where `state` left off if it is there. `save` is called whenever the state
/// is saved. Returns false when it was stopped; its state is saved then.
///
/// # Errors
/// When a state cannot be read or written.
pub fn train(
    (store, policy): (&nn::VarStore, &PolicyNet),
    material: &Material<'_>,
    preset: &Preset,
    state: &Path,
    report: &mut dyn Report,
    stop: &AtomicBool,
    save: &mut dyn FnMut(u64) -> anyhow::Result<()>,
) -> anyhow::Result<bool> {
    let (history, device) = (policy.spec().history, store.device());
    let mut learner = Learner::new(store, preset.training.clone(), preset.seed);
    if state.is_file() {
        learner.resume(state)?;
    }
    anyhow::ensure!(!material.items.training.is_empty(), "there is nothing to learn from: no span has a text");
    while !learner.is_done() {
        if stop.load(Ordering::Relaxed) {
            learner.save(state)?;
            save(learner.step())?;
            return Ok(false);
        }
        let drawn = Items::draw(&material.items.training, preset.seed, learner.step(), preset.training.batch);
        let batch = material.batch(&drawn, history, device)?;
        learner.begin_step();
        let logits = policy.forward(&batch.observation, &batch.sentence, true);
        let loss = bc::loss(&logits, &batch.actions, &batch.objects);
        learner.minimise(&loss.total());
        let mut scalars = Scalars::new("policy", learner.step(), preset.training.steps);
        if learner.step().is_multiple_of(preset.report_every) || learner.is_done() {
            scalars.add("action_loss", &loss.action);
            scalars.add("object_loss", &loss.object);
            let (actions, objects) = bc::accuracy(&logits, &batch.actions, &batch.objects);
            scalars.set("action_accuracy", actions);
            scalars.set("object_accuracy", objects);
        }
        if learner.step().is_multiple_of(preset.report_every * 5) || learner.is_done() {
            measure(policy, material, &material.items.held_out, preset, device, &mut scalars)?;
        }
        report.step(&scalars)?;
        if learner.step().is_multiple_of(preset.save_every) || learner.is_done() {
            learner.save(state)?;
            save(learner.step())?;
        }
    }
    Ok(true)
}

/// Loss and accuracy on held-out spans: the same items every time.
fn measure(
    policy: &PolicyNet,
    material: &Material<'_>,
    spans: &[Span],
    preset: &Preset,
    device: Device,
    scalars: &mut Scalars,
) -> anyhow::Result<()> {
    let drawn = Items::draw(spans, preset.seed, u64::MAX / 2, MEASURED);
    let mut sums = [0.0; 4];
    let (mut chunks, mut interacting) = (0.0, 0.0);
    for items in drawn.chunks(CHUNK) {
        let batch = material.batch(items, policy.spec().history, device)?;
        let logits = tch::no_grad(|| policy.forward(&batch.observation, &batch.sentence, false));
        let loss = bc::loss(&logits, &batch.actions, &batch.objects);
        let (actions, objects) = bc::accuracy(&logits, &batch.actions, &batch.objects);
        let any = batch.objects.gt(0).any().int64_value(&[]) as f64;
        let found = [loss.action.double_value(&[]), actions, loss.object.double_value(&[]), objects * any];
        sums.iter_mut().zip(found).for_each(|(sum, value)| *sum += value);
        chunks += 1.0;
        interacting += any;
    }
    if chunks > 0.0 {
        scalars.set("held_out_action_loss", sums[0] / chunks);
        scalars.set("held_out_action_accuracy", sums[1] / chunks);
    }
    if interacting > 0.0 {
        scalars.set("held_out_object_loss", sums[2] / interacting);
        scalars.set("held_out_object_accuracy", sums[3] / interacting);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::features::{Header, Writer};
    use crate::data::items::Label;
    use crate::nets::policy::PolicySpec;

    const FRAMES: u64 = 24;

    fn preset(steps: u64) -> Preset {
        let mut preset = Preset::named("l-bc").unwrap();
        preset.policy = PolicySpec { history: 2, embedding: 3, channels: [4; 4], hidden: vec![32], dropout: 0.1 };
        preset.visual.channels = [2; 4];
        (preset.training.steps, preset.training.batch) = (steps, 16);
        (preset.training.schedule.warmup_steps, preset.training.schedule.learning_rate) = (2, 0.01);
        (preset.save_every, preset.report_every) = (1000, 1000);
        preset
    }

    /// Frames of noise, each with an action of its own; half of them with an object.
    fn features(preset: &Preset) -> Features {
        let folder = tempfile::tempdir().unwrap();
        let numbers = preset.visual.map() as u64;
        let header = Header { format_version: 1, encoder: "e".into(), dataset: "d".into(), maps: FRAMES, numbers };
        tch::manual_seed(4);
        let maps = Tensor::rand([FRAMES as i64, numbers as i64], (Kind::Half, Device::Cpu));
        let mut bytes = vec![0; maps.numel() * 2];
        maps.copy_data_u8(&mut bytes, maps.numel());
        let mut writer = Writer::open(folder.path(), header.clone()).unwrap();
        writer.add(&bytes).unwrap();
        writer.finish().unwrap();
        Features::read(folder.path(), &header).unwrap().unwrap()
    }

    fn items() -> Items {
        let label = |frame: u64| Label { action: (frame % 12) as u8, object: (frame % 2 * (frame % 12)) as u8 };
        let span =
            |text| move |first: u32| Span { trajectory: 0, skills: 0..1, first, start: first, end: first + 6, text };
        Items {
            labels: (0..FRAMES).map(|frame| Some(label(frame))).collect(),
            texts: vec!["one".into(), "two".into()],
            training: (0..8).map(|i| span(i % 2)(i / 2 * 6)).collect(),
            held_out: vec![span(0)(0), span(1)(0)],
            firsts: vec![0, FRAMES as u32],
        }
    }

    /// Notes the last numbers, and pulls the brake after a step.
    struct Watch<'a> {
        stop: &'a AtomicBool,
        stop_after: u64,
        last: Scalars,
    }

    impl Report for Watch<'_> {
        fn step(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
            self.last = scalars.clone();
            self.stop.store(scalars.step == self.stop_after, Ordering::Relaxed);
            Ok(())
        }
    }

    /// Trains, stopping once and going on when `stop_after` says so; the final weights and numbers.
    fn trained(steps: u64, stop_after: u64) -> (Vec<(String, Tensor)>, Scalars) {
        let preset = preset(steps);
        let (features, items) = (features(&preset), items());
        let sentences = Tensor::from_slice2(&[[1.0f32, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let material = Material { items: &items, features: &features, sentences: &sentences };
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("policy.safetensors");
        let stop = AtomicBool::new(false);
        loop {
            tch::manual_seed(1);
            let store = nn::VarStore::new(Device::Cpu);
            let policy = PolicyNet::new(&store.root(), &preset.policy, preset.visual.features());
            let mut watch = Watch { stop: &stop, stop_after, last: Scalars::new("", 0, 0) };
            stop.store(false, Ordering::Relaxed);
            let mut save = |_| Ok(());
            if train((&store, &policy), &material, &preset, &state, &mut watch, &stop, &mut save).unwrap() {
                let mut weights: Vec<(String, Tensor)> = store.variables().into_iter().collect();
                weights.sort_by(|a, b| a.0.cmp(&b.0));
                return (weights, watch.last);
            }
        }
    }

    #[test]
    fn a_few_frames_are_learned_by_heart() {
        let _chance = crate::nets::testing::chance();
        let (_, last) = trained(250, u64::MAX);
        assert!(last.values["held_out_action_accuracy"] > 0.95, "{last:?}");
        assert!(last.values["held_out_object_accuracy"] > 0.95, "{last:?}");
    }

    #[test]
    fn a_training_that_was_stopped_and_resumed_equals_the_uninterrupted_one_to_the_bit() {
        let _chance = crate::nets::testing::chance();
        let (whole, resumed) = (trained(8, u64::MAX).0, trained(8, 3).0);
        assert_eq!(whole.len(), resumed.len());
        for ((name, one), (_, other)) in whole.iter().zip(&resumed) {
            assert_eq!(one, other, "{name}");
        }
    }
}
