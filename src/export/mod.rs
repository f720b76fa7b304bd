//! Frames and series written to files. What is written appears in its place only when it is complete.

mod folder;
pub mod sequence;
mod stored;
pub mod vtu;

pub use stored::StoredSeries;
