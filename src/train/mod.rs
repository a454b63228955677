//! Training: presets, data, batches, the trainer, and the jobs that make data and checkpoints.

pub mod batch_sampler;
pub mod collect;
pub mod feature_cache;
pub mod frame_store;
pub mod in_training_eval;
pub mod metrics;
pub mod model_card;
pub mod perception_targets;
pub mod preset;
pub mod pretrain;
pub mod relabel;
pub mod tensorboard;
pub mod trainer;
pub mod training_data;
pub mod training_state;
pub mod validation;
pub mod visual;
