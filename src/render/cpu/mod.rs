//! Renderers on the CPU.

pub mod havs;
mod prepared;
mod raster;
mod ray;
pub mod raycast;
mod tiles;
