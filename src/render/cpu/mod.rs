//! Renderers on the CPU.

pub mod raycast;
