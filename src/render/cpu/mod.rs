//! Renderers on the CPU.

pub mod havs;
mod joint;
mod raster;
mod ray;
pub mod raycast;
mod tiles;
mod visible;
