//! Policies that were exported to one file, ONNX or TorchScript, with a description beside it.

mod answer;
mod format;
mod frame_stack;
mod house;
mod inputs;
mod model;
mod onnx;
mod remote;
mod policy;
pub(crate) mod spec;
mod torchscript;

#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

pub(crate) use format::Format;
pub(crate) use frame_stack::FrameStack;
pub(crate) use policy::{ExportedPolicy, hash};
