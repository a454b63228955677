//! Networks: weights files, sentence encoders, the visual encoder, policy and critic, and where they compute.

pub(crate) mod chooser;
pub(crate) mod completion_server;
pub(crate) mod critic;
pub(crate) mod detector;
pub mod device;
pub mod embedding_cache;
pub(crate) mod episodic;
pub(crate) mod film;
pub(crate) mod frozen;
pub(crate) mod home;
pub(crate) mod language_model;
pub(crate) mod macro_critic;
pub(crate) mod perception_heads;
pub(crate) mod policy;
pub(crate) mod precision;
pub(crate) mod resize;
pub mod resnet18;
pub mod sentence;
pub(crate) mod shared_rows;
pub(crate) mod size_differences;
#[cfg(test)]
pub(crate) mod testing;
pub(crate) mod trunk;
pub(crate) mod value;
pub(crate) mod visual;
pub mod visual_encoder;
pub mod weights;
mod weights_error;

mod bert;
mod bounds;
mod encoder_settings;
mod encoder_stack;
mod mpnet;
mod opt;
mod opt_config;
mod opt_tokenizer;
mod opt_weights;
mod padded_batch;
mod pooling;
mod sampling;
mod transformer;
mod transformer_config;
