//! Renderers on the CPU.

mod grid;
pub mod havs;
mod raster;
mod ray;
pub mod raycast;
mod tiles;
mod visible;
