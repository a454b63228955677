//! Trains the visual encoder to predict perception targets of drawn frames.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::ensure;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::{Kind, Tensor, nn};

use super::frame_store::FrameStore;
use super::metrics::{ProgressLogger, Scalars};
use super::perception_targets::{CELL_LABELS, PerceptionTargets};
use super::preset::Preset;
use super::training_state::TrainingState;
use crate::algo::learner::Learner;
use crate::domain::Class;
use crate::house::House;
use crate::house::render::Renderer;
use crate::nets::perception_heads::{FrameLabels, PerceptionHeads};
use crate::nets::visual::{HouseEncoder, SIDE};

/// Frames on which the encoder is measured while it trains.
const MEASURED: usize = 256;

/// Trains an encoder up to the preset's last step, from where `state` left off if it is there. Returns false when it was stopped;
/// its state is saved then.
///
/// # Errors
/// When a state cannot be read or written, or a frame not be drawn.
pub(crate) fn train(
    store: &nn::VarStore,
    encoder: &HouseEncoder,
    frame_store: &FrameStore,
    preset: &Preset,
    state: TrainingState<'_>,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let heads = PerceptionHeads::new(&(store.root() / "heads"), encoder.spec().features(), CELL_LABELS as i64);
    let training = &preset.visual_encoder_training;
    let mut learner = Learner::new(store, training.optimisation.clone(), preset.seed);
    if let Some((step, tensors)) = state.read()? {
        learner.restore_checked(state.path, step, &tensors)?;
    }
    let apart = frame_store.kept_apart_with(preset.hold_out, &preset.withheld_scenes)?;
    ensure!(apart.contains(&false), "there is nothing to learn from: every trajectory is held out");
    let drawn = |step, count, held_out| {
        frames(frame_store, preset.seed, step, count, &|frame| apart[frame_store.trajectory_of(frame)] == held_out)
    };
    let held_out = if apart.contains(&true) { drawn(0, MEASURED, true) } else { Vec::new() };
    while !learner.is_done() {
        if stop.load(Ordering::Relaxed) {
            state.write(learner.step(), &learner.state())?;
            return Ok(false);
        }
        let (images, targets) =
            batch(frame_store, encoder, &drawn(learner.step() + 1, training.optimisation.batch_size, false))?;
        learner.begin_step();
        let loss =
            heads.loss(&encoder.forward_with(preset.precision, &images, true), &targets, training.positive_weight);
        learner.minimise(&loss.total());
        let mut scalars = Scalars::new("visual_encoder", learner.step(), training.optimisation.steps);
        if learner.step().is_multiple_of(preset.report_every) || learner.is_done() {
            scalars.add("cell_label_loss", &loss.cell_labels);
            scalars.add("depth_loss", &loss.depth);
            scalars.add("held_object_loss", &loss.held);
        }
        if (learner.step().is_multiple_of(preset.report_every * 5) || learner.is_done()) && !held_out.is_empty() {
            measure(encoder, &heads, frame_store, &held_out, &mut scalars)?;
        }
        logger.log(&scalars)?;
        if learner.step().is_multiple_of(preset.save_every) || learner.is_done() {
            state.write(learner.step(), &learner.state())?;
        }
    }
    Ok(true)
}

fn measure(
    encoder: &HouseEncoder,
    heads: &PerceptionHeads,
    frame_store: &FrameStore,
    held_out: &[usize],
    scalars: &mut Scalars,
) -> anyhow::Result<()> {
    let (images, targets) = batch(frame_store, encoder, held_out)?;
    tch::no_grad(|| {
        let maps = encoder.forward(&images, false);
        for (name, from, to) in [("class", 0, Class::VOCABULARY), ("affordance", Class::VOCABULARY, CELL_LABELS - 1)] {
            let [true_positives, positives, predicted, held] = heads.counts(&maps, &targets, from as i64, to as i64);
            scalars.set(&format!("held_out_{name}_recall"), true_positives / positives.max(1.0));
            scalars.set(&format!("held_out_{name}_precision"), true_positives / predicted.max(1.0));
            scalars.set("held_out_held_object_accuracy", held / held_out.len().max(1) as f64);
        }
    });
    Ok(())
}

/// The frames of a step, of those that are wanted: a function of the seed and the step. There has to be one.
fn frames(frame_store: &FrameStore, seed: u64, step: u64, count: usize, wanted: &dyn Fn(usize) -> bool) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5157);
    rng.set_stream(step);
    std::iter::repeat_with(|| rng.random_range(0..frame_store.frames()))
        .filter(|&frame| wanted(frame))
        .take(count)
        .collect()
}

/// Draws frames: images [n, 3, side, side] of bytes, and the perception targets.
fn batch(frame_store: &FrameStore, encoder: &HouseEncoder, frames: &[usize]) -> anyhow::Result<(Tensor, FrameLabels)> {
    let spec = encoder.spec();
    let draw = |renderer: &mut Renderer, &frame: &usize| -> anyhow::Result<(Vec<u8>, PerceptionTargets)> {
        let (scene, world) = frame_store.state(frame)?;
        let frame = renderer.draw(scene, &world);
        Ok((spec.image(frame), PerceptionTargets::of(scene, &world, frame)))
    };
    let drawn: Vec<(Vec<u8>, PerceptionTargets)> =
        frames.par_iter().map_init(|| Renderer::new(House::FRAME), draw).collect::<anyhow::Result<_>>()?;
    let n = drawn.len() as i64;
    let (images, each): (Vec<Vec<u8>>, Vec<PerceptionTargets>) = drawn.into_iter().unzip();
    let side = encoder.spec().image_size;
    let held: Vec<i64> = each.iter().map(|target| i64::from(target.held)).collect();
    let gather = |part: fn(&PerceptionTargets) -> &[u8]| each.iter().flat_map(part).copied().collect::<Vec<u8>>();
    let depth: Vec<f32> = each.iter().flat_map(|target| target.depth.iter().copied()).collect();
    let device = encoder.device();
    let targets = FrameLabels {
        cell_labels: Tensor::from_slice(&gather(|target| &target.cell_labels))
            .view([n, CELL_LABELS as i64, SIDE, SIDE])
            .to_device(device)
            .to_kind(Kind::Float),
        depth: Tensor::from_slice(&depth).view([n, 1, SIDE, SIDE]).to_device(device),
        held: Tensor::from_slice(&held).to_device(device),
    };
    Ok((Tensor::from_slice(&images.concat()).view([n, 3, side, side]), targets))
}

/// A small frame store for tests.
#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use crate::data::dataset;
    use crate::data::dataset::Dataset;
    use crate::domain::{Action, ActionType, Trajectory, trajectory};
    use crate::house::testing::kitchen;

    /// Two turns around in the test kitchen.
    pub(crate) fn frame_store() -> FrameStore {
        let folder = tempfile::tempdir().unwrap();
        let (scene, start) = kitchen();
        let mut writer = crate::data::dataset::DatasetWriter::new(folder.path()).unwrap();
        writer.scene(&scene).unwrap();
        for (id, turn) in [("left", ActionType::RotateLeft), ("right", ActionType::RotateRight)] {
            let trajectory = Trajectory {
                start: start.clone(),
                actions: vec![Action::navigate(turn); 4],
                ..trajectory::testing::empty(id, &scene.name)
            };
            writer.trajectory(&trajectory).unwrap();
        }
        writer.finish(&dataset::testing::manifest(1, &[])).unwrap();
        FrameStore::open(&[Dataset::open(folder.path()).unwrap()]).unwrap()
    }

    /// Records what is reported.
    pub(crate) struct RecordedScalars(pub(crate) Vec<Scalars>);

    impl ProgressLogger for RecordedScalars {
        fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
            self.0.push(scalars.clone());
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::testing::{RecordedScalars, frame_store};
    use super::*;
    use crate::nets::precision::Precision;
    use tch::Device;

    #[test]
    fn the_encoder_learns_what_a_few_frames_show() {
        let _chance = crate::nets::testing::chance();
        let frame_store = frame_store();
        assert_eq!(frame_store.frames(), 10);
        let mut preset = Preset::named("l-bc").unwrap();
        preset.visual_encoder.channels = vec![4, 4, 8, 16];
        preset.visual_encoder_training.optimisation.batch_size = 8;
        preset.visual_encoder_training.optimisation.schedule.warmup_steps = 2;
        (preset.report_every, preset.save_every) = (1, 100);
        let mut losses = |precision, steps| -> Vec<f64> {
            preset.precision = precision;
            preset.visual_encoder_training.optimisation.steps = steps;
            tch::manual_seed(2);
            let store = nn::VarStore::new(Device::Cpu);
            let encoder = HouseEncoder::new(&(store.root() / "encoder"), &preset.visual_encoder);
            let folder = tempfile::tempdir().unwrap();
            let (path, stop) = (folder.path().join("visual.safetensors"), AtomicBool::new(false));
            let state = TrainingState { path: &path, identity: &BTreeMap::new() };
            let mut recorded = RecordedScalars(Vec::new());
            assert!(train(&store, &encoder, &frame_store, &preset, state, &mut recorded, &stop).unwrap());
            recorded.0.iter().map(|scalars| scalars.values["cell_label_loss"]).collect()
        };
        let (full, mixed) = (losses(Precision::Full, 90), losses(Precision::Mixed, 2));
        assert!(full[89] < 0.5 * full[0], "{} then {}", full[0], full[89]);
        assert!(mixed[0] != full[0] && (mixed[0] - full[0]).abs() < 0.01 * full[0], "{} and {}", mixed[0], full[0]);
        assert!(mixed[1].is_finite());
    }
}
