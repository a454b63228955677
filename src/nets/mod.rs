//! Networks: weights files, sentence encoders, the visual encoder, policy and critic, and where they compute.

pub mod critic;
pub mod device;
pub mod embedding_cache;
pub mod episodic;
pub mod film;
pub mod frozen;
pub mod home;
pub mod perception_heads;
pub mod policy;
pub mod precision;
pub mod resize;
pub mod resnet18;
pub mod sentence;
#[cfg(test)]
pub mod testing;
pub mod trunk;
pub mod value;
pub mod visual;
pub mod visual_encoder;
pub mod weights;

mod bert;
mod bounds;
mod encoder_stack;
mod mpnet;
mod pooling;
mod transformer;
mod transformer_config;
