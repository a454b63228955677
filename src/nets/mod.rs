//! Networks: weights files, sentence encoders, and where they compute.

pub mod device;
pub mod home;
pub mod sentence;
