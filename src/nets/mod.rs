//! Networks: weights files, sentence encoders, the visual encoder, policy and critic, and where they compute.

pub mod visual_encoder;
pub mod perception_heads;
pub mod resize;
pub mod device;
pub mod home;
pub mod weights;

pub mod embedding_cache;
pub mod sentence;

pub mod critic;
pub mod episodic;
pub mod film;
pub mod frozen;
pub mod policy;
pub mod precision;
pub mod resnet18;
pub mod trunk;
pub mod value;
pub mod visual;

mod bert;
mod bounds;
mod encoder_stack;
mod mpnet;
mod pooling;
mod transformer;
#[cfg(test)]
pub mod testing;
