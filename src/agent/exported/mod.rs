//! Policies that were exported to one file, ONNX or TorchScript, with a description beside it.

mod answer;
mod frame_stack;
mod house;
mod inputs;
mod model;
mod onnx;
mod own;
mod policy;
pub(crate) mod spec;
mod torchscript;

#[cfg(test)]
mod tests;

pub(crate) use frame_stack::FrameStack;
pub(crate) use model::Format;
pub(crate) use policy::ExportedPolicy;
