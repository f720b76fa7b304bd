//! Frames and series written to files. What is written appears in its place only when it is complete.

pub mod annotate;
mod folder;
pub mod movie;
pub mod sequence;
pub mod still;
pub mod vtu;
