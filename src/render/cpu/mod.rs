//! Renderers on the CPU.

pub mod havs;
mod prepared;
mod ray;
pub mod raycast;
mod tiles;
