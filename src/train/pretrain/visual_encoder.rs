//! The visual stage: the House encoder learns from drawn frames; ResNet-18 and another checkpoint's encoder stay as they are.

use std::sync::atomic::AtomicBool;

use tch::nn::VarStore;

use super::checkpoint_config::visual_identity;
use super::demonstrations::Demonstrations;
use super::spec::Pretraining;
use crate::nets::visual::HouseEncoder;
use crate::nets::visual_encoder::VisualEncoder;
use crate::nets::weights;
use crate::train::metrics::ProgressLogger;
use crate::train::training_state::TrainingState;
use crate::train::visual;

/// Trains `encoder`, where it is to be trained; false when it was stopped.
pub(super) fn train(
    spec: &Pretraining,
    demonstrations: &Demonstrations,
    encoder: &VisualEncoder,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let (VisualEncoder::House { store: own, .. }, None) = (encoder, &spec.visual_from) else {
        return Ok(true);
    };
    let path = spec.training_folder().join("visual.safetensors");
    let state = TrainingState { path: &path, identity: &visual_identity(spec, &demonstrations.digest()) };
    // The perception heads live in the trained store too, so the encoder is copied out of it.
    let mut store = VarStore::new(spec.device);
    let trained = HouseEncoder::new(&(store.root() / "encoder"), &spec.preset.visual_encoder);
    let finished = visual::train(&store, &trained, &demonstrations.frame_store, &spec.preset, state, logger, stop)?;
    store.freeze();
    weights::copy(&store.variables().into_iter().collect(), "encoder.", own)?;
    Ok(finished)
}
