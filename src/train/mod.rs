//! Training: presets, data, batches, the trainer, and the jobs that make data and checkpoints.

pub mod batch_sampler;
pub(crate) mod completion_server;
pub mod collect;
pub(crate) mod feature_cache;
pub(crate) mod detection;
pub(crate) mod finetune;
pub(crate) mod frame_store;
pub(crate) mod in_training_eval;
pub(crate) mod memory_agent;
pub(crate) mod http_summarizer;
pub mod metrics;
pub(crate) mod opt_summarizer;
pub(crate) mod model_card;
pub(crate) mod perception_targets;
pub mod preset;
pub(crate) mod pretrain;
pub(crate) mod ranked_chains;
pub(crate) mod relabel;
pub(crate) mod tensorboard;
pub mod trainer;
pub mod training_data;
pub mod training_state;
pub mod update_timing;
pub(crate) mod validation;
pub(crate) mod visual;
