//! Trains the visual encoder on drawn frames of a dataset.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::{Kind, Tensor, nn};

use super::footage::Footage;
use super::presets::Preset;
use super::progress::{Report, Scalars};
use super::sights::{MARKS, Sight};
use crate::algo::learner::Learner;
use crate::domain::Class;
use crate::house::House;
use crate::house::render::Renderer;
use crate::nets::sight_heads::{Known, SightHeads};
use crate::nets::visual::{SIDE, VisualEncoder};

/// Frames on which the encoder is measured while it trains.
const MEASURED: usize = 256;

/// Trains an encoder up to the preset's last step, from where `state` left off if it is there. Returns false when it was stopped;
/// its state is saved then.
///
/// # Errors
/// When a state cannot be read or written, or a frame not be drawn.
pub fn train(
    store: &nn::VarStore,
    encoder: &VisualEncoder,
    footage: &Footage,
    preset: &Preset,
    state: &Path,
    report: &mut dyn Report,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let heads = SightHeads::new(&(store.root() / "heads"), encoder.spec().features(), MARKS as i64);
    let training = &preset.visual_training;
    let mut learner = Learner::new(store, training.optimisation.clone(), preset.seed);
    if state.is_file() {
        learner.resume(state)?;
    }
    let held_out = frames(footage, preset, 0, MEASURED, true);
    while !learner.is_done() {
        if stop.load(Ordering::Relaxed) {
            learner.save(state)?;
            return Ok(false);
        }
        let step = learner.step();
        let (images, known) =
            batch(footage, encoder, &frames(footage, preset, step + 1, training.optimisation.batch, false))?;
        learner.begin_step();
        let loss = heads.loss(&encoder.forward_with(preset.precision, &images, true), &known, training.positive_weight);
        learner.minimise(&loss.total());
        let mut scalars = Scalars::new("visual", learner.step(), training.optimisation.steps);
        if learner.step().is_multiple_of(preset.report_every) || learner.is_done() {
            scalars.add("marks", &loss.marks);
            scalars.add("depth", &loss.depth);
            scalars.add("held", &loss.held);
        }
        if learner.step().is_multiple_of(preset.report_every * 5) || learner.is_done() {
            measure(encoder, &heads, footage, &held_out, &mut scalars)?;
        }
        report.step(&scalars)?;
        if learner.step().is_multiple_of(preset.save_every) || learner.is_done() {
            learner.save(state)?;
        }
    }
    Ok(true)
}

fn measure(
    encoder: &VisualEncoder,
    heads: &SightHeads,
    footage: &Footage,
    held_out: &[usize],
    scalars: &mut Scalars,
) -> anyhow::Result<()> {
    let (images, known) = batch(footage, encoder, held_out)?;
    tch::no_grad(|| {
        let maps = encoder.forward(&images, false);
        for (name, from, to) in [("classes", 0, Class::VOCABULARY), ("possible", Class::VOCABULARY, MARKS - 1)] {
            let [both, holds, told, held] = heads.counts(&maps, &known, from as i64, to as i64);
            scalars.set(&format!("held_out_{name}_recall"), both / holds.max(1.0));
            scalars.set(&format!("held_out_{name}_precision"), both / told.max(1.0));
            scalars.set("held_out_held_accuracy", held / held_out.len().max(1) as f64);
        }
    });
    Ok(())
}

/// The frames of a step: a function of the preset's seed and the step. Held-out trajectories are kept apart.
fn frames(footage: &Footage, preset: &Preset, step: u64, count: usize, held_out: bool) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(preset.seed ^ 0x5157);
    rng.set_stream(step);
    let mut frames = Vec::with_capacity(count);
    let any = preset.hold_out > 1 && footage.trajectories.len() >= preset.hold_out;
    while frames.len() < count {
        let frame = rng.random_range(0..footage.frames());
        if !any || footage.is_held_out(frame, preset.hold_out) == held_out {
            frames.push(frame);
        }
    }
    frames
}

/// Draws frames: what the encoder reads and what is known of them.
fn batch(footage: &Footage, encoder: &VisualEncoder, frames: &[usize]) -> anyhow::Result<(Tensor, Known)> {
    let spec = encoder.spec();
    let draw = |renderer: &mut Renderer, &frame: &usize| -> anyhow::Result<(Vec<u8>, Sight)> {
        let (scene, world) = footage.state(frame)?;
        let frame = renderer.draw(scene, &world);
        Ok((spec.image(frame), Sight::of(scene, &world, frame)))
    };
    let drawn: Vec<(Vec<u8>, Sight)> =
        frames.par_iter().map_init(|| Renderer::new(House::FRAME), draw).collect::<anyhow::Result<_>>()?;
    let n = drawn.len() as i64;
    let (images, sights): (Vec<Vec<u8>>, Vec<Sight>) = drawn.into_iter().unzip();
    let side = encoder.spec().input;
    let held: Vec<i64> = sights.iter().map(|sight| i64::from(sight.held)).collect();
    let gather = |part: fn(&Sight) -> &[u8]| sights.iter().flat_map(part).copied().collect::<Vec<u8>>();
    let depth: Vec<f32> = sights.iter().flat_map(|sight| sight.depth.iter().copied()).collect();
    let device = encoder.device();
    let known = Known {
        marks: Tensor::from_slice(&gather(|sight| &sight.marks))
            .view([n, MARKS as i64, SIDE, SIDE])
            .to_device(device)
            .to_kind(Kind::Float),
        depth: Tensor::from_slice(&depth).view([n, 1, SIDE, SIDE]).to_device(device),
        held: Tensor::from_slice(&held).to_device(device),
    };
    Ok((Tensor::from_slice(&images.concat()).view([n, 3, side, side]), known))
}

/// Footage for tests.
#[cfg(test)]
pub mod testing {
    use super::*;
    use crate::data::dataset::{Dataset, Manifest};
    use crate::domain::task::SceneRef;
    use crate::domain::{Action, ActionType, Trajectory};
    use crate::house::testing::kitchen;

    /// Two turns around in the test kitchen.
    pub fn footage() -> Footage {
        let folder = tempfile::tempdir().unwrap();
        let (scene, start) = kitchen();
        let mut writer = crate::data::dataset::Writer::new(folder.path()).unwrap();
        writer.scene(&scene).unwrap();
        for (id, turn) in [("left", ActionType::RotateLeft), ("right", ActionType::RotateRight)] {
            let trajectory = Trajectory {
                id: id.into(),
                split: "train".into(),
                scene: SceneRef::Named(scene.name.clone()),
                start: start.clone(),
                actions: vec![Action::navigate(turn); 4],
                roles: Vec::new(),
                skills: Vec::new(),
                skill_starts: Vec::new(),
                goal: None,
                annotations: Vec::new(),
                boxes: Vec::new(),
                choices: Vec::new(),
            };
            writer.trajectory(&trajectory).unwrap();
        }
        let manifest = Manifest {
            format_version: Manifest::FORMAT,
            source: "test".into(),
            counts: Default::default(),
            scenes: 1,
            held_out: Vec::new(),
            skipped: Vec::new(),
        };
        writer.finish(&manifest).unwrap();
        Footage::open(&[Dataset::open(folder.path()).unwrap()]).unwrap()
    }

    /// Notes what is reported.
    pub struct Notes(pub Vec<Scalars>);

    impl Report for Notes {
        fn step(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
            self.0.push(scalars.clone());
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::testing::{Notes, footage};
    use super::*;
    use crate::nets::precision::Precision;
    use tch::Device;

    #[test]
    fn the_encoder_learns_what_a_few_frames_show() {
        let _chance = crate::nets::testing::chance();
        let footage = footage();
        assert_eq!(footage.frames(), 10);
        let mut preset = Preset::named("l-bc").unwrap();
        preset.visual.channels = vec![4, 4, 8, 16];
        preset.visual_training.optimisation.batch = 8;
        preset.visual_training.optimisation.schedule.warmup_steps = 2;
        (preset.report_every, preset.save_every) = (1, 100);
        let mut losses = |precision, steps| -> Vec<f64> {
            preset.precision = precision;
            preset.visual_training.optimisation.steps = steps;
            tch::manual_seed(2);
            let store = nn::VarStore::new(Device::Cpu);
            let encoder = VisualEncoder::new(&(store.root() / "encoder"), &preset.visual);
            let folder = tempfile::tempdir().unwrap();
            let (state, stop) = (folder.path().join("visual.safetensors"), AtomicBool::new(false));
            let mut notes = Notes(Vec::new());
            assert!(train(&store, &encoder, &footage, &preset, &state, &mut notes, &stop).unwrap());
            notes.0.iter().map(|scalars| scalars.values["marks"]).collect()
        };
        let (full, mixed) = (losses(Precision::Full, 90), losses(Precision::Mixed, 2));
        assert!(full[89] < 0.5 * full[0], "{} then {}", full[0], full[89]);
        assert!(mixed[0] != full[0] && (mixed[0] - full[0]).abs() < 0.01 * full[0], "{} and {}", mixed[0], full[0]);
        assert!(mixed[1].is_finite());
    }
}
