//! Frames and series written to files. What is written appears in its place only when it is complete.

pub mod annotate;
mod folder;
pub mod movie;
pub mod sequence;
pub mod still;
mod stored;
pub mod vtu;

pub use stored::StoredSeries;
