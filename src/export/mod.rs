//! Export of frames and series to files, which appear at their paths only when they are complete.

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
mod written;
mod xml;

pub use stored::StoredSeries;
pub use written::Written;
