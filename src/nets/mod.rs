//! Nets: what is learned or loaded as weights. `tch` starts here.

pub mod film;
pub mod policy;
pub mod shrink;
pub mod visual;
pub mod weights;
