//! Networks: weights files, sentence encoders, and where they compute.

pub mod device;
pub mod home;
pub mod weights;

pub mod embedding_cache;
pub mod sentence;

mod bert;
mod encoder_stack;
mod mpnet;
mod pooling;
mod transformer;
