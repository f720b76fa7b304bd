//! Frames and series written to files. What is written appears in its place only when it is complete.

pub mod annotate;
mod appended;
mod collection;
mod folder;
pub mod movie;
mod numbered;
pub mod run;
pub mod sequence;
pub mod still;
mod stored;
pub mod surface;
pub mod vtu;
mod xml;

pub use stored::StoredSeries;
