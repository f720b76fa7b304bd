//! What a scene does not need: the set of active cells.

mod cell_set;

pub use cell_set::CellSet;
