//! Renderers on the CPU.

mod prepared;
mod ray;
pub mod raycast;
mod tiles;
